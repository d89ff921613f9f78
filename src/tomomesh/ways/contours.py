"""Several rings a slice: networks -> regions -> points -> levels around the rings -> boundary -> mesh."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import EmptyError
from ..followed import Followed, boundary_followed, components_followed
from ..isosurface.crossings import Levels
from ..isosurface.voxels import Boundary, boundary, voxel_surface
from ..measure.rings import assess_contours
from ..memory.limit import disk_folder
from ..model.sliced import ranges, some_of, together
from ..progress import Progress, silent
from ..results import Enclosed, Segmentation, Surface
from ..segmentation.contours.between import Between, filled_between
from ..segmentation.contours.train import train_contours
from ..segmentation.networks.training import regions
from ..segmentation.sample import sample_contours
from ..slabs.near import NearSurface
from ..stage import Stage, folded, measured
from .sections import body_of_voxels, boundary_found, missed, networks_on_slices, sampling_found
from .way import POINTS, TRAINING, Way, parameters

if TYPE_CHECKING:
    from ..isosurface.run_mask import RunMask
    from ..model.contours import Contours
    from ..model.volume import Volume
    from ..segmentation.study import Selected
    from ..settings import Settings

NOTHING = np.empty(0, np.int32)
FEW = 4
"""What part of the slices that are read together levels are drawn of together, where they are never whole: what lies
between the parts is drawn twice, and what they are made of takes three times their memory. Chosen."""


def segment_by_contours(kept: Selected, settings: Settings, progress: Progress) -> Stage[Segmentation[Contours]]:
    """Train a ring on every contour of each slice, and place their neurons in space."""
    study, mask, run = kept.study, kept.chosen.runs, settings.run
    pixel_mm = study.spacing_mm[:2]
    chosen = kept.chosen
    levels = Levels(chosen.volume.voxels, chosen.lower, chosen.upper, settings.window.layers)
    trained = measured(
        "networks", train_contours, mask, settings.network, levels=levels, pixel_mm=pixel_mm, seed=run.seed,
        threads=run.threads, progress=progress,
    )  # fmt: skip
    labels = partial(regions, mask, trained.value, pixel_mm=pixel_mm, threads=run.threads)
    placed = measured("points", sample_contours, trained.value, study)
    sampling = placed.value
    found = Segmentation(study, kept.plane, mask, labels, sampling.points, sampling, trained.value, levels)
    return folded(found, trained, _contours_found(trained.value, kept, settings), placed, sampling_found(placed.value))


def surface_by_contours(found: Segmentation[Contours], settings: Settings, progress: Progress) -> Stage[Surface]:
    """Let a net around the pixels that the rings enclose come to rest where the rings pass between them.

    Raises
    ------
    EmptyError
        Where the rings enclose the middle of no pixel, or are on one slice alone.
    """
    run = settings.run
    follows = measured("quality", followed_by, found, run.threads)  # before there is a net, which takes as much
    bounded = measured(
        "contours", boundary_of_rings, found, surface=settings.cubes.surface, threads=run.threads, progress=progress
    )
    made = bounded.value
    meshed = measured("fit", voxel_surface, made, settings.fit, threads=run.threads, progress=progress)
    rest = meshed.value
    surface = Surface(
        found.points, made.cuberille, rest.smoothed, rest.mesh, NOTHING, cavities=made.cavities,
        encloses=Enclosed("rings", found.sampling.volume_mm3).or_more(Enclosed.window(found)),
        follows=follows.value,
    )  # fmt: skip
    return folded(surface, bounded, meshed, follows, boundary_found(made, rest))


def followed_by(found: Segmentation[Contours], threads: int) -> Followed:
    """Return what of the window the contours are to follow."""
    if found.source.kind != "components":
        return boundary_followed(found.runs, found.volume)
    outlined = all(one.outlined for one in found.source.contours)
    return components_followed(found.runs, found.volume, outlined=outlined, threads=threads)


def levels_of_rings(found: Segmentation[Contours], threads: int = 0) -> tuple[Volume, RunMask]:
    """Return the levels around rings, drawn once, some slices at a time, and which voxels lie inside: what slabs take.

    Inside is what is over 0.

    Raises
    ------
    EmptyError
        As `surface_by_contours`.
    """
    _refuse_one_slice(found.source)
    between = Between.of(found.source, found.runs, found.volume, found.levels, threads)
    volume = between.over(found.volume)
    parts = ranges(0, between.shape[0], max(together(between.frame) // FEW, 1) * between.times)
    drawn = (some_of(volume.voxels, *part) for part in parts)
    levels: Any = NearSurface.of(drawn, between.most, disk_folder(), threads)
    _refuse_none(found.source, levels.inside.count)
    return replace(volume, voxels=levels), levels.inside


def boundary_of_rings(
    found: Segmentation[Contours], *, surface: str = "all", threads: int = 0, progress: Progress = silent
) -> Boundary:
    """Return the boundary of what rings enclose on their slices and between them, crossed where they pass."""
    contours = found.source
    _refuse_one_slice(contours)
    filled = filled_between(contours, found.runs, found.volume, levels=found.levels, threads=threads, progress=progress)
    inside = filled.voxels > 0
    _refuse_none(contours, int(np.count_nonzero(inside)))
    outer = "outer" if surface == "outer" else "all"
    return boundary(filled, inside, lower=0.0, surface=outer, threads=threads)


def _refuse_one_slice(contours: Contours) -> None:
    if len(contours.slices) < 2:
        found = f"{len(contours.slices)} slice"
        raise EmptyError("contours on one slice enclose no volume", found=found, expected="at least two slices")


def _refuse_none(contours: Contours, pixels: int) -> None:
    if not pixels:
        raise EmptyError(
            "the contours enclose no pixel", found=f"{len(contours)} contours", expected="contours wider than a pixel",
            hint="--way contours",
        )  # fmt: skip


def _contours_found(contours: Contours, kept: Selected, settings: Settings) -> Stage[None]:
    """Tell what was trained, and which slices have no contour."""
    each = contours.contours
    seen = {"boundary" if one.outlined else "region" for one in each}
    without, lost = missed(contours.slices, kept.chosen.runs)
    counted = contours.kind == "loops" and settings.network.neurons is None
    stats: dict[str, dict[str, Any]] = {
        "networks": {
            "topology": "ring",
            "neurons": None if counted else settings.network.neuron_count,
            "trained": len(contours.slices),
            "signal": seen.pop() if len(seen) == 1 else "both",
            "pixels": sum(one.pixels for one in each),
            "strays": sum(one.strays for one in each),
            "slices_without": without,
        }
    }
    if len(contours):
        stats["rings"] = assess_contours(contours, kept.study.spacing_mm[:2], closed=True)
    crossings = stats.get("rings", {}).get("crossings")
    crossed = f"contours of a slice cross each other {crossings} time(s): more --neurons keep them apart"
    return Stage(None, stats, (*lost, *((crossed,) if crossings else ())))


def _of_networks(report: dict[str, Any]) -> list[str]:
    """Say what contours there are, and what becomes of them from slice to slice."""
    rings = report["rings"]
    return [
        f"contours  {rings['count']} {rings['kind']} on {report['networks']['trained']} slices, "
        f"{rings['neurons']} neurons, {rings['dropped']} too small, {len(rings['bridged_gaps'])} bridged gap(s)",
        f"          {rings['tracks']} tracks: {rings['births']} born, {rings['branches']} branched, "
        f"{rings['merges']} merged",
    ]


WAY = Way(
    applies=lambda settings, input: input not in POINTS and settings.network.contours not in ("auto", "one"),
    because=lambda settings, input: "with --way contours",
    reads=TRAINING | parameters("bridge", "even", "surface", "stiffness", "allow_leaks"),
    segment=segment_by_contours,
    surface=surface_by_contours,
    of_networks=_of_networks,
    of_body=lambda report: body_of_voxels(report, "crossed where the rings pass"),
    pictures=networks_on_slices,
)
