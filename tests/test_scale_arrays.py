"""Arrays of Dask and Zarr as voxels: the same as the arrays, read where they are wanted."""

from __future__ import annotations

import pickle
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from conftest import law
from tomomesh.errors import UsageError
from tomomesh.model.lazy import in_memory
from tomomesh.model.volume import Volume
from tomomesh.scale.arrays import lazy_voxels
from writers import needed

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

da: Any = pytest.importorskip("dask.array", reason="the extra `scale` is not installed")

STORED = np.random.default_rng(3).integers(0, 255, (9, 10, 11), np.uint8)
AFFINE = np.diag([-1.0, 1.0, 2.0, 1.0])


def of_zarr(folder: Path, **how: Any) -> Any:
    array = needed("zarr").create_array(folder / "s.zarr", shape=STORED.shape, dtype=STORED.dtype, **how)
    array[...] = STORED
    return array


@law(20)
@given(
    chunks=st.tuples(*3 * [st.integers(1, 11)]),
    sides=st.tuples(*3 * [st.lists(st.integers(0, 11), min_size=2, max_size=2).map(sorted)]),
    axis=st.integers(0, 2),
)
def test_any_part_of_dasks_is_that_of_the_array(
    chunks: tuple[int, ...], sides: tuple[list[int], ...], axis: int
) -> None:
    whole = Volume.from_stored(STORED, AFFINE)
    lazy = Volume.from_stored(lazy_voxels(da.from_array(STORED, chunks=chunks)), AFFINE)
    low = [(min(a, n), min(b, n)) for (a, b), n in zip(sides, whole.shape, strict=True)]
    box = slice(*low[0]), slice(*low[1]), slice(*low[2])
    part, same = (in_memory(one.cropped(box).along(axis).voxels) for one in (lazy, whole))
    np.testing.assert_array_equal(part, same, strict=True)


@pytest.mark.parametrize("how", [{"chunks": (4, 4, 4)}, {"chunks": (2, 2, 2), "shards": (4, 4, 4)}])
def test_zarrs_is_the_array_here_and_in_another_process(tmp_path: Path, how: Any) -> None:
    voxels = lazy_voxels(of_zarr(tmp_path, **how))
    assert voxels.transpose((2, 0, 1)).chunks == how["chunks"]
    np.testing.assert_array_equal(voxels[1:, ::-2].read(), STORED[1:, ::-2], strict=True)
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(voxels)).read(), STORED, strict=True)


def test_no_more_chunks_of_dasks_are_computed_than_are_asked_for() -> None:
    seen: list[Any] = []

    def counted(block: NDArray[Any], block_info: Any = None) -> NDArray[Any]:
        seen.append(block_info[0]["chunk-location"])
        return block + 1

    array = da.from_array(STORED, chunks=(3, 10, 11)).map_blocks(counted, dtype=STORED.dtype, meta=STORED[:0])
    voxels = lazy_voxels(array)
    assert not seen
    np.testing.assert_array_equal(voxels[4], STORED[4] + 1, strict=True)
    assert seen == [(1, 0, 0)]


def test_tasks_on_a_cluster_read_them(client: Any) -> None:
    voxels = lazy_voxels(da.from_array(STORED, chunks=4))
    parts = client.gather(client.map(in_memory, [voxels[k : k + 2] for k in range(0, 9, 2)]))
    np.testing.assert_array_equal(np.concatenate(parts), STORED, strict=True)


@pytest.mark.parametrize(
    "array",
    [
        np.zeros((3, 3, 3)), da.zeros((3, 3)), da.zeros((3, 3, 3), dtype=complex), "an array",
        da.from_array(STORED, chunks=4)[da.from_array(STORED[:, 0, 0], chunks=4) > 100],
    ],
    ids=["in memory", "flat", "complex", "text", "unknown sizes"],
)  # fmt: skip
def test_others_are_refused_in_one_line(array: Any) -> None:
    with pytest.raises(UsageError, match=r"^the array is no volume in chunks\. Found: \["):
        lazy_voxels(array)
