"""Multi-page TIFF by tifffile and Pillow: kinds of files, and where the spacing comes from."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from PIL import Image

from studies import assert_in_place, sampled
from tomomesh.errors import FormatError, GeometryError
from tomomesh.io import read_volume
from tomomesh.model.units import millimeters
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


class TestWhiteIsZero:
    """Low numbers that are bright: one rule for stacks and folders, whatever the bits."""

    LEVELS = (np.arange(4 * 9 * 13) % 200).reshape(4, 9, 13)

    @pytest.mark.parametrize(("kind", "black"), [("u1", 255), ("u2", 65535), ("f4", None)])
    def test_a_stack_and_a_folder_are_read_alike(self, tmp_path: Path, kind: str, black: int | None) -> None:
        tifffile = needed("tifffile")
        stored = self.LEVELS.astype(kind)
        tifffile.imwrite(tmp_path / "s.tif", stored, photometric="miniswhite", metadata=None)
        (tmp_path / "f").mkdir()
        for k, pixels in enumerate(stored):
            tifffile.imwrite(tmp_path / "f" / f"s{k}.tif", pixels, photometric="miniswhite", metadata=None)
        expected = stored if black is None else black - stored
        for path in (tmp_path / "s.tif", tmp_path / "f"):
            volume = read_volume(path, settings=SPACING)
            np.testing.assert_array_equal(volume.voxels, expected)
            assert sum("WhiteIsZero" in note for note in volume.notes) == 1

    def test_other_pages_are_not_turned_over(self, tmp_path: Path) -> None:
        needed("tifffile").imwrite(tmp_path / "s.tif", self.LEVELS.astype("u1"), photometric="minisblack")
        volume = read_volume(tmp_path / "s.tif", settings=SPACING)
        np.testing.assert_array_equal(volume.voxels, self.LEVELS)
        assert not any("WhiteIsZero" in note for note in volume.notes)


class TestBits:
    MASK = np.linalg.norm(np.indices((6, 9, 13)) - np.array([3, 4, 6]).reshape(3, 1, 1, 1), axis=0) < 3

    @pytest.mark.parametrize("rows", [None, 2])
    @pytest.mark.parametrize("photometric", ["minisblack", "miniswhite", None])
    @pytest.mark.parametrize("compression", [None, "zlib"])
    def test_a_stack_of_bits_is_a_mask(
        self, tmp_path: Path, photometric: str | None, rows: int | None, compression: str | None
    ) -> None:
        told = {"photometric": photometric, "rowsperstrip": rows, "compression": compression}
        needed("tifffile").imwrite(tmp_path / "s.tif", self.MASK, **told)
        volume = read_volume(tmp_path / "s.tif", settings=SPACING)
        np.testing.assert_array_equal(volume.voxels, self.MASK)
        assert volume.voxels.dtype == np.uint8

    @pytest.mark.parametrize("photometric", ["minisblack", "miniswhite"])
    def test_a_folder_of_bits_is_the_same_mask(self, tmp_path: Path, photometric: str) -> None:
        for k, pixels in enumerate(self.MASK):
            needed("tifffile").imwrite(tmp_path / f"s{k}.tif", pixels, photometric=photometric)
        volume = read_volume(tmp_path, settings=SPACING)
        np.testing.assert_array_equal(volume.voxels, self.MASK)
        assert volume.voxels.dtype == np.uint8
        assert "pixels of one bit: a mask of 0 and 1" in volume.notes

    @pytest.mark.parametrize("compression", [None, "group4", "packbits"])
    def test_a_folder_by_pillow_too(self, tmp_path: Path, compression: str | None) -> None:
        for k, pixels in enumerate(self.MASK):
            Image.fromarray(pixels).save(tmp_path / f"s{k}.tif", compression=compression)
        np.testing.assert_array_equal(read_volume(tmp_path, settings=SPACING).voxels, self.MASK)

    def test_a_folder_of_bits_and_bytes_is_refused(self, tmp_path: Path) -> None:
        for k, pixels in enumerate(self.MASK):
            Image.fromarray(pixels if k else pixels.astype(np.uint8)).save(tmp_path / f"s{k}.tif")
        with pytest.raises(FormatError, match=r"another kind.*pixels = bool.*uint8"):
            read_volume(tmp_path, settings=SPACING)

    @pytest.mark.parametrize("compression", [None, "group4"])
    def test_pages_of_pillow_too(self, tmp_path: Path, compression: str | None) -> None:
        needed("tifffile")
        needed("imagecodecs")
        pages = [Image.fromarray(pixels) for pixels in self.MASK]
        pages[0].save(tmp_path / "s.tif", save_all=True, append_images=pages[1:], compression=compression)
        np.testing.assert_array_equal(read_volume(tmp_path / "s.tif", settings=SPACING).voxels, self.MASK)

    def test_one_that_is_cut_off_is_refused(self, tmp_path: Path) -> None:
        needed("tifffile").imwrite(tmp_path / "s.tif", np.zeros((6, 64, 64), bool), photometric="minisblack")
        whole = (tmp_path / "s.tif").read_bytes()
        (tmp_path / "s.tif").write_bytes(whole[:-100])
        with pytest.raises(FormatError):
            read_volume(tmp_path / "s.tif", settings=SPACING)


@pytest.mark.parametrize("told", [{"metadata": None}, {"metadata": {"axes": "ZSYX"}, "ome": True}])
def test_planar_colors_are_colors(tmp_path: Path, told: Any) -> None:
    colors = np.stack([TestTiff.STORED % n for n in (251, 7, 13)], axis=1).astype(np.uint8)
    needed("tifffile").imwrite(tmp_path / "s.tif", colors, photometric="rgb", planarconfig="separate", **told)
    volume = read_volume(tmp_path / "s.tif", settings=SPACING)
    np.testing.assert_array_equal(volume.voxels, np.moveaxis(colors, 1, -1))


class TestPages:
    """As tifffile's users write them: one by one, with previews, and with axes of one."""

    def pages(self, folder: Path, stored: Any, **told: Any) -> Path:
        with needed("tifffile").TiffWriter(folder / "s.tif", **told) as file:
            for pixels in stored:
                file.write(pixels, photometric="minisblack")
        return folder / "s.tif"

    def test_that_were_written_one_by_one(self, tmp_path: Path) -> None:
        assert_in_place(read_volume(self.pages(tmp_path, TestTiff.STORED), settings=SPACING))

    def test_of_several_sizes_or_kinds_or_stacks_are_refused(self, tmp_path: Path) -> None:
        one = TestTiff.STORED
        for stored in ([*one, one[0][:-1]], [*one, one[0].astype(np.int32)], [one, one]):
            with pytest.raises(FormatError, match="several images"):
                read_volume(self.pages(tmp_path, stored), settings=SPACING)

    def test_of_several_scenes_are_refused(self, tmp_path: Path) -> None:
        with pytest.raises(FormatError, match="several images"):
            read_volume(self.pages(tmp_path, TestTiff.STORED, ome=True), settings=SPACING)

    def test_beside_a_preview(self, tmp_path: Path) -> None:
        with needed("tifffile").TiffWriter(tmp_path / "s.tif") as file:
            file.write(TestTiff.STORED, photometric="minisblack")
            file.write(np.zeros((3, 3), np.uint8), photometric="minisblack", subfiletype=1)
        assert_in_place(read_volume(tmp_path / "s.tif", settings=SPACING))

    @pytest.mark.parametrize("shape", [(1, 1, -1), (-1, 1), (1, -1)])
    def test_with_axes_of_one(self, tmp_path: Path, shape: tuple[int, ...]) -> None:
        stored = TestTiff.STORED.reshape(*shape, *TestTiff.STORED.shape[1:])
        needed("tifffile").imwrite(tmp_path / "s.tif", stored, photometric="minisblack")
        assert_in_place(read_volume(tmp_path / "s.tif", settings=SPACING))

    def test_in_two_axes_are_refused(self, tmp_path: Path) -> None:
        needed("tifffile").imwrite(tmp_path / "s.tif", np.stack([TestTiff.STORED] * 2), photometric="minisblack")
        with pytest.raises(FormatError, match="several frames"):
            read_volume(tmp_path / "s.tif", settings=SPACING)

    def test_of_channels_are_told(self, tmp_path: Path) -> None:
        needed("tifffile").imwrite(
            tmp_path / "s.tif", np.stack([TestTiff.STORED] * 2, 1), imagej=True, metadata={"axes": "ZCYX"}
        )
        with pytest.raises(FormatError, match="several channels"):
            read_volume(tmp_path / "s.tif", settings=SPACING)


class TestUnits:
    """Of each axis, as ImageJ and OME spell them."""

    def imagej(self, folder: Path, resolution: tuple[float, float], **told: Any) -> Path:
        needed("tifffile").imwrite(
            folder / "s.tif", TestTiff.STORED, imagej=True, resolution=resolution, metadata={"axes": "ZYX", **told}
        )
        return folder / "s.tif"

    @pytest.mark.parametrize(
        ("resolution", "told"),
        [
            ((1 / 20, 1 / 20), {"unit": "micron", "spacing": 20}),
            ((1 / 20, 1 / 20), {"unit": r"\u00B5m", "spacing": 20}),
            ((1 / 20, 1 / 20), {"unit": "um", "spacing": -20}),
            ((50, 50), {"unit": "mm", "zunit": "micron", "spacing": 20}),
            ((1 / 20, 1 / 20), {"unit": "micron", "zunit": "mm", "spacing": 0.02}),
            ((1 / 20, 1 / 20), {"unit": "micron", "zunit": "nm", "spacing": 20000}),
            ((1 / 20, 1 / 20000), {"unit": "micron", "yunit": "nm", "spacing": 20}),
            ((1270, 1270), {"unit": "in", "spacing": 0.02 / 25.4}),
            ((1270, 1270), {"unit": "inch", "zunit": "cm", "spacing": 0.002}),
        ],
    )
    def test_imagej_names_one_for_each_axis(
        self, tmp_path: Path, resolution: tuple[float, float], told: dict[str, Any]
    ) -> None:
        volume = read_volume(self.imagej(tmp_path, resolution, **told))
        np.testing.assert_allclose(volume.spacing_mm, (0.02,) * 3, rtol=1e-6)

    def test_imagej_leaves_out_a_distance_of_one(self, tmp_path: Path) -> None:
        assert read_volume(self.imagej(tmp_path, (2.0, 2.0), unit="mm")).spacing_mm == (0.5, 0.5, 1.0)

    def test_an_axis_of_another_kind_is_named(self, tmp_path: Path) -> None:
        path = self.imagej(tmp_path, (1.0, 1.0), unit="micron", zunit="pixel", spacing=1)
        with pytest.raises(GeometryError, match=r"micron, micron, pixel.*--spacing x y z"):
            read_volume(path)
        assert read_volume(path, settings=SPACING).spacing_mm == SPACING.spacing

    @pytest.mark.parametrize(
        ("unit", "mm"),
        [("Å", 1e-7), ("\u212b", 1e-7), ("in", 25.4), ("thou", 0.0254), ("ft", 304.8), ("μm", 1e-3), ("pm", 1e-9)],
    )
    def test_ome_has_many(self, tmp_path: Path, unit: str, mm: float) -> None:
        told: dict[str, Any] = {"axes": "ZYX"}
        for axis, size in zip("XYZ", (0.5, 0.7, 2.0), strict=True):
            told |= {f"PhysicalSize{axis}": size / mm, f"PhysicalSize{axis}Unit": unit}
        needed("tifffile").imwrite(tmp_path / "s.ome.tif", TestTiff.STORED, metadata=told)
        np.testing.assert_allclose(read_volume(tmp_path / "s.ome.tif").spacing_mm, (0.5, 0.7, 2.0))


@pytest.mark.parametrize(
    ("unit", "expected"),
    [
        *[(unit, 1e-3) for unit in ("µm", "μm", "um", "micron", "Microns", "micrometre", r"\u00b5m", r"\u00B5m\0")],
        *[(unit, 1e-3) for unit in ("UM", "Um", "µM", "MICRON", r"\u00B5", "Âµm", "[µm]")],
        *[(unit, 1.0) for unit in ("mm", "Millimeters", "millimetre", " mm ", "MM", "mm.", "(mm)", "mm^")],
        *[(unit, 25.4) for unit in ("in", "inch", "Inches", '"', "IN", "in.")],
        *[(unit, 1e-7) for unit in ("A", "Å", "Angstroms")],
        *[(unit, 10.0) for unit in ("cm", "CM", "Cm")],
        *[(unit, None) for unit in ("Mm", "Pm", "ms", "pixel", "", "sec", "a", "mm^3", "reference frame")],
    ],
)
def test_units_as_writers_spell_them(unit: str, expected: float | None) -> None:
    assert millimeters(unit.replace(r"\0", "\0")) == expected
