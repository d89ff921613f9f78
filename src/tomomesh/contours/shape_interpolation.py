"""Shapes between the slices: signed distances interpolated along the parts (Raya & Udupa 1990; Herman et al. 1992)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from ..kernels.threads import in_blocks
from ..progress import Progress, silent
from .curves import Field, field_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from .tracks import Link, Part

    Floats = NDArray[np.float64]
    Values = NDArray[np.float32]
    Array = TypeVar("Array", Floats, Values)

MARGIN = 3
"""Voxels of background around the shapes. Chosen: half of it changes the distance by -0.2 %, twice by 0.0 %."""
FAR = np.float32(1e4)
"""Distance far outside, in voxels. Farther than volumes are wide, and exact in 32 bits."""
ENDS = 0.5
"""Share of a slice distance that a part goes on beyond its last contour. Chosen: half of it changes the distance by
+116.0 %, twice by -19.7 %."""
LIMIT = 3.0
"""Slopes are at most this many times the smaller change: then nothing overshoots (Fritsch & Carlson 1980). Chosen: half
of it changes the distance by +0.1 %, twice by -0.4 %."""


@dataclass(frozen=True)
class Shape:
    """Parts of one slice that go on together: their middle, the distances around it, and their depth."""

    center: Floats
    field: Field
    depth: float


@dataclass(frozen=True)
class Stack:
    """The parts of every slice, how they go on, and the voxels to fill.

    Attributes
    ----------
    slices : sequence of sequences of Part
    links : sequence of sequences of Link
        For the space below each slice, and that above the last.
    heights : (s,) float array
    edge : float
        Edge of the voxels.
    """

    slices: Sequence[Sequence[Part]]
    links: Sequence[Sequence[Link]]
    heights: Floats
    edge: float

    def ending(self, k: int, upward: bool) -> float:
        """Return how far parts of slice k that end go on beyond it."""
        steps = np.diff(self.heights)
        nearest = k if upward else k - 1
        return ENDS * float(steps[np.clip(nearest, 0, len(steps) - 1)])

    @property
    def low(self) -> Floats:
        """Center of the first voxel, in the stack's own frame."""
        corner = np.min([part.low for parts in self.slices for part in parts], axis=0)
        return np.append(corner, self.heights[0] - self.ending(0, False)) - MARGIN * self.edge

    @property
    def shape(self) -> tuple[int, int, int]:
        """Voxels along height, second and first axis."""
        corner = np.max([part.high for parts in self.slices for part in parts], axis=0)
        last = len(self.heights) - 1
        high = np.append(corner, self.heights[last] + self.ending(last, True)) + MARGIN * self.edge
        i, j, k = (np.ceil((high - self.low) / self.edge).astype(int) + 1).tolist()
        return k, j, i


def filled_between(stack: Stack, *, threads: int = 0, progress: Progress = silent) -> Values:
    """Interpolate the inside of slices to voxels.

    Along each link the distances f of both slices follow, at each pixel, a cubic over the height whose slopes are
    those of the parabola through the next slices too, limited so that nothing overshoots; their middles follow such
    a cubic too, so that a slanted part keeps its width. Where a part ends, its outline closes over half of the
    distance to the next slice: with the depth e of the part, the height t in shares of that, and a the slope at the
    contour,  f + e (1 - sqrt(1 - a t - (1 - a) t^2)):  an ellipsoid for a = 0, a paraboloid for a = 1.

    Parameters
    ----------
    stack : Stack
    threads : int
    progress : callable

    Returns
    -------
    (K, J, I) float32 array
        Negative inside; in voxels.
    """
    shapes = _shapes(stack, threads)
    volume = np.full(stack.shape, FAR, np.float32)
    height = stack.low[2] + stack.edge * np.arange(len(volume))
    space = np.searchsorted(stack.heights, height)

    def work(start: int, stop: int) -> None:
        for k in range(start, stop):
            layers = np.flatnonzero(space == k)
            for link in stack.links[k]:
                _Span(stack, shapes, k, link).fill(volume, layers, height)

    in_blocks(
        work, len(stack.links), block=1, threads=threads, done=lambda n: progress("slices", n, len(stack.links))
    )  # fmt: skip
    return volume


Key = tuple[int, tuple[int, ...]]


def _shapes(stack: Stack, threads: int) -> dict[Key, Shape]:
    """Measure each set of parts that goes on together."""
    keys = sorted(
        {(k, link.above) for k, links in enumerate(stack.links) for link in links if link.above}
        | {(k - 1, link.below) for k, links in enumerate(stack.links) for link in links if link.below}
    )
    made: list[Shape | None] = [None] * len(keys)

    def work(start: int, stop: int) -> None:
        for n in range(start, stop):
            made[n] = _shape([stack.slices[keys[n][0]][part] for part in keys[n][1]], stack.edge)

    in_blocks(work, len(keys), block=1, threads=threads)
    return {key: shape for key, shape in zip(keys, made, strict=True) if shape}


def _shape(parts: Sequence[Part], edge: float) -> Shape:
    areas = np.array([part.moments.area for part in parts])
    center = (areas[:, None] * np.stack([part.moments.center for part in parts])).sum(axis=0) / areas.sum()
    field = field_of([curve for part in parts for curve in part.curves], center, edge, MARGIN)
    return Shape(center, field, max(-float(field.values.min()), 0.5))


class _Span:
    """One link through the space below slice k."""

    def __init__(self, stack: Stack, shapes: dict[Key, Shape], k: int, link: Link) -> None:
        self.stack, self.shapes, self.k, self.link = stack, shapes, k, link

    def fill(self, volume: Values, layers: NDArray[np.int64], height: Floats) -> None:
        """Add the inside along the link to the layers of voxels."""
        if self.link.below and self.link.above:
            self._fill_between(volume, layers, height)
        else:
            self._fill_end(volume, layers, height)

    def _before(self, k: int, parts: tuple[int, ...]) -> Key | None:
        return next(((k - 1, link.below) for link in self.stack.links[k] if link.above == parts and link.below), None)

    def _after(self, k: int, parts: tuple[int, ...]) -> Key | None:
        return next(
            ((k + 1, link.above) for link in self.stack.links[k + 1] if link.below == parts and link.above), None
        )

    def _fill_between(self, volume: Values, layers: NDArray[np.int64], height: Floats) -> None:
        k, heights = self.k, self.stack.heights / self.stack.edge
        one, other = self.shapes[k - 1, self.link.below], self.shapes[k, self.link.above]
        low = np.minimum(one.field.low, other.field.low)
        high = np.maximum(one.field.high, other.field.high)
        step = float(heights[k] - heights[k - 1])
        f, g = one.field.over(low, high), other.field.over(low, high)
        change, way = (g - f) / step, (other.center - one.center) / step
        before, after = self._before(k - 1, self.link.below), self._after(k, self.link.above)
        slopes, ways = [change, change], [way, way]
        if before:
            last, step_before = self.shapes[before], float(heights[k - 1] - heights[k - 2])
            earlier = (f - last.field.over(low, high)) / step_before
            slopes[0] = _limited(earlier, change, step_before, step)
            ways[0] = _parabolic((one.center - last.center) / step_before, way, step_before, step)
        if after:
            next_, step_after = self.shapes[after], float(heights[k + 1] - heights[k])
            later = (next_.field.over(low, high) - g) / step_after
            slopes[1] = _limited(change, later, step, step_after)
            ways[1] = _parabolic(way, (next_.center - other.center) / step_after, step, step_after)
        for layer in layers:
            t = float(height[layer] / self.stack.edge - heights[k - 1]) / step
            values = _cubic(t, step, f, g, *slopes)
            center = _cubic(t, step, one.center, other.center, *ways)
            self._lay(volume[layer], values, low, center)

    def _fill_end(self, volume: Values, layers: NDArray[np.int64], height: Floats) -> None:
        upward = not self.link.above
        k = self.k - 1 if upward else self.k
        parts = self.link.below or self.link.above
        shape = self.shapes[k, parts]
        reach, slope = self._ending(k, parts, upward)
        for layer in layers:
            t = abs(height[layer] - self.stack.heights[k]) / reach
            if t < 1 + MARGIN * self.stack.edge / reach:
                left = 1 - slope * t - (1 - slope) * t * t
                closed = shape.depth * (1 - np.sign(left) * np.sqrt(abs(left)))
                self._lay(volume[layer], shape.field.values + np.float32(closed), shape.field.low, shape.center)

    def _ending(self, k: int, parts: tuple[int, ...], upward: bool) -> tuple[float, float]:
        """Return how far parts go on beyond their last slice, and the slope at which they begin to close.

        The squared depth of a ball falls all but evenly along its end: where it would reach 0 by the last two slices.
        """
        most = self.stack.ending(k, upward)
        inward = self._before(k, parts) if upward else self._after(k, parts)
        if inward is None:
            return most, 0.0
        depth, deeper = self.shapes[k, parts].depth, self.shapes[inward].depth
        step = abs(float(self.stack.heights[k] - self.stack.heights[inward[0]]))
        closing = max((deeper / depth) ** 2 - 1, 0.0) * most / step
        return most / max(closing, 1.0), min(closing, 1.0)

    def _lay(self, layer: Values, values: Values, low: NDArray[np.int64], center: Floats) -> None:
        """Write distances around a center to a layer of voxels, where they are less; linear between the pixels."""
        place = (center - self.stack.low[:2]) / self.stack.edge + low
        column, row = np.floor(place).astype(np.int64).tolist()
        x, y = (place - np.floor(place)).tolist()
        across = values[:, 1:] * (1 - x) + values[:, :-1] * x
        moved = across[1:] * (1 - y) + across[:-1] * y
        j, i = moved.shape
        top, left = max(-row - 1, 0), max(-column - 1, 0)
        at = layer[row + 1 + top : row + 1 + j, column + 1 + left : column + 1 + i]
        np.minimum(at, moved[top : top + at.shape[0], left : left + at.shape[1]], out=at)


def _cubic(t: float, step: float, f: Array, g: Array, start: Array, stop: Array) -> Array:
    """Interpolate between two values of given slopes (Hermite)."""
    u = 1 - t
    moved = u * u * (1 + 2 * t) * f + t * t * (1 + 2 * u) * g + step * t * u * (u * start - t * stop)
    return np.asarray(moved, f.dtype)


def _parabolic(earlier: Array, later: Array, before: float, after: float) -> Array:
    """Return the slope of the parabola through three values, from the changes before and after the middle one."""
    return np.asarray((after * earlier + before * later) / (before + after), earlier.dtype)


def _limited(earlier: Values, later: Values, before: float, after: float) -> Values:
    """Return that slope, limited so that the values between do not overshoot."""
    most = LIMIT * np.minimum(np.abs(earlier), np.abs(later))
    slope = np.clip(_parabolic(earlier, later, before, after), -most, most)
    return np.asarray(np.where(earlier * later > 0, slope, 0), np.float32)
