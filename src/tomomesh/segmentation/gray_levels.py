"""The gray levels of a study, their padding as background, and the body in them: the same whatever window is chosen."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

from .body import Body
from .padding import as_background, padding_in
from .slabwise.cut import HERE

if TYPE_CHECKING:
    from collections.abc import Hashable

    from ..model.volume import Volume
    from .padding import Padding
    from .slabwise.cut import Cut, Cutting


@dataclass(frozen=True)
class Shown:
    """Gray levels whose padding is background.

    Attributes
    ----------
    volume : Volume
    cut : Cut
        Its voxels.
    padding : Padding or None
    padded, named : int
        Voxels whose level was changed for that; those of them that the file's header calls padding.
    """

    volume: Volume
    cut: Cut
    padding: Padding | None = None
    padded: int = 0
    named: int = 0

    @cached_property
    def body(self) -> Body:
        """The body in a CT, found once."""
        return Body.of(self.volume, self.cut)


class GrayLevels:
    """A study whose windows are chosen: what they have in common is found once.

    Parameters
    ----------
    volume : Volume
    cutting : Cutting, optional
        How it is looked at, slab by slab: no result depends on it.
    """

    def __init__(self, volume: Volume, cutting: Cutting = HERE) -> None:
        self.volume, self.cutting = volume, cutting
        self.cut = cutting.of(volume.voxels)
        self._shown: dict[Hashable, Shown] = {}

    def shown(self, *, guessed: bool) -> Shown:
        """Return the levels with padding as background: that which a header names, and where asked by its looks."""
        padding = padding_in(self.cut, self.volume.padding, guessed=guessed)
        key = None if padding is None else (padding.named, padding.level, padding.axis)
        if key not in self._shown:
            self._shown[key] = self._without(padding)
        return self._shown[key]

    def _without(self, padding: Padding | None) -> Shown:
        if padding is None:
            return Shown(self.volume, self.cut)
        cut, changed, named = as_background(self.cut, padding)
        return Shown(replace(self.volume, voxels=cut.voxels), cut, padding, changed, named)
