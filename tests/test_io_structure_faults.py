"""RT structure sets that are broken, or hold something else: one line each."""

from __future__ import annotations

import random
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from faults import changed, fault_of
from structure_sets import circle, structure_set, written
from studies import rotation, save
from test_io_damage import damaged
from test_io_structures import EVEN, text
from tomomesh.errors import EmptyError, FormatError, GeometryError, ResourceError
from tomomesh.io import read_points, read_volume
from tomomesh.settings import CloudSettings

if TYPE_CHECKING:
    from pathlib import Path


class TestFaults:
    @pytest.mark.parametrize(
        ("edit", "said"),
        [
            (lambda one: one.update(text("1\\2\\three")), "no number"),
            (lambda one: one.update(text("1\\2\\nan\\1\\2\\3\\4\\5\\6")), "not finite"),
            (lambda one: one.update(text("0\\0\\0\\1\\0\\0\\0\\1")), "incomplete corner"),
            (lambda one: one.update(text("0\\0\\0\\1\\0\\0\\0\\1\\0\\5")), "incomplete corner"),
            (lambda one: one.update(text("")), "no corners"),
            (lambda one: one.update(text("0\\0\\0\\1\\1\\1\\2\\2\\2")), "corners"),
            (lambda one: setattr(one, "NumberOfContourPoints", 7), "another number of corners"),
            (lambda one: delattr(one, "ContourData"), "no corners"),
        ],
    )
    def test_a_broken_contour_is_named(self, tmp_path: Path, edit: Any, said: str) -> None:
        data = structure_set({"one": EVEN})
        edit(data.ROIContourSequence[0].ContourSequence[3])
        with pytest.raises(FormatError, match=said) as told:
            read_points(save(data, tmp_path / "plan.dcm"))
        assert "structure 1, contour 4" in str(told.value)

    @pytest.mark.parametrize("again", [lambda one: one, lambda one: one[::-1], lambda one: np.roll(one, 5, axis=0)])
    def test_a_repeated_contour_is_named(self, tmp_path: Path, again: Any) -> None:
        with pytest.raises(FormatError, match=r"structure 1, contour 17: the same corners as contour 3"):
            read_points(written({"one": [*EVEN, again(EVEN[2])]}, tmp_path / "plan.dcm"))

    @pytest.mark.parametrize("corners", [1, 2, 9])
    def test_a_flat_contour_is_named_or_left_out(self, tmp_path: Path, corners: int) -> None:
        line = np.arange(corners)[:, None] * np.array([[30.0, 10.0, 0.0]]) + EVEN[3][:1]
        path = written({"one": [*EVEN, line]}, tmp_path / "plan.dcm")
        with pytest.raises(FormatError, match=rf"encloses nothing.*contour 17: {corners} corners.*--skip-flat"):
            read_points(path)
        points = read_points(path, settings=CloudSettings(skip_flat=True))
        assert points.notes == (
            "structure 1: one of 1, 16 contours on 16 slices", "contours that enclose nothing, left out: 1",
        )  # fmt: skip

    def test_planes_that_are_not_parallel(self, tmp_path: Path) -> None:
        across = EVEN[8] @ rotation(0.6, 0, 0).T
        with pytest.raises(GeometryError, match=r"parallel planes.*contour 17"):
            read_points(written({"one": [*EVEN, across]}, tmp_path / "plan.dcm"))

    def test_one_slice(self, tmp_path: Path) -> None:
        with pytest.raises(EmptyError, match="one slice"):
            read_points(written({"one": [circle(5, 0), circle(9, 0)]}, tmp_path / "plan.dcm"))

    def test_contours_of_light_years(self, tmp_path: Path) -> None:
        with pytest.raises(ResourceError, match="too long"):
            read_points(written({"one": [*EVEN, circle(1e9, 30, 4000)]}, tmp_path / "plan.dcm"))

    def test_files_that_hold_something_else(self, tmp_path: Path) -> None:
        from segmentations import written as segmentation

        path = segmentation({1: np.ones((2, 3, 4), bool)}, np.eye(4), tmp_path / "seg.dcm")
        with pytest.raises(FormatError, match=r"no contours.*tomomesh reconstruct"):
            read_points(path)
        with pytest.raises(FormatError, match=r"no voxels.*tomomesh surface"):
            read_volume(written({"one": EVEN}, tmp_path / "plan.dcm"))

    def test_damage_is_told_in_one_line(self, tmp_path: Path) -> None:
        contours = [circle(np.sqrt(100 - z * z), z, 12) for z in (-6.0, -2.0, 2.0, 6.0)]
        whole = written({"one": contours, "two": contours}, tmp_path / "good.dcm").read_bytes()
        rng, told = random.Random(5), []
        for n in range(120):
            (tmp_path / "bad.dcm").write_bytes(damaged(whole, rng) if n % 4 == 0 else changed(whole, rng))
            told.append(fault_of(read_points, tmp_path / "bad.dcm", settings=CloudSettings(structure="1")))
        faults = [fault for fault in told if fault]
        assert 0 < len(faults) < len(told)
        assert {fault.exit_code for fault in faults} <= {2, 4, 5, 6, 7}
        assert not any("\n" in str(fault) or "Secret" in str(fault) for fault in faults)
