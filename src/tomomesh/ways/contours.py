"""Several rings a slice: networks -> regions -> points -> insides -> voxels between the slices -> mesh."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..contours.known import known_slices
from ..errors import EmptyError
from ..measure.rings import assess_contours
from ..results import Enclosed, Segmentation
from ..segmentation.contours.train import train_contours
from ..segmentation.sample import sample_contours
from ..segmentation.training import regions
from ..stage import Stage, folded, measured
from .sections import missed, networks_on_slices, sampling_found
from .stack import body_of_stack, surface_of_slices
from .way import POINTS, TRAINING, Way, parameters

if TYPE_CHECKING:
    from ..contours.slices import Slices
    from ..model.contours import Contours
    from ..model.points import PointSet
    from ..progress import Progress
    from ..results import Surface
    from ..segmentation.study import Selected
    from ..settings import Settings


def segment_by_contours(kept: Selected, settings: Settings, progress: Progress) -> Stage[Segmentation[Contours]]:
    """Train a ring on every contour of each slice, and place their neurons in space."""
    study, mask, run = kept.study, kept.mask, settings.run
    pixel_mm = study.spacing_mm[:2]
    trained = measured(
        "networks", train_contours, mask, settings.network, pixel_mm=pixel_mm, seed=run.seed, threads=run.threads,
        progress=progress,
    )  # fmt: skip
    labels = measured("regions", regions, mask, trained.value, pixel_mm=pixel_mm, threads=run.threads)
    placed = measured("points", sample_contours, trained.value, study)
    sampling = placed.value
    found = Segmentation(study, kept.plane, mask, labels.value, sampling.points, sampling, trained.value)
    return folded(
        found, trained, labels, _contours_found(trained.value, kept, settings), placed, sampling_found(placed.value)
    )


def surface_by_contours(found: Segmentation[Contours], settings: Settings, progress: Progress) -> Stage[Surface]:
    """Close the contours of all slices."""
    encloses = Enclosed("rings", found.sampling.volume_mm3).or_more(Enclosed.window(found))
    finest, sampling = min(found.volume.spacing_mm[:2]), found.sampling
    return surface_of_slices(
        found.points, slices_of_rings(found.points), settings, progress, finest=finest, bridged=sampling.bridged,
        encloses=encloses,
    )  # fmt: skip


def slices_of_rings(points: PointSet) -> Slices:
    """Return the slices of the rings of a study, which know them.

    Raises
    ------
    EmptyError
        Where they are on one slice alone.
    """
    slices = known_slices(points)
    if slices is None:
        found = f"{len(np.unique(points.slices))} slice"
        raise EmptyError("contours on one slice enclose no volume", found=found, expected="at least two slices")
    return slices


def _contours_found(contours: Contours, kept: Selected, settings: Settings) -> Stage[None]:
    """Tell what was trained, and which slices have no contour."""
    each = contours.contours
    seen = {"boundary" if one.outlined else "region" for one in each}
    without, lost = missed(contours.slices, kept.mask)
    stats: dict[str, dict[str, Any]] = {
        "networks": {
            "topology": "ring",
            "neurons": settings.network.neuron_count,
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
    reads=TRAINING | parameters("bridge", "even", "cell_mm", "cell_factor", "stiffness", "allow_leaks"),
    segment=segment_by_contours,
    surface=surface_by_contours,
    of_networks=_of_networks,
    of_body=body_of_stack,
    pictures=networks_on_slices,
)
