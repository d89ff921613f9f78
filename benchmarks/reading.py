"""What does reading a volume cost, against the format's own library on the same file: CPU time, and memory."""

from __future__ import annotations

import argparse
import gzip
import subprocess
import sys
import tempfile
from functools import partial
from importlib import import_module
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, Any

import numpy as np

from bench import at_most, header, note

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

SHAPE = (200, 512, 512)
"""Slices, rows and columns: 105 MB of 16 bits."""

REPEATS = 5
MOST_TIME, MOST_MEMORY = 1.1, 2.2

IMPORTS = {
    "tomomesh": "from tomomesh.io import read_volume; from tomomesh.settings import ReadSettings",
    "nibabel": "import nibabel",
    "pynrrd": "import nrrd",
    "SimpleITK": "import SimpleITK",
    "tifffile": "import tifffile",
    "NumPy": "pass",
    "Pillow": "from PIL import Image",
    "zarr": "import zarr",
    "pydicom": "import pydicom",
}
"""What is imported before the clock starts; tomomesh's own lazy imports are made by reading a small file first."""

READS = {
    "tomomesh": "read_volume(path, settings=ReadSettings(spacing=(1.0, 1.0, 1.0))).voxels",
    "nibabel": "numpy.asanyarray(nibabel.load(path, **({} if path.endswith('z') else {'mmap': False})).dataobj)",
    "pynrrd": "nrrd.read(path)[0]",
    "SimpleITK": "SimpleITK.GetArrayFromImage(SimpleITK.ReadImage(path))",
    "tifffile": "tifffile.imread(path)",
    "NumPy": "numpy.load(path)",
    "Pillow": "numpy.stack([numpy.asarray(Image.open(one)) for one in sorted(pathlib.Path(path).iterdir())])",
    "pydicom": "numpy.stack([pydicom.dcmread(one).pixel_array for one in sorted(pathlib.Path(path).iterdir())])",
    "zarr": "zarr.open_group(path, mode='r')['0'][...]",
}

PROGRAM = """
import pathlib, re, resource, sys, time, warnings, numpy
warnings.simplefilter("ignore")
small, path = sys.argv[1:]
{imports}
def read(path):
    return {read}
def peak():  # of this process alone; getrusage() would count its parent's
    return 1024 * int(re.search(r"VmHWM:\\s*(\\d+)", pathlib.Path("/proc/self/status").read_text())[1])
def spent():  # the child, in which compressed pixels are decoded, too
    return sum(sum(resource.getrusage(whose)[:2]) for whose in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
read(small)
before = peak()
start = spent()
voxels = read(path)
seconds = spent() - start
print(seconds, (peak() - before) / voxels.nbytes)
"""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("only", nargs="*", help="cases, by the first words of their names; all where none is given")
    only = tuple(parser.parse_args().only)
    header(f"Reading {' x '.join(map(str, SHAPE))} voxels of 16 bits", "nibabel", "pynrrd", "SimpleITK", "zarr")
    compare_all(only)


def compare_all(only: tuple[str, ...] = ()) -> None:
    """Print the rows of all cases, or of those whose names begin so."""
    for write, *peers in (case for case in CASES if not only or case[0].__doc__.startswith(only)):
        with tempfile.TemporaryDirectory() as folder:
            rng = np.random.default_rng(0)
            small = write(Path(folder), "small", _head((4, 8, 8), rng))
            large = write(Path(folder), "large", _head(SHAPE, rng))
            _compare(write.__doc__ or "", small, large, peers)


def _head(shape: tuple[int, int, int], rng: np.random.Generator) -> NDArray[np.int16]:
    """Return noise on a smooth ball, which packs about as well as a CT does."""
    away = sum((np.linspace(-1, 1, size) ** 2).reshape([-1 if n == axis else 1 for n in range(3)])
               for axis, size in enumerate(shape))  # fmt: skip
    return np.asarray(1000 * (away < 0.8) + rng.integers(0, 40, shape), np.int16)


def _compare(name: str, small: Path, large: Path, peers: list[str]) -> None:
    names = ["tomomesh", *peers]
    rounds = [[_once(one, small, large) for one in names] for _ in range(REPEATS)]
    seconds, memory = ([median(turn[n][part] for turn in rounds) for n in range(len(names))] for part in (0, 1))
    note(f"{name}: tomomesh", f"{1e3 * seconds[0]:.0f} ms")
    for n, peer in enumerate(peers, 1):
        at_most(f"{name}: CPU time over {peer}'s", seconds[0] / seconds[n], MOST_TIME, "x")
    told = ", ".join(f"{peer} {held:.2f}" for peer, held in zip(peers, memory[1:], strict=True))
    at_most(f"{name}: memory over the volume ({told})", memory[0], MOST_MEMORY, "x")


def _once(reader: str, small: Path, large: Path) -> tuple[float, float]:
    """Read in a process of its own; return seconds, and what its peak memory grew by over the volume's size."""
    program = PROGRAM.format(imports=IMPORTS[reader], read=READS[reader])
    done = subprocess.run(
        [sys.executable, "-c", program, str(small), str(large)], check=True, capture_output=True, text=True
    )
    seconds, held = done.stdout.split()
    return float(seconds), float(held)


def nifti(folder: Path, name: str, voxels: NDArray[Any], *, packed: bool = False, scaled: bool = False) -> Path:
    import nibabel

    image = nibabel.Nifti1Image(voxels.T, np.eye(4))
    if scaled:
        image.header.set_slope_inter(0.5, -1000)
    raw = bytearray(image.to_bytes())
    if scaled:
        raw[112:120] = np.array([0.5, -1000], "<f4").tobytes()
    path = folder / f"{name}.nii{'.gz' if packed else ''}"
    path.write_bytes(gzip.compress(raw, 1) if packed else bytes(raw))
    return path


def mgz(folder: Path, name: str, voxels: NDArray[Any]) -> Path:
    import nibabel

    path = folder / f"{name}.mgz"
    path.write_bytes(gzip.compress(nibabel.MGHImage(voxels.T, np.eye(4)).to_bytes(), 1))
    return path


def itk(folder: Path, name: str, voxels: NDArray[Any], *, suffix: str, packed: bool = False) -> Path:
    kit: Any = import_module("SimpleITK")
    path = folder / f"{name}{suffix}"
    image = kit.GetImageFromArray(voxels)
    image.SetSpacing((1.0, 1.0, 1.1))
    kit.WriteImage(image, str(path), packed)
    return path


def npy(folder: Path, name: str, voxels: NDArray[Any]) -> Path:
    np.save(folder / f"{name}.npy", voxels)
    return folder / f"{name}.npy"


def tiff(folder: Path, name: str, voxels: NDArray[Any], *, packed: str | None = None) -> Path:
    import tifffile

    path = folder / f"{name}.tif"
    tifffile.imwrite(path, voxels, photometric="minisblack", metadata=None, compression=packed)
    return path


def png(folder: Path, name: str, voxels: NDArray[Any]) -> Path:
    from PIL import Image

    (folder / name).mkdir()
    for k, pixels in enumerate(voxels.astype(np.uint16)):
        Image.fromarray(pixels).save(folder / name / f"{k:04d}.png", compress_level=1)
    return folder / name


def dicom(folder: Path, name: str, voxels: NDArray[Any], *, packed: str = "") -> Path:
    from pydicom import Dataset, uid
    from pydicom.dataset import FileMetaDataset

    (folder / name).mkdir()
    for k, pixels in enumerate(voxels):
        data = Dataset()
        data.file_meta = FileMetaDataset()
        data.file_meta.TransferSyntaxUID = uid.ExplicitVRLittleEndian
        data.SOPClassUID, data.SOPInstanceUID = uid.CTImageStorage, f"1.2.3.{k + 1}"
        data.StudyInstanceUID = data.SeriesInstanceUID = data.FrameOfReferenceUID = "1.2.3"
        data.Modality, data.InstanceNumber = "CT", k + 1
        data.ImageOrientationPatient, data.ImagePositionPatient = [1, 0, 0, 0, 1, 0], [0, 0, k]
        data.PixelSpacing, data.RescaleSlope, data.RescaleIntercept = [1, 1], 1, 0
        data.Rows, data.Columns, data.SamplesPerPixel = *pixels.shape, 1
        data.BitsAllocated, data.BitsStored, data.HighBit, data.PixelRepresentation = 16, 16, 15, 1
        data.PhotometricInterpretation, data.PixelData = "MONOCHROME2", pixels.tobytes()
        if packed:
            data.compress(packed, generate_instance_uid=False)
        data.save_as(folder / name / f"{k:04d}.dcm", enforce_file_format=True)
    return folder / name


def ome_zarr(folder: Path, name: str, voxels: NDArray[Any], *, zarr_format: int) -> Path:
    library: Any = import_module("zarr")
    path = folder / f"{name}.zarr"
    steps = [{"type": "scale", "scale": [1.0, 1.0, 1.0]}]
    axes = [{"name": axis, "type": "space", "unit": "millimeter"} for axis in "zyx"]
    images = [{"axes": axes, "datasets": [{"path": "0", "coordinateTransformations": steps}]}]
    group = library.open_group(path, mode="w", zarr_format=zarr_format)
    group.attrs.update({"multiscales": images, "ome": {"version": "0.5", "multiscales": images}})
    group.create_array("0", shape=voxels.shape, dtype=voxels.dtype, chunks=(64, 128, 128))[...] = voxels
    return path


def _named(name: str, write: Callable[..., Path], **more: Any) -> Any:
    case: Any = partial(write, **more)
    case.__doc__ = name
    return case


CASES: list[tuple[Any, ...]] = [
    (_named("NIfTI", nifti), "nibabel", "SimpleITK"),
    (_named("NIfTI, gzip", nifti, packed=True), "nibabel", "SimpleITK"),
    (_named("NIfTI, scaled", nifti, scaled=True), "nibabel", "SimpleITK"),
    (_named("MGZ", mgz), "nibabel"),
    (_named("NRRD", itk, suffix=".nrrd"), "pynrrd", "SimpleITK"),
    (_named("NRRD, gzip", itk, suffix=".nrrd", packed=True), "pynrrd", "SimpleITK"),
    (_named("MetaImage", itk, suffix=".mha"), "SimpleITK"),
    (_named("MetaImage, zlib", itk, suffix=".mha", packed=True), "SimpleITK"),
    (_named("TIFF", tiff), "tifffile"),
    (_named("TIFF, deflate", tiff, packed="zlib"), "tifffile"),
    (_named("NPY", npy), "NumPy"),
    (_named("PNG slices", png), "Pillow"),
    (_named("DICOM", dicom), "pydicom"),
    (_named("DICOM, RLE", dicom, packed="1.2.840.10008.1.2.5"), "pydicom"),
    (_named("DICOM, JPEG-LS", dicom, packed="1.2.840.10008.1.2.4.80"), "pydicom"),
    (_named("OME-Zarr, blosc", ome_zarr, zarr_format=2), "zarr"),
    (_named("OME-Zarr, zstd", ome_zarr, zarr_format=3), "zarr"),
]
"""How a volume is written, and who else reads it."""


if __name__ == "__main__":
    main()
