"""What a network is shown of its slice (eq. 4)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import scipy

from ..kernels.contours.closing import close_plane
from ..kernels.contours.moments import plane_moments
from ..model.columns import for_kernels
from ..model.sliced import areas_of, parts_of, some_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..isosurface.crossings import Levels
    from ..model.sliced import Sliced

SOLID = 0.4
"""Share of its ellipse that a window must fill to count as a solid, whose outline is taken.

An annulus of inner over outer radius q fills (1 - q^2) / (1 + q^2): measured, skulls 0.1 to 0.2 and
heads 0.7 to 1.
"""

STEPPED_ON = 8
"""Slices at least, of those that hold something, on which the gray levels are looked at. Chosen: they are alike in all
slices of a study."""
NARROW = 0.06
"""Width of the openings that the outside does not pass, over the square root of the window's area. Chosen: half of it
changes the distance by +62.7 %, twice nothing."""
WORD = 64
"""Pixels in a word of bits."""


def fills_most(mask: Sliced, *, solid: float = SOLID) -> bool:
    """Tell whether the window of a study is a solid, like skin, and not a wall, like a skull.

    Compares the pixels of all slices with the areas of the ellipses that have the same second moments; a ring
    run over a solid winds through its inside and would enclose half of it.

    Parameters
    ----------
    mask : (K, J, I) bool array or slices of it
    """
    sums = np.empty((mask.shape[0], 6))
    for start, stop in parts_of(mask):
        plane_moments(for_kernels(some_of(mask, start, stop), np.bool_), sums[start:stop])
    count, x, y, xx, xy, yy = sums[sums[:, 0] > 2].T
    spread = (xx / count - (x / count) ** 2 + 1 / 12) * (yy / count - (y / count) ** 2 + 1 / 12)
    ellipses = 4 * np.pi * np.sqrt(np.maximum(spread - (xy / count - x * y / count**2) ** 2, 0.0))
    return bool(count.sum() > solid * ellipses.sum())


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
    border = scipy.ndimage.binary_dilation(filled) & ~scipy.ndimage.binary_erosion(filled)
    return pixels_of(border) - margin


def crossings_around(plane: NDArray[np.bool_], levels: Levels, k: int) -> NDArray[np.float64]:
    """Return where the border of a filled window lies between its pixels, (n, 2) columns and rows.

    As `outline`, below a pixel: between a pixel of the window and one that is not, where the gray levels cross a
    bound; half way where an opening was closed, and at the edge of the image.

    Parameters
    ----------
    plane : (J, I) bool array
        Slice `k` of the window.
    levels : Levels
        The gray levels of the study.
    k : int
    """
    filled, _, margin = closed(plane)
    inner, steps = border_pairs(filled)
    if len(inner) == 0:
        return np.empty((0, 2))
    inner = inner - margin
    own, near, far = levels.on(k), on_slice(inner, 0), on_slice(inner + steps, 0)
    inside, outside = (own.inside(own.at(one)) for one in (near, far))
    share = np.where(inside & ~outside, own.crossed(near, far), 0.5)
    return np.asarray(inner + share[:, None] * steps)


def is_stepped(mask: Sliced, levels: Levels) -> bool:
    """Tell whether the gray levels at the border of a window in its slices are those of a mask, no finer than it."""
    full = np.flatnonzero(areas_of(mask))
    some = full[:: max(1, len(full) // STEPPED_ON)].tolist()
    if len(some) == 0:
        return False
    found = [border_pairs(np.pad(mask[k], 1)) for k in some]
    inner = np.concatenate([on_slice(pixels - 1, n) for n, (pixels, _) in enumerate(found)])
    steps = np.concatenate([on_slice(step, 0) for _, step in found])
    return len(inner) > 0 and levels.on(*some).stepped(inner, steps)


def on_slice(pixels: NDArray[np.int64], k: int) -> NDArray[np.int32]:
    """Return pixels (n, 2) of a slice, columns and rows, as voxels (n, 3)."""
    return np.column_stack([pixels, np.full(len(pixels), k)]).astype(np.int32)


def border_pairs(filled: NDArray[np.bool_]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the pixels inside that have a neighbor outside, and the steps there, (n, 2) columns and rows twice.

    Parameters
    ----------
    filled : (J, I) bool array
        Nothing on its edge.
    """
    pairs = []
    for axis, step in ((0, (0, 1)), (1, (1, 0))):
        one, other = (np.take(filled, np.arange(a, filled.shape[axis] - 1 + a), axis) for a in (0, 1))
        for inside, outside, sign in ((one, other, 1), (other, one, -1)):
            row, column = np.nonzero(inside & ~outside)
            shift = 0 if sign > 0 else 1
            pairs.append((np.column_stack([column, row]) + shift * np.array(step), sign * np.array(step)))
    return (
        np.concatenate([pixels for pixels, _ in pairs]),
        np.concatenate([np.broadcast_to(step, pixels.shape) for pixels, step in pairs]),
    )


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
    margin = reach + 1
    rows, columns = (size + 2 * margin for size in plane.shape)
    framed = np.zeros((rows, -(-columns // WORD) * WORD), np.bool_)
    framed[margin : rows - margin, margin : columns - margin] = plane
    filled = np.packbits(framed, axis=1, bitorder="little").view(np.uint64)
    hollow = np.empty_like(filled)
    close_plane(filled, reach, hollow)
    return _unpacked(filled, columns), _unpacked(hollow, columns), margin


def _unpacked(words: NDArray[np.uint64], columns: int) -> NDArray[np.bool_]:
    """Return so many columns of a plane of bits."""
    return np.unpackbits(words.view(np.uint8), axis=1, count=columns, bitorder="little").view(np.bool_)
