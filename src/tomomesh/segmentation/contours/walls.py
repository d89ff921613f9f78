"""Two rings on the two sides of a wall: the outer and the inner table of a skull."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import scipy

from ...measure.polygon import area, distance, inside
from ...model.contours import WALL_INNER, WALL_OUTER
from ...model.lattice import lattice
from ...som.fit import fit
from ..signal import closed, pixels_of
from .inputs import SHORTEST, TOUCHING, Inputs, inputs_along
from .loops import Loop, trace

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...settings import NetworkSettings

    Floats = NDArray[np.float64]

LONG = 0.25
"""Borders shorter than this share of the longest are pores of a wall, not its sides. Chosen: half of it changes the
distance by +91.3 %, twice by +8.0 %."""


def inputs_of_walls(
    plane: NDArray[np.bool_], settings: NetworkSettings, rng: np.random.Generator, pixel_mm: tuple[float, float]
) -> tuple[list[Inputs], int]:
    """Find the walls of a slice, and show each of two rings one side.

    A ring in the middle of the wall, split along its normals, gives both their starts; what lies outside of it is
    shown to the one, what lies inside to the other. Where the middle lies on the window, the wall is massive, and its
    borders are shown; else it has two tables, and their pixels are shown. A slice through a solid has one side only.

    Parameters
    ----------
    plane : (J, I) bool array
    settings : NetworkSettings
    rng : Generator
    pixel_mm : (float, float)

    Returns
    -------
    inputs : list of Inputs
    dropped : int
        Parts of the window whose outer border has fewer than `SHORTEST` pixel sides.
    """
    filled, hollow, margin = closed(plane)
    parts, count = scipy.ndimage.label(filled, TOUCHING)
    framed = np.pad(plane, margin)
    inputs: list[Inputs] = []
    dropped = 0
    for number in range(1, count + 1):
        part = parts == number
        outer = max(trace(part[margin:-margin, margin:-margin]), key=lambda loop: loop.area)
        inner = _hole(hollow & part, margin)
        if len(outer) < SHORTEST:
            dropped += 1
        elif inner is None:
            inputs.append(inputs_along(outer, WALL_OUTER))
        else:
            inputs += _two_sides((framed & part)[margin:-margin, margin:-margin], outer, inner, settings, rng, pixel_mm)
    return inputs, dropped


def _hole(hollow: NDArray[np.bool_], margin: int) -> Loop | None:
    """Return the border of the largest hole; None where there is none worth a ring."""
    loops = trace(hollow[margin:-margin, margin:-margin])
    largest = max(loops, key=lambda loop: loop.area, default=None)
    return largest if largest is not None and len(largest) >= SHORTEST else None


def _two_sides(
    wall: NDArray[np.bool_], outer: Loop, inner: Loop, settings: NetworkSettings, rng: np.random.Generator,
    pixel_mm: tuple[float, float],
) -> list[Inputs]:  # fmt: skip
    """Part a wall by the ring in its middle; where that follows no wall, take the borders as they are."""
    pixels = pixels_of(wall)
    graph = lattice("ring", min(settings.neuron_count, len(pixels)))
    middle = fit(pixels * pixel_mm, graph, settings, rng, pixel_area=pixel_mm[0] * pixel_mm[1]).codebook
    column, row = np.rint(middle / pixel_mm).astype(int).T
    massive = bool(wall[row.clip(0, len(wall) - 1), column.clip(0, wall.shape[1] - 1)].mean() > 0.5)
    shown = (_borders(wall) if massive else pixels) * pixel_mm
    within = inside(middle, shown)
    if min(within.sum(), (~within).sum()) < SHORTEST:
        return [inputs_along(outer, WALL_OUTER), inputs_along(inner, WALL_INNER)]
    return [
        Inputs(
            seen / pixel_mm, _moved(middle, way * _apart(middle, seen)) / pixel_mm, loop.filled(), side, len(loop),
            massive,
        )
        for seen, way, loop, side in (
            (shown[~within], 1.0, outer, WALL_OUTER),
            (shown[within], -1.0, inner, WALL_INNER),
        )
    ]  # fmt: skip


def _borders(wall: NDArray[np.bool_]) -> Floats:
    """Return the middles of the sides of a wall's long borders."""
    loops = trace(wall)
    longest = max(map(len, loops))
    return np.concatenate([loop.middles for loop in loops if len(loop) >= LONG * longest])


def _apart(ring: Floats, seen: Floats) -> float:
    return float(np.median(distance(ring, seen)))


def _moved(ring: Floats, by: float) -> Floats:
    """Move a ring along its normals, outward where `by` is over 0."""
    along = np.roll(ring, -1, axis=0) - np.roll(ring, 1, axis=0)
    outward = np.stack([along[:, 1], -along[:, 0]], axis=1) * np.sign(area(ring))
    length = np.sqrt((outward**2).sum(axis=1, keepdims=True))
    return np.asarray(ring + by * outward / np.where(length > 0, length, 1.0))
