"""Enhanced multi-frame files: several stacks, and several images at one position."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from pydicom.dataset import Dataset
from pydicom.sequence import Sequence
from pydicom.tag import Tag

from studies import AFFINES, assert_in_place, enhanced, sampled, save, setting, slice_dataset, write_series
from tomomesh.errors import FormatError, GeometryError
from tomomesh.io import read_volume
from tomomesh.settings import ReadSettings

if TYPE_CHECKING:
    from pathlib import Path

AXIAL = AFFINES["axial"]
STORED = sampled(AXIAL)


def content(data: Dataset, frame: int, **fields: object) -> None:
    """Describe a frame's place among the dimensions of its file."""
    item = Dataset()
    for keyword, value in fields.items():
        setattr(item, keyword, value)
    data.PerFrameFunctionalGroupsSequence[frame].FrameContentSequence = Sequence([item])


def test_stacks_of_one_file_are_listed_and_chosen_like_series(tmp_path: Path) -> None:
    other = AFFINES["oblique sagittal"]
    data = enhanced(np.concatenate([STORED, sampled(other)]), AXIAL, list(range(10)))
    tilted = enhanced(sampled(other), other, list(range(5)))
    groups = data.PerFrameFunctionalGroupsSequence
    for frame in range(10):
        if frame >= 5:
            groups[frame] = tilted.PerFrameFunctionalGroupsSequence[frame - 5]
        content(data, frame, StackID=str(1 + frame // 5), InStackPositionNumber=1 + frame % 5)
    path = save(data, tmp_path / "e.dcm")
    with pytest.raises(GeometryError, match=r"1: no description, stack 1, slices 5.*2: .*stack 2.*--series"):
        read_volume(path)
    for series in (1, 2):
        assert_in_place(read_volume(path, settings=ReadSettings(series=series)))


def test_time_points_of_one_file_are_refused_with_the_dimension(tmp_path: Path) -> None:
    data = enhanced(np.concatenate([STORED, STORED + 1]), AXIAL, [0, 1, 2, 3, 4, 0, 1, 2, 3, 4])
    data.NumberOfFrames = 10
    data.PixelData = np.concatenate([STORED, STORED + 1]).tobytes()
    pointers = [Dataset(), Dataset()]
    pointers[0].DimensionIndexPointer, pointers[1].DimensionIndexPointer = Tag(0x00209057), Tag(0x00209128)
    data.DimensionIndexSequence = Sequence(pointers)
    for frame in range(10):
        content(data, frame, DimensionIndexValues=[1 + frame % 5, 1 + frame // 5])
    path = save(data, tmp_path / "e.dcm")
    with pytest.raises(GeometryError, match=r"TemporalPositionIndex = 1 and 2.*one TemporalPositionIndex alone"):
        read_volume(path)


def test_frames_without_dimensions_are_refused_too(tmp_path: Path) -> None:
    data = enhanced(STORED, AXIAL, [0, 1, 2, 3, 3])
    data.PixelData = STORED.tobytes()
    with pytest.raises(GeometryError, match=r"different slices are at the same position.*PixelData = different"):
        read_volume(save(data, tmp_path / "e.dcm"))


def test_echoes_of_plain_files_are_refused_with_a_hint(tmp_path: Path) -> None:
    folder = write_series(tmp_path / "s", STORED, AXIAL, setting(EchoTime=10, EchoNumbers=1))
    for k in range(5):
        data = slice_dataset(STORED[k] + 5, AXIAL, k)
        data.EchoTime, data.EchoNumbers = 80, 2
        save(data, folder / f"second-{k}.dcm")
    with pytest.raises(GeometryError, match=r"EchoTime = 10\.0 and 80\.0.*the slices of one EchoTime alone"):
        read_volume(folder)


def test_a_scale_of_its_own_for_each_frame_is_applied(tmp_path: Path) -> None:
    data = enhanced(STORED, AXIAL, [0, 1, 2, 3, 4])
    for frame, group in enumerate(data.PerFrameFunctionalGroupsSequence):
        group.PixelValueTransformationSequence[0].RescaleIntercept = -100 * frame
    data.PixelData = (STORED + 100 * np.arange(5, dtype=np.int16)[:, None, None]).tobytes()
    assert_in_place(read_volume(save(data, tmp_path / "e.dcm")))


def test_a_count_of_frames_that_the_file_cannot_hold_is_refused_at_once(tmp_path: Path) -> None:
    data = slice_dataset(STORED[0], AXIAL, 0)
    data.NumberOfFrames = 2**31 - 1
    with pytest.raises(FormatError, match=r"cut off.*2147483647"):
        read_volume(save(data, tmp_path / "e.dcm"))
