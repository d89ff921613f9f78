"""One network in space: the window's boundary or voxels -> network -> its own faces, divided -> mesh."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy

from ..cuberille.partition import partition
from ..dynamics.low_pass import OneRing
from ..dynamics.mass_spring import fit
from ..dynamics.moving_least_squares import fit_to_surface
from ..dynamics.subdivision import squares_of
from ..dynamics.untangle import untangle
from ..errors import GeometryError, UsageError
from ..followed import Followed, outline_followed
from ..isosurface.voxels import boundary
from ..measure.intersections import CrossingFaces
from ..model.columns import any_of
from ..model.lattice import other_number
from ..model.mesh import QuadMesh, TriMesh
from ..model.points import PointSet
from ..pointcloud.samples import settle_points
from ..results import Enclosed, Segmentation, Surface
from ..segmentation.sample import Sampling
from ..segmentation.space import is_wall, pieces_of, regions_in_space, sees_boundary, train_space, untangled
from ..settings import SURFACES
from ..stage import Stage, folded, measured, timed
from .sections import fit_found, points_found
from .way import POINTS, TRAINING, Way, parameters

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..model.networks import SpaceNetwork
    from ..model.trace import Trace
    from ..progress import Progress
    from ..segmentation.study import Selected
    from ..settings import Settings

    Floats = NDArray[np.float64]

REACH = 1.5
"""Most that a vertex moves in a step of the fit, sides of the finer mesh. Chosen: half of it changes the distance by
+0.0 %, twice by +0.1 %."""
FLAT = 1e-9
"""Least volume, in its area to the power of 1.5: a ball has .09, and what lies flat has rounding errors alone."""
LEFT_OUT = 0.01
"""Share of the window in small pieces over which a network in space is warned of. Chosen: no mesh depends on it."""


@dataclass(frozen=True)
class SpaceFound:
    """One network in space, and what it was trained on.

    Attributes
    ----------
    network : SpaceNetwork
    places : (n, 3) float array
        The window's boundary or its voxels in patient millimeters, all of them.
    follows : Followed
    """

    network: SpaceNetwork
    places: Floats
    follows: Followed


@dataclass(frozen=True)
class Shown:
    """What a network is shown: voxels (n, 3) in patient millimeters, or the boundary around them; what it follows."""

    voxels: Floats
    places: Floats
    outlined: bool
    follows: Followed


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


def segment_in_space(kept: Selected, settings: Settings, progress: Progress) -> Stage[Segmentation[SpaceFound]]:
    """Train one network on the whole window."""
    run = settings.run
    pieces = measured("window", pieces_of, kept.mask)
    mask, count = pieces.value
    shown = measured("points", shown_in_space, kept, mask, settings)
    voxels, places, outlined = shown.value.voxels, shown.value.places, shown.value.outlined
    progress("networks", 0, 1)
    trained = measured("networks", train_space, places, settings.network, outlined=outlined, seed=run.seed)
    progress("networks", 1, 1)
    labels = partial(regions_in_space, mask, voxels, trained.value, run.threads)
    network, sampling = trained.value, _sampled(trained.value)
    source = SpaceFound(network, places, shown.value.follows)
    found = Segmentation(kept.study, kept.plane, kept.chosen.runs, labels, sampling.points, sampling, source)
    inside = not outlined and settings.network.network in SURFACES and not is_wall(mask)
    dropped = int(np.count_nonzero(kept.mask) - np.count_nonzero(mask))
    asked = settings.network.neurons
    told = _network_found(network, kept.mask, count, dropped, inside=inside, asked=asked)
    return folded(found, pieces, shown, trained, told, points_found(sampling.points, sampling.spacing_mm))


def shown_in_space(kept: Selected, mask: NDArray[np.bool_], settings: Settings) -> Shown:
    """Return what a network is shown of the pieces (K, J, I) of a window that it is to stand for."""
    voxels = kept.study.to_mm(np.argwhere(mask)[:, ::-1].astype(np.float64))
    if not sees_boundary(mask, settings.network):
        follows = outline_followed(mask, kept.study, threads=settings.run.threads).as_closed("space")
        return Shown(voxels, voxels, False, follows)
    chosen = kept.chosen
    found = boundary(
        chosen.volume, mask, lower=chosen.lower, upper=chosen.upper, layers=settings.window.layers, surface="outer",
        divide=settings.cubes.divide, threads=settings.run.threads,
    )  # fmt: skip
    return Shown(voxels, found.points.positions, True, Followed.in_space(found, mask))


def _network_found(
    network: SpaceNetwork, mask: NDArray[np.bool_], pieces: int, dropped: int, *, inside: bool, asked: int | None
) -> Stage[None]:
    """Tell of the one network in space, and what of the window it does not stand for."""
    voxels = int(np.count_nonzero(mask))
    stats: dict[str, dict[str, Any]] = {
        "networks": {
            "topology": network.lattice.name,
            "neurons": len(network.lattice),
            "trained": 1,
            "signal": "boundary" if network.outlined else "region",
            "pixels": network.inputs,
            "strays": network.strays,
            "slices_without": [],
        },
        "space": {"pieces": pieces, "dropped_voxels": dropped},
    }
    other = other_number(network.lattice, asked)
    warnings = [other] if other else []
    if inside:
        warnings.append("the window is a solid, and the surface lies inside of it: --signal boundary lays it around")
    if pieces > 1:
        warnings.append(f"the window is in {pieces} pieces, and one network spans them all")
    if dropped > LEFT_OUT * voxels:
        warnings.append(f"{dropped} of {voxels} voxels of the window lie in small pieces, and were left out")
    return Stage(None, stats, tuple(warnings))


def _sampled(network: SpaceNetwork) -> Sampling:
    """Return the neurons as the point set P; r is the longest edge."""
    spacing = float(_lengths(network.codebook, network.lattice.edges).max())
    points = replace(
        PointSet.from_positions(network.codebook), neurons=np.arange(len(network.codebook), dtype=np.int32)
    )
    return Sampling(points, spacing, 0, np.empty(0), np.empty(0))


@dataclass(frozen=True)
class _Rest:
    """A finer mesh at rest; `filled` (m,) are its faces where there was nothing to rest on."""

    mesh: TriMesh
    filled: NDArray[np.bool_]
    trace: Trace | None


def surface_in_space(found: Segmentation[SpaceFound], settings: Settings, progress: Progress) -> Stage[Surface]:
    """Make a network's own faces a closed surface that rests on the boundary of the window."""
    threads = settings.run.threads
    apart = measured("untangle", untangled, found.source.network, found.source.places, threads)
    faces = _divide(*apart.value)
    rough = faces.value
    ring = OneRing.of_quads(rough.quads.astype(np.int32), len(rough.vertices), threads)
    rest = measured("fit", _fitted, rough, ring, found.source, settings, progress)
    mesh = measured(
        "untangle", untangle, rest.value.mesh, rough.vertices, ring, CrossingFaces(threads, single=True), rough.vertices
    )  # fmt: skip
    made, taken_back, crossing = mesh.value
    _require_volume(made, len(found.source.network.lattice))
    surface = Surface(
        found.points, rough, rough.triangulated(), made, np.empty(0, np.int32), trace=rest.value.trace,
        filled=rest.value.filled, crossing=crossing, rests_on=found.source.places, encloses=Enclosed.window(found),
        follows=found.source.follows,
    )  # fmt: skip
    fitted = fit_found(rest.value.trace, len(rough.vertices), taken_back=taken_back, filled=rest.value.filled)
    return folded(surface, apart, faces, rest, mesh, fitted)


def _require_volume(mesh: TriMesh, neurons: int) -> None:
    """Refuse a surface that has fallen flat, or has turned inside out."""
    volume = float(mesh.face_volumes.sum())
    if volume <= FLAT * float(mesh.face_areas.sum()) ** 1.5:
        raise GeometryError(
            "the network bounds nothing: its surface has fallen flat or turned inside out",
            found=f"{neurons} neurons, volume = {volume:.4g} mm^3", expected="a volume over 0",
            hint="other --neurons, --network or --start; --way voxels takes the window's boundary",
        )  # fmt: skip


@timed("smooth")
def _divide(network: TriMesh, moved: int) -> Stage[QuadMesh]:
    """Divide a network's own faces into finer squares."""
    vertices, quads = squares_of(network)
    rough = QuadMesh(vertices, quads.astype(np.int64))
    stats: dict[str, dict[str, Any]] = {
        "space": {"faces": len(network.faces), "untangled": moved},
        "surface": {
            "found": 1, "cavities": 0, "taken": 1, "debris": 0, "square_faces": len(quads), "enclosed_cubes": 0,
        },
    }  # fmt: skip
    return Stage(rough, stats)


def _fitted(rough: QuadMesh, ring: OneRing, found: SpaceFound, settings: Settings, progress: Progress) -> _Rest:
    """Draw the finer mesh to the boundary of the window; over a wall the network itself is the middle surface."""
    start, threads, origin = rough.triangulated(), settings.run.threads, found.places.min(axis=0)
    unfilled = np.zeros(len(start.faces), np.bool_)
    if not found.network.outlined:
        return _Rest(start, unfilled, None)
    edge = REACH * float(np.median(_lengths(rough.vertices, rough.edges)))
    if settings.fit.attraction == "nearest":
        mesh, trace = _drawn_to_points(rough, found.places, edge, settings, progress)
        return _Rest(mesh, unfilled, trace)
    samples = settle_points(found.places - origin, threads=threads, progress=progress)
    vertices = rough.vertices - origin
    rest = fit_to_surface(vertices, ring, samples, edge, settings.fit, threads=threads, progress=progress)
    mesh = TriMesh(rest.vertices + origin, rest.faces)
    return _Rest(mesh, any_of(rest.filled[rest.faces]), rest.trace)


def _lengths(places: Floats, edges: NDArray[np.int64]) -> Floats:
    ends = places[edges]
    return np.asarray(np.sqrt(((ends[:, 1] - ends[:, 0]) ** 2).sum(axis=1)))


def _drawn_to_points(
    rough: QuadMesh, places: Floats, edge: float, settings: Settings, progress: Progress
) -> tuple[TriMesh, Trace]:
    """Draw each vertex to the nearest place, first of all places, then around the last one (the paper's attraction)."""
    start = rough.triangulated()
    grid = partition(places, np.full(3, edge))
    cube_of = np.empty(len(places), np.int64)
    cube_of[grid.order] = np.repeat(np.arange(len(grid.keys)), np.diff(grid.start))
    cubes = cube_of[scipy.spatial.cKDTree(places).query(rough.vertices)[1]]
    springs = rough.edges if settings.fit.springs == "quads" else start.edges
    rest = fit(
        rough.vertices, springs, cubes, places, grid, settings.fit, threads=settings.run.threads, progress=progress
    )  # fmt: skip
    return start.moved(rest.vertices), rest.trace


def _of_networks(report: dict[str, Any]) -> list[str]:
    """Say what the one network in space is."""
    networks, left = report["networks"], report["space"]["dropped_voxels"]
    return [
        f"network   a {networks['topology']} of {networks['neurons']} neurons in space on the window's "
        f"{'boundary' if networks['signal'] == 'boundary' else 'voxels'}, "
        f"{left or 'no'} voxel(s) of small pieces left out"
    ]


def _of_body(report: dict[str, Any]) -> list[str]:
    space = report["space"]
    return [f"faces     {space['faces']} of the network, divided into {report['surface']['square_faces']} squares"]


def _because(settings: Settings, input: str) -> str:
    return f"with {'--space volume' if settings.network.space == 'volume' else f'--network {settings.network.network}'}"


NEAREST = {"attraction": ("nearest",)}
WAY = Way(
    applies=lambda settings, input: input not in POINTS and settings.network.in_space,
    because=_because,
    reads=TRAINING
    | parameters(
        "allow_leaks", "divide", "attraction", "damping", "step", stiffness=NEAREST, springs=NEAREST, limit=NEAREST
    ),
    segment=segment_in_space,
    surface=surface_in_space,
    require=require_surface,
    of_networks=_of_networks,
    of_body=_of_body,
)
