"""Sums that no order changes."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..compile import kernel

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]


@kernel("void(f8[::1], i4[::1], f8[::1], f8[:,::1])")
def add_folds(values: Floats, groups: NDArray[np.int32], tops: Floats, sums: Floats) -> None:
    """Add values to the sums of their groups, cut into parts whose sums are exact.

    Parameters
    ----------
    values : (n,) float array
    groups : (n,) or (1,) int32 array
        The sum to which each belongs; all to one where it is a single number.
    tops : (k,) float array
        What rounds the rest of a value to each of its parts, largest first.
    sums : (g, k) float array
        Added to.
    """
    group, alone = groups[0], len(groups) == 1
    for n in range(len(values)):
        rest = values[n]
        if not alone:
            group = groups[n]
        for k in range(len(tops)):
            part = (rest + tops[k]) - tops[k]
            sums[group, k] += part
            rest -= part
