"""The way of one network in space, one arrow a line: study -> mask -> places -> network -> its own faces -> mesh."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import cKDTree

from .cuberille.partition import partition
from .dynamics.low_pass import OneRing
from .dynamics.mass_spring import fit
from .dynamics.moving_least_squares import fit_to_surface
from .dynamics.subdivision import squares_of
from .dynamics.untangle import untangle
from .errors import UsageError
from .isosurface.voxels import boundary
from .measure.intersections import Crossings
from .measure.topology import check_promise
from .model.columns import any_of
from .model.mesh import QuadMesh, TriMesh
from .model.points import PointSet
from .pointcloud.samples import settle_points
from .results import NO_CUBES, NO_NETWORKS, NO_TRACE, NOTHING, Segmentation, SpaceFound, Surface
from .segmentation.sample import Sampling
from .segmentation.space import is_wall, pieces_of, regions_in_space, train_space
from .settings import SURFACES

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .account import Account
    from .model.networks import SpaceNetwork
    from .model.trace import Trace
    from .progress import Progress
    from .segmentation.selection import Chosen
    from .settings import Settings

    Floats = NDArray[np.float64]

REACH = 1.5
"""Most that a vertex moves in a step of the fit, sides of the finer mesh."""


def require_surface(settings: Settings) -> None:
    """Refuse to make a surface of a network in space that has no faces.

    Raises
    ------
    UsageError
    """
    network = settings.network
    if network.in_space and network.network not in SURFACES:
        raise UsageError(
            "the network has no faces, and bounds nothing", found=f"--network = {network.network}, --space = volume",
            expected=f"--network {' | '.join(SURFACES)}, or --space slice",
            hint="`tomomesh segment` writes its neurons",
        )  # fmt: skip


def segment_in_space(chosen: Chosen, settings: Settings, account: Account, progress: Progress) -> Segmentation:
    """Train one network on the whole window."""
    stack, threads = chosen.volume, settings.run.threads
    with account.timed("window"):
        mask, pieces = pieces_of(chosen.mask)
    with account.timed("points"):
        voxels = stack.to_mm(np.argwhere(mask)[:, ::-1].astype(np.float64))
        outlined, places = _outlined(mask, settings), voxels
        if outlined:
            found = boundary(
                stack, mask, lower=chosen.lower, upper=chosen.upper, layers=settings.window.layers, surface="outer",
                threads=threads,
            )  # fmt: skip
            places = found.points.positions
    with account.timed("networks"):
        progress("networks", 0, 1)
        network = train_space(places, settings.network, outlined=outlined, seed=settings.run.seed)
        progress("networks", 1, 1)
    with account.timed("regions"):
        labels = regions_in_space(mask, voxels, network, threads)
    if not outlined and settings.network.network in SURFACES and not is_wall(mask):
        account.warn("the window is a solid, and the surface lies inside of it: --signal boundary lays it around")
    account.space(network, pieces, int(np.count_nonzero(chosen.mask) - np.count_nonzero(mask)))
    sampling = _sampled(network)
    account.points(sampling.points, sampling.spacing_mm)
    space = SpaceFound(network, places)
    return Segmentation(stack, mask, NO_NETWORKS, labels, sampling.points, sampling, account.report, space=space)


def _outlined(mask: NDArray[np.bool_], settings: Settings) -> bool:
    """Tell whether the network sees the window's boundary; a torus, which has a hole of its own, is no wall."""
    asked = settings.network
    if asked.signal != "auto" or asked.network not in SURFACES:
        return asked.signal == "boundary"
    return asked.network == "torus" or not is_wall(mask)


def _sampled(network: SpaceNetwork) -> Sampling:
    """Return the neurons as the point set P; r is the longest edge."""
    ends = network.codebook[network.lattice.edges]
    spacing = float(np.sqrt(((ends[:, 1] - ends[:, 0]) ** 2).sum(axis=1)).max())
    points = replace(
        PointSet.from_positions(network.codebook), neurons=np.arange(len(network.codebook), dtype=np.int32)
    )
    return Sampling(points, spacing, 0, NOTHING, NOTHING)


@dataclass(frozen=True)
class _Rest:
    """A finer mesh at rest; `filled` (m,) are its faces where there was nothing to rest on."""

    mesh: TriMesh
    filled: NDArray[np.bool_]
    trace: Trace


def surface_of_space(stage_one: Segmentation, settings: Settings, account: Account, progress: Progress) -> Surface:
    """Make a network's own faces a closed surface that rests on the boundary of the window."""
    found, threads = stage_one.space, settings.run.threads
    assert found is not None
    with account.timed("untangle"):
        network, moved = _untangled(found.network, threads)
    with account.timed("smooth"):
        vertices, quads = squares_of(network)
        rough = QuadMesh(vertices, quads.astype(np.int64), np.zeros(len(quads), np.int64))
        start = rough.triangulated()
    account.faces(network, len(quads), moved)
    with account.timed("fit"):
        ring = OneRing.of_quads(quads, len(vertices), threads)
        rest = _fitted(rough, ring, found, settings, progress)
    with account.timed("untangle"):
        mesh, taken_back, crossing = untangle(rest.mesh, vertices, ring, Crossings(threads))
    account.rested(rest.trace, len(vertices), taken_back, rest.filled)
    with account.timed("quality"):
        check_promise(mesh, cavities=0)
        account.quality(mesh, PointSet.from_positions(found.places), 0, progress, crossing)
    none = np.empty(0, np.int32)
    return Surface(
        stage_one.points, NO_CUBES, rough, start, mesh, none, rest.trace, account.report, filled=rest.filled
    )  # fmt: skip


def _untangled(network: SpaceNetwork, threads: int) -> tuple[TriMesh, int]:
    """Return a network as a mesh that faces outward and does not pass through itself, if smoothing can help it."""
    mesh = TriMesh(network.codebook, network.lattice.faces)
    mesh, moved, _ = untangle(
        mesh, mesh.vertices, OneRing.of_edges(mesh.edges, len(mesh.vertices), threads), Crossings(threads)
    )
    outward = mesh.face_volumes.sum() > 0
    return mesh if outward else replace(mesh, faces=np.ascontiguousarray(mesh.faces[:, ::-1])), moved


def _fitted(rough: QuadMesh, ring: OneRing, found: SpaceFound, settings: Settings, progress: Progress) -> _Rest:
    """Draw the finer mesh to the boundary of the window; over a wall the network itself is the middle surface."""
    start, threads, origin = rough.triangulated(), settings.run.threads, found.places.min(axis=0)
    unfilled = np.zeros(len(start.faces), np.bool_)
    if not found.network.outlined:
        return _Rest(start, unfilled, NO_TRACE)
    edge = REACH * float(np.median(_lengths(rough)))
    if settings.fit.attraction == "nearest":
        mesh, trace = _drawn_to_points(rough, found.places, edge, settings, progress)
        return _Rest(mesh, unfilled, trace)
    samples = settle_points(found.places - origin, threads=threads, progress=progress)
    vertices = rough.vertices - origin
    rest = fit_to_surface(vertices, ring, samples, edge, settings.fit, threads=threads, progress=progress)
    mesh = TriMesh(rest.vertices + origin, rest.faces)
    return _Rest(mesh, any_of(rest.filled[rest.faces]), rest.trace)


def _lengths(rough: QuadMesh) -> Floats:
    ends = rough.vertices[rough.edges]
    return np.asarray(np.sqrt(((ends[:, 1] - ends[:, 0]) ** 2).sum(axis=1)))


def _drawn_to_points(
    rough: QuadMesh, places: Floats, edge: float, settings: Settings, progress: Progress
) -> tuple[TriMesh, Trace]:
    """Draw each vertex to the nearest place, first of all places, then around the last one (the paper's attraction)."""
    start = rough.triangulated()
    grid = partition(places, np.full(3, edge))
    cube_of = np.empty(len(places), np.int64)
    cube_of[grid.order] = np.repeat(np.arange(len(grid.keys)), np.diff(grid.start))
    cubes = cube_of[cKDTree(places).query(rough.vertices)[1]]
    springs = rough.edges if settings.fit.springs == "quads" else start.edges
    rest = fit(
        rough.vertices, springs, cubes, places, grid, settings.fit, threads=settings.run.threads, progress=progress
    )  # fmt: skip
    return start.moved(rest.vertices), rest.trace
