"""Polygons by a depth buffer: at each sample the nearest face is kept (Catmull 1974)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..compile import kernel

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Bytes = NDArray[np.uint8]

STEPS = 16
"""Places of a corner from one sample to the next."""
NEAREST = 2**31 - 2
"""The largest depth, that of what is nearest to the viewer."""


@kernel("void(i8[:,::1], i8[:,::1], u1[:,:,::1], b1, f8, u1[::1], i8, i8[:,::1])")
def keep_nearest(
    corners: NDArray[np.int64], polygons: NDArray[np.int64], colors: Bytes, smooth: bool, line: float, ink: Bytes,
    first_row: int, nearest: NDArray[np.int64],
) -> None:  # fmt: skip
    """Lay convex polygons into a band of samples, each of which keeps the one that is nearest to the viewer.

    Parameters
    ----------
    corners : (n, 3) int array
        To the right and down in steps, `STEPS` from sample to sample and at most 2^29 from the first, and the depth,
        from 0 to `NEAREST`, which rises toward the viewer.
    polygons : (m, 3 or more) int array
        Counterclockwise where they face the viewer.
    colors : (2, n or m, 3) uint8 array
        Of the corners or of the polygons, as they are seen from the front and from behind.
    smooth : bool
        Whether the colors are the corners', blended in between (Gouraud 1971).
    line, ink : float, (3,) uint8 array
        Half of the width of the lines along the sides, in steps, 0 for none, and their color. The faces at a side
        draw a half of its line each.
    first_row : int
        Of the band, among all rows of samples.
    nearest : (rows, columns) int array
        Result: the depth plus one above 32 bits of color, 0xRRGGBB; 0 where nothing is. The largest is kept, so that
        the order of the polygons changes nothing.

    Notes
    -----
    A sample belongs to the triangle in which its middle lies; on a side, to one of the two beside it. Corners are
    integers, so that this is exact: triangles with a common side leave no sample out and share none (Pineda 1988).
    """
    rows, columns = nearest.shape
    middle, last = STEPS // 2, polygons.shape[1] - 1
    for number in range(len(polygons)):
        for n in range(1, last):
            a, b, c = polygons[number, 0], polygons[number, n], polygons[number, n + 1]
            ax, ay, bx, by, cx, cy = (
                corners[a, 0], corners[a, 1], corners[b, 0], corners[b, 1], corners[c, 0], corners[c, 1]
            )  # fmt: skip
            top, bottom = max((min(ay, by, cy) - middle) // STEPS - first_row, 0), max(ay, by, cy) - middle
            bottom = min(bottom // STEPS - first_row, rows - 1)
            twice = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay)
            if top > bottom or twice == 0:
                continue
            side, of_b, of_c = 1, n == last - 1, n == 1  # which of the sides opposite to b and to c are the polygon's
            if twice < 0:  # down is positive: a front
                side, b, c, bx, by, cx, cy, of_b, of_c = 0, c, b, cx, cy, bx, by, of_c, of_b
            left = max((min(ax, bx, cx) - middle) // STEPS, 0)
            right = min((max(ax, bx, cx) - middle) // STEPS, columns - 1)
            # which of the three sides have the samples on them
            on_a = 0 if cy < by or (cy == by and cx > bx) else 1
            on_b = 0 if ay < cy or (ay == cy and ax > cx) else 1
            on_c = 0 if by < ay or (by == ay and bx > ax) else 1
            share = 1.0 / abs(twice)
            depth = float(corners[a, 2])
            to_b, to_c = float(corners[b, 2]) - depth, float(corners[c, 2]) - depth
            u, v, w = (a, b, c) if smooth else (number, number, number)
            tones = colors[side]
            red_a, green_a, blue_a = float(tones[u, 0]), float(tones[u, 1]), float(tones[u, 2])
            red_b, green_b, blue_b = tones[v, 0] - red_a, tones[v, 1] - green_a, tones[v, 2] - blue_a
            red_c, green_c, blue_c = tones[w, 0] - red_a, tones[w, 1] - green_a, tones[w, 2] - blue_a
            long_a = np.sqrt(float((cx - bx) ** 2 + (cy - by) ** 2))
            long_b = np.sqrt(float((ax - cx) ** 2 + (ay - cy) ** 2))
            long_c = np.sqrt(float((bx - ax) ** 2 + (by - ay) ** 2))
            for j in range(top, bottom + 1):
                x, y = STEPS * left + middle, STEPS * (j + first_row) + middle
                # twice the areas that the sample spans with the sides opposite to a, b and c
                at_a = (cx - bx) * (y - by) - (cy - by) * (x - bx)
                at_b = (ax - cx) * (y - cy) - (ay - cy) * (x - cx)
                at_c = (bx - ax) * (y - ay) - (by - ay) * (x - ax)
                for i in range(left, right + 1):
                    if at_a >= on_a and at_b >= on_b and at_c >= on_c:
                        second, third = at_b * share, at_c * share
                        key = (np.int64(depth + second * to_b + third * to_c) + 1) << 32
                        if key + 0xFFFFFF >= nearest[j, i]:
                            inked = 0.0
                            if line > 0.0:
                                away = at_a / long_a
                                if of_b:
                                    away = min(away, at_b / long_b)
                                if of_c:
                                    away = min(away, at_c / long_c)
                                inked = max(min(away + middle, line) - max(away - middle, -line), 0.0) / STEPS
                            red = red_a + second * red_b + third * red_c
                            green = green_a + second * green_b + third * green_c
                            blue = blue_a + second * blue_b + third * blue_c
                            red += inked * (ink[0] - red)
                            green += inked * (ink[1] - green)
                            blue += inked * (ink[2] - blue)
                            key |= np.int64(red + 0.5) << 16 | np.int64(green + 0.5) << 8 | np.int64(blue + 0.5)
                            nearest[j, i] = max(nearest[j, i], key)
                    at_a -= (cy - by) * STEPS
                    at_b -= (ay - cy) * STEPS
                    at_c -= (by - ay) * STEPS


@kernel("void(i8[:,::1], u1[:,:,:])")
def mean_of_samples(nearest: NDArray[np.int64], pixels: Bytes) -> None:
    """Give each pixel the mean of its samples' colors, its own where nothing is.

    Parameters
    ----------
    nearest : (rows * s, columns * s) int array
        As `keep_nearest` leaves it, s x s samples a pixel.
    pixels : (rows, columns, 3) uint8 array
        Changed.
    """
    rows, columns, _ = pixels.shape
    each = nearest.shape[0] // max(rows, 1)
    count = each * each
    for j in range(rows):
        for i in range(columns):
            seen, red, green, blue = 0, 0, 0, 0
            for v in range(each * j, each * (j + 1)):
                for u in range(each * i, each * (i + 1)):
                    key = nearest[v, u]
                    if key > 0:
                        seen += 1
                        red += (key >> 16) & 255
                        green += (key >> 8) & 255
                        blue += key & 255
            if seen > 0:
                pixels[j, i, 0] = (red + (count - seen) * int(pixels[j, i, 0]) + count // 2) // count
                pixels[j, i, 1] = (green + (count - seen) * int(pixels[j, i, 1]) + count // 2) // count
                pixels[j, i, 2] = (blue + (count - seen) * int(pixels[j, i, 2]) + count // 2) // count
