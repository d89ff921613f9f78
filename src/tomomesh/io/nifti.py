"""NIfTI studies: RAS becomes LPS here."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import FormatError, GeometryError
from ..model.volume import Volume
from .affine import GIVEN, SMALLEST_SPACING, check_affine, check_spacing, passed_over, upright
from .gray import check_scale, native, scaled, scaled_dtype, without_holes
from .limits import require_bytes
from .source import existing_file, suffix_of, third_party
from .unpack import GZIP, PLAIN, check_promise, fill, unpacked

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from ..settings import ReadSettings

FLIP = np.diag([-1.0, -1.0, 1.0, 1.0])
"""RAS to LPS and back."""

MM_PER_UNIT = {0: 1.0, 1: 1000.0, 2: 1.0, 3: 0.001}
"""Millimeters in the header's unit: unknown, meter, millimeter, micron."""

SIZES = {348: "Nifti1Header", 540: "Nifti2Header"}
"""Header lengths in bytes, and nibabel's classes for them."""

HINT = "--spacing x y z"


@dataclass(frozen=True)
class Layout:
    """What a header promises, checked.

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
    """

    shape: tuple[int, int, int]
    dtype: np.dtype[Any]
    offset: int
    slope: float
    intercept: float

    @property
    def promised(self) -> int:
        """Bytes of all voxels."""
        return self.shape[0] * self.shape[1] * self.shape[2] * self.dtype.itemsize


def read_nifti(path: Path, settings: ReadSettings) -> Volume:
    """Read a study from a ``.nii`` or ``.nii.gz`` file.

    Parameters
    ----------
    path : Path
        The file.
    settings : ReadSettings
        `spacing` stands in for a frame that the file does not hold.

    Returns
    -------
    Volume
        In patient millimeters, LPS. The sform is used where its code is not 0, else the qform.

    Raises
    ------
    UnreadableError, FormatError, GeometryError, ResourceError
        As the header or the voxels demand.
    """
    path, name = existing_file(path), str(path)
    packing = GZIP if suffix_of(path) == ".nii.gz" else PLAIN
    with unpacked(path, packing, file=name) as stream:
        start = stream.read(max(SIZES))
        header = _header(start, name)
        layout = _layout(header, name)
        affine, notes = _frame(header, settings, name)
        check_promise(layout.offset + layout.promised, path.stat().st_size, packing, file=name)
        data = np.empty(layout.promised, np.uint8)
        stream.seek(layout.offset)
        fill(data, stream, file=name)
    stored, more = _gray(data, layout, name)
    return Volume.from_stored(stored, affine, notes=notes + more)


def _header(start: bytes, name: str) -> Any:
    """Unpack the header as it stands: nibabel's own checks would repair it in silence."""
    require_bytes(min(SIZES), len(start), file=name)
    size = next((n for n in SIZES if n in (_int(start, "<"), _int(start, ">"))), 0)
    if not size or not start[344 if size == 348 else 4 :].startswith((b"n+1\0", b"n+2\0")):
        raise FormatError("the file is no NIfTI file", file=name, expected="NIfTI-1 or NIfTI-2 in one file")
    require_bytes(size, len(start), file=name)
    import nibabel

    with third_party("nibabel", name):
        return getattr(nibabel, SIZES[size])(start[:size], check=False)


def _int(start: bytes, order: str) -> int:
    return int(np.frombuffer(start, f"{order}i4", 1)[0])


def _layout(header: Any, name: str) -> Layout:
    dim, ndim = [int(size) for size in header["dim"]], int(header["dim"][0])
    if not 2 <= ndim <= 7 or min(dim[1 : ndim + 1]) < 1:
        raise FormatError("the sizes of the volume are invalid", file=name, found=f"dim = {dim}", expected="all over 0")
    sizes = [*dim[1 : ndim + 1], 1][: max(ndim, 3)]
    if any(size > 1 for size in sizes[3:]):
        raise FormatError(
            "the file holds several frames",
            file=name,
            found=f"dim = {sizes}",
            expected="one volume",
            hint="one frame, written to a file of its own",
        )
    slope, intercept = float(header["scl_slope"]), float(header["scl_inter"])
    if slope == 0:  # the standard's way to say: not scaled
        slope, intercept = 1.0, 0.0
    check_scale(slope, intercept, file=name)
    offset = float(header["vox_offset"])
    if not offset >= int(header["sizeof_hdr"]) or not offset.is_integer():
        raise FormatError("the place of the voxels is invalid", file=name, found=f"vox_offset = {offset:g}")
    return Layout((sizes[0], sizes[1], sizes[2]), _dtype(header, name), int(offset), slope, intercept)


def _dtype(header: Any, name: str) -> np.dtype[Any]:
    from nibabel.nifti1 import data_type_codes

    code = int(header["datatype"])
    dtype: np.dtype[Any] = np.dtype(data_type_codes.dtype.get(code, np.void))
    if not dtype.itemsize:  # 0 and 1, an unknown kind and single bits, have none either
        raise FormatError("the voxels are of an unknown kind", file=name, found=f"datatype = {code}")
    return dtype.newbyteorder(header.endianness)


def _frame(header: Any, settings: ReadSettings, name: str) -> tuple[NDArray[np.float64], tuple[str, ...]]:
    """Return the affine in millimeters, LPS, and notes."""
    pixdim = [float(size) for size in header["pixdim"][1:4]]
    forms = [form for form in ("sform", "qform") if int(header[f"{form}_code"]) > 0]
    broken = not forms or not all(SMALLEST_SPACING <= size < np.inf for size in pixdim)
    if settings.spacing and broken:
        return upright(settings.spacing), (GIVEN,)
    check_spacing(pixdim, ["pixdim[1]", "pixdim[2]", "pixdim[3]"], file=name, hint=HINT)
    if not forms:
        raise GeometryError(
            "the file does not say where its voxels are",
            file=name,
            found="sform_code = 0, qform_code = 0",
            expected="one of them over 0",
            hint=HINT,
        )
    with third_party("nibabel", name):
        affine = np.asarray(header.get_sform() if forms[0] == "sform" else header.get_qform(), np.float64)
    unit, notes = _unit(header, name)
    affine = np.diag([unit, unit, unit, 1.0]) @ FLIP @ affine
    check_affine(affine, file=name, hint="a file with a valid sform")
    return affine, notes + passed_over(settings.spacing)


def _unit(header: Any, name: str) -> tuple[float, tuple[str, ...]]:
    code = int(header["xyzt_units"]) & 7
    if code not in MM_PER_UNIT:
        raise GeometryError(
            "the unit of the coordinates is unknown",
            file=name,
            found=f"xyzt_units = {code}",
            expected="0 to 3",
        )
    factor = MM_PER_UNIT[code]
    return factor, () if factor == 1 else (f"coordinates were brought to millimeters: x {factor:g}",)


def _gray(data: NDArray[np.uint8], layout: Layout, name: str) -> tuple[NDArray[Any], tuple[str, ...]]:
    """Return voxels (K, J, I[, 3]); they are stored fastest axis first."""
    shape = layout.shape[::-1]
    if layout.dtype.names:
        return data.reshape(*shape, len(layout.dtype.names))[..., :3], ()
    stored = native(data.view(layout.dtype).reshape(shape), file=name)
    dtype = scaled_dtype(stored.dtype, [(layout.slope, layout.intercept)])
    return without_holes(scaled(stored, layout.slope, layout.intercept, dtype), file=name)
