"""Components of a mask from its runs are those of a labelling of all its voxels."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy import ndimage

from conftest import law
from tomomesh.isosurface.run_mask import RunMask
from tomomesh.isosurface.runs import Runs
from tomomesh.model.boxes import box_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Mask = NDArray[np.bool_]

MASKS = arrays(np.bool_, st.tuples(*(st.integers(1, 7),) * 3))


def labelled(mask: Mask, *, corners: bool) -> tuple[NDArray[np.int32], int]:
    """Number the components of a mask from 1, voxel by voxel."""
    labels, count = ndimage.label(mask, np.ones((3, 3, 3)) if corners else None)
    return labels.astype(np.int32), count


@pytest.mark.parametrize("corners", [False, True])
@pytest.mark.parametrize("value", [False, True])
@given(mask=MASKS)
@law(60)
def test_components_are_those_of_all_voxels(mask: Mask, *, value: bool, corners: bool) -> None:
    labels, count = labelled(mask == value, corners=corners)
    runs = RunMask.of([mask])
    found = Runs.of(runs if value else ~runs, corners=corners, threads=2)
    assert len(found.sizes) == count
    for part in range(count):
        painted = np.zeros_like(mask)
        found.fill(painted, np.arange(count) == part, True)
        own = np.unique(labels[painted])
        assert len(own) == 1
        np.testing.assert_array_equal(painted, labels == own[0])
        assert found.sizes[part] == painted.sum()
        assert tuple(map(slice, *found.boxes[part])) == ndimage.find_objects(painted.view(np.int8))[0]
        inner = painted[1:-1, 1:-1, 1:-1]
        assert found.bordering[part] == (inner.sum() < painted.sum())


@given(mask=MASKS, seed=st.integers(0, 9))
@law(60)
def test_voxels_of_another_mask_are_counted_in_each(mask: Mask, seed: int) -> None:
    other = np.random.default_rng(seed).random(mask.shape) < 0.5
    labels, count = labelled(mask, corners=False)
    wanted = np.bincount(labels[other], minlength=count + 1)[1:]
    assert sorted(Runs.of(mask).within([other]).tolist()) == sorted(wanted.tolist())


def test_a_part_of_an_array_is_changed_in_place() -> None:
    whole = np.zeros((4, 5, 6), np.bool_)
    whole[1, 2, 2:4] = whole[2, 3, 4] = True
    box = whole[1:3, 2:4, 2:5]
    found = Runs.of(box)
    found.fill(box, found.sizes < 2, False)
    assert np.argwhere(whole).tolist() == [[1, 2, 2], [1, 2, 3]]


def cuts_of(draw: st.DrawFn, count: int) -> list[tuple[int, int]]:
    """Draw how so many slices are cut into slabs."""
    inner = draw(st.sets(st.integers(1, count - 1))) if count > 1 else set()
    return list(pairwise([0, *sorted(inner), count]))


@given(data=st.data(), mask=MASKS)
@law(60)
def test_runs_of_slabs_are_those_of_the_whole(data: st.DataObject, mask: Mask) -> None:
    slabs = data.draw(st.composite(lambda draw: cuts_of(draw, len(mask)))())
    runs, whole = RunMask.of(mask[a:b] for a, b in slabs), RunMask.of([mask], threads=2)
    for name in ("shape", "begin", "starts", "stops"):
        np.testing.assert_array_equal(getattr(runs, name), getattr(whole, name))
    np.testing.assert_array_equal(runs[:], mask)
    assert all(np.array_equal(runs[a:b], mask[a:b]) and np.array_equal(runs[a], mask[a]) for a, b in slabs)
    assert all(np.array_equal(runs.part(a, b)[:], mask[a:b]) for a, b in slabs)
    other = np.random.default_rng(mask.sum()).random(mask.shape) < 0.5
    np.testing.assert_array_equal(runs.within(other[a:b] for a, b in slabs), whole.within([other]))
    assert runs.within([other]).sum() == np.count_nonzero(mask & other)


@given(mask=MASKS)
@law(60)
def test_a_mask_of_runs_tells_what_the_mask_holds(mask: Mask) -> None:
    runs = RunMask.of([mask])
    assert runs.box == box_of(mask)
    assert runs.count == np.count_nonzero(mask)
    for axis in range(3):
        rest = tuple(other for other in range(3) if other != axis)
        np.testing.assert_array_equal(runs.areas(axis), np.count_nonzero(mask, axis=rest))
        for place in range(mask.shape[axis]):
            np.testing.assert_array_equal(runs.plane(axis, place), mask.take(place, axis))
    assert not RunMask.none(mask.shape)[:].any()


@given(data=st.data(), mask=MASKS)
@law(60)
def test_masks_of_runs_are_joined_and_parted_as_masks_are(data: st.DataObject, mask: Mask) -> None:
    runs, other = RunMask.of([mask]), data.draw(arrays(np.bool_, mask.shape))
    for found, wanted in ((~runs, ~mask), (runs | RunMask.of([other]), mask | other)):
        again = RunMask.of([wanted])
        for name in ("shape", "begin", "starts", "stops"):
            np.testing.assert_array_equal(getattr(found, name), getattr(again, name))
    np.testing.assert_array_equal(runs.cropped(runs.box)[:], mask[box_of(mask)])
    np.testing.assert_array_equal(runs.cropped(runs.box).placed(runs.box, mask.shape)[:], mask)
    parts = Runs.of(mask)
    marked = np.arange(len(parts.sizes)) % 2 == 0
    drawn = np.zeros_like(mask)
    parts.fill(drawn, marked, True)
    np.testing.assert_array_equal(parts.only(marked)[:], drawn)
