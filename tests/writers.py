"""Volumes written by the formats' own libraries, for the readers to be judged by."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import nibabel
import numpy as np
import pytest
from PIL import Image

from studies import LPS_TO_RAS, write_series

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from numpy.typing import NDArray

    from tomomesh.model.volume import Volume

    Writer = Callable[[Path, NDArray[Any], NDArray[np.float64]], Path]
    """Writes an array (K, J, I) with its affine, LPS millimeters, into a folder, and returns what to read."""


def needed(name: str) -> Any:
    """Return a package; skip the test where it is not installed."""
    return pytest.importorskip(name, reason=f"the package {name} is not installed", exc_type=ImportError)


def as_image(stored: NDArray[Any], affine: NDArray[np.float64]) -> Any:
    """Return SimpleITK's image of an array (K, J, I)."""
    image = needed("SimpleITK").GetImageFromArray(stored)
    spacing = np.linalg.norm(affine[:3, :3], axis=0)
    image.SetSpacing(spacing.tolist())
    image.SetDirection((affine[:3, :3] / spacing).ravel().tolist())
    image.SetOrigin(affine[:3, 3].tolist())
    return image


def assert_agrees(volume: Volume, image: Any) -> None:
    """Compare voxels and places with SimpleITK's."""
    np.testing.assert_array_equal(volume.grid.restore(volume.voxels), needed("SimpleITK").GetArrayViewFromImage(image))
    affine = np.eye(4)
    affine[:3, :3] = np.array(image.GetDirection()).reshape(3, 3) * image.GetSpacing()
    affine[:3, 3] = image.GetOrigin()
    np.testing.assert_allclose(volume.grid.affine, affine, atol=1e-4)


def with_itk(suffix: str, packed: bool = False) -> Writer:
    """Return a writer by SimpleITK; detached formats put the voxels beside the header."""

    def write(folder: Path, stored: NDArray[Any], affine: NDArray[np.float64]) -> Path:
        needed("SimpleITK").WriteImage(as_image(stored, affine), str(folder / f"study{suffix}"), packed)
        return folder / f"study{suffix}"

    return write


def with_nibabel(suffix: str) -> Writer:
    """Return a writer by nibabel: MGH, NIfTI, or a NIfTI pair for ``.hdr``."""
    kinds = {".mgh": nibabel.MGHImage, ".mgz": nibabel.MGHImage, ".hdr": nibabel.Nifti1Pair}

    def write(folder: Path, stored: NDArray[Any], affine: NDArray[np.float64]) -> Path:
        image = kinds.get(suffix, nibabel.Nifti1Image)(stored.T, LPS_TO_RAS @ affine)
        nibabel.save(image, folder / f"study{suffix}")
        return folder / f"study{suffix}"

    return write


def with_qform(folder: Path, stored: NDArray[Any], affine: NDArray[np.float64]) -> Path:
    """Write a NIfTI file that has a qform alone."""
    image = nibabel.Nifti1Image(stored.T, None)
    image.header.set_qform(LPS_TO_RAS @ affine, code=1)
    nibabel.save(image, folder / "study.nii")
    return folder / "study.nii"


def with_pynrrd(suffix: str) -> Writer:
    """Return a writer by pynrrd, which keeps sheared axes."""

    def write(folder: Path, stored: NDArray[Any], affine: NDArray[np.float64]) -> Path:
        header = {"space": "LPS", "space directions": affine[:3, :3].T, "space origin": affine[:3, 3]}
        needed("nrrd").write(str(folder / f"study{suffix}"), stored.T, header)
        return folder / f"study{suffix}"

    return write


def with_pydicom(folder: Path, stored: NDArray[Any], affine: NDArray[np.float64]) -> Path:
    """Write a series whose files are named out of order."""
    return write_series(folder / "series", stored, affine)


def with_numpy(folder: Path, stored: NDArray[Any], affine: NDArray[np.float64]) -> Path:
    """Write an array without a place."""
    np.save(folder / "study.npy", stored)
    return folder / "study.npy"


def with_pillow(suffix: str) -> Writer:
    """Return a writer of a folder of slices, without a place."""

    def write(folder: Path, stored: NDArray[Any], affine: NDArray[np.float64]) -> Path:
        more: dict[str, Any] = {"quality": 100} if suffix == ".jpg" else {}
        for k, pixels in enumerate(stored):
            Image.fromarray(pixels).save(folder / f"slice{k}{suffix}", **more)
        return folder

    return write


def with_tifffile(folder: Path, stored: NDArray[Any], affine: NDArray[np.float64]) -> Path:
    """Write pages without a place."""
    needed("tifffile").imwrite(folder / "study.tif", stored, photometric="minisblack", metadata=None)
    return folder / "study.tif"


def with_ome_tiff(folder: Path, stored: NDArray[Any], affine: NDArray[np.float64]) -> Path:
    """Write pages with their distances, and without directions."""
    told: dict[str, Any] = {"axes": "ZYX"}
    for axis, size in zip("XYZ", np.diag(affine)[:3].tolist(), strict=True):
        told |= {f"PhysicalSize{axis}": size, f"PhysicalSize{axis}Unit": "mm"}
    needed("tifffile").imwrite(folder / "study.ome.tif", stored, metadata=told)
    return folder / "study.ome.tif"


def with_zarr(zarr_format: int) -> Writer:
    """Return a writer of OME-Zarr 0.4 (Zarr format 2) or 0.5 (format 3), which has scales and an offset alone."""

    def write(folder: Path, stored: NDArray[Any], affine: NDArray[np.float64]) -> Path:
        scale, offset = np.diag(affine)[2::-1].tolist(), affine[2::-1, 3].tolist()
        steps = [{"type": "scale", "scale": scale}, {"type": "translation", "translation": offset}]
        axes = [{"name": name, "type": "space", "unit": "millimeter"} for name in "zyx"]
        images = [{"axes": axes, "datasets": [{"path": "0", "coordinateTransformations": steps}]}]
        group = needed("zarr").open_group(folder / "study.zarr", mode="w", zarr_format=zarr_format)
        group.attrs.update({"ome": {"version": "0.5", "multiscales": images}, "multiscales": images})
        group.create_array("0", shape=stored.shape, dtype=stored.dtype, chunks=(16, 16, 16))[...] = stored
        return folder / "study.zarr"

    return write
