"""OME-Zarr and plain Zarr: places, levels, axes, and kinds of voxels."""

from __future__ import annotations

import shutil
import zipfile
from typing import TYPE_CHECKING

import numpy as np
import pytest

from stores import AFFINE, FORMATS, OFFSET, SCALE, STORED, chunk, directed, multiscales, write
from studies import assert_in_place
from tomomesh.errors import FormatError, GeometryError, UsageError
from tomomesh.io import read_volume
from tomomesh.io.studies.folder import find_studies
from tomomesh.settings import ReadSettings

if TYPE_CHECKING:
    from pathlib import Path


zarr = pytest.importorskip("zarr", reason="the package zarr is not installed")


class TestPlaces:
    @FORMATS
    @pytest.mark.parametrize(("unit", "per_mm"), [("millimeter", 1.0), ("micrometer", 1e3), ("nanometer", 1e6)])
    def test_every_voxel_is_where_its_gray_level_says(
        self, tmp_path: Path, zarr_format: int, unit: str, per_mm: float
    ) -> None:
        images = multiscales(unit=unit, per_mm=per_mm)
        volume = read_volume(write(tmp_path / "s.zarr", STORED, images, zarr_format))
        assert_in_place(volume)
        np.testing.assert_allclose(volume.affine, AFFINE, atol=1e-9)
        assert "no directions" in volume.notes[0]
        assert len(volume.notes) == 1 + (per_mm != 1)

    @pytest.mark.parametrize("names", ["zyx", "xyz", "yxz", "tzyx", "czyx", "tczyx"])
    def test_axes_of_any_order_are_followed(self, tmp_path: Path, names: str) -> None:
        stored = STORED.transpose(["zyx".index(name) for name in names if name in "zyx"])
        stored = stored.reshape((1,) * (len(names) - 3) + stored.shape)
        volume = read_volume(write(tmp_path / "s.zarr", stored, multiscales(names)))
        assert_in_place(volume)
        np.testing.assert_array_equal(volume.voxels, STORED)

    def test_the_images_own_transformation_comes_after_the_levels(self, tmp_path: Path) -> None:
        steps = [{"type": "scale", "scale": [2, 2, 2]}, {"type": "translation", "translation": [1, 2, 3]}]
        volume = read_volume(write(tmp_path / "s.zarr", images=multiscales(coordinateTransformations=steps)))
        np.testing.assert_allclose(volume.affine[:3, :3], 2 * AFFINE[:3, :3])
        np.testing.assert_allclose(volume.affine[:3, 3], 2 * AFFINE[:3, 3] + [3, 2, 1])

    @pytest.mark.parametrize("bare", [False, True])
    def test_directions_are_followed(self, tmp_path: Path, bare: bool) -> None:
        volume = read_volume(write(tmp_path / "s.zarr", images=directed(bare=bare)))
        np.testing.assert_allclose(volume.grid.affine, np.diag([-1, -1, 1, 1]) @ AFFINE)
        assert volume.notes == (
            "the translation counts along the directions of the axes, as RFC 4 of the format has it",
        )
        with pytest.raises(GeometryError, match="directions of the axes"):
            read_volume(write(tmp_path / "s.zarr", images=directed("dorsal-to-ventral", bare=bare)))

    def test_axes_along_others_of_the_patient_carry_their_translation(self, tmp_path: Path) -> None:
        images = directed("left-to-right", "inferior-to-superior", "anterior-to-posterior")
        volume = read_volume(write(tmp_path / "s.zarr", images=images))
        turned = np.array([[0, 0, -1, 0], [1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0, 1]])
        np.testing.assert_allclose(volume.grid.affine, turned @ AFFINE)

    @pytest.mark.parametrize("spacing", [None, SCALE])
    def test_a_missing_unit_leaves_directions_and_translation(
        self, tmp_path: Path, spacing: tuple[float, ...] | None
    ) -> None:
        images = directed(unit=None)
        volume = read_volume(write(tmp_path / "s.zarr", images=images), settings=ReadSettings(spacing=spacing))
        np.testing.assert_allclose(volume.grid.affine, np.diag([-1, -1, 1, 1]) @ AFFINE)
        assert ("--spacing" in volume.notes[-1]) == (spacing is not None)

    def test_a_spacing_in_another_unit_carries_the_translation(self, tmp_path: Path) -> None:
        images = directed(unit=None)
        given_spacing = ReadSettings(spacing=tuple(10 * value for value in SCALE))
        volume = read_volume(write(tmp_path / "s.zarr", images=images), settings=given_spacing)
        np.testing.assert_allclose(volume.grid.affine[:3], (np.diag([-1, -1, 1, 1]) @ AFFINE)[:3] * 10)

    @pytest.mark.parametrize(("bare", "world"), [(False, (1, 1, 1)), (True, (-1, -1, 1))])
    @pytest.mark.parametrize("level", [0, 1])
    def test_the_origin_of_an_image_that_ngff_zarr_wrote_is_known(
        self, tmp_path: Path, bare: bool, world: tuple[int, ...], level: int
    ) -> None:
        images = directed(bare=bare)
        images[0]["@type"] = "ngff:Image"
        images[0]["datasets"] = [
            {"path": f"scale{n}/image", "coordinateTransformations": [
                {"type": "scale", "scale": [value * 2**n for value in SCALE[::-1]]},
                {"type": "translation", "translation": [
                    at + value * (2**n - 1) / 2 for at, value in zip(OFFSET[::-1], SCALE[::-1], strict=True)
                ]},
            ]}
            for n in range(2)
        ]  # fmt: skip
        folder = write(tmp_path / "s.zarr", images=images)
        for n in range(2):
            (folder / f"scale{n}").mkdir()
            shutil.copytree(folder / "0", folder / f"scale{n}" / "image")
        volume = read_volume(folder, settings=ReadSettings(level=level))
        finest = np.diag([-1, -1, 1, 1]) @ AFFINE
        finest[:3, 3] = np.array(world) * OFFSET
        expected = finest @ np.diag([2.0**level] * 3 + [1])
        expected[:3, 3] = (finest @ [*[(2**level - 1) / 2] * 3, 1])[:3]
        np.testing.assert_allclose(volume.grid.affine, expected)
        assert bool(volume.notes) == (world == (1, 1, 1))

    def test_0_6_is_read_by_its_coordinate_systems(self, tmp_path: Path) -> None:
        (image,) = directed()
        other = {"name": "atlas", "axes": [{"name": name, "type": "space", "unit": "meter"} for name in "zyx"]}
        image["coordinateSystems"] = [other, {"name": "intrinsic", "axes": image.pop("axes")}]
        steps = image["datasets"][0]["coordinateTransformations"]
        one = {"type": "sequence", "transformations": steps, "input": {"path": "0"}, "output": {"name": "intrinsic"}}
        image["datasets"][0]["coordinateTransformations"] = [one]
        image["coordinateTransformations"] = [
            {
                "type": "affine",
                "affine": [[9, 0, 0, 0]] * 3,
                "input": {"name": "intrinsic"},
                "output": {"name": "atlas"},
            }
        ]
        volume = read_volume(write(tmp_path / "s.zarr", images=[image]))
        np.testing.assert_allclose(volume.grid.affine, np.diag([-1, -1, 1, 1]) @ AFFINE)

    @pytest.mark.parametrize("inside", ["", "s.ome.zarr/"])
    def test_an_archive_of_one_store_is_read(self, tmp_path: Path, inside: str) -> None:
        folder = write(tmp_path / "s.zarr", chunks=(2, 2, 2), shards=(4, 4, 4))
        with zipfile.ZipFile(tmp_path / "s.ozx", "w") as archive:
            for path in sorted(path for path in folder.rglob("*") if path.is_file()):
                archive.write(path, inside + path.relative_to(folder).as_posix())
        np.testing.assert_array_equal(read_volume(tmp_path / "s.ozx").voxels, STORED)
        shutil.rmtree(folder)
        assert [study.path.name for study in find_studies(tmp_path)] == ["s.ozx"]

    @FORMATS
    def test_a_level_is_chosen(self, tmp_path: Path, zarr_format: int) -> None:
        images = multiscales()
        coarse = [{"type": "scale", "scale": [4.0, 1.4, 1.0]}]
        images[0]["datasets"].append({"path": "deep/1", "coordinateTransformations": coarse})
        folder = write(tmp_path / "s.zarr", images=images, zarr_format=zarr_format)
        small = zarr.open_group(folder, mode="r+").require_group("deep")
        small.create_array("1", shape=(2, 3, 4), dtype="i2", chunks=(2, 3, 4))[...] = STORED[:4:2, :6:2, :8:2]
        volume = read_volume(folder, settings=ReadSettings(level=1))
        np.testing.assert_array_equal(volume.voxels, STORED[:4:2, :6:2, :8:2])
        assert volume.spacing_mm == (1.0, 1.4, 4.0)
        with pytest.raises(UsageError, match="0 to 1"):
            read_volume(folder, settings=ReadSettings(level=2))

    def test_it_is_one_study_of_a_folder(self, tmp_path: Path) -> None:
        folder = write(tmp_path / "s.zarr")
        (study,) = find_studies(tmp_path)
        assert study.path == folder
        before = study.state
        chunk(folder).write_bytes(chunk(folder).read_bytes() + b"0")
        assert find_studies(tmp_path)[0].state != before

    def test_without_a_unit_a_spacing_is_asked_for(self, tmp_path: Path) -> None:
        folder = write(tmp_path / "s.zarr", images=multiscales(unit=None))
        with pytest.raises(GeometryError, match=r"units of x, y, z: none.*--spacing x y z"):
            read_volume(folder)
        volume = read_volume(folder, settings=ReadSettings(spacing=SCALE))
        np.testing.assert_allclose(volume.affine, AFFINE)

    @FORMATS
    def test_a_plain_array_needs_a_spacing(self, tmp_path: Path, zarr_format: int) -> None:
        array = zarr.create_array(
            tmp_path / "s", shape=STORED.shape, dtype="i2", chunks=(4, 4, 4), zarr_format=zarr_format
        )
        array[...] = STORED
        with pytest.raises(GeometryError, match="--spacing x y z"):
            read_volume(tmp_path / "s")
        volume = read_volume(tmp_path / "s", settings=ReadSettings(spacing=SCALE))
        np.testing.assert_array_equal(volume.voxels, STORED)
        assert volume.spacing_mm == SCALE


class TestVoxels:
    def test_three_channels_of_bytes_are_color(self, tmp_path: Path) -> None:
        colors = np.stack([STORED % n for n in (251, 7, 13)]).astype(np.uint8)
        volume = read_volume(write(tmp_path / "s.zarr", colors, multiscales("czyx")))
        np.testing.assert_array_equal(volume.voxels, np.moveaxis(colors, 0, -1))

    @pytest.mark.parametrize(("names", "count", "kind"), [("czyx", 2, "u1"), ("czyx", 3, "i2"), ("tzyx", 3, "u1")])
    def test_frames_and_channels_are_refused_before_they_are_read(
        self, tmp_path: Path, names: str, count: int, kind: str, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        folder = write(tmp_path / "s.zarr", np.stack([STORED] * count).astype(kind), multiscales(names))
        monkeypatch.setattr("tomomesh.io.volumes.zarr.omezarr.read_array", None)
        with pytest.raises(FormatError, match="a store of its own"):
            read_volume(folder)

    @pytest.mark.parametrize("kind", ["u1", "i1", "u2", "i2", "u4", "i4", "i8", "f4", "f8", "b1", ">i2"])
    @FORMATS
    def test_every_kind_of_number_comes_back(self, tmp_path: Path, kind: str, zarr_format: int) -> None:
        stored = (STORED % 100).astype(kind)
        volume = read_volume(write(tmp_path / "s.zarr", stored, zarr_format=zarr_format))
        np.testing.assert_array_equal(volume.voxels, stored)
        assert volume.voxels.dtype.isnative

    @pytest.mark.parametrize("name", ["Blosc", "Zstd", "GZip", "LZ4", "Zlib", "BZ2", "LZMA"])
    def test_every_packing_of_format_2(self, tmp_path: Path, name: str) -> None:
        numcodecs = pytest.importorskip("numcodecs", reason="the package numcodecs is not installed")
        folder = write(tmp_path / "s.zarr", zarr_format=2, compressors=getattr(numcodecs, name)())
        np.testing.assert_array_equal(read_volume(folder).voxels, STORED)

    def test_shards(self, tmp_path: Path) -> None:
        folder = write(tmp_path / "s.zarr", chunks=(2, 2, 2), shards=(4, 4, 4))
        np.testing.assert_array_equal(read_volume(folder).voxels, STORED)

    def test_nan_becomes_background(self, tmp_path: Path) -> None:
        stored = STORED.astype(np.float32)
        stored[3, 2, 1] = np.nan
        volume = read_volume(write(tmp_path / "s.zarr", stored))
        assert volume.voxels[3, 2, 1] == np.nanmin(stored)
