"""What the rings of some slices are shown: what of it needs the whole study is found first."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from ...isosurface.runs import Runs
from ...kernels.threads import in_order
from ...model.sliced import parts_of, some_of
from ..signal import is_stepped, on_slice
from .inputs import Inputs, components_of, inputs_of_loops, solids
from .loops import trace
from .walls import inputs_of_walls

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...isosurface.crossings import Levels
    from ...isosurface.run_mask import RunMask
    from ...model.sliced import Sliced
    from ...settings import NetworkSettings
    from .inputs import Component

    Mask = NDArray[np.bool_]
    Found = tuple[list[Inputs], int]


@dataclass(frozen=True)
class Shown:
    """What is known of a whole window before its slices are looked at.

    Attributes
    ----------
    mask : (K, J, I) bool array or slices of it
    levels : Levels or None
        Those that tell more than the mask does.
    settings : NetworkSettings
    pixel_mm : (float, float)
    seed : int
    bodies : Runs or None
        The components in space, where there is a ring on each in every slice.
    solid : set of int
        Those of them that are shown their outlines.
    """

    mask: Sliced
    levels: Levels | None
    settings: NetworkSettings
    pixel_mm: tuple[float, float]
    seed: int
    bodies: Runs | None = None
    solid: frozenset[int] = frozenset()

    @classmethod
    def of(
        cls, mask: Mask | RunMask, levels: Levels | None, settings: NetworkSettings, pixel_mm: tuple[float, float],
        seed: int, threads: int,
    ) -> Shown:  # fmt: skip
        """Look at a whole window: loops are shown levels unless those are a mask's, and components their bodies'."""
        if settings.contours != "components":
            fine = levels if settings.contours == "loops" else None
            return cls(mask, None if fine is None or is_stepped(mask, fine) else fine, settings, pixel_mm, seed)
        bodies = Runs.of(mask, corners=True, threads=threads)
        solid = frozenset(range(len(bodies.sizes))) if settings.signal == "boundary" else frozenset()
        if settings.signal == "auto":
            parts = (_components(mask, bodies, start, stop, threads) for start, stop in parts_of(mask))
            solid = frozenset(solids(one for part in parts for found, _ in part for one in found))
        return cls(mask, None, settings, pixel_mm, seed, bodies, solid)

    def on(self, start: int, stop: int, threads: int = 0) -> list[Found]:
        """Return what the rings of some slices are shown, and how many contours of each are too small."""
        if self.bodies is not None:
            found = _components(self.mask, self.bodies, start, stop, threads)
            return in_order(lambda n: self._of_components(*found[n]), len(found), threads=threads)
        some = some_of(self.mask, start, stop)
        levels = None if self.levels is None else self.levels.part(start, stop)
        if self.settings.contours == "loops":
            return in_order(lambda n: (_of_loops(some[n], levels, n), 0), len(some), threads=threads)
        return in_order(lambda n: self._of_sides(some[n], start + n), len(some), threads=threads)

    def _of_components(self, components: list[Component], dropped: int) -> Found:
        return [one.inputs(solid=one.body in self.solid) for one in components], dropped

    def _of_sides(self, plane: Mask, k: int) -> Found:
        return inputs_of_walls(plane, self.settings, np.random.default_rng([self.seed, k]), self.pixel_mm)


def _components(mask: Sliced, bodies: Runs, start: int, stop: int, threads: int) -> list[tuple[list[Component], int]]:
    some = some_of(mask, start, stop)
    return in_order(lambda n: components_of(some[n], partial(bodies.part_at, start + n)), len(some), threads=threads)


def _of_loops(plane: Mask, levels: Levels | None, k: int) -> list[Inputs]:
    """Show each loop where the gray levels cross the window's bounds; half way where those are a mask's."""
    return inputs_of_loops(trace(plane), None if levels is None else partial(_crossed, levels, k))


def _crossed(levels: Levels, k: int, inner: NDArray[np.int64], outer: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return where between pixels of slice k the gray levels cross the window's bounds."""
    return levels.crossed(on_slice(inner, k), on_slice(outer, k))
