"""Meshes cut into pieces at any of their vertices, and who works on the pieces."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from hypothesis import strategies as st

from tomomesh import TriMesh
from tomomesh.slabs.patches.patch import Patches, patches_of

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence


@dataclass(frozen=True)
class Piece:
    vertices: Any
    centers: Any
    halves: Any
    quarters: Any


class InMemory:
    def each(self, work: Callable[..., Any], *columns: Sequence[Any]) -> list[Any]:
        return [work(*row) for row in zip(*columns, strict=True)]

    def fetch(self, kept: Sequence[Any]) -> list[Any]:
        return list(kept)


def cut(mesh: TriMesh, at: Sequence[int], centers: int = 0, quarters: int = 0, seed: int | None = None) -> list[Piece]:
    """Cut a mesh before some of its vertices; a face goes to the piece of its lowest vertex, or to any by a seed.

    The last `centers` vertices are centers, which are shared out evenly, and the last `quarters` faces quarters.
    """
    own, halves = len(mesh.vertices) - centers, len(mesh.faces) - quarters
    ends = np.array([0, *sorted(min(one, own) for one in at), own])
    middle = own + np.linspace(0, centers, len(ends)).astype(int)
    piece = np.searchsorted(ends[1:-1], mesh.faces.min(axis=1), side="right")
    if seed is not None:
        piece = np.random.default_rng(seed).integers(len(ends) - 1, size=len(piece))
    half = np.arange(len(mesh.faces)) < halves
    return [
        Piece(
            mesh.vertices[ends[n] : ends[n + 1]], mesh.vertices[middle[n] : middle[n + 1]],
            mesh.faces[half & (piece == n)], mesh.faces[~half & (piece == n)],
        )
        for n in range(len(ends) - 1)
    ]  # fmt: skip


def whole(pieces: Sequence[Piece]) -> TriMesh:
    """Return the mesh whose pieces these are, its faces in their order."""
    vertices = [one.vertices for one in pieces] + [one.centers for one in pieces]
    faces = [one.halves for one in pieces] + [one.quarters for one in pieces]
    return TriMesh(np.concatenate(vertices), np.concatenate(faces))


def patches(pieces: Sequence[Piece]) -> Patches:
    return patches_of(InMemory(), pieces)


cuts = st.lists(st.integers(0, 400), max_size=5)
