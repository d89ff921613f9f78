"""Train several networks on every slice of a study, and carry them from slice to slice."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, TypeVar

import numpy as np
import scipy

from ...errors import EmptyError
from ...kernels.threads import in_blocks
from ...measure.polygon import evenly
from ...model.contours import Contour, Contours
from ...model.lattice import lattice
from ...progress import Progress, silent
from ...settings import MOST_NEURONS
from ...som.even_spacing import bridged_edges
from ...som.fit import fit, radii
from ..signal import is_stepped
from .curved import evened, unshrunk
from .inputs import FEWEST, SHORTEST, Inputs, components_of, inputs_of_loops, solids
from .loops import trace
from .tracking import track
from .walls import inputs_of_walls

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from ...isosurface.crossings import Levels
    from ...settings import NetworkSettings

    Floats = NDArray[np.float64]

T = TypeVar("T")

REFINED = (2.0, 0.7)
"""First and last radius of a ring that starts near its place, hops: measured, a start at 4 fails on two-sided walls."""


def train_contours(
    mask: NDArray[np.bool_],
    settings: NetworkSettings,
    *,
    levels: Levels | None = None,
    pixel_mm: tuple[float, float] = (1.0, 1.0),
    seed: int = 0,
    threads: int = 0,
    progress: Progress = silent,
) -> Contours:
    """Run a ring on every contour of each slice of a window: ``settings.contours`` says which.

    ``settings.neurons`` are shared among the contours of a slice by the lengths of their outlines: `FEWEST` each at
    least (a loop: one for `SIDES_MOST` pixel sides at least), and at most one for two pixel sides, or a small loop's
    sides. Where none are asked for, each loop gets as many as its length and curvature want, `MOST_NEURONS` a slice at
    most. Every loop has a ring, down to one pixel; components and walls of fewer than `SHORTEST` sides have none. First
    the inputs of every slice are found, then the contours are linked from slice to slice by what they enclose, then
    each track is trained from its first slice to its last, every ring with its first neuron next to that of the ring
    before it.

    Parameters
    ----------
    mask : (K, J, I) bool array
    settings : NetworkSettings
    levels : Levels, optional
        The gray levels and the window on them: loops are shown where they cross its bounds between two pixels. Half
        way where not given, or where they are those of a mask.
    pixel_mm : (float, float)
        Distance of the columns and of the rows.
    seed, threads : int
        No result depends on the number of threads.
    progress : callable

    Returns
    -------
    Contours

    Raises
    ------
    EmptyError
        Where no contour is long enough.
    """
    inputs, dropped = _inputs(mask, levels, settings, pixel_mm, seed, threads)
    if not any(inputs):
        raise EmptyError(
            "no contour is long enough for a network",
            found=f"{dropped} of fewer than {SHORTEST} pixel sides" if dropped else "no contour",
            expected=f"at least {SHORTEST} pixel sides",
            hint="a wider window",
        )
    tracks = track([[one.inside for one in row] for row in inputs], [[one.side for one in row] for row in inputs])
    counted = settings.contours == "loops" and settings.neurons is None
    shares = [neurons_of(row) if counted else shared(row, settings.neuron_count) for row in inputs]
    members = tracks.members
    trained: list[list[Contour]] = [[] for _ in members]

    def work(start: int, stop: int) -> None:
        for number in range(start, stop):
            first = None
            for k, ring in members[number]:
                one = _trained(inputs[k][ring], shares[k][ring], settings, (seed, k, ring), pixel_mm, first)
                first = one.codebook[0]
                trained[number].append(replace(one, track=number))

    total = len(members)
    in_blocks(work, total, block=1, threads=threads, done=lambda done: progress("networks", done, total))
    order = sorted((one for row in trained for one in row), key=lambda one: (one.slice, one.ring))
    return Contours(settings.contours, tuple(order), tuple(tracks.events), dropped)


def shared(inputs: Sequence[Inputs], neurons: int) -> list[int]:
    """Share neurons among the contours of a slice by the lengths of their outlines.

    Returns
    -------
    list of int
        Each at least `Inputs.least`, so that they may be more in all, and at most `Inputs.most`.
    """
    whole = sum(one.perimeter for one in inputs)
    return [min(max(one.least, round(neurons * one.perimeter / whole)), one.most) for one in inputs]


def neurons_of(inputs: Sequence[Inputs]) -> list[int]:
    """Return how many neurons the loops of a slice want, at most `MOST_NEURONS` in all, but each its least."""
    each = [one.neurons for one in inputs]
    share = min(1.0, MOST_NEURONS / max(sum(each), 1))
    return [min(max(FEWEST, round(share * n)), one.most) for n, one in zip(each, inputs, strict=True)]


def _inputs(
    mask: NDArray[np.bool_], levels: Levels | None, settings: NetworkSettings, pixel_mm: tuple[float, float],
    seed: int, threads: int,
) -> tuple[list[list[Inputs]], int]:  # fmt: skip
    """Find the inputs of all contours, slice by slice; return also how many contours are too small."""
    if settings.contours == "components":
        return _inputs_of_components(mask, settings.signal, threads)
    if settings.contours == "loops":
        return _inputs_of_loops(mask, levels, threads), 0
    return _in_slices(
        len(mask), lambda k: inputs_of_walls(mask[k], settings, np.random.default_rng([seed, k]), pixel_mm), threads
    )


def _inputs_of_loops(mask: NDArray[np.bool_], levels: Levels | None, threads: int) -> list[list[Inputs]]:
    """Show each loop where the gray levels cross the window's bounds; half way where those are a mask's."""
    loops, _ = _in_slices(len(mask), lambda k: (trace(mask[k]), 0), threads)
    if levels is not None and is_stepped(mask, levels):
        levels = None

    def find(k: int) -> tuple[list[Inputs], int]:
        return inputs_of_loops(loops[k], None if levels is None else partial(_crossed, levels, k)), 0

    return _in_slices(len(mask), find, threads)[0]


def _crossed(levels: Levels, k: int, inner: NDArray[np.int64], outer: NDArray[np.int64]) -> Floats:
    """Return where between pixels of slice k the gray levels cross the window's bounds."""
    return levels.crossed(_placed(inner, k), _placed(outer, k))


def _placed(pixels: NDArray[np.int64], k: int) -> NDArray[np.int32]:
    """Return pixels (column, row) of slice k as voxels (x, y, z)."""
    return np.column_stack([pixels, np.full(len(pixels), k)]).astype(np.int32)


def _inputs_of_components(mask: NDArray[np.bool_], signal: str, threads: int) -> tuple[list[list[Inputs]], int]:
    """Show each component its outline or its pixels, as the whole body asks for that it is part of."""
    bodies, _ = scipy.ndimage.label(mask, np.ones((3, 3, 3), bool))
    found, dropped = _in_slices(len(mask), lambda k: components_of(mask[k], bodies[k]), threads)
    every = [one for row in found for one in row]
    solid = solids(every) if signal == "auto" else {one.body for one in every if signal == "boundary"}
    inputs, _ = _in_slices(len(mask), lambda k: ([one.inputs(solid=one.body in solid) for one in found[k]], 0), threads)
    return inputs, dropped


def _in_slices(count: int, find: Callable[[int], tuple[list[T], int]], threads: int) -> tuple[list[list[T]], int]:
    found: list[tuple[list[T], int]] = [([], 0)] * count

    def work(start: int, stop: int) -> None:
        for k in range(start, stop):
            found[k] = find(k)

    in_blocks(work, count, block=1, threads=threads)
    return [row for row, _ in found], sum(dropped for _, dropped in found)


def _trained(
    own: Inputs, neurons: int, settings: NetworkSettings, place: tuple[int, int, int], pixel_mm: tuple[float, float],
    first: Floats | None,
) -> Contour:  # fmt: skip
    """Train one ring; `first` is where the ring before it on its track begins."""
    graph, shown = lattice("ring", neurons), own.shown * pixel_mm
    rng, pixel_area = np.random.default_rng(place), pixel_mm[0] * pixel_mm[1]
    if own.line is None:
        fitted = fit(shown, graph, settings, rng, pixel_area=pixel_area)
        _, last = radii(shown, graph, settings, pixel_area)
    else:
        start = drawn(own.line * pixel_mm, neurons, None if first is None else first * pixel_mm)
        refined = replace(settings, radius=settings.radius or REFINED, trim=0.0 if own.outlined else settings.trim)
        fitted = fit(shown, graph, refined, rng, pixel_area=pixel_area, start=start)
        _, last = refined.radius or REFINED
    found = fitted.codebook
    gaps = bridged_edges(found, graph, settings.bridge)
    if settings.training == "batch":
        found = unshrunk(found, graph, settings, gaps, last)
    if settings.even:
        found, gaps = evened(found, gaps)
    return Contour(
        place[1], place[2], own.side, -1, found / pixel_mm, gaps, own.outlined, len(shown), int((~fitted.kept).sum())
    )  # fmt: skip


def drawn(line: Floats, count: int, first: Floats | None = None) -> Floats:
    """Place points at equal steps along a closed line (p, 2), the first of them next to a place.

    Where no place is given, it is straight to the right of the line's middle: a ring that starts from an ellipse
    begins there too.
    """
    offset = line - (line.mean(axis=0) if first is None else first)
    away = np.abs(offset[:, 1]) - offset[:, 0] if first is None else (offset**2).sum(axis=1)
    closed = np.roll(line, -int(np.argmin(away)), axis=0)
    closed = np.concatenate([closed, closed[:1]])
    return evenly(closed, count + 1)[:-1]
