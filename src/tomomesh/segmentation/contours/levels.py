"""How deep pixels lie inside of the rings of their slice, as gray levels."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...kernels.contours.rings import draw_rings
from ...kernels.threads import in_blocks
from ...measure.polygon import area
from .curved import finely

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from ...model.contours import Contour, Contours

    Floats = NDArray[np.float64]

LEVEL = 0.5
"""Level on a ring."""
NEAR = 0.5
"""Pixels from a ring, as far as an outline that passes half way between two is from both: nearer than that a ring does
not tell on which side of it a pixel lies."""
BARELY = 0.005
"""Difference from it that a pixel has at least which the ring leaves on the other side: a hundredth of the way to the
next pixel, as near to a voxel as gray levels are let cross a bound."""


def levels_of(
    contours: Contours, mask: NDArray[np.bool_], pixel_mm: tuple[float, float], threads: int = 0
) -> NDArray[np.float32]:
    """Draw the rings of all slices onto the pixels.

    A level is .5 on a ring, and rises by half over the width of a pixel, to 1 inside and 0 outside: so between two
    pixels it crosses .5 just where a straight side does, and a pixel is over .5 where the rings enclose its middle.
    Loops have been shown the window's own outlines: which side of a ring a pixel lies on that is half a pixel away, or
    nearer, is then for the window to say.

    Parameters
    ----------
    contours : Contours
    mask : (K, J, I) bool array
        The window.
    pixel_mm : (float, float)
        Distance of the columns and of the rows.
    threads : int

    Returns
    -------
    (K, J, I) float32 array
    """
    levels = np.zeros(mask.shape, np.float32)
    slices = [(int(k), contours.on(int(k))) for k in contours.slices]
    pixel = np.array(pixel_mm)
    near = NEAR * LEVEL * float(pixel.min() / pixel.max())

    def work(start: int, stop: int) -> None:
        for k, rings in slices[start:stop]:
            draw(rings, pixel, levels[k])
            if contours.kind == "loops":
                side_with(mask[k], levels[k], near)

    in_blocks(work, len(slices), block=1, threads=threads)
    return levels


def draw(rings: Sequence[Contour], pixel: Floats, levels: NDArray[np.float32]) -> None:
    """Draw the rings of one slice onto its pixels, (J, I)."""
    curves = [turned(one) for one in rings]
    sizes = np.array([len(curve) for curve in curves])
    onward = np.arange(1, sizes.sum() + 1)
    onward[np.cumsum(sizes) - 1] = np.cumsum(sizes) - sizes
    reach = float(pixel.max())
    draw_rings(np.concatenate(curves), onward, pixel, reach, levels, np.empty(levels.shape, np.int32))
    levels *= LEVEL / reach
    levels += LEVEL


def turned(one: Contour) -> Floats:
    """Return the smooth curve of a ring (p, 2), the inside of the structure on its left."""
    curve = finely(one.codebook).reshape(-1, 2)
    forward, around = area(curve) > 0, one.side % 2 == 0
    return np.ascontiguousarray(curve if forward == around else curve[::-1])


def side_with(plane: NDArray[np.bool_], levels: NDArray[np.float32], near: float) -> None:
    """Leave pixels (J, I) whose level differs by less than `near` from a ring's on the side that the window has."""
    close = np.abs(levels - LEVEL) < near
    np.maximum(levels, np.float32(LEVEL + BARELY), out=levels, where=close & plane)
    np.minimum(levels, np.float32(LEVEL - BARELY), out=levels, where=close & ~plane)
