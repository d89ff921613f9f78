"""Train several networks on every slice of a study, and carry them from slice to slice."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...errors import EmptyError
from ...kernels.threads import in_order
from ...measure.polygon import evenly
from ...model.contours import Contour, Contours
from ...model.lattice import lattice
from ...model.sliced import parts_of
from ...progress import Progress, silent
from ...settings import MOST_NEURONS
from ...som.even_spacing import bridged_edges
from ...som.fit import fit, radii
from .curved import evened, unshrunk
from .inputs import FEWEST, SHORTEST, Inputs
from .shown import Shown
from .tracking import Tracker

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from ...isosurface.crossings import Levels
    from ...isosurface.run_mask import RunMask
    from ...settings import NetworkSettings
    from ...som.passes import Look

    Floats = NDArray[np.float64]

REFINED = (2.0, 0.7)
"""First and last radius of a ring that starts near its place, hops: measured, a start at 4 fails on two-sided walls."""


def train_contours(
    mask: NDArray[np.bool_] | RunMask,
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
    most. Every loop has a ring, down to one pixel; components and walls of fewer than `SHORTEST` sides have none. The
    inputs of every slice are found, then the contours are linked from slice to slice by what they enclose, then each
    track is trained from its first slice to its last, every ring with its first neuron next to that of the ring before
    it: some slices after the other, where the window is drawn some at a time.

    Parameters
    ----------
    mask : (K, J, I) bool array or RunMask
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
    shown = Shown.of(mask, levels, settings, pixel_mm, seed, threads)
    tracker, dropped = Tracker(), 0
    found: list[Contour] = []
    last: dict[int, Floats] = {}
    for start, stop in parts_of(mask):
        rows = shown.on(start, stop, threads)
        dropped += sum(few for _, few in rows)
        rings = [ring for k, (inputs, _) in enumerate(rows, start) for ring in _asked(k, inputs, settings, tracker)]
        told = partial(_tell, progress, start, stop, mask.shape[0])
        found += _along_tracks(rings, partial(trained_ring, settings, seed, pixel_mm), last, threads, told)
    if not found:
        raise EmptyError(
            "no contour is long enough for a network",
            found=f"{dropped} of fewer than {SHORTEST} pixel sides" if dropped else "no contour",
            expected=f"at least {SHORTEST} pixel sides",
            hint="a wider window",
        )
    return Contours(settings.contours, tuple(found), tracker.end(), dropped)


class Ring(NamedTuple):
    """A ring to be trained: where, on what, with how many neurons, and on which track."""

    slice: int
    number: int
    own: Inputs
    neurons: int
    track: int


def _asked(k: int, inputs: Sequence[Inputs], settings: NetworkSettings, tracker: Tracker) -> list[Ring]:
    """Return the rings of the next slice."""
    counted = settings.contours == "loops" and settings.neurons is None
    shares = neurons_of(inputs) if counted else shared(inputs, settings.neuron_count)
    tracks = tracker.follow([one.inside for one in inputs], [one.side for one in inputs])
    return [Ring(k, n, *one) for n, one in enumerate(zip(inputs, shares, tracks, strict=True))]


def _along_tracks(
    rings: Sequence[Ring], train: Callable[[Ring, Floats | None], Contour], last: dict[int, Floats], threads: int,
    done: Callable[[int, int], None],
) -> list[Contour]:  # fmt: skip
    """Train the rings of some slices, each track from its first to its last; by slice, then ring.

    `last` tells where the last ring of each track begins, and is brought up to these slices.
    """
    tracks: dict[int, list[Ring]] = {}
    for ring in rings:
        tracks.setdefault(ring.track, []).append(ring)
    each = list(tracks.items())

    def along(n: int) -> list[Contour]:
        number, members = each[n]
        found, first = [], last.get(number)
        for ring in members:
            found.append(train(ring, first))
            first = found[-1].codebook[0]
        return found

    rows = in_order(along, len(each), threads=threads, done=lambda count: done(count, len(each)))
    last.update({row[-1].track: row[-1].codebook[0] for row in rows})
    return sorted((one for row in rows for one in row), key=lambda one: (one.slice, one.ring))


def _tell(progress: Progress, start: int, stop: int, count: int, done: int, total: int) -> None:
    """Say of how many slices the tracks are trained."""
    progress("networks", start + (stop - start) * done // total, count)


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


def trained_ring(
    settings: NetworkSettings, seed: int, pixel_mm: tuple[float, float], ring: Ring, first: Floats | None,
    look: Look | None = None,
) -> Contour:  # fmt: skip
    """Train one ring; `first` is where the ring before it on its track begins, `look` who looks on."""
    own, neurons = ring.own, ring.neurons
    graph, shown = lattice("ring", neurons), own.shown * pixel_mm
    rng, pixel_area = np.random.default_rng((seed, ring.slice, ring.number)), pixel_mm[0] * pixel_mm[1]
    if own.line is None:
        fitted = fit(shown, graph, settings, rng, pixel_area=pixel_area, look=look)
        _, last = radii(shown, graph, settings, pixel_area)
    else:
        start = drawn(own.line * pixel_mm, neurons, None if first is None else first * pixel_mm)
        refined = replace(settings, radius=settings.radius or REFINED, trim=0.0 if own.outlined else settings.trim)
        fitted = fit(shown, graph, refined, rng, pixel_area=pixel_area, start=start, look=look)
        _, last = refined.radius or REFINED
    found = fitted.codebook
    gaps = bridged_edges(found, graph, settings.bridge)
    if settings.training == "batch":
        found = unshrunk(found, graph, settings, gaps, last)
    if settings.even:
        found, gaps = evened(found, gaps)
    return Contour(
        ring.slice, ring.number, own.side, ring.track, found / pixel_mm, gaps, own.outlined, len(shown),
        int((~fitted.kept).sum()),
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
