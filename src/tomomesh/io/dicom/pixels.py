"""Stored pixels of a DICOM file."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import FormatError
from ..limits import require_bytes, require_memory
from ..source import third_party

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from .header import Frame

PIXEL_FIELDS = ("PixelData", "FloatPixelData", "DoubleFloatPixelData")


class Decoder:
    """Decode frames, and remember the last file for its other frames."""

    def __init__(self) -> None:
        self._path: Path | None = None
        self._frames: NDArray[Any] = np.empty(0)

    def __call__(self, frame: Frame) -> NDArray[Any]:
        """Return a frame's stored numbers, (J, I) or (J, I, 3).

        Raises
        ------
        FormatError
            For pixels that are missing, cut off, of a wrong sign or compression.
        ResourceError
            Where they do not fit into the memory.
        """
        if self._path != frame.path:
            self._frames, self._path = _decoded(frame), frame.path
        return np.asarray(self._frames[frame.number])


def _decoded(frame: Frame) -> NDArray[Any]:
    """Return all frames of a file, (frames, J, I) or (frames, J, I, 3)."""
    import pydicom
    from pydicom.pixels import pixel_array

    name = frame.path.name
    with third_party("pydicom", name):
        data = pydicom.dcmread(frame.path, force=True)
        _check_kind(data, name)
        _check_length(data, frame, name)
        pixels = pixel_array(data, correct_unused_bits=False)  # they tell of overlays and of wrong signs
    count = int(data.get("NumberOfFrames") or 1)
    shape = (count, *frame.size, *([3] if int(data.get("SamplesPerPixel") or 1) == 3 else []))
    if pixels.size != np.prod(shape):
        raise FormatError(
            "the pixels do not match the header",
            file=name,
            found=f"pixels = {pixels.shape}",
            expected=f"{shape}",
        )
    pixels = _masked(pixels.reshape(shape), data, name)
    return _upright_gray(pixels, data)


def _check_kind(data: Any, name: str) -> None:
    photometric = str(data.get("PhotometricInterpretation", ""))
    if photometric == "PALETTE COLOR" or "ModalityLUTSequence" in data:
        raise FormatError(
            "the gray levels are behind a table that cannot be read",
            file=name,
            found=f"PhotometricInterpretation = {photometric}",
            expected="MONOCHROME or RGB with a linear scale",
        )
    if not any(field in data for field in PIXEL_FIELDS):
        raise FormatError("the file holds no pixels", file=name, found="PixelData = missing", hint="a fresh copy")
    _check_compression(data, name)


def _check_compression(data: Any, name: str) -> None:
    from pydicom.pixels import get_decoder
    from pydicom.uid import ImplicitVRLittleEndian

    syntax = data.file_meta.get("TransferSyntaxUID", ImplicitVRLittleEndian)
    data.file_meta.TransferSyntaxUID = syntax
    try:
        known = get_decoder(syntax).is_available
    except NotImplementedError:
        known = False
    if not known:
        raise FormatError(
            "the compression of the pixels cannot be decoded",
            file=name,
            found=f"TransferSyntaxUID = {syntax.name}",
            hint=f"pip install {_package(syntax.name)}",
        )


def _package(syntax: str) -> str:
    """Name the package from which pydicom learns to decode a transfer syntax."""
    return "pylibjpeg pylibjpeg-openjpeg" if "High-Throughput" in syntax else "python-gdcm"


def _check_length(data: Any, frame: Frame, name: str) -> None:
    """Compare the pixels promised with those held: pydicom itself reads the wrong frames in silence."""
    bits, samples = int(data.BitsAllocated), int(data.get("SamplesPerPixel") or 1)
    row = frame.size[1] * samples * max(bits, 8) // 8
    promised = row * frame.size[0] * int(data.get("NumberOfFrames") or 1)
    require_memory(promised, file=name)
    if data.file_meta.TransferSyntaxUID.is_compressed or "YBR" in str(data.get("PhotometricInterpretation")):
        return
    held = len(next(data[field].value for field in PIXEL_FIELDS if field in data))
    require_bytes(promised, held if bits >= 8 else 8 * held, file=name)
    if bits >= 8 and held - promised >= max(row, 2):
        raise FormatError(
            "the file holds more pixels than its header promises",
            file=name,
            found=f"data = {held} bytes",
            expected=f"{promised} bytes for Rows x Columns",
        )


def _masked(pixels: NDArray[Any], data: Any, name: str) -> NDArray[Any]:
    """Clear the bits that are no part of the gray level; they may hold overlays.

    Raises
    ------
    FormatError
        Where they repeat the sign: signed numbers that the header calls unsigned.
    """
    allocated, used = int(data.BitsAllocated), int(data.get("BitsStored") or data.BitsAllocated)
    if pixels.dtype.kind not in "iu" or not 0 < used < allocated or allocated != 8 * pixels.dtype.itemsize:
        return pixels
    spare = allocated - used
    if pixels.dtype.kind == "i":
        return np.asarray((pixels << spare) >> spare)
    upper = pixels >> used
    if upper.any() and set(np.unique(upper).tolist()) <= {0, 2**spare - 1} and not _overlays(data):
        raise FormatError(
            "negative gray levels are stored as unsigned",
            file=name,
            found=f"PixelRepresentation = 0, BitsStored = {used}",
            expected="PixelRepresentation = 1",
            hint="a corrected header",
        )
    return np.asarray(pixels & pixels.dtype.type(2**used - 1))


def _overlays(data: Any) -> bool:
    """Tell whether overlays are kept in the spare bits of the pixels."""
    return any((group, 0x0102) in data and data[group, 0x0102].value for group in range(0x6000, 0x6020, 2))


def _upright_gray(pixels: NDArray[Any], data: Any) -> NDArray[Any]:
    """Turn MONOCHROME1 over, so that bright is high; the numbers of a CT mean something: they stay."""
    if data.get("PhotometricInterpretation") != "MONOCHROME1" or data.get("Modality") == "CT":
        return pixels
    bits = int(data.get("BitsStored") or 8 * pixels.dtype.itemsize)
    if pixels.dtype.kind == "i":
        return np.asarray(-1 - pixels)
    if pixels.dtype.kind == "u":
        return np.asarray(pixels.dtype.type(2**bits - 1) - pixels)
    return np.asarray(pixels.max() - pixels)
