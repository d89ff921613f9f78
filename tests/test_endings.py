"""Planes of contours, and how a body ends beyond its last."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tomomesh.contours.endings import Ending, parabola
from tomomesh.contours.levels import planes_within, slices_at

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]


class TestPlanes:
    """Heights, and which are the same."""

    def test_jitter_is_told_from_slices(self) -> None:
        column, width = np.zeros(6, np.int64), np.full(6, 20.0)
        heights = np.array([6.01, 0.0, 3.0, 0.02, 6.0, 2.98])
        np.testing.assert_array_equal(planes_within(heights, column, width), [2, 0, 1, 0, 2, 1])
        assert slices_at(heights, 20.0) == 3

    def test_a_wide_gap_joins_no_slices(self) -> None:
        heights = np.array([0, 2.5, 5, 47.5, 50, 52.5])
        np.testing.assert_array_equal(planes_within(heights, np.zeros(6, np.int64), np.full(6, 9.0)), np.arange(6))

    def test_columns_have_planes_of_their_own(self) -> None:
        heights, column = np.array([0, 0.5, 6, 6.5]), np.array([0, 1, 0, 1])
        np.testing.assert_array_equal(planes_within(heights, column, np.full(4, 9.0)), [0, 2, 1, 3])


class TestEndings:
    """What is assumed beyond the last contour."""

    @given(st.floats(0.05, 0.99), st.floats(0.5, 5.0), st.floats(5, 40))
    def test_balls_and_cones_end_in_their_pole(self, share: float, step: float, radius: float) -> None:
        away = share * step + step * np.arange(3)
        for squares in (away * (2 * radius - away), away**2) if radius > 3 * step else (away**2,):
            shape = parabola((1.0, 2.0), (squares[1] / squares[0], squares[2] / squares[0]))
            assert Ending.after(step, *shape).reach == pytest.approx(away[0], rel=1e-3)

    @given(st.floats(0.5, 5.0))
    def test_a_prism_ends_flat_half_a_step_later(self, step: float) -> None:
        end = Ending.after(step, *parabola((1.0, 2.0), (1.0, 1.0)))
        assert (end.reach, end.left(0.99), end.left(2.0)) == (step / 2, 1.0, 1.0)

    @given(st.floats(-0.5, 3.0), st.floats(-1.0, 1.0))
    def test_what_is_left_falls_to_nothing_within_a_step(self, fall: float, bend: float) -> None:
        bend = max(bend, -(fall**2) / 4)
        end = Ending.after(1.0, fall, bend)
        left = [end.left(t) for t in np.linspace(0, 0.999, 50)]
        assert 0 < end.reach <= 1 + 1e-9
        assert left[0] == 1
        assert (np.diff(left) <= 1e-12).all()
        assert 0 < end.volume <= end.reach + 1e-9
