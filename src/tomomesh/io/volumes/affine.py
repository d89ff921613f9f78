"""What an affine must be."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...errors import GeometryError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

GIVEN = "no frame in the file: --spacing, columns to the left, rows to the back"
UNTURNED = "no directions in the file: columns to the left, rows to the back, slices up"
NOT_GIVEN = "--spacing is not used: the file holds its own"
"""Notes on where a frame came from."""

SPACING_HINT = "--spacing x y z"
"""What to try where a file does not say how far its voxels are apart."""

SMALLEST_SPACING = 1e-6
"""Shorter distances of voxels are taken for a broken header; in the file's own unit. In mm it is a nanometer, below the
voxels of light, X-rays and scanning electrons."""

LEAST_VOLUME = 1e-3
"""An affine whose unit columns span less is flat: one axis is within .06 degrees of the plane of the others."""


def check_spacing(values: Sequence[float], fields: Sequence[str], *, file: str, hint: str) -> None:
    """Refuse spacings that no scanner writes.

    Raises
    ------
    GeometryError
        For 0, negative, NaN, infinite and vanishing values; it names the field.
    """
    for value, field in zip(values, fields, strict=True):
        if not (np.isfinite(value) and value >= SMALLEST_SPACING):
            raise GeometryError(
                "the spacing of the voxels is invalid",
                file=file,
                found=f"{field} = {value:g}",
                expected=f"a finite number of at least {SMALLEST_SPACING:g}",
                hint=hint,
            )


def check_affine(affine: NDArray[np.float64], *, file: str, hint: str) -> None:
    """Refuse an affine that flattens the voxels.

    Raises
    ------
    GeometryError
        Where it is singular, or holds NaN or infinite values.
    """
    columns = affine[:3, :3]
    with np.errstate(over="ignore", invalid="ignore"):  # what is too long for a square is infinite below
        lengths = np.sqrt((columns**2).sum(axis=0))
    if np.isfinite(affine).all() and lengths.min() >= SMALLEST_SPACING:
        volume = abs(float(np.linalg.det(columns / lengths)))
        if volume >= LEAST_VOLUME:
            return
    raise GeometryError(
        "the affine is singular",
        file=file,
        found=f"column lengths = {', '.join(f'{length:g}' for length in lengths)}",
        expected="three independent axes of finite length",
        hint=hint,
    )


def required_spacing(
    spacing: tuple[float, ...] | None, *, file: str, what: str = "the file does not say how far its voxels are apart"
) -> tuple[float, ...]:
    """Return the spacing that was given for a file that holds none.

    Raises
    ------
    GeometryError
        Where none was.
    """
    if spacing is None:
        raise GeometryError(what, file=file, expected="the distance of the voxels in mm", hint=SPACING_HINT)
    return spacing


def brought_to_mm(factor: float) -> tuple[str, ...]:
    """Return the note on coordinates that are in another unit."""
    return () if factor == 1 else (f"coordinates were brought to millimeters: x {factor:g}",)


def passed_over(spacing: Sequence[float] | None) -> tuple[str, ...]:
    """Return the note on a spacing that was given for a file that holds its own."""
    return (NOT_GIVEN,) if spacing else ()


def upright(spacing: Sequence[float]) -> NDArray[np.float64]:
    """Return the affine of slices without a frame of their own.

    Columns run to +x (left), rows to +y (posterior), slices to +z (superior); the origin is 0.
    """
    return np.diag([*spacing, 1.0])
