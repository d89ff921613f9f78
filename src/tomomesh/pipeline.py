"""The whole way, one arrow a line: study -> mask -> networks -> points -> cubes -> cuberille -> mesh."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from .account import Account
from .cloudwise import surface_of_cloud
from .contourwise import slices_of, slices_of_rings, surface_of_contours
from .cuberille.partition import sampling_distance
from .decimation import decimate, faces_under, require_decimation
from .errors import EmptyError
from .measure.topology import check_promise
from .model.columns import box
from .model.points import PointSet
from .networkwise import surface_of_networks
from .pointcloud.samples import distinct
from .printing.part import make_part, require_printing
from .progress import Progress, silent
from .results import NO_CUBES, NO_TRACE, Segmentation, Surface
from .settings import Settings, without_effect
from .spacewise import require_surface, surface_of_space
from .studywise import segment_study
from .voxelwise import mesh_boundary

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from .contours.slices import Slices
    from .isosurface.voxels import Boundary
    from .model.mesh import TriMesh
    from .model.volume import Volume


def reconstruct(
    volume: Volume,
    settings: Settings | None = None,
    *,
    labels: Volume | None = None,
    truth: TriMesh | None = None,
    progress: Progress = silent,
    **changes: Any,
) -> Surface:
    """Turn a study of slices into a closed surface (Reyes Aldasoro & Algorri 2000).

    Parameters
    ----------
    volume : Volume
    settings : Settings, optional
    labels : Volume, optional
        A label map on the study's grid, for ``select``; where not given, the study is the label map itself.
    truth : TriMesh, optional
        The exact surface, where it is known; the report then holds the distance to it, caps aside.
    progress : callable
        Called as ``progress(stage, done, total)``; raise in it to stop.
    **changes
        Parameters by their bare names, as ``neurons=80``; the report warns of those that have no effect beside the
        others.

    Returns
    -------
    Surface

    Raises
    ------
    TomomeshError
        Of the kind that fits; see `tomomesh.errors`.
    """
    settings = (settings or Settings()).replace(**changes)
    require_decimation(settings.run.target_faces)
    require_printing(settings)
    require_surface(settings)
    account = _begun(settings, changes, volume)
    segmentation = segment_study(volume, labels, settings, account, progress)
    surface = _surface_of(segmentation, settings, account, progress)
    surface = _printed(_coarser(surface, settings, account, progress), settings, account, progress)
    account.volume(segmentation.sampling)
    if truth is not None:
        account.truth(surface.mesh, surface.cap_faces, truth)
    return replace(surface, segmentation=segmentation)


def segment(
    volume: Volume,
    settings: Settings | None = None,
    *,
    labels: Volume | None = None,
    progress: Progress = silent,
    **changes: Any,
) -> Segmentation:
    """Run stage one alone: window, networks, regions, points.

    Parameters and errors are those of `reconstruct`.
    """
    settings = (settings or Settings()).replace(**changes)
    return segment_study(volume, labels, settings, _begun(settings, changes, volume), progress)


def reconstruct_points(
    points: PointSet | NDArray[np.float64],
    settings: Settings | None = None,
    *,
    progress: Progress = silent,
    **changes: Any,
) -> Surface:
    """Turn any unoriented points into a closed surface: stages two and three alone.

    Parameters
    ----------
    points : PointSet or (n, 3) array
        Positions; their order and repetitions change nothing.
    settings, progress, **changes
        As in `reconstruct`.

    Returns
    -------
    Surface
    """
    settings = (settings or Settings()).replace(**changes)
    require_decimation(settings.run.target_faces)
    require_printing(settings)
    cloud = points if isinstance(points, PointSet) else PointSet.from_positions(points)
    if len(cloud) == 0:
        raise EmptyError("there are no points", expected="at least one")
    lowest, _ = box(cloud.positions)
    if cloud.frame == "LPS":
        settings = settings.replace(units="mm")
    if settings.run.local_origin:
        cloud = replace(cloud, positions=cloud.positions - lowest)
    account = Account(settings)
    with account.timed("slices"):
        slices = slices_of(cloud, settings)
    _warn(settings, changes, "cloud" if slices is None else "stack", account)
    if slices is not None and settings.fit.attraction != "nearest":
        surface = _surface_of_contours(cloud, slices, settings, account, progress)
    elif settings.fit.attraction == "nearest":
        with account.timed("points"):
            spacing = sampling_distance(distinct(cloud.positions))
        account.points(cloud, spacing)
        surface = surface_of_networks(cloud, spacing, settings, account, progress)
    else:
        surface = _surface_of_cloud(cloud, settings, account, progress)
    account.cloud(cloud, lowest)
    surface = _coarser(surface, settings, account, progress)
    return _printed(surface, settings, account, progress, unit=settings.run.units)


def _begun(settings: Settings, changes: Mapping[str, Any], volume: Volume) -> Account:
    """Begin the account of a study."""
    account = Account(settings)
    _warn(settings, changes, "color" if getattr(volume, "layers", 1) > 1 else "gray", account)
    return account


def _warn(settings: Settings, changes: Mapping[str, Any], kind: str, account: Account) -> None:
    """Warn of what was asked for and changes nothing."""
    for message in without_effect(settings, changes, input=kind):
        account.warn(message)


def _surface_of(segmentation: Segmentation, settings: Settings, account: Account, progress: Progress) -> Surface:
    """Take the way to a surface that stage one has taken."""
    sampling = segmentation.sampling
    if segmentation.boundary is not None:
        return _surface_of_voxels(segmentation.boundary, settings, account, progress)
    if segmentation.space is not None:
        return surface_of_space(segmentation, settings, account, progress)
    if segmentation.contours is not None:
        finest, slices = min(segmentation.volume.spacing_mm[:2]), slices_of_rings(sampling.points)
        return _surface_of_contours(
            sampling.points, slices, settings, account, progress, finest=finest, bridged=sampling.bridged
        )
    return surface_of_networks(
        sampling.points, sampling.spacing_mm, settings, account, progress, expected_mm3=sampling.volume_mm3
    )


def _surface_of_cloud(cloud: PointSet, settings: Settings, account: Account, progress: Progress) -> Surface:
    found = surface_of_cloud(cloud.positions, settings, account, progress)
    with account.timed("quality"):
        check_promise(found.mesh, cavities=account.cavities, open_=settings.cubes.open)
        account.quality(found.mesh, cloud, account.cavities, progress, found.crossing)
    trace = NO_TRACE if found.fitted is None else found.fitted.trace
    return Surface(
        cloud, NO_CUBES, found.cuberille, found.smoothed, found.mesh, np.empty(0, np.int32), trace, account.report,
        filled=found.filled,
    )  # fmt: skip


def _surface_of_contours(
    cloud: PointSet, slices: Slices, settings: Settings, account: Account, progress: Progress,
    *, finest: float | None = None, bridged: int = 0,
) -> Surface:  # fmt: skip
    made = surface_of_contours(cloud, slices, settings, account, progress, finest=finest, bridged=bridged)
    with account.timed("quality"):
        check_promise(made.mesh, cavities=account.cavities)
        account.quality(made.mesh, cloud, account.cavities, progress)
    return Surface(
        cloud, NO_CUBES, made.boundary.cuberille, made.rest.smoothed, made.mesh, made.rest.nearest, NO_TRACE,
        account.report, filled=made.filled,
    )  # fmt: skip


def _coarser(surface: Surface, settings: Settings, account: Account, progress: Progress) -> Surface:
    """Leave the mesh the faces that were asked for, and check and measure it anew."""
    most, threads = settings.run.target_faces, settings.run.threads
    if most is None or len(surface.mesh.faces) <= most:
        return surface
    with account.timed("decimate"):
        mesh = decimate(surface.mesh, most, cavities=account.cavities, threads=threads)
        filled = None if surface.filled is None else surface.filled[faces_under(mesh, surface.mesh)]
    account.decimated(filled)
    with account.timed("quality"):
        check_promise(mesh, cavities=account.cavities)
        account.quality(mesh, surface.points, account.cavities, progress)
    return replace(surface, mesh=mesh, filled=filled, nearest=np.empty(0, np.int32))


def _printed(
    surface: Surface, settings: Settings, account: Account, progress: Progress, *, unit: str = "mm"
) -> Surface:
    """Make the part to print, where one is asked for; the surface and what is measured of it stay."""
    if not settings.printing.asked:
        return surface
    with account.timed("print"):
        part = make_part(surface.mesh, settings, unit=unit, progress=progress)
    account.printed(lambda: part.report)
    return replace(surface, part=part)


def _surface_of_voxels(found: Boundary, settings: Settings, account: Account, progress: Progress) -> Surface:
    made = mesh_boundary(found, settings, account, progress)
    return Surface(
        found.points, NO_CUBES, found.cuberille, made.smoothed, made.mesh, made.nearest, NO_TRACE, account.report
    )  # fmt: skip
