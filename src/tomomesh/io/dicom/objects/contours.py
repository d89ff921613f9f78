"""The corners of a structure's closed contours, checked one by one."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ....errors import FormatError
from ..headers.values import numbers
from .rings import parted

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

CLOSED, OPEN = ("CLOSED_PLANAR", "CLOSEDPLANAR_XOR"), "OPEN_PLANAR"
"""Kinds of contours that enclose an area, and the kind that does where its ends meet."""


def ends_meet(item: Any) -> bool:
    """Tell whether the ends of an open contour are no farther apart than its longest side; no for a broken one."""
    try:
        corners = _corners(item, "", "")
    except FormatError:
        return False
    sides = np.linalg.norm(np.diff(corners, axis=0), axis=1)
    return len(corners) > 2 and bool(np.linalg.norm(corners[0] - corners[-1]) <= sides.max())


def corners_of(items: Sequence[Any], *, where: str, file: str, skip_flat: bool = False) -> list[Floats]:
    """Return the corners (u, 3) of contours in millimeters, LPS.

    Parameters
    ----------
    items : sequence of pydicom Dataset
        Closed contours.
    where : str
        The structure, for errors.
    file : str
        The bare name of the file.
    skip_flat : bool
        Whether contours that enclose nothing are left out.

    Raises
    ------
    FormatError
        For a contour that is not as it says, encloses nothing or repeats another; it names the contour.
    """
    contours: list[Floats] = []
    seen: dict[frozenset[tuple[float, ...]], int] = {}
    for number, item in enumerate(items, 1):
        told = f"{where}, contour {number}"
        corners = _corners(item, told, file)
        if not parted(corners):
            if skip_flat:
                continue
            raise FormatError(
                "a contour encloses nothing",
                file=file,
                found=f"{told}: {len(corners)} corners",
                expected="three corners off one line",
                hint="--skip-flat, which leaves such contours out",
            )
        key = frozenset(map(tuple, corners.tolist()))
        if (first := seen.setdefault(key, number)) != number:
            raise FormatError(
                "a contour is repeated",
                file=file,
                found=f"{told}: the same corners as contour {first}",
                expected="each contour once, as overlapping ones cancel out",
            )
        contours.append(corners)
    return contours


def _corners(item: Any, told: str, file: str) -> Floats:
    values = _values(item, told, file)
    if len(values) % 3 or not len(values):
        raise FormatError(
            "a contour has an incomplete corner" if len(values) else "a contour has no corners",
            file=file,
            found=f"{told}: ContourData = {len(values)} numbers",
            expected="three a corner",
        )
    promised = numbers(item.get("NumberOfContourPoints"), 1, "NumberOfContourPoints", file)
    if promised is not None and promised[0] != len(values) // 3:
        raise FormatError(
            "a contour has another number of corners than it says",
            file=file,
            found=f"{told}: ContourData = {len(values) // 3} corners",
            expected=f"{promised[0]:g}, as NumberOfContourPoints",
        )
    return values.reshape(-1, 3)


def _values(item: Any, told: str, file: str) -> Floats:
    """Return the numbers of a contour, without a Python object for each where the file is as it was read."""
    element = item.get_item("ContourData")
    value = None if element is None else element.value
    parts = value.strip(b" \0").rstrip(b"\\").split(b"\\") if isinstance(value, bytes) else value
    try:
        values = np.array([] if parts is None else parts).astype(np.float64).reshape(-1)
    except (TypeError, ValueError):
        raise FormatError("a contour holds what is no number", file=file, found=f"{told}: ContourData") from None
    if not np.isfinite(values).all():
        raise FormatError(
            "a contour is not finite",
            file=file,
            found=f"{told}: corner {int(np.flatnonzero(~np.isfinite(values))[0]) // 3 + 1}",
        )
    return values
