"""Hand the stages of a result to the gallery."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..model.lattice import Lattice
from ..model.networks import Networks
from ..model.points import PointSet
from ..show import draw_all
from ..show.film import film
from ..show.gallery import median_slice
from ..show.maps import SHEETS, draw_maps
from ..show.plane import Plane
from ..show.render import View
from ..show.topologies import draw_adapted, draw_update_regions
from ..som.fit import match
from ..som.snapshots import snapshots

if TYPE_CHECKING:
    from collections.abc import Iterator

    from matplotlib.figure import Figure

    from ..results import Segmentation, Surface
    from ..settings import Settings
    from ..som.region import TrainedNetwork

FRAMES = 40
"""Most looks at a network that is filmed."""


def pictures(
    stage_one: Segmentation | None, surface: Surface | None, settings: Settings
) -> Iterator[tuple[str, Figure]]:
    """Yield every picture that the stages allow, with its name."""
    stages: dict[str, Any] = {"tolerance": settings.fit.tolerance}
    if stage_one is not None:
        volume = stage_one.volume
        plane = stage_one.report["study"]["plane"]
        stages |= {
            "images": volume.voxels,
            "mask": stage_one.mask,
            "networks": stage_one.networks if stage_one.contours is None else _on_one_slice(stage_one),
            "labels": stage_one.labels,
            "contours": stage_one.contours,
            "points": _drawn(stage_one),
            "plane": Plane(spacing_mm=volume.spacing_mm[:2], upward=plane != "axial"),
        }
    if surface is not None:
        stages |= {
            "points": surface.points if stage_one is None else _drawn(stage_one),
            "cuberille": surface.cuberille,
            "triangulated": surface.cuberille.triangulated(),
            "smoothed": surface.smoothed,
            "mesh": surface.mesh,
            "trace": surface.trace,
            "view": _view(stage_one, settings),
        }
    if surface is not None and stage_one is not None:
        stages["on_slices"] = surface.mesh.moved(stage_one.volume.to_indices(surface.mesh.vertices))
    return draw_all(**stages)


def pictures_of_network(trained: TrainedNetwork, title: str, axes: slice) -> Iterator[tuple[str, Figure]]:
    """Yield the pictures of a network on a region, with their names; `axes` are those that are places."""
    inputs, codebook, graph = trained.inputs, trained.codebook, trained.lattice
    start = trained.start[:, axes]
    yield "01-topologies", draw_update_regions()
    yield "02-network", draw_adapted(inputs[:, axes], codebook[:, axes], graph, start=start, title=title)
    if graph.name in SHEETS:
        winners, _ = match(np.ascontiguousarray(codebook.T), np.ascontiguousarray(inputs.T))
        yield "02-maps", draw_maps(codebook, graph, winners)


def film_of_network(trained: TrainedNetwork, settings: Settings, pixel_area: float, title: str, axes: slice) -> bytes:
    """Train once more, looking on; the last frame is the network as it is handed back."""
    seen = snapshots(
        trained.inputs, trained.lattice, settings.network, seed=settings.run.seed, pixel_area=pixel_area, most=FRAMES
    )  # fmt: skip
    notes = [f"{trained.lattice.name} of {len(trained.lattice)} neurons, {step:,} {seen.unit}" for step in seen.steps]
    codebooks = [*seen.codebooks]
    if not np.array_equal(codebooks[-1], trained.codebook):
        codebooks.append(trained.codebook)
        notes.append(f"{notes[-1]}, spaced evenly")
    places = [one[:, axes] for one in codebooks]
    return film(trained.inputs[:, axes], places, trained.lattice, notes=notes, title=title)


def _on_one_slice(stage_one: Segmentation) -> Networks:
    """Return the rings of the slice that is drawn as one network."""
    found = stage_one.contours
    assert found is not None
    k = median_slice(stage_one.mask, found.slices)
    rings = found.on(k)
    first = np.cumsum([0, *map(len, rings)])
    edges = [
        n + np.stack([np.arange(len(ring)), (np.arange(len(ring)) + 1) % len(ring)], axis=1)
        for n, ring in zip(first[:-1], rings, strict=True)
    ]
    hops = np.zeros((first[-1], first[-1]), np.int32)
    return Networks(
        Lattice("rings", np.concatenate(edges), hops, (int(first[-1]),)),
        np.array([k], np.int32),
        np.concatenate([ring.codebook for ring in rings])[None],
        np.concatenate([ring.bridged for ring in rings])[None],
        rings[0].outlined,
        np.array([sum(ring.pixels for ring in rings)]),
        np.array([sum(ring.strays for ring in rings)]),
    )


def _drawn(stage_one: Segmentation) -> PointSet:
    """Return the points; without a network there are no kinds of neurons to tell apart."""
    points = stage_one.points
    return points if stage_one.boundary is None else PointSet.from_positions(points.positions)


def _view(stage_one: Segmentation | None, settings: Settings) -> View:
    """Name the axes of the patient where there is one, and plainly where there is a cloud."""
    return View() if stage_one is not None else View(unit=settings.run.units, axes=("x", "y", "z"))
