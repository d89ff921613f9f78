"""The gray levels of a stack, slice by slice."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ....errors import FormatError, GeometryError, TomomeshError, UnreadableError
from ...files.limits import require_memory
from ...volumes.gray import native, scaled, scaled_dtype, without_holes
from .duplicates import difference

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from ..headers.header import ImageFrame
    from ..pixels.decoder import Decoder
    from .stack import Stack


@dataclass(frozen=True)
class Gray:
    """Gray levels of a stack.

    Attributes
    ----------
    voxels : (K, J, I[, 3]) array
    notes : tuple of str
    bad : dict
        The files whose pixels are broken: the voxels lack theirs.
    padding : (lowest, highest) or None
        Gray levels that stand for nothing measured, where the headers name them.
    """

    voxels: NDArray[Any]
    notes: tuple[str, ...]
    bad: dict[Path, TomomeshError]
    padding: tuple[float, float] | None = None


def gray(stack: Stack, decode: Decoder, *, study: str) -> Gray:
    """Decode the slices of a stack, and interpolate those between its places.

    Raises
    ------
    FormatError
        Where the slices are not of one kind.
    GeometryError
        Where different slices are at one position, or most voxels are no numbers.
    ResourceError
        Where the voxels do not fit into the memory.
    """
    slices = _Slices(stack, decode, study)
    voxels, before = np.empty(0), None
    for level, place in zip(stack.levels, stack.places, strict=True):
        here = slices.at(place)
        if here is None or slices.bad:
            continue
        voxels = voxels if voxels.size else slices.room(here)
        if before is not None:
            _between(voxels, *before, here, level)
        if level.is_integer():
            voxels[int(level)] = here
        before = here, level
    if slices.bad:
        return Gray(voxels, (), slices.bad)
    note = (f"slices that repeat another, left out: {slices.repeats}",) if slices.repeats else ()
    voxels, holes = without_holes(voxels, file=study)
    return Gray(voxels, note + holes, {}, slices.padding)


class _Slices:
    """Decoded slices in one type of number, and what was wrong with the others."""

    def __init__(self, stack: Stack, decode: Decoder, study: str) -> None:
        self._decode, self._study = decode, study
        self._count = int(stack.levels[-1]) + 1
        self._frames = [frame for place in stack.places for frame in place]
        self._kind: tuple[Any, ...] = ()
        self._dtype: np.dtype[Any] = np.dtype(np.int16)
        self.repeats = 0
        self.padding: tuple[float, float] | None = None
        self.bad: dict[Path, TomomeshError] = {}

    def room(self, first: NDArray[Any]) -> NDArray[Any]:
        """Return an array for all slices, where the memory has room for it."""
        require_memory(self._count * first.nbytes, file=self._study)
        return np.empty((self._count, *first.shape), first.dtype)

    def at(self, place: list[ImageFrame]) -> NDArray[Any] | None:
        """Return the gray levels at a position, None where all its files are broken.

        Raises
        ------
        GeometryError
            Where several slices are there, and differ.
        """
        found = [(frame, pixels) for frame in place if (pixels := self._one(frame)) is not None]
        for frame, pixels in found[1:]:
            if not np.array_equal(found[0][1], pixels):
                raise _two_at_once(found[0][0], frame)
        self.repeats += max(len(found) - 1, 0)
        return found[0][1] if found else None

    def _one(self, frame: ImageFrame) -> NDArray[Any] | None:
        if frame.path in self.bad:
            return None
        try:
            stored = native(self._decode(frame), file=frame.path.name)
        except (FormatError, UnreadableError) as fault:
            self.bad[frame.path] = fault
            return None
        self._check_kind(stored, frame)
        return self._padded(scaled(stored, *frame.scale, self._dtype), frame)

    def _padded(self, levels: NDArray[Any], frame: ImageFrame) -> NDArray[Any]:
        """Give a slice the padding of the first one that names some, whose scale may be another."""
        if (padding := frame.padding) is None:
            return levels
        low, high = np.sort(scaled(np.array(padding), *frame.scale, self._dtype))
        self.padding = self.padding or (float(low), float(high))
        if self.padding == (low, high):
            return levels
        return np.where((levels >= low) & (levels <= high), self._dtype.type(self.padding[0]), levels)

    def _check_kind(self, stored: NDArray[Any], frame: ImageFrame) -> None:
        """Refuse a slice of another kind than the first; the first decides on the type of all gray levels."""
        kind = (stored.dtype, stored.shape)
        if not self._kind:
            bits = int(frame.header.get("BitsStored") or 64)
            self._kind = kind
            self._dtype = scaled_dtype(stored.dtype, [one.scale for one in self._frames], bits)
        if kind != self._kind:
            raise FormatError(
                "the slice is of another kind than the others",
                file=frame.path.name,
                found=f"pixels = {stored.dtype}{stored.shape}",
                expected=f"{self._kind[0]}{self._kind[1]}",
            )


def _two_at_once(one: ImageFrame, other: ImageFrame) -> GeometryError:
    keyword, values = difference(one, other)
    return GeometryError(
        "different slices are at the same position",
        file=other.path.name,
        found=f"{keyword} = {values}",
        expected="one slice a position",
        hint=f"the slices of one {keyword} alone" if keyword != "PixelData" else "a folder with one of them",
    )


def _between(voxels: NDArray[Any], below: NDArray[Any], low: np.float64, above: NDArray[Any], high: np.float64) -> None:
    """Interpolate the slices strictly between two levels."""
    for k in range(int(np.floor(low)) + 1, int(np.ceil(high))):
        share = (k - low) / (high - low)
        between = (1 - share) * below.astype(np.float64) + share * above.astype(np.float64)
        voxels[k] = np.rint(between) if voxels.dtype.kind in "iu" else between
