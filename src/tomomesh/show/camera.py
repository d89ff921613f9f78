"""An orthographic camera in the patient frame: projection, normals and light."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Directions in the camera's frame (right, up, toward the viewer), and their strength.
KEY_LIGHT, KEY = np.array([-0.46, 0.60, 0.65]), 0.68
FILL_LIGHT, FILL = np.array([0.80, 0.05, 0.60]), 0.24
AMBIENT = 0.22


@dataclass(frozen=True)
class Camera:
    """Where the viewer stands; +z is up in the picture and nothing shrinks with distance.

    Attributes
    ----------
    azimuth : float
        Degrees from straight in front of the face (-y), positive to the patient's left (+x).
    elevation : float
        Degrees above the horizon.
    """

    azimuth: float = 38.0
    elevation: float = 16.0

    @cached_property
    def rotation(self) -> NDArray[np.float64]:
        """Unit vectors to the right, up and toward the viewer, one a row, (3, 3)."""
        turn, rise = math.radians(self.azimuth), math.radians(self.elevation)
        right = [math.cos(turn), math.sin(turn), 0.0]
        viewer = [math.cos(rise) * math.sin(turn), -math.cos(rise) * math.cos(turn), math.sin(rise)]
        return np.array([right, np.cross(viewer, right), viewer])

    def project(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Carry (..., 3) points to right, up and toward the viewer, in the points' unit."""
        return np.asarray(np.asarray(points) @ self.rotation.T)


def normals(corners: NDArray[np.float64], polygons: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return the unit normals of (m, 3 or 4) polygons, zero where there is no area, (m, 3)."""
    first, second = corners[polygons[:, 2]], corners[polygons[:, -1]]
    first -= corners[polygons[:, 0]]
    second -= corners[polygons[:, 1]]
    return unit(np.cross(first, second))


def unit(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return (n, 3) vectors of length 1, zero where they have none."""
    size = np.abs(vectors).max(axis=1, keepdims=True, initial=0)  # squares of huge and of tiny ones have no number
    scaled = vectors / np.where(size > 0, size, 1.0)
    length = np.sqrt((scaled**2).sum(axis=1, keepdims=True))
    return np.asarray(scaled / np.where(length > 0, length, 1.0))


def brightness(directions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Light (n, 3) unit normals of the camera's frame by two lamps (Lambert 1760), from 0 to 1."""
    key = np.maximum(directions @ (KEY_LIGHT / np.linalg.norm(KEY_LIGHT)), 0)
    fill = np.maximum(directions @ (FILL_LIGHT / np.linalg.norm(FILL_LIGHT)), 0)
    return np.asarray(np.minimum(AMBIENT + KEY * key + FILL * fill, 1))
