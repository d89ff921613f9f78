"""PNG and TIFF slices: natural order, kinds of pixels, and what is refused."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from PIL import Image

from studies import assert_in_place, sampled, shared
from tomomesh.errors import FormatError, GeometryError, ResourceError
from tomomesh.io import read_volume
from tomomesh.io.files import limits
from tomomesh.settings import ReadSettings
from writers import needed

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

SPACING = ReadSettings(spacing=(0.5, 0.7, 2.0))
STORED = sampled(np.diag([0.5, 0.7, 2.0, 1.0]), (12, 7, 9))


def write_stack(folder: Path, stored: NDArray[Any], suffix: str = ".png") -> Path:
    """Write slices whose names only a natural sort puts in order."""
    folder.mkdir()
    for k, pixels in enumerate(stored):
        Image.fromarray(pixels).save(folder / f"slice{k}{suffix}")
    return folder


class TestStack:
    @pytest.mark.parametrize("suffix", [".png", ".tif", ".tiff", ".PNG"])
    def test_every_voxel_is_where_its_gray_level_says(self, tmp_path: Path, suffix: str) -> None:
        volume = read_volume(write_stack(tmp_path / "s", STORED.astype(np.uint16), suffix), settings=SPACING)
        assert_in_place(volume)
        np.testing.assert_array_equal(volume.affine, np.diag([0.5, 0.7, 2, 1]))
        assert volume.voxels.dtype == np.uint16

    @pytest.mark.parametrize(("kind", "suffix"), [("u1", ".png"), ("u2", ".png"), ("i4", ".tif"), ("f4", ".tif")])
    def test_kinds_of_gray_are_kept(self, tmp_path: Path, kind: str, suffix: str) -> None:
        stored = (STORED % 256).astype(kind)
        voxels = read_volume(write_stack(tmp_path / "s", stored, suffix), settings=SPACING).voxels
        np.testing.assert_array_equal(voxels, stored)
        assert voxels.dtype.isnative

    @pytest.mark.parametrize("kind", ["i1", "u1", "i2", "u2", "i4", "u4", "i8", "u8", "f2", "f4", "f8"])
    @pytest.mark.parametrize("order", ["<", ">"])
    def test_tiff_slices_hold_the_numbers_of_a_tiff_stack(self, tmp_path: Path, kind: str, order: str) -> None:
        tifffile = needed("tifffile")
        stored = (STORED % 100).astype(kind)
        stored[0, 0, 0] = -0.5 if kind[0] == "f" else np.iinfo(kind).max if kind[0] == "u" else np.iinfo(kind).min // 2
        (tmp_path / "s").mkdir()
        for k, pixels in enumerate(stored):
            tifffile.imwrite(tmp_path / "s" / f"{k}.tif", pixels, photometric="minisblack", byteorder=order)
        tifffile.imwrite(tmp_path / "s.tif", stored, photometric="minisblack", byteorder=order)
        for path in (tmp_path / "s", tmp_path / "s.tif"):
            np.testing.assert_array_equal(read_volume(path, settings=SPACING).voxels, stored)

    def test_a_tiff_that_pillow_does_not_know_may_have_one_page_alone(self, tmp_path: Path) -> None:
        needed("tifffile").imwrite(tmp_path / "0.tif", STORED.astype(np.float64), photometric="minisblack")
        (tmp_path / "1.tif").write_bytes((tmp_path / "0.tif").read_bytes())
        with pytest.raises(FormatError, match="several pages"):
            read_volume(tmp_path, settings=SPACING)

    def test_color_has_three_channels(self, tmp_path: Path) -> None:
        colors = np.stack([STORED % 251, STORED % 7, STORED % 13, STORED * 0 + 255], axis=-1).astype(np.uint8)
        for name, stored in (("rgb", colors[..., :3].copy()), ("rgba", colors)):
            voxels = read_volume(write_stack(tmp_path / name, stored), settings=SPACING).voxels
            np.testing.assert_array_equal(voxels, colors[..., :3])

    def test_black_and_white_is_gray(self, tmp_path: Path) -> None:
        voxels = read_volume(write_stack(tmp_path / "s", STORED > 2000), settings=SPACING).voxels
        np.testing.assert_array_equal(voxels, (STORED > 2000) * 255)

    def test_nan_becomes_background(self, tmp_path: Path) -> None:
        stored = STORED.astype(np.float32)
        stored[3, 2, 1] = np.nan
        volume = read_volume(write_stack(tmp_path / "s", stored, ".tif"), settings=SPACING)
        assert volume.voxels[3, 2, 1] == STORED.min()


class TestFaults:
    def test_a_spacing_is_needed(self, tmp_path: Path) -> None:
        with pytest.raises(GeometryError, match="--spacing x y z"):
            read_volume(write_stack(tmp_path / "s", STORED.astype(np.uint16)))

    def test_slices_of_another_size_or_kind_are_refused(self, tmp_path: Path) -> None:
        folder = write_stack(tmp_path / "s", STORED.astype(np.uint16))
        Image.fromarray(STORED[0][:-1].astype(np.uint16)).save(folder / "slice3.png")
        with pytest.raises(GeometryError, match=r"slice3\.png \[size = 9 x 6\]"):
            read_volume(folder, settings=SPACING)
        Image.fromarray(STORED[0].astype(np.uint8)).save(folder / "slice3.png")
        with pytest.raises(FormatError, match="another kind"):
            read_volume(folder, settings=SPACING)

    def test_a_broken_slice_is_named(self, tmp_path: Path) -> None:
        folder = write_stack(tmp_path / "s", STORED.astype(np.uint16))
        path = folder / "slice4.png"
        for content in (path.read_bytes()[:-30], b"no image at all", b""):
            path.write_bytes(content)
            with pytest.raises(FormatError, match=r"slice4\.png"):
                read_volume(folder, settings=SPACING)

    def test_two_kinds_of_files_are_refused(self, tmp_path: Path) -> None:
        folder = write_stack(tmp_path / "s", STORED.astype(np.uint16))
        Image.fromarray(STORED[0].astype(np.uint16)).save(folder / "x.tif")
        with pytest.raises(FormatError, match="PNG and TIFF"):
            read_volume(folder, settings=SPACING)

    def test_several_pages_are_refused(self, tmp_path: Path) -> None:
        pages = [Image.fromarray(pixels.astype(np.uint16)) for pixels in STORED]
        (tmp_path / "s").mkdir()
        pages[0].save(tmp_path / "s" / "x.tif", save_all=True, append_images=pages[1:])
        with pytest.raises(FormatError, match="several pages"):
            read_volume(tmp_path / "s", settings=SPACING)

    def test_one_file_asks_for_its_folder(self, tmp_path: Path) -> None:
        folder = write_stack(tmp_path / "s", STORED.astype(np.uint16))
        with pytest.raises(FormatError, match="folder of the slices"):
            read_volume(folder / "slice0.png", settings=SPACING)

    def test_a_stack_beyond_the_memory_is_refused(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        folder = write_stack(tmp_path / "s", STORED.astype(np.uint16))
        for held in (100, 1000):
            monkeypatch.setattr(limits, "physical_memory", lambda held=held: held)
            with pytest.raises(ResourceError):
                read_volume(folder, settings=SPACING)

    def test_a_bomb_is_refused(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        folder = write_stack(tmp_path / "s", STORED.astype(np.uint16))
        monkeypatch.setattr(Image, "MAX_IMAGE_PIXELS", 10)
        with pytest.raises(ResourceError):
            read_volume(folder, settings=SPACING)


class TestSharedData:
    @pytest.mark.parametrize("kind", ["png", "tif"])
    def test_the_stacks_hold_the_voxels_of_the_nifti_file(self, kind: str) -> None:
        folder = shared("derived/dev54_t1")
        study = read_volume(folder / "dev54_t1.nii.gz")
        stack = read_volume(folder / kind, settings=ReadSettings(spacing=study.spacing_mm))
        stored = study.grid.restore(study.voxels)
        np.testing.assert_allclose(stack.spacing_mm, study.spacing_mm)
        assert any(
            np.array_equal(stack.voxels, turned)
            for turned in (stored, stored[:, ::-1], stored[:, :, ::-1], stored[:, ::-1, ::-1])
        )

    def test_a_broken_slice_is_refused(self, tmp_path: Path) -> None:
        (tmp_path / "a.png").write_bytes((shared("malformed") / "truncated.png").read_bytes())
        with pytest.raises(FormatError, match=r"a\.png"):
            read_volume(tmp_path, settings=SPACING)


def test_jpeg_slices(tmp_path: Path) -> None:
    stored = np.tile(np.arange(5, dtype=np.uint8)[:, None, None] * 50, (1, 16, 24))
    for suffix in (".jpg", ".jpeg"):
        (tmp_path / suffix).mkdir()
        for k, pixels in enumerate(stored):
            Image.fromarray(pixels).save(tmp_path / suffix / f"s{k + 8}{suffix}", format="JPEG", quality=95)
        volume = read_volume(tmp_path / suffix, settings=SPACING)
        assert np.abs(volume.voxels.astype(int) - stored).max() <= 1
        assert "JPEG slices" in volume.notes[0]
