"""Voxels behind a text header, NRRD's or MetaImage's: in the same file or in others, packed or not."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import FormatError
from ...model.lazy import LazyVoxels, Voxels, in_memory, layer_of, slabs
from ..files.limits import require_bytes, require_memory, require_rows
from ..files.numbers import FileNumbers, Plain, Unpacked
from ..files.parts import Seen, read_later
from ..files.source import existing_file, first_bytes, third_party, whole
from ..files.unpack import PLAIN, check_promise, fill, pass_over, unpacked
from .gray import native, without_holes

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from numpy.typing import NDArray

TEXT = "text"
"""The packing of voxels that are written as words."""

HEX = "hex"
"""That of bytes that are written as two digits of base 16 each."""

LONGEST_HEADER = 2**20
"""A header that does not end within these bytes is none: real ones have some thousand, and the names of
`files.detached.MOST_FILES` data files, of 16 letters each, are as many."""

HeaderFields = dict[str, str]
"""The fields of a text header, by their names."""


@dataclass(frozen=True)
class Raster:
    """What a header promises.

    Attributes
    ----------
    shape : tuple of int
        Sizes of all stored axes, slowest first.
    dtype : data type
        Of one number, in the file's byte order.
    packing : str
        One of `unpack`'s, ``TEXT`` or ``HEX``.
    parts : tuple of Path
        The files that hold the voxels, one after another, each as many.
    start : int
        Bytes before the voxels, or packed voxels, of each; -1 where they are its last bytes.
    skip : int
        Unpacked bytes before the voxels.
    """

    shape: tuple[int, ...]
    dtype: np.dtype[Any]
    packing: str
    parts: tuple[Path, ...]
    start: int = 0
    skip: int = 0

    @property
    def share(self) -> int:
        """Numbers in each part."""
        return math.prod(self.shape) // len(self.parts)

    @property
    def part_bytes(self) -> int:
        """Unpacked bytes of the numbers in each part."""
        return self.share * self.dtype.itemsize


def header_bytes(path: Path) -> bytes:
    """Return the bytes among which a header must end."""
    return first_bytes(existing_file(path), LONGEST_HEADER)


def sizes_of(values: Sequence[str], count: int, field: str, *, file: str) -> tuple[int, ...]:
    """Return sizes of axes, as many as there must be.

    Raises
    ------
    FormatError
        For another count, text, and sizes below 1.
    """
    sizes = tuple(
        int(value) for value in values if value.isascii() and value.isdigit() and len(value) < 19
    )  # fit into 64 bits
    if len(sizes) != len(values) or len(sizes) != count or min(sizes, default=0) < 1:
        raise FormatError(
            "the sizes of the volume are invalid",
            file=file,
            found=f"{field} = {' '.join(values)[:80]}",
            expected=f"{count} whole numbers over 0",
        )
    return sizes


def floats_of(words: Sequence[str], field: str, *, file: str) -> NDArray[np.float64]:
    """Return the numbers of a field.

    Raises
    ------
    FormatError
        For text.
    """
    try:
        return np.array([float(word) for word in words])
    except ValueError:
        found = f"{field} = {' '.join(words)[:80]}"
        raise FormatError("a field of the header is no number", file=file, found=found, expected="numbers") from None


def read_raster(raster: Raster, *, file: str) -> Any:
    """Read the promised numbers, in the machine's byte order; or leave them where they are, where that is wanted.

    Returns
    -------
    array or LazyVoxels
        Of the shape that the header promises.

    Raises
    ------
    FormatError
        Where the files hold fewer, or are damaged.
    ResourceError
        Where they do not fit into the memory.
    """
    if math.prod(raster.shape) % len(raster.parts):
        found = f"files = {len(raster.parts)}, shape = {raster.shape[::-1]}"
        raise FormatError("the data files cannot hold as many voxels each", file=file, found=found)
    if read_later() and raster.packing not in (TEXT, HEX) and raster.shape[0] % len(raster.parts) == 0:
        return native(LazyVoxels.of(_opened(raster, file)), file=file)
    require_memory(len(raster.parts) * raster.part_bytes, file=file)
    if raster.packing == TEXT:
        return native(np.concatenate([_words(raster, part, file) for part in raster.parts]), file=file).reshape(
            raster.shape
        )
    if raster.packing == HEX:
        digits = b"".join([_from_digits(raster, part, file) for part in raster.parts])
        return native(np.frombuffer(digits, raster.dtype).reshape(raster.shape), file=file)
    starts = [_start(raster, part, file) for part in raster.parts]
    data = np.empty((len(raster.parts), raster.part_bytes), np.uint8)
    for row, part, start in zip(data, raster.parts, starts, strict=True):
        with unpacked(part, raster.packing, file=file, start=start) as stream:
            pass_over(stream, raster.skip)
            fill(row, stream, file=file)
    return native(data.reshape(-1).view(raster.dtype).reshape(raster.shape), file=file)


def at_once(voxels: NDArray[Any] | LazyVoxels, *, file: str) -> NDArray[Any]:
    """Return voxels as an array, read where they are not.

    Raises
    ------
    ResourceError
        Where they do not fit into the memory.
    """
    if isinstance(voxels, LazyVoxels):
        require_memory(math.prod(voxels.shape) * voxels.dtype.itemsize, file=file)
    return in_memory(voxels)


def layers_last(stored: Any, space: Sequence[int], *, file: str) -> Any:
    """Return voxels (K, J, I, layers) of an array whose last axis is one of 1.

    Parameters
    ----------
    stored : array or LazyVoxels
    space : sequence of int
        The axes of slices, rows and columns; all others become one, behind them.
    file : str
    """
    others = sorted({*range(stored.ndim)} - {*space}, key=lambda axis: stored.shape[axis] == 1)
    turned = stored.transpose((*space, *others))
    while isinstance(turned, LazyVoxels) and turned.ndim > 4 and turned.shape[-1] == 1:
        turned = turned.layer(0)
    return turned if turned.ndim == 4 else at_once(turned, file=file).reshape(*turned.shape[:3], -1)


def _opened(raster: Raster, file: str) -> FileNumbers:
    """Return the numbers where they are, unpacked where they have to be."""
    starts, seen = [_start(raster, part, file) for part in raster.parts], tuple(map(Seen.of, raster.parts))
    if raster.packing == PLAIN:
        plain = (Plain(one, start + raster.skip) for one, start in zip(seen, starts, strict=True))
        return FileNumbers(raster.shape, raster.dtype, tuple(plain))
    packed = Unpacked(seen, tuple(starts), raster.packing, raster.skip, raster.part_bytes, file)
    return FileNumbers(raster.shape, raster.dtype, (packed.now(),))


def _start(raster: Raster, part: Path, file: str) -> int:
    """Return where the voxels of a part begin, once it is known to be long enough."""
    size = part.stat().st_size
    start = size - raster.part_bytes if raster.start < 0 else raster.start
    check_promise(raster.skip + raster.part_bytes, size - max(start, 0), raster.packing, file=file)
    return start


def _words(raster: Raster, part: Path, file: str) -> NDArray[Any]:
    require_bytes(raster.start + 2 * raster.share - 1, part.stat().st_size, file=file)
    words = whole(part)[raster.start :].split()
    require_rows(raster.share, len(words), "voxels", file=file)
    kind = raster.dtype.newbyteorder("=")
    with third_party("numpy", file):
        return np.array([kind.type(word) for word in words[: raster.share]], kind)


def _from_digits(raster: Raster, part: Path, file: str) -> bytes:
    least = raster.skip + raster.part_bytes
    require_bytes(raster.start + 2 * least, part.stat().st_size, file=file)
    with third_party("the reader of digits", file):
        found = bytes.fromhex(whole(part)[raster.start :].decode("ascii"))[raster.skip : least]
    require_bytes(raster.part_bytes, len(found), file=file)
    return found


def many_levels(stored: Voxels) -> bool:
    """Tell whether a layer of bytes (K, J, I, channels) has more levels than a mask."""
    if stored.dtype != np.uint8:
        return False
    seen = np.zeros((stored.shape[3], 256), np.bool_)
    for slab in slabs(stored):
        for layer, levels in zip(np.moveaxis(in_memory(slab), 3, 0), seen, strict=True):
            levels |= np.bincount(layer.ravel(), minlength=256) > 0
        if (seen.sum(axis=1) > 2).any():
            return True
    return False


def gray_or_color(stored: Voxels, channels: int, *, file: str, named: bool = True) -> tuple[Voxels, tuple[str, ...]]:
    """Return voxels (K, J, I), or (K, J, I, 3) of bytes, from an array whose last axis is that of the channels.

    Parameters
    ----------
    stored : (K, J, I, channels) array
        One number a voxel, or the 3 of a color, or 4 with its opacity, which is dropped.
    channels : int
    file : str
    named : bool
        Whether the file says that a color is one. Else layers of two levels each are masks, as of one-hot labels.

    Raises
    ------
    FormatError
        For another count, and colors that are no bytes.
    GeometryError
        Where more than half of the voxels are no numbers.
    """
    if channels == 1:
        return without_holes(layer_of(stored, 0), file=file)
    if channels in (3, 4) and stored.dtype == np.uint8 and (named or many_levels(stored)):
        return stored[:, :, :, :3], ()
    raise FormatError(
        "the file holds several values a voxel",
        file=file,
        found=f"values = {channels} of {stored.dtype}",
        expected="one gray level, or a color of 3 or 4 bytes",
        hint="one of them, written to a file of its own; of masks, the number of the mask as one label map",
    )
