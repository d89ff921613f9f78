"""DICOM segmentations in: what highdicom reads of them is what comes back."""

from __future__ import annotations

import random
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydicom import dcmread
from pydicom.uid import DeflatedExplicitVRLittleEndian, RLELossless

from conftest import law, seeds
from faults import changed, fault_of
from segmentations import by_highdicom, frames_of, palette, segmentation, written
from studies import AFFINES, save
from test_io_damage import damaged
from tomomesh.errors import EmptyError, FormatError, GeometryError, TomomeshError
from tomomesh.io import read_volume
from tomomesh.model.volume import Volume
from tomomesh.settings import ReadSettings

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from segmentations import Masks

KINDS = ("BINARY", "FRACTIONAL", "LABELMAP")
AFFINE = AFFINES["oblique"]


def labels(seed: int = 0, shape: tuple[int, int, int] = (9, 7, 11)) -> NDArray[np.int64]:
    """Labels 0 to 2 at random; nothing on the first slice and on two in the middle."""
    found = np.random.default_rng(seed).integers(0, 3, shape)
    found[[0, 4, 5]] = 0
    return found


def masks_of(found: NDArray[np.int64]) -> Masks:
    return {number: found == number for number in (1, 2)}


def shares_of(found: NDArray[np.int64], kind: str) -> Masks:
    """Masks as a kind of segmentation wants them."""
    return {n: mask.astype(np.float64) if kind == "FRACTIONAL" else mask for n, mask in masks_of(found).items()}


def on_full_grid(volume: Volume, shape: tuple[int, int, int], affine: NDArray[np.float64]) -> NDArray[Any]:
    """Lay labels onto the grid they were made on, voxel by voxel."""
    found = np.zeros(shape, volume.voxels.dtype)
    places = volume.to_mm(np.argwhere(volume.voxels)[:, ::-1].astype(float))
    indices = (places - affine[:3, 3]) @ np.linalg.inv(affine[:3, :3]).T
    assert np.abs(indices - np.rint(indices)).max() < 1e-6
    found[tuple(np.rint(indices).astype(int)[:, ::-1].T)] = volume.voxels[volume.voxels > 0]
    return found


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("place", AFFINES)
class TestEveryKindAndPlace:
    def test_highdicom_reads_the_same(self, tmp_path: Path, kind: str, place: str) -> None:
        pytest.importorskip("highdicom", reason="highdicom, the independent judge, is not here")
        judge = by_highdicom(shares_of(labels(), kind), AFFINES[place], tmp_path / "seg.dcm", kind)
        volume = read_volume(tmp_path / "seg.dcm")
        theirs = judge.get_volume(rescale_fractional=False) if kind == "FRACTIONAL" else judge.get_volume(
            combine_segments=True
        )  # fmt: skip
        whole = (theirs.array > 0) @ np.array([1, 2]) if kind == "FRACTIONAL" else theirs.array
        expected = Volume.from_stored(whole, theirs.affine[:, [2, 1, 0, 3]])
        np.testing.assert_array_equal(volume.voxels, expected.voxels)
        np.testing.assert_allclose(volume.affine, expected.affine, atol=1e-4)

    def test_every_voxel_is_in_its_place(self, tmp_path: Path, kind: str, place: str) -> None:
        affine, truth = AFFINES[place], labels(1)
        volume = read_volume(written(shares_of(truth, kind), affine, tmp_path / "seg.dcm", kind=kind))
        np.testing.assert_array_equal(on_full_grid(volume, truth.shape, affine), truth)


@pytest.mark.parametrize("packed", [False, True])
def test_colors_of_labels_are_for_the_eye_alone(tmp_path: Path, packed: bool) -> None:
    pytest.importorskip("highdicom", reason="highdicom, the writer, is not here")
    path = tmp_path / "seg.dcm"
    judge = by_highdicom(masks_of(labels()), AFFINE, path, "LABELMAP", palette_color_lut_transformation=palette())
    assert judge.PhotometricInterpretation == "PALETTE COLOR"
    if packed:
        data = dcmread(path)
        data.compress(RLELossless, encoding_plugin="pydicom")
        save(data, path)
    volume = read_volume(path)
    theirs = judge.get_volume(combine_segments=True)
    expected = Volume.from_stored(theirs.array, theirs.affine[:, [2, 1, 0, 3]])
    np.testing.assert_array_equal(volume.voxels, expected.voxels)
    np.testing.assert_allclose(volume.affine, expected.affine, atol=1e-4)
    assert set(np.unique(volume.voxels)) == {0, 1, 2}


@law(10)
@given(seeds, st.sampled_from(KINDS[:2]))
def test_the_order_of_the_frames_changes_nothing(tmp_path_factory: Any, seed: int, kind: str) -> None:
    folder, masks = tmp_path_factory.mktemp("seg"), masks_of(labels(seed))
    order = frames_of(masks)
    random.Random(seed).shuffle(order)
    one = read_volume(written(masks, AFFINE, folder / "one.dcm", kind=kind))
    other = read_volume(written(masks, AFFINE, folder / "other.dcm", kind=kind, order=order))
    np.testing.assert_array_equal(one.voxels, other.voxels)
    np.testing.assert_allclose(one.affine, other.affine, atol=1e-9)


@pytest.mark.parametrize("kind", KINDS[1:])
def test_run_lengths(tmp_path: Path, kind: str) -> None:
    truth = labels()
    data = segmentation(shares_of(truth, kind), AFFINE, kind=kind)
    data.compress(RLELossless, encoding_plugin="pydicom")
    volume = read_volume(save(data, tmp_path / "seg.dcm"))
    np.testing.assert_array_equal(on_full_grid(volume, truth.shape, AFFINE), truth)


@pytest.mark.parametrize("kind", KINDS)
def test_a_deflated_file(tmp_path: Path, kind: str) -> None:
    truth = labels()
    data = segmentation(shares_of(truth, kind), AFFINE, kind=kind)
    data.file_meta.TransferSyntaxUID = DeflatedExplicitVRLittleEndian
    volume = read_volume(save(data, tmp_path / "seg.dcm"))
    np.testing.assert_array_equal(on_full_grid(volume, truth.shape, AFFINE), truth)


class TestWhatIsDecided:
    def test_segments_are_named_without_control_characters(self, tmp_path: Path) -> None:
        notes = read_volume(written(masks_of(labels()), AFFINE, tmp_path / "seg.dcm")).notes
        assert notes[0] == "segments: 1 Liver, 2 Left [31m kidney"
        assert "background: 2" in notes[1]

    def test_half_is_the_threshold_of_a_share(self, tmp_path: Path) -> None:
        shares = np.linspace(0, 1, 201).reshape(3, 67, 1)
        volume = read_volume(written({1: shares}, np.eye(4), tmp_path / "seg.dcm", kind="FRACTIONAL"))
        np.testing.assert_array_equal(on_full_grid(volume, shares.shape, np.eye(4)), shares >= 0.5)
        assert any("0.5" in note for note in volume.notes)

    def test_numbers_over_255_are_kept(self, tmp_path: Path) -> None:
        found = read_volume(written({300: labels() == 1}, AFFINE, tmp_path / "seg.dcm"))
        assert set(np.unique(found.voxels)) == {0, 300}

    def test_a_folder_that_holds_one_is_read(self, tmp_path: Path) -> None:
        one = read_volume(written(masks_of(labels()), AFFINE, tmp_path / "folder" / "IM0001"))
        np.testing.assert_array_equal(read_volume(tmp_path / "folder").voxels, one.voxels)


class TestOneSlice:
    def test_it_needs_a_distance(self, tmp_path: Path) -> None:
        path = written({1: labels()[1:2] == 1}, AFFINE, tmp_path / "seg.dcm")
        with pytest.raises(GeometryError, match="--spacing-z"):
            read_volume(path)
        np.testing.assert_allclose(read_volume(path, settings=ReadSettings(spacing_z=2.0)).affine, AFFINE, atol=1e-4)

    def test_it_may_say_its_thickness(self, tmp_path: Path) -> None:
        data = segmentation({1: labels()[1:2] == 1}, AFFINE)
        data.SharedFunctionalGroupsSequence[0].PixelMeasuresSequence[0].SliceThickness = 2.0
        np.testing.assert_allclose(read_volume(save(data, tmp_path / "seg.dcm")).affine, AFFINE, atol=1e-4)


class TestEverySecondSlice:
    def test_the_file_says_how_far_slices_are_apart(self, tmp_path: Path) -> None:
        truth = labels()
        truth[::2] = 0
        data = segmentation(masks_of(truth), AFFINE)
        measures = data.SharedFunctionalGroupsSequence[0].PixelMeasuresSequence[0]
        wide = read_volume(save(data, tmp_path / "wide.dcm"))
        measures.SpacingBetweenSlices = 2.0
        said = read_volume(save(data, tmp_path / "said.dcm"))
        np.testing.assert_allclose([wide.spacing_mm[2], said.spacing_mm[2]], [4, 2], atol=1e-6)
        np.testing.assert_array_equal(on_full_grid(wide, truth.shape, AFFINE), truth)
        np.testing.assert_array_equal(on_full_grid(said, truth.shape, AFFINE), truth)

    def test_what_the_file_says_must_fit(self, tmp_path: Path) -> None:
        data = segmentation(masks_of(labels()), AFFINE)
        data.SharedFunctionalGroupsSequence[0].PixelMeasuresSequence[0].SpacingBetweenSlices = 3.1
        np.testing.assert_allclose(read_volume(save(data, tmp_path / "seg.dcm")).spacing_mm[2], 2, atol=1e-6)


class TestOverlap:
    @pytest.fixture
    def path(self, tmp_path: Path) -> Path:
        """A tumor within a liver, and half of a kidney in it."""
        liver, kidney, tumor = np.zeros((3, 6, 8, 8), bool)
        liver[1:5, 1:7, 1:7] = tumor[2:4, 2:4, 2:4] = kidney[2:4, 6:8, 2:6] = True
        return written({1: liver, 2: kidney, 3: tumor}, AFFINE, tmp_path / "seg.dcm")

    def test_it_is_told_with_the_segments(self, path: Path) -> None:
        with pytest.raises(GeometryError) as told:
            read_volume(path)
        assert "1 Liver and 3 Tumor in 8 voxels" in str(told.value)
        assert "1 Liver and 2 Left [31m kidney in 8 voxels" in str(told.value)
        assert "--select" in str(told.value)

    @pytest.mark.parametrize("wanted", [(1,), (2,), (3,), (1, 2), (1, 3), (1, 2, 3), (0, 1)])
    def test_only_what_is_wanted_is_read_and_it_may_overlap(self, path: Path, wanted: tuple[int, ...]) -> None:
        volume = read_volume(path, select=wanted)
        liver = np.ones((4, 6, 6), bool)
        assert set(np.unique(volume.voxels)) - {0} == set(wanted) - {0}
        if 1 in wanted:
            assert (volume.voxels > 0).sum() == liver.sum() + (8 if 2 in wanted else 0)

    def test_one_that_is_hidden_is_told(self, tmp_path: Path) -> None:
        twice = labels() == 1
        with pytest.raises(EmptyError, match="wholly within"):
            read_volume(written({1: twice, 2: twice}, AFFINE, tmp_path / "seg.dcm"), select=(1, 2))

    def test_one_that_is_not_there_is_told_with_those_that_are(self, path: Path) -> None:
        with pytest.raises(EmptyError, match=r"no such segment.*1 Liver, 2 Left"):
            read_volume(path, select=(1, 9))


class TestFaults:
    @pytest.mark.parametrize(
        ("keyword", "value", "kind"),
        [
            ("SegmentationType", "OTHER", FormatError),
            ("SegmentationType", None, FormatError),
            ("NumberOfFrames", 3, FormatError),
            ("Rows", 700, FormatError),
            ("PerFrameFunctionalGroupsSequence", None, TomomeshError),
        ],
    )
    def test_headers_that_lie(self, tmp_path: Path, keyword: str, value: Any, kind: type[TomomeshError]) -> None:
        data = segmentation(masks_of(labels()), AFFINE)
        if value is None:
            delattr(data, keyword)
        else:
            setattr(data, keyword, value)
        with pytest.raises(kind) as told:
            read_volume(save(data, tmp_path / "seg.dcm"))
        assert told.value.exit_code in (4, 5)
        assert "Secret" not in str(told.value)

    @pytest.mark.parametrize(
        ("position", "said"),
        [([0, 0, 1.03], "whole number"), ([4.0, 0, 4.0], "straight line"), ([float("nan"), 0, 0], "frame 3")],
    )
    def test_frames_off_the_lattice(self, tmp_path: Path, position: list[float], said: str) -> None:
        data = segmentation({1: labels() >= 0}, np.eye(4))
        place = data.PerFrameFunctionalGroupsSequence[2].PlanePositionSequence[0]
        place.ImagePositionPatient = position
        with pytest.raises(GeometryError, match=said):
            read_volume(save(data, tmp_path / "seg.dcm"))

    def test_a_frame_of_no_segment(self, tmp_path: Path) -> None:
        data = segmentation(masks_of(labels()), AFFINE)
        del data.PerFrameFunctionalGroupsSequence[2].SegmentIdentificationSequence
        with pytest.raises(FormatError, match="frame 3"):
            read_volume(save(data, tmp_path / "seg.dcm"))

    def test_places_a_light_year_apart(self, tmp_path: Path) -> None:
        data = segmentation({1: labels() >= 0}, np.eye(4))
        last = data.PerFrameFunctionalGroupsSequence[-1].PlanePositionSequence[0]
        last.ImagePositionPatient = [0, 0, 1e12]
        with pytest.raises(TomomeshError) as told:
            read_volume(save(data, tmp_path / "seg.dcm"))
        assert told.value.exit_code in (5, 7)

    @pytest.mark.parametrize("kind", KINDS)
    def test_damage_is_told_in_one_line(self, tmp_path: Path, kind: str) -> None:
        whole, rng = (
            written(shares_of(labels(), kind), AFFINE, tmp_path / "good.dcm", kind=kind).read_bytes(),
            random.Random(kind),
        )
        told = []
        for n in range(40):
            (tmp_path / "bad.dcm").write_bytes(damaged(whole, rng) if n % 2 else changed(whole, rng))
            told.append(fault_of(read_volume, tmp_path / "bad.dcm", settings=ReadSettings(spacing_z=1)))
        faults = [fault for fault in told if fault]
        assert 0 < len(faults) < len(told)
        assert {fault.exit_code for fault in faults} <= {4, 5, 7}
        assert not any("\n" in str(fault) or "Secret" in str(fault) for fault in faults)
