"""The part of a study that matters: boxes in millimeters, ranges of slices, and labels on the whole grid."""

from __future__ import annotations

from typing import TYPE_CHECKING

import nibabel
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from conftest import law
from studies import AFFINES, affine_of, assert_in_place, indices_of, rotation, sampled, write_nifti
from test_cli import fails
from test_end_to_end import ball
from tomomesh import read_volume, reconstruct, segment
from tomomesh.cli import main
from tomomesh.errors import EmptyError, UsageError
from tomomesh.model.volume import Volume
from tomomesh.segmentation.crop import crop, inside_roi
from tomomesh.settings.crop import CropSettings

if TYPE_CHECKING:
    from pathlib import Path

    from _pytest.capture import CaptureFixture
    from numpy.typing import NDArray

NAMES = sorted(AFFINES)


def volume_of(name: str) -> Volume:
    return Volume.from_stored(sampled(AFFINES[name]), AFFINES[name])


def roi_around(volume: Volume, shares: NDArray[np.float64]) -> tuple[float, ...]:
    """Return a box between two shares (2, 3) of the way through a study along each axis of the patient."""
    ends = volume.to_mm(indices_of(volume.shape))
    low, high = ends.min(axis=0), ends.max(axis=0)
    sides = np.sort(low + shares * (high - low), axis=0)
    return tuple(sides.T.ravel())


class TestCrop:
    @law(60)
    @given(st.sampled_from(NAMES), st.lists(st.floats(0.2, 0.8), min_size=6, max_size=6))
    def test_the_part_is_a_view_in_place_and_holds_what_the_box_holds(self, name: str, shares: list[float]) -> None:
        volume = volume_of(name)
        roi = roi_around(volume, np.reshape(shares, (2, 3)))
        part, sides = CropSettings(roi=roi), np.array(roi)
        low, high = sides[::2], sides[1::2]
        places = volume.to_mm(indices_of(volume.shape))
        wanted = ((places >= low - 1e-5) & (places <= high + 1e-5)).all(axis=1)
        try:
            found, box = crop(volume, part, 2)
            inside = inside_roi(found, part.roi)
        except EmptyError:
            assert not ((places >= low + 1e-5) & (places <= high - 1e-5)).all(axis=1).any()
            return
        assert np.shares_memory(found.voxels, volume.voxels)
        assert_in_place(found)
        whole = np.zeros(volume.shape, bool)
        whole[box] = True if inside is None else inside[:]
        assert np.array_equal(whole.ravel(), wanted)

    @pytest.mark.parametrize("name", NAMES)
    @pytest.mark.parametrize("axis", [0, 1, 2])
    def test_slices_are_counted_along_their_axis_and_from_the_end(self, name: str, axis: int) -> None:
        volume = volume_of(name)
        count = len(volume.along(axis).voxels)
        forth, _ = crop(volume, CropSettings(slice_range=(1, count - 2)), axis)
        back, _ = crop(volume, CropSettings(slice_range=(1, -2)), axis)
        assert np.array_equal(forth.along(axis).voxels, volume.along(axis).voxels[1:-1])
        assert np.array_equal(forth.voxels, back.voxels)
        assert_in_place(forth.along(axis))

    @pytest.mark.parametrize("name", NAMES)
    @pytest.mark.parametrize("axis", [0, 1, 2])
    def test_what_is_found_in_a_part_of_a_part_goes_back_to_its_own_voxels(self, name: str, axis: int) -> None:
        volume = volume_of(name)
        once, _ = crop(volume, CropSettings(slice_range=(1, -1)), axis)
        twice = once.along((axis + 1) % 3).cropped((slice(0, 2), slice(1, 3), slice(1, 4))).along(2)
        restored = twice.grid.restore(twice.voxels)
        assert restored.shape == volume.grid.shape
        kept = restored != 0
        assert np.count_nonzero(kept) == twice.voxels.size
        assert np.array_equal(restored[kept], volume.grid.restore(volume.voxels)[kept])

    def test_the_whole_grid_lies_where_the_study_does(self) -> None:
        volume = volume_of("oblique sagittal")
        part = volume.cropped((slice(1, 3), slice(0, 2), slice(2, 4)))
        blank = part.grid.blank()
        assert blank.shape == volume.shape
        assert np.allclose(blank.affine, volume.affine)

    @pytest.mark.parametrize("asked", [(0, 99), (5, 3), (-99, 2), (3, -4)])
    def test_slices_that_there_are_not_are_refused(self, asked: tuple[int, int]) -> None:
        with pytest.raises(EmptyError, match="0 to 4"):
            crop(volume_of("axial"), CropSettings(slice_range=asked), 2)

    def test_a_box_elsewhere_is_refused_with_the_extent_of_the_study(self) -> None:
        with pytest.raises(EmptyError, match=r"x -3 to 1, y 11 to 15\.2, z 40 to 48 mm"):
            crop(volume_of("axial"), CropSettings(roi=(50, 60, 11, 12, 40, 48)), 2)

    def test_a_box_between_the_voxels_of_a_turned_grid_is_refused(self) -> None:
        volume = volume_of("oblique")
        middle = volume.to_mm(np.array([[3.5, 3.5, 2.5]]))[0]
        roi = tuple(np.stack([middle - 1e-3, middle + 1e-3], axis=1).ravel())
        with pytest.raises(EmptyError, match="no voxel"):
            inside_roi(volume, roi)

    def test_a_box_inside_out_is_refused(self) -> None:
        with pytest.raises(UsageError, match="X0 <= X1"):
            CropSettings(roi=(1.0, 0.0, 0.0, 1.0, 0.0, 1.0))


class TestOnWholeGrid:
    """Commands on a part, judged by nibabel."""

    AFFINE = affine_of(rotation(0.3, 0.1, -0.2) @ np.diag([-1.0, 1.0, 1.0]), (1.0, 1.0, 1.0))

    @pytest.mark.parametrize("network", ["none", "ring"])
    def test_labels_of_a_part_lie_on_the_grid_of_the_file(self, tmp_path: Path, network: str) -> None:
        study = write_nifti(tmp_path / "ball.nii", ball(), self.AFFINE)
        labels, report = tmp_path / "labels.nii", tmp_path / "report.json"
        options = ["--lower", "50", "--network", network, "--slice-range", "12", "-15", "--slices", "axial", "--quiet"]
        assert main([
            "reconstruct", str(study), "-o", str(tmp_path / "ball.ply"), "--labels", str(labels), "--report",
            str(report), *options,
        ]) == 0  # fmt: skip
        written, source = nibabel.load(labels), nibabel.load(study)
        assert np.allclose(written.affine, source.affine, atol=1e-5)
        inside = np.asarray(written.dataobj) > 0
        assert inside.any()
        assert (np.asarray(source.dataobj)[inside] > 50).all()
        whole = read_volume(study).along(2)
        kept = whole.grid.restore(np.broadcast_to(np.arange(len(whole.voxels))[:, None, None], whole.shape)).T
        assert kept[inside].min() == 12
        assert kept[inside].max() == len(whole.voxels) - 15

    def test_a_label_map_is_cropped_with_its_study(self, tmp_path: Path) -> None:
        volume = Volume.from_stored(ball(), self.AFFINE)
        labels = Volume.from_stored((ball() > 50).astype(np.uint8), self.AFFINE)
        by_window = segment(volume, lower=50.0, network="none", slice_range=(12, 19))
        by_label = segment(volume, labels=labels, select=(1,), network="none", slice_range=(12, 19))
        assert np.array_equal(by_label.mask, by_window.mask)

    def test_what_lies_outside_of_the_box_on_a_turned_grid_is_no_part_of_the_mesh(self) -> None:
        volume = Volume.from_stored(ball(), self.AFFINE)
        center = volume.to_mm((np.array(volume.shape[::-1]) - 1)[None] / 2.0)[0]
        roi = (center[0], center[0] + 50, center[1] - 50, center[1] + 50, center[2] - 50, center[2] + 50)
        whole = reconstruct(volume, lower=50.0, network="none").mesh
        half = reconstruct(volume, lower=50.0, network="none", roi=roi).mesh
        assert half.vertices[:, 0].min() > center[0] - 1
        assert half.face_volumes.sum() == pytest.approx(whole.face_volumes.sum() / 2, rel=0.08)

    def test_the_report_says_what_was_kept(self) -> None:
        volume = Volume.from_stored(ball(), np.eye(4))
        _, rows, columns = volume.shape
        study = segment(volume, lower=50.0, slice_range=(2, 7)).report["study"]
        assert study["crop"] == {"slices": [2, 7], "rows": [0, rows - 1], "columns": [0, columns - 1]}
        assert segment(volume, lower=50.0).report["study"]["crop"] is None


def test_the_command_refuses_a_box_elsewhere(tmp_path: Path, capsys: CaptureFixture[str]) -> None:
    study = write_nifti(tmp_path / "ball.nii", ball(), np.eye(4))
    output = tmp_path / "ball.ply"
    box = ["--roi", "-900", "-800", "0", "1e1", "0", "10"]
    assert "x " in fails(["reconstruct", str(study), "-o", str(output), *box], 6, capsys)
    assert not output.exists()


def test_inspect_tells_of_the_part(tmp_path: Path, capsys: CaptureFixture[str]) -> None:
    study = write_nifti(tmp_path / "ball.nii", ball(), np.eye(4))
    assert main(["inspect", str(study), "--slice-range", "2", "5"]) == 0
    assert "size      4 slices" in capsys.readouterr().out
