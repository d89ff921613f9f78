"""NRRD, MetaImage, MGH, NPY and TIFF: one study in every format, and SimpleITK, nibabel and pynrrd as judges."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import nibabel
import numpy as np
import pytest
from PIL import Image

from studies import (
    AFFINES,
    LPS_TO_RAS,
    SHAPE,
    affine_of,
    assert_in_place,
    indices_of,
    rotation,
    sampled,
    shared,
    write_nifti,
)
from tomomesh.cli import main
from tomomesh.errors import FormatError, GeometryError
from tomomesh.io import read_mesh, read_volume, write_labels
from tomomesh.settings import ReadSettings

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from numpy.typing import NDArray

    from tomomesh.model.volume import Volume


def needed(name: str) -> Any:
    return pytest.importorskip(name, reason=f"the package {name} is not installed")


SPACING = ReadSettings(spacing=(0.5, 0.7, 2.0))
TURNED = {
    **AFFINES,
    "left-handed": affine_of(rotation(0.2, -0.3, 0.4) @ np.diag([1.0, -1.0, 1.0])),
    "upside down": affine_of(np.diag([-1.0, 1.0, -1.0])),
}
SHEARED = affine_of(rotation(0.1, 0.2, -0.2) @ np.array([[1.0, 0.1, 0], [0, 1, 0.3], [0, 0, 1]]))


def as_image(stored: NDArray[Any], affine: NDArray[np.float64]) -> Any:
    """Return SimpleITK's image of an array (K, J, I)."""
    image = needed("SimpleITK").GetImageFromArray(stored)
    spacing = np.linalg.norm(affine[:3, :3], axis=0)
    image.SetSpacing(spacing.tolist())
    image.SetDirection((affine[:3, :3] / spacing).ravel().tolist())
    image.SetOrigin(affine[:3, 3].tolist())
    return image


def with_itk(suffix: str, packed: bool = False) -> Callable[[Path, NDArray[Any], NDArray[np.float64]], Path]:
    def write(folder: Path, stored: NDArray[Any], affine: NDArray[np.float64]) -> Path:
        needed("SimpleITK").WriteImage(as_image(stored, affine), str(folder / f"study{suffix}"), packed)
        return folder / f"study{suffix}"

    return write


def with_nibabel(suffix: str) -> Callable[[Path, NDArray[Any], NDArray[np.float64]], Path]:
    def write(folder: Path, stored: NDArray[Any], affine: NDArray[np.float64]) -> Path:
        kind = nibabel.MGHImage if suffix.startswith(".mg") else nibabel.Nifti1Image
        nibabel.save(kind(stored.T, LPS_TO_RAS @ affine), folder / f"study{suffix}")
        return folder / f"study{suffix}"

    return write


WRITERS = {
    "nii.gz": with_nibabel(".nii.gz"),
    "nrrd": with_itk(".nrrd"),
    "nrrd gzip": with_itk(".nrrd", True),
    "nhdr": with_itk(".nhdr"),
    "nhdr gzip": with_itk(".nhdr", True),
    "mha": with_itk(".mha"),
    "mha zlib": with_itk(".mha", True),
    "mhd": with_itk(".mhd"),
    "mhd zlib": with_itk(".mhd", True),
    "mgh": with_nibabel(".mgh"),
    "mgz": with_nibabel(".mgz"),
}


def assert_agrees(volume: Volume, image: Any) -> None:
    """Compare voxels and places with SimpleITK's."""
    np.testing.assert_array_equal(volume.grid.restore(volume.voxels), needed("SimpleITK").GetArrayViewFromImage(image))
    affine = np.eye(4)
    affine[:3, :3] = np.array(image.GetDirection()).reshape(3, 3) * image.GetSpacing()
    affine[:3, 3] = image.GetOrigin()
    np.testing.assert_allclose(volume.grid.affine, affine, atol=1e-4)


class TestOneStudyInEveryFormat:
    @pytest.mark.parametrize("turn", TURNED)
    @pytest.mark.parametrize("kind", WRITERS)
    def test_every_voxel_is_where_its_gray_level_says(self, tmp_path: Path, kind: str, turn: str) -> None:
        volume = read_volume(WRITERS[kind](tmp_path, sampled(TURNED[turn]), TURNED[turn]))
        assert_in_place(volume)
        assert volume.voxels.dtype == np.int16
        assert volume.notes == ()

    @pytest.mark.parametrize("turn", TURNED)
    @pytest.mark.parametrize("kind", [kind for kind in WRITERS if kind[0] == "n" or kind[:3] in ("mha", "mhd")])
    def test_simpleitk_agrees(self, tmp_path: Path, kind: str, turn: str) -> None:
        path = WRITERS[kind](tmp_path, sampled(TURNED[turn]), TURNED[turn])
        assert_agrees(read_volume(path), needed("SimpleITK").ReadImage(str(path)))

    def test_all_give_the_same_canonical_volume(self, tmp_path: Path) -> None:
        found = []
        for number, write in enumerate(WRITERS.values()):
            (tmp_path / str(number)).mkdir()
            found.append(read_volume(write(tmp_path / str(number), sampled(AFFINES["oblique"]), AFFINES["oblique"])))
        for volume in found:
            np.testing.assert_array_equal(volume.voxels, found[0].voxels)
            np.testing.assert_allclose(volume.affine, found[0].affine, atol=1e-4)

    @pytest.mark.parametrize("kind", ["i1", "u1", "i2", "u2", "i4", "u4", "i8", "u8", "f4", "f8"])
    @pytest.mark.parametrize("suffix", [".nrrd", ".mha"])
    def test_every_kind_of_number_comes_back(self, tmp_path: Path, suffix: str, kind: str) -> None:
        stored = (np.arange(np.prod(SHAPE)) % 100 - (0 if kind[0] == "u" else 50)).astype(kind).reshape(SHAPE)
        path = with_itk(suffix)(tmp_path, stored, AFFINES["axial"])
        volume = read_volume(path)
        assert_agrees(volume, needed("SimpleITK").ReadImage(str(path)))
        assert volume.voxels.dtype == np.dtype(kind)

    @pytest.mark.parametrize("kind", ["u1", "u2", "i2", "i4", "f4"])
    def test_every_kind_of_number_of_mgh(self, tmp_path: Path, kind: str) -> None:
        stored = (np.arange(np.prod(SHAPE)) % 100).astype(kind).reshape(SHAPE)
        volume = read_volume(with_nibabel(".mgz")(tmp_path, stored, AFFINES["axial"]))
        np.testing.assert_array_equal(volume.grid.restore(volume.voxels), stored)
        assert volume.voxels.dtype == np.dtype(kind)

    @pytest.mark.parametrize("suffix", [".nrrd", ".mha"])
    def test_color_has_three_channels(self, tmp_path: Path, suffix: str) -> None:
        colors = np.stack([sampled(AFFINES["axial"]) % n for n in (251, 7, 13)], axis=-1).astype(np.uint8)
        image = needed("SimpleITK").GetImageFromArray(colors, isVector=True)
        needed("SimpleITK").WriteImage(image, str(tmp_path / f"c{suffix}"))
        volume = read_volume(tmp_path / f"c{suffix}")
        np.testing.assert_array_equal(volume.voxels, colors)

    @pytest.mark.parametrize("suffix", [".nrrd", ".mha"])
    def test_several_values_a_voxel_are_refused(self, tmp_path: Path, suffix: str) -> None:
        image = needed("SimpleITK").GetImageFromArray(np.zeros((*SHAPE, 3), np.float32), isVector=True)
        needed("SimpleITK").WriteImage(image, str(tmp_path / f"c{suffix}"))
        with pytest.raises(FormatError, match="several values"):
            read_volume(tmp_path / f"c{suffix}")

    @pytest.mark.parametrize("suffix", [".nrrd", ".mha", ".mgz"])
    def test_nan_becomes_background(self, tmp_path: Path, suffix: str) -> None:
        stored = sampled(AFFINES["axial"]).astype(np.float32)
        stored[3, 2, 1] = np.nan
        write = with_nibabel(suffix) if suffix == ".mgz" else with_itk(suffix)
        volume = read_volume(write(tmp_path, stored, AFFINES["axial"]))
        assert volume.voxels[3, 2, 1] == np.nanmin(stored)
        assert "1" in volume.notes[0]

    @pytest.mark.parametrize("suffix", [".nii.gz", ".nrrd", ".mha"])
    def test_label_maps_keep_their_numbers(self, tmp_path: Path, suffix: str) -> None:
        study = read_volume(write_nifti(tmp_path / "s.nii", sampled(TURNED["left-handed"]), TURNED["left-handed"]))
        labels = (study.voxels % 5 * 129).astype(np.uint16)
        if suffix == ".nii.gz":
            write_labels(labels, study, tmp_path / "l.nii.gz")
        else:
            with_itk(suffix)(tmp_path, study.grid.restore(labels), study.grid.affine).rename(tmp_path / f"l{suffix}")
        found = read_volume(tmp_path / f"l{suffix}")
        assert found.voxels.dtype == np.uint16
        np.testing.assert_array_equal(found.voxels, labels)
        np.testing.assert_allclose(found.affine, study.affine, atol=1e-4)


class TestNrrd:
    def write(self, path: Path, affine: NDArray[np.float64], signs: Any = (1, 1, 1), **fields: Any) -> Path:
        """Write by pynrrd; its arrays are fastest axis first."""
        nrrd = needed("nrrd")
        header = {
            "space": "left-posterior-superior",
            "space directions": (affine[:3, :3] * np.reshape(signs, (3, 1))).T,
            "space origin": affine[:3, 3] * signs,
            **fields,
        }
        nrrd.write(str(path), sampled(affine).T, {key: value for key, value in header.items() if value is not None})
        return path

    @pytest.mark.parametrize("turn", TURNED)
    @pytest.mark.parametrize(
        ("space", "signs"),
        [
            ("left-posterior-superior", (1, 1, 1)), ("LPS", (1, 1, 1)),
            ("right-anterior-superior", (-1, -1, 1)), ("RAS", (-1, -1, 1)),
            ("left-anterior-superior", (1, -1, 1)), ("LAS", (1, -1, 1)),
        ],
    )  # fmt: skip
    def test_every_space_becomes_lps(self, tmp_path: Path, space: str, signs: Any, turn: str) -> None:
        path = self.write(tmp_path / "s.nrrd", TURNED[turn], signs, space=space)
        volume = read_volume(path)
        assert_in_place(volume)
        assert_agrees(volume, needed("SimpleITK").ReadImage(str(path)))

    def test_sheared_axes_stay_sheared(self, tmp_path: Path) -> None:
        volume = read_volume(self.write(tmp_path / "s.nrrd", SHEARED))
        assert_in_place(volume)
        np.testing.assert_allclose(volume.grid.affine, SHEARED, atol=1e-9)

    @pytest.mark.parametrize("encoding", ["raw", "gzip", "bzip2", "ascii"])
    @pytest.mark.parametrize("endian", ["little", "big"])
    @pytest.mark.parametrize("suffix", [".nrrd", ".nhdr"])
    def test_every_encoding(self, tmp_path: Path, encoding: str, endian: str, suffix: str) -> None:
        affine = AFFINES["oblique"]
        self.write(tmp_path / f"s{suffix}", affine, encoding=encoding, endian=endian)
        nrrd = needed("nrrd")
        data, _ = nrrd.read(str(tmp_path / f"s{suffix}"))
        volume = read_volume(tmp_path / f"s{suffix}")
        np.testing.assert_array_equal(volume.grid.restore(volume.voxels), data.T)
        assert_in_place(volume)
        assert volume.voxels.dtype.isnative

    def test_voxels_at_the_end_and_behind_lines(self, tmp_path: Path) -> None:
        whole = self.write(tmp_path / "s.nrrd", AFFINES["axial"], encoding="raw").read_bytes()
        head, blank, data = whole.partition(b"\n\n")
        (tmp_path / "end.nrrd").write_bytes(head + b"\nbyte skip: -1" + blank + b"whatever it is" + data)
        (tmp_path / "lines.nrrd").write_bytes(head + b"\nline skip: 2\nbyte skip: 3" + blank + b"a\nb\nxyz" + data)
        for name in ("end", "lines"):
            assert_in_place(read_volume(tmp_path / f"{name}.nrrd"))

    def test_lists_and_patterns_of_data_files(self, tmp_path: Path) -> None:
        affine = AFFINES["oblique"]
        stored = sampled(affine)
        head = self.write(tmp_path / "s.nhdr", affine, encoding="raw").read_bytes().decode()
        head = "\n".join(line for line in head.splitlines() if line and not line.startswith("data file"))
        for k, pixels in enumerate(stored):
            (tmp_path / f"slice{k + 3:02d}.raw").write_bytes(pixels.tobytes())
        names = "\n".join(f"slice{k + 3:02d}.raw" for k in range(len(stored)))
        (tmp_path / "list.nhdr").write_text(f"{head}\ndata file: LIST\n{names}\n")
        (tmp_path / "pattern.nhdr").write_text(f"{head}\ndata file: slice%02d.raw 3 7 1\n")
        for name in ("list", "pattern"):
            assert_in_place(read_volume(tmp_path / f"{name}.nhdr"))

    def test_meters_and_microns_become_millimeters(self, tmp_path: Path) -> None:
        scaled = np.diag([1000, 1000, 1000, 1.0]) @ AFFINES["oblique"]
        nrrd = needed("nrrd")
        header = {
            "space": "LPS", "space directions": scaled[:3, :3].T, "space origin": scaled[:3, 3],
            "space units": ["um", "um", "um"],
        }  # fmt: skip
        nrrd.write(str(tmp_path / "s.nrrd"), sampled(AFFINES["oblique"]).T, header)
        volume = read_volume(tmp_path / "s.nrrd")
        assert_in_place(volume)
        assert "millimeters" in volume.notes[0]

    def test_spacings_alone_are_taken_and_told(self, tmp_path: Path) -> None:
        path = self.write(
            tmp_path / "s.nrrd", AFFINES["axial"], space=None, **{
                "space directions": None, "space origin": None, "spacings": [0.5, 0.7, 2.0],
            }
        )  # fmt: skip
        volume = read_volume(path)
        np.testing.assert_array_equal(volume.affine, np.diag([0.5, 0.7, 2, 1]))
        assert "no directions" in volume.notes[0]

    def test_without_any_frame_a_spacing_is_asked_for(self, tmp_path: Path) -> None:
        nrrd = needed("nrrd")
        nrrd.write(str(tmp_path / "s.nrrd"), sampled(AFFINES["axial"]).T)
        with pytest.raises(GeometryError, match="--spacing x y z"):
            read_volume(tmp_path / "s.nrrd")
        assert read_volume(tmp_path / "s.nrrd", settings=SPACING).spacing_mm == SPACING.spacing

    def test_a_list_of_layers_is_no_space(self, tmp_path: Path) -> None:
        nrrd = needed("nrrd")
        stored = sampled(AFFINES["oblique"])
        directions = np.vstack([np.full(3, np.nan), AFFINES["oblique"][:3, :3].T])
        header = {"space": "LPS", "space directions": directions, "space origin": AFFINES["oblique"][:3, 3]}
        nrrd.write(str(tmp_path / "one.nrrd"), stored.T[None], {**header, "kinds": ["list", *["domain"] * 3]})
        assert_in_place(read_volume(tmp_path / "one.nrrd"))
        nrrd.write(str(tmp_path / "two.nrrd"), np.stack([stored.T] * 2), {**header, "kinds": ["list", *["domain"] * 3]})
        with pytest.raises(FormatError, match="several values"):
            read_volume(tmp_path / "two.nrrd")


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


class TestMgh:
    def test_nibabel_agrees(self, tmp_path: Path) -> None:
        path = with_nibabel(".mgz")(tmp_path, sampled(TURNED["left-handed"]), TURNED["left-handed"])
        image, volume = nibabel.load(path), read_volume(path)
        np.testing.assert_allclose(volume.grid.affine, LPS_TO_RAS @ image.affine, atol=1e-4)
        np.testing.assert_array_equal(volume.grid.restore(volume.voxels).T, np.asarray(image.dataobj))

    def test_a_file_without_a_frame_has_freesurfers_and_says_so(self, tmp_path: Path) -> None:
        path = with_nibabel(".mgh")(tmp_path, sampled(AFFINES["axial"]), AFFINES["axial"])
        raw = bytearray(path.read_bytes())
        raw[28:30] = b"\0\0"
        path.write_bytes(bytes(raw))
        volume = read_volume(path)
        np.testing.assert_allclose(volume.grid.affine, LPS_TO_RAS @ nibabel.MGHImage.from_bytes(bytes(raw)).affine)
        assert "no frame" in volume.notes[0]


class TestNpy:
    def test_a_spacing_puts_it_in_place(self, tmp_path: Path) -> None:
        stored = sampled(np.diag([0.5, 0.7, 2, 1]))
        for name, array in (("c", stored), ("f", np.asfortranarray(stored)), ("b", stored.astype(">i2"))):
            np.save(tmp_path / f"{name}.npy", array)
            assert_in_place(read_volume(tmp_path / f"{name}.npy", settings=SPACING))

    def test_without_it_one_is_asked_for(self, tmp_path: Path) -> None:
        np.save(tmp_path / "a.npy", sampled(AFFINES["axial"]))
        with pytest.raises(GeometryError, match="--spacing x y z"):
            read_volume(tmp_path / "a.npy")

    @pytest.mark.parametrize("array", [np.zeros((3, 3)), np.zeros((2, 3, 4, 5)), np.zeros((2, 0, 3)), np.array([{}])])
    def test_other_arrays_are_refused(self, tmp_path: Path, array: Any) -> None:
        np.save(tmp_path / "a.npy", array, allow_pickle=True)
        with pytest.raises(FormatError):
            read_volume(tmp_path / "a.npy", settings=SPACING)


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


def test_jpeg_slices(tmp_path: Path) -> None:
    stored = np.tile(np.arange(5, dtype=np.uint8)[:, None, None] * 50, (1, 16, 24))
    for suffix in (".jpg", ".jpeg"):
        (tmp_path / suffix).mkdir()
        for k, pixels in enumerate(stored):
            Image.fromarray(pixels).save(tmp_path / suffix / f"s{k + 8}{suffix}", format="JPEG", quality=95)
        volume = read_volume(tmp_path / suffix, settings=SPACING)
        assert np.abs(volume.voxels.astype(int) - stored).max() <= 1
        assert "JPEG slices" in volume.notes[0]


class TestSharedData:
    @pytest.mark.parametrize(
        "name",
        [
            "derived/dev54_t1/dev54_t1.nrrd", "derived/dev54_t1/dev54_t1.mha", "derived/dev54_t1/dev54_t1.nii.gz",
            "niivue/demos/images/FLAIR.nrrd", "niivue/demos/images/mha.mha",
            "itkcuberille/blob0.mha", "itkcuberille/fuel.mha", "itkcuberille/marschnerlobb.mha",
        ],
    )  # fmt: skip
    def test_simpleitk_agrees(self, name: str) -> None:
        path = shared(name)
        assert_agrees(read_volume(path), needed("SimpleITK").ReadImage(str(path)))

    def test_one_head_is_the_same_in_three_formats(self) -> None:
        found = [read_volume(shared("derived/dev54_t1") / f"dev54_t1.{kind}") for kind in ("nii.gz", "nrrd", "mha")]
        for volume in found:
            np.testing.assert_array_equal(volume.voxels, found[0].voxels)
            np.testing.assert_allclose(volume.affine, found[0].affine, atol=1e-4)


@pytest.mark.parametrize("suffix", [".nrrd", ".mha", ".mgz"])
def test_the_command_line_puts_a_ball_in_its_place(tmp_path: Path, suffix: str) -> None:
    affine = affine_of(rotation(0.2, -0.3, 0.4), (1.0, 1.2, 2.0), (30.0, -50.0, 70.0))
    places = indices_of((20, 40, 48)) @ affine[:3, :3].T + affine[:3, 3]
    center = np.array([24.0, 20.0, 10.0]) @ affine[:3, :3].T + affine[:3, 3] + [1.3, -0.7, 0.4]
    distance = np.linalg.norm(places - center, axis=1).reshape(20, 40, 48)
    stored = np.rint(1000 - 50 * distance).astype(np.int16)
    write = with_nibabel(suffix) if suffix == ".mgz" else with_itk(suffix)
    study, mesh = write(tmp_path, stored, affine), tmp_path / "ball.vtp"
    assert main(["reconstruct", str(study), "-o", str(mesh), "--lower", "500", "--network", "none"]) == 0
    assert mesh.exists()
    assert (
        main(["reconstruct", str(study), "-o", str(mesh.with_suffix(".ply")), "--lower", "500", "--network", "none"])
        == 0
    )
    vertices = read_mesh(mesh.with_suffix(".ply")).vertices
    assert np.abs(np.linalg.norm(vertices - center, axis=1) - 10).max() < 0.5
