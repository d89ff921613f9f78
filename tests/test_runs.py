"""Components of a mask from its runs are those of a labelling of all its voxels."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy import ndimage

from conftest import law
from tomomesh.isosurface.runs import Runs

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
    found = Runs.of(mask, value=value, corners=corners, threads=2)
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
    assert sorted(Runs.of(mask).within(other).tolist()) == sorted(wanted.tolist())


def test_a_part_of_an_array_is_changed_in_place() -> None:
    whole = np.zeros((4, 5, 6), np.bool_)
    whole[1, 2, 2:4] = whole[2, 3, 4] = True
    box = whole[1:3, 2:4, 2:5]
    found = Runs.of(box)
    found.fill(box, found.sizes < 2, False)
    assert np.argwhere(whole).tolist() == [[1, 2, 2], [1, 2, 3]]
