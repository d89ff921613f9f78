"""Gray-level windows (eq. 3, Fig. 4), one a layer where the slices are in color."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import EmptyError, UsageError
from ..isosurface.run_mask import RunMask
from .labels import labels_counted
from .otsu import otsu_threshold
from .slabwise.cut import HERE
from .slabwise.levels import gathered

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from ..model.boxes import Box
    from ..model.volume import Volume
    from ..settings import WindowSettings
    from .padding import Padding
    from .slabwise.cut import Cut
    from .slabwise.levels import Levels, Looked
    from .slabwise.sources import Voxels

    Limit = float | NDArray[np.float64]

PRESETS_HU = {
    "bone": (300.0, np.inf),
    "compact-bone": (661.0, 1988.0),
    "spongy-bone": (147.0, 661.0),
    "enamel": (1552.0, 2850.0),
    "skin": (-300.0, np.inf),
    "soft-tissue": (-300.0, 225.0),
    "muscle": (-6.0, 135.0),
    "fat": (-206.0, -51.0),
    "lung": (-np.inf, -400.0),
}
"""Windows for CT, Hounsfield units: lower < k <= upper. Usual values are air -1000, lung -850, fat -100, soft tissue 20
to 80, bone 300 to 1900. Bone is what is surely bone; skin begins a third of the way from tissue to air, over foam and
cloth, as soft tissue does; lung ends half way from itself to tissue. The others, and the upper end of soft tissue, are
those of adults in the table of presets in the manual of InVesalius 3."""


def window(volume: Volume, *, lower: Limit = -np.inf, upper: Limit = np.inf, layers: str = "all") -> NDArray[np.bool_]:
    """Keep the voxels with lower < k <= upper (Reyes Aldasoro & Algorri 2000, eq. 3).

    The window is a mask of its own: a kept voxel of gray level 0 stays kept.

    Parameters
    ----------
    volume : Volume
    lower, upper : float or (L,) float array
        Stored gray levels; HU where the study is CT. One for all layers of a color volume, or one a layer.
    layers : {"all", "any"}
        Whether all layers of a voxel must lie in their windows, or one at least.

    Returns
    -------
    (K, J, I) bool array

    Raises
    ------
    UsageError
        Where the limits leave no gray level between them.
    EmptyError
        Where nothing lies in the window; names the range of the data.

    Examples
    --------
    >>> import numpy as np
    >>> from tomomesh import Volume, window
    >>> study = Volume.from_stored(np.arange(8).reshape(2, 2, 2), np.eye(4))
    >>> window(study, lower=2, upper=5).sum(axis=(1, 2))
    array([1, 2])
    """
    cut = HERE.of(volume.voxels)
    return window_in(cut, lower=lower, upper=upper, layers=layers).dense


def window_in(cut: Cut, *, lower: Limit = -np.inf, upper: Limit = np.inf, layers: str = "all") -> RunMask:
    """Return the window of a study in slabs; parameters and errors are those of `window`."""
    _check_limits(cut.voxels, lower, upper)
    found = cut.runs(partial(_kept_in, lower=lower, upper=upper, layers=layers))
    if not found.count:
        hint = "--layers any, or " if cut.voxels.ndim == 4 and layers == "all" else ""
        low, high = cut.ends
        raise EmptyError(
            "the window selects nothing",
            found=f"lower = {said(lower)}, upper = {said(upper)}",
            expected=f"gray levels between {low:g} and {high:g}",
            hint=f"{hint}`tomomesh inspect` to see the histogram",
        )
    return found


def _kept_in(levels: NDArray[Any], box: Box, *, lower: Limit, upper: Limit, layers: str) -> RunMask:
    kept = _within(levels, lower, upper)
    joined = kept if levels.ndim == 3 else ~any_of_layers(~kept) if layers == "all" else any_of_layers(kept)
    return RunMask.of([joined])


def by_layer(volume: Volume, *, lower: Limit = -np.inf, upper: Limit = np.inf) -> NDArray[np.bool_]:
    """Tell which levels lie in their layer's window, (K, J, I[, L]); parameters and errors are those of `window`."""
    _check_limits(volume.voxels, lower, upper)
    return _within(volume.voxels, lower, upper)


def _check_limits(voxels: Voxels, lower: Limit, upper: Limit) -> None:
    if not np.less(lower, upper).all():
        found = f"lower = {said(lower)}, upper = {said(upper)}"
        raise UsageError("the window is empty", found=found, expected="lower < upper")
    layers = voxels.shape[3] if voxels.ndim == 4 else 1
    for limit in (lower, upper):
        if np.ndim(limit) and np.size(limit) != layers:
            kind = "gray" if layers == 1 else f"of {layers} layers"
            raise UsageError(
                "the limits do not fit the layers of the study", found=f"{np.size(limit)} limits: {said(limit)}",
                expected=f"one, or one a layer; the study is {kind}",
            )  # fmt: skip


def _within(levels: NDArray[Any], lower: Limit, upper: Limit) -> NDArray[np.bool_]:
    if np.isneginf(lower).all():
        return np.asarray(levels <= upper)
    kept = np.asarray(levels > lower)
    if not np.isposinf(upper).all():
        kept &= levels <= upper
    return kept


def any_of_layers(kept: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Tell where one of the few layers at least is kept: layer by layer, which is many times as fast as along them."""
    return np.asarray(np.logical_or.reduce([kept[..., n] for n in range(kept.shape[-1])]))


def said(limit: Limit) -> str:
    """Put a limit, or one a layer, into words."""
    return ", ".join(f"{value:g}" for value in np.ravel(limit))


def choose_window(volume: Volume, settings: WindowSettings) -> tuple[Limit, Limit]:
    """Return the limits that the settings ask for of a study in memory that has no padding; see `window_limits`."""
    cut = HERE.of(volume.voxels)
    return window_limits(volume, cut, settings, lambda: otsu_in(cut))


def window_limits(volume: Volume, cut: Cut, settings: WindowSettings, otsu: Callable[[], Limit]) -> tuple[Limit, Limit]:
    """Return the limits that the settings ask for; Otsu's threshold, in each layer its own, where they ask for none.

    A layer that has one level alone tells nothing, and is not limited.

    Parameters
    ----------
    volume : Volume
    cut : Cut
        Its voxels.
    settings : WindowSettings
    otsu : callable
        Finds Otsu's threshold.

    Raises
    ------
    UsageError
        Where a preset for CT is asked of a study that is not in Hounsfield units.
    """
    lower, upper = (
        np.array(limit) if isinstance(limit, tuple) else limit for limit in (settings.lower, settings.upper)
    )
    if settings.preset is not None:
        _check_ct(volume, cut, settings.preset)
        return PRESETS_HU[settings.preset]
    if lower is None and upper is None:
        lower = otsu()
    return -np.inf if lower is None else lower, np.inf if upper is None else upper


def may_be_ct(volume: Volume, lowest: float) -> bool:
    """Tell whether gray levels may be Hounsfield units: where the file says so, or says nothing and air is below 0."""
    return volume.layers == 1 and volume.unit in ("HU", "stored") and bool(lowest < 0)


def _check_ct(volume: Volume, cut: Cut, preset: str) -> None:
    lowest = cut.ends[0]
    if may_be_ct(volume, lowest):
        return
    raise UsageError(
        "the study is not in Hounsfield units",
        found=f"--preset = {preset}, lowest gray level = {lowest:g} ({volume.unit})",
        expected="a CT whose air lies below 0",
        hint="--select, which chooses labels" if labels_counted(cut)
        else "--lower and --upper, in the study's own gray levels",
    )  # fmt: skip


def otsu_thresholds(volume: Volume, padded: NDArray[np.bool_] | None = None) -> Limit:
    """Return Otsu's threshold of a gray volume in memory, without its padding, or those of a color one, (L,)."""
    if padded is not None and volume.voxels.ndim == 3:
        return otsu_threshold(volume.voxels[~padded])
    return otsu_in(HERE.of(volume.voxels))


def otsu_in(cut: Cut, padded: Padding | None = None) -> Limit:
    """Return Otsu's threshold of a gray study in slabs, without its padding, or those of the layers of a color one."""
    if cut.voxels.ndim == 3:
        return otsu_threshold(cut.levels if padded is None else beside(cut, padded))
    layers = [cut.layer(n) for n in range(cut.voxels.shape[3])]
    return np.array([otsu_threshold(one) if one.ends[0] < one.ends[1] else -np.inf for one in layers])


def beside(cut: Cut, padded: Padding) -> Levels:
    """Look at the levels that are no padding."""
    return gathered(lambda work: cut.sum(partial(_unpadded, work, padded)), cut.voxels.dtype)


def _unpadded(work: Looked, padded: Padding, levels: NDArray[Any], box: Box) -> Any:
    return work(levels[~padded.within(levels, box)])


def is_dense(mask: RunMask, cut: Cut) -> bool:
    """Tell whether over half of a window of a CT is as dense as a body; one of lungs or airways is not."""
    return bool(2 * cut.sum(_dense, cut.over(mask)) > mask.count)


def _dense(levels: NDArray[Any], box: Box, mask: RunMask) -> int:
    return int(mask.within([levels > PRESETS_HU["skin"][0]]).sum())


def skin_of(cut: Cut) -> RunMask:
    """Return what of a CT is denser than air."""
    return cut.runs(_denser)


def _denser(levels: NDArray[Any], box: Box) -> RunMask:
    return RunMask.of([levels > PRESETS_HU["skin"][0]])
