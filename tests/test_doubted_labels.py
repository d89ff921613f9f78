"""A study of gray levels that is taken for a label map is warned of."""

from __future__ import annotations

import numpy as np
import pytest

from test_end_to_end import ball
from tomomesh import reconstruct, segment
from tomomesh.model.volume import Volume


def warnings(volume: Volume, labels: Volume | None = None) -> list[str]:
    told: list[str] = segment(volume, labels=labels, select=(7,), network="none").report["warnings"]
    return told


def map_of(dtype: type, unit: str = "stored") -> Volume:
    return Volume.from_stored(np.where(ball() > 50, 7, 0).astype(dtype), np.eye(4), unit=unit)


class TestDoubt:
    def test_a_label_map_is_not_warned_of(self) -> None:
        assert not any("label" in warning for warning in warnings(map_of(np.uint8)))

    @pytest.mark.parametrize(("volume", "said"), [
        (map_of(np.float32), "float32"), (map_of(np.int16, "HU"), "Hounsfield"),
    ])  # fmt: skip
    def test_floats_and_studies_are(self, volume: Volume, said: str) -> None:
        assert any(said in warning for warning in warnings(volume))
        assert any(said in warning for warning in warnings(map_of(np.uint8), volume))

    def test_many_levels_are(self) -> None:
        levels = np.zeros((20, 20, 20), np.uint16)
        levels.flat[:5000] = np.arange(5000)
        assert any("5000 labels" in warning for warning in warnings(Volume.from_stored(levels, np.eye(4))))


class TestGrayLevels:
    def test_labels_that_are_taken_for_gray_levels_are_warned_of(self) -> None:
        labels = np.where(ball() > 50, 7, 0).astype(np.uint8)
        labels[:, :, :20] //= 2
        told = segment(Volume.from_stored(labels, np.eye(4)), network="none").report["warnings"]
        assert any("--select chooses labels" in warning for warning in told)

    def test_gray_levels_and_masks_are_not(self) -> None:
        levels = ball() + np.random.default_rng(0).integers(0, 20, ball().shape)
        for one in (levels, np.where(ball() > 50, 7, 0)):
            told = segment(Volume.from_stored(one.astype(np.uint8), np.eye(4)), network="none").report["warnings"]
            assert not any("--select" in warning for warning in told)


class TestMasks:
    """A mask among gray levels is told; labels are masks, and nothing is to be said of that."""

    def test_labels_are_not_told_to_be_a_mask(self) -> None:
        mask = np.where(ball() > 50, 7, 0).astype(np.uint8)
        alone = reconstruct(Volume.from_stored(mask, np.eye(4)), select=(7,), network="none").report
        beside = reconstruct(
            Volume.from_stored(ball(), np.eye(4)), labels=Volume.from_stored(mask, np.eye(4)), select=(7,)
        ).report
        gray = reconstruct(Volume.from_stored(mask, np.eye(4)), lower=3, network="none").report
        assert [alone["warnings"], beside["warnings"]] == [[], []]
        assert any("those of a mask" in warning for warning in gray["warnings"])
        assert not alone["voxels"]["interpolated"]
