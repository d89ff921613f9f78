"""Studies larger than the memory: read, chosen, meshed, checked and written slab by slab."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from .begin import begun_on, require_way, settled
from .errors import ResourceError
from .memory.limit import disk_folder
from .model.mesh import TriMesh
from .pipeline import finished
from .pointcloud.forecast import bytes_in_words, free_memory
from .progress import Progress, silent
from .report import Reported
from .segmentation.selection import STEPS
from .segmentation.slabwise.cut import Cutting
from .segmentation.study import lay_out
from .slabs.cuts import Cuts
from .slabs.keep import OnDisk
from .slabs.on_client import OnClient
from .slabs.place import HALO
from .stage import folded
from .ways.choice import known_way
from .ways.in_slabs.contours import contours_in_slabs
from .ways.in_slabs.voxels import (
    checked_in_slabs,
    followed_by,
    followed_in_slabs,
    measured_in_slabs,
    mesh_in_slabs,
    require_slabs,
)

if TYPE_CHECKING:
    from .begin import Begun
    from .followed import Followed
    from .isosurface.run_mask import RunMask
    from .model.points import PointSet
    from .model.volume import Volume
    from .results import Surface
    from .settings import Settings
    from .slabs.keep import Slabs
    from .slabs.patches.patch import Patches
    from .stage import Stage

BASE = 180e6
"""Bytes of Python, its packages, the kernels and Dask."""
A_VOXEL = 4.0
"""Bytes for each voxel of a slab and its halo, beside those of the file: read, masked, joined. Measured, as the next:
2.5 of a ball of gray levels, and 215 to 250."""
A_CELL = 300.0
"""Bytes for each vertex of a slab and its halo."""
CELLS_A_RUN = 6.0
"""Vertices for each run of a mask: a run has two sides across its row, and faces are as many along other axes."""
IN_SLABS = ("voxels", "contours")
"""Ways whose mesh is never whole."""


@dataclass(frozen=True)
class LargeSurface(Reported):
    """A surface that is never whole.

    Attributes
    ----------
    mesh : Patches
        What `tomomesh.write_mesh` and `tomomesh.io.write_pieces` take as they take a mesh, in patient millimeters.
    volume : Volume
        The study, whose voxels stay in its file.
    neurons : PointSet or None
        Of rings, on the ways that have any.
    """

    mesh: Patches
    volume: Volume
    neurons: PointSet | None = None

    def joined(self) -> TriMesh:
        """Return the whole mesh, where the memory holds it."""
        vertices, faces = ([*parts] for parts in (self.mesh.vertices(), self.mesh.faces()))
        return TriMesh(np.concatenate(vertices), np.concatenate(faces))


def reconstruct_large(
    volume: Volume,
    settings: Settings | None = None,
    *,
    labels: Volume | None = None,
    client: Any = None,
    memory: float | None = None,
    slab: int | None = None,
    progress: Progress = silent,
    **changes: Any,
) -> LargeSurface | Surface:
    """Turn a study that need not fit into the memory into a closed surface, slab by slab.

    No byte of the mesh depends on slabs or workers; it is that of `reconstruct` without even triangles and divided
    voxels (``remesh=False, divide=False``), which need the whole mesh.

    Parameters
    ----------
    volume : Volume
        As `tomomesh.io.open_study` opens it, or with voxels in memory.
    settings : Settings, optional
    labels : Volume, optional
        A label map on the study's grid, for ``select``.
    client : distributed.Client, optional
        Whose workers work on slabs side by side; without one, one slab follows the other here.
    memory : float, optional
        Bytes that each process may take, by default what is free over the processes; slabs are as thick as it holds.
    slab : int, optional
        Slices of a slab, in place of that.
    progress : callable
    **changes
        Parameters by their bare names, as in `reconstruct`.

    Returns
    -------
    LargeSurface, or Surface
        The latter where a network a slice is taken, whose neurons and mesh fit into the memory where the study does
        not.

    Raises
    ------
    TomomeshError
        Of the kind that fits; see `tomomesh.errors`.

    Examples
    --------
    >>> from tomomesh import phantom, reconstruct_large, write_mesh
    >>> head = phantom((12, 32, 32), (7.5, 7.5, 12.0))
    >>> found = reconstruct_large(head.volume, lower=head.lower, way="voxels", slab=5)
    >>> write_mesh(found.mesh, "head.ply")
    >>> found.report["quality"]["closed"], found.report["slabs"]["count"]
    (True, 3)
    """
    settings = settled(settings, changes)
    require_large(settings)
    slabs, room = _workers(client, memory, slab)
    cutting = Cutting(partial(_cuts, room=room, itemsize=volume.voxels.dtype.itemsize), slabs)
    progress("window", 0, STEPS)
    study = lay_out(volume, labels, settings, labelled=settings.window.select is not None, cutting=cutting)
    begun = begun_on(study, settings, changes, progress)
    if begun.way.name not in IN_SLABS:
        return finished(begun, progress)
    require_slabs(begun.taken)
    kept, cut = begun.kept, partial(_cuts_of, room=room)
    if begun.way.name == "voxels":
        made = mesh_in_slabs(kept, begun.taken, slabs, cut(kept.study, kept.chosen.runs), progress)
        return _checked(begun, made, followed_by(made.value, kept.study.affine), progress)
    found = contours_in_slabs(kept, begun.taken, slabs, cut, progress)
    surface, neurons, follows = found.value
    return replace(_checked(begun, folded(surface, found), follows, progress), neurons=neurons)


def require_large(settings: Settings) -> None:
    """Refuse what the settings alone tell cannot be done slab by slab, before anything is read.

    Raises
    ------
    UsageError
    """
    require_way(settings)
    known = known_way(settings)
    if known is not None and known.way in IN_SLABS:
        require_slabs(settings)


@dataclass(frozen=True)
class _Room:
    """How thick slabs may be.

    Attributes
    ----------
    slab : int or None
        So many slices, where that is asked for.
    most : float
        Bytes of each process.
    workers : int
        Which each want a slab at least.
    """

    slab: int | None
    most: float
    workers: int = 1


def _cuts_of(volume: Volume, runs: RunMask, *, room: _Room) -> Cuts:
    """Cut a volume of which some voxels are kept; where they are read, into whole chunks if one fits."""
    each, parts = volume.layers * volume.voxels.dtype.itemsize, volume.in_parts
    chunk = 1 if parts is None else parts.chunks[0]
    return Cuts(_cuts(volume.shape, room=room, itemsize=each, runs=runs, chunk=chunk))


def _checked(begun: Begun, made: Stage[Any], follows: Followed, progress: Progress) -> LargeSurface:
    """Check a surface in pieces across its seams, and that it follows its window; the rest is measured later."""
    kept, study = begun.kept, begun.kept.study
    checked = checked_in_slabs(made.value, kept, progress)
    patches = checked.value[0]
    near = followed_in_slabs(patches, follows, begun.taken)
    stages = (begun.told, made, checked, near, partial(measured_in_slabs, *checked.value))
    return LargeSurface(patches, study, way=begun.way.name, settings=begun.settings, stages=stages)


def _workers(client: Any, memory: float | None, slab: int | None) -> tuple[Slabs, _Room]:
    """Return who works on slabs, and how thick these may be."""
    if client is None:
        return OnDisk(disk_folder()), _Room(slab, memory or free_memory())
    limits = [one["memory_limit"] or math.inf for one in client.scheduler_info(n_workers=-1)["workers"].values()]
    count = max(len(limits), 1)
    most = memory or min(min(limits, default=math.inf), free_memory() / count)
    return OnClient(client), _Room(slab, most, count)


def _cuts(
    shape: tuple[int, ...], *, room: _Room, itemsize: int, runs: RunMask | None = None, chunk: int = 1
) -> tuple[int, ...]:
    """Cut a study into slabs of so many slices, or of as many as fit and leave no worker without one.

    Raises
    ------
    ResourceError
        Where not even one slice does.
    """
    if room.slab is not None:
        return Cuts.every(shape[0], room.slab).places
    layer = math.prod(shape[1:3]) * (itemsize + A_VOXEL)
    layer += 0.0 if runs is None else A_CELL * CELLS_A_RUN * _most_runs(runs)
    halo = 0 if runs is None else 2 * HALO
    fitting = int((room.most - BASE) / max(layer, 1.0)) - halo if room.most < math.inf else shape[0]
    if fitting < 1:
        raise ResourceError(
            "the memory does not hold a slab of one slice", found=bytes_in_words(room.most),
            expected=f"at least {bytes_in_words(BASE + (1 + halo) * layer)}",
        )  # fmt: skip
    thick = min(fitting, -(-shape[0] // room.workers))
    return Cuts.every(shape[0], thick - thick % min(chunk, thick)).places


def _most_runs(runs: RunMask) -> float:
    """Return how many runs a slice has, on the mean over as many slices as have most of them and are a slab's least."""
    slices = runs.begin[:: runs.shape[1]]
    return max(float(np.diff(slices[:: 2 * HALO]).max(initial=0)) / (2 * HALO), len(runs.starts) / runs.shape[0])
