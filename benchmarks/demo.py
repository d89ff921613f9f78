"""Is the demo's surface what it should be: closed, whole, of the right volume, near the exact one."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

import trimesh

from bench import at_most, header, holds, note
from tomomesh import Settings, phantom, reconstruct, write_mesh

if TYPE_CHECKING:
    from tomomesh.head_phantom import Phantom
    from tomomesh.results import Surface


def main() -> None:
    header("The built-in head", "trimesh")
    head = phantom()
    default = _run(head, Settings())
    _judge("defaults", default)
    truth = default.report["truth"]
    at_most("defaults: mean distance to the exact surface", truth["mean_mm"], 0.15, "mm")
    at_most("defaults: 95 % of the distances", truth["p95_mm"], 0.35, "mm")
    at_most("defaults: mean distance from the exact surface", truth["back_mean_mm"], 0.15, "mm")
    at_most("defaults: 95 % of these", truth["back_p95_mm"], 0.35, "mm")
    note("defaults: neurons of a ring", str(default.report["networks"]["neurons"]))
    at_most("defaults: steps of the fit", default.report["fit"]["iterations"], 30)
    holds("defaults: at rest", default.report["fit"]["converged"])
    at_most("defaults: volume off the rings' volume", _volume_error(default), 10, "%")
    for neurons in (58, 200):
        finer = _with(head, neurons)
        at_most(f"{neurons} neurons: mean distance to the exact surface", finer["mean_mm"], 0.15, "mm")
        at_most(f"{neurons} neurons: 95 % of the distances", finer["p95_mm"], 0.35, "mm")
    near = _run(head, Settings().replace(attraction="nearest")).report["truth"]
    note("--attraction nearest: distance to the exact surface, mean and 95 %", _both(near))
    paper = _run(head, Settings.for_paper())
    _judge("--paper", paper)
    note("--paper: distance to the exact surface, mean and 95 %", _both(paper.report["truth"]))
    note("--paper: steps of the fit", str(paper.report["fit"]["iterations"]))
    note("--paper: volume off the rings' volume", f"{_volume_error(paper):.2g} %")
    note("--paper: vertices", f"{len(paper.mesh.vertices):,}")
    wide = _run(head, Settings.for_paper().replace(cell_from="adjacent", allow_far=True))
    note("--paper --cell-from adjacent: distance, mean and 95 %", _both(wide.report["truth"]))
    note("--paper --cell-from adjacent: vertices", f"{len(wide.mesh.vertices):,}")


def _run(head: Phantom, settings: Settings) -> Surface:
    return reconstruct(head.volume, settings, truth=head.truth, lower=head.lower, upper=head.upper)


def _judge(name: str, surface: Surface) -> None:
    """Let another reader weld the written file and look at it."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "mesh.stl"
        write_mesh(surface.mesh, path)
        mesh = trimesh.load_mesh(path)
    holds(f"{name}: closed and manifold after welding", mesh.is_watertight and mesh.is_winding_consistent)
    holds(f"{name}: manifold at every vertex too", surface.report["quality"]["sound_after_welding"])
    holds(f"{name}: one component of genus 0", mesh.body_count == 1 and mesh.euler_number == 2)


def _with(head: Phantom, neurons: int) -> dict[str, float]:
    surface = _run(head, Settings().replace(neurons=neurons))
    _judge(f"{neurons} neurons", surface)
    truth: dict[str, float] = surface.report["truth"]
    return truth


def _both(truth: dict[str, float]) -> str:
    return f"{truth['mean_mm']:.3f} mm, {truth['p95_mm']:.3f} mm"


def _volume_error(surface: Surface) -> float:
    return 100 * abs(float(surface.report["quality"]["volume_over_rings"]) - 1)


if __name__ == "__main__":
    main()
