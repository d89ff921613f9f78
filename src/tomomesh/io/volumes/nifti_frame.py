"""Where a NIfTI header puts the voxels: RAS becomes LPS here."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import FormatError, GeometryError
from .affine import (
    GIVEN,
    SMALLEST_SPACING,
    SPACING_HINT,
    brought_to_mm,
    check_affine,
    check_spacing,
    passed_over,
    upright,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...settings import ReadSettings

    Affine = NDArray[np.float64]

FLIP = np.diag([-1.0, -1.0, 1.0, 1.0])
"""RAS to LPS and back."""
NIFTI_UNITS_MM = {0: 1.0, 1: 1000.0, 2: 1.0, 3: 0.001}
"""Millimeters in the header's units of space (nifti1.h): unknown, meter, millimeter, micron."""
UNPLACED = "no orientation in the file (sform_code = qform_code = 0): taken for columns right, rows front, slices up"
"""The note on a file of the standard's method 1."""
FORMS = ("sform", "qform")
APART = 0.1
"""Part of a voxel by which the two forms may differ at the corners of the volume without a word: interpolation would
not show it. A form in 32 bits is off by a ten-thousandth of that."""
LONGEST = 1.01
"""A quaternion's three numbers that are longer than 1, as rounding makes them, are brought to it, up to this length."""
ROUNDED = 1e-7
"""What is left to the fourth number's square that is taken for rounding (nifti1_io.c); nibabel takes as much as three
units in the last place of 1, which is more in 32 bits."""


def frame_of(
    header: Any, settings: ReadSettings, shape: tuple[int, ...], name: str
) -> tuple[Affine, tuple[str, ...], str]:
    """Return where a header puts the voxels.

    Parameters
    ----------
    header : record
        From `nifti_header.unpack_header`.
    settings : ReadSettings
        `nifti_form` chooses between two forms; `spacing` stands in for what there is not.
    shape : (I, J, K)
    name : str
        The path as the user typed it.

    Returns
    -------
    affine : (4, 4) float array
        Index to millimeters, LPS.
    notes : tuple of str
    other : str
        The option that takes the file's other form, where it has two that disagree.

    Raises
    ------
    GeometryError, FormatError
        For forms, sizes and units that cannot be.
    """
    pixdim = [float(size) for size in header["pixdim"][1:4]]
    forms = [form for form in FORMS if int(header[f"{form}_code"]) > 0]
    forms.sort(key=lambda form: form != settings.nifti_form)
    broken = not forms or not all(SMALLEST_SPACING <= size < np.inf for size in pixdim)
    if settings.spacing and broken:
        return upright(settings.spacing), (GIVEN,), ""
    check_spacing(pixdim, ["pixdim[1]", "pixdim[2]", "pixdim[3]"], file=name, hint=SPACING_HINT)
    unit, notes = _unit(header, name)
    scale = np.diag([unit, unit, unit, 1.0]) @ FLIP
    affine = scale @ (_form(header, forms[0], name) if forms else upright(pixdim))
    check_affine(affine, file=name, hint="a file with a valid sform")
    other, apart = _other(header, forms, scale, affine, shape)
    return affine, (() if forms else (UNPLACED,)) + apart + notes + passed_over(settings.spacing), other


def _form(header: Any, form: str, name: str) -> Affine:
    """Return the matrix of a form, RAS."""
    placed = np.eye(4)
    if form == "sform":
        placed[:3] = header["srow"]
        return placed
    sizes = header["pixdim"][1:4] * [1, 1, -1 if header["pixdim"][0] < 0 else 1]
    placed[:3, :3], placed[:3, 3] = _turned(header["quatern"], name) * sizes, header["qoffset"]
    return placed


def _turned(quaternion: NDArray[Any], name: str) -> NDArray[Any]:
    """Return the turn (3, 3) of a unit quaternion whose last three numbers are given (nifti1.h, method 2)."""
    x, y, z = axis = quaternion.astype(np.longdouble)
    if not (squared := axis @ axis) <= LONGEST**2:  # nor is it where a number is none
        raise FormatError(
            "the quaternion is no turn", file=name, found=f"length = {np.sqrt(squared):.4g}", expected="at most 1"
        )
    w = 0 * x if 1 - squared < max(ROUNDED, 3 * np.finfo(quaternion.dtype).eps) else np.sqrt(1 - squared)
    crossed = np.array([[0 * x, -z, y], [z, 0 * x, -x], [-y, x, 0 * x]])
    return np.asarray(np.eye(3) + 2 / (w * w + squared) * (w * crossed + crossed @ crossed))


def _other(
    header: Any, forms: list[str], scale: Affine, affine: Affine, shape: tuple[int, ...]
) -> tuple[str, tuple[str, ...]]:
    """Return the option that takes the other form, and a note, where there are two that put voxels apart."""
    if len(forms) < 2:
        return "", ()
    try:
        other = scale @ _form(header, forms[1], "")
    except FormatError:
        return "", ()
    corners = np.array(list(np.ndindex(2, 2, 2))) * (np.array(shape) - 1.0)
    apart = corners @ (other - affine)[:3, :3].T + (other - affine)[:3, 3]
    most = float(np.sqrt((apart**2).sum(axis=1)).max())
    if not most > APART * float(np.sqrt((affine[:3, :3] ** 2).sum(axis=0)).min()):
        return "", ()
    option = f"--nifti-form {forms[1]}"
    return option, (
        f"{forms[0]} and {forms[1]} disagree by up to {most:.4g} mm: {forms[0]} was taken, {option} takes the other",
    )


def _unit(header: Any, name: str) -> tuple[float, tuple[str, ...]]:
    code = int(header["xyzt_units"]) & 7
    if code not in NIFTI_UNITS_MM:
        raise GeometryError(
            "the unit of the coordinates is unknown",
            file=name,
            found=f"xyzt_units = {code}",
            expected="0 to 3",
        )
    factor = NIFTI_UNITS_MM[code]
    return factor, brought_to_mm(factor)
