"""Files of several frames without functional groups: dose, nuclear medicine, ultrasound, angiography, old captures."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydicom.dataset import Dataset
from pydicom.sequence import Sequence
from pydicom.tag import Tag

from conftest import law
from studies import TURNED, assert_in_place, enhanced, gray_at, indices_of, sampled, save, set_pixels, slice_dataset
from tomomesh.cli import main
from tomomesh.errors import FormatError, GeometryError
from tomomesh.io import list_series, read_volume
from tomomesh.settings import ReadSettings

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

STORAGE = "1.2.840.10008.5.1.4.1.1."
DOSE, NUCLEAR, ULTRASOUND, ANGIOGRAPHY, CAPTURE = (STORAGE + end for end in ("481.2", "20", "3.1", "12.1", "7.3"))
AXIAL = TURNED["axial"]
STEP = 2.0
GIVEN = ReadSettings(spacing_z=1.0, spacing=(1.0, 1.0, 1.0), fill_gaps=True, resample_slices=True)
"""Every flag that stands in for a place."""


def frames(affine: NDArray[np.float64], offsets: NDArray[np.floating[Any]], kind: str, **fields: Any) -> Dataset:
    """Return a file whose frames lie at offsets in mm along the normal of the first one's rows and columns."""
    normal = np.cross(affine[:3, 0], affine[:3, 1])
    normal /= np.linalg.norm(normal)
    planes = []
    for offset in offsets:
        placed = affine.copy()
        placed[:3, 3] += offset * normal
        planes.append(sampled(placed, (1, 7, 9))[0])
    data = slice_dataset(planes[0], affine, 0)
    set_pixels(data, np.array(planes))
    data.SOPClassUID = data.file_meta.MediaStorageSOPClassUID = kind
    data.NumberOfFrames = len(offsets)
    for keyword, value in fields.items():
        setattr(data, keyword, value)
    return data


def dose(affine: NDArray[np.float64], offsets: NDArray[np.floating[Any]], **fields: Any) -> Dataset:
    """Return a dose whose stored numbers are a fourth of the gray levels."""
    data = frames(affine, offsets, DOSE, Modality="RTDOSE", DoseUnits="GY", DoseGridScaling=0.25)
    data.FrameIncrementPointer = Tag("GridFrameOffsetVector")
    data.GridFrameOffsetVector = [float(offset) for offset in offsets]
    stored = np.frombuffer(data.PixelData, np.int16).reshape(len(offsets), 7, 9)
    set_pixels(data, (4 * stored.astype(np.int64)).astype(np.int32))
    for keyword, value in fields.items():
        setattr(data, keyword, value)
    return data


def nuclear(affine: NDArray[np.float64], slices: list[int], distance: float, **fields: Any) -> Dataset:
    """Return reconstructed slices of nuclear medicine, whose place is kept with the detector."""
    data = frames(affine, (np.array(slices) - slices[0]) * distance, NUCLEAR, Modality="NM")
    data.ImageType, data.SpacingBetweenSlices = ["ORIGINAL", "PRIMARY", "RECON TOMO", "EMISSION"], distance
    data.FrameIncrementPointer, data.SliceVector = Tag("SliceVector"), slices
    detector = Dataset()
    for keyword in ("ImagePositionPatient", "ImageOrientationPatient"):
        setattr(detector, keyword, data[keyword].value)
        delattr(data, keyword)
    data.DetectorInformationSequence = Sequence([detector])
    for keyword, value in fields.items():
        setattr(data, keyword, value)
    return data


class TestPlaces:
    @pytest.mark.parametrize("turn", sorted(TURNED))
    @pytest.mark.parametrize("sign", [1, -1])
    def test_a_dose_is_at_its_place_and_scaled(self, tmp_path: Path, turn: str, sign: int) -> None:
        volume = read_volume(save(dose(TURNED[turn], sign * STEP * np.arange(5)), tmp_path / "d.dcm"))
        assert_in_place(volume)
        assert (volume.unit, volume.voxels.shape) == ("Gy", (5, 7, 9) if turn == "axial" else volume.voxels.shape)

    @pytest.mark.parametrize("sign", [1, -1])
    @pytest.mark.parametrize("turn", [1.0, -1.0])
    def test_offsets_of_a_dose_may_be_heights(self, tmp_path: Path, sign: int, turn: float) -> None:
        affine = AXIAL @ np.diag([turn, turn, 1.0, 1.0])
        data = dose(affine, sign * STEP * np.arange(5))
        data.GridFrameOffsetVector = [float(affine[2, 3] + sign * STEP * n) for n in range(5)]
        assert_in_place(read_volume(save(data, tmp_path / "d.dcm")))

    @given(gaps=st.lists(st.sampled_from([1.0, 1.5, 2.0, 3.0, 4.7]), min_size=2, max_size=6), falls=st.booleans())
    @law(40)
    def test_uneven_planes_of_a_dose_are_interpolated(
        self, tmp_path_factory: pytest.TempPathFactory, gaps: list[float], falls: bool
    ) -> None:
        offsets = np.cumsum([0.0, *gaps]) * (-1 if falls else 1)
        path = tmp_path_factory.mktemp("dose") / "d.dcm"
        volume = read_volume(save(dose(AXIAL, offsets), path))
        assert_in_place(volume, 0.6)  # the gray levels are linear along the normal; planes may be off by 1 % of a step
        heights = AXIAL[2, 3] + offsets
        ends = volume.to_mm(np.array([[0.0, 0, 0], [0, 0, len(volume.voxels) - 1]]))[:, 2]
        np.testing.assert_allclose(ends, [heights.min(), heights.max()])

    @pytest.mark.parametrize("distance", [2.0, -2.0])
    @pytest.mark.parametrize("slices", [[1, 2, 3, 4, 5], [5, 4, 3, 2, 1], [3, 1, 2, 5, 4]])
    @pytest.mark.parametrize("turn", ["axial", "oblique", "left-handed"])
    def test_nuclear_medicine_is_at_its_place(
        self, tmp_path: Path, distance: float, slices: list[int], turn: str
    ) -> None:
        path = save(nuclear(TURNED[turn], slices, distance), tmp_path / "n.dcm")
        for settings in (ReadSettings(), ReadSettings(spacing_z=7.0)):
            assert_in_place(read_volume(path, settings=settings))

    @pytest.mark.parametrize("distance", [2.0, -2.0])
    @pytest.mark.parametrize("kind", [CAPTURE, ULTRASOUND, STORAGE + "3", ANGIOGRAPHY])
    def test_old_frames_with_a_distance_go_along_their_normal(self, tmp_path: Path, kind: str, distance: float) -> None:
        """Volumes of ultrasound and of rotational angiography were written so, with a time for the viewer's film."""
        fields = {"FrameTime": 30, "FrameIncrementPointer": Tag("FrameTime")}
        data = frames(AXIAL, distance * np.arange(5), kind, SpacingBetweenSlices=distance, **fields)
        volume = read_volume(save(data, tmp_path / "c.dcm"))
        assert_in_place(volume)
        assert "along their normal" in volume.notes[0]

    @pytest.mark.parametrize("shared", [False, True])
    def test_groups_that_say_other_things_leave_places_to_the_header(self, tmp_path: Path, shared: bool) -> None:
        data = frames(AXIAL, STEP * np.arange(5), CAPTURE, SpacingBetweenSlices=STEP)
        scale = Dataset()
        scale.RescaleSlope, scale.RescaleIntercept = 1, 0
        group = Dataset()
        group.PixelValueTransformationSequence = Sequence([scale])
        data.PerFrameFunctionalGroupsSequence = Sequence([Dataset() if shared else group for _ in range(5)])
        data.SharedFunctionalGroupsSequence = Sequence([group] if shared else [])
        volume = read_volume(save(data, tmp_path / "f.dcm"))
        assert_in_place(volume)
        assert any("placed by SpacingBetweenSlices" in note for note in volume.notes)
        del data.SpacingBetweenSlices
        with pytest.raises(GeometryError, match="where its first frame lies, but no other"):
            read_volume(save(data, tmp_path / "f.dcm"))

    def test_slice_locations_place_frames_where_they_begin_with_the_first(self, tmp_path: Path) -> None:
        for first in (0.0, AXIAL[2, 3]):
            data = frames(AXIAL, -STEP * np.arange(5), CAPTURE)
            data.FrameIncrementPointer = Tag("SliceLocationVector")
            data.SliceLocationVector = [first - STEP * n for n in range(5)]
            assert_in_place(read_volume(save(data, tmp_path / "c.dcm")))

    def test_one_frame_alone_is_where_it_says(self, tmp_path: Path) -> None:
        path = save(dose(AXIAL, np.zeros(1)), tmp_path / "d.dcm")
        assert_in_place(read_volume(path, settings=ReadSettings(spacing_z=2.0)))

    def test_where_only_the_first_frame_is_told_nothing_else_is_said(self, tmp_path: Path) -> None:
        path = save(frames(AXIAL, STEP * np.arange(5), CAPTURE), tmp_path / "c.dcm")
        with pytest.raises(GeometryError, match=r"first frame lies, but no other.*--spacing-z") as caught:
            read_volume(path)
        assert "ImagePositionPatient" not in str(caught.value)
        volume = read_volume(path, settings=ReadSettings(spacing_z=STEP))
        assert_in_place(volume)
        assert "along their normal" in volume.notes[0]

    def test_a_volume_of_ultrasound_is_placed_by_its_transducer(self, tmp_path: Path) -> None:
        data = enhanced(sampled(AXIAL), AXIAL, [0, 1, 2, 3, 4])
        data.SOPClassUID = data.file_meta.MediaStorageSOPClassUID = STORAGE + "6.2"
        for groups in data.PerFrameFunctionalGroupsSequence:
            for kind in ("Position", "Orientation"):
                item = Dataset()
                value = [float(v) for v in groups[f"Plane{kind}Sequence"][0][f"Image{kind}Patient"].value]
                setattr(item, f"Image{kind}Volume", value)
                setattr(groups, f"Plane{kind}VolumeSequence", Sequence([item]))
                delattr(groups, f"Plane{kind}Sequence")
        volume = read_volume(save(data, tmp_path / "u.dcm"))
        assert_in_place(volume)
        assert "transducer" in volume.notes[0]

    def test_a_dose_beside_its_ct_is_a_series_with_a_distance(self, tmp_path: Path) -> None:
        save(dose(AXIAL, STEP * np.arange(5), SeriesNumber=7, SeriesInstanceUID="1.7"), tmp_path / "s" / "d.dcm")
        for k in range(3):
            save(slice_dataset(sampled(AXIAL)[k], AXIAL, k), tmp_path / "s" / f"{k}.dcm")
        dosed = list_series(tmp_path / "s").series[1]
        assert (dosed.modality, dosed.slices, dosed.refused) == ("RTDOSE", 5, None)
        assert dosed.slice_spacing.distances_mm == pytest.approx((STEP, STEP))


class TestRefused:
    @pytest.mark.parametrize(
        ("kind", "fields", "what"),
        [
            (ULTRASOUND, {"Modality": "US", "FrameTime": 30}, "points in time, Modality = US"),
            (STORAGE + "3", {"Modality": "US"}, "points in time, Modality = US"),
            (ANGIOGRAPHY, {"Modality": "XA"}, "projections, Modality = XA"),
            (STORAGE + "12.2", {"Modality": "RF", "FrameTimeVector": [0.0, 30, 30, 30, 30]}, "projections, .*= RF"),
            (STORAGE + "77.1.4.1", {"Modality": "XC"}, "points in time"),
            (STORAGE + "77.1.6", {"Modality": "SM"}, "tiles of a slide"),
            (NUCLEAR, {"ImageType": ["ORIGINAL", "PRIMARY", "TOMO", "EMISSION"]}, "projections, .*= TOMO"),
            (NUCLEAR, {"ImageType": ["ORIGINAL", "PRIMARY", "DYNAMIC", "EMISSION"]}, "points in time, .*= DYNAMIC"),
            (NUCLEAR, {"ImageType": ["ORIGINAL", "PRIMARY", "WHOLE BODY", "EMISSION"]}, "projections, .*= WHOLE"),
            (CAPTURE, {"FrameTime": 30, "FrameIncrementPointer": Tag("FrameTime")}, "points in time, .* FrameTime"),
        ],
    )  # fmt: skip
    def test_what_is_no_slice_is_named_whatever_the_flags(
        self, tmp_path: Path, kind: str, fields: dict[str, Any], what: str
    ) -> None:
        path = save(frames(AXIAL, STEP * np.arange(5), kind, **fields), tmp_path / "f.dcm")
        for settings in (ReadSettings(), GIVEN):
            with pytest.raises(FormatError, match=rf"frames of the file are no slices.*{what}") as caught:
                read_volume(path, settings=settings)
            assert "missing" not in str(caught.value)
        assert main(["inspect", str(path), "--spacing-z", "1"]) == 4

    def test_a_dose_without_its_scale_is_refused(self, tmp_path: Path) -> None:
        data = dose(AXIAL, STEP * np.arange(5))
        del data.DoseGridScaling
        with pytest.raises(FormatError, match="DoseGridScaling = missing"):
            read_volume(save(data, tmp_path / "d.dcm"), settings=GIVEN)

    @pytest.mark.parametrize(
        ("offsets", "what"),
        [
            ([5.0, 7, 9, 11, 13], r"GridFrameOffsetVector = 5, \.\.\..*height of the first frame = 40"),
            ([0.0, 2, 4], "GridFrameOffsetVector = 3 numbers.*Expected: 5"),
        ],
    )
    def test_offsets_that_begin_nowhere_are_refused(self, tmp_path: Path, offsets: list[float], what: str) -> None:
        path = save(dose(AXIAL, STEP * np.arange(5), GridFrameOffsetVector=offsets), tmp_path / "d.dcm")
        with pytest.raises(FormatError, match=what):
            read_volume(path, settings=GIVEN)

    def test_gates_at_one_place_are_named(self, tmp_path: Path) -> None:
        data = nuclear(AXIAL, [1, 2, 3, 1, 2], 2.0, TimeSlotVector=[1, 1, 1, 2, 2])
        data.FrameIncrementPointer = [Tag("TimeSlotVector"), Tag("SliceVector")]
        pixels = np.frombuffer(data.PixelData, np.int16).copy().reshape(5, 7, 9)
        pixels[3:] += 1
        data.PixelData = pixels.tobytes()
        with pytest.raises(GeometryError, match="TimeSlotVector = 1 and 2"):
            read_volume(save(data, tmp_path / "n.dcm"))


def test_the_gray_levels_are_linear_along_the_normal() -> None:
    """Without this the uneven doses above would prove nothing."""
    places = indices_of((3, 1, 1)) @ np.diag([0.0, 0.0, 1.0])
    assert np.ptp(np.diff(gray_at(places))) == pytest.approx(0)
