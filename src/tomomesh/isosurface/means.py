"""Averages over lists of members: the squares around a vertex, the corners of a square, a vertex' neighbors."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from ..kernels.isosurface.surface_nets import mean_of, mean_of_numbers
from ..kernels.threads import in_blocks

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

Span = tuple[int, int]
"""The first of some rows, and the one behind the last."""
Rows = Callable[[int], Span]
"""Told how many layers around what is wanted are still to be looked at, returns the rows of vertices or squares that
have to be known: of a net that is whole, all of them."""

BLOCK = 40_000
"""Vertices or squares handled in one call: far below 100 ms."""


def whole(count: int) -> Rows:
    """Return the rows of a net that is whole: all, always."""
    return lambda layers: (0, count)


def over(work: Callable[[int, int], None], span: Span, threads: int) -> None:
    """Call ``work(start, stop)`` on blocks that cover some rows."""
    first, last = span
    in_blocks(lambda start, stop: work(first + start, first + stop), last - first, block=BLOCK, threads=threads)


def means(values: Floats, members: NDArray[np.int32], threads: int, span: Span | None = None) -> Floats:
    """Average numbers (n,) or rows (n, 3) over lists of them (m, s): (m,) or (m, 3); all, or what is in a span."""
    found, mean = np.zeros((len(members), *values.shape[1:])), mean_of if values.ndim > 1 else mean_of_numbers
    over(lambda start, stop: mean(values, members, found, start, stop), span or (0, len(members)), threads)
    return found
