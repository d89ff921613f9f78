"""What a network is shown of its slice (eq. 4)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy import ndimage

if TYPE_CHECKING:
    from numpy.typing import NDArray

SOLID = 0.5
"""Share of its ellipse that a window must fill to count as a solid, whose outline is taken.

An annulus of inner over outer radius q fills (1 - q^2) / (1 + q^2): a skull about 0.2, a head's skin 0.6 to 1.
"""


def fills_most(mask: NDArray[np.bool_], *, solid: float = SOLID) -> bool:
    """Tell whether the window of a study is a solid, like skin, and not a wall, like a skull.

    Compares the pixels of all slices with the areas of the ellipses that have the same second moments; a ring
    run over a solid winds through its inside and would enclose half of it.

    Parameters
    ----------
    mask : (K, J, I) bool array
    """
    pixels = [np.argwhere(plane) for plane in mask]
    areas = [4 * np.pi * np.sqrt(np.linalg.det(np.cov(p.T) + np.eye(2) / 12)) for p in pixels if len(p) > 2]
    return bool(areas) and sum(len(p) for p in pixels if len(p) > 2) > solid * sum(areas)


def outline(plane: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return the border pixels of a (J, I) mask whose holes are filled; pixels at the image's edge count."""
    framed = np.pad(plane, 1)
    background, _ = ndimage.label(~framed)
    filled = (background != background[0, 0])[1:-1, 1:-1]
    return np.asarray(filled & ~ndimage.binary_erosion(filled))
