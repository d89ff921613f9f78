"""Volumes as NPY arrays."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from studies import AFFINES, assert_in_place, sampled
from tomomesh.errors import FormatError, GeometryError
from tomomesh.io import read_volume
from tomomesh.settings import ReadSettings

if TYPE_CHECKING:
    from pathlib import Path


SPACING = ReadSettings(spacing=(0.5, 0.7, 2.0))


class TestNpy:
    def test_a_spacing_puts_it_in_place(self, tmp_path: Path) -> None:
        stored = sampled(np.diag([0.5, 0.7, 2, 1]))
        for name, array in (("c", stored), ("f", np.asfortranarray(stored)), ("b", stored.astype(">i2"))):
            np.save(tmp_path / f"{name}.npy", array)
            assert_in_place(read_volume(tmp_path / f"{name}.npy", settings=SPACING))

    @pytest.mark.parametrize("order", ["C", "F"])
    def test_a_mask_of_true_and_false(self, tmp_path: Path, order: Any) -> None:
        mask = np.array(sampled(AFFINES["axial"]) > 2000, order=order)
        np.save(tmp_path / "a.npy", mask)
        volume = read_volume(tmp_path / "a.npy", settings=SPACING)
        np.testing.assert_array_equal(volume.voxels, mask)
        assert volume.voxels.dtype == np.uint8

    @pytest.mark.parametrize("before", [(1,), (1, 1)])
    @pytest.mark.parametrize("order", ["C", "F"])
    def test_axes_of_one_are_dropped(self, tmp_path: Path, before: tuple[int, ...], order: Any) -> None:
        stored = sampled(np.diag([0.5, 0.7, 2, 1]))
        colors = np.stack([stored % 200] * 3, axis=-1).astype(np.uint8)
        for name, array in (("gray", stored), ("color", colors)):
            np.save(tmp_path / f"{name}.npy", np.array(array.reshape(*before, *array.shape), order=order))
        assert_in_place(read_volume(tmp_path / "gray.npy", settings=SPACING))
        np.testing.assert_array_equal(read_volume(tmp_path / "color.npy", settings=SPACING).voxels, colors)

    def test_without_it_one_is_asked_for(self, tmp_path: Path) -> None:
        np.save(tmp_path / "a.npy", sampled(AFFINES["axial"]))
        with pytest.raises(GeometryError, match="--spacing x y z"):
            read_volume(tmp_path / "a.npy")

    @pytest.mark.parametrize("array", [np.zeros((3, 3)), np.zeros((2, 3, 4, 5)), np.zeros((2, 0, 3)), np.array([{}])])
    def test_other_arrays_are_refused(self, tmp_path: Path, array: Any) -> None:
        np.save(tmp_path / "a.npy", array, allow_pickle=True)
        with pytest.raises(FormatError):
            read_volume(tmp_path / "a.npy", settings=SPACING)

    def test_truth_values_are_a_mask(self, tmp_path: Path) -> None:
        mask = sampled(np.diag([0.5, 0.7, 2, 1])) > 50
        np.save(tmp_path / "a.npy", mask)
        read = read_volume(tmp_path / "a.npy", settings=SPACING)
        np.testing.assert_array_equal(read.voxels, mask.astype(np.uint8))

    @pytest.mark.parametrize("dtype", [bool, np.uint8])
    @pytest.mark.parametrize("layers", [3, 4])
    def test_masks_behind_each_other_are_no_color(self, tmp_path: Path, dtype: type, layers: int) -> None:
        numbers = np.arange(4 * 5 * 6).reshape(4, 5, 6) % layers
        np.save(tmp_path / "a.npy", np.stack([numbers == n for n in range(layers)], axis=3).astype(dtype))
        with pytest.raises(FormatError, match="several values"):
            read_volume(tmp_path / "a.npy", settings=SPACING)
        colors = np.random.default_rng(0).integers(0, 256, (4, 5, 6, layers)).astype(np.uint8)
        np.save(tmp_path / "c.npy", colors)
        np.testing.assert_array_equal(read_volume(tmp_path / "c.npy", settings=SPACING).voxels, colors[..., :3])
