"""Chunks of a Zarr array that are not there: which, and whether their writer left them out."""

from __future__ import annotations

import operator
import os
import re
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np

from ....errors import FormatError
from ....model.lazy import in_memory

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from numpy.typing import NDArray

TORN = 0.25
"""A missing chunk was lost where more than this part of the voxels beside it differ from the fill value: what writers
leave out is background, which an object touches in part at most; around a lost part of it, it is on all sides."""


def grid_of(array: Any) -> tuple[int, ...]:
    """Return how many chunks, or shards, lie along each axis."""
    return tuple(-(-size // chunk) for size, chunk in zip(array.shape, unit_of(array), strict=True))


def unit_of(array: Any) -> tuple[int, ...]:
    """Return the sizes of what a file holds: a chunk, or a shard."""
    unit: tuple[int, ...] = array.shards or array.chunks
    return unit


def missing_chunks(array: Any, folder: Path, file: str) -> NDArray[np.bool_]:
    """Tell which chunks, or shards, there are not.

    Raises
    ------
    FormatError
        For a link, or a special file, in the array's folder.
    """
    missing = np.ones(grid_of(array), np.bool_)
    for key in _files(folder, "", file):
        place = tuple(map(int, re.findall("[0-9]+", key)))
        inside = len(place) == missing.ndim and all(map(operator.lt, place, missing.shape))
        if inside and array.metadata.encode_chunk_key(place) == key:
            missing[place] = False
    return missing


def _files(folder: Path, prefix: str, file: str) -> Iterator[str]:
    """Return the files of an array by their keys; nothing is opened where one of them is a link."""
    with os.scandir(folder / prefix) as entries:
        for entry in entries:
            if entry.is_dir(follow_symlinks=False):
                yield from _files(folder, f"{prefix}{entry.name}/", file)
            elif entry.is_file(follow_symlinks=False):
                yield prefix + entry.name
            else:
                expected = "the chunks themselves, no links"
                raise FormatError(
                    "a chunk is no regular file", file=file, found=f"chunk = {entry.name}", expected=expected
                )


def are_fill(voxels: Any, missing: NDArray[np.bool_], chunks: tuple[int, ...], fill: Any) -> bool:
    """Tell whether the voxels beside the missing chunks are mostly of the fill value, as theirs were then.

    Parameters
    ----------
    voxels : array or LazyVoxels
        Of a lazy one no more is read than the planes of other chunks that touch the missing ones.
    missing : bool array
        One for each chunk.
    chunks : tuple of int
        Their sizes.
    fill : number
    """
    other = np.zeros(missing.shape, np.int64)
    area = np.zeros(missing.shape, np.int64)
    for axis, step in product(range(missing.ndim), (-1, 1)):
        for place in map(tuple, np.argwhere(missing & ~_shifted(missing, axis, step))):
            part = in_memory(voxels[_face(place, axis, step, chunks)])
            other[place] += np.count_nonzero(_differs(part, fill))
            area[place] += part.size
    return bool((other <= TORN * area).all())


def _shifted(missing: NDArray[np.bool_], axis: int, step: int) -> NDArray[np.bool_]:
    """Tell of every chunk whether that beside it is missing, or beyond the end."""
    around = np.pad(missing, [(int(n == axis),) * 2 for n in range(missing.ndim)], constant_values=True)
    start = 1 + step
    return around[(*(slice(None),) * axis, slice(start, start + missing.shape[axis]))]


def _face(place: tuple[int, ...], axis: int, step: int, chunks: tuple[int, ...]) -> tuple[slice, ...]:
    """Return the plane of voxels that touches a chunk from the side along an axis."""
    box = [slice(n * chunk, (n + 1) * chunk) for n, chunk in zip(place, chunks, strict=True)]
    plane = box[axis].stop if step > 0 else box[axis].start - 1
    box[axis] = slice(plane, plane + 1)
    return tuple(box)


def _differs(values: NDArray[Any], fill: Any) -> NDArray[np.bool_]:
    return np.asarray(values != fill if fill == fill else ~np.isnan(values))
