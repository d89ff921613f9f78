"""Volumes as NPY arrays, which hold no frame."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ...errors import FormatError
from ...model.volume import Volume
from ..files.npy_header import npy_header
from ..files.unpack import PLAIN
from .affine import GIVEN, required_spacing, upright
from .raster import Raster, gray_or_color, header_bytes, read_raster

if TYPE_CHECKING:
    from pathlib import Path

    from ...settings import ReadSettings


COLORS = (1, 3, 4)
"""Numbers of a voxel behind its place: gray, a color, a color with its opacity."""


def read_npy_volume(path: Path, settings: ReadSettings) -> Volume:
    """Read an array (K, J, I), or (K, J, I, L) with 3 or 4 colors, also behind axes of one, from a ``.npy`` file.

    Parameters
    ----------
    path : Path
        The file.
    settings : ReadSettings
        `spacing` must be given: the file holds none.

    Returns
    -------
    Volume
        Columns run to +x (left), rows to +y (posterior), slices to +z (superior); the origin is 0.

    Raises
    ------
    UnreadableError, FormatError, GeometryError
        For a file that is broken, an array of another shape, and without `spacing`.
    """
    name = str(path)
    shape, by_columns, dtype, start = npy_header(header_bytes(path), file=name)
    plain = _without_ones(shape)
    if len(plain) not in (3, 4) or 0 in shape:
        raise FormatError(
            "the array is no volume",
            file=name,
            found=f"shape = {shape}",
            expected="(slices, rows, columns), or colors behind",
        )
    spacing = required_spacing(settings.spacing, file=name, what="NPY arrays hold no spacing")
    order = slice(None, None, -1 if by_columns else 1)
    raster = Raster((*plain, 1)[:4][order], dtype, PLAIN, (path,), start)
    stored = read_raster(raster, file=name).transpose((0, 1, 2, 3)[order])
    voxels, notes = gray_or_color(stored, stored.shape[3], file=name, named=False)
    return Volume.from_stored(voxels, upright(spacing), notes=(GIVEN, *notes))


def _without_ones(shape: tuple[int, ...]) -> tuple[int, ...]:
    """Drop axes of one before the slices, as neural networks have them for batches and channels."""
    while len(shape) > (4 if shape[-1] in COLORS else 3) and shape[0] == 1:
        shape = shape[1:]
    return shape
