"""A stack of DICOM slices that are decoded when they are asked for."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ...model.lazy import LazyVoxels
from ..files.parts import Seen, reading_later
from .bad import leave_out
from .files import read_frames
from .pixels.decoder import Decoder
from .series.voxels import Gray, Kind, Slices, mixed

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from .series.stack import Stack


@dataclass(frozen=True, eq=False)
class StackedSlices:
    """The slices of a stack, each read from its file with its header.

    Attributes
    ----------
    shape : tuple of int
    kind : Kind
        What the first slice and the headers of all have decided.
    levels : (s,) float array
        Slice number at which each place lies.
    places : tuple of tuples of (Seen, int)
        The frames at each place: their files, and their numbers in these.
    study : str
        The path as the user typed it.
    """

    shape: tuple[int, ...]
    kind: Kind
    levels: NDArray[np.float64]
    places: tuple[tuple[tuple[Seen, int], ...], ...]
    study: str

    @property
    def dtype(self) -> np.dtype[Any]:
        """Of the gray levels."""
        return self.kind.dtype

    @property
    def chunks(self) -> tuple[int, ...]:
        """Sizes of what is read together: a slice."""
        return (1, *self.shape[1:])

    def read(self, box: tuple[slice, ...]) -> NDArray[Any]:
        """Return a part.

        Raises
        ------
        TomomeshError
            As `read_dicom`, for the slices of this part.
        """
        with Decoder() as decode, reading_later(map):
            slices = _Near(self, decode)
            return np.stack([slices.at_level(k)[box[1:]] for k in range(self.shape[0])[box[0]]])


class _Near:
    """Slices of a stack by their level; the last two places are kept for those between them."""

    def __init__(self, stack: StackedSlices, decode: Decoder) -> None:
        self._stack, self._decode = stack, decode
        self._places: dict[int, NDArray[Any]] = {}
        self._frames: dict[Path, list[Any]] = {}

    def at_level(self, k: int) -> NDArray[Any]:
        """Return a slice, interpolated where it is none of the stack's own."""
        levels = self._stack.levels
        n = int(np.searchsorted(levels, k))
        if levels[n] == k:
            return self._place(n)
        return mixed(self._place(n - 1), levels[n - 1], self._place(n), levels[n], k)

    def _place(self, n: int) -> NDArray[Any]:
        if n not in self._places:
            frames = [self._frame(seen, number) for seen, number in self._stack.places[n]]
            slices = Slices([frames], self._decode, self._stack.kind)
            found = slices.at(frames)
            leave_out(slices.bad, len(self._stack.places) - len(slices.bad), skip=False, study=self._stack.study)
            assert found is not None
            self._places = {m: one for m, one in self._places.items() if m == n - 1} | {n: found}
        return self._places[n]

    def _frame(self, seen: Seen, number: int) -> Any:
        path = seen.unchanged()
        if path not in self._frames:
            reading = read_frames([path])
            leave_out(reading.bad, len(self._stack.places) - 1, skip=False, study=self._stack.study)
            self._frames = {path: reading.frames}  # a file of several frames is read once, others have one
        return self._frames[path][number]


def opened(stack: Stack, decode: Decoder, *, study: str, all_now: bool) -> Gray:
    """Look at the slices that decide on the others, and leave the voxels where they are.

    Parameters
    ----------
    stack : Stack
    decode : Decoder
    study : str
    all_now : bool
        Whether all slices are decoded once, so that those are known that are broken. Else it is the first, and those
        that share their place.
    """
    slices = Slices(stack.places, decode)
    for n, place in enumerate(stack.places):
        (slices.at if n == 0 or all_now or len(place) > 1 else slices.check)(place)
    if slices.bad or slices.kind is None:
        return Gray(np.empty(0), (), slices.bad)
    places = tuple(tuple((Seen.of(frame.path), frame.number) for frame in place) for place in stack.places)
    shape = (int(stack.levels[-1]) + 1, *slices.kind.shape)
    return slices.found(LazyVoxels.of(StackedSlices(shape, slices.kind, stack.levels, places, study)), study)
