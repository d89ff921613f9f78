"""One study larger than the memory: slab by slab here, or among Dask workers."""

from __future__ import annotations

import sys
from contextlib import contextmanager
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from .. import io
from ..errors import UsageError
from ..memory.limit import bytes_of
from ..settings import option_of
from ..stage import Stage
from .bars import bars_of
from .batch import OF_ONE
from .outputs.checks import check_folder, check_frame, check_outputs
from .outputs.write import write_documents, write_surface
from .sources import open_study, sources_of
from .spread import check_workers

if TYPE_CHECKING:
    from argparse import Namespace
    from collections.abc import Iterator, Mapping

    from ..large import LargeSurface
    from ..results import Surface
    from ..settings import Settings
    from .bars import Bars

IN_SLABS = ("workers", "scheduler", *OF_ONE)
"""Options of one study by which it is worked on slab by slab."""
WHOLE = ("points", "labels", "mask_out", "figures", "html", "slicer", "patient")
"""Results that need the study whole."""


def is_large(chosen: Namespace) -> bool:
    """Tell whether a study is to be worked on slab by slab."""
    return any(getattr(chosen, name) is not None for name in IN_SLABS)


def reconstruct_in_slabs(chosen: Namespace, settings: Settings, given: Mapping[str, Any]) -> LargeSurface | Surface:
    """Read, reconstruct and write a study that is never whole in the memory.

    Raises
    ------
    TomomeshError
    """
    _check(chosen, settings)
    from ..large import LargeSurface, reconstruct_large, require_large

    require_large(settings)
    memory = None if chosen.memory is None else bytes_of(chosen.memory)
    with _client(chosen) as client, bars_of(chosen) as progress:
        volume, labels = open_study(chosen, settings, progress)
        found = reconstruct_large(
            volume, settings, labels=labels, client=client, memory=memory, slab=chosen.slab, progress=progress, **given
        )
        if isinstance(found, LargeSurface):
            return _write(chosen, found, settings, progress)
        return write_surface(chosen, found, settings, progress)


def _check(chosen: Namespace, settings: Settings) -> None:
    check_workers(chosen)
    given = [option_of(name) for name in WHOLE if getattr(chosen, name) not in (None, False)]
    if given:
        raise UsageError(
            "this needs the study whole", found=f"{given[0]}, and a study that is worked on slab by slab",
            hint=f"the same without {given[0]}",
        )  # fmt: skip
    if chosen.slab is not None and chosen.slab < 1:
        raise UsageError("a slab has a slice", found=f"--slab {chosen.slab}", expected="at least 1")
    check_outputs(chosen, io.PART_WRITERS, *sources_of(chosen, settings))
    check_frame(chosen.output, settings)
    if chosen.neuroglancer:
        check_folder(chosen.neuroglancer)


@contextmanager
def _client(chosen: Namespace) -> Iterator[Any]:
    """Hand over a client of the workers that were asked for, or None."""
    if not (chosen.workers or chosen.scheduler):
        yield None
        return
    from ..scale import cluster

    if not chosen.quiet:
        print("waiting for workers", file=sys.stderr)
    with cluster.connected(chosen.scheduler) if chosen.scheduler else cluster.local(chosen.workers) as found:
        yield found.client


def _at_vertices(found: LargeSurface, output: str) -> dict[str, Any]:
    """Return what the format keeps of the neurons, at the vertices: a ring, its side and its track."""
    from ..pointcloud.attributes import carry

    if found.neurons is None:
        return {}
    kept = {name: values for name, values in found.neurons.attributes.items() if io.keeps(output, name)}
    parts = [carry(replace(found.neurons, attributes=kept), places) for places in found.mesh.vertices()]
    return {name: np.concatenate([part[name] for part in parts]) for name in kept}


def _write(chosen: Namespace, found: LargeSurface, settings: Settings, progress: Bars) -> LargeSurface:
    """Write the mesh in the frame that was asked for, and the documents; its report tells of both."""
    frame = io.frame_of_study(settings.run.frame, found.volume.grid)
    mesh, unit, name = found.mesh.carried(frame.matrix), frame.unit, frame.name
    progress("write", 0, 1)
    told: dict[str, Any] = {"unit": unit, "frame": name}
    if chosen.pieces is None:
        fields = _at_vertices(found, chosen.output)
        io.write_mesh(
            mesh, chosen.output, unit=unit, frame=name, vertex_fields=fields, precision=settings.run.precision
        )  # fmt: skip
    else:
        precision = settings.run.precision
        files = io.write_pieces(mesh, chosen.output, chosen.pieces, unit=unit, frame=name, precision=precision)
        told["files"] = [file.name for file in files]
    if chosen.neuroglancer:
        io.write_neuroglancer(mesh, chosen.neuroglancer, unit=unit, frame=name)
    progress("write", 1, 1)
    found = replace(found, stages=(*found.stages, Stage(None, {"written": told})))
    write_documents(chosen, found.report, settings)
    return found
