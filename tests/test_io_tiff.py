"""Multi-page TIFF by tifffile and Pillow: kinds of files, and where the spacing comes from."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from PIL import Image

from studies import assert_in_place, sampled
from tomomesh.errors import FormatError, GeometryError
from tomomesh.io import read_volume
from tomomesh.settings import ReadSettings
from writers import needed

if TYPE_CHECKING:
    from pathlib import Path


SPACING = ReadSettings(spacing=(0.5, 0.7, 2.0))


class TestTiff:
    STORED = sampled(np.diag([0.5, 0.7, 2.0, 1.0])).astype(np.uint16)

    @pytest.mark.parametrize("compression", [None, "zlib", "lzw"])
    @pytest.mark.parametrize("order", ["<", ">"])
    @pytest.mark.parametrize("big", [False, True])
    def test_pages_with_a_spacing(self, tmp_path: Path, compression: str | None, order: str, big: bool) -> None:
        tifffile = needed("tifffile")
        if compression == "lzw":
            needed("imagecodecs")
        tifffile.imwrite(
            tmp_path / "s.tif", self.STORED, byteorder=order, bigtiff=big, compression=compression,
            photometric="minisblack", metadata=None,
        )  # fmt: skip
        volume = read_volume(tmp_path / "s.tif", settings=SPACING)
        assert_in_place(volume)
        assert volume.voxels.dtype == np.uint16
        assert volume.voxels.dtype.isnative

    def test_pages_of_pillow(self, tmp_path: Path) -> None:
        needed("tifffile")
        pages = [Image.fromarray(pixels) for pixels in self.STORED]
        pages[0].save(tmp_path / "s.tiff", save_all=True, append_images=pages[1:])
        assert_in_place(read_volume(tmp_path / "s.tiff", settings=SPACING))

    @pytest.mark.parametrize(("unit", "per_mm"), [("µm", 1000), ("mm", 1), ("nm", 1e6), ("cm", 0.1)])
    def test_ome_holds_its_spacing(self, tmp_path: Path, unit: str, per_mm: float) -> None:
        tifffile = needed("tifffile")
        told: dict[str, Any] = {"axes": "ZYX"}
        for axis, size in zip("XYZ", (0.5, 0.7, 2.0), strict=True):
            told |= {f"PhysicalSize{axis}": size * per_mm, f"PhysicalSize{axis}Unit": unit}
        tifffile.imwrite(tmp_path / "s.ome.tif", self.STORED, metadata=told)
        volume = read_volume(tmp_path / "s.ome.tif")
        assert_in_place(volume)
        assert "no directions" in volume.notes[0]

    def test_imagej_holds_its_spacing(self, tmp_path: Path) -> None:
        tifffile = needed("tifffile")
        tifffile.imwrite(
            tmp_path / "s.tif", self.STORED, imagej=True, resolution=(1 / 0.5, 1 / 0.7),
            metadata={"spacing": 2.0, "unit": "mm", "axes": "ZYX"},
        )  # fmt: skip
        assert_in_place(read_volume(tmp_path / "s.tif"), 0.6)

    def test_a_spacing_is_asked_for(self, tmp_path: Path) -> None:
        needed("tifffile").imwrite(tmp_path / "s.tif", self.STORED, photometric="minisblack", metadata=None)
        with pytest.raises(GeometryError, match="--spacing x y z"):
            read_volume(tmp_path / "s.tif")

    def test_color_has_three_channels(self, tmp_path: Path) -> None:
        colors = np.stack([self.STORED % n for n in (251, 7, 13)], axis=-1).astype(np.uint8)
        needed("tifffile").imwrite(tmp_path / "s.tif", colors, photometric="rgb", metadata=None)
        np.testing.assert_array_equal(read_volume(tmp_path / "s.tif", settings=SPACING).voxels, colors)

    def test_one_page_asks_for_the_folder_and_frames_are_refused(self, tmp_path: Path) -> None:
        tifffile = needed("tifffile")
        tifffile.imwrite(tmp_path / "one.tif", self.STORED[0])
        with pytest.raises(FormatError, match="folder of the slices"):
            read_volume(tmp_path / "one.tif", settings=SPACING)
        tifffile.imwrite(tmp_path / "t.ome.tif", np.stack([self.STORED] * 2), metadata={"axes": "TZYX"})
        with pytest.raises(FormatError, match="several frames"):
            read_volume(tmp_path / "t.ome.tif", settings=SPACING)
        with tifffile.TiffWriter(tmp_path / "two.tif") as pages:
            pages.write(self.STORED[0], metadata=None)
            pages.write(self.STORED[0, :3], metadata=None)
        with pytest.raises(FormatError, match="several images"):
            read_volume(tmp_path / "two.tif", settings=SPACING)

    def test_a_missing_package_is_named(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        Image.fromarray(self.STORED[0]).save(tmp_path / "s.tif")
        monkeypatch.setitem(__import__("sys").modules, "tifffile", None)
        with pytest.raises(FormatError, match=r"tomomesh\[tiff\]"):
            read_volume(tmp_path / "s.tif", settings=SPACING)
