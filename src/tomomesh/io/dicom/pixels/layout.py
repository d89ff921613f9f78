"""How a DICOM file keeps its pixels: what its header says, checked before anything is read by it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from ....errors import FormatError
from ..headers.values import numbers

if TYPE_CHECKING:
    from ..headers.header import ImageFrame

ALLOCATED_BITS = {"PixelData": (1, 8, 16, 32, 64), "FloatPixelData": (32,), "DoubleFloatPixelData": (64,)}
"""Bits that an element may have for each number (PS3.3, C.7.6.3 and C.7.6.24)."""

SUBSAMPLED = "YBR_FULL_422"


@dataclass(frozen=True)
class PixelLayout:
    """Sizes and kind of the pixels in a file.

    Attributes
    ----------
    name : str
        The bare name of the file.
    syntax : pydicom UID
        Its transfer syntax.
    keyword : str
        The element that holds the pixels.
    frames, rows, columns, samples : int
        How many there are; samples 1 or 3.
    allocated, stored, high : int
        Bits of a sample's place, bits in use, and the highest of these.
    signed : bool
        Whether the numbers have a sign.
    planar : int
        1 where color is stored plane by plane.
    photometric : str
        What the numbers stand for.
    """

    name: str
    syntax: Any
    keyword: str
    frames: int
    rows: int
    columns: int
    samples: int
    allocated: int
    stored: int
    high: int
    signed: bool
    planar: int
    photometric: str

    @property
    def shape(self) -> tuple[int, ...]:
        """Sizes of a frame, (J, I) or (J, I, 3)."""
        return (self.rows, self.columns, 3) if self.samples == 3 else (self.rows, self.columns)

    @property
    def frame_bytes(self) -> int:
        """Bytes of a decoded frame."""
        return math.prod(self.shape) * max(self.allocated // 8, 1)

    @property
    def plain_bytes(self) -> int:
        """Bytes of all frames as they are stored without compression."""
        samples = 2 if self.samples == 3 and self.photometric == SUBSAMPLED else self.samples
        return -(-self.frames * self.rows * self.columns * samples * self.allocated // 8)

    def options(self) -> dict[str, Any]:
        """Return the same in the words of pydicom's decoders."""
        return {
            "number_of_frames": self.frames,
            "rows": self.rows,
            "columns": self.columns,
            "samples_per_pixel": self.samples,
            "bits_allocated": self.allocated,
            "bits_stored": self.stored,
            "pixel_representation": int(self.signed),
            "planar_configuration": self.planar,
            "photometric_interpretation": self.photometric,
            "pixel_keyword": self.keyword,
        }


def layout_of(frame: ImageFrame, keyword: str) -> PixelLayout:
    """Return how the file of a frame keeps its pixels in an element.

    Raises
    ------
    FormatError
        For sizes and bits that cannot be.
    """
    header, name = frame.header, frame.path.name

    def number(field: str, missing: int) -> int:
        value = numbers(header.get(field), 1, field, name)
        return missing if value is None else int(value[0])

    allocated = number("BitsAllocated", ALLOCATED_BITS[keyword][-1] if keyword != "PixelData" else 0)
    stored = number("BitsStored", allocated) if keyword == "PixelData" else allocated
    high, samples = number("HighBit", stored - 1), number("SamplesPerPixel", 1)
    _check("BitsAllocated", allocated, ALLOCATED_BITS[keyword], name)
    _check("BitsStored", stored, range(1, allocated + 1), name)
    _check("HighBit", high, range(stored - 1, allocated), name)
    _check("SamplesPerPixel", samples, (1, 3), name)
    return PixelLayout(
        name=name,
        syntax=syntax_of(header),
        keyword=keyword,
        frames=number("NumberOfFrames", 1),
        rows=frame.size[0],
        columns=frame.size[1],
        samples=samples,
        allocated=allocated,
        stored=stored,
        high=high,
        signed=number("PixelRepresentation", 0) == 1,
        planar=number("PlanarConfiguration", 0),
        photometric=str(header.get("PhotometricInterpretation") or ("RGB" if samples == 3 else "MONOCHROME2")),
    )


def syntax_of(header: Any) -> Any:
    """Return a header's transfer syntax; for files without one, that of their own encoding."""
    from pydicom.uid import ExplicitVRBigEndian, ExplicitVRLittleEndian, ImplicitVRLittleEndian

    implicit, little = header.original_encoding
    plain = ImplicitVRLittleEndian if implicit else ExplicitVRLittleEndian if little else ExplicitVRBigEndian
    return header.file_meta.get("TransferSyntaxUID") or plain


def _check(field: str, value: int, allowed: tuple[int, ...] | range, name: str) -> None:
    if value in allowed:
        return
    ends = f"{allowed[0]} to {allowed[-1]}" if isinstance(allowed, range) else " | ".join(map(str, allowed))
    raise FormatError("the pixels are laid out as they cannot be", file=name, found=f"{field} = {value}", expected=ends)
