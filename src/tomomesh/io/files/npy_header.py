"""The header of NPY files, in which clouds and volumes are kept."""

from __future__ import annotations

import io
from typing import Any

import numpy as np

from .source import third_party

HEADER_READERS = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}
"""Version of the format to the reader of its header."""


def npy_header(data: bytes, *, file: str) -> tuple[tuple[int, ...], bool, np.dtype[Any], int]:
    """Return an NPY file's shape, whether its first axis is the fastest, its type, and the bytes up to the numbers.

    Raises
    ------
    FormatError
        For a broken header, and arrays of Python objects.
    """
    stream = io.BytesIO(data)
    with third_party("numpy", file):
        shape, by_columns, kind = HEADER_READERS[np.lib.format.read_magic(stream)](stream)
        if kind.hasobject or any(length < 0 for length in shape):
            raise ValueError(kind)
        return shape, by_columns, kind, stream.tell()
