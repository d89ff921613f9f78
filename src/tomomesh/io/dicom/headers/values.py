"""Numbers of a header's fields, checked."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ....errors import FormatError

if TYPE_CHECKING:
    from numpy.typing import NDArray


def numbers(value: Any, count: int, keyword: str, name: str) -> NDArray[np.float64] | None:
    """Return a field's numbers, None where it is missing or empty.

    Raises
    ------
    FormatError
        Where they are no numbers, or not as many as they must be.
    """
    if value is None or (isinstance(value, str) and not value.strip()) or value == []:
        return None
    values = [value] if isinstance(value, (str, int, float)) else list(value)
    try:
        found = np.array([float(one) for one in values])
    except (TypeError, ValueError):
        raise FormatError("a field holds no numbers", file=name, found=keyword) from None
    if len(found) != count:
        raise FormatError(
            "a field has too few or too many numbers",
            file=name,
            found=f"{keyword} = {len(found)} numbers",
            expected=f"{count}",
        )
    return found
