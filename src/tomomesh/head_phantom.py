"""The built-in head: a stack of slices whose skull is known exactly."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from .errors import UsageError
from .model.mesh import TriMesh
from .model.volume import Volume

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.floating[Any]]
    Triple = tuple[float, float, float]

# The head at full size, in mm about the center of its equator (x left, y posterior, z superior).
FIELD_MM = 240.0
LOWEST_MM, HIGHEST_MM = -60.0, 83.0
SKULL_X, SKULL_Y, SKULL_UP, SKULL_DOWN = 70.0, 88.0, 85.0, 110.0
SKULL_HALF_WIDTH = 3.3
SCALP_WIDTH = 6.0
FLATTEST = 0.25
TAPER = 0.12
"""How much wider the back of the skull is than its front, as a logarithm over half its length."""

# Ellipsoids (center, radii); those off the middle have a mirror image on the other side.
NOSE = ((0.0, -84.0, -38.0), (13.0, 30.0, 22.0))
EAR = ((76.0, 8.0, -18.0), (9.0, 17.0, 28.0))
NASAL_OPENING = ((0.0, -84.0, -48.0), (13.0, 30.0, 20.0))
AIRWAY = ((0.0, -64.0, -48.0), (8.0, 32.0, 15.0))
VENTRICLE = ((11.0, 4.0, 16.0), (6.0, 28.0, 14.0))


@dataclass(frozen=True)
class Contrast:
    """Gray levels of the tissues, their noise and range, and the window that selects the skull."""

    air: float
    scalp: float
    skull: float
    brain: float
    fluid: float
    noise: float
    lower: float
    upper: float
    lowest: float
    dtype: type[np.generic]
    unit: str


CONTRASTS = {
    "mr": Contrast(5, 120, 230, 130, 60, 6, 200, 255, 0, np.uint8, "stored"),
    "ct": Contrast(-1000, 60, 900, 40, 8, 25, 475, 3071, -1024, np.int16, "HU"),
}


@dataclass(frozen=True)
class Phantom:
    """A made study with its truth.

    Attributes
    ----------
    volume : Volume
        The slices.
    truth : TriMesh
        The middle surface of the skull between the first and the last slice, open at both; it continues
        across the nasal opening.
    lower, upper : float
        The window that selects the skull: lower < k <= upper.
    """

    volume: Volume
    truth: TriMesh
    lower: float
    upper: float

    @property
    def closed_truth(self) -> TriMesh:
        """The truth with a flat cap over each end, for programs that want a solid."""
        return _capped(self.truth)


@dataclass(frozen=True)
class Head:
    """The head's size, and the part of it that the slices meet.

    Attributes
    ----------
    scale, scale_z : float
        Size in the slices' plane and across it, over full size.
    half_width_mm : float
        Half the thickness of the skull.
    lowest_mm, highest_mm : float
        Heights of the outer slices.
    """

    scale: float = 1.0
    scale_z: float = 1.0
    half_width_mm: float = SKULL_HALF_WIDTH
    lowest_mm: float = LOWEST_MM
    highest_mm: float = HIGHEST_MM

    @classmethod
    def fitted(cls, shape: tuple[int, int, int], spacing_mm: Triple) -> Head:
        """Fit the head to the field of view; its skull is never thinner than two and a half pixels."""
        slices, rows, columns = shape
        dx, dy, dz = spacing_mm
        scale, depth = min(columns * dx, rows * dy) / FIELD_MM, (slices - 1) * dz
        scale_z = max(depth / (HIGHEST_MM - LOWEST_MM), FLATTEST * scale)
        half_width = max(SKULL_HALF_WIDTH * min(scale, scale_z), 1.25 * max(dx, dy))
        middle = (LOWEST_MM + HIGHEST_MM) / 2 * scale_z
        return cls(scale, scale_z, half_width, middle - depth / 2, middle + depth / 2)

    def skull(self, x: Floats, y: Floats, z: Floats) -> Floats:
        """Return the first-order signed distance (g - 1) / |grad g| to the skull's middle surface, mm.

        g^2 = (x / (a exp(t y / b)))^2 + (y / b)^2 + (z / c)^2, with one c above and one below the equator.
        """
        a, b = SKULL_X * self.scale, SKULL_Y * self.scale
        up, down = SKULL_UP * self.scale_z, SKULL_DOWN * self.scale_z
        width = a * np.exp(TAPER / b * y)
        u, v, w = x / width, y / b, np.where(z >= 0, z / up, z / down)
        slope_y = (v - TAPER * u * u) / b
        return _first_order(u, v, w, u / width, slope_y, np.where(z >= 0, w / up, w / down))

    def ellipsoid(self, part: tuple[Triple, Triple], x: Floats, y: Floats, z: Floats) -> Floats:
        """Return the first-order signed distance to a part of the head and its mirror image, mm."""
        scales = (self.scale, self.scale, self.scale_z)
        offsets = [q - c * s for q, c, s in zip((np.abs(x), y, z), part[0], scales, strict=True)]
        radii = [r * s for r, s in zip(part[1], scales, strict=True)]
        u, v, w = (q / r for q, r in zip(offsets, radii, strict=True))
        return _first_order(u, v, w, u / radii[0], v / radii[1], w / radii[2])

    def middle(self, around: int = 384, along: int = 144) -> TriMesh:
        """Triangulate the skull's middle surface between the outer slices, open at both ends."""
        up, down = SKULL_UP * self.scale_z, SKULL_DOWN * self.scale_z
        ends = [math.asin(z / (down if z < 0 else up)) for z in (self.lowest_mm, self.highest_mm)]
        latitude = np.linspace(ends[0], ends[1], along)
        turn = np.arange(around) * (2 * math.pi / around)
        v = np.cos(latitude)[:, None] * np.sin(turn)
        u = np.cos(latitude)[:, None] * np.cos(turn)
        z = np.sin(latitude) * np.where(latitude < 0, down, up)
        x, y = SKULL_X * self.scale * np.exp(TAPER * v) * u, SKULL_Y * self.scale * v
        vertices = np.stack([x, y, np.broadcast_to(z[:, None], x.shape)], axis=-1).reshape(-1, 3)
        return TriMesh(vertices, _tube(around, along))

    def paint(self, x: Floats, y: Floats, z: Floats, contrast: Contrast, voxel_mm: float) -> Floats:
        """Return the gray levels without noise, boundaries blurred over one voxel by partial volume."""

        def inside(distance: Floats) -> Floats:
            return np.asarray(np.clip(0.5 - distance / voxel_mm, 0, 1))

        def part(ellipsoid: tuple[Triple, Triple]) -> Floats:
            return inside(self.ellipsoid(ellipsoid, x, y, z))

        middle = self.skull(x, y, z)
        scalp = inside(middle - self.half_width_mm - SCALP_WIDTH * self.scale)
        bone = inside(np.abs(middle) - self.half_width_mm) * (1 - part(NASAL_OPENING))
        gray = contrast.air + (contrast.scalp - contrast.air) * np.maximum(scalp, np.maximum(part(NOSE), part(EAR)))
        layers = [
            (contrast.brain, inside(middle)),
            (contrast.fluid, part(VENTRICLE)),
            (contrast.air, part(AIRWAY)),
            (contrast.skull, bone),
        ]
        for level, coverage in layers:
            gray += (level - gray) * coverage
        return gray


def phantom(
    shape: tuple[int, int, int] = (54, 256, 256),
    spacing_mm: tuple[float, float, float] = (0.9375, 0.9375, 2.7),
    *,
    contrast: str = "mr",
    noise: float | None = None,
    seed: int = 0,
) -> Phantom:
    """Make a head whose skull is known exactly.

    The head is fitted to the field of view: to its smaller side in the slices' plane, and across it so that
    the slices reach from the upper jaw to just below the apex; a stack too thin for a head of a quarter of
    its natural height shows the middle of one. The bright band of the skull has nearly the same gray on both
    sides, so that the window is symmetric about its middle. The nose's opening is cut through it in front.

    Parameters
    ----------
    shape : (K, J, I)
        Slices, rows and columns, at least (2, 16, 16).
    spacing_mm : (x, y, z)
        Distance of the voxels along columns, rows and slices.
    contrast : {"mr", "ct"}
        Gray levels 0-255 in uint8, or Hounsfield units in int16.
    noise : float, optional
        Standard deviation of the Gaussian noise in gray levels; by default 6 (MR) or 25 HU (CT).
    seed : int
        Seed of the noise.

    Raises
    ------
    UsageError
        For a shape, spacing, contrast or noise outside these limits.

    Examples
    --------
    >>> from tomomesh import phantom
    >>> head = phantom((12, 32, 32), (7.5, 7.5, 12.0))
    >>> head.volume, head.lower, head.upper
    (Volume(12 x 32 x 32 of uint8, 7.5 x 7.5 x 12 mm), 200, 255)
    """
    _check(shape, spacing_mm, contrast, noise)
    tissue, head = CONTRASTS[contrast], Head.fitted(shape, spacing_mm)
    affine = np.diag([*spacing_mm, 1.0])
    affine[:2, 3] = [-(shape[2] - 1) / 2 * spacing_mm[0], -(shape[1] - 1) / 2 * spacing_mm[1]]
    affine[2, 3] = head.lowest_mm
    voxels = _voxels(head, shape, affine, tissue, tissue.noise if noise is None else noise, seed)
    volume = Volume.from_stored(voxels, affine, unit=tissue.unit)
    return Phantom(volume, head.middle(), tissue.lower, tissue.upper)


def _voxels(
    head: Head,
    shape: tuple[int, int, int],
    affine: NDArray[np.float64],
    tissue: Contrast,
    noise: float,
    seed: int,
) -> NDArray[Any]:
    """Paint slice by slice, so that only one slice is ever held as floating point."""
    axes = [np.arange(shape[2 - n], dtype=np.float32) * affine[n, n] + affine[n, 3] for n in range(3)]
    x, y, z = (axis.astype(np.float32) for axis in axes)
    rng, voxel_mm = np.random.default_rng(seed), float(max(affine[0, 0], affine[1, 1]))
    voxels = np.empty(shape, tissue.dtype)
    with np.errstate(divide="ignore"):
        for k in range(shape[0]):
            gray = head.paint(x[None, :], y[:, None], z[k : k + 1, None], tissue, voxel_mm)
            gray += noise * rng.standard_normal(shape[1:], dtype=np.float32)
            voxels[k] = np.clip(np.rint(gray), tissue.lowest, tissue.upper).astype(tissue.dtype)
    return voxels


def _first_order(u: Floats, v: Floats, w: Floats, half_x: Floats, half_y: Floats, half_z: Floats) -> Floats:
    """Return (g - 1) / |grad g|, g^2 = u^2 + v^2 + w^2, from half the gradient of g^2; -inf in the center."""
    g = np.sqrt(u * u + v * v + w * w)
    slope = np.sqrt(half_x * half_x + half_y * half_y + half_z * half_z) / np.maximum(g, 1e-9)
    return np.asarray((g - 1) / slope)


def _tube(around: int, along: int) -> NDArray[np.int64]:
    """Triangulate a stack of rings, counter-clockwise seen from outside where the rings rise."""
    low = np.arange((along - 1) * around).reshape(along - 1, around)
    beside = np.roll(low, -1, axis=1)
    corners = [low, beside, beside + around, low, beside + around, low + around]
    return np.stack(corners, axis=-1).reshape(-1, 3).astype(np.int64)


def _capped(tube: TriMesh) -> TriMesh:
    """Close a stack of rings, the lowest first, by fans of triangles around the middles of both ends."""
    heights = tube.vertices[:, 2]
    around, n = int((heights == heights[0]).sum()), len(tube.vertices)
    low, high = np.arange(around), np.arange(n - around, n)
    fans = [
        np.stack([ring, np.roll(ring, turn), np.full(around, middle)], axis=1)
        for ring, turn, middle in ((low, 1, n), (high, -1, n + 1))
    ]
    middles = [tube.vertices[ring].mean(axis=0) for ring in (low, high)]
    return TriMesh(np.concatenate([tube.vertices, middles]), np.concatenate([tube.faces, *fans]))


def _check(shape: tuple[int, int, int], spacing_mm: Triple, contrast: str, noise: float | None) -> None:
    if contrast not in CONTRASTS:
        found, expected = f"contrast = {contrast}", " | ".join(CONTRASTS)
    elif len(shape) != 3 or any(n < least for n, least in zip(shape, (2, 16, 16), strict=True)):
        found, expected = f"shape = {tuple(shape)}", "slices, rows and columns, at least (2, 16, 16)"
    elif len(spacing_mm) != 3 or not all(0 < s < math.inf for s in spacing_mm):
        found, expected = f"spacing_mm = {tuple(spacing_mm)}", "three numbers over 0"
    elif noise is not None and not 0 <= noise < math.inf:
        found, expected = f"noise = {noise}", "a number of at least 0"
    else:
        return
    raise UsageError("the phantom cannot be made", found=found, expected=expected)
