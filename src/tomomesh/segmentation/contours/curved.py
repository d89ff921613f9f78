"""Rings as smooth closed curves: their shrinking undone, their neurons evenly spaced along them."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import scipy

from ...measure.polygon import along, evenly
from ...som.even_spacing import even_arcs
from ...som.fit import fit

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...model.lattice import Lattice
    from ...settings import NetworkSettings

    Floats = NDArray[np.float64]

FINE = 16
"""Pieces into which each side of a ring is split along its curve. Chosen: half of it changes the distance by +2.2 %,
twice by -1.7 %."""
TIMES = 3
"""How often the shrinking is taken back: measured, each time leaves a third of it."""


def finely(ring: Floats) -> Floats:
    """Draw a closed curve through the neurons of a ring: the points of each side, its first neuron first.

    Returns (u, `FINE`, 2). A periodic cubic spline over the roots of the chords (centripetal: Lee 1989).
    """
    closed = np.concatenate([ring, ring[:1]])
    chord = np.sqrt((np.diff(closed, axis=0) ** 2).sum(axis=1))
    # a millionth of the longest chord at least: neurons at one place get knots of their own
    step = np.sqrt(np.maximum(chord, 1e-6 * max(float(chord.max()), 1e-300)))
    knots = np.concatenate([[0.0], np.cumsum(step)])
    place = knots[:-1, None] + np.arange(FINE) / FINE * step[:, None]
    return np.asarray(scipy.interpolate.CubicSpline(knots, closed, bc_type="periodic")(place))


def unshrunk(
    codebook: Floats, lattice: Lattice, settings: NetworkSettings, gaps: NDArray[np.bool_], radius: float
) -> Floats:
    """Take back what a ring lost by the averaging of its training.

    A neuron is the mean of the pixels around it, and on a bend that mean lies inside of the line: with neurons s apart
    and a last radius of w hops by (1/24 + w^2/2) s^2 times the curvature. So the ring c is sought that the same
    averaging makes the trained one m:  c <- c + m - S(c),  S one more pass over the ring's own curve (van Cittert 1931;
    once: Tukey's twicing, 1977).

    Parameters
    ----------
    codebook : (u, 2) float array
    lattice : Lattice
    settings : NetworkSettings
    gaps : (u,) bool array
        Sides that no pixel was seen along.
    radius : float
        The last of the training, hops.

    Returns
    -------
    (u, 2) float array
    """
    once = replace(settings, training="batch", epochs=1, radius=(radius, radius), trim=0.0)
    ring = codebook
    for _ in range(TIMES):
        shown = finely(ring)[~gaps].reshape(-1, 2)
        again = fit(shown, lattice, once, np.random.default_rng(0), start=ring).codebook
        ring = ring + codebook - again
    return ring


def evened(ring: Floats, gaps: NDArray[np.bool_], count: int | None = None) -> tuple[Floats, NDArray[np.bool_]]:
    """Slide the neurons of a ring along its curve until they are equally far apart; see `tomomesh.som.even_spacing`.

    Along the curve, and not along the sides as there: few neurons would cut off its bends. It gets `count` neurons, as
    many as it has where not given.
    """
    fine, count = finely(ring), len(ring) if count is None else count
    if not gaps.any():
        line = fine.reshape(-1, 2)
        return evenly(np.concatenate([line, line[:1]]), count + 1)[:-1], np.zeros(count, bool)
    shift = int(np.flatnonzero(gaps)[-1]) + 1
    fine, wide = np.roll(fine, -shift, axis=0), np.roll(gaps, -shift)
    ends = np.flatnonzero(wide)
    starts = np.concatenate([[0], ends[:-1] + 1])
    arcs = [np.concatenate([fine[a:b].reshape(-1, 2), fine[b, :1]]) for a, b in zip(starts, ends, strict=True)]
    if sum(along(arc)[-1] for arc in arcs) == 0:
        return ring, gaps
    turned, inner = even_arcs(arcs, count)
    shift = round(shift * count / len(ring))
    return np.roll(turned, shift, axis=0), np.roll(np.append(inner, True), shift)
