"""Shapes between the slices: signed distances interpolated along the parts (Raya & Udupa 1990; Herman et al. 1992)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..kernels.threads import in_blocks
from ..model.cubics import LIMIT, cubic, limited, parabolic
from ..progress import Progress, silent
from .assembly import MARGIN
from .curves import Field, field_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from .assembly import Key, Stack
    from .tracks import Link

    Floats = NDArray[np.float64]
    Values = NDArray[np.float32]

FAR = np.float32(1e4)
"""Distance far outside, in voxels. Farther than volumes are wide, and exact in 32 bits."""


@dataclass(frozen=True)
class Shape:
    """Parts of one slice that go on together: center, height in voxels, distances around the center, and depth."""

    center: Floats
    height: float
    field: Field
    depth: float


def filled_between(
    stack: Stack, heights: Floats | None = None, *, threads: int = 0, progress: Progress = silent
) -> Values:
    """Interpolate the inside of slices to voxels.

    Along each link the distances f of both slices follow, at each pixel, a cubic over the height whose slopes are
    those of the parabola through the next slices too, limited so that nothing overshoots; their middles follow such
    a cubic too, so that a slanted part keeps its width. Where a part ends, its outline closes as
    `tomomesh.contours.endings.Ending` has it: with the depth e of the part and the share s of its square that is left,
    f + e (1 - sqrt(s)). What several links fill is their union.

    Parameters
    ----------
    stack : Stack
    heights : (K,) float array, optional
        Of the layers of voxels, rising; those of `stack`'s own voxels where not given.
    threads : int
    progress : callable

    Returns
    -------
    (K, J, I) float32 array
        Negative inside; in voxels.
    """
    shapes = _shapes(stack, threads)
    height = stack.low[2] + stack.edge * np.arange(stack.shape[0]) if heights is None else heights
    volume = np.full((len(height), *stack.shape[1:]), FAR, np.float32)
    spans = [_Span(stack, shapes, link, height) for link in stack.links]
    filled = 0
    for units in _rounds(spans):

        def work(start: int, stop: int, units: list[list[_Span]] = units) -> None:
            for unit in units[start:stop]:
                for span in unit:
                    span.fill(volume)

        def done(count: int, before: int = filled, units: list[list[_Span]] = units) -> None:
            progress("slices", before + sum(map(len, units[:count])), len(spans))

        in_blocks(work, len(units), block=1, threads=threads, done=done)
        filled += sum(map(len, units))
    return volume


def _rounds(spans: Sequence[_Span]) -> list[list[list[_Span]]]:
    """Share out spans to rounds of units whose layers have none in common, so that each writes what is its own."""
    units: dict[tuple[int, int], list[_Span]] = {}
    for span in spans:
        units.setdefault((span.layers.start, span.layers.stop), []).append(span)
    rounds: list[list[list[_Span]]] = []
    free: list[int] = []
    for (start, stop), unit in sorted(units.items(), key=lambda one: one[0]):
        n = next((n for n, first in enumerate(free) if first <= start), len(free))
        if n == len(free):
            rounds.append([])
            free.append(0)
        rounds[n].append(unit)
        free[n] = stop
    return rounds


def _shapes(stack: Stack, threads: int) -> dict[Key, Shape]:
    """Measure each set of parts that goes on together."""
    keys = sorted({key for link in stack.links for key in (link.below, link.above) if key})
    made: list[Shape | None] = [None] * len(keys)

    def work(start: int, stop: int) -> None:
        for n in range(start, stop):
            made[n] = _shape(stack, keys[n])

    in_blocks(work, len(keys), block=1, threads=threads)
    return {key: shape for key, shape in zip(keys, made, strict=True) if shape}


def _shape(stack: Stack, key: Key) -> Shape:
    *center, height = stack.mean(key)
    curves = [curve for n in key for curve in stack.parts[n].curves]
    field = field_of(curves, np.array(center), stack.edge, MARGIN)
    return Shape(np.array(center), height / stack.edge, field, max(-float(field.values.min()), 0.5))


class _Span:
    """One link through the layers of voxels that it fills."""

    def __init__(self, stack: Stack, shapes: dict[Key, Shape], link: Link, height: Floats) -> None:
        self.stack, self.shapes, self.link, self.height = stack, shapes, link, height / stack.edge
        self.layers = range(*np.searchsorted(self.height, self._reach(), side="right").tolist())

    def _reach(self) -> tuple[float, float]:
        """Return where it begins and ends, in voxels."""
        below, above = self.link.below, self.link.above
        if below and above:
            return self.shapes[below].height, self.shapes[above].height
        self.end, self.aside = self.stack.ending(below or above, upward=not above)
        here, beyond = self.shapes[below or above].height, self.end.reach / self.stack.edge + MARGIN
        return (here, here + beyond) if below else (here - beyond, here)

    def fill(self, volume: Values) -> None:
        """Add the inside along the link to the layers of voxels."""
        if self.link.below and self.link.above:
            self._fill_between(volume)
        else:
            self._fill_end(volume)

    def _fill_between(self, volume: Values) -> None:
        one, other = self.shapes[self.link.below], self.shapes[self.link.above]
        low = np.minimum(one.field.low, other.field.low)
        high = np.maximum(one.field.high, other.field.high)
        step = other.height - one.height
        f, g = one.field.over(low, high), other.field.over(low, high)
        change, way = (g - f) / step, (other.center - one.center) / step
        before, after = self.stack.before.get(self.link.below), self.stack.after.get(self.link.above)
        slopes, ways = [change, change], [way, way]
        if not before:
            fall = self._toward_end(self.link.below, one, change, upward=False)
            slopes[0] = (change - fall) / 2
        if not after:
            fall = self._toward_end(self.link.above, other, change, upward=True)
            slopes[1] = (change + fall) / 2
        if before:
            last = self.shapes[before]
            step_before = one.height - last.height
            earlier = (f - last.field.over(low, high)) / step_before
            slopes[0] = limited(earlier, change, step_before, step)
            ways[0] = parabolic((one.center - last.center) / step_before, way, step_before, step)
        if after:
            next_ = self.shapes[after]
            step_after = next_.height - other.height
            later = (next_.field.over(low, high) - g) / step_after
            slopes[1] = limited(change, later, step, step_after)
            ways[1] = parabolic(way, (next_.center - other.center) / step_after, step, step_after)
        for layer in self.layers:
            t = float(self.height[layer] - one.height) / step
            values = cubic(t, step, f, g, *slopes)
            center = cubic(t, step, one.center, other.center, *ways)
            self._lay(volume[layer], values, low, center)

    def _toward_end(self, key: Key, shape: Shape, change: Values, *, upward: bool) -> np.float32:
        """Return how fast the outline of a part closes where its end begins, in voxels.

        A part of a pixel ends at once, so steeply that what is before it would bulge: at most `LIMIT` changes.
        """
        end = self.stack.ending(key, upward)[0]
        fall = shape.depth * end.fall * self.stack.edge / (2 * end.reach)
        return np.float32(min(fall, LIMIT * float(np.abs(change).max())))

    def _fill_end(self, volume: Values) -> None:
        shape, reach = self.shapes[self.link.below or self.link.above], self.end.reach / self.stack.edge
        for layer in self.layers:
            away = abs(float(self.height[layer]) - shape.height)
            closed = shape.depth * (1 - np.sqrt(self.end.left(away / reach)))
            values = np.maximum(shape.field.values + np.float32(closed), np.float32(away - reach))
            self._lay(volume[layer], values, shape.field.low, shape.center + self.aside * min(away / reach, 1.0))

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
