"""Clouds as NumPy arrays: NPY and NPZ."""

from __future__ import annotations

import io
import math
import zipfile
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import FormatError
from ..fields import AXES, doubles, split_fields
from ..files.atomic import replacing
from ..files.limits import require_bytes, require_memory
from ..files.npy_header import npy_header
from ..files.source import stored, third_party, whole

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from ...model.points import PointSet
    from ..fields import Cloud, Fields
    from ..meshes.attributes import MeshAttributes

POSITIONS = ("points", "positions", "xyz", "vertices", "pos", "arr_0")
"""What the positions in an NPZ file are called; the first that is there."""

HEADER = 1 << 17
"""More bytes than NumPy takes for a header."""


def read_npy(path: Path) -> Cloud:
    """Read an (n, 3) array, or one with named fields, x, y and z among them."""
    array = _array(stored(path), str(path))
    if array.dtype.names and set(AXES) <= set(array.dtype.names):
        return split_fields({name: array.ravel()[name] for name in array.dtype.names}, file=str(path))
    return _positions(array, str(path)), {}


def read_npz(path: Path) -> Cloud:
    """Read positions under a name of `POSITIONS`, or as x, y and z; arrays of as many rows are fields.

    Raises
    ------
    FormatError
    """
    arrays = _members(path)
    if set(AXES) <= set(arrays):
        return split_fields(_as_long(arrays, arrays["x"]), file=str(path))
    name = next((name for name in POSITIONS if name in arrays), "")
    if not name:
        raise FormatError(
            "the file has no positions",
            file=str(path),
            found=f"arrays = {', '.join(arrays) or 'none'}",
            expected=f"one of {' | '.join(POSITIONS)}",
        )
    positions = _positions(arrays.pop(name), str(path))
    return positions, _as_long(arrays, positions)


def _as_long(arrays: Fields, one: NDArray[Any]) -> Fields:
    """Return the arrays that have as many rows as one of them."""
    return {name: array for name, array in arrays.items() if array.shape[:1] == one.shape[:1]}


def _members(path: Path) -> Fields:
    """Return the arrays of an NPZ file; nothing is unpacked that would not fit into the memory."""
    file = str(path)
    with third_party("zipfile", file), zipfile.ZipFile(io.BytesIO(whole(path))) as archive:
        members = [one for one in archive.infolist() if one.filename.endswith(".npy")]
        require_memory(sum(one.file_size for one in members), file=file)
        arrays = {one.filename.removesuffix(".npy"): _array(archive.read(one), file) for one in members}
        return {name: array for name, array in arrays.items() if array.dtype.kind in "biuf"}


def _array(data: bytes | memoryview, file: str) -> NDArray[Any]:
    """Return the array in the bytes of an NPY file, once they are as many as its header promises."""
    shape, by_columns, kind, start = npy_header(bytes(data[:HEADER]), file=file)
    require_bytes(start + math.prod(shape) * kind.itemsize, len(data), file=file)
    with third_party("numpy", file):
        return np.ndarray(shape, kind, data, start, order="F" if by_columns else "C")


def _positions(array: NDArray[Any], file: str) -> NDArray[np.float64]:
    if array.ndim != 2 or array.shape[1] != 3 or array.dtype.kind not in "iuf":
        raise FormatError(
            "the array is no cloud",
            file=file,
            found=f"shape = {array.shape}, type = {array.dtype}",
            expected="(n, 3) real numbers",
        )
    as_needed = array.dtype == np.float64 and array.flags.carray
    return array if as_needed else doubles(array)  # a file's own rows are not held twice


def write_npy(points: PointSet, path: str | Path, _beside: MeshAttributes) -> None:
    """Write positions alone."""
    with replacing(path) as file:
        np.lib.format.write_array(file, np.ascontiguousarray(points.positions, "<f8"), version=(1, 0))
