"""TIFF files that are damaged, or lie."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import pytest

from test_io_volume_faults import SPACING, STORED
from tomomesh.errors import FormatError, GeometryError
from tomomesh.io import read_volume

if TYPE_CHECKING:
    from pathlib import Path


class TestTiff:
    def write(self, path: Path, **more: Any) -> bytes:
        tifffile = pytest.importorskip("tifffile", reason="the package tifffile is not installed")
        tifffile.imwrite(path, STORED.astype(np.uint16), **{"photometric": "minisblack", "metadata": None, **more})
        return path.read_bytes()

    @pytest.mark.parametrize("more", [{}, {"compression": "zlib"}, {"imagej": True, "metadata": {"axes": "ZYX"}}])
    def test_a_file_that_is_cut_off_is_refused(self, tmp_path: Path, more: dict[str, Any]) -> None:
        raw = self.write(tmp_path / "s.tif", **more)
        for keep in (len(raw) // 8, len(raw) // 3, len(raw) // 2):
            (tmp_path / "c.tif").write_bytes(raw[:keep])
            with pytest.raises(FormatError, match=r"damaged|cut off|tifffile"):
                read_volume(tmp_path / "c.tif", settings=SPACING)

    def test_no_page_is_lost_in_silence(self, tmp_path: Path) -> None:
        raw = self.write(tmp_path / "s.tif")
        for keep in range(len(raw) - 250, len(raw), 7):
            (tmp_path / "c.tif").write_bytes(raw[:keep])
            try:
                voxels = read_volume(tmp_path / "c.tif", settings=SPACING).voxels
            except FormatError:
                continue
            np.testing.assert_array_equal(voxels, STORED)

    @pytest.mark.parametrize("more", [{}, {"bigtiff": True}, {"byteorder": ">"}])
    def test_a_circle_of_pages_is_refused(self, tmp_path: Path, more: dict[str, Any]) -> None:
        tifffile = pytest.importorskip("tifffile", reason="the package tifffile is not installed")
        raw = bytearray(self.write(tmp_path / "s.tif", **more))
        with tifffile.TiffFile(tmp_path / "s.tif") as file:
            layout, pages = file.tiff, [page.offset for page in file.pages]
        for back in range(len(pages)):
            order: Literal["little", "big"] = "little" if layout.byteorder == "<" else "big"
            width = layout.offsetsize
            count = int.from_bytes(raw[pages[-1] : pages[-1] + layout.tagnosize], order)
            end = pages[-1] + layout.tagnosize + count * layout.tagsize
            raw[end : end + width] = pages[back].to_bytes(width, order)
            (tmp_path / "c.tif").write_bytes(bytes(raw))
            with pytest.raises(FormatError, match=f"circle.*pages = {len(pages)}"):
                read_volume(tmp_path / "c.tif", settings=SPACING)

    def test_files_that_ome_names_are_not_opened(self, tmp_path: Path) -> None:
        (tmp_path / "in").mkdir()
        told = {"axes": "ZYX"} | {f"PhysicalSize{axis}": 1.0 for axis in "XYZ"}
        raw = self.write(tmp_path / "secret.ome.tif", photometric=None, metadata=told)
        text = raw[raw.index(b"<?xml") : raw.index(b"</OME>")]
        data = text[text.index(b"<TiffData") : text.index(b"</Pixels>")]
        named = b'<TiffData IFD="0"><UUID FileName="../secret.ome.tif">urn:uuid:0</UUID></TiffData>'
        other = text.replace(data, named) + b"</OME>"
        (tmp_path / "in" / "s.ome.tif").touch()
        self.write(tmp_path / "in" / "s.ome.tif", description=other.decode(), ome=False)
        (tmp_path / "secret.ome.tif").write_bytes(b"never to be read")
        read = read_volume(tmp_path / "in" / "s.ome.tif")
        np.testing.assert_array_equal(read.voxels, STORED)

    def test_entities_are_refused(self, tmp_path: Path) -> None:
        text = '<?xml version="1.0"?><!DOCTYPE a [<!ENTITY b "c">]><OME>&b;</OME>'
        self.write(tmp_path / "s.tif", description=text, ome=False)
        with pytest.raises((FormatError, GeometryError)):
            read_volume(tmp_path / "s.tif")
