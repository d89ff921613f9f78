"""A sheet of neurons laid flat: how far neighbors are apart, and how many inputs each has won."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..errors import UsageError
from .drawing.axes import color_bar
from .drawing.marks import fill, small_print
from .drawing.page import canvas
from .drawing.style import INK, TINT, WHITE

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..model.lattice import Lattice
    from .drawing.page import Page, Panel

    Floats = NDArray[np.float64]

SHEETS = ("grid", "hexagonal", "cylinder", "torus")
"""Topologies that can be laid flat."""
MOST_NUMBERS = 200
"""Neurons up to which hits are written into their cells."""


def draw_maps(codebook: Floats, network: Lattice, labels: NDArray[np.integer], *, unit: str = "") -> Page:
    """Draw the U-matrix (Ultsch & Siemon 1990) and the hit map of a sheet of neurons.

    The U-matrix has a cell for each neuron and one between each two neighbors, which tells their distance; a
    neuron's own is the mean of those around it. A cylinder and a torus are cut open, and what lies across the cut
    is drawn at the right and at the top.

    Parameters
    ----------
    codebook : (u, d) float array
    network : Lattice
        A grid, hexagonal grid, cylinder or torus.
    labels : (n,) int array
        Each input's winner, as `tomomesh.SOM` keeps it in ``labels_``.
    unit : str
        Of the inputs.

    Raises
    ------
    UsageError
        For a topology that cannot be laid flat.
    """
    if network.name not in SHEETS:
        raise UsageError("the network has no U-matrix", found=f"topology = {network.name}", expected=" | ".join(SHEETS))
    hits = np.bincount(labels, minlength=len(network))
    corners = _hexagon() if network.name == "hexagonal" else _SQUARE
    places = laid_flat(network)
    size = np.ptp(places, axis=0) + 1
    page, axes = canvas(8.6, float(np.clip(3.4 * size[1] / size[0], 1.6, 6.0)) + 1.2, 1, 2, below=0.6)
    centers, far = u_matrix(codebook, network)
    for ax, middles, reach in ((axes[0], centers, 0.35), (axes[1], places, 0.6)):
        ax.limit(*(middles.min(axis=0) - reach), *(middles.max(axis=0) + reach))
    of = f"distance of neighbors{f' ({unit})' if unit else ''}"
    _draw_cells(axes[0], centers, corners / 2, far, of, lowest=float(far.min()))
    axes[0].heading("a  U-matrix", f"{network.name} of {network.shape[0]} x {network.shape[1]} neurons")
    _draw_cells(axes[1], places, corners, hits, "inputs won")
    dead = int((hits == 0).sum())
    axes[1].heading("b  Hits", f"{len(labels):,} inputs, {dead or 'no'} dead neuron{'' if dead == 1 else 's'}")
    if len(hits) <= MOST_NUMBERS:
        _number(axes[1], places, hits)
    return page


def laid_flat(network: Lattice) -> Floats:
    """Return the place (x, y) of each neuron of a sheet, neighbors 1 apart, (u, 2)."""
    row, column = np.divmod(np.arange(len(network)), network.shape[1])
    if network.name == "hexagonal":
        return np.stack([column + 0.5 * (row % 2), np.sqrt(0.75) * row], axis=1)
    return np.stack([column, row], axis=1).astype(np.float64)


def u_matrix(codebook: Floats, network: Lattice) -> tuple[Floats, Floats]:
    """Return the cells of the U-matrix of a sheet, and what each tells.

    Returns
    -------
    centers : (c, 2) float array
        Of the neurons' own cells first, then of those between neighbors in the order of the edges; on sheets of
        squares then of those between four neurons, whose distance is the mean of the four around them.
    distances : (c,) float array
    """
    places, edges = laid_flat(network), network.edges
    apart = np.sqrt(((codebook[edges[:, 1]] - codebook[edges[:, 0]]) ** 2).sum(axis=1))
    summed, count = np.zeros(len(network)), np.zeros(len(network))
    for end in edges.T:
        np.add.at(summed, end, apart)
        np.add.at(count, end, 1)
    middles = _middles(places[edges[:, 0]], places[edges[:, 1]])
    own = summed / np.maximum(count, 1)
    centers, far = np.concatenate([places, middles]), np.concatenate([own, apart])
    if network.name == "hexagonal":
        return centers, far
    between = _between_four(middles, apart)
    return np.concatenate([centers, between[:, :2]]), np.concatenate([far, between[:, 2]])


def _middles(first: Floats, second: Floats) -> Floats:
    """Return the places half way; of neighbors across a cut, half a step beyond the farther."""
    cut = np.asarray((np.abs(second - first) > 1.5).any(axis=1))
    beyond = np.maximum(first, second) + np.where(np.abs(second - first) > 1.5, 0.5, 0.0)
    return np.where(cut[:, None], beyond, (first + second) / 2)


def _between_four(middles: Floats, apart: Floats) -> Floats:
    """Return the cells between four neurons (x, y, mean distance of the edges around them that are drawn)."""
    corners = np.concatenate([middles + step for step in ([0, 0.5], [0, -0.5], [0.5, 0], [-0.5, 0])])
    odd = (np.round(2 * corners) % 2 == 1).all(axis=1) & (corners > 0).all(axis=1)
    spots, owner = np.unique(np.round(2 * corners[odd]), axis=0, return_inverse=True)
    owner = owner.reshape(-1)
    count = np.bincount(owner)
    mean = np.bincount(owner, np.tile(apart, 4)[odd]) / count
    return np.column_stack([spots / 2, mean])[count >= 2]


_SQUARE = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])


def _hexagon() -> Floats:
    """Return a hexagon that stands on a corner, 1 wide."""
    turn = np.pi / 6 + np.arange(6) * np.pi / 3
    return np.asarray(np.stack([np.cos(turn), np.sin(turn)], axis=1) / np.sqrt(3))


def _draw_cells(
    ax: Panel, centers: Floats, corners: Floats, values: NDArray[np.generic], name: str, *, lowest: float = 0.0
) -> None:
    """Fill a cell around each center, and put a scale beside them, from the lowest value on."""
    highest = float(values.max())
    low, high = lowest if lowest < highest else 0.0, highest or 1.0
    fill(ax, centers[:, None] + corners, color=TINT((np.asarray(values, np.float64) - low) / (high - low)))
    inch, (left, _, right, bottom) = ax.page.dpi, ax.box
    half, middle = 0.375 * (right - left), (left + right) / 2
    bar = np.array([middle - half, bottom + 0.12 * inch, middle + half, bottom + 0.21 * inch])
    color_bar(ax.page, bar, low, high, TINT, name, whole=np.issubdtype(values.dtype, np.integer))


def _number(ax: Panel, places: Floats, hits: NDArray[np.integer]) -> None:
    """Write the hits into their cells, dark on light and light on dark."""
    size = float(np.clip(90 / max(np.ptp(places[:, 0]) + 1, 1), 4.0, 8.0))
    for place, count in zip(places, hits, strict=True):
        small_print(ax, str(count), place, color=WHITE if count > 0.45 * hits.max() else INK, size=size)
