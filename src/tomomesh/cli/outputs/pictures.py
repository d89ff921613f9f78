"""Hand the stages of a result to the gallery."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ...model.contours import Contours
from ...model.lattice import lattice
from ...model.networks import Networks
from ...segmentation.contours.one import train_slice
from ...segmentation.contours.shown import Shown
from ...segmentation.signal import outline, pixels_of
from ...show import draw_all
from ...show.film import draw_key_frames, film
from ...show.fit import draw_learning
from ...show.gallery import median_slice
from ...show.maps import SHEETS, draw_maps
from ...show.plane import Plane
from ...show.topologies import draw_adapted, draw_update_regions
from ...som.fit import match
from ...som.passes import Look
from ...som.snapshots import snapshots
from ...ways import way_of

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from numpy.typing import NDArray

    from ...results import Segmentation, Surface
    from ...settings import Settings
    from ...show.drawing.page import Page
    from ...som.region import TrainedNetwork

FRAMES, KEY_FRAMES = 40, 6
"""Most frames of a network that is filmed, and of those that are drawn beside each other."""


def pictures(
    stage_one: Segmentation[Any] | None, surface: Surface | None, settings: Settings
) -> Iterator[tuple[str, Page]]:
    """Yield every picture that the stages allow, with its name."""
    stages: dict[str, Any] = {"tolerance": settings.fit.tolerance}
    if surface is not None:
        stages |= {
            "points": surface.points,
            "smoothed": surface.smoothed,
            "mesh": surface.mesh,
            "trace": surface.trace,
            "view": surface.view,
        }
    if surface is not None and len(surface.cuberille.quads):
        stages |= {"cuberille": surface.cuberille, "triangulated": surface.cuberille.triangulated()}
    if stage_one is not None:
        way = way_of(stage_one.way)
        stages |= {
            "images": _shown(stage_one, settings),
            "mask": stage_one.mask,
            "points": stage_one.points,
            "plane": _plane(stage_one),
            **way.pictures(stage_one),
        }
    if surface is not None and stage_one is not None:
        stages["on_slices"] = surface.mesh.moved(stage_one.volume.to_indices(surface.mesh.vertices))
    return draw_all(**stages)


def pictures_of_network(trained: TrainedNetwork, title: str, axes: slice) -> Iterator[tuple[str, Page]]:
    """Yield the pictures of a network on a region, with their names; `axes` are those that are places."""
    inputs, codebook, graph = trained.inputs, trained.codebook, trained.lattice
    start = trained.start[:, axes]
    yield "01-topologies", draw_update_regions()
    yield "02-network", draw_adapted(inputs[:, axes], codebook[:, axes], graph, start=start, title=title)
    yield "02-learning", draw_learning(trained.history)
    if graph.name in SHEETS:
        winners, _ = match(codebook, inputs)
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


def key_frames(found: Segmentation[Any]) -> Page | None:
    """Train what the slice with the median window has once more, looking on; None where slices have no networks."""
    if isinstance(found.source, Networks) and len(found.source.slices):
        return _network_frames(found, found.source)
    return _ring_frames(found, found.source) if isinstance(found.source, Contours) else None


def _network_frames(found: Segmentation[Any], networks: Networks) -> Page:
    settings = found.settings
    k, spacing = median_slice(found.mask, networks.slices), np.array(found.volume.spacing_mm[:2])
    window = found.mask[k]
    inputs = (outline if networks.outlined else pixels_of)(window)[:, :2] * spacing
    seen = snapshots(
        inputs, networks.lattice, settings.network, seed=settings.run.seed, pixel_area=float(spacing.prod()),
        most=KEY_FRAMES - 1,
    )  # fmt: skip
    notes = [*(f"{step:,} {seen.unit}" for step in seen.steps), "as it was handed on"]
    codebooks = [*(one / spacing for one in seen.codebooks), networks.codebook_on(k)]
    title = f"{networks.lattice.name} of {len(networks.lattice)} neurons, slice {k + 1}"
    return draw_key_frames(window, codebooks, networks.lattice.edges, _plane(found), notes=notes, title=title)


def _ring_frames(found: Segmentation[Any], contours: Contours) -> Page:
    """Draw all rings of a slice at the same shares of their trainings, which may be of different lengths."""
    run, pixel_mm = found.settings.run, found.volume.spacing_mm[:2]
    network = found.settings.network.taking(found.way)
    shown = Shown.of(found.runs, found.levels, network, pixel_mm, run.seed, run.threads)
    k = median_slice(found.mask, contours.slices)
    seen: list[list[NDArray[np.float64]]] = [[] for _ in contours.on(k)]
    train_slice(contours, shown, k, [Look(_kept(one), KEY_FRAMES - 2) for one in seen])
    shares = np.linspace(0, 1, KEY_FRAMES - 1)
    codebooks = [np.concatenate([one[round(share * (len(one) - 1))] for one in seen]) / pixel_mm for share in shares]
    notes = ["at the start", *(f"{share:.0%} of the training" for share in shares[1:]), "as they were handed on"]
    starts = np.cumsum([0, *map(len, contours.on(k))])
    edges = np.concatenate(
        [lattice("ring", n).edges + start for n, start in zip(np.diff(starts), starts, strict=False)]
    )
    title = f"{len(seen)} rings, slice {k + 1}" if len(seen) > 1 else f"a ring, slice {k + 1}"
    return draw_key_frames(
        found.mask[k], [*codebooks, contours.codebook_on(k)], edges, _plane(found), notes=notes, title=title
    )


def _kept(seen: list[NDArray[np.float64]]) -> Callable[..., None]:
    return lambda codebook, done, radius, alpha: seen.append(codebook)


def _plane(found: Segmentation[Any]) -> Plane:
    """Return spacing and sense of the slices."""
    return Plane(spacing_mm=found.volume.spacing_mm[:2], upward=found.plane != "axial")


def _shown(stage_one: Segmentation[Any], settings: Settings) -> NDArray[Any]:
    """Return the levels of the slices; of a label map by itself what is chosen, over other labels, over background.

    The number of a label is no gray level.
    """
    voxels, select = stage_one.volume.voxels, settings.window.select
    if select is None or not np.isin(voxels[stage_one.mask], select).mean() > 0.5:
        return voxels
    return np.where(stage_one.mask, 2, voxels > 0).astype(np.uint8)
