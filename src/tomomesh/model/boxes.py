"""The box of what a mask holds."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray


def box_of(mask: NDArray[np.bool_]) -> tuple[slice, slice, slice]:
    """Return the box (K, J, I) of what is true in a mask; empty where nothing is.

    Examples
    --------
    >>> box_of(np.array([[[False, True, True, False]]]))
    (slice(0, 1, None), slice(0, 1, None), slice(1, 3, None))
    """
    plane = np.asarray(mask.any(axis=0))
    k, j, i = (_reach(held) for held in (mask.any(axis=(1, 2)), plane.any(axis=1), plane.any(axis=0)))
    return k, j, i


def _reach(held: ArrayLike) -> slice:
    """Return the stretch from the first to the last that is true."""
    places = np.flatnonzero(held)
    return slice(int(places[0]), int(places[-1]) + 1) if len(places) else slice(0, 0)
