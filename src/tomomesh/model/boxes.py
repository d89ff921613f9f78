"""The box of what a mask holds."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from .sliced import Sliced

    Box = tuple[slice, slice, slice]


def box_of(mask: Sliced, around: Box | None = None) -> Box:
    """Return the box (K, J, I) of what is true in a mask; empty where nothing is.

    Parameters
    ----------
    mask : (K, J, I) bool array, or a `RunMask`, which knows its own
    around : box, optional
        Outside of which nothing is true: what lies there is not looked at.

    Examples
    --------
    >>> box_of(np.array([[[False, True, True, False]]]))
    (slice(0, 1, None), slice(0, 1, None), slice(1, 3, None))
    """
    if not isinstance(mask, np.ndarray):
        return mask.box  # type: ignore[attr-defined, no-any-return]
    if around is not None:
        return within(around, box_of(mask[around]))
    plane = np.asarray(mask.any(axis=0))
    k, j, i = (_reach(held) for held in (mask.any(axis=(1, 2)), plane.any(axis=1), plane.any(axis=0)))
    return k, j, i


def within(box: Box, inner: Box) -> Box:
    """Return a box in the numbers of what another is a box in, whose first voxel its own are counted from.

    Examples
    --------
    >>> within((slice(5, 9), slice(0, 4), slice(2, 3)), (slice(1, 3), slice(0, 2), slice(0, 1)))
    (slice(6, 8, None), slice(0, 2, None), slice(2, 3, None))
    """
    k, j, i = (slice(out.start + one.start, out.start + one.stop) for out, one in zip(box, inner, strict=True))
    return k, j, i


def _reach(held: ArrayLike) -> slice:
    """Return the stretch from the first to the last that is true."""
    places = np.flatnonzero(held)
    return slice(int(places[0]), int(places[-1]) + 1) if len(places) else slice(0, 0)
