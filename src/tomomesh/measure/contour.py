"""How good is a contour: what the quantization error cannot tell."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from .distance import pairs_within
from .polygon import area, side_lengths

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

ROUNDING = 1e-9
"""What a place may lie off a line, over the product of the lengths, and still count as on it. A computed turn errs by
some 4e-16 of that for each length between the line and the origin: lines up to a million lengths away are told right.
"""


@dataclass(frozen=True)
class ContourMeasures:
    """Measures of one line of neurons, in its own unit.

    Attributes
    ----------
    closure_gap : float
        From the last neuron to the first.
    self_crossings : int
        Pairs of sides that cross.
    perimeter : float
        Length of all sides.
    area : float
        Enclosed; 0 for a line that is not closed.
    longest_over_median : float
        The longest side over the median one: a bridged gap shows here.
    evenness : float
        Standard deviation of the sides over their mean, bridged gaps aside; 0 is even.
    """

    closure_gap: float
    self_crossings: int
    perimeter: float
    area: float
    longest_over_median: float
    evenness: float


def measure_contour(line: Floats, *, closed: bool = True, bridged: NDArray[np.bool_] | None = None) -> ContourMeasures:
    """Measure a contour.

    Parameters
    ----------
    line : (u, 2) float array
        Its neurons, two at least.
    closed : bool
        Whether it is a ring.
    bridged : (u,) or (u - 1,) bool array, optional
        The sides that cross a gap, the first from neuron 0 to neuron 1.

    Returns
    -------
    ContourMeasures
    """
    lengths = side_lengths(line, closed=closed)
    usual = lengths if bridged is None or bridged.all() else lengths[~bridged]
    return ContourMeasures(
        closure_gap=float(np.hypot(*(line[0] - line[-1]))),
        self_crossings=crossings(line, closed=closed),
        perimeter=float(lengths.sum()),
        area=abs(area(line)) if closed else 0.0,
        longest_over_median=float(lengths.max() / max(np.median(lengths), 1e-300)),
        evenness=float(usual.std() / max(usual.mean(), 1e-300)),
    )


def crossings(line: Floats, *, closed: bool = True) -> int:
    """Count the pairs of sides of a contour (u, 2) that cross each other."""
    onward = np.roll(line, -1, axis=0) if closed else line[1:]
    return len(_crossing(line[: len(onward)], onward))


def crossings_between(lines: Sequence[Floats]) -> NDArray[np.int64]:
    """Count how often closed contours cross each other, (c, c); the diagonal counts what crosses itself."""
    if not lines:
        return np.zeros((0, 0), np.int64)
    owner = np.repeat(np.arange(len(lines)), [len(line) for line in lines])
    start, stop = np.concatenate(list(lines)), np.concatenate([np.roll(line, -1, axis=0) for line in lines])
    one, other = owner[_crossing(start, stop)].T
    counts = np.zeros((len(lines), len(lines)), np.int64)
    np.add.at(counts, (one, other), 1)
    np.add.at(counts, (other, one), one != other)
    return counts


def _crossing(start: Floats, stop: Floats) -> NDArray[np.int64]:
    """Return the pairs (p, 2) of segments that cross; those that only touch do not.

    Segments cross only where their middles are at most as far apart as the longest is long.
    """
    longest = float(np.sqrt(((stop - start) ** 2).sum(axis=1)).max(initial=0.0))
    pairs = pairs_within((start + stop) / 2, longest)
    a, b, c, d = start[pairs[:, 0]], stop[pairs[:, 0]], start[pairs[:, 1]], stop[pairs[:, 1]]
    parted = _turn(a, b, c) * _turn(a, b, d) < 0
    parted &= _turn(c, d, a) * _turn(c, d, b) < 0
    found = pairs[parted]
    return np.asarray(found[np.lexsort((found[:, 1], found[:, 0]))])


def _turn(a: Floats, b: Floats, p: Floats) -> Floats:
    """Tell on which side of the line from a to b places lie; 0 on it."""
    along, across = b - a, p - a
    turn = along[:, 0] * across[:, 1] - along[:, 1] * across[:, 0]
    scale = np.sqrt((along**2).sum(axis=1) * (across**2).sum(axis=1))
    return np.asarray(np.where(np.abs(turn) <= ROUNDING * scale, 0.0, np.sign(turn)))
