"""What a NIfTI header promises, checked: nibabel knows the fields, but would repair them in silence."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import FormatError, GeometryError
from ..files.limits import require_bytes
from ..files.source import third_party
from .gray import check_scale

if TYPE_CHECKING:
    from ...settings import ReadSettings

NIFTI_HEADERS = {348: "Nifti1Header", 540: "Nifti2Header"}
"""Header lengths in bytes (nifti1.h, nifti2.h), and nibabel's classes for them."""

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

    @property
    def promised(self) -> int:
        """Bytes of all voxels."""
        return self.shape[0] * self.shape[1] * self.shape[2] * self.dtype.itemsize


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
    nibabel.Nifti1Header or nibabel.Nifti2Header
        Without form, unit and intercept where the file is Analyze 7.5.

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
    import nibabel

    with third_party("nibabel", file):
        header = getattr(nibabel, NIFTI_HEADERS[size])(start[:size], check=False)
    for field in ANALYZE_LACKS if analyze else ():
        header[field] = 0
    return header


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
    from nibabel.nifti1 import data_type_codes

    code = int(header["datatype"])
    dtype: np.dtype[Any] = np.dtype(data_type_codes.dtype.get(code, np.void))
    if not dtype.itemsize:  # 0 and 1, an unknown kind and single bits, have none either
        raise FormatError("the voxels are of an unknown kind", file=file, found=f"datatype = {code}")
    return dtype.newbyteorder(header.endianness)
