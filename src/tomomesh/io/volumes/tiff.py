"""Multi-page TIFF: OME-TIFF and ImageJ's with their spacing, others with ``--spacing``; through tifffile.

Pillow, which reads single slices, knows neither of them, no BigTIFF and few kinds of numbers. tifffile is one module on
NumPy; files packed by LZW, JPEG and others need imagecodecs too, 20 MB of compiled code: hence the extra ``tiff``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree

import numpy as np

from ...errors import FormatError
from ...model.lazy import LazyVoxels
from ...model.units import millimeters
from ...model.volume import Volume
from ..files.extras import required
from ..files.limits import require_bytes, require_memory
from ..files.numbers import FileNumbers, Plain
from ..files.parts import Seen, read_later
from ..files.source import existing_file, third_party
from .affine import GIVEN, UNTURNED, check_spacing, passed_over, required_spacing, upright
from .gray import WHITE_IS_ZERO, bright_is_high, native
from .raster import gray_or_color, layers_last
from .tiff_pages import Pages, opened, page_axes, pages_of, stack_of

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from ...settings import ReadSettings

UNPACKED_WITHOUT = (1, 8, 32946)
"""Compressions, none and deflate, that need no further package."""

TIFF_RATIO = 2**14
"""A packed byte is never taken to hold more bytes of voxels: ten times what deflate (1,032) and LZW (1,243, measured on
zeros) reach."""

Spacing = tuple[tuple[float, ...], tuple[str, ...]]
"""Distances along columns, rows and slices, and the unit of each."""


def read_tiff(path: Path, settings: ReadSettings) -> Volume:
    """Read a stack from the pages of one file.

    Parameters
    ----------
    path : Path
        The file; files that it names beside it are not opened.
    settings : ReadSettings
        `spacing` stands in for one that the file does not hold.

    Returns
    -------
    Volume
        Columns run to +x (left), rows to +y (posterior), slices to +z (superior); the origin is 0.

    Raises
    ------
    UnreadableError, FormatError, GeometryError, ResourceError
        As the pages demand; `FormatError` too where the package is not installed.
    """
    name = str(existing_file(path))
    with opened(path, name) as pages:
        found = stack_of(pages.series, name)
        spacing, notes = _spacing(pages, settings, name)
        stored, more = _stored(found, path, name)
    return Volume.from_stored(stored, upright(spacing), notes=notes + more)


def read_page(path: Path) -> tuple[NDArray[Any], tuple[str, ...]]:
    """Return the pixels (J, I), or (J, I, 3), of a file of one page, and notes.

    Raises
    ------
    FormatError, ResourceError
        As the page demands; `FormatError` too where the package is not installed.
    """
    with opened(path, path.name) as pages:
        if len(pages.pages) > 1:
            raise FormatError("the file holds several pages", file=path.name, expected="one slice a file")
        stored, notes = _stored(pages.series[:1], path, path.name)
    return stored[0], notes


def _stored(found: list[Any], path: Path, name: str) -> tuple[Any, tuple[str, ...]]:
    """Return the voxels (K, J, I), or (K, J, I, 3), of a stack, and notes."""
    if not read_later():
        require_memory(sum(one.nbytes for one in found), file=name)
    for one in found:
        _check_promise(one, path.stat().st_size, name)
    keyframe, planar = found[0].keyframe, page_axes(found[0]) == "SYX"
    stored = native(_numbers(found, path, name), file=name)
    bits = keyframe.bitspersample if keyframe.photometric == WHITE_IS_ZERO or keyframe.bitspersample == 1 else 0
    stored, turned = bright_is_high(stored, bits)
    stored = layers_last(stored, (0, 2, 3) if planar else (0, 1, 2), file=name)
    voxels, more = gray_or_color(stored, stored.shape[3], file=name)
    return voxels, turned + more


def _numbers(found: list[Any], path: Path, name: str) -> Any:
    """Return the numbers of a stack, slices first, with an axis of 1 behind; or leave them where they are."""
    page = found[0].shape[found[0].ndim - len(page_axes(found[0])) :]
    count = sum(math.prod(one.shape) for one in found) // math.prod(page)
    shape, start = (count, *page, 1), found[0].dataoffset
    if read_later() and len(found) == 1 and start is not None:
        kind = found[0].dtype.newbyteorder(found[0].keyframe.parent.byteorder)
        return LazyVoxels.of(FileNumbers(shape, kind, (Plain(Seen.of(path), start),)))
    if read_later() and len(pages_of(found)) == count:
        return LazyVoxels.of(Pages(shape, found[0].dtype, Seen.of(path), name))
    require_memory(sum(one.nbytes for one in found), file=name)
    parts = [one.asarray() for one in found]
    if any(part.shape != one.shape for part, one in zip(parts, found, strict=True)):
        raise ValueError(parts[0].shape)
    return (parts[0] if len(parts) == 1 else np.stack(parts)).reshape(shape)


def _check_promise(series: Any, size: int, name: str) -> None:
    """Compare what the pages promise with the memory and with the file's bytes."""
    keyframe = series.keyframe
    chunk = math.prod(keyframe.chunks) * keyframe.dtype.itemsize
    require_memory(chunk, file=name)
    if series.dataoffset is not None:
        require_bytes(series.dataoffset + series.nbytes, size, file=name)
        return
    packed = 0
    for page in series.pages:
        if page is None:
            raise FormatError("a page is missing", file=name, expected=f"{len(series.pages)} pages")
        ends = [start + count for start, count in zip(page.dataoffsets, page.databytecounts, strict=True)]
        require_bytes(max(ends, default=0), size, file=name)
        packed += sum(page.databytecounts)
    stored = series.nbytes // 8 if keyframe.bitspersample == 1 else series.nbytes  # bits are unpacked into bytes
    require_bytes(stored, packed * (1 if keyframe.compression == 1 else TIFF_RATIO), file=name)
    if keyframe.compression not in UNPACKED_WITHOUT:
        required("imagecodecs", file=name)


def _spacing(pages: Any, settings: ReadSettings, name: str) -> Spacing:
    """Return the distances in mm, and notes: the file's own, else those that were given."""
    own = _of_ome(pages.ome_metadata, name) if pages.is_ome else _of_imagej(pages) if pages.is_imagej else None
    if own is None:
        return required_spacing(settings.spacing, file=name), (GIVEN,)
    factors = [factor for factor in map(millimeters, own[1]) if factor is not None]
    if len(factors) < len(own[1]):
        named = ", ".join(unit[:20] or "none" for unit in own[1])
        what = f"the file does not say how far its voxels are apart (units of x, y, z: {named})"
        return required_spacing(settings.spacing, file=name, what=what), (GIVEN,)
    check_spacing(own[0], ["spacing along x", "spacing along y", "spacing along z"], file=name, hint="another file")
    placed = tuple(value * factor for value, factor in zip(own[0], factors, strict=True))
    return placed, (UNTURNED, *passed_over(settings.spacing))


def _of_ome(text: str, name: str) -> Spacing | None:
    """Return what OME-XML says of the first image, None where it is not all there."""
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise FormatError("the OME text declares entities", file=name, expected="plain OME-XML")
    with third_party("the XML parser", name):
        pixels = ElementTree.fromstring(text).find(".//{*}Pixels")
        sizes = [] if pixels is None else [pixels.get(f"PhysicalSize{axis}") for axis in "XYZ"]
        if pixels is None or None in sizes:
            return None
        units = tuple(pixels.get(f"PhysicalSize{axis}Unit", "µm") for axis in "XYZ")
        return tuple(float(size or "nan") for size in sizes), units


def _of_imagej(pages: Any) -> Spacing | None:
    """Return what ImageJ says: the distance of slices in its text, pixels per unit as the resolution.

    It leaves out a distance of 1, and the units of rows and slices where they are that of columns.
    """
    told, tags = pages.imagej_metadata or {}, pages.pages[0].tags
    if "unit" not in told or not {"XResolution", "YResolution"} <= {tag.name for tag in tags}:
        return None
    per_unit = [tags[axis].value for axis in ("XResolution", "YResolution")]
    across = [below / above if above else math.nan for above, below in per_unit]
    units = tuple(str(told.get(key, told["unit"])) for key in ("unit", "yunit", "zunit"))
    return (*across, abs(float(told.get("spacing", 1.0)))), units
