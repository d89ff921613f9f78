"""Stored numbers of a frame to what they mean: bits in use, tables, bright as high."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ....errors import FormatError
from .tables import PALETTE, modality_levels, palette_colors

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .layout import PixelLayout

INVERTED = "MONOCHROME1"

MEANINGS = {"MONOCHROME2": 1, INVERTED: 1, PALETTE: 1, "RGB": 3}
"""What decoded numbers may stand for, and how many a pixel has."""


def levels(pixels: NDArray[Any], photometric: str, layout: PixelLayout, header: Any) -> NDArray[Any]:
    """Return the gray levels (J, I) or colors (J, I, 3) of a frame, before their scale.

    Parameters
    ----------
    pixels : array
        Stored numbers.
    photometric : str
        What they stand for after decoding.
    layout : PixelLayout
        The bits that are in use.
    header : pydicom Dataset
        It holds the tables.

    Raises
    ------
    FormatError
        For colors of another kind, and negative gray levels that the header calls unsigned.
    """
    if MEANINGS.get(photometric) != layout.samples:
        raise FormatError(
            "the pixels are of a kind that cannot be read",
            file=layout.name,
            found=f"PhotometricInterpretation = {photometric}, SamplesPerPixel = {layout.samples}",
            expected=" | ".join(MEANINGS),
        )
    stored = masked(pixels, layout, overlays=_overlays(header))
    if photometric == PALETTE:
        return palette_colors(stored, header, name=layout.name)
    gray = modality_levels(stored, header, name=layout.name)
    if photometric == INVERTED and header.get("Modality") != "CT":
        return _turned(gray, 8 * gray.itemsize if "ModalityLUTSequence" in header else layout.stored)
    return gray


def masked(pixels: NDArray[Any], layout: PixelLayout, *, overlays: bool) -> NDArray[Any]:
    """Clear the bits that are no part of the gray level; they may hold overlays.

    Raises
    ------
    FormatError
        Where they repeat the sign: signed numbers that the header calls unsigned.
    """
    below, spare = layout.high + 1 - layout.stored, layout.allocated - layout.stored
    if pixels.dtype.kind not in "iu" or spare == 0 or layout.allocated != 8 * pixels.dtype.itemsize:
        return pixels
    if pixels.dtype.kind == "i":
        return np.asarray((pixels << (spare - below)) >> spare)
    if below == 0 and int(pixels.max()) >> layout.stored == 0:
        return pixels
    upper = pixels >> (layout.stored + below)
    if upper.any() and not overlays and set(np.unique(upper).tolist()) <= {0, 2 ** (spare - below) - 1}:
        raise FormatError(
            "negative gray levels are stored as unsigned",
            file=layout.name,
            found=f"PixelRepresentation = 0, BitsStored = {layout.stored}",
            expected="PixelRepresentation = 1",
            hint="a corrected header",
        )
    return np.asarray((pixels >> below) & pixels.dtype.type(2**layout.stored - 1))


def _overlays(header: Any) -> bool:
    """Tell whether overlays are kept in the spare bits of the pixels."""
    return any((group, 0x0102) in header and header[group, 0x0102].value for group in range(0x6000, 0x6020, 2))


def _turned(gray: NDArray[Any], bits: int) -> NDArray[Any]:
    """Turn MONOCHROME1 over, so that bright is high; the numbers of a CT mean something: they stay."""
    if gray.dtype.kind == "i":
        return np.asarray(-1 - gray)
    return np.asarray(-gray if gray.dtype.kind == "f" else gray.dtype.type(2**bits - 1) - gray)
