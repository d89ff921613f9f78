"""A stack of slices with its place in the patient."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from .lazy import LazyVoxels

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

AXES = ("sagittal", "coronal", "axial")
"""The plane whose normal is patient axis 0 (left), 1 (posterior), 2 (superior)."""

SLAB = 8
"""A study with this many times fewer slices than rows and columns is a slab. Chosen: a head of 24 slices of 256 is one,
of 54 none."""


@dataclass(frozen=True)
class Grid:
    """Where a file keeps its voxels: the key to writing labels back on the study's own grid.

    Attributes
    ----------
    axes : tuple of int
        The stored array axis (slowest first) behind each of the canonical axes K, J, I.
    flipped : tuple of bool
        Which of the canonical axes K, J, I run against the stored direction.
    affine : (4, 4) float array
        Stored index (last, middle, first array axis) to patient millimeters, LPS.
    shape : tuple of int
        Sizes of the stored array, slowest axis first; empty where there is no file.
    corner : tuple of int
        The lowest stored index of the part of it that a volume holds, slowest axis first.
    """

    axes: tuple[int, int, int]
    flipped: tuple[bool, bool, bool]
    affine: NDArray[np.float64]
    shape: tuple[int, ...] = ()
    corner: tuple[int, int, int] = (0, 0, 0)

    def restore(self, voxels: NDArray[Any]) -> NDArray[Any]:
        """Bring a canonical (K, J, I) array back into the stored order, with zeros around a part."""
        keep = tuple(slice(None, None, -1 if flip else 1) for flip in self.flipped)
        part = np.transpose(voxels[keep], np.argsort(self.axes))
        if part.shape == (self.shape or part.shape):
            return part
        whole = np.zeros(self.shape, part.dtype)
        whole[tuple(slice(low, low + size) for low, size in zip(self.corner, part.shape, strict=True))] = part
        return whole

    def blank(self) -> Volume:
        """Return the whole stored grid in canonical order; its voxels, all 0, take no memory."""
        return Volume.from_stored(np.broadcast_to(np.zeros((), np.uint8), self.shape), self.affine)


@dataclass(frozen=True)
class Volume:
    """Voxels in canonical order: K runs to superior, J to posterior, I to left (as nearly as they can).

    Attributes
    ----------
    voxels : (K, J, I) or (K, J, I, L) array
        Stored gray levels; HU where the study is CT. Those of a study that is read part by part are a `LazyVoxels`,
        which does what a view needs and refuses the rest: `in_parts` tells.
    affine : (4, 4) float array
        Index (i, j, k) to patient millimeters (x, y, z), LPS.
    grid : Grid
        The file's own order of axes.
    unit : str
        ``"HU"`` for CT, else ``"stored"``.
    notes : tuple of str
        What the reader decided or dropped, one line each, without patient data.
    padding : (lowest, highest) or None
        Gray levels that stand for nothing measured, where the file names them.
    other_frame : str
        The option that takes the file's other frame, where it holds two that disagree.
    dicom : mapping of str
        Fields of a DICOM study's header that say whose it is and where it belongs: never shown and never reported, only
        written where the user asks for them.

    Examples
    --------
    >>> import numpy as np
    >>> from tomomesh import Volume
    >>> to_the_right = np.diag([-0.5, 0.5, 2.0, 1.0])
    >>> study = Volume.from_stored(np.arange(24).reshape(4, 3, 2), to_the_right)
    >>> study
    Volume(4 x 3 x 2 of int64, 0.5 x 0.5 x 2 mm)
    >>> study.voxels[0, 0].tolist(), study.grid.flipped
    ([1, 0], (False, False, True))
    """

    voxels: NDArray[Any]
    affine: NDArray[np.float64]
    grid: Grid
    unit: str = "stored"
    notes: tuple[str, ...] = ()
    padding: tuple[float, float] | None = None
    other_frame: str = ""
    dicom: Mapping[str, Any] = field(default_factory=dict)

    def __repr__(self) -> str:
        k, j, i = self.shape
        x, y, z = self.spacing_mm
        return f"Volume({k} x {j} x {i} of {self.voxels.dtype}, {x:g} x {y:g} x {z:g} mm)"

    @classmethod
    def from_stored(
        cls,
        stored: NDArray[Any] | LazyVoxels,
        affine: NDArray[np.float64],
        *,
        unit: str = "stored",
        notes: tuple[str, ...] = (),
    ) -> Volume:
        """Turn a stored array into canonical order without copying it.

        Parameters
        ----------
        stored : (A, B, C) or (A, B, C, L) array
            Voxels, slowest axis first; a `LazyVoxels` stays one.
        affine : (4, 4) float array
            Index (c, b, a), fastest first, to patient millimeters, LPS.
        """
        world = _world_axes(affine[:3, :3])
        order = np.argsort(world)
        canonical = affine[:, [*order, 3]].copy()
        k, j, i = (int(2 - order[2 - n]) for n in range(3))
        voxels: Any = stored.transpose((k, j, i, *range(3, stored.ndim)))
        flips = [bool(canonical[2 - n, 2 - n] < 0) for n in range(3)]
        for n in (n for n in range(3) if flips[n]):
            canonical[:3, 3] += canonical[:3, 2 - n] * (voxels.shape[n] - 1)
            canonical[:3, 2 - n] *= -1
        voxels = voxels[tuple(slice(None, None, -1 if flip else 1) for flip in flips)]
        sizes = stored.shape[0], stored.shape[1], stored.shape[2]
        grid = Grid((k, j, i), (flips[0], flips[1], flips[2]), affine, sizes)
        return cls(voxels, canonical + 0.0, grid, unit, notes)

    @property
    def shape(self) -> tuple[int, int, int]:
        """Sizes K, J, I."""
        return self.voxels.shape[0], self.voxels.shape[1], self.voxels.shape[2]

    @property
    def in_parts(self) -> LazyVoxels | None:
        """The voxels, where they stay in their file and are read part by part."""
        voxels: object = self.voxels
        return voxels if isinstance(voxels, LazyVoxels) else None

    @property
    def layers(self) -> int:
        """Layers L of a voxel: 1 gray, 3 color."""
        return self.voxels.shape[3] if self.voxels.ndim == 4 else 1

    @property
    def spacing_mm(self) -> tuple[float, float, float]:
        """Distance between neighboring voxels along I, J, K, in millimeters."""
        x, y, z = np.sqrt((self.affine[:3, :3] ** 2).sum(axis=0))
        return float(x), float(y), float(z)

    @property
    def pixel_area_mm2(self) -> float:
        """Area of a pixel of a slice K; where a slice is sheared, less than the product of its spacings."""
        return float(np.linalg.norm(np.cross(self.affine[:3, 0], self.affine[:3, 1])))

    @property
    def slice_distance_mm(self) -> float:
        """Distance of the planes of neighboring slices K; under gantry tilt less than the spacing along K."""
        return self.voxel_mm3 / self.pixel_area_mm2

    @property
    def voxel_mm3(self) -> float:
        """Volume of a voxel."""
        return float(abs(np.linalg.det(self.affine[:3, :3])))

    @property
    def stored_axis(self) -> int:
        """The patient axis (0 left, 1 posterior, 2 superior) along which the file stacks its slices."""
        return 2 - self.grid.axes.index(0)

    def thickest_axis(self) -> int:
        """Return the patient axis across which slices are taken by default.

        That of the widest spacing; superior where it is not wider than the others by 0.1 %. A slab of few slices
        is never cut across its width, whatever its spacing.
        """
        counts = self.shape[::-1]
        thin = [axis for axis in range(3) if counts[axis] * SLAB < min(counts[:axis] + counts[axis + 1 :])]
        if thin:
            return thin[0]
        spacing = self.spacing_mm
        widest = int(np.argmax(spacing))
        return widest if spacing[widest] > 1.001 * max(spacing[:widest] + spacing[widest + 1 :]) else 2

    def along(self, axis: int) -> Volume:
        """Return a view whose slices K are stacked along a patient axis (0 left, 1 posterior, 2 superior).

        Rows and columns keep their order: K before J before I.
        """
        order = order_along(axis)
        columns = [2 - order[2], 2 - order[1], 2 - order[0], 3]
        axes, flipped = self.grid.axes, self.grid.flipped
        grid = replace(
            self.grid,
            axes=(axes[order[0]], axes[order[1]], axes[order[2]]),
            flipped=(flipped[order[0]], flipped[order[1]], flipped[order[2]]),
        )
        voxels = self.voxels.transpose((*order, *range(3, self.voxels.ndim)))
        return replace(self, voxels=voxels, affine=self.affine[:, columns], grid=grid)

    def cropped(self, box: tuple[slice, slice, slice]) -> Volume:
        """Return a view of the voxels from ``start`` to before ``stop`` along K, J and I."""
        first = np.array([side.start for side in box[::-1]])
        affine = self.affine.copy()
        affine[:3, 3] = self.to_mm(first[None].astype(np.float64))[0]
        corner = list(self.grid.corner)
        for axis, flip, side, size in zip(self.grid.axes, self.grid.flipped, box, self.shape, strict=True):
            corner[axis] += size - side.stop if flip else side.start
        grid = replace(self.grid, corner=(corner[0], corner[1], corner[2]))
        return replace(self, voxels=self.voxels[box], affine=affine, grid=grid)

    def bare(self) -> Volume:
        """Return the same without its voxels: all 0, they take no memory."""
        return replace(self, voxels=np.broadcast_to(np.zeros((), self.voxels.dtype), self.voxels.shape))

    def to_mm(self, indices: NDArray[np.float64]) -> NDArray[np.float64]:
        """Carry (n, 3) indices (i, j, k) to patient millimeters (x, y, z)."""
        return indices @ self.affine[:3, :3].T + self.affine[:3, 3]

    def to_indices(self, positions: NDArray[np.float64]) -> NDArray[np.float64]:
        """Carry (n, 3) patient millimeters to indices (i, j, k), not rounded."""
        return np.asarray(np.linalg.solve(self.affine[:3, :3], (positions - self.affine[:3, 3]).T).T, np.float64)


def order_along(axis: int) -> tuple[int, int, int]:
    """Return which of the canonical axes K, J, I become slices, rows and columns along a patient axis."""
    return ((0, 1, 2), (1, 0, 2), (2, 0, 1))[2 - axis]


def _world_axes(columns: NDArray[np.float64]) -> NDArray[np.int64]:
    """Assign a patient axis to every index axis, the clearest direction first."""
    cosines = np.abs(columns) / np.sqrt((columns**2).sum(axis=0))
    world = np.zeros(3, np.int64)
    for _ in range(3):
        axis, index = np.unravel_index(int(np.argmax(np.round(cosines, 9))), (3, 3))
        world[index] = axis
        cosines[axis, :] = -1
        cosines[:, index] = -1
    return world
