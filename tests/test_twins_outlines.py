"""Pieces, holes and forks of the slices of a window, counted by filling and labelling instead."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy import ndimage

from tomomesh.segmentation.outlines import SIDES, outlines_of
from tomomesh.segmentation.signal import fills_most

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Mask = NDArray[np.bool_]

TOUCHING, BESIDE = np.ones((3, 3)), ndimage.generate_binary_structure(2, 1)
GOING_ON = np.zeros((3, 3, 3), bool)
GOING_ON[1], GOING_ON[:, 1, 1] = True, True
"""Neighbors within a slice, corners among them, and straight above and below."""
MASKS = arrays(np.bool_, st.tuples(*[st.integers(1, 7)] * 3), elements=st.booleans())


def holes_of(plane: Mask) -> NDArray[np.int64]:
    """Return the sizes of the holes of a slice, by filling."""
    labels, count = ndimage.label(ndimage.binary_fill_holes(plane, BESIDE) & ~plane, BESIDE)
    return np.bincount(labels.ravel(), minlength=count + 1)[1:]


def pieces_of(plane: Mask) -> NDArray[np.int64]:
    labels, count = ndimage.label(plane, TOUCHING)
    return np.bincount(labels.ravel(), minlength=count + 1)[1:]


def forks_of(mask: Mask) -> int:
    """Count the pieces that have several partners above, and those that have several below."""
    labels = [ndimage.label(plane, TOUCHING)[0] for plane in mask]
    pairs = [
        {(low, high) for low, high in zip(one.ravel(), other.ravel(), strict=True) if low and high}
        for one, other in pairwise(labels)
    ]
    ends = [[pair[n] for pair in links] for links in pairs for n in (0, 1)]
    return sum(each.count(piece) > 1 for each in ends for piece in set(each))


class TestTwin:
    @given(MASKS)
    def test_pieces_and_holes_are_those_of_labels(self, mask: Mask) -> None:
        found = outlines_of(mask)
        for counts, sizes, most, parts in (
            (found.pieces, found.area, found.largest, pieces_of),
            (found.holes, found.hollow, found.largest_hole, holes_of),
        ):  # fmt: skip
            each = [parts(plane) for plane in mask]
            assert counts.tolist() == [len(one) for one in each]
            assert sizes.tolist() == [one.sum() for one in each]
            assert most.tolist() == [one.max(initial=0) for one in each]

    @given(MASKS)
    def test_slices_go_on_as_the_voxels_do(self, mask: Mask) -> None:
        found = outlines_of(mask)
        labels, bodies = ndimage.label(mask, GOING_ON)
        assert found.shared.tolist() == [(one & other).sum() for one, other in pairwise(mask)]
        assert found.bodies == bodies
        assert found.forks == forks_of(mask)
        largest = np.bincount(labels[mask], minlength=1).max(initial=0)
        assert found.largest_body == pytest.approx(largest / max(mask.sum(), 1))

    @given(MASKS, st.floats(0.1, 9), st.floats(0.1, 9))
    def test_lengths_are_those_of_the_sides_of_pixels(self, mask: Mask, x: float, y: float) -> None:
        framed = np.pad(mask, ((0, 0), (1, 1), (1, 1)))
        across, down = (np.abs(np.diff(framed.astype(int), axis=axis)).sum(axis=(1, 2)) for axis in (2, 1))
        np.testing.assert_allclose(outlines_of(mask, (x, y)).length, SIDES * (across * y + down * x))

    @given(MASKS)
    def test_a_wall_is_what_a_ring_takes_for_one(self, mask: Mask) -> None:
        thick = mask[mask.sum(axis=(1, 2)) > 2]  # `fills_most` leaves out slices of fewer pixels
        assume(len(thick))
        assert outlines_of(thick).wall == (not fills_most(thick))

    @given(MASKS, st.integers(0, 2), st.integers(0, 5))
    def test_neither_mirrors_nor_what_is_around_change_anything(self, mask: Mask, axis: int, wide: int) -> None:
        found, mirrored = outlines_of(mask), outlines_of(np.flip(mask, axis))
        grown = outlines_of(np.pad(mask, ((0, 0), (wide, 0), (0, wide))))
        for name in ("pieces", "area", "largest", "holes", "hollow", "largest_hole", "length", "ellipse"):
            kept = getattr(mirrored, name)
            np.testing.assert_allclose(getattr(found, name), kept[::-1] if axis == 0 else kept, atol=1e-9)
            np.testing.assert_allclose(getattr(found, name), getattr(grown, name), atol=1e-9)
        assert (found.bodies, found.forks) == (mirrored.bodies, mirrored.forks) == (grown.bodies, grown.forks)
