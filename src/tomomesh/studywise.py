"""Stage one, one arrow a line: study -> mask -> networks -> regions -> points."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from .contourwise import find_contours
from .errors import UsageError
from .model.volume import AXES, Volume
from .results import NO_NETWORKS, Segmentation
from .segment.contours.looks import share_of_holes, slices_with_several
from .segment.sample import sample
from .segment.select import require_same_grid, select
from .segment.study import regions, train_study
from .segment.window import by_layer, choose_window, window
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
    stack = volume.along(axis)
    account.study(stack, AXES[axis])
    chosen = _selected(volume, labels, settings, account)
    kept = None if chosen is None else np.ascontiguousarray(replace(volume, voxels=chosen).along(axis).voxels)
    if settings.network.network == "none":
        return _segment_voxels(stack, kept, settings, account)
    if settings.network.in_space:
        return segment_in_space(stack, kept, settings, account, progress)
    mask, layers = _window(stack, settings, account) if kept is None else (kept, None)
    if settings.network.contours != "one":
        contours, regions_, sampling = find_contours(stack, mask, settings, account, progress)
        return Segmentation(
            stack, mask, NO_NETWORKS, regions_, sampling.points, sampling, account.report, contours=contours
        )  # fmt: skip
    networks = _networks(stack, mask, layers, settings, account, progress)
    with account.timed("regions"):
        found = regions(mask, networks, pixel_mm=stack.spacing_mm[:2], threads=settings.run.threads)
    account.networks(networks, mask)
    account.crowded(slices_with_several(mask, settings.run.threads), len(networks.slices))
    if networks.outlined:
        account.filled_holes(share_of_holes(mask, settings.run.threads))
    with account.timed("points"):
        sampling = sample(networks, stack, caps=settings.cubes.caps, bridge=settings.network.bridge)
    account.points(sampling.points, sampling.spacing_mm, sampling.bridged)
    return Segmentation(stack, mask, networks, found, sampling.points, sampling, account.report)


def _selected(volume: Volume, labels: Volume | None, settings: Settings, account: Account) -> NDArray[np.bool_] | None:
    """Return the voxels of the labels that were asked for; None where a window is."""
    wanted = settings.window.select
    if wanted is None:
        if labels is not None:
            raise UsageError("no label was chosen", found="a label map", expected="--select with its labels")
        return None
    if labels is not None:
        require_same_grid(labels, volume)
    with account.timed("window"):
        mask = select(volume if labels is None else labels, wanted)
    account.window(mask, -np.inf, np.inf)
    return mask


def _window(stack: Volume, settings: Settings, account: Account) -> tuple[NDArray[np.bool_], NDArray[np.bool_] | None]:
    """Return the window (K, J, I), and that of each layer (K, J, I, L) where networks are shown layers."""
    with account.timed("window"):
        lower, upper = choose_window(stack, settings.window)
        mask = window(stack, lower=lower, upper=upper, layers=settings.window.layers)
        layers = (
            by_layer(stack, lower=lower, upper=upper) & mask[..., None] if _presents_layers(stack, settings) else None
        )
    account.window(mask, lower, upper, stack.layers)
    return mask, layers


def _presents_layers(stack: Volume, settings: Settings) -> bool:
    return stack.layers > 1 and settings.network.inputs == "layers" and not settings.network.in_space


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


def _segment_voxels(
    stack: Volume, kept: NDArray[np.bool_] | None, settings: Settings, account: Account
) -> Segmentation:
    """Take the boundary of the window in place of networks."""
    if kept is not None:
        stack, settings = replace(stack, voxels=kept.view(np.uint8)), settings.replace(select=None, lower=0.5)
    mask, found = find_boundary(stack, settings, account)
    return Segmentation(
        stack, mask, NO_NETWORKS, mask.astype(np.uint16), found.points, sampled(found), account.report, boundary=found
    )


def _slice_axis(volume: Volume, slices: str) -> int:
    if slices == "auto":
        return volume.thickest_axis()
    return volume.stored_axis if slices == "stored" else AXES.index(slices)
