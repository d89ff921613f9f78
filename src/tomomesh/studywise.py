"""Stage one, one arrow a line: study -> mask -> networks -> regions -> points."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .contourwise import find_contours
from .errors import UsageError
from .model.volume import AXES, Volume, order_along
from .results import NO_NETWORKS, Segmentation
from .segmentation.contours.inputs import share_of_holes, slices_with_several
from .segmentation.crop import crop, inside_roi
from .segmentation.grid import onto_grid
from .segmentation.labels import doubted
from .segmentation.sample import sample
from .segmentation.selection import Chosen, choose
from .segmentation.training import regions, train_study
from .segmentation.window import by_layer
from .spacewise import segment_in_space
from .voxelwise import find_boundary, sampled

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .account import Account
    from .model.networks import Networks
    from .progress import Progress
    from .settings import Settings


def segment_study(
    volume: Volume, labels: Volume | None, settings: Settings, account: Account, progress: Progress
) -> Segmentation:
    """Run stage one: the window or the labels of a study, its networks, and the points in patient millimeters."""
    if not isinstance(volume, Volume):
        raise UsageError(
            "a study is a Volume",
            found=type(volume).__name__,
            expected="read_volume(path) or Volume.from_stored(array, affine)",
        )
    axis = _slice_axis(volume, settings.network.slices)
    part, box = crop(volume, settings.crop, axis)
    stack = part.along(axis)
    account.study(stack, AXES[axis])
    account.cropped(tuple(box[n] for n in order_along(axis)), volume.along(axis).shape)
    if labels is not None:
        labels = _fitting(labels, volume, settings).cropped(box).along(axis)
        account.notes(labels.notes)
    chosen = _chosen(stack, labels, settings, account)
    mask = chosen.mask
    if settings.network.network == "none":
        return _segment_voxels(stack, chosen, settings, account)
    if settings.network.in_space:
        return segment_in_space(chosen, settings, account, progress)
    if settings.network.contours != "one":
        contours, regions_, sampling = find_contours(stack, mask, settings, account, progress)
        return Segmentation(
            stack, mask, NO_NETWORKS, regions_, sampling.points, sampling, account.report, contours=contours
        )  # fmt: skip
    networks = _networks(stack, mask, _layers(chosen, settings), settings, account, progress)
    with account.timed("regions"):
        found = regions(mask, networks, pixel_mm=stack.spacing_mm[:2], threads=settings.run.threads)
    account.networks(networks, mask)
    account.crowded(slices_with_several(mask, settings.run.threads), len(networks.slices))
    if networks.outlined:
        account.filled_holes(share_of_holes(mask, settings.run.threads))
    with account.timed("points"):
        sampling = sample(
            networks, stack, caps=settings.cubes.caps, bridge=settings.network.bridge,
            cell_from=settings.cubes.cell_from,
        )  # fmt: skip
    account.points(sampling.points, sampling.spacing_mm, sampling.bridged)
    return Segmentation(stack, mask, networks, found, sampling.points, sampling, account.report)


def _fitting(labels: Volume, volume: Volume, settings: Settings) -> Volume:
    """Lay a label map onto the study's grid; refuse one of which no label is asked for."""
    if settings.window.select is None:
        raise UsageError("no label was chosen", found="a label map", expected="--select with its labels")
    return onto_grid(labels, volume)


def _chosen(stack: Volume, labels: Volume | None, settings: Settings, account: Account) -> Chosen:
    with account.timed("window"):
        chosen = choose(stack, labels, settings, inside_roi(stack, settings.crop.roi))
    account.window(chosen)
    if settings.window.select is not None and (doubt := doubted(stack if labels is None else labels)):
        account.warn(doubt)
    return chosen


def _layers(chosen: Chosen, settings: Settings) -> NDArray[np.bool_] | None:
    """Return the window of each layer (K, J, I, L), where networks are shown layers."""
    if not _presents_layers(chosen.volume, settings):
        return None
    return by_layer(chosen.volume, lower=chosen.lower, upper=chosen.upper) & chosen.mask[..., None]


def _presents_layers(stack: Volume, settings: Settings) -> bool:
    return stack.layers > 1 and settings.network.inputs == "layers"


def _networks(
    stack: Volume,
    mask: NDArray[np.bool_],
    layers: NDArray[np.bool_] | None,
    settings: Settings,
    account: Account,
    progress: Progress,
) -> Networks:
    with account.timed("networks"):
        return train_study(
            mask,
            settings.network,
            layers=layers,
            pixel_mm=stack.spacing_mm[:2],
            seed=settings.run.seed,
            threads=settings.run.threads,
            progress=progress,
        )


def _segment_voxels(stack: Volume, chosen: Chosen, settings: Settings, account: Account) -> Segmentation:
    """Take the boundary of the window in place of networks."""
    mask, found = chosen.mask, find_boundary(chosen, settings, account)
    return Segmentation(
        stack, mask, NO_NETWORKS, mask.astype(np.uint16), found.points, sampled(found), account.report,
        boundary=found,
    )  # fmt: skip


def _slice_axis(volume: Volume, slices: str) -> int:
    if slices == "auto":
        return volume.thickest_axis()
    return volume.stored_axis if slices == "stored" else AXES.index(slices)
