"""What lies around the vertices of a net, and what springs against bends make of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ..kernels.isosurface.surface_nets import add_term, lean, list_rings
from .means import over

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .means import Rows, Span
    from .surface_nets import Net

    Floats = NDArray[np.float64]

TERMS = 6
"""Degree of the series by which a net against bends begins. Chosen: with it the net of a skull's mask takes 16 more
steps, with 3 18; with 4 and 5 rods two voxels wide keep .86 and .915 of their volume in place of .926."""

SOFTEST = 0.5
"""Least stiffness against bends with which a net begins where it would rest: squares alone do not see corners that take
turns, so that for softer nets the series makes spikes. What softer ones lose is less in proportion. Chosen: a rod one
voxel wide gets 1.07 times its volume at most; with half of it 1.10, and with twice 1.04."""


@dataclass(frozen=True)
class Rings:
    """What lies around the vertices of a net, see `list_rings`."""

    beside: NDArray[np.uint32]
    aslant: NDArray[np.uint32]
    shares: Floats
    threads: int

    @classmethod
    def of(cls, net: Net, threads: int, span: Span | None = None) -> Rings:
        """Look around all vertices, or those in a span."""
        (beside, aslant), shares = np.empty((2, *net.links.shape), np.uint32), np.empty(len(net.links))
        over(
            lambda start, stop: list_rings(net.links, net.fans, net.quads, beside, aslant, shares, start, stop),
            span or (0, len(shares)), threads,
        )  # fmt: skip
        return cls(beside, aslant, shares, threads)

    def lean(self, values: Floats, span: Span) -> Floats:
        """Return by how much the mean of the neighbors' values (n, 3) is more than a vertex' own; in a span."""
        leaning = np.zeros(values.shape)
        over(lambda start, stop: lean(values, self.beside, self.shares, leaning, start, stop), span, self.threads)
        return leaning

    def evened(self, values: Floats, bending: float, rows: Rows) -> Floats:
        """Return where a net would rest that is drawn to values (n, 3) and resists bends, all but exactly.

        Squares and springs together are  1 - l + b l^2  there, l as an operator that takes a mean from what it is of:
        its inverse is a Chebyshev series. What it is more than 1 is a multiple of l, so that planes stay as they are.
        """
        coefficients = np.polynomial.chebyshev.chebinterpolate(
            lambda mean: (1 / resistance(1 - mean, bending) - 1) / (mean - 1), TERMS,
        )  # fmt: skip
        last = self.lean(values, rows(TERMS))
        total: Floats = values + coefficients[0] * last
        before = last.copy()
        for n, coefficient in enumerate(coefficients[1:]):
            self._add(last, before, 2.0 if n else 1.0, coefficient, total, rows(TERMS - 1 - n))
            last, before = before, last
        return total

    def _add(self, last: Floats, before: Floats, times: float, coefficient: float, total: Floats, span: Span) -> None:
        over(
            lambda start, stop: add_term(
                last, before, self.beside, self.shares, times, coefficient, total, start, stop
            ),
            span, self.threads,
        )  # fmt: skip


def resistance(lean: Any, bending: float) -> Any:
    """Return what a net resists that leans so many times its distance from rest: squares, and springs against bends."""
    return np.maximum(1 - lean, 0) + bending * lean**2
