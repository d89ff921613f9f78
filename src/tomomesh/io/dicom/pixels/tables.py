"""Tables of gray levels and of colors that stand between the stored numbers and what they mean."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ....errors import FormatError
from ..headers.values import numbers

if TYPE_CHECKING:
    from numpy.typing import NDArray

PALETTE = "PALETTE COLOR"

CHANNELS = ("Red", "Green", "Blue")
DESCRIPTOR, DATA = "PaletteColorLookupTableDescriptor", "PaletteColorLookupTableData"


def check_tables(header: Any, *, name: str) -> None:
    """Refuse tables that are not applied, a table beside a scale, and a palette that is missing.

    Raises
    ------
    FormatError
        It says which.
    """
    palette = header.get("PhotometricInterpretation") == PALETTE
    refused = {
        "a supplemental palette": header.get("PixelPresentation") in ("COLOR", "MIXED"),
        "a palette in segments": "SegmentedRedPaletteColorLookupTableData" in header,
        "a palette that is missing": palette and not all(f"{color}{DATA}" in header for color in CHANNELS),
        "both a table and a scale": "ModalityLUTSequence" in header and "RescaleSlope" in header,
    }
    for reason in (reason for reason, present in refused.items() if present):
        raise FormatError(
            f"the gray levels are behind {reason}",
            file=name,
            found=f"PhotometricInterpretation = {header.get('PhotometricInterpretation')}",
            expected="stored gray levels, a plain palette or one table",
            hint="a copy in gray levels or RGB",
        )


def modality_levels(stored: NDArray[Any], header: Any, *, name: str) -> NDArray[Any]:
    """Return gray levels through the header's modality table, unchanged where it has none.

    Raises
    ------
    FormatError
        For a table without entries, with too few of them, or of more than 16 bits.
    """
    if "ModalityLUTSequence" not in header:
        return stored
    item = (header.ModalityLUTSequence or [{}])[0]
    return _looked_up(stored, item.get("LUTDescriptor"), item.get("LUTData"), header, name)


def palette_colors(stored: NDArray[Any], header: Any, *, name: str) -> NDArray[Any]:
    """Return the colors (J, I, 3) of indices (J, I) into the header's palette.

    Raises
    ------
    FormatError
        As `modality_levels`.
    """
    layers = [
        _looked_up(stored, header.get(f"{color}{DESCRIPTOR}"), header.get(f"{color}{DATA}"), header, name)
        for color in CHANNELS
    ]
    return np.stack(layers, axis=-1)


def _looked_up(stored: NDArray[Any], descriptor: Any, data: Any, header: Any, name: str) -> NDArray[Any]:
    """Look numbers up in a table: those before and beyond it get its first and last entry (PS3.3 C.11.1.1.1)."""
    shape = numbers(descriptor, 3, "LUTDescriptor", name)
    count, first, bits = (0, 0, 0) if shape is None else (int(value) for value in shape)
    count = count or 2**16  # sixteen bits cannot say more
    table = _entries(data, count, bits, little=header.original_encoding[1])
    if table is None:
        raise FormatError(
            "a table of the gray levels is broken",
            file=name,
            found=f"entries = {count} of {bits} bits",
            expected="as many entries as its descriptor says, of 8 to 16 bits",
        )
    if stored.dtype.kind == "i" and first >= 2**15:
        first -= 2**16
    return np.asarray(table[np.clip(stored.astype(np.int64) - first, 0, count - 1)])


def _entries(data: Any, count: int, bits: int, *, little: bool) -> NDArray[Any] | None:
    """Return the entries of a table, of one byte each or of two; None where there are too few."""
    if isinstance(data, bytes):
        wide = len(data) >= 2 * count
        kind = np.dtype("<u2" if little else ">u2") if wide else np.dtype(np.uint8)
        data = np.frombuffer(data[: len(data) // kind.itemsize * kind.itemsize], kind)
    entries = np.atleast_1d(np.asarray([] if data is None else data))[:count]
    if len(entries) < count or not 8 <= bits <= 16:
        return None
    return entries.astype(np.uint8 if bits == 8 else np.uint16)
