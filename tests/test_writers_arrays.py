"""Arrays as other programs write them: rows of docs/writers.md, made by the writer itself."""

from __future__ import annotations

import importlib.util
import subprocess
import sys
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from PIL import Image

from studies import AFFINES, assert_in_place, gray_at, indices_of, sampled
from tomomesh.errors import FormatError
from tomomesh.io import read_volume
from tomomesh.model.volume import Volume
from tomomesh.settings import ReadSettings
from writers import as_image, needed

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

PERMUTED = np.array([[0, 0, 0.5, -10], [-0.7, 0, 0, 25], [0, -2.0, 0, 40], [0, 0, 0, 1.0]])
ALONG_AXES = {
    "upright": np.array([[0.5, 0, 0, -10], [0, 0.7, 0, 25], [0, 0, 2.0, 40], [0, 0, 0, 1.0]]),
    "left to right": np.array([[-0.5, 0, 0, 20], [0, 0.7, 0, 25], [0, 0, 2.0, 40], [0, 0, 0, 1.0]]),
    "RAS": np.array([[-0.5, 0, 0, 20], [0, -0.7, 0, 25], [0, 0, 2.0, 40], [0, 0, 0, 1.0]]),
    "head to feet": np.array([[0.5, 0, 0, -10], [0, 0.7, 0, 25], [0, 0, -2.0, 40], [0, 0, 0, 1.0]]),
    "sagittal": PERMUTED,
}
"""Affines, LPS, that a store of scales, translations and directions can hold."""
MM = ReadSettings(spacing=(0.5, 0.7, 2.0))


def in_place_at(volume: Volume, affine: NDArray[np.float64]) -> None:
    np.testing.assert_allclose(volume.grid.affine, affine, atol=1e-5)
    assert_in_place(volume, 0.6)


WRITER = """
import sys, pathlib, itk, nibabel, numpy as np, ngff_zarr as ngff
folder, units = pathlib.Path(sys.argv[1]), dict.fromkeys("xyz", "millimeter")
def write(image, name, version):
    ngff.to_ngff_zarr(str(folder / name), ngff.to_multiscales(image, scale_factors=[], chunks=4), version=version)
for file in folder.glob("*.npz"):
    stored, affine = (np.load(file)[key] for key in ("stored", "affine"))
    spacing = np.linalg.norm(affine[:3, :3], axis=0)
    for version in ("0.4", "0.5", "0.6"):
        for unit in (False, True):
            image = itk.image_from_array(stored)
            image.SetSpacing(spacing.tolist())
            image.SetOrigin(affine[:3, 3].tolist())
            image.SetDirection(itk.matrix_from_array(affine[:3, :3] / spacing))
            made = ngff.itk_image_to_ngff_image(image)
            made.axes_units = units if unit else None
            write(made, f"{file.stem} itk {version} {unit}.ome.zarr", version)
        other = nibabel.Nifti1Image(stored.T, np.diag([-1, -1, 1, 1]) @ affine)
        write(ngff.nibabel_image_to_ngff_image(other), f"{file.stem} nibabel {version}.ome.zarr", version)
        if version != "0.4":
            write(made, f"{file.stem} {version}.ozx", version)
"""
"""A program of its own, for ITK and Numba may not share a process."""


@pytest.fixture(scope="module")
def stores(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """OME-Zarr by ngff-zarr of images of ITK and nibabel, in every direction."""
    missing = [name for name in ("ngff_zarr", "itk", "zarr") if importlib.util.find_spec(name) is None]
    if missing:
        pytest.skip(f"the package {missing[0]} is not installed")
    folder = tmp_path_factory.mktemp("stores")
    for name, affine in ALONG_AXES.items():
        np.savez(folder / name, stored=sampled(affine), affine=affine)
    subprocess.run([sys.executable, "-c", WRITER, str(folder)], check=True)
    return folder


class TestNgffZarr:
    """OME-Zarr by ngff-zarr, which writes orientations without units, and origins whatever the directions are."""

    @pytest.mark.parametrize("version", ["0.4", "0.5", "0.6"])
    @pytest.mark.parametrize("units", [False, True])
    @pytest.mark.parametrize("turn", ALONG_AXES)
    def test_of_an_image_of_itk(self, stores: Path, turn: str, units: bool, version: str) -> None:
        volume = read_volume(stores / f"{turn} itk {version} {units}.ome.zarr")
        in_place_at(volume, ALONG_AXES[turn])
        assert any("ngff-zarr" in note for note in volume.notes) == (turn != "upright")
        assert any("no units" in note for note in volume.notes) == (not units)

    @pytest.mark.parametrize("version", ["0.4", "0.5", "0.6"])
    @pytest.mark.parametrize("turn", ALONG_AXES)
    def test_of_an_image_of_nibabel(self, stores: Path, turn: str, version: str) -> None:
        in_place_at(read_volume(stores / f"{turn} nibabel {version}.ome.zarr"), ALONG_AXES[turn])

    @pytest.mark.parametrize("version", ["0.5", "0.6"])
    @pytest.mark.parametrize("turn", ALONG_AXES)
    def test_zipped(self, stores: Path, turn: str, version: str) -> None:
        in_place_at(read_volume(stores / f"{turn} {version}.ozx"), ALONG_AXES[turn])


class TestTifffile:
    AFFINE = np.diag([0.5, 0.7, 2.0, 1.0])

    @pytest.mark.parametrize(
        "told",
        [
            {"imagej": True, "resolution": (1 / 500, 1 / 700),
             "metadata": {"unit": r"\u00B5m", "spacing": 2000, "axes": "ZYX"}},
            {"imagej": True, "resolution": (2, 1 / 0.7),
             "metadata": {"unit": "mm", "zunit": "cm", "spacing": 0.2, "axes": "ZYX"}},
            {"ome": True, "metadata": {
                "axes": "ZYX", "PhysicalSizeX": 5e6, "PhysicalSizeXUnit": "Å", "PhysicalSizeY": 700,
                "PhysicalSizeYUnit": "µm", "PhysicalSizeZ": 2 / 25.4, "PhysicalSizeZUnit": "in"}},
        ],
        ids=["ImageJ, escaped", "ImageJ, an axis in cm", "OME, three units"],
    )  # fmt: skip
    def test_units_of_each_axis(self, tmp_path: Path, told: dict[str, Any]) -> None:
        stored = (sampled(self.AFFINE) + 9000).astype(np.uint16)
        needed("tifffile").imwrite(tmp_path / "s.tif", stored, **told)
        volume = read_volume(tmp_path / "s.tif")
        np.testing.assert_allclose(volume.affine, self.AFFINE, rtol=1e-5)
        np.testing.assert_array_equal(volume.voxels, stored)

    def test_masks_in_a_folder(self, tmp_path: Path) -> None:
        mask = sampled(self.AFFINE) > 0
        for writer in ("tifffile", "Pillow", "SimpleITK"):
            (tmp_path / writer).mkdir()
            for k, pixels in enumerate(mask):
                path = tmp_path / writer / f"{k}.tif"
                if writer == "tifffile":
                    needed("tifffile").imwrite(path, pixels)
                elif writer == "Pillow":
                    Image.fromarray(pixels).save(path, compression="group4")
                else:
                    sitk = needed("SimpleITK")
                    sitk.WriteImage(sitk.GetImageFromArray(pixels.astype(np.uint8)), str(path))
            np.testing.assert_array_equal(read_volume(tmp_path / writer, settings=MM).voxels, mask)

    def test_pages_that_are_written_one_by_one(self, tmp_path: Path) -> None:
        stored = sampled(self.AFFINE)
        with needed("tifffile").TiffWriter(tmp_path / "s.tif") as file:
            for pixels in stored:
                file.write(pixels)
        np.testing.assert_array_equal(read_volume(tmp_path / "s.tif", settings=MM).voxels, stored)

    def test_a_mask(self, tmp_path: Path) -> None:
        mask = sampled(self.AFFINE) > 0
        needed("tifffile").imwrite(tmp_path / "s.tif", mask)
        np.testing.assert_array_equal(read_volume(tmp_path / "s.tif", settings=MM).voxels, mask)


class TestPynrrd:
    @pytest.mark.parametrize("encoding", ["raw", "gzip", "bzip2", "ascii"])
    def test_a_study(self, tmp_path: Path, encoding: str) -> None:
        affine = AFFINES["oblique"]
        header = {"space": "left-posterior-superior", "space directions": affine[:3, :3].T,
                  "space origin": affine[:3, 3], "encoding": encoding}  # fmt: skip
        needed("nrrd").write(str(tmp_path / "s.nrrd"), sampled(affine).T, header)
        in_place_at(read_volume(tmp_path / "s.nrrd"), affine)

    def test_spacings_with_units(self, tmp_path: Path) -> None:
        header = {"spacings": [500.0, 700.0, 0.2], "units": ["um", "um", "cm"]}
        stored = sampled(np.diag([0.5, 0.7, 2.0, 1.0]))
        needed("nrrd").write(str(tmp_path / "s.nrrd"), stored.T, header)
        volume = read_volume(tmp_path / "s.nrrd")
        np.testing.assert_allclose(volume.affine, np.diag([0.5, 0.7, 2.0, 1.0]))
        np.testing.assert_array_equal(volume.voxels, stored)

    def test_layers_of_segments(self, tmp_path: Path) -> None:
        affine = AFFINES["axial"]
        place = indices_of((9, 9, 9)).reshape(9, 9, 9, 3)
        ball = np.linalg.norm(place - 4, axis=-1) < 4
        core = np.linalg.norm(place - 4, axis=-1) < 2
        header: dict[str, Any] = {
            "space": "left-posterior-superior", "kinds": ["list", "domain", "domain", "domain"],
            "space directions": np.vstack([np.full(3, np.nan), affine[:3, :3].T]), "space origin": affine[:3, 3],
        }  # fmt: skip
        for n, name in enumerate(("Ball", "Core")):
            header |= {f"Segment{n}_Name": name, f"Segment{n}_LabelValue": "1", f"Segment{n}_Layer": str(n)}
        needed("nrrd").write(str(tmp_path / "s.seg.nrrd"), np.stack([ball.T, core.T]).astype(np.uint8), header)
        for number, mask in ((1, ball), (2, core)):
            np.testing.assert_array_equal(read_volume(tmp_path / "s.seg.nrrd", select=[number]).voxels == number, mask)


class TestSimpleItk:
    @pytest.mark.parametrize("suffix", [".mha", ".mhd", ".nrrd", ".nhdr", ".nii.gz"])
    @pytest.mark.parametrize("packed", [False, True])
    def test_a_study(self, tmp_path: Path, suffix: str, packed: bool) -> None:
        affine = AFFINES["oblique"]
        path = tmp_path / f"s{suffix}"
        needed("SimpleITK").WriteImage(as_image(sampled(affine), affine), str(path), packed)
        in_place_at(read_volume(path), affine)

    @pytest.mark.parametrize("levels", [2, 200])
    def test_a_vector_of_three_bytes_is_a_color_where_it_is_no_mask(self, tmp_path: Path, levels: int) -> None:
        sitk, voxels = needed("SimpleITK"), np.arange(630, dtype=np.int64).reshape(5, 6, 7, 3) % levels
        sitk.WriteImage(
            sitk.GetImageFromArray(voxels.astype(np.uint8), isVector=True), path := str(tmp_path / "s.nrrd")
        )
        assert "kinds: vector" in (tmp_path / "s.nrrd").read_bytes()[:600].decode("ascii", "replace")
        if levels == 2:
            with pytest.raises(FormatError, match=r"several values a voxel.*3 of kind vector"):
                read_volume(path)
        else:
            expected = Volume.from_stored(voxels, np.eye(4)).voxels
            np.testing.assert_array_equal(read_volume(path).voxels, expected)


class TestZarr:
    @pytest.mark.parametrize("version", [2, 3])
    def test_a_plain_array_and_its_place(self, tmp_path: Path, version: int) -> None:
        affine = np.diag([0.5, 0.7, 2.0, 1.0])
        zarr, stored = needed("zarr"), sampled(affine)
        array = zarr.create_array(tmp_path / "s", shape=stored.shape, dtype="i2", chunks=(4, 4, 4), zarr_format=version)
        array[...] = stored
        volume = read_volume(tmp_path / "s", settings=MM)
        np.testing.assert_allclose(volume.voxels.ravel(), gray_at(volume.to_mm(indices_of(volume.shape))), atol=0.51)
