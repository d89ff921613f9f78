"""Gray-level windows (eq. 3, Fig. 4)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import EmptyError, UsageError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..model.volume import Volume
    from ..settings import WindowSettings

PRESETS_HU = {"bone": (300.0, np.inf), "skin": (-300.0, np.inf)}
"""Windows for CT, Hounsfield units."""
PILED, SPAN = 0.999, (0.01, 99.99)
"""Share of the levels in one bin over which a histogram tells nothing, and the percentiles that it then spans."""


def window(volume: Volume, *, lower: float = -np.inf, upper: float = np.inf) -> NDArray[np.bool_]:
    """Keep the voxels with lower < k <= upper (Reyes Aldasoro & Algorri 2000, eq. 3).

    The window is a mask of its own: a kept voxel of gray level 0 stays kept.

    Parameters
    ----------
    volume : Volume
        Of a color volume, every layer must lie in the window.
    lower, upper : float
        Stored gray levels; HU where the study is CT.

    Returns
    -------
    (K, J, I) bool array

    Raises
    ------
    UsageError
        Where the limits leave no gray level between them.
    EmptyError
        Where nothing lies in the window; names the range of the data.
    """
    if not lower < upper:
        raise UsageError("the window is empty", found=f"lower = {lower:g}, upper = {upper:g}", expected="lower < upper")
    levels = volume.voxels
    kept = levels <= upper if np.isneginf(lower) else (levels > lower) & (levels <= upper)
    mask = np.ascontiguousarray(kept.all(axis=3) if levels.ndim == 4 else kept)
    if not mask.any():
        raise EmptyError(
            "the window selects nothing",
            found=f"lower = {lower:g}, upper = {upper:g}",
            expected=f"gray levels between {levels.min():g} and {levels.max():g}",
            hint="`tomomesh inspect` to see the histogram",
        )
    return mask


def choose_window(volume: Volume, settings: WindowSettings) -> tuple[float, float]:
    """Return the limits that the settings ask for; Otsu's threshold where they ask for none.

    Raises
    ------
    UsageError
        Where a preset for CT is asked of a study that is not in Hounsfield units.
    """
    lower, upper = settings.lower, settings.upper
    if settings.preset is not None:
        if volume.voxels.min() >= 0:
            raise UsageError(
                "the study is not in Hounsfield units",
                found=f"--preset = {settings.preset}, lowest gray level = {volume.voxels.min():g}",
                expected="a CT whose air lies below 0",
                hint="--lower and --upper, in the study's own gray levels",
            )
        return PRESETS_HU[settings.preset]
    if lower is None and upper is None:
        lower = otsu_threshold(volume.voxels)
    return -np.inf if lower is None else lower, np.inf if upper is None else upper


def otsu_threshold(levels: NDArray[Any], *, bins: int = 256) -> float:
    """Return the gray level that splits a histogram into two classes most unlike each other (Otsu 1979).

    Parameters
    ----------
    levels : array
        Gray levels of any shape; those that are not finite do not count.
    bins : int
        Bins of the histogram between the lowest and the highest level; between the percentiles `SPAN` where a
        few far levels pile all others up in one bin.

    Returns
    -------
    float
        Middle of the last bin of the lower class; the level itself where there is only one.
    """
    levels = levels[np.isfinite(levels)] if levels.dtype.kind == "f" else levels
    low, high = float(levels.min()), float(levels.max())
    if low == high:
        return low
    counts = histogram(levels, low, high, bins)
    if counts.max() > PILED * counts.sum():
        inner = np.percentile(levels, SPAN)
        low, high = inner if inner[0] < inner[1] else (low, high)
        counts = histogram(levels, low, high, bins)
    middles = low + (np.arange(bins) + 0.5) * (high - low) / bins
    below = np.cumsum(counts)[:-1]
    above = counts.sum() - below
    mass = np.cumsum(counts * middles)
    with np.errstate(invalid="ignore", divide="ignore"):
        apart = mass[:-1] / below - (mass[-1] - mass[:-1]) / above
        between = np.nan_to_num(below * above * apart**2)
    return float(middles[np.argmax(between)])


def histogram(levels: NDArray[Any], low: float, high: float, bins: int) -> NDArray[np.int64]:
    """Count gray levels in equal bins; exact and quick for small integers, which most studies hold."""
    levels = levels.view(np.uint8) if levels.dtype.kind == "b" else levels
    if levels.dtype.kind in "iu" and levels.dtype.itemsize <= 2:
        base = int(np.iinfo(levels.dtype).min)
        counts = np.bincount(levels.ravel().astype(np.int64) - base)
        present = np.flatnonzero(counts)
        return np.histogram(present + base, bins, (low, high), weights=counts[present])[0].astype(np.int64)
    return np.histogram(levels, bins, (low, high))[0].astype(np.int64)
