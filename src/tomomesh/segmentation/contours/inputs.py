"""What each of several networks is shown of its slice, and where it starts."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy

from ...isosurface.runs import Runs
from ...kernels.threads import in_order
from ...model.contours import HOLE, OUTER
from ...model.sliced import parts_of, some_of
from ...som.starts import moments
from ..signal import SOLID, outline, pixels_of
from .loops import Loop, Patch, trace

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from numpy.typing import NDArray

    from ...model.sliced import Sliced

    Crossed = Callable[[NDArray[np.int64], NDArray[np.int64]], NDArray[np.float64]]

FEWEST, SIDES_EACH = 12, 2
"""Neurons that a ring has at least, where its outline has as many pixel sides, and sides for each neuron of more.
Measured: 12 follow a component to 0.12 pixels. Chosen: half and twice change nothing and nothing (FEWEST); distance
+7.7 % and distance -8.6 % (SIDES_EACH)."""
SHORTEST = FEWEST * SIDES_EACH
"""Pixel sides of the shortest outline of a component or a wall that gets a ring: about 6 pixels across."""
SIDES_MOST = 8
"""Pixel sides of an outline for each neuron of a loop at most: fewer neurons would cut thin walls and bays across.
Chosen: half and twice of it change no case of benchmarks/constants.py."""
OFF = 0.02
"""Pixels that a straight side of a loop may be off the outline that it follows. Chosen, on a skull in slabs of 4 mm:
half of it changes the distance by -0.4 % and the turn from face to face by +2.7 %, twice by +2.1 % and -7.2 %."""
STAIRS = 2.0
"""Pixel sides over which the stairs of an outline are evened out before its curvature is measured. Chosen: half of it
changes the distance by -0.2 % and the turn by +2.8 %, twice by +1.7 % and -8.0 %."""
BESIDE = 0.1
"""Share of the largest component's box that another one covers to be a structure of its own. Chosen: half and twice of
it change no case of benchmarks/constants.py."""
TOUCHING = np.ones((3, 3), bool)
"""Pixels that touch at a corner are of one component."""


@dataclass(frozen=True)
class Inputs:
    """What one ring is shown.

    Attributes
    ----------
    shown : (n, 2) float array
        Inputs as pixel columns and rows.
    line : (p, 2) float array or None
        A closed line to start on; None starts as the settings say.
    inside : Patch
        The pixels that it should enclose.
    side : int
    perimeter : int
        Pixel sides of its outline.
    outlined : bool
        Whether it is shown an outline, not the window's pixels.
    least : int
        Neurons that it has at least, as far as its outline has room for them.
    """

    shown: NDArray[np.float64]
    line: NDArray[np.float64] | None
    inside: Patch
    side: int
    perimeter: int
    outlined: bool

    least: int = FEWEST

    @property
    def most(self) -> int:
        """Neurons that it can have at most."""
        return min(max(self.perimeter // SIDES_EACH, min(self.perimeter, FEWEST)), len(self.shown))

    @property
    def neurons(self) -> int:
        """Neurons that follow its line to `OFF` pixels, by its length and curvature.

        A side of length s on curvature c is off by s^2 c / 8 in the middle, so  sqrt(c / (8 OFF))  neurons a pixel do,
        summed along the line without its stairs.
        """
        assert self.line is not None
        smooth = scipy.ndimage.gaussian_filter1d(self.line, min(STAIRS, len(self.line) / 8), axis=0, mode="wrap")
        side = np.roll(smooth, -1, axis=0) - smooth
        length, way = np.hypot(*side.T), np.arctan2(side[:, 1], side[:, 0])
        turn = np.abs((way - np.roll(way, 1) + np.pi) % (2 * np.pi) - np.pi)
        return int(np.ceil(np.sqrt(turn * (length + np.roll(length, 1)) / (16 * OFF)).sum()))


def inputs_of_loops(loops: Sequence[Loop], crossed: Crossed | None = None) -> list[Inputs]:
    """Show each ring one closed outline of the window, where it crosses from the pixels inside to those outside.

    Parameters
    ----------
    loops : sequence of Loop
    crossed : callable, optional
        Told pixels (column, row) inside and their neighbors outside, (n, 2) each, returns the share of the way where
        the outline passes, (n,); half way where not given, as for a mask.

    Returns
    -------
    list of Inputs
    """
    return [inputs_along(loop, OUTER if loop.area > 0 else HOLE, crossed) for loop in loops]


def inputs_along(loop: Loop, side: int, crossed: Crossed | None = None) -> Inputs:
    """Show a ring the outline itself, and let it start there."""
    inner, outer = loop.pixels
    share = np.full(len(loop), 0.5) if crossed is None else crossed(inner, outer)
    line = np.asarray(inner + share[:, None] * (outer - inner), np.float64)
    least = max(FEWEST, len(loop) // SIDES_MOST)
    return Inputs(line, line, loop.filled(), side, len(loop), outlined=True, least=least)


@dataclass(frozen=True)
class Component:
    """One connected component of the window in a slice.

    Attributes
    ----------
    body : int
        The connected component of the whole window that it belongs to.
    low : (2,) int64 array
        Its first pixel (column, row).
    pixels : (j, i) bool array
    """

    body: int
    low: NDArray[np.int64]
    pixels: NDArray[np.bool_]

    @property
    def ellipse(self) -> float:
        """Area of the ellipse that has the same second moments."""
        spread = moments(np.ascontiguousarray(pixels_of(self.pixels).T))[1] + np.eye(2) / 12
        return float(4 * np.pi * np.sqrt(np.linalg.det(spread)))

    def inputs(self, *, solid: bool) -> Inputs:
        """Show a ring the outline of a solid, or the pixels of a wall."""
        loop = max(trace(self.pixels), key=lambda found: found.area)
        shown = outline(self.pixels) if solid else pixels_of(self.pixels)
        inside = loop.filled()
        patch = Patch(inside.low + self.low, inside.pixels)
        return Inputs(shown + self.low, None, patch, OUTER, len(loop), outlined=solid)


def components_of(plane: NDArray[np.bool_], body_at: Callable[[int, int], int]) -> tuple[list[Component], int]:
    """Part the window of a slice into its connected components.

    Parameters
    ----------
    plane : (J, I) bool array
    body_at : callable
        Told a pixel (row, column), returns the number of the connected component of the whole window there.

    Returns
    -------
    components : list of Component
    dropped : int
        Components whose outer border has fewer than `SHORTEST` pixel sides.
    """
    labels, _ = scipy.ndimage.label(plane, TOUCHING)
    found = []
    boxes = scipy.ndimage.find_objects(labels)
    for number, (rows, columns) in enumerate(boxes, 1):
        if 2 * (rows.stop - rows.start + columns.stop - columns.start) >= SHORTEST:
            pixels = labels[rows, columns] == number
            row, column = divmod(int(np.argmax(pixels)), pixels.shape[1])
            body = body_at(rows.start + row, columns.start + column)
            found.append(Component(body, np.array([columns.start, rows.start]), pixels))
    return found, len(boxes) - len(found)


def solids(components: Iterable[Component]) -> set[int]:
    """Return the bodies that are solids, and not walls, over all their slices; see `signal.fills_most`."""
    filled: dict[int, float] = {}
    for one in components:
        more = np.count_nonzero(one.pixels) - SOLID * one.ellipse
        filled[one.body] = filled.get(one.body, 0.0) + more
    return {body for body, more in filled.items() if more > 0}


def slices_with_several(mask: Sliced, threads: int = 0) -> int:
    """Count the slices in which components of the window lie side by side, for which one network is too few.

    A component counts where its box covers at least `BESIDE` of the largest one's and lies in no other; they are
    looked at in pixels twice as wide.

    Parameters
    ----------
    mask : (K, J, I) bool array or slices of it
    threads : int
    """
    return int(_of_planes(_side_by_side, mask, threads).sum())


def share_of_holes(mask: Sliced, threads: int = 0) -> float:
    """Return the area of the holes in the slices of a window over its own, which an outline fills, in coarse pixels.

    Parameters
    ----------
    mask : (K, J, I) bool array or slices of it
    threads : int
    """
    filled, own = _of_planes(_filled_and_own, mask, threads).sum(axis=0)
    return float(filled / max(own, 1) - 1.0)


def _of_planes(find: Callable[[NDArray[np.bool_]], int | tuple[int, int]], mask: Sliced, threads: int) -> NDArray[Any]:
    """Return what is found on each slice, (K, ...)."""
    found: list[int | tuple[int, int]] = []
    for start, stop in parts_of(mask):
        some = some_of(mask, start, stop)
        found += in_order(lambda k: find(some[k]), stop - start, block=8, threads=threads)  # noqa: B023
    return np.array(found)


def _filled_and_own(plane: NDArray[np.bool_]) -> tuple[int, int]:
    """Count the coarse pixels of a plane, with its holes and without."""
    coarse = _coarse(plane)
    return int(scipy.ndimage.binary_fill_holes(coarse).sum()), int(coarse.sum())


def _coarse(plane: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return a plane in pixels twice as wide."""
    rows, columns = plane.shape[0] // 2 * 2, plane.shape[1] // 2 * 2
    coarse = plane[:rows:2, :columns:2] | plane[1:rows:2, :columns:2]
    return np.asarray(coarse | plane[:rows:2, 1:columns:2] | plane[1:rows:2, 1:columns:2])


def _side_by_side(plane: NDArray[np.bool_]) -> bool:
    boxes = Runs.of(_coarse(plane)[None], corners=True).boxes
    if len(boxes) < 2:
        return False
    sizes = (boxes[:, 1] - boxes[:, 0]).prod(axis=1)
    large = boxes[sizes >= BESIDE * sizes.max()]
    within = ((large[:, None, 0] >= large[:, 0]) & (large[:, None, 1] <= large[:, 1])).all(axis=2)
    return bool((within.sum(axis=1) == 1).sum() > 1)
