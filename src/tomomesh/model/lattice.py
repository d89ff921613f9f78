"""The named network topologies (Fig. 1), built from chains, rings, and a divided icosahedron."""

from __future__ import annotations

from math import prod
from typing import TYPE_CHECKING

import numpy as np

from ..errors import UsageError
from .graph import Lattice, hops_along, scaled
from .icosphere import icosphere

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

__all__ = ["TOPOLOGIES", "Lattice", "lattice"]

LEAST = 3
"""Fewest neurons. A ring of two has no inside."""
TUBE = 0.4
"""Radius of a torus' tube over the radius of its ring, at rest. Chosen: half of it changes the distance by -0.2 %,
twice by +0.6 %."""


def lattice(name: str, neurons: int, *, shape: tuple[int, int] | None = None) -> Lattice:
    """Build a network by its name.

    Parameters
    ----------
    name : {"chain", "ring", "grid", "hexagonal", "cylinder", "torus", "sphere"}
        A grid has 4 neighbors a neuron, a hexagonal grid 6; a cylinder and a torus are a grid with one and with
        both pairs of sides joined; a sphere is an icosahedron divided f-fold.
    neurons : int
        At least 3. A grid, a hexagonal grid, a cylinder and a torus take the sides a <= b <= 2a, and a sphere the
        10 f^2 + 2, that come nearest to it.
    shape : (rows, columns), optional
        Sides of a grid, hexagonal grid, cylinder (length, girth) or torus (tube, ring), in place of `neurons`.

    Raises
    ------
    UsageError
        For a topology that there is not, too few neurons, and sides that it cannot have.
    """
    if name not in TOPOLOGIES:
        raise UsageError("there is no such network", found=f"--network = {name}", expected=" | ".join(TOPOLOGIES))
    if shape is None and neurons < LEAST:
        raise UsageError("a network has more neurons", found=f"{neurons} neurons", expected=f"at least {LEAST}")
    if name in _SHEETS:
        build, least = _SHEETS[name]
        sides = shape or _sides(neurons, max(least))
        if len(sides) != 2 or min(sides) < min(least) or sides[0] < least[0] or sides[1] < least[1]:
            raise UsageError("the network cannot have these sides", found=f"shape = {sides}", expected=f">= {least}")
        return build(*sides)
    if shape is not None:
        raise UsageError("the network has no sides", found=f"shape = {shape}", expected=" | ".join(_SHEETS))
    return _LINES[name](neurons) if name in _LINES else _sphere(neurons)


def other_number(graph: Lattice, asked: int | None) -> str | None:
    """Say so where a sheet or a sphere has another number of neurons than was asked for: 58 and 37 make neither.

    Examples
    --------
    >>> other_number(lattice("grid", 37), 37)
    '37 neurons make no grid of about equal sides: it has 6 x 6 = 36'
    """
    if asked is None or graph.name not in (*_SHEETS, "sphere") or len(graph) == asked:
        return None
    if graph.name == "sphere":
        return f"{asked} neurons make no even sphere: it has {len(graph)}"
    rows, columns = graph.shape
    return f"{asked} neurons make no {graph.name} of about equal sides: it has {rows} x {columns} = {len(graph)}"


def _sides(neurons: int, least: int) -> tuple[int, int]:
    """Return the sides a <= b <= 2a whose product is nearest, the most equal of those."""
    widest = int(neurons**0.5) + least + 1
    pairs = [(a, b) for a in range(least, widest + 1) for b in range(a, 2 * a + 1)]
    return min(pairs, key=lambda pair: (abs(prod(pair) - neurons), pair[1] - pair[0]))


def _chain(neurons: int) -> Lattice:
    node = np.arange(neurons)
    apart = np.abs(node[:, None] - node)
    places = np.sqrt(3) * np.linspace(-1, 1, neurons) if neurons > 1 else np.zeros(1)
    edges = np.stack([node[:-1], node[1:]], axis=1)
    return Lattice("chain", edges, apart.astype(np.int32), (neurons,), places[:, None])


def _ring(neurons: int) -> Lattice:
    node = np.arange(neurons)
    apart = np.abs(node[:, None] - node)
    edges = np.stack([node, (node + 1) % neurons], axis=1)
    angle = 2 * np.pi * node / neurons
    places = np.sqrt(2) * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return Lattice("ring", edges, np.minimum(apart, neurons - apart).astype(np.int32), (neurons,), places)


def _woven(name: str, first: Lattice, second: Lattice, places: NDArray[np.float64] | None = None) -> Lattice:
    """Cross two networks: neuron (a, b) is next to (a', b) and to (a, b'); hops add up (Cartesian product)."""
    node = np.arange(len(first) * len(second)).reshape(len(first), len(second))
    along, across = node[:, second.edges].reshape(-1, 2), node[first.edges].transpose(0, 2, 1).reshape(-1, 2)
    row, column = np.divmod(node.ravel(), len(second))
    hops = first.hops[row[:, None], row] + second.hops[column[:, None], column]
    if places is None:
        places = np.concatenate([first.places[row], second.places[column]], axis=1)
    return Lattice(name, np.concatenate([along, across]), hops, node.shape, places)


def _grid(rows: int, columns: int) -> Lattice:
    return _woven("grid", _chain(rows), _chain(columns))


def _cylinder(length: int, girth: int) -> Lattice:
    return _woven("cylinder", _chain(length), _ring(girth))


def _torus(tube: int, ring: int) -> Lattice:
    around, along = np.divmod(np.arange(tube * ring), ring)
    tilt, turn = 2 * np.pi * around / tube, 2 * np.pi * along / ring
    reach = 1 + TUBE * np.cos(tilt)
    places = np.stack([reach * np.cos(turn), reach * np.sin(turn), TUBE * np.sin(tilt)], axis=1)
    woven = _woven("torus", _ring(tube), _ring(ring), scaled(places))
    node = np.arange(tube * ring).reshape(tube, ring)
    up, on = np.roll(node, -1, axis=0), np.roll(node, -1, axis=1)
    corner = np.roll(up, -1, axis=1)
    faces = np.concatenate([np.stack([node, on, corner], axis=-1), np.stack([node, corner, up], axis=-1)])
    return Lattice("torus", woven.edges, woven.hops, woven.shape, woven.places, faces.reshape(-1, 3))


def _hexagonal(rows: int, columns: int) -> Lattice:
    """Shift every other row by half a neuron: six neighbors each.

    In oblique coordinates (q, r) the hops are max(|dq|, |dr|, |dq + dr|).
    """
    row, column = np.divmod(np.arange(rows * columns), columns)
    q, r = (axis[:, None] - axis for axis in (column - (row - row % 2) // 2, row))
    hops = np.maximum(np.maximum(np.abs(q), np.abs(r)), np.abs(q + r)).astype(np.int32)
    places = np.stack([np.sqrt(0.75) * row, column + 0.5 * (row % 2)], axis=1)
    return Lattice("hexagonal", np.argwhere(np.triu(hops == 1)), hops, (rows, columns), scaled(places))


def _sphere(neurons: int) -> Lattice:
    vertices, faces = icosphere(max(round(np.sqrt(max(neurons - 2, 0) / 10)), 1))
    sides = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    edges = np.unique(sides, axis=0)
    return Lattice("sphere", edges, hops_along(edges, len(vertices)), (len(vertices),), scaled(vertices), faces)


_LINES: dict[str, Callable[[int], Lattice]] = {"chain": _chain, "ring": _ring}
_SHEETS: dict[str, tuple[Callable[[int, int], Lattice], tuple[int, int]]] = {
    "grid": (_grid, (1, 1)),
    "hexagonal": (_hexagonal, (2, 2)),
    "cylinder": (_cylinder, (2, 3)),
    "torus": (_torus, (3, 3)),
}
TOPOLOGIES = (*_LINES, *_SHEETS, "sphere")
"""The names, as `lattice` and ``--network`` know them."""
