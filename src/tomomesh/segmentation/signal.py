"""What a network is shown of its slice (eq. 4)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy import ndimage

from ..som.starts import moments

if TYPE_CHECKING:
    from numpy.typing import NDArray

SOLID = 0.4
"""Share of its ellipse that a window must fill to count as a solid, whose outline is taken.

An annulus of inner over outer radius q fills (1 - q^2) / (1 + q^2): measured, skulls 0.1 to 0.2 and
heads 0.7 to 1.
"""

NARROW = 0.06
"""Width of the openings that the outside does not pass, over the square root of the window's area. Chosen: half of it
changes the distance by +62.7 %, twice nothing."""


def fills_most(mask: NDArray[np.bool_], *, solid: float = SOLID) -> bool:
    """Tell whether the window of a study is a solid, like skin, and not a wall, like a skull.

    Compares the pixels of all slices with the areas of the ellipses that have the same second moments; a ring
    run over a solid winds through its inside and would enclose half of it.

    Parameters
    ----------
    mask : (K, J, I) bool array
    """
    filled = ellipses = 0.0
    for plane in mask:
        pixels = pixels_of(plane)
        if len(pixels) > 2:
            filled += len(pixels)
            ellipses += 4 * np.pi * np.sqrt(np.linalg.det(moments(np.ascontiguousarray(pixels.T))[1] + np.eye(2) / 12))
    return filled > solid * ellipses


def pixels_of(plane: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Return the pixels of a (J, I) mask, row by row, (n, 2) columns and rows; of (J, I, L) also layers, (n, 3)."""
    if plane.ndim == 3:
        row, column, layer = np.nonzero(plane)
        return np.stack([column, row, layer], axis=1).astype(np.float64)
    row, column = np.divmod(np.flatnonzero(plane), plane.shape[1])
    return np.stack([column, row], axis=1).astype(np.float64)


def outline(plane: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Return the pixels on both sides of the border of a filled window, (n, 2) columns and rows.

    With the last pixels inside and the first outside, which may lie just off the image, the middle of the
    signal is the border itself. What the outside cannot reach is filled, also where only a narrow opening leads
    there, as between scalp and brain at the edge of an image: the outside passes no opening narrower than
    `NARROW` of the window's size (a morphological closing).

    Parameters
    ----------
    plane : (J, I) bool array
    """
    filled, _, margin = closed(plane)
    border = ndimage.binary_dilation(filled) & ~ndimage.binary_erosion(filled)
    return pixels_of(border) - margin


def closed(plane: NDArray[np.bool_]) -> tuple[NDArray[np.bool_], NDArray[np.bool_], int]:
    """Close the narrow openings of a window, and fill what the outside cannot reach then.

    Parameters
    ----------
    plane : (J, I) bool array

    Returns
    -------
    filled, hollow : (J + 2 m, I + 2 m) bool arrays
        The filled window, and what of it the closing left open.
    margin : int
        Pixels m that were added around the slice.
    """
    reach = round(NARROW / 2 * float(np.sqrt(np.count_nonzero(plane))))
    framed = np.pad(plane, reach + 1)
    open_ = ~_grown(framed, reach)
    background, _ = ndimage.label(open_)
    outside = background == background[0, 0]
    return framed | ~_grown(outside, reach), open_ & ~outside, reach + 1


def _grown(mask: NDArray[np.bool_], steps: int) -> NDArray[np.bool_]:
    """Dilate by an octagon: crosses and squares in turn."""
    for step in range(steps):
        mask = ndimage.binary_dilation(mask, ndimage.generate_binary_structure(2, 1 + step % 2))
    return mask
