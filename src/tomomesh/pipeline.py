"""The whole way, one arrow a line: study -> mask -> networks -> points -> cubes -> cuberille -> mesh."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.spatial import cKDTree

from .account import Account
from .cloudwise import surface_of_cloud
from .contourwise import slices_of, surface_of_contours
from .decimation import decimate, faces_under, require_decimation
from .errors import EmptyError, GeometryError, UsageError
from .measure.topology import check_promise
from .model.points import CAP, PointSet
from .model.volume import AXES, Volume
from .progress import Progress, silent
from .segment.sample import Sampling, sample
from .segment.study import regions, train_study
from .segment.window import choose_window, window
from .settings import Settings
from .surface.collapse import without_collapse
from .surface.dynamics import fit
from .surface.holding import CLOSINGS, hold
from .surface.partition import is_flat, partition, sampling_distance
from .surface.samples import distinct
from .surface.smooth import low_pass
from .voxelwise import NO_CUBES, NO_NETWORKS, NO_TRACE, find_boundary, mesh_boundary, sampled

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .model.cubes import CubeGrid
    from .model.mesh import QuadMesh, TriMesh
    from .model.networks import Networks
    from .model.trace import Trace
    from .surface.slices import Slices
    from .surface.voxels import Boundary

LEAST = 0.5
"""Share of the rings' volume that a shell must enclose; a slab may be too thin to be seen to hold."""


@dataclass(frozen=True)
class Segmentation:
    """A study after stage one.

    Attributes
    ----------
    volume : Volume
        The study, its slices along K.
    mask : (K, J, I) bool array
        The window.
    networks : Networks
    labels : (K, J, I) uint16 array
        Every window pixel's winner: 0 background, neuron + 1 within its slice.
    points : PointSet
        The neurons, bridged gaps and caps in patient millimeters.
    sampling : Sampling
    report : dict
    boundary : Boundary or None
        The window's own boundary, where it takes the place of networks.
    """

    volume: Volume
    mask: NDArray[np.bool_]
    networks: Networks
    labels: NDArray[np.uint16]
    points: PointSet
    sampling: Sampling
    report: dict[str, Any]
    boundary: Boundary | None = None


@dataclass(frozen=True)
class Surface:
    """A cloud after stages two and three; every stage is kept.

    Attributes
    ----------
    points : PointSet
    cubes : CubeGrid
    cuberille : QuadMesh
    smoothed, mesh : TriMesh
        The surface before and after the fit, with the same faces unless `mesh` was decimated.
    nearest : (n,) int32 array
        The point that draws each vertex of `mesh`, -1 where there is none; empty for clouds and decimated meshes.
    trace : Trace
    report : dict
    segmentation : Segmentation or None
        Stage one, where the points came from a study.
    filled : (m,) bool array or None
        Faces of `mesh` that lie where a cloud has no points: filled, not measured.
    """

    points: PointSet
    cubes: CubeGrid
    cuberille: QuadMesh
    smoothed: TriMesh
    mesh: TriMesh
    nearest: NDArray[np.int32]
    trace: Trace
    report: dict[str, Any]
    segmentation: Segmentation | None = None
    filled: NDArray[np.bool_] | None = None

    @property
    def cap_faces(self) -> NDArray[np.bool_]:
        """Faces (m,) with a corner that is nearest to a cap: filled, not measured."""
        _, nearest = cKDTree(self.points.positions).query(self.mesh.vertices)
        on_cap = self.points.kinds[nearest] == CAP
        return np.asarray(on_cap[self.mesh.faces].any(axis=1))


def reconstruct(
    volume: Volume,
    settings: Settings | None = None,
    *,
    truth: TriMesh | None = None,
    progress: Progress = silent,
    **changes: Any,
) -> Surface:
    """Turn a study of slices into a closed surface (Reyes Aldasoro & Algorri 2000).

    Parameters
    ----------
    volume : Volume
    settings : Settings, optional
    truth : TriMesh, optional
        The exact surface, where it is known; the report then holds the distance to it, caps aside.
    progress : callable
        Called as ``progress(stage, done, total)``; raise in it to stop.
    **changes
        Parameters by their bare names, as ``neurons=80``.

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
    account = Account(settings)
    segmentation = _segment(volume, settings, account, progress)
    sampling = segmentation.sampling
    if segmentation.boundary is not None:
        surface = _surface_of_voxels(segmentation.boundary, settings, account, progress)
    else:
        surface = _surface(
            sampling.points, sampling.spacing_mm, settings, account, progress, expected_mm3=sampling.volume_mm3
        )
    surface = _coarser(surface, settings, account, progress)
    account.rings(sampling)
    if truth is not None:
        account.truth(surface.mesh, surface.cap_faces, truth)
    report = account.report()
    return replace(surface, report=report, segmentation=replace(segmentation, report=report))


def segment(
    volume: Volume, settings: Settings | None = None, *, progress: Progress = silent, **changes: Any
) -> Segmentation:
    """Run stage one alone: window, networks, regions, points.

    Parameters and errors are those of `reconstruct`.
    """
    settings = (settings or Settings()).replace(**changes)
    account = Account(settings)
    found = _segment(volume, settings, account, progress)
    return replace(found, report=account.report())


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
    cloud = points if isinstance(points, PointSet) else PointSet.from_positions(points)
    if len(cloud) == 0:
        raise EmptyError("there are no points", expected="at least one")
    lowest = cloud.positions.min(axis=0)
    if settings.run.local_origin:
        cloud = replace(cloud, positions=cloud.positions - lowest)
    account = Account(settings)
    with account.timed("slices"):
        slices = slices_of(cloud, settings)
    if slices is not None and settings.fit.attraction != "nearest":
        surface = _surface_of_contours(cloud, slices, settings, account, progress)
    elif settings.fit.attraction == "nearest":
        with account.timed("points"):
            spacing = sampling_distance(distinct(cloud.positions))
        account.points(cloud, spacing)
        surface = _surface(cloud, spacing, settings, account, progress)
    else:
        surface = _surface_of_cloud(cloud, settings, account, progress)
    account.origin(lowest)
    surface = _coarser(surface, settings, account, progress)
    return replace(surface, report=account.report())


def _surface_of_cloud(cloud: PointSet, settings: Settings, account: Account, progress: Progress) -> Surface:
    found = surface_of_cloud(cloud.positions, settings, account, progress)
    with account.timed("quality"):
        check_promise(found.mesh, cavities=account.cavities, open_=settings.cubes.open)
        account.quality(found.mesh, cloud, account.cavities, progress, found.crossing)
    trace = NO_TRACE if found.draped is None else found.draped.trace
    return Surface(
        cloud, NO_CUBES, found.cuberille, found.smoothed, found.mesh, np.empty(0, np.int32), trace, {},
        filled=found.filled,
    )  # fmt: skip


def _surface_of_contours(
    cloud: PointSet, slices: Slices, settings: Settings, account: Account, progress: Progress
) -> Surface:
    made = surface_of_contours(cloud, slices, settings, account, progress)
    with account.timed("quality"):
        check_promise(made.mesh, cavities=account.cavities)
        account.quality(made.mesh, cloud, account.cavities, progress)
    return Surface(
        cloud, NO_CUBES, made.boundary.cuberille, made.rest.smoothed, made.mesh, made.rest.nearest, NO_TRACE, {},
        filled=made.filled,
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


def _segment(volume: Volume, settings: Settings, account: Account, progress: Progress) -> Segmentation:
    if not isinstance(volume, Volume):
        raise UsageError(
            "a study is a Volume",
            found=type(volume).__name__,
            expected="read_volume(path) or Volume.from_stored(array, affine)",
        )
    axis = _slice_axis(volume, settings.network.slices)
    stack = volume.along(axis)
    account.study(stack, AXES[axis])
    if settings.network.network == "none":
        return _segment_voxels(stack, settings, account)
    with account.timed("window"):
        lower, upper = choose_window(volume, settings.window)
        mask = window(stack, lower=lower, upper=upper)
    account.window(mask, lower, upper)
    pixel_mm, threads = stack.spacing_mm[:2], settings.run.threads
    with account.timed("networks"):
        networks = train_study(
            mask,
            settings.network,
            pixel_mm=pixel_mm,
            seed=settings.run.seed,
            threads=threads,
            progress=progress,
        )
    with account.timed("regions"):
        labels = regions(mask, networks, pixel_mm=pixel_mm, threads=threads)
    account.networks(networks, mask)
    with account.timed("points"):
        sampling = sample(networks, stack, caps=settings.cubes.caps, bridge=settings.network.bridge)
    account.points(sampling.points, sampling.spacing_mm, sampling.bridged)
    return Segmentation(stack, mask, networks, labels, sampling.points, sampling, {})


def _segment_voxels(stack: Volume, settings: Settings, account: Account) -> Segmentation:
    """Take the boundary of the window in place of networks."""
    mask, found = find_boundary(stack, settings, account)
    return Segmentation(
        stack, mask, NO_NETWORKS, mask.astype(np.uint16), found.points, sampled(found), {}, boundary=found
    )


def _surface_of_voxels(found: Boundary, settings: Settings, account: Account, progress: Progress) -> Surface:
    made = mesh_boundary(found, settings, account, progress)
    return Surface(
        found.points, NO_CUBES, found.cuberille, made.smoothed, made.mesh, made.nearest, NO_TRACE, {}
    )  # fmt: skip


def _slice_axis(volume: Volume, slices: str) -> int:
    if slices == "auto":
        return volume.thickest_axis()
    return volume.stored_axis if slices == "stored" else AXES.index(slices)


def _surface(
    points: PointSet,
    spacing: float,
    settings: Settings,
    account: Account,
    progress: Progress,
    *,
    expected_mm3: float = 0.0,
) -> Surface:
    asked, threads = settings.cubes, settings.run.threads
    with account.timed("cubes"):
        grid = partition(points.positions, _cell(spacing, settings))
        closings = CLOSINGS if asked.closing is None else (asked.closing,)
        held = hold(grid.cells, closings, cavities=asked.surface == "all", threads=threads, progress=progress)
        taken = held.walls.worth_keeping(largest=asked.largest)
    account.held(held, taken, grid.cell_mm, len(grid.keys))
    with account.timed("cuberille"):
        walls = held.walls.only(taken)
        cubes, cuberille = walls.over(grid)
    enclosed = float(walls.volumes.sum() * grid.cell_mm.prod())
    if enclosed < LEAST * expected_mm3 if expected_mm3 else not held.holds:
        settings = _without_fit(account, settings, points.positions)
    with account.timed("smooth"):
        rough = cuberille.triangulated()
        smoothed = rough.moved(low_pass(cuberille.vertices, cuberille.edges, settings.cubes.smoothing))
    with account.timed("fit"):
        springs = cuberille.edges if settings.fit.springs == "quads" else rough.edges
        rest = fit(
            smoothed.vertices, springs, cuberille.vertex_cubes, points.positions, cubes, settings.fit,
            threads=threads, progress=progress,
        )  # fmt: skip
    mesh, collapsed = without_collapse(smoothed, smoothed.moved(rest.vertices))
    account.fit(rest.trace, len(mesh.vertices), collapsed)
    with account.timed("quality"):
        check_promise(mesh, cavities=account.cavities)
        account.quality(mesh, points, account.cavities)
    return Surface(points, cubes, cuberille, smoothed, mesh, rest.nearest, rest.trace, {})


def _cell(spacing: float, settings: Settings) -> NDArray[np.float64]:
    """Return the edge of the cubes along each axis: r, or what was asked for, times the dilation factor."""
    asked = settings.cubes.cell_mm or (spacing,)
    return np.broadcast_to(np.array(asked, np.float64) * settings.cubes.cell_factor, 3).copy()


def _without_fit(account: Account, settings: Settings, positions: NDArray[np.float64]) -> Settings:
    """Refuse a shell that the outside leaks into, unless that was allowed or the points lie in a plane.

    What is let pass is not fitted: both walls would rest on the same points, and the mesh would fall flat.
    """
    flat = is_flat(positions, account.cell_mm)
    if flat or settings.cubes.allow_leaks:
        account.unfitted(flat=flat)
        return settings.replace(max_steps=0)
    raise GeometryError(
        "the outside leaks into the shell of cubes, so its surface would have two walls",
        found=f"cell = {account.cell_mm:.4g}",
        expected="gaps between the points that are narrower than a hole of the surface",
        hint="a larger --cell-mm or --closing, or --allow-leaks",
    )
