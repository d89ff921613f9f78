"""Where a cloud that does not close is open."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from .borders import borders

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..pointcloud.samples import Samples


@dataclass(frozen=True)
class Gap:
    """A border that samples end at: the diagonal of the box around it, and the middle (3,) of that."""

    size: float
    place: NDArray[np.float64]


def gaps(samples: Samples, edge: float, *, threads: int = 0) -> list[Gap]:
    """Find the borders of the surface that samples describe, the widest first.

    Parameters
    ----------
    samples : Samples
    edge : float
        Edge of the cubes.
    threads : int
    """
    found, _ = borders(samples, edge, threads=threads)
    rims = [found.samples[found.labels == label, :3] for label in range(found.count)]
    boxes = [(rim.min(axis=0), rim.max(axis=0)) for rim in rims]
    wide = [Gap(float(np.linalg.norm(high - low)), 0.5 * (low + high)) for low, high in boxes]
    return sorted(wide, key=lambda gap: -gap.size)
