"""Undo the fit where it made vertices meet or a component fall flat."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..measure.distance import pairs_within
from ..measure.links import Links

if TYPE_CHECKING:
    from ..model.mesh import TriMesh

CLOSE = 1e-4
"""Distance, over the median edge, under which two vertices count as meeting: above what the 32 bits of a mesh file lose
of a mesh a thousand edges wide, 1000 / 2^24 = 6e-5."""
BACK = 1 / 16
"""Share of the way back to its smoothed place that a vertex takes where it meets another: no vertex goes back by more
than a sixteenth of its way too far."""
MOST = 32
"""Most steps back: (1 - 1/16)^32, an eighth of the way, is then left."""


def without_collapse(smoothed: TriMesh, fitted: TriMesh) -> tuple[TriMesh, int]:
    """Keep vertices apart, and components from falling flat.

    Vertices that are drawn to the same point may come to rest at one place, and a small component whose vertices
    are all drawn to a few points may turn inside out. The first go back a little towards their smoothed places,
    the second all the way.

    Parameters
    ----------
    smoothed, fitted : TriMesh
        The same faces before and after the fit.

    Returns
    -------
    mesh : TriMesh
    collapsed : int
        Components taken back to their smoothed shape.
    """
    links = Links(smoothed)
    count, label, owner = links.pieces, links.vertex_pieces, links.face_pieces
    before, after = (np.bincount(owner, mesh.face_volumes, count) for mesh in (smoothed, fitted))
    turned = before * after <= 0
    vertices = np.where(turned[label][:, None], smoothed.vertices, fitted.vertices)
    corners = smoothed.corners
    close = CLOSE * float(np.median(np.sqrt(((corners - np.roll(corners, 1, axis=1)) ** 2).sum(axis=2))))
    for _ in range(MOST):
        pairs = pairs_within(vertices, close)
        if len(pairs) == 0:
            break
        meeting = np.unique(pairs)
        vertices[meeting] += BACK * (smoothed.vertices[meeting] - vertices[meeting])
    return fitted.moved(vertices), int(turned.sum())
