"""What is taken over all points of a cloud, for its parts to know."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable


@dataclass(frozen=True)
class Whole:
    """What is taken over all points of a cloud, each found where it is first asked for.

    A part of a cloud is handed that of the whole cloud, and settles as it does there.

    Attributes
    ----------
    values : dict of str
        Corners where cubes begin, the sampling distance, counts and medians, by what they are of.
    """

    values: dict[str, Any] = field(default_factory=dict)

    def get(self, name: str, find: Callable[[], Any]) -> Any:
        """Return what is known, or what is found, and know it from then on."""
        if name not in self.values:
            self.values[name] = find()
        return self.values[name]
