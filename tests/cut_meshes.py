"""Meshes cut into pieces at any of their vertices."""

from __future__ import annotations

import pickle
from typing import TYPE_CHECKING, Any

import numpy as np
from hypothesis import strategies as st

from tomomesh.slabs.keep import InMemory
from tomomesh.slabs.mesh import Piece, SlabMesh

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from tomomesh import TriMesh
    from tomomesh.slabs.keep import Kept, Slabs


def cut_off_in(mesh: SlabMesh) -> NDArray[np.bool_]:
    """Return over which faces (m,) of the whole the study is cut off."""
    ends = [len(one.halves) for one in mesh]
    halves = [one.cut_off[:end] for one, end in zip(mesh, ends, strict=True)]
    return np.concatenate([*halves, *(one.cut_off[end:] for one, end in zip(mesh, ends, strict=True))])


def cut(
    mesh: TriMesh,
    at: Sequence[int],
    centers: int = 0,
    quarters: int = 0,
    seed: int | None = None,
    slabs: Slabs | None = None,
    cut_off: NDArray[np.bool_] | None = None,
) -> SlabMesh:
    """Cut a mesh before some of its vertices; a face goes to the piece of its lowest vertex, or to any by a seed.

    The last `centers` vertices are centers, which are shared out evenly, and the last `quarters` faces quarters. The
    study is cut off over some of the faces (m,), or none.
    """
    own, halves = len(mesh.vertices) - centers, len(mesh.faces) - quarters
    ends = np.array([0, *sorted(min(one, own) for one in at), own])
    middle = own + np.linspace(0, centers, len(ends)).astype(int)
    piece = np.searchsorted(ends[1:-1], mesh.faces.min(axis=1), side="right")
    if seed is not None:
        piece = np.random.default_rng(seed).integers(len(ends) - 1, size=len(piece))
    half = np.arange(len(mesh.faces)) < halves
    marks = np.zeros(len(mesh.faces), np.bool_) if cut_off is None else cut_off
    pieces = [
        Piece(
            mesh.vertices[ends[n] : ends[n + 1]], mesh.vertices[middle[n] : middle[n + 1]],
            mesh.faces[half & (piece == n)], mesh.faces[~half & (piece == n)],
            np.concatenate([marks[some & (piece == n)] for some in (half, ~half)]),
        )
        for n in range(len(ends) - 1)
    ]  # fmt: skip
    return SlabMesh.of(pieces, InMemory() if slabs is None else slabs)


class Sent(InMemory):
    """Works in any order, on values that were sent to it, whose arrays nobody may write to."""

    def __init__(self, seed: int) -> None:
        self.rng = np.random.default_rng(seed)

    def each(self, work: Callable[..., Any], *columns: Sequence[Any]) -> list[Kept]:
        rows = list(zip(*columns, strict=True))
        found: list[Kept] = [None] * len(rows)
        for n in self.rng.permutation(len(rows)).tolist():
            called, *entries = self._sent((work, *rows[n]))
            found[n] = self._sent(called(*entries))
        return found

    @staticmethod
    def _sent(value: Any) -> Any:
        buffers: list[pickle.PickleBuffer] = []
        text = pickle.dumps(value, protocol=5, buffer_callback=buffers.append)
        return pickle.loads(text, buffers=[bytes(one) for one in buffers])  # what was just written here


cuts = st.lists(st.integers(0, 400), max_size=5)
