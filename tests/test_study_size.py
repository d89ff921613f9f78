"""What a study will take is known from its headers: the bytes of its voxels as they are read, and none is read."""

from __future__ import annotations

import gzip
from typing import TYPE_CHECKING, Any

import nibabel
import numpy as np
import pytest
from PIL import Image

from studies import write_nifti, write_series
from tomomesh.io import find_studies, read_volume, voxel_bytes
from tomomesh.settings import ReadSettings

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

SETTINGS = ReadSettings(spacing=(1.0, 1.0, 1.0))
VOXELS = np.arange(6 * 7 * 8, dtype=np.int16).reshape(6, 7, 8)


def _nifti(folder: Path) -> None:
    write_nifti(folder / "a.nii", VOXELS, np.eye(4))


def _packed(folder: Path) -> None:
    nibabel.save(nibabel.Nifti1Image(np.zeros((60, 70, 80), np.float32), np.eye(4)), folder / "a.nii.gz")


def _nrrd(folder: Path) -> None:
    head = "NRRD0004\ntype: int16\ndimension: 3\nsizes: 8 7 6\nencoding: gzip\nendian: little\nspacings: 1 1 1\n\n"
    (folder / "a.nrrd").write_bytes(head.encode() + gzip.compress(VOXELS.tobytes()))


def _metaimage(folder: Path) -> None:
    lines = ["NDims = 3", "DimSize = 8 7 6", "ElementType = MET_SHORT", "ElementDataFile = LOCAL", ""]
    (folder / "a.mha").write_bytes("\n".join(lines).encode() + VOXELS.tobytes())


def _npy(folder: Path) -> None:
    np.save(folder / "a.npy", VOXELS)


def _mgh(folder: Path) -> None:
    nibabel.save(nibabel.MGHImage(VOXELS, np.eye(4)), folder / "a.mgz")


def _dicom(folder: Path) -> None:
    write_series(folder / "a", VOXELS, np.eye(4))


def _tiff(folder: Path) -> None:
    pytest.importorskip("tifffile").imwrite(folder / "a.tif", VOXELS, compression="zlib", photometric="minisblack")


def _zarr(folder: Path) -> None:
    array: Any = pytest.importorskip("zarr").create_array(
        folder / "a.zarr", shape=VOXELS.shape, dtype="int16", chunks=(2, 4, 4), dimension_names=("z", "y", "x")
    )
    array[:] = VOXELS


HEADER: dict[object, int] = {_nifti: 352, _packed: 352, _mgh: 284}
"""Bytes in front of the voxels, of formats that count them."""


@pytest.mark.parametrize("write", [_nifti, _packed, _nrrd, _metaimage, _npy, _mgh, _dicom, _tiff, _zarr])
def test_as_many_as_are_read(write: Callable[[Path], None], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write(tmp_path)
    (study,) = find_studies(tmp_path)
    read = read_volume(study.path, settings=SETTINGS).voxels.nbytes
    with monkeypatch.context() as patched:
        patched.setattr("tomomesh.io.files.limits.physical_memory", lambda: 1)  # whoever asked would be refused
        assert voxel_bytes(study, SETTINGS) - read in (0, HEADER.get(write, 0))


def test_slices_of_pictures_are_no_fewer(tmp_path: Path) -> None:
    (tmp_path / "a").mkdir()
    for k in range(3):
        Image.fromarray(np.full((40, 50), k, np.uint8)).save(tmp_path / "a" / f"{k}.png")
    (study,) = find_studies(tmp_path)
    assert 3 * 40 * 50 <= voxel_bytes(study, SETTINGS) <= 4 * 3 * 40 * 50


def test_a_broken_study_is_as_large_as_its_file(tmp_path: Path) -> None:
    (tmp_path / "a.nii").write_bytes(b"no image")
    (study,) = find_studies(tmp_path)
    assert voxel_bytes(study, SETTINGS) == 8


def test_the_next_study_is_read(tmp_path: Path) -> None:
    _nifti(tmp_path)
    (study,) = find_studies(tmp_path)
    voxel_bytes(study, SETTINGS)
    assert read_volume(study.path).voxels.shape == VOXELS.shape
