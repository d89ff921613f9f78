"""Voxels that are read part by part: the same as the whole, and nothing that asks for all of them gets them."""

from __future__ import annotations

import pickle
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from conftest import law
from tomomesh.errors import ResourceError
from tomomesh.model.lazy import ArraySource, LazyVoxels, in_memory
from tomomesh.model.volume import Volume

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

ARRAY = np.arange(5 * 4 * 3 * 3, dtype=np.int16).reshape(5, 4, 3, 3)
STEPS = st.slices(6)
VIEWS = st.lists(st.one_of(st.permutations(range(4)), st.tuples(STEPS, STEPS, STEPS, STEPS)), max_size=5)


class Counting(ArraySource):
    """An array that says how many of its numbers were read."""

    numbers = 0

    def read(self, box: tuple[slice, ...]) -> NDArray[Any]:
        part = super().read(box)
        object.__setattr__(self, "numbers", self.numbers + part.size)
        return part


@law(200)
@given(VIEWS)
def test_turns_and_parts_are_those_of_numpy(views: list[Any]) -> None:
    whole, lazy = ARRAY, LazyVoxels.of(ArraySource(ARRAY))
    for view in views:
        turned = isinstance(view, list)
        whole, lazy = (whole.transpose(view), lazy.transpose(view)) if turned else (whole[view], lazy[view])
    assert (lazy.shape, lazy.dtype, lazy.ndim) == (whole.shape, whole.dtype, whole.ndim)
    np.testing.assert_array_equal(lazy.read(), whole, strict=True)
    for n in range(-whole.shape[0], whole.shape[0]):
        np.testing.assert_array_equal(lazy[n], whole[n], strict=True)
        np.testing.assert_array_equal(lazy[n, ::-1], whole[n, ::-1], strict=True)
    with pytest.raises(IndexError):
        lazy[whole.shape[0]]
    if whole.size:
        np.testing.assert_array_equal(lazy[:, -1, :, 0], whole[:, -1, :, 0], strict=True)
    if whole.shape[3]:
        np.testing.assert_array_equal(lazy.layer(0).read(), whole[..., 0], strict=True)


@law(60)
@given(st.permutations(range(3)), st.tuples(*3 * [st.sampled_from([-1.0, 1.0])]), st.integers(0, 2), st.data())
def test_a_volume_of_them_is_that_of_the_array(
    order: list[int], signs: tuple[float, ...], axis: int, data: st.DataObject
) -> None:
    affine = np.eye(4)
    affine[:3, :3] = np.diag([*signs])[:, order]
    both = [Volume.from_stored(stored, affine).along(axis) for stored in (ARRAY, LazyVoxels.of(ArraySource(ARRAY)))]
    sides = [sorted(data.draw(st.tuples(*2 * [st.integers(0, size)]))) for size in both[0].shape]
    box = slice(*sides[0]), slice(*sides[1]), slice(*sides[2])
    whole, lazy = (volume.cropped(box) for volume in both)
    assert (lazy.shape, lazy.layers, repr(lazy)) == (whole.shape, whole.layers, repr(whole))
    assert (lazy.grid.axes, lazy.grid.corner, lazy.grid.flipped) == (
        whole.grid.axes, whole.grid.corner, whole.grid.flipped,
    )  # fmt: skip
    np.testing.assert_array_equal(lazy.affine, whole.affine)
    assert whole.in_parts is None
    assert lazy.in_parts is not None
    np.testing.assert_array_equal(lazy.in_parts.read(), whole.voxels, strict=True)
    np.testing.assert_array_equal(in_memory(lazy.voxels), in_memory(whole.voxels), strict=True)
    np.testing.assert_array_equal(lazy.bare().voxels, whole.bare().voxels, strict=True)


def test_no_more_is_read_than_is_asked_for() -> None:
    source = Counting(ARRAY)
    volume = Volume.from_stored(LazyVoxels.of(source), np.diag([1.0, -1.0, 1.0, 1.0])).along(0)
    assert source.numbers == 0
    assert volume.voxels[1].size == source.numbers == ARRAY[:, :, 0].size


ALL_AT_ONCE: dict[str, Callable[[Any], Any]] = {
    "asarray": np.asarray,
    "add": lambda voxels: voxels + 1,
    "added": lambda voxels: np.ones(3) + voxels,
    "equal": lambda voxels: voxels == 0,
    "unequal": lambda voxels: voxels != 0,
    "above": lambda voxels: voxels > 0,
    "ufunc": np.isfinite,
    "max": lambda voxels: voxels.max(),
    "np.max": np.max,
    "astype": lambda voxels: voxels.astype(float),
    "reshape": lambda voxels: voxels.reshape(-1),
    "count": np.count_nonzero,
    "take": lambda voxels: np.take(voxels, 0, 0),
    "contiguous": np.ascontiguousarray,
    "layers": lambda voxels: voxels[..., 0],
    "mask": lambda voxels: voxels[np.ones(5, bool)],
    "list": lambda voxels: voxels[[0, 1]],
    "deeper": lambda voxels: voxels[0, 0, 0, 0, 0],
}


@pytest.mark.parametrize("use", ALL_AT_ONCE.values(), ids=ALL_AT_ONCE)
def test_what_needs_all_of_them_is_refused_and_reads_nothing(use: Callable[[Any], Any]) -> None:
    source = Counting(ARRAY)
    with pytest.raises(ResourceError, match=r"^the study is read part by part, .* \[5 x 4 x 3 x 3 of int16\]\. Try: "):
        use(LazyVoxels.of(source))
    assert source.numbers == 0


def test_they_travel_to_another_process() -> None:
    lazy = LazyVoxels.of(ArraySource(ARRAY)).map(np.negative, ARRAY.dtype)[1:3].transpose((1, 0, 2, 3))
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(lazy)).read(), -ARRAY[1:3].transpose(1, 0, 2, 3))
    assert not hasattr(lazy, "__array_interface__")
    assert len(list(lazy)) == len(lazy) == 4
