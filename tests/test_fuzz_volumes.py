"""Every reader of volumes, on damaged bytes: a result, or one line with exit code 4 to 7."""

from __future__ import annotations

import bz2
import gzip
import zlib
from typing import TYPE_CHECKING

import nibabel
import numpy as np
import pydicom
import pytest
from PIL import Image

from fuzz import PEAK_BYTES, fuzz
from studies import AFFINES, LPS_TO_RAS, enhanced, sampled, save, slice_dataset, write_nifti
from tomomesh.errors import TomomeshError
from tomomesh.io import open_study, read_volume
from tomomesh.model.lazy import in_memory
from tomomesh.settings import ReadSettings

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from tomomesh.model.volume import Volume

AFFINE = AFFINES["oblique"]
STORED = sampled(AFFINE)
PIXELS = STORED.astype(np.uint16)
SETTINGS = ReadSettings(spacing=(1, 1, 1), spacing_z=1)
NRRD = (
    "NRRD0005\ntype: short\ndimension: 3\nspace: left-posterior-superior\nsizes: 9 7 5\n"
    "space directions: (0.5,0,0) (0,0.7,0) (0,0,2)\nendian: little\nencoding: {}\nspace origin: (-3,11,40)\n{}\n"
)
META = (
    "ObjectType = Image\nNDims = 3\nDimSize = 9 7 5\nElementType = MET_SHORT\nElementSpacing = 0.5 0.7 2\n"
    "Offset = -3 11 40\nTransformMatrix = 1 0 0 0 1 0 0 0 1\nCompressedData = {}\nElementDataFile = {}\n"
)


def nifti(path: Path) -> None:
    write_nifti(path, STORED, AFFINE)


def packed_nifti(path: Path) -> None:
    path.write_bytes(gzip.compress(nibabel.Nifti1Image(STORED.T, LPS_TO_RAS @ AFFINE).to_bytes(), mtime=0))


def nifti2(path: Path) -> None:
    path.write_bytes(nibabel.Nifti2Image(STORED.T, LPS_TO_RAS @ AFFINE).to_bytes())


def mgh(path: Path) -> None:
    raw = nibabel.MGHImage(STORED.T, LPS_TO_RAS @ AFFINE).to_bytes()
    path.write_bytes(gzip.compress(raw, mtime=0) if path.suffix == ".mgz" else raw)


def nrrd(encoding: str, pack: Callable[[bytes], bytes], more: str = "") -> Callable[[Path], None]:
    def write(path: Path) -> None:
        (path.parent / "beside.raw").write_bytes(STORED.tobytes())
        path.write_bytes(NRRD.format(encoding, more).encode() + (b"" if more else pack(STORED.tobytes())))

    return write


def meta(compressed: bool, named: str = "LOCAL") -> Callable[[Path], None]:
    def write(path: Path) -> None:
        (path.parent / "beside.raw").write_bytes(STORED.tobytes())
        data = zlib.compress(STORED.tobytes()) if compressed else STORED.tobytes()
        path.write_bytes(META.format(compressed, named).encode() + (data if named == "LOCAL" else b""))

    return write


def npy(path: Path) -> None:
    np.save(path, STORED)


def pages(path: Path) -> None:
    first, *others = [Image.fromarray(page) for page in PIXELS]
    first.save(path, save_all=True, append_images=others)


def one_picture(path: Path) -> None:
    Image.fromarray(PIXELS[0].astype(np.uint8) if path.suffix == ".jpg" else PIXELS[0]).save(path)


def dicom(path: Path) -> None:
    save(slice_dataset(STORED[0], AFFINE, 0), path)


def frames(path: Path) -> None:
    save(enhanced(STORED, AFFINE, [0, 1, 2, 3, 4]), path)


def run_lengths(path: Path) -> None:
    data = slice_dataset(STORED[0], AFFINE, 0)
    data.compress(pydicom.uid.RLELossless, generate_instance_uid=False)
    save(data, path)


def jpeg_ls(path: Path) -> None:
    pytest.importorskip("jpeg_ls", reason="the package pyjpegls is not installed")
    data = slice_dataset(PIXELS[0], AFFINE, 0)
    data.compress(pydicom.uid.JPEGLSLossless, generate_instance_uid=False)
    save(data, path)


FILES: dict[str, Callable[[Path], None]] = {
    "a.nii": nifti,
    "a.nii.gz": packed_nifti,
    "two.nii": nifti2,
    "a.mgh": mgh,
    "a.mgz": mgh,
    "a.nrrd": nrrd("raw", bytes),
    "gzip.nrrd": nrrd("gzip", lambda data: gzip.compress(data, mtime=0)),
    "bzip2.nrrd": nrrd("bzip2", bz2.compress),
    "text.nrrd": nrrd("ascii", lambda data: " ".join(map(str, STORED.ravel())).encode()),
    "a.nhdr": nrrd("raw", bytes, "data file: beside.raw\n"),
    "a.mha": meta(False),
    "zlib.mha": meta(True),
    "a.mhd": meta(False, "beside.raw"),
    "a.npy": npy,
    "a.tif": pages,
    "slices/a.png": one_picture,
    "slices/a.tif": one_picture,
    "slices/a.jpg": one_picture,
    "slice.dcm": dicom,
    "frames.dcm": frames,
    "rle.dcm": run_lengths,
    "jpeg-ls.dcm": jpeg_ls,
}


def study(path: Path) -> Path:
    return path.parent if path.parent.name == "slices" else path


def read(path: Path) -> Volume:
    return read_volume(study(path), settings=SETTINGS)


def read_in_parts(path: Path) -> None:
    """Open a file and read what it holds: the same voxels as read whole, or a fault as there."""
    try:
        whole = read(path)
    except TomomeshError:
        whole = None
    found = in_memory(open_study(study(path), SETTINGS).voxels)
    assert whole is not None
    np.testing.assert_array_equal(found, whole.voxels, strict=True)


@pytest.mark.parametrize("way", [read, read_in_parts])
@pytest.mark.parametrize("name", FILES)
def test_damage_ends_in_a_result_or_in_one_line(tmp_path: Path, name: str, way: Callable[[Path], object]) -> None:
    if name == "a.tif":
        pytest.importorskip("tifffile", reason="the package tifffile is not installed")
    path = tmp_path / name
    path.parent.mkdir(exist_ok=True)
    FILES[name](path)
    fuzz(way, path, most=PEAK_BYTES)
