"""Stored numbers to gray levels."""

from __future__ import annotations

import math
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import FormatError, GeometryError
from ...model.lazy import LazyVoxels, Voxels, in_memory, slabs
from ..files.parts import each_part

if TYPE_CHECKING:
    from numpy.typing import DTypeLike, NDArray


WHITE_IS_ZERO = 0
"""TIFF's photometric interpretation of pictures whose low numbers are bright."""

ONE_BIT = "pixels of one bit: a mask of 0 and 1"
"""The note on them."""


def native(voxels: Voxels, *, file: str) -> Voxels:
    """Return real numbers in the machine's own byte order, turned in place; truth values are 0 and 1.

    Raises
    ------
    FormatError
        For complex and other kinds of voxels.
    """
    if isinstance(voxels, LazyVoxels):
        kind = native(np.empty(0, voxels.dtype), file=file).dtype
        return voxels.map(partial(native, file=file), kind)
    if voxels.dtype == np.bool_:
        return np.minimum(voxels.view(np.uint8), 1)
    if voxels.dtype.kind not in "iuf" or voxels.dtype.itemsize > 8:
        raise FormatError(
            "the voxels are of a kind that cannot be read",
            file=file,
            found=f"data type = {voxels.dtype}",
            expected="integers or real numbers of at most 64 bits",
        )
    kind = voxels.dtype.newbyteorder("=")
    turned = kind != voxels.dtype and voxels.flags.writeable
    return voxels.byteswap(inplace=True).view(kind) if turned else voxels.astype(kind, copy=False)


def bright_is_high(voxels: Voxels, bits: int) -> tuple[Voxels, tuple[str, ...]]:
    """Turn over, in place, the gray levels of TIFF pages that are WhiteIsZero, as `io.dicom` does MONOCHROME1's.

    Parameters
    ----------
    voxels : array
    bits : int
        Of a number that is WhiteIsZero, 0 for other pages; 1 for all pages of single bits.

    Returns
    -------
    voxels : array
        The standard says of numbers without a sign alone which is black, ``2**bits - 1``; others stay. Single bits
        stay too: they are masks, which tifffile writes as WhiteIsZero without turning them over, and drawings, whose
        black is the figure.
    notes : tuple of str
    """
    if not bits:
        return voxels, ()
    if isinstance(voxels, LazyVoxels):
        return voxels.map(partial(_bright, bits=bits), voxels.dtype), bright_is_high(np.empty(0, voxels.dtype), bits)[1]
    if bits == 1:
        return voxels, (ONE_BIT,)
    if voxels.dtype.kind != "u":
        return voxels, (f"low gray levels are bright (WhiteIsZero): {voxels.dtype} numbers are left as they are",)
    black = voxels.dtype.type(2**bits - 1)
    return np.subtract(black, voxels, out=voxels), (
        "low gray levels are bright in the file (WhiteIsZero): they were turned over",
    )


def _bright(voxels: NDArray[Any], bits: int) -> NDArray[Any]:
    return bright_is_high(voxels, bits)[0]


def check_scale(slope: float, intercept: float, *, file: str) -> None:
    """Refuse a scale that would wipe out or invalidate the gray levels.

    Raises
    ------
    FormatError
        For a slope of 0, and for NaN or infinite values.
    """
    if slope == 0 or not np.isfinite([slope, intercept]).all():
        raise FormatError(
            "the scale of the gray levels is invalid",
            file=file,
            found=f"slope = {slope:g}, intercept = {intercept:g}",
            expected="finite numbers, slope not 0",
        )


def scaled(stored: Voxels, slope: float, intercept: float, dtype: DTypeLike) -> Voxels:
    """Return ``slope * stored + intercept``, computed and kept in `dtype`."""
    if isinstance(stored, LazyVoxels):
        return stored.map(partial(scaled, slope=slope, intercept=intercept, dtype=dtype), dtype)
    if slope == 1 and intercept == 0:
        return stored.astype(dtype, copy=False)
    levels = stored.astype(dtype)
    levels *= levels.dtype.type(slope)
    levels += levels.dtype.type(intercept)
    return levels


def scaled_dtype(dtype: DTypeLike, scales: list[tuple[float, float]], bits: int = 64) -> np.dtype[Any]:
    """Return the smallest type that keeps all gray levels: an integer where the scales are integral.

    Parameters
    ----------
    dtype : data type
        Of the stored numbers.
    scales : list of (slope, intercept)
        All scales in use.
    bits : int
        How many bits of a stored integer are in use.
    """
    stored = np.dtype(dtype)
    if all(scale == (1, 0) for scale in scales):
        return stored
    if stored.kind != "f" and all(float(value).is_integer() for scale in scales for value in scale):
        bits = min(bits, 8 * stored.itemsize)
        low, high = (-(2 ** (bits - 1)), 2 ** (bits - 1)) if stored.kind == "i" else (0, 2**bits)
        ends = [int(slope) * end + int(intercept) for slope, intercept in scales for end in (low, high)]
        for kind in (np.int16, np.int32):
            if np.iinfo(kind).min <= min(ends) and max(ends) - 1 <= np.iinfo(kind).max:
                return np.dtype(kind)
    return np.dtype(np.float32 if stored.itemsize <= 2 or stored == np.float32 else np.float64)


def stays_finite(stored: np.dtype[Any], scale: tuple[float, float], dtype: np.dtype[Any]) -> bool:
    """Tell whether whatever is stored becomes a finite number: whole numbers do, but for a scale beyond `dtype`."""
    if dtype.kind != "f" or stored.kind == "f":
        return dtype.kind != "f"
    with np.errstate(over="ignore"):
        return bool(np.isfinite(scaled(np.array([np.iinfo(stored).min, np.iinfo(stored).max]), *scale, dtype)).all())


def without_holes(voxels: Voxels, *, file: str) -> tuple[Voxels, tuple[str, ...]]:
    """Set NaN and infinite voxels to the lowest finite gray level, and count them.

    Raises
    ------
    GeometryError
        Where more than half of the voxels are affected.
    """
    if voxels.dtype.kind != "f":
        return voxels, ()
    total = math.prod(voxels.shape)
    counts, lowest = zip(*each_part(_finite, slabs(voxels)), strict=True)
    count = total - sum(counts)
    if 2 * count > total:
        raise GeometryError(
            "more than half of the voxels are no numbers",
            file=file,
            found=f"NaN or infinite = {count} of {total}",
        )
    if count == 0:
        return voxels, ()
    note, low = f"NaN or infinite voxels set to the background: {count}", min(lowest)
    if isinstance(voxels, LazyVoxels):
        return voxels.map(partial(_filled, low=low), voxels.dtype), (note,)
    return _filled(voxels, low), (note,)


def _finite(voxels: NDArray[Any] | LazyVoxels) -> tuple[int, np.floating[Any]]:
    """Count the finite voxels, and find the lowest of them."""
    count, low = 0, np.inf
    for part in in_memory(voxels):  # slice by slice: no mask of all
        finite = np.isfinite(part)
        within = int(np.count_nonzero(finite))
        count += within
        low = min(low, part.min() if within == part.size else part.min(where=finite, initial=np.inf))
    return count, voxels.dtype.type(low)


def _filled(voxels: NDArray[Any], low: np.floating[Any]) -> NDArray[Any]:
    return np.where(np.isfinite(voxels), voxels, low)
