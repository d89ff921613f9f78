"""Pixels without compression, read frame by frame from their place in the file."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np

from ....errors import FormatError
from ...files.limits import require_bytes

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..headers.element import PixelElement
    from .layout import PixelLayout

NATIVE = {"1.2.840.10008.1.2", "1.2.840.10008.1.2.1", "1.2.840.10008.1.2.1.99", "1.2.840.10008.1.2.2"}
"""Transfer syntaxes without compression of the pixels: implicit, explicit, deflated as a whole, big-endian."""


def check_native(element: PixelElement, layout: PixelLayout) -> None:
    """Compare the bytes that a header promises with those of the element.

    Raises
    ------
    FormatError
        Where there are fewer, or a row more.
    """
    if element.encapsulated:
        raise FormatError(
            "the pixels are compressed, and the header says that they are not",
            file=layout.name,
            found=f"TransferSyntaxUID = {layout.syntax.name}",
            hint="a corrected header",
        )
    promised, available = layout.plain_bytes, element.available
    require_bytes(promised, available, file=layout.name)
    if available - promised >= max(promised // (layout.frames * layout.rows), 2):
        raise FormatError(
            "the file holds more pixels than its header promises",
            file=layout.name,
            found=f"data = {available} bytes",
            expected=f"{promised} bytes for Rows x Columns",
        )


def read_native(file: BinaryIO, element: PixelElement, layout: PixelLayout, number: int) -> tuple[NDArray[Any], str]:
    """Return the stored numbers of a frame, and what they stand for.

    Returns
    -------
    pixels : (J, I) or (J, I, 3) array
        Read-only.
    photometric : str
        As in the header, but RGB for colors that were converted.
    """
    from pydicom.pixels import get_decoder

    if layout.allocated == 1:
        return _single_bits(file, element, layout, number), layout.photometric
    file.seek(element.start)
    pixels, found = get_decoder(layout.syntax).as_array(
        file, index=number, view_only=True, correct_unused_bits=False, pixel_vr=element.kind, **layout.options()
    )
    return pixels, str(found["photometric_interpretation"])


def _single_bits(file: BinaryIO, element: PixelElement, layout: PixelLayout, number: int) -> NDArray[np.uint8]:
    """Return a frame of packed bits, lowest first; it may begin within a byte, which pydicom gets wrong."""
    count = math.prod(layout.shape)
    byte, bit = divmod(number * count, 8)
    file.seek(element.start + byte)
    packed = np.frombuffer(file.read(-(-(bit + count) // 8)), np.uint8)
    return np.unpackbits(packed, count=bit + count, bitorder="little")[bit:].reshape(layout.shape)
