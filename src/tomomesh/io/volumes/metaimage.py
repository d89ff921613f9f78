"""MetaImage studies, with the voxels behind the header (``.mha``) or beside it (``.mhd``).

The header is read by hand, in thirty lines: the library that knows the format is ITK itself, 50 MB, which opens
whatever file the header names. It judges this reader in the tests.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import FormatError, GeometryError
from ...model.units import millimeters
from ...model.volume import Volume
from ..files.detached import beside, check_count, numbered
from ..files.unpack import PLAIN, ZLIB
from .affine import (
    GIVEN,
    SPACING_HINT,
    UNTURNED,
    brought_to_mm,
    check_affine,
    check_spacing,
    passed_over,
    required_spacing,
    upright,
)
from .raster import TEXT, Raster, floats_of, gray_or_color, header_bytes, read_raster, sizes_of

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from ...settings import ReadSettings
    from .raster import HeaderFields

META_TYPES = {
    "MET_CHAR": "i1", "MET_UCHAR": "u1", "MET_SHORT": "i2", "MET_USHORT": "u2", "MET_INT": "i4", "MET_UINT": "u4",
    "MET_LONG": "i4", "MET_ULONG": "u4", "MET_LONG_LONG": "i8", "MET_ULONG_LONG": "u8",
    "MET_FLOAT": "f4", "MET_DOUBLE": "f8",
}  # fmt: skip
"""The format's types to NumPy's codes."""

DIRECTIONS = ("TransformMatrix", "Rotation", "Orientation")
ORIGINS = ("Offset", "Position", "Origin")
"""Names of one field, in the order in which they are looked for."""

LAST_LINE = re.compile(rb"^[ \t]*ElementDataFile[ \t]*=[^\n]*(\n|\Z)", re.MULTILINE)
"""The line that ends the header."""


def read_metaimage(path: Path, settings: ReadSettings) -> Volume:
    """Read a study, or a label map, from a ``.mha`` or ``.mhd`` file.

    Parameters
    ----------
    path : Path
        The file; data files of a ``.mhd`` must be in its folder.
    settings : ReadSettings
        `spacing` stands in for one that the file does not hold.

    Returns
    -------
    Volume
        In patient millimeters, LPS, which the format's physical space is.

    Raises
    ------
    UnreadableError, FormatError, GeometryError, ResourceError
        As the header or the voxels demand.
    """
    name = str(path)
    start = header_bytes(path)
    fields, length = _parse(start, name)
    sizes = _sizes(fields, name)
    affine, notes = _frame(fields, settings, name)
    channels = _channels(fields, name)
    stored = read_raster(_raster(fields, (*sizes[::-1], channels), path, start, length), file=name)
    voxels, more = gray_or_color(stored, channels, file=name, named=False)
    return Volume.from_stored(voxels, affine, notes=notes + more)


def _parse(start: bytes, name: str) -> tuple[HeaderFields, int]:
    """Return the fields, and the bytes up to the voxels."""
    last = LAST_LINE.search(start)
    lines = start[: last.end() if last else 0].decode("utf-8", "replace").splitlines()
    fields = {key.strip(): value.strip() for key, _, value in (line.partition("=") for line in lines)}
    missing = [field for field in ("NDims", "DimSize", "ElementType") if field not in fields]
    if last is None or missing or fields.get("ObjectType", "Image") != "Image":
        raise FormatError(
            "the file has no MetaImage header",
            file=name,
            found=f"missing = {', '.join(missing)}" if last and missing else "",
            expected="an image, and ElementDataFile as the last field",
        )
    return fields, last.end()


def _sizes(fields: HeaderFields, name: str) -> tuple[int, ...]:
    """Return the sizes of columns, rows and slices."""
    if fields["NDims"] not in ("2", "3", "4"):
        raise FormatError("the sizes of the volume are invalid", file=name, found=f"NDims = {fields['NDims'][:80]}")
    sizes = sizes_of(fields["DimSize"].split(), int(fields["NDims"]), "DimSize", file=name)
    if len(sizes) < 3:
        found = f"DimSize = {fields['DimSize']}"
        raise GeometryError("the file holds one slice", file=name, found=found, expected="a stack of slices")
    if sizes[3:] > (1,):
        raise FormatError("the file holds several frames", file=name, found=f"DimSize = {fields['DimSize']}")
    return sizes[:3]


def _channels(fields: HeaderFields, name: str) -> int:
    return sizes_of([fields.get("ElementNumberOfChannels", "1")], 1, "ElementNumberOfChannels", file=name)[0]


def _frame(fields: HeaderFields, settings: ReadSettings, name: str) -> tuple[NDArray[np.float64], tuple[str, ...]]:
    """Return the affine in millimeters, LPS, and notes."""
    spacing = _numbers(fields, ("ElementSpacing", "ElementSize"), 1, name)
    if spacing is None:
        return upright(required_spacing(settings.spacing, file=name)), (GIVEN,)
    check_spacing(spacing.tolist(), [f"ElementSpacing[{n}]" for n in range(3)], file=name, hint=SPACING_HINT)
    matrix, origin = _numbers(fields, DIRECTIONS, 2, name), _numbers(fields, ORIGINS, 1, name)
    affine, (factor, brought) = np.eye(4), _unit(fields, name)
    affine[:3, :3] = (np.eye(3) if matrix is None else matrix.T) * spacing
    affine[:3, 3] = 0.0 if origin is None else origin
    affine[:3] *= factor
    check_affine(affine, file=name, hint="a file with a valid TransformMatrix")
    notes = (UNTURNED,) if matrix is None else ()
    return affine, notes + brought + passed_over(settings.spacing)


def _unit(fields: HeaderFields, name: str) -> tuple[float, tuple[str, ...]]:
    """Return the millimeters in the file's unit, and a note; none, or a question mark, is taken for millimeters."""
    unit = fields.get("DistanceUnits", "?").strip()
    factor = 1.0 if unit in ("", "?") else millimeters(unit)
    if factor is None:
        found = f"DistanceUnits = {unit[:80]}"
        raise GeometryError("the unit of the coordinates is unknown", file=name, found=found, expected="um | mm | cm")
    return factor, brought_to_mm(factor)


def _numbers(fields: HeaderFields, names: tuple[str, ...], rank: int, name: str) -> NDArray[np.float64] | None:
    """Return the first field that is there: 3 numbers, or 3 x 3, of as many dimensions as the file has."""
    field = next((one for one in names if one in fields), "")
    if not field:
        return None
    numbers, count = floats_of(fields[field].split(), field, file=name), int(fields["NDims"])
    if len(numbers) != count**rank:
        found = f"{field} = {fields[field][:80]}"
        raise FormatError(
            "a field of the header has another length", file=name, found=found, expected=f"{count**rank} numbers"
        )  # fmt: skip
    return numbers.reshape((count,) * rank)[(slice(3),) * rank]


def _raster(fields: HeaderFields, shape: tuple[int, ...], path: Path, start: bytes, length: int) -> Raster:
    name, kind = str(path), fields["ElementType"].removesuffix("_ARRAY")
    if kind not in META_TYPES:
        found = f"ElementType = {fields['ElementType'][:80]}"
        raise FormatError("the voxels are of an unknown kind", file=name, found=found)
    big = _is_true(fields, "BinaryDataByteOrderMSB") or _is_true(fields, "ElementByteOrderMSB")
    dtype: np.dtype[Any] = np.dtype((">" if big else "<") + META_TYPES[kind])
    packing = ZLIB if _is_true(fields, "CompressedData") else PLAIN
    if fields.get("BinaryData", "True").lower() == "false":
        packing = TEXT
    before = fields.get("HeaderSize", "0")
    if not re.fullmatch(r"-1|[0-9]{1,15}", before):
        raise FormatError("a field of the header is no number", file=name, found=f"HeaderSize = {before[:80]}")
    named = fields["ElementDataFile"]
    if named.upper() == "LOCAL":
        return Raster(shape, dtype, packing, (path,), length)
    return Raster(shape, dtype, packing, _parts(named, path, start[length:]), int(before))


def _is_true(fields: HeaderFields, field: str) -> bool:
    return fields.get(field, "").lower() in ("true", "1")


def _parts(named: str, path: Path, behind: bytes) -> tuple[Path, ...]:
    """Return the data files: one, those of a pattern, or those whose names stand behind the header."""
    words = named.split()
    if words[:1] == ["LIST"]:
        names = [line.strip() for line in behind.decode("utf-8", "replace").splitlines() if line.strip()]
        check_count(len(names), path)
        return tuple(beside(path, one) for one in names)
    if "%" in named:
        return tuple(numbered(path, words))
    return (beside(path, named),)
