"""MetaImage: byte orders, text, data files, and what the header leaves out."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from studies import AFFINES, SHEARED, assert_in_place, sampled
from tomomesh.errors import GeometryError
from tomomesh.io import read_volume
from tomomesh.settings import ReadSettings
from writers import assert_agrees, needed

if TYPE_CHECKING:
    from pathlib import Path


SPACING = ReadSettings(spacing=(0.5, 0.7, 2.0))


class TestMetaImage:
    def test_sheared_axes_stay_sheared(self, tmp_path: Path) -> None:
        spacing = np.linalg.norm(SHEARED[:3, :3], axis=0)
        fields = {
            b"TransformMatrix = 1 0 0 0 1 0 0 0 1": (SHEARED[:3, :3] / spacing).T.ravel(),
            b"ElementSpacing = 0.5 0.7 2": spacing,
        }
        raw = self.header()
        for old, values in fields.items():
            words = " ".join(repr(value) for value in values.tolist())
            raw = raw.replace(old, old.partition(b" = ")[0] + f" = {words}".encode())
        (tmp_path / "s.mha").write_bytes(raw + sampled(SHEARED).tobytes())
        volume = read_volume(tmp_path / "s.mha")
        assert_in_place(volume)
        np.testing.assert_allclose(volume.grid.affine, SHEARED, atol=1e-9)

    def header(self, extra: str = "", data: str = "LOCAL") -> bytes:
        return (
            "ObjectType = Image\nNDims = 3\nDimSize = 9 7 5\nElementType = MET_SHORT\n"
            f"ElementSpacing = 0.5 0.7 2\nOffset = -3 11 40\nTransformMatrix = 1 0 0 0 1 0 0 0 1\n{extra}"
            f"ElementDataFile = {data}\n"
        ).encode()

    def test_big_endian_text_and_bytes_at_the_end(self, tmp_path: Path) -> None:
        stored = sampled(AFFINES["axial"])
        little, big = (stored.astype(f"{order}i2").tobytes() for order in "<>")
        (tmp_path / "big.mha").write_bytes(self.header("BinaryDataByteOrderMSB = True\n") + big)
        (tmp_path / "text.mha").write_bytes(
            self.header("BinaryData = False\n") + " ".join(map(str, stored.ravel())).encode()
        )
        (tmp_path / "x.raw").write_bytes(b"something before" + little)
        (tmp_path / "end.mhd").write_bytes(self.header("HeaderSize = -1\n", "x.raw"))
        (tmp_path / "start.mhd").write_bytes(self.header("HeaderSize = 16\n", "x.raw"))
        for name in ("big.mha", "text.mha", "end.mhd", "start.mhd"):
            assert_in_place(read_volume(tmp_path / name))

    @pytest.mark.parametrize(("unit", "mm"), [("um", 1e-3), ("mm", 1.0), ("cm", 10.0), ("?", 1.0)])
    def test_a_unit_is_brought_to_millimeters(self, tmp_path: Path, unit: str, mm: float) -> None:
        text = self.header(f"DistanceUnits = {unit}\n")
        (tmp_path / "s.mha").write_bytes(text + sampled(AFFINES["axial"]).tobytes())
        volume = read_volume(tmp_path / "s.mha")
        np.testing.assert_allclose(volume.affine[:3], AFFINES["axial"][:3] * mm)
        assert (f"coordinates were brought to millimeters: x {mm:g}" in volume.notes) == (mm != 1)

    def test_another_unit_is_refused(self, tmp_path: Path) -> None:
        (tmp_path / "s.mha").write_bytes(self.header("DistanceUnits = s\n") + sampled(AFFINES["axial"]).tobytes())
        with pytest.raises(GeometryError, match="DistanceUnits = s"):
            read_volume(tmp_path / "s.mha")

    def test_lists_and_patterns_of_data_files(self, tmp_path: Path) -> None:
        stored = sampled(AFFINES["axial"])
        for k, pixels in enumerate(stored):
            (tmp_path / f"s{k}.raw").write_bytes(pixels.tobytes())
        names = "\n".join(f"s{k}.raw" for k in range(5))
        (tmp_path / "list.mhd").write_bytes(self.header(data="LIST") + f"{names}\n".encode())
        (tmp_path / "pattern.mhd").write_bytes(self.header(data="s%d.raw 0 4 1"))
        for name in ("list", "pattern"):
            volume = read_volume(tmp_path / f"{name}.mhd")
            assert_in_place(volume)
            assert_agrees(volume, needed("SimpleITK").ReadImage(str(tmp_path / f"{name}.mhd")))

    def test_without_a_spacing_one_is_asked_for(self, tmp_path: Path) -> None:
        raw = self.header().replace(b"ElementSpacing = 0.5 0.7 2\n", b"") + sampled(AFFINES["axial"]).tobytes()
        (tmp_path / "s.mha").write_bytes(raw)
        with pytest.raises(GeometryError, match="--spacing x y z"):
            read_volume(tmp_path / "s.mha")
        assert read_volume(tmp_path / "s.mha", settings=SPACING).spacing_mm == SPACING.spacing
