"""What a NIfTI header promises, checked.

The fields are read here: nibabel would repair some in silence, and takes as long to import as a study to reconstruct.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from ...errors import FormatError, GeometryError
from ..files.limits import require_bytes
from .gray import check_scale

if TYPE_CHECKING:
    from ...settings import ReadSettings

NIFTI_HEADERS: dict[int, dict[str, tuple[str, int]]] = {
    348: {
        **{"sizeof_hdr": ("i4", 0), "dim": ("8i2", 40), "datatype": ("i2", 70), "pixdim": ("8f4", 76)},
        **{"vox_offset": ("f4", 108), "scl_slope": ("f4", 112), "scl_inter": ("f4", 116), "xyzt_units": ("u1", 123)},
        **{"qform_code": ("i2", 252), "sform_code": ("i2", 254), "quatern": ("3f4", 256), "qoffset": ("3f4", 268)},
        "srow": ("(3,4)f4", 280),
    },
    540: {
        **{"sizeof_hdr": ("i4", 0), "dim": ("8i8", 16), "datatype": ("i2", 12), "pixdim": ("8f8", 104)},
        **{"vox_offset": ("i8", 168), "scl_slope": ("f8", 176), "scl_inter": ("f8", 184), "xyzt_units": ("i4", 500)},
        **{"qform_code": ("i4", 344), "sform_code": ("i4", 348), "quatern": ("3f8", 352), "qoffset": ("3f8", 376)},
        "srow": ("(3,4)f8", 400),
    },
}
"""Header lengths in bytes, and of each field we read its type and first byte (nifti1.h, nifti2.h)."""

DATA_TYPES = {
    **{2: "u1", 4: "i2", 8: "i4", 16: "f4", 32: "c8", 64: "f8", 128: "u1,u1,u1", 256: "i1", 512: "u2", 768: "u4"},
    **{1024: "i8", 1280: "u8", 1792: "c16", 2304: "u1,u1,u1,u1"},
}
"""Codes of data types (nifti1.h), but for those of no use here: bits, and numbers of 128 bits."""

MAGIC_AT = {348: 344, 540: 4}
"""Byte at which a header of each length says what it is."""

MAGIC = {True: (b"ni1\0", b"ni2\0"), False: (b"n+1\0", b"n+2\0")}
"""What it says: for a pair of files, and for one."""

ANALYZE_LACKS = ("qform_code", "sform_code", "xyzt_units", "scl_inter")
"""Fields of NIfTI in whose bytes Analyze 7.5 keeps something else."""


@dataclass(frozen=True)
class NiftiLayout:
    """Where the voxels are, and of what kind.

    Attributes
    ----------
    shape : tuple of int
        Sizes I, J, K as they are stored, fastest first.
    dtype : data type
        Of one voxel.
    offset : int
        Bytes before the first voxel.
    slope, intercept : float
        Scale of the gray levels; 1 and 0 where the header has none.
    notes : tuple of str
        What of the header is not used.
    """

    shape: tuple[int, int, int]
    dtype: np.dtype[Any]
    offset: int
    slope: float
    intercept: float
    notes: tuple[str, ...] = ()


def unpack_header(start: bytes, settings: ReadSettings, *, paired: bool, file: str) -> Any:
    """Return the header among a file's first bytes, with the fields as they stand.

    Parameters
    ----------
    start : bytes
        As many as the longest header has, where the file has them.
    settings : ReadSettings
        With a `spacing`, Analyze 7.5 is read too.
    paired : bool
        Whether the voxels are in another file.

    Returns
    -------
    record
        Its fields by their names; without form, unit and intercept where the file is Analyze 7.5.

    Raises
    ------
    FormatError
        For a file of another kind, and where the header is cut off.
    GeometryError
        For Analyze 7.5, which does not say which side is left.
    """
    require_bytes(min(NIFTI_HEADERS), len(start), file=file)
    size = next((n for n in NIFTI_HEADERS if n in (_int(start, "<"), _int(start, ">"))), 0)
    analyze = paired and size == 348 and not start[344:].startswith(b"n")
    if not analyze and start[MAGIC_AT.get(size, 0) :][:4] not in MAGIC[paired]:
        expected = "NIfTI-1 or NIfTI-2 in " + ("a pair of files" if paired else "one file")
        raise FormatError("the file is no NIfTI file", file=file, expected=expected)
    if analyze and settings.spacing is None:
        raise GeometryError(
            "Analyze 7.5 does not say which side is left",
            file=file,
            expected="NIfTI, with an sform or a qform",
            hint="a NIfTI copy made where it is known, or --spacing x y z: columns to the left, rows to the back",
        )
    require_bytes(size, len(start), file=file)
    header = np.frombuffer(start, _fields(size, "<" if _int(start, "<") == size else ">"), 1).copy()[0]
    for field in ANALYZE_LACKS if analyze else ():
        header[field] = 0
    return header


def _fields(size: int, order: Literal["<", ">"]) -> np.dtype[Any]:
    fields = NIFTI_HEADERS[size]
    formats, offsets = zip(*fields.values(), strict=True)
    return np.dtype({"names": [*fields], "formats": formats, "offsets": offsets, "itemsize": size}).newbyteorder(order)


def _int(start: bytes, order: str) -> int:
    return int(np.frombuffer(start, f"{order}i4", 1)[0])


def layout_of(header: Any, *, paired: bool, file: str) -> NiftiLayout:
    """Return what a header says of the voxels.

    Raises
    ------
    FormatError
        For sizes, types, scales and places that cannot be, and for several frames.
    """
    slope, intercept = float(header["scl_slope"]), float(header["scl_inter"])
    notes = () if np.isfinite(slope) else (f"scl_slope = {slope:g}: gray levels as they are stored",)
    if slope == 0 or notes:  # 0 is the standard's way to say: not scaled; its own readers take NaN for that
        slope, intercept = 1.0, 0.0
    check_scale(slope, intercept, file=file)
    offset = float(header["vox_offset"])
    if not offset >= (0 if paired else int(header["sizeof_hdr"])) or not offset.is_integer():
        raise FormatError("the place of the voxels is invalid", file=file, found=f"vox_offset = {offset:g}")
    return NiftiLayout(_shape(header, file), _dtype(header, file), int(offset), slope, intercept, notes)


def _shape(header: Any, file: str) -> tuple[int, int, int]:
    dim, ndim = [int(size) for size in header["dim"]], int(header["dim"][0])
    if not 2 <= ndim <= 7 or min(dim[1 : ndim + 1]) < 1:
        raise FormatError("the sizes of the volume are invalid", file=file, found=f"dim = {dim}", expected="all over 0")
    sizes = [*dim[1 : ndim + 1], 1][: max(ndim, 3)]
    if any(size > 1 for size in sizes[3:]):
        several = "values a voxel" if max(sizes[4:], default=1) > 1 else "frames"
        raise FormatError(
            f"the file holds several {several}",
            file=file,
            found=f"dim = {sizes}",
            expected="one volume",
            hint="one of them, written to a file of its own",
        )
    return sizes[0], sizes[1], sizes[2]


def _dtype(header: Any, file: str) -> np.dtype[Any]:
    code = int(header["datatype"])
    if code not in DATA_TYPES:
        raise FormatError("the voxels are of an unknown kind", file=file, found=f"datatype = {code}")
    return np.dtype(DATA_TYPES[code]).newbyteorder(header["dim"].dtype.byteorder)
