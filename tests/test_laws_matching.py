"""Matching parts of slices, against every way to pair them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from conftest import law, seeds
from tomomesh.measure.matching import matched, similar

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

Pairs = tuple[tuple[int, int], ...]


def every(allowed: NDArray[np.bool_], row: int = 0, taken: Pairs = ()) -> Iterator[Pairs]:
    """Yield every way to pair rows with columns, each once at most."""
    if row == len(allowed):
        yield taken
        return
    yield from every(allowed, row + 1, taken)
    for column in np.flatnonzero(allowed[row]).tolist():
        if column not in [b for _, b in taken]:
            yield from every(allowed, row + 1, (*taken, (row, column)))


@st.composite
def choices(draw: st.DrawFn) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    shape = draw(st.tuples(st.integers(0, 4), st.integers(0, 4)))
    rng = np.random.default_rng(draw(seeds))
    allowed = rng.random(shape) < draw(st.sampled_from([0.2, 0.5, 0.9]))
    return rng.uniform(0, 10.0 ** draw(st.integers(-3, 6)), shape), allowed


@law(300)
@given(choices())
def test_as_many_as_can_be_are_paired_at_the_least_cost(chosen: tuple[NDArray[np.float64], NDArray[np.bool_]]) -> None:
    cost, allowed = chosen
    ways = [(len(pairs), sum(cost[pair] for pair in pairs)) for pairs in every(allowed)]
    most = max(count for count, _ in ways)
    found = matched(cost, allowed)
    assert all(allowed[pair] for pair in found)
    assert len(found) == most == len({a for a, _ in found}) == len({b for _, b in found})
    least = min(total for count, total in ways if count == most)
    assert sum(cost[pair] for pair in found) == pytest.approx(least, rel=1e-9)


@law(300)
@given(choices())
def test_where_none_costs_nothing_only_what_is_worth_it_is_paired(
    chosen: tuple[NDArray[np.float64], NDArray[np.bool_]],
) -> None:
    worth, allowed = chosen
    best = max(sum(worth[pair] for pair in pairs) for pairs in every(allowed))
    assert sum(worth[pair] for pair in matched(-worth, allowed, alone=0.0)) == pytest.approx(best, rel=1e-9)


def test_areas_are_similar_up_to_four_times() -> None:
    assert similar([1.0, 8.0], [4.0, 4.1, 2.0]).tolist() == [[True, False, True], [True, True, True]]
