"""Arrays as kernels take them."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeVar

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

Kind = TypeVar("Kind", bound=np.generic)


def for_kernels(numbers: ArrayLike, kind: type[Kind]) -> NDArray[Kind]:
    """Return numbers of one type, row after row, aligned and writable; a copy only where they are not."""
    return np.require(numbers, kind, ["C", "A", "W"])
