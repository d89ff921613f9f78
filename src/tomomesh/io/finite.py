"""Coordinates that are numbers."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..errors import FormatError

if TYPE_CHECKING:
    from numpy.typing import NDArray


def check_finite(positions: NDArray[np.float64], row: str, *, file: str) -> None:
    """Refuse NaN and infinite coordinates.

    Raises
    ------
    FormatError
        It names the first row, from 1.
    """
    if np.isfinite(positions).all():
        return
    broken = ~np.isfinite(positions).all(axis=1)
    raise FormatError(
        "a coordinate is not finite",
        file=file,
        found=f"{row} {int(broken.argmax()) + 1}, {int(broken.sum())} in all",
        expected="finite numbers",
    )
