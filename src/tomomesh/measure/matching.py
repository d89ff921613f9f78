"""Which part of a slice goes on as which of the next: contours are matched here, whoever draws them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import scipy

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

SIMILAR = 4.0
"""Most that the areas differ of two parts that go on as each other. Chosen: half of it changes the distance by -0.1 %,
twice nothing."""
SHARED = 0.1
"""Share of a part's area that must lie over a part of the next slice for the two to be of one structure. Chosen: half
and twice of it change no case of benchmarks/constants.py."""


def similar(before: Sequence[float], here: Sequence[float]) -> NDArray[np.bool_]:
    """Tell which areas (a,) of a slice are like which (b,) of the next, (a, b)."""
    one, other = np.array(before, np.float64)[:, None], np.array(here, np.float64)[None, :]
    return np.asarray(np.maximum(one, other) <= SIMILAR * np.minimum(one, other))


def matched(cost: NDArray[np.float64], allowed: NDArray[np.bool_], alone: float | None = None) -> list[tuple[int, int]]:
    """Pair rows with columns, each once at most, for the least sum of costs (Kuhn 1955).

    Parameters
    ----------
    cost : (a, b) float array
    allowed : (a, b) bool array
        Which pairs there may be.
    alone : float, optional
        Cost of two that stay alone; more than all pairs together where not given, so that as many as can be are
        paired. Not infinity nor 1e30, in whose sums the costs of the others would be lost: measured, 90 of 4,000
        random matchings of up to 4 by 4 were not the best.

    Returns
    -------
    list of (row, column)
        By rows.
    """
    alone = 1.0 + float(cost[allowed].sum()) if alone is None else alone
    pairs = zip(*scipy.optimize.linear_sum_assignment(np.where(allowed, cost, alone)), strict=True)
    return [(int(a), int(b)) for a, b in pairs if allowed[a, b]]
