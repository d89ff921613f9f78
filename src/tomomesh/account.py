"""Keep the account of a run: what each stage found, and how long it took."""

from __future__ import annotations

import platform
import time
from contextlib import contextmanager
from functools import cache, partial
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

import numpy as np

from .measure.report import assess, compare
from .measure.rings import assess_contours
from .model.points import BRIDGE, CAP, NEURON
from .progress import Progress, silent
from .segment.som.schedules import schedule_warning

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from numpy.typing import NDArray

    from .model.contours import Contours
    from .model.mesh import TriMesh
    from .model.networks import Networks, SpaceNetwork
    from .model.points import PointSet
    from .model.trace import Trace
    from .model.volume import Volume
    from .segment.chosen import Chosen
    from .segment.sample import Sampling
    from .segment.window import Limit
    from .settings import Settings
    from .surface.contours import ContourSurface
    from .surface.drape import Draped
    from .surface.holding import Held
    from .surface.samples import Samples
    from .surface.slices import Slices
    from .surface.voxels import Boundary, VoxelSurface

SECTIONS = (
    "study", "window", "networks", "rings", "points", "cubes", "surface", "fit", "quality", "print", "truth", "timings",
    "settings", "versions", "warnings",
)  # fmt: skip
ORDER = (*SECTIONS[: SECTIONS.index("surface")], "stack", "voxels", "space", *SECTIONS[SECTIONS.index("surface") :])
"""The same, and what stands in place of cubes: the stack of contours, the voxels, and the network in space."""
LEFT_OUT = 0.01
"""Share of the window in small pieces over which a network in space is warned of."""
DRAWN = 0.9
"""Share of the vertices that must have a point near them, else a result is warned of."""
PLAUSIBLE = 0.15
"""Difference from the volume of the rings over which a result is warned of."""
STRAYS = 0.05
"""Share of strays among the points over which a result is warned of."""
WIDE = 3
"""Closing over which a result is warned of, cubes."""
CROWDED = 0.25
"""Share of the slices with several components side by side over which one network a slice is warned of."""
HOLES = 0.15
"""Area of the holes in the slices over that of the window from which an outline that fills them is warned of."""
FAR = 2.0
"""Distance of the surface from one point in twenty, slice distances, from which a result is warned of."""
FILLED = 0.05
"""Share of filled faces over which a result is warned of."""
APART = 1.5
"""Distance of two slices of a stack of contours, in median ones, over which a result is warned of."""
PACKAGES = ("tomomesh", "numpy", "scipy", "numba")


class Account:
    """The report in the making; one method a section, each documented key by key in docs/report.md."""

    def __init__(self, settings: Settings) -> None:
        self._settings = settings
        self._sections: dict[str, dict[str, Any]] = {}
        self._timings: dict[str, float] = {}
        self._warnings: list[str] = []
        self._measure: Callable[[], dict[str, Any]] | None = None
        self._judge: Callable[[], dict[str, Any]] | None = None
        self._rings_mm3 = 0.0

    @contextmanager
    def timed(self, stage: str) -> Iterator[None]:
        """Measure a stage."""
        start = time.perf_counter()
        yield
        self._timings[f"{stage}_s"] = self._timings.get(f"{stage}_s", 0.0) + time.perf_counter() - start

    def warn(self, message: str) -> None:
        """Note what a reader of the result must know."""
        self._warnings.append(message)

    @property
    def cell_mm(self) -> float:
        """The smallest edge of the cubes."""
        return float(min(self._sections["cubes"]["cell_mm"]))

    def study(self, volume: Volume, plane: str) -> None:
        """Note what the slices are."""
        self._sections["study"] = {
            "slices": volume.shape[0],
            "rows": volume.shape[1],
            "columns": volume.shape[2],
            "plane": plane,
            "column_spacing_mm": volume.spacing_mm[0],
            "row_spacing_mm": volume.spacing_mm[1],
            "slice_spacing_mm": volume.spacing_mm[2],
            "gray_unit": volume.unit,
            "notes": list(volume.notes),
        }

    def cropped(self, box: tuple[slice, ...], sizes: tuple[int, int, int]) -> None:
        """Note which slices, rows and columns of the whole study are left, where it was cropped."""
        kept = [[int(side.start), int(side.stop) - 1] for side in box]
        cropped = kept != [[0, size - 1] for size in sizes]
        names = ("slices", "rows", "columns")
        self._sections["study"]["part"] = dict(zip(names, kept, strict=True)) if cropped else None

    def notes(self, notes: tuple[str, ...]) -> None:
        """Note what was decided on a label map beside the study."""
        self._sections["study"]["notes"] += notes

    def window(self, chosen: Chosen) -> None:
        """Note what the window kept, the limits of its layers, and the components that were left out."""
        asked, mask, layers = self._settings.window, chosen.mask, chosen.volume.layers
        limits = (chosen.lower, chosen.upper) if asked.select is None else (-np.inf, np.inf)
        given = asked.lower is not None or asked.upper is not None
        edges = [np.take(mask, end, axis=axis).any() for axis in range(3) for end in (0, -1)]
        self._sections["window"] = {
            "lower": _limits(limits[0]),
            "upper": _limits(limits[1]),
            "layers": layers,
            "joined_by": asked.layers if layers > 1 else None,
            "chosen_by": "labels" if asked.select else "preset" if asked.preset else "given" if given else "otsu",
            "voxels": int(mask.sum()),
            "share": float(mask.mean()),
            "touches_border": bool(any(edges)),
            "components": chosen.found or None,
            "dropped_components": chosen.dropped,
            "dropped_voxels": chosen.dropped_voxels,
        }
        if chosen.dropped and asked.keep == "auto":
            self._sections["study"]["notes"].append(
                f"{chosen.dropped} of {chosen.found} components of the window ({chosen.dropped_voxels} voxels) were "
                "left out, which lie in nothing that is 12 mm thick, as a scanner's table: --keep all keeps them"
            )
        if any(edges[2:]):
            self.warn("the window touches the border of the slices: the surface is closed along it")

    def networks(self, networks: Networks, mask: NDArray[np.bool_]) -> None:
        """Note what was trained, and which slices could not be."""
        if warning := schedule_warning(self._settings.network):
            self.warn(warning)
        signal = "boundary" if networks.outlined else "region"
        self._networks(
            networks.slices,
            mask,
            networks.lattice.name,
            len(networks.lattice),
            signal,
            networks.pixels,
            networks.strays,
        )
        self._lines(networks.lines, closed=networks.lattice.name == "ring")

    def contours(self, contours: Contours, mask: NDArray[np.bool_]) -> None:
        """Note the contours that were trained, and which slices have none."""
        each = contours.contours
        seen = {"boundary" if one.outlined else "region" for one in each}
        pixels, strays = (np.array([getattr(one, name) for one in each]) for name in ("pixels", "strays"))
        neurons = self._settings.network.neuron_count
        self._networks(contours.slices, mask, "ring", neurons, seen.pop() if len(seen) == 1 else "both", pixels, strays)
        self._lines(contours)
        crossings = self._sections["rings"]["crossings"]
        if crossings:
            self.warn(f"contours of a slice cross each other {crossings} time(s): more --neurons keep them apart")

    def crowded(self, slices: int, trained: int) -> None:
        """Warn of one network where many slices hold several components side by side."""
        if slices > CROWDED * trained:
            self.warn(
                f"{slices} slices hold several components side by side: --contours components has a ring for each"
            )

    def filled_holes(self, share: float) -> None:
        """Warn of outlines that fill much that is not in the window."""
        if share > HOLES:
            self.warn(f"holes of {share:.0%} of the window's area are filled: --contours loops follows them too")

    def _lines(self, contours: Contours, *, closed: bool = True) -> None:
        if len(contours):
            self._sections["rings"] = assess_contours(contours, self._pixel_mm, closed=closed)

    @property
    def _pixel_mm(self) -> tuple[float, float]:
        study = self._sections["study"]
        return study["column_spacing_mm"], study["row_spacing_mm"]

    def _networks(
        self, slices: NDArray[np.int32], mask: NDArray[np.bool_], topology: str, neurons: int, signal: str,
        pixels: NDArray[np.int64], strays: NDArray[np.int64],
    ) -> None:  # fmt: skip
        without = np.setdiff1d(np.arange(len(mask)), slices)
        self._sections["networks"] = {
            "topology": topology,
            "neurons": neurons,
            "trained": len(slices),
            "signal": signal,
            "pixels": int(pixels.sum()),
            "strays": int(strays.sum()),
            "slices_without": without.tolist(),
        }
        inside = (without > slices[0]) & (without < slices[-1])
        missed = without[inside | mask[without].any(axis=(1, 2))]
        if len(missed):
            named = ", ".join(map(str, missed[:8])) + (", ..." if len(missed) > 8 else "")
            self.warn(f"{len(missed)} slice(s) without pixels enough for a network: {named}")

    def space(self, network: SpaceNetwork, pieces: int, dropped: int) -> None:
        """Note the one network in space, and what of the window it does not stand for."""
        self._sections["networks"] = {
            "topology": network.lattice.name,
            "neurons": len(network.lattice),
            "trained": 1,
            "signal": "boundary" if network.outlined else "region",
            "pixels": network.inputs,
            "strays": network.strays,
            "slices_without": [],
        }
        self._sections["space"] = {"pieces": pieces, "dropped_voxels": dropped}
        voxels = self._sections["window"]["voxels"]
        if pieces > 1:
            self.warn(f"the window is in {pieces} pieces, and one network spans them all")
        if dropped > LEFT_OUT * voxels:
            self.warn(f"{dropped} of {voxels} voxels of the window lie in small pieces, and were left out")

    def faces(self, network: TriMesh, squares: int, untangled: int) -> None:
        """Note the faces of a network in space, and the finer squares that they were divided into."""
        self._sections["space"] |= {"faces": len(network.faces), "untangled": untangled}
        self._sections["surface"] = {
            "found": 1,
            "cavities": 0,
            "taken": 1,
            "debris": 0,
            "square_faces": squares,
            "enclosed_cubes": 0,
        }

    def rested(self, trace: Trace, vertices: int, taken_back: int, filled: NDArray[np.bool_]) -> None:
        """Note how a network's own faces came to rest, and where there was nothing to rest on."""
        self.fit(trace, vertices, 0)
        self._sections["fit"] |= {"taken_back": taken_back, "filled_faces": int(filled.sum())}
        if not len(trace.speed):
            self._sections["fit"]["converged"] = True

    def points(self, points: PointSet, spacing: float, bridged: int = 0) -> None:
        """Note how many points there are and how far apart."""
        self._sections["points"] = {
            "unit": "mm" if "study" in self._sections else self._settings.run.units,
            "count": len(points),
            "measured": int((points.kinds == NEURON).sum()),
            "on_bridges": int((points.kinds == BRIDGE).sum()),
            "on_caps": int((points.kinds == CAP).sum()),
            "bridged_gaps": bridged,
            "spacing_mm": spacing,
        }

    @property
    def cavities(self) -> int:
        """The surfaces taken that line a cavity."""
        return int(self._sections["surface"]["cavities"])

    def cloud(self, cloud: PointSet, lowest: NDArray[np.float64]) -> None:
        """Note where the lowest corner of a cloud is, and what its reader says of it."""
        known = {"origin": lowest.tolist(), "frame": cloud.frame, "notes": list(cloud.notes)}
        self._sections["points"] |= known

    def samples(self, count: int, samples: Samples) -> None:
        """Note how far apart the points of a cloud are, how noisy, and how many are strays."""
        spacing, noise = float(np.median(samples.spacing)), float(np.median(samples.noise))
        self._sections["points"] = {
            "unit": self._settings.run.units,
            "count": count,
            "distinct": len(samples.positions) + samples.strays,
            "strays": samples.strays,
            "spacing_mm": spacing,
            "spacing_p5_mm": float(np.percentile(samples.spacing, 5)),
            "spacing_p95_mm": float(np.percentile(samples.spacing, 95)),
            "noise_mm": noise,
            "noise_p95_mm": float(np.percentile(samples.noise, 95)),
        }
        if samples.strays > STRAYS * count:
            self.warn(f"{samples.strays} of {count} points are strays, and were left out")

    def held(
        self, held: Held, taken: NDArray[np.bool_], cell: NDArray[np.float64], cubes: int, bridged: int = 0
    ) -> None:
        """Note the cubes, the closing that made them hold, and which surfaces were taken."""
        shell, walls = held.shell, held.walls
        self._sections["cubes"] = {
            "cell_mm": cell.tolist(),
            "occupied": cubes,
            "bridge_places": bridged,
            "closing": shell.closing,
            "added_for_composition": shell.added,
            "two_sided": held.two_sided,
            "holds": held.holds,
        }
        self._sections["surface"] = {
            "found": walls.count,
            "cavities": int((walls.inward & taken).sum()),
            "taken": int(taken.sum()),
            "debris": int(walls.debris.sum()),
            "square_faces": int(walls.sizes[taken].sum()),
            "enclosed_cubes": int(walls.volumes[taken].sum()),
        }
        if held.holds and shell.closing > WIDE:
            self.warn(f"gaps up to {2 * shell.closing} cubes wide were closed: the surface is made up there")

    def unfitted(self, *, flat: bool) -> None:
        """Warn of a shell that does not hold and was let pass: both its walls would rest on the same points."""
        self.warn(
            "the points lie in a plane, on a line or at one place: their shell is smoothed, but not fitted"
            if flat
            else "the outside leaks into the shell: its surface has two walls, and is smoothed, but not fitted"
        )

    def draped(self, draped: Draped | None, taken_back: int, filled: NDArray[np.bool_]) -> None:
        """Note how the mesh of a cloud came to rest, and what of it was filled rather than measured."""
        if draped is None:
            self._sections["fit"] = {"iterations": 0, "converged": True, "collapsed": 0}
        else:
            self.fit(draped.trace, len(draped.vertices), 0)
        self._sections["fit"] |= {"taken_back": taken_back, "filled_faces": int(filled.sum())}
        if filled.mean() > FILLED:
            self.warn(f"{filled.mean():.0%} of the faces lie where there are no points: they were filled")

    def fit(self, trace: Trace, vertices: int, collapsed: int) -> None:
        """Note how the mesh came to rest, and how many components were not left as the fit had them."""
        steps = len(trace.speed)
        self._sections["fit"] = {"iterations": steps, "converged": trace.converged, "collapsed": collapsed}
        if collapsed:
            self.warn(f"{collapsed} component(s) collapsed in the fit: they are smoothed, but not fitted")
        if steps:
            self._sections["fit"] |= {
                "speed": float(trace.speed[-1]),
                "acceleration": float(trace.acceleration[-1]),
                "first_distance_mm": float(trace.distance_mm[0]),
                "last_distance_mm": float(trace.distance_mm[-1]),
                "clamped": int(trace.clamped.sum()),
                "unattracted": int(trace.unattracted[-1]),
            }
            drawn = 1 - trace.unattracted[-1] / max(vertices, 1)
            if drawn < DRAWN:
                self.warn(f"{1 - drawn:.0%} of the vertices have no point near: the cubes are small for the points")
        if steps and not trace.converged:
            self.warn(f"the mesh had not come to rest after {steps} steps")

    def boundary(self, found: Boundary, surface: VoxelSurface) -> None:
        """Note the boundary of the voxels, and how its net came to rest."""
        rest = surface.rest
        self._sections["voxels"] = {
            "added_for_composition": found.added,
            "interpolated": not found.crossings.stepped,
            "split_in_four": len(surface.mesh.vertices) - len(found.net.low),
        }
        self._sections["surface"] = {
            "found": len(found.volumes),
            "cavities": found.cavities,
            "taken": len(found.volumes),
            "debris": 0,
            "square_faces": len(found.net.quads),
            "enclosed_cubes": int(found.volumes.sum()),
        }
        self._sections["fit"] = {"iterations": rest.steps, "converged": rest.converged, "collapsed": 0}
        if found.crossings.stepped:
            self.warn("the gray levels are those of a mask: the surface is evened out between the voxels")
        elif rest.steps and not rest.converged:
            self.warn(f"the mesh had not come to rest after {rest.steps} steps")

    def stack(self, made: ContourSurface, slices: Slices) -> None:
        """Note the slices of a stack of contours, and the voxels between them."""
        widest = float(np.diff(slices.heights).max())
        self._sections["stack"] = {
            "slices": made.slices,
            "contours": made.contours,
            "open": made.open,
            "slice_distance_mm": slices.distance,
            "widest_slice_distance_mm": widest,
            "longest_gap": made.reach,
            "voxel_mm": made.edge,
            "voxels": made.voxels,
        }
        self._sections["fit"]["filled_faces"] = int(made.filled.sum())
        if "study" not in self._sections and widest > APART * slices.distance:
            self.warn(f"slices lie up to {widest:.4g} apart, {slices.distance:.4g} as a rule: that is interpolated")
        if made.edge > made.asked_edge:
            self.warn(f"voxels of {made.asked_edge:.4g} would not fit: they are {made.edge:.4g} wide")

    def quality(
        self,
        mesh: TriMesh,
        points: PointSet,
        cavities: int,
        progress: Progress = silent,
        crossing: NDArray[np.bool_] | None = None,
    ) -> None:
        """Have the mesh measured, against its points too, once the report is asked for."""
        self._measure = partial(
            assess, mesh, points=points.positions, cavities=cavities, crossing=crossing,
            threads=self._settings.run.threads, progress=progress,
        )  # fmt: skip

    def decimated(self, filled: NDArray[np.bool_] | None) -> None:
        """Count the filled faces of the coarser mesh."""
        if filled is not None:
            self._sections["fit"]["filled_faces"] = int(filled.sum())

    def printed(self, judge: Callable[[], dict[str, Any]]) -> None:
        """Have it told whether the part can be printed, once the report is asked for."""
        self._judge = judge

    def volume(self, sampling: Sampling) -> None:
        """Have the volume of the mesh compared with the areas of the rings times the distance of their slices."""
        self._rings_mm3 = sampling.volume_mm3

    def truth(self, mesh: TriMesh, caps: NDArray[np.bool_], truth: TriMesh) -> None:
        """Measure the distance to the exact surface, both ways; the caps are no part of it."""
        with self.timed("truth"):
            self._sections["truth"] = compare(mesh, truth, leave_out=caps)

    def report(self) -> dict[str, Any]:
        """Return the report, its sections in their documented order; measures the mesh the first time."""
        self._measured()
        self._judged()
        sections: dict[str, Any] = self._sections | {
            "timings": self._timings | {"total_s": sum(self._timings.values())},
            "settings": self._settings.to_dict(),
            "versions": dict(versions()),
            "warnings": list(self._warnings),
        }
        return {name: sections[name] for name in ORDER if name in sections}

    def _measured(self) -> None:
        """Measure the mesh, where there is one that has not been."""
        if self._measure is None:
            return
        with self.timed("quality"):
            quality = self._sections["quality"] = self._measure()
        self._measure = None
        if self._rings_mm3 > 0:
            quality["rings_volume_mm3"] = self._rings_mm3
            quality["volume_over_rings"] = quality["volume_mm3"] / self._rings_mm3
            if abs(quality["volume_over_rings"] - 1) > PLAUSIBLE:
                self.warn(f"the mesh encloses {quality['volume_over_rings']:.0%} of the volume of its rings")
        far = quality.get("points_to_surface_p95_mm", 0.0)
        if "study" in self._sections and far > FAR * self._sections["study"]["slice_spacing_mm"]:
            self.warn(
                f"one point in twenty lies over {far:.3g} mm from the surface: it does not follow the window there"
            )
        if quality["self_intersections"]:
            self.warn(f"{quality['self_intersections']} faces pass through others")

    def _judged(self) -> None:
        """Tell whether the part can be printed, where there is one that has not been looked at."""
        if self._judge is not None:
            with self.timed("print"):
                self._sections["print"] = self._judge()
            self._judge = None


def _limits(limit: Limit) -> float | list[float | None] | None:
    """Return a limit, or one a layer, with None where there is none; one that all layers share once."""
    found = [None if np.isinf(one) else float(one) for one in np.ravel(limit)]
    return found if len(set(found)) > 1 else found[0]


@cache
def versions() -> dict[str, str]:
    """Return the versions of what the result depends on."""
    return {name: version(name) for name in PACKAGES} | {"python": platform.python_version()}
