"""NRRD studies, with the voxels behind the header (``.nrrd``) or beside it (``.nhdr``).

The header is read by hand, in forty lines: what pynrrd and ITK do beyond that, opening whatever file the header names
and allocating whatever it promises, is what a reader of unknown files must not do. Both judge this one in the tests.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import numpy as np

from ....errors import FormatError
from ....model.volume import Volume
from ...files.detached import beside, check_count, numbered
from ...files.source import first_bytes
from ...files.unpack import BZIP2, GZIP, PLAIN
from ..raster import (
    HEX,
    LONGEST_HEADER,
    TEXT,
    Raster,
    gray_or_color,
    header_bytes,
    layers_last,
    many_levels,
    read_raster,
    sizes_of,
)
from .nrrd_frame import frame_of, is_spatial
from .segments import Segment, label_map, segments_in

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from ....settings import ReadSettings
    from ..raster import HeaderFields

TYPE_WORDS = {
    "i1": ("signed char", "int8", "int8_t"),
    "u1": ("uchar", "unsigned char", "uint8", "uint8_t"),
    "i2": ("short", "short int", "signed short", "signed short int", "int16", "int16_t"),
    "u2": ("ushort", "unsigned short", "unsigned short int", "uint16", "uint16_t"),
    "i4": ("int", "signed int", "int32", "int32_t"),
    "u4": ("uint", "unsigned int", "uint32", "uint32_t"),
    "i8": ("longlong", "long long", "long long int", "signed long long", "signed long long int", "int64", "int64_t"),
    "u8": ("ulonglong", "unsigned long long", "unsigned long long int", "uint64", "uint64_t"),
    "f4": ("float",),
    "f8": ("double",),
}
"""NumPy's codes of the types to the format's names for them."""

NRRD_TYPES = {name: code for code, names in TYPE_WORDS.items() for name in names}

PACKINGS = {
    "raw": PLAIN, "gzip": GZIP, "gz": GZIP, "bzip2": BZIP2, "bz2": BZIP2, "text": TEXT, "txt": TEXT, "ascii": TEXT,
    "hex": HEX,
}  # fmt: skip
"""The format's encodings."""

NRRD_ORDERS = {"little": "<", "big": ">"}

LIST = ""
"""The field under which the names stand that follow ``data file: LIST``."""


COLORS = ("rgb-color", "3-color", "rgba-color", "4-color")
"""The format's kinds of an axis of color, as 3 or 4 bytes."""
ITK_COLORS = ("vector",)
"""What ITK calls that axis where the type of its pixels does not say that they are colors, as SimpleITK's does not."""

KINDLESS = ("", "none", "???")
"""Kinds that say nothing; 3 or 4 bytes are taken for a color then."""


def read_nrrd(path: Path, settings: ReadSettings, select: Sequence[int] | None = None) -> Volume:
    """Read a study, or a label map, from a ``.nrrd`` or ``.nhdr`` file.

    Parameters
    ----------
    path : Path
        The file; data files of a ``.nhdr`` must be in its folder.
    settings : ReadSettings
        `spacing` stands in for one that the file does not hold.
    select : sequence of int, optional
        Of segments in several layers, those that are wanted, which may overlap.

    Returns
    -------
    Volume
        In patient millimeters, LPS.

    Raises
    ------
    UnreadableError, FormatError, GeometryError, ResourceError
        As the header or the voxels demand.
    """
    name = str(path)
    fields, length = _parse(header_bytes(path), name)
    sizes = sizes_of(fields["sizes"].split(), _dimension(fields, name), "sizes", file=name)
    spatial = is_spatial(fields, sizes, file=name)
    affine, notes = frame_of(fields, spatial, settings, file=name)
    segments = segments_in(fields, file=name)
    numbers = read_raster(_raster(fields, sizes, path, length, name), file=name)
    stored = layers_last(numbers, [axis for axis, space in enumerate(spatial[::-1]) if space], file=name)
    if segments:
        voxels, more = label_map(stored, segments, select, file=name)
    else:
        _check_kinds(fields, sizes, spatial, stored, name)
        voxels, more = gray_or_color(stored, stored.shape[3], file=name)
    return Volume.from_stored(voxels, affine, notes=notes + more)


def nrrd_segments(path: Path) -> dict[int, Segment]:
    """Return the segments that a file's header names, by the numbers that they are chosen by.

    Raises
    ------
    UnreadableError, FormatError
        As the header demands.
    """
    return segments_in(_parse(header_bytes(path), str(path))[0], file=str(path))


def _parse(start: bytes, name: str) -> tuple[HeaderFields, int]:
    """Return the fields, their names without spaces, and the keys, as they are; with the bytes up to the voxels.

    The bytes are -1 where no voxels follow.
    """
    end = re.search(rb"\r?\n\r?\n", start)
    if not re.match(rb"NRRD000[1-9]\r?\n", start) or (end is None and len(start) >= LONGEST_HEADER):
        raise FormatError("the file has no NRRD header", file=name, expected="NRRD000n, fields, and an empty line")
    lines = start[: end.start() if end else None].decode("utf-8", "replace").splitlines()[1:]
    fields: HeaderFields = {}
    for number, line in enumerate(lines):
        key, equals, said = line.partition(":=")
        field, colon, value = line.partition(": ")
        if line.startswith("#"):
            continue
        if equals and (not colon or len(key) < len(field)):
            fields[key] = said.strip()
        elif colon:
            fields[field.replace(" ", "").lower()] = value.strip()
        if fields.get("datafile", "").startswith("LIST"):
            fields[LIST] = "\n".join(one for one in lines[number + 1 :] if one.strip())
            break
    missing = [field for field in ("dimension", "sizes", "type", "encoding") if field not in fields]
    if missing:
        raise FormatError("the NRRD header is not whole", file=name, found=f"missing = {', '.join(missing)}")
    return fields, end.end() if end else -1


def _dimension(fields: HeaderFields, name: str) -> int:
    if fields["dimension"] not in ("2", "3", "4", "5", "6"):
        raise FormatError("the sizes of the volume are invalid", file=name, found=f"dimension = {fields['dimension']}")
    return int(fields["dimension"])


def _raster(fields: HeaderFields, sizes: tuple[int, ...], path: Path, length: int, name: str) -> Raster:
    dtype, packing = _dtype(fields, name), PACKINGS.get(fields["encoding"].lower(), "")
    if not packing:
        raise FormatError(
            "the encoding of the voxels is unknown",
            file=name,
            found=f"encoding = {fields['encoding']}",
            expected=" | ".join(PACKINGS),
        )
    parts = _parts(fields, path, length, name)
    lines, skip = (_whole_number(fields, field, name) for field in ("lineskip", "byteskip"))
    start = max([length, 0][bool(fields.get("datafile"))], 0)
    start = _after_lines(parts[0], start, lines, name) if lines > 0 else start
    if packing != PLAIN:
        return Raster((*sizes[::-1], 1), dtype, packing, parts, start, max(skip, 0))
    return Raster((*sizes[::-1], 1), dtype, packing, parts, -1 if skip < 0 else start + skip)


def _dtype(fields: HeaderFields, name: str) -> np.dtype[Any]:
    kind, endian = fields["type"].lower(), fields.get("endian", "").lower()
    if kind not in NRRD_TYPES:
        raise FormatError("the voxels are of an unknown kind", file=name, found=f"type = {fields['type']}")
    code = NRRD_TYPES[kind]
    if code[1] != "1" and PACKINGS.get(fields["encoding"].lower()) != TEXT and endian not in NRRD_ORDERS:
        found = f"endian = {endian or 'missing'}"
        raise FormatError("the byte order of the voxels is unknown", file=name, found=found, expected="little | big")
    return np.dtype(NRRD_ORDERS.get(endian, "<") + code)


def _parts(fields: HeaderFields, path: Path, length: int, name: str) -> tuple[Path, ...]:
    """Return the files that hold the voxels: the file itself, or those that it names."""
    named = fields.get("datafile", "")
    if not named:
        if length < 0:
            raise FormatError("the NRRD header does not end", file=name, expected="an empty line, or a data file")
        return (path,)
    if named.startswith("LIST"):
        names = fields[LIST].splitlines()
        check_count(len(names), path)
        return tuple(beside(path, one.strip()) for one in names)
    if "%" in named:
        return tuple(numbered(path, named.split()))
    return (beside(path, named),)


def _whole_number(fields: HeaderFields, field: str, name: str) -> int:
    value = fields.get(field, "0")
    if not re.fullmatch(r"-1|[0-9]{1,15}", value):
        raise FormatError("a field of the header is no number", file=name, found=f"{field} = {value[:80]}")
    return int(value)


def _after_lines(part: Path, start: int, lines: int, name: str) -> int:
    """Return where the lines end that stand before the voxels."""
    ends = [match.end() for match in re.finditer(rb"\n", first_bytes(part, start + LONGEST_HEADER)[start:])]
    if lines > len(ends):
        raise FormatError(
            "the file has fewer lines than are to be passed over", file=name, found=f"lines = {len(ends)}"
        )
    return start + ends[lines - 1]


def _check_kinds(fields: HeaderFields, sizes: tuple[int, ...], spatial: list[bool], stored: Any, name: str) -> None:
    """Refuse vectors and lists of three bytes, which are no colors, but for those that ITK calls vectors."""
    kinds = fields.get("kinds", "").lower().split()
    if len(kinds) != len(sizes):
        return
    others = [(kind, size) for kind, size, space in zip(kinds, sizes, spatial, strict=True) if not space and size > 1]
    if others and not (
        len(others) == 1 and others[0][0] in (*COLORS, *KINDLESS, *(ITK_COLORS if many_levels(stored) else ()))
    ):
        raise FormatError(
            "the file holds several values a voxel",
            file=name,
            found=", ".join(f"{size} of kind {kind[:20]}" for kind, size in others),
            expected="one gray level, a color, or segments with names",
            hint="one of them, written to a file of its own; or the kind RGB-color in the header, where it is a color",
        )
