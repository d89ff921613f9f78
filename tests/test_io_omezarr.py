"""OME-Zarr and plain Zarr: places, levels, axes, and stores that lie, lack chunks or leave their folder."""

from __future__ import annotations

import json
import os
import shutil
import zipfile
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st

from studies import assert_in_place, sampled
from tomomesh.cli import main
from tomomesh.errors import FormatError, GeometryError, ResourceError, TomomeshError, UsageError
from tomomesh.io import read_volume
from tomomesh.io.files import limits
from tomomesh.io.studies.folder import find_studies
from tomomesh.settings import ReadSettings

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

zarr = pytest.importorskip("zarr", reason="the package zarr is not installed")

SCALE, OFFSET = (0.5, 0.7, 2.0), (-3.0, 11.0, 40.0)
AFFINE = np.array([[0.5, 0, 0, -3], [0, 0.7, 0, 11], [0, 0, 2, 40], [0, 0, 0, 1]])
STORED = sampled(AFFINE)
FORMATS = pytest.mark.parametrize("zarr_format", [2, 3])


def multiscales(names: str = "zyx", unit: str | None = "millimeter", per_mm: float = 1.0, **more: Any) -> Any:
    """Return the metadata of an image of one level at path 0."""
    kinds = {"t": "time", "c": "channel"}
    axes: list[dict[str, Any]] = [{"name": name, "type": kinds.get(name, "space")} for name in names]
    for axis in axes if unit else ():
        axis |= {"unit": unit} if axis["type"] == "space" else {}
    steps = [
        {"type": kind, kind: [values["xyz".index(n)] * per_mm if n in "xyz" else other for n in names]}
        for kind, values, other in (("scale", SCALE, 1.0), ("translation", OFFSET, 0.0))
    ]
    return [{"axes": axes, "datasets": [{"path": "0", "coordinateTransformations": steps}], **more}]


def directed(
    z: str = "inferior-to-superior",
    y: str = "posterior-to-anterior",
    x: str = "left-to-right",
    *,
    bare: bool = False,
    unit: str | None = "millimeter",
) -> Any:
    """Return the metadata of an image whose axes have directions, as objects or as ngff-zarr's bare words."""
    images = multiscales(unit=unit)
    for axis, value in zip(images[0]["axes"], (z, y, x), strict=True):
        axis["orientation"] = value if bare else {"type": "anatomical", "value": value}
    return images


def write(folder: Path, stored: NDArray[Any] = STORED, images: Any = None, zarr_format: int = 3, **array: Any) -> Path:
    """Write an image by zarr-python; 0.4 is of format 2, 0.5 of format 3."""
    group = zarr.open_group(folder, mode="w", zarr_format=zarr_format)
    told = {"multiscales": multiscales() if images is None else images}
    group.attrs.update({"ome": {"version": "0.5", **told}} if zarr_format == 3 else told)
    options = {"chunks": tuple(min(size, 4) for size in stored.shape)} | array
    group.create_array("0", shape=stored.shape, dtype=stored.dtype, **options)[...] = stored
    return folder


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


def chunk(folder: Path, place: str = "1/1/1") -> Path:
    """Return the file of a chunk, whatever the format is."""
    found = [folder / "0" / "c" / place, folder / "0" / place.replace("/", ".")]
    return next(path for path in found if path.exists())


def isle(shape: tuple[int, int, int] = (16, 16, 16)) -> NDArray[np.int16]:
    """Return a ball that touches no side, in a background of 0."""
    away = np.linalg.norm(np.indices(shape) - np.array(shape).reshape(3, 1, 1, 1) / 3, axis=0)
    return np.where(away < 3.5, 1000, 0).astype(np.int16)


class TestMissingChunks:
    @FORMATS
    def test_what_the_writer_left_out_is_its_fill_and_is_said(self, tmp_path: Path, zarr_format: int) -> None:
        folder = write(tmp_path / "s.zarr", isle(), zarr_format=zarr_format)
        volume = read_volume(folder)
        np.testing.assert_array_equal(volume.voxels, isle())
        (note,) = [note for note in volume.notes if "chunks" in note]
        stored = len(list((folder / "0").rglob("*[0-9]")))
        there = sum(path.is_file() for path in (folder / "0").rglob("*") if path.name[0] not in ".z")
        assert stored
        assert note.endswith(f"{64 - there} of 64")

    @FORMATS
    @pytest.mark.parametrize("lost", ["1/1/1", "0/1/1", "1/0/2"])
    def test_one_that_was_lost_is_refused_and_counted(self, tmp_path: Path, zarr_format: int, lost: str) -> None:
        folder = write(tmp_path / "s.zarr", zarr_format=zarr_format)
        chunk(folder, lost).unlink()
        with pytest.raises(FormatError, match=r"missing = 1 of 12.*--fill-chunks"):
            read_volume(folder)
        volume = read_volume(folder, settings=ReadSettings(fill_chunks=True))
        assert (volume.voxels == 0).sum() > (STORED == 0).sum()
        assert "1 of 12" in volume.notes[-1]

    def test_a_hole_in_a_ball_is_refused(self, tmp_path: Path) -> None:
        folder = write(tmp_path / "s.zarr", isle())
        chunk(folder, "1/1/1").unlink()
        with pytest.raises(FormatError, match="chunks of the array are missing"):
            read_volume(folder)

    def test_a_fill_that_is_no_number_counts_too(self, tmp_path: Path) -> None:
        stored = isle().astype(np.float32)
        stored[9:] = np.nan
        folder = write(tmp_path / "s.zarr", stored, fill_value=np.nan, config={"write_empty_chunks": False})
        assert any("16 of 64" in note for note in read_volume(folder).notes)
        chunk(folder, "0/0/0").unlink()
        with pytest.raises(FormatError, match="missing"):
            read_volume(folder)

    def test_all_of_them_are_never_taken_for_fill(self, tmp_path: Path) -> None:
        folder = write(tmp_path / "s.zarr", np.zeros((8, 8, 8), np.int16))
        with pytest.raises(FormatError, match="missing = 8 of 8"):
            read_volume(folder, settings=ReadSettings(fill_chunks=True))

    def test_a_lost_shard_is_refused(self, tmp_path: Path) -> None:
        folder = write(tmp_path / "s.zarr", chunks=(2, 2, 2), shards=(4, 4, 4))
        chunk(folder).unlink()
        with pytest.raises(FormatError, match="missing = 1 of 12"):
            read_volume(folder)


class TestDamage:
    @pytest.mark.parametrize("cut", [1, 5, 30, 10**6])
    @pytest.mark.parametrize("packing", ["auto", None])
    @FORMATS
    def test_a_chunk_that_is_cut_off_is_refused(
        self, tmp_path: Path, zarr_format: int, cut: int, packing: str | None
    ) -> None:
        folder = write(tmp_path / "s.zarr", zarr_format=zarr_format, compressors=packing)
        path = chunk(folder)
        path.write_bytes(path.read_bytes()[: -min(cut, path.stat().st_size)])
        with pytest.raises(FormatError):
            read_volume(folder)

    @pytest.mark.parametrize("name", ["Blosc", "Zstd"])
    def test_a_chunk_that_holds_far_more_is_refused(self, tmp_path: Path, name: str) -> None:
        numcodecs = pytest.importorskip("numcodecs", reason="the package numcodecs is not installed")
        codec = getattr(numcodecs, name)()
        folder = write(tmp_path / "s.zarr", zarr_format=2, compressors=codec)
        chunk(folder).write_bytes(codec.encode(bytes(2**22)))
        with pytest.raises(ResourceError, match="far more than its voxels"):
            read_volume(folder)

    def edited(self, folder: Path, **fields: Any) -> Path:
        path = next(path for path in (folder / "0" / "zarr.json", folder / "0" / ".zarray") if path.exists())
        path.write_text(json.dumps(json.loads(path.read_text()) | fields))
        return folder

    @pytest.mark.parametrize(
        ("zarr_format", "fields", "told"),
        [
            (2, {"filters": [{"id": "pickle"}]}, "codec = pickle"),
            (2, {"compressor": {"id": "imagecodecs_jpegxl"}}, "codec = imagecodecs_jpegxl"),
            (3, {"codecs": [{"name": "bytes"}, {"name": "secret.codec"}]}, "codec = secret.codec"),
            (3, {"codecs": [{"name": "numcodecs.pickle"}]}, "codec = numcodecs.pickle"),
            (3, {"codecs": [{"name": "sharding_indexed", "configuration": {"codecs": [{"name": "q"}]}}]}, "codec = q"),
        ],
    )
    def test_unknown_codecs_are_named(self, tmp_path: Path, zarr_format: int, fields: Any, told: str) -> None:
        folder = self.edited(write(tmp_path / "s.zarr", zarr_format=zarr_format), **fields)
        with pytest.raises(FormatError) as fault:
            read_volume(folder)
        assert told in str(fault.value)

    def test_sizes_are_compared_with_the_memory_first(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        folder = self.edited(write(tmp_path / "s.zarr", zarr_format=2), shape=[32767] * 3)
        with pytest.raises(ResourceError, match="memory"):
            read_volume(folder)
        monkeypatch.setattr(limits, "physical_memory", lambda: 100)
        with pytest.raises(ResourceError, match="at most 100 bytes"):
            read_volume(write(tmp_path / "s.zarr"))

    @pytest.mark.parametrize("path", ["../other", "..", "/", "nowhere", "", "0/0"])
    def test_a_level_outside_of_the_folder_is_never_opened(self, tmp_path: Path, path: str) -> None:
        images = multiscales()
        images[0]["datasets"][0]["path"] = str(tmp_path / "other") if path == "/" else path
        write(tmp_path / "other", images=images)
        folder = write(tmp_path / "s.zarr", images=images)
        with pytest.raises(FormatError) as fault:
            read_volume(folder)
        assert str(tmp_path / "other") not in str(fault.value)

    @pytest.mark.parametrize("linked", ["0", "0/c", "0/c/1", "0/c/1/1/1", "0/zarr.json"])
    def test_links_that_leave_the_folder_are_never_followed(self, tmp_path: Path, linked: str) -> None:
        folder = write(tmp_path / "s.zarr")
        target = tmp_path / "outside"
        (folder / linked).rename(target)
        (folder / linked).symlink_to(target)
        with pytest.raises(FormatError, match=r"outside|no regular file"):
            read_volume(folder)

    def test_a_pipe_is_never_opened(self, tmp_path: Path) -> None:
        if not hasattr(os, "mkfifo"):
            pytest.skip("there are no pipes here")
        folder = write(tmp_path / "s.zarr")
        path = chunk(folder)
        path.unlink()
        os.mkfifo(path)
        with pytest.raises(FormatError, match="no regular file"):
            read_volume(folder)

    @pytest.mark.parametrize(
        ("told", "words"),
        [
            ({"bioformats2raw.layout": 3}, "the folder of one image"),
            ({"plate": {}}, "the folder of one image"),
            ({}, "no multiscales"),
        ],
    )
    def test_other_stores_say_what_to_give(self, tmp_path: Path, told: Any, words: str) -> None:
        zarr.open_group(tmp_path / "s.zarr", mode="w", zarr_format=2).attrs.update(told)
        with pytest.raises(FormatError, match=words):
            read_volume(tmp_path / "s.zarr")

    @pytest.mark.parametrize(
        ("change", "kind"),
        [
            (lambda image: image["axes"].pop(0), GeometryError),
            (lambda image: image["axes"][0].update(name="w"), FormatError),
            (lambda image: image["axes"].append({"name": "t"}), FormatError),
            (lambda image: image["datasets"].clear(), UsageError),
            (lambda image: image["datasets"][0].pop("path"), FormatError),
            (lambda image: image["datasets"][0]["coordinateTransformations"][0]["scale"].pop(), FormatError),
            (lambda image: image["datasets"][0]["coordinateTransformations"][0].update(type="affine"), FormatError),
            (
                lambda image: image["datasets"][0]["coordinateTransformations"][0].update(scale=[1, 0, 1]),
                GeometryError,
            ),
            (lambda image: image["datasets"][0].pop("coordinateTransformations"), GeometryError),
            (lambda image: image.pop("axes"), FormatError),
        ],
    )
    def test_metadata_that_lie_are_refused(self, tmp_path: Path, change: Any, kind: type[TomomeshError]) -> None:
        images = multiscales()
        change(images[0])
        folder = write(tmp_path / "s.zarr", images=images)
        with pytest.raises(kind) as fault:
            read_volume(folder)
        assert str(fault.value).isprintable()

    def test_a_missing_package_is_named(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        folder = write(tmp_path / "s.zarr")
        monkeypatch.setitem(__import__("sys").modules, "zarr", None)
        with pytest.raises(FormatError, match=r"tomomesh\[zarr\]"):
            read_volume(folder)

    def test_the_command_line_says_one_line(self, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        folder = write(tmp_path / "s.zarr")
        chunk(folder).unlink()
        assert main(["reconstruct", str(folder), "-o", str(tmp_path / "m.ply"), "--lower", "0"]) == 4
        lines = [line for line in capsys.readouterr().err.splitlines() if line.startswith("error: ")]
        assert len(lines) == 1
        assert not (tmp_path / "m.ply").exists()


@FORMATS
def test_damage_ends_in_a_result_or_in_one_line(tmp_path: Path, zarr_format: int) -> None:
    folder = write(tmp_path / "s.zarr", zarr_format=zarr_format)
    whole = {path: path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}
    edit = st.tuples(st.integers(0, len(whole) - 1), st.integers(0, 2**12), st.integers(0, 6), st.binary(max_size=6))

    @hypothesis_settings(max_examples=40, suppress_health_check=list(HealthCheck))
    @given(edits=st.lists(edit, min_size=1, max_size=3))
    def damage(edits: list[tuple[int, int, int, bytes]]) -> None:
        for path, data in whole.items():
            path.write_bytes(data)
        for which, at, gone, new in edits:
            path = list(whole)[which]
            raw = bytearray(whole[path])
            raw[at % len(raw) : at % len(raw) + gone] = new
            path.write_bytes(bytes(raw))
        told: list[TomomeshError] = []
        try:
            read_volume(folder, settings=ReadSettings(spacing=SCALE))
        except TomomeshError as fault:
            told.append(fault)
        assert all(str(fault).isprintable() and fault.exit_code in (2, 4, 5, 7) for fault in told)

    damage()
