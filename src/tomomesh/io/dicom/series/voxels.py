"""The gray levels of a stack, slice by slice."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from ....errors import FormatError, GeometryError, TomomeshError, UnreadableError
from ...files.limits import require_memory
from ...volumes.gray import native, scaled, scaled_dtype, stays_finite, without_holes
from .duplicates import difference

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from numpy.typing import NDArray

    from ....model.lazy import Voxels
    from ..headers.header import ImageFrame
    from ..pixels.decoder import Decoder
    from .stack import Stack


Taken = TypeVar("Taken")


@dataclass(frozen=True)
class Gray:
    """Gray levels of a stack.

    Attributes
    ----------
    voxels : (K, J, I[, 3]) array or LazyVoxels
    notes : tuple of str
    bad : dict
        The files whose pixels are broken: the voxels lack theirs.
    padding : (lowest, highest) or None
        Gray levels that stand for nothing measured, where the headers name them.
    """

    voxels: Any
    notes: tuple[str, ...]
    bad: dict[Path, TomomeshError]
    padding: tuple[float, float] | None = None


@dataclass(frozen=True)
class Kind:
    """What the numbers of a stack are, stored and as gray levels.

    Attributes
    ----------
    stored : data type
    shape : tuple of int
        Of a slice.
    dtype : data type
        Of all gray levels.
    padding : (lowest, highest) or None
    """

    stored: np.dtype[Any]
    shape: tuple[int, ...]
    dtype: np.dtype[Any]
    padding: tuple[float, float] | None

    @classmethod
    def of(cls, stored: NDArray[Any], frame: ImageFrame, frames: list[ImageFrame]) -> Kind:
        """Decide by the first slice, and by what the headers of all say."""
        bits = int(frame.header.get("BitsStored") or 64)
        dtype = scaled_dtype(stored.dtype, [one.scale for one in frames], bits)
        padding = next((ends for one in frames if (ends := _padding(one, dtype))), None)
        return cls(stored.dtype, stored.shape, dtype, padding)

    def may_have_holes(self, frames: list[ImageFrame]) -> bool:
        """Tell whether gray levels may be no numbers."""
        return not all(stays_finite(self.stored, scale, self.dtype) for scale in {frame.scale for frame in frames})

    def levels(self, stored: NDArray[Any], frame: ImageFrame) -> NDArray[Any]:
        """Return the gray levels of a slice, with the padding of the first one that names some.

        Raises
        ------
        FormatError
            For a slice of another kind.
        """
        if (stored.dtype, stored.shape) != (self.stored, self.shape):
            raise FormatError(
                "the slice is of another kind than the others",
                file=frame.path.name,
                found=f"pixels = {stored.dtype}{stored.shape}",
                expected=f"{self.stored}{self.shape}",
            )
        levels, own = scaled(stored, *frame.scale, self.dtype), _padding(frame, self.dtype)
        if own is None or self.padding is None or own == self.padding:
            return levels
        return np.where((levels >= own[0]) & (levels <= own[1]), self.dtype.type(self.padding[0]), levels)


def _padding(frame: ImageFrame, dtype: np.dtype[Any]) -> tuple[float, float] | None:
    """Return the gray levels of a slice, lowest and highest, that stand for nothing measured."""
    if (padding := frame.padding) is None:
        return None
    low, high = np.sort(scaled(np.array(padding), *frame.scale, dtype))
    return float(low), float(high)


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
    slices = Slices(stack.places, decode)
    voxels, before = np.empty(0), None
    for level, place in zip(stack.levels, stack.places, strict=True):
        here = slices.at(place)
        if here is None or slices.bad:
            continue
        voxels = voxels if voxels.size else _room(here, stack, study)
        if before is not None:
            _between(voxels, *before, here, level)
        if level.is_integer():
            voxels[int(level)] = here
        before = here, level
    return slices.found(voxels, study)


def _room(first: NDArray[Any], stack: Stack, study: str) -> NDArray[Any]:
    """Return an array for all slices, where the memory has room for it."""
    count = int(stack.levels[-1]) + 1
    require_memory(count * first.nbytes, file=study)
    return np.empty((count, *first.shape), first.dtype)


class Slices:
    """Decoded slices in one type of number, and what was wrong with the others."""

    def __init__(self, places: list[list[ImageFrame]], decode: Decoder, kind: Kind | None = None) -> None:
        self._decode, self.kind = decode, kind
        self._frames = [frame for place in places for frame in place]
        self._repeats = len(self._frames) - len(places)
        self.bad: dict[Path, TomomeshError] = {}

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
        return found[0][1] if found else None

    def check(self, place: list[ImageFrame]) -> None:
        """Find out which files at a position are broken, as far as that is known before they are decoded."""
        for frame in place:
            self._unless_bad(frame, self._decode.check)

    def _one(self, frame: ImageFrame) -> NDArray[Any] | None:
        stored = self._unless_bad(frame, lambda one: native(self._decode(one), file=one.path.name))
        if stored is None:
            return None
        self.kind = self.kind or Kind.of(stored, frame, self._frames)
        return self.kind.levels(stored, frame)

    def _unless_bad(self, frame: ImageFrame, take: Callable[[ImageFrame], Taken]) -> Taken | None:
        if frame.path in self.bad:
            return None
        try:
            return take(frame)
        except (FormatError, UnreadableError) as fault:
            self.bad[frame.path] = fault
            return None

    def found(self, voxels: Voxels, study: str) -> Gray:
        """Return what the slices make, or which of them are broken."""
        if self.bad or self.kind is None:
            return Gray(voxels, (), self.bad)
        note = (f"slices that repeat another, left out: {self._repeats}",) if self._repeats else ()
        holes: tuple[str, ...] = ()
        if self.kind.may_have_holes(self._frames):
            voxels, holes = without_holes(voxels, file=study)
        return Gray(voxels, note + holes, {}, self.kind.padding)


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
        voxels[k] = mixed(below, low, above, high, k)


def mixed(below: NDArray[Any], low: np.float64, above: NDArray[Any], high: np.float64, k: int) -> NDArray[Any]:
    """Return the slice at a level between two others."""
    share = (k - low) / (high - low)
    between = (1 - share) * below.astype(np.float64) + share * above.astype(np.float64)
    return np.asarray(np.rint(between) if below.dtype.kind in "iu" else between).astype(below.dtype)
