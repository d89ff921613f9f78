"""What gray levels are in, and which of them are padding, as DICOM says."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from pydicom.dataset import Dataset
from pydicom.sequence import Sequence

from studies import AFFINES, as_ct, enhanced, sampled, save, set_pixels, slice_dataset, write_series
from tomomesh.cli import main
from tomomesh.cli.inspect.inspection import inspected
from tomomesh.errors import UsageError
from tomomesh.io import read_volume
from tomomesh.segmentation.window import choose_window
from tomomesh.settings import Settings, WindowSettings
from writers import needed

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from numpy.typing import NDArray

AXIAL = AFFINES["axial"]
STORED = sampled(AXIAL)
CAPTURE = "1.2.840.10008.5.1.4.1.1.7"
AIR = np.where(np.median(STORED) < STORED, 40, -1000).astype(np.int16)


def ct(**fields: Any) -> Callable[[Dataset, int], None]:
    """Return an edit that makes a slice one of a CT with some fields; a tuple holds one value a slice."""

    def edit(data: Dataset, k: int) -> None:
        as_ct(data, k)
        data.RescaleSlope, data.RescaleIntercept = 1, 0
        for keyword, value in fields.items():
            setattr(data, keyword, value[k] if isinstance(value, tuple) else value)

    return edit


class TestUnit:
    @pytest.mark.parametrize("said", ["HU", "", "hu ", None])
    def test_a_ct_is_in_hounsfield_units_where_it_says_so_or_nothing(self, tmp_path: Path, said: str | None) -> None:
        edit = ct() if said is None else ct(RescaleType=said)
        assert read_volume(write_series(tmp_path / "s", AIR, AXIAL, edit)).unit == "HU"

    @pytest.mark.parametrize(("said", "known"), [("US", True), ("MGML", False)])
    def test_a_ct_by_gdcm_may_say_so_for_want_of_another_word(self, tmp_path: Path, said: str, known: bool) -> None:
        def edit(data: Dataset, k: int) -> None:
            ct(RescaleType=said)(data, k)
            data.file_meta.ImplementationVersionName = "GDCM 3.2.5"

        volume = read_volume(write_series(tmp_path / "s", AIR, AXIAL, edit))
        assert volume.unit != "HU"
        assert any("GDCM" in note for note in volume.notes) == known

    def test_a_ct_by_simpleitk_is_one_of_them(self, tmp_path: Path) -> None:
        sitk = needed("SimpleITK")
        (tmp_path / "s").mkdir()
        writer = sitk.ImageFileWriter()
        writer.KeepOriginalImageUIDOn()
        for k, plane in enumerate(AIR):
            image = sitk.GetImageFromArray(plane[None])
            told = {"0008|0060": "CT", "0028|1052": "0", "0028|1053": "1", "0020|0032": f"0\\0\\{2 * k}"}
            for key, value in {**told, "0020|000e": "1.2.3.4", "0020|0013": str(k)}.items():
                image.SetMetaData(key, value)
            writer.SetFileName(str(tmp_path / "s" / f"{k}.dcm"))
            writer.Execute(image)
        assert any("GDCM" in note for note in read_volume(tmp_path / "s").notes)

    @pytest.mark.parametrize("said", ["US", "MGML", "OD", "Z_EFF", "HU_MOD", "ED", "EDW", "PCT", "OTHER"])
    def test_a_ct_of_another_scale_is_not(self, tmp_path: Path, said: str, capsys: pytest.CaptureFixture[str]) -> None:
        folder = write_series(tmp_path / "s", AIR, AXIAL, ct(RescaleType=said))
        volume = read_volume(folder)
        assert volume.unit not in ("HU", "stored")
        assert f"RescaleType = {said}: the gray levels are not Hounsfield units" in volume.notes
        with pytest.raises(UsageError, match="not in Hounsfield units"):
            choose_window(volume, WindowSettings(preset="bone"))
        found = inspected(str(folder), Settings())
        assert not any("bone" in window or "skin" in window for window in found["windows"])
        assert found["gray_unit"] == volume.unit
        assert "--preset" not in found["next"]
        assert main(["reconstruct", str(folder), "--preset", "bone", "-o", str(tmp_path / "m.stl")]) == 2
        assert volume.unit in capsys.readouterr().err

    def test_one_slice_of_another_scale_is_enough(self, tmp_path: Path) -> None:
        folder = write_series(tmp_path / "s", AIR, AXIAL, ct(RescaleType=("HU", "HU", "MGML", "HU", "HU")))
        assert read_volume(folder).unit == "mg/ml"

    def test_frames_of_an_enhanced_file_have_their_own_scale(self, tmp_path: Path) -> None:
        data = enhanced(AIR, AXIAL, [0, 1, 2, 3, 4])
        data.Modality = "CT"
        for groups in data.PerFrameFunctionalGroupsSequence:
            groups.PixelValueTransformationSequence[0].RescaleType = "MGML"
        assert read_volume(save(data, tmp_path / "e.dcm")).unit == "mg/ml"

    @pytest.mark.parametrize(("said", "unit"), [("HU", "HU"), ("OD", "thousandths of optical density")])
    def test_a_table_says_what_it_gives(self, tmp_path: Path, said: str, unit: str) -> None:
        def edit(data: Dataset, k: int) -> None:
            as_ct(data, k)
            item = Dataset()
            item.ModalityLUTType = said
            item.add_new("LUTDescriptor", "US", [4, 0, 16])
            item.add_new("LUTData", "US", [0, 1, 2, 3])
            data.ModalityLUTSequence = Sequence([item])

        assert read_volume(write_series(tmp_path / "s", STORED % 4, AXIAL, edit)).unit == unit

    def test_pictures_of_a_ct_are_not(self, tmp_path: Path) -> None:
        def capture(data: Dataset, k: int) -> None:
            as_ct(data, k)
            data.SOPClassUID = data.file_meta.MediaStorageSOPClassUID = CAPTURE

        assert read_volume(write_series(tmp_path / "gray", STORED, AXIAL, capture)).unit == "stored"
        color = np.repeat((STORED % 256).astype(np.uint8)[..., None], 3, axis=3)
        assert read_volume(write_series(tmp_path / "color", color, AXIAL, as_ct)).unit == "stored"


class TestPadding:
    def padded(self, folder: Path, stored: NDArray[Any], edit: Callable[[Dataset, int], None]) -> NDArray[np.bool_]:
        """Return which voxels of a series, one of whose corners is padding, are taken for such."""
        volume = read_volume(write_series(folder, stored, AXIAL, edit))
        assert volume.padding is not None
        low, high = volume.padding
        return np.asarray((volume.voxels >= low) & (volume.voxels <= high))

    @pytest.mark.parametrize("modality", ["CT", "MR"])
    @pytest.mark.parametrize("photometric", ["MONOCHROME1", "MONOCHROME2"])
    @pytest.mark.parametrize("kind", [np.int16, np.uint16])
    def test_it_is_found_however_levels_are_turned(
        self, tmp_path: Path, modality: str, photometric: str, kind: type
    ) -> None:
        corner = np.zeros(STORED.shape, bool)
        corner[:, :2, :3] = True
        stored: NDArray[Any] = np.where(corner, 7, STORED).astype(kind)

        def edit(data: Dataset, k: int) -> None:
            data.Modality, data.PhotometricInterpretation = modality, photometric
            data.add_new("PixelPaddingValue", "SS" if kind is np.int16 else "US", 7)

        np.testing.assert_array_equal(self.padded(tmp_path / "s", stored, edit), corner)

    def test_a_scale_that_rounds_hides_none(self, tmp_path: Path) -> None:
        corner = np.zeros(STORED.shape, bool)
        corner[:, :2, :3] = True
        edit = ct(RescaleSlope=0.1, RescaleIntercept=-0.7, PixelPaddingValue=-2003)
        np.testing.assert_array_equal(self.padded(tmp_path / "s", np.where(corner, -2003, STORED), edit), corner)

    def test_slices_may_have_each_its_own(self, tmp_path: Path) -> None:
        values = (-2000, -1999, -1900, -2000, -1500)
        corner = np.zeros(STORED.shape, bool)
        corner[:, :2, :3] = True
        stored = np.where(corner, np.array(values)[:, None, None], STORED).astype(np.int16)
        np.testing.assert_array_equal(self.padded(tmp_path / "s", stored, ct(PixelPaddingValue=values)), corner)

    def test_some_slices_may_have_none(self, tmp_path: Path) -> None:
        corner = np.zeros(STORED.shape, bool)
        corner[1:3, :2, :3] = True

        def edit(data: Dataset, k: int) -> None:
            if k in (1, 2):
                data.add_new("PixelPaddingValue", "SS", -2000)

        np.testing.assert_array_equal(
            self.padded(tmp_path / "s", np.where(corner, -2000, STORED).astype(np.int16), edit), corner
        )

    def test_numbers_of_floating_point_have_a_field_of_their_own(self, tmp_path: Path) -> None:
        data = slice_dataset(STORED[0], AXIAL, 0)
        levels = STORED.astype(np.float32) + np.float32(0.5)
        levels[:, :2, :3] = -1e6
        set_pixels(data, STORED)
        for keyword in ("PixelData", "BitsStored", "HighBit", "PixelRepresentation"):
            delattr(data, keyword)
        data.BitsAllocated, data.NumberOfFrames, data.SpacingBetweenSlices = 32, 5, 2.0
        data.FloatPixelPaddingValue, data.FloatPixelData = -1e6, levels.tobytes()
        volume = read_volume(save(data, tmp_path / "f.dcm"))
        assert volume.padding == (-1e6, -1e6)
        assert volume.voxels.min() == -1e6

    @pytest.mark.parametrize("window", [(), ("--lower", "20"), ("--preset", "skin")])
    def test_it_counts_on_every_path(self, tmp_path: Path, window: tuple[str, ...]) -> None:
        """Padding above all tissue is in no window, and moves no threshold."""
        k, j, i = np.indices((20, 24, 24))
        ball = (i - 12) ** 2 + (j - 12) ** 2 + (k - 10) ** 2 <= 49
        rng = np.random.default_rng(0)
        levels = np.where(ball, 60, -1000) + rng.integers(-20, 20, ball.shape)
        levels[:, :2] = 3000
        edit = ct(PixelPaddingValue=2990, PixelPaddingRangeLimit=3000)
        folder = write_series(tmp_path / "s", levels.astype(np.int16), AXIAL, edit)
        mask = tmp_path / "mask.nii.gz"
        command = ["reconstruct", str(folder), *window, "--way", "voxels", "--quiet", "--labels", str(mask)]
        assert main([*command, "-o", str(tmp_path / "m.stl")]) == 0
        assert np.count_nonzero(read_volume(mask).voxels) == np.count_nonzero(ball)
        found = inspected(str(folder), Settings())
        assert found["histogram_to"] < 100
        assert any("padding, 3000" in remark for remark in found["remarks"])
