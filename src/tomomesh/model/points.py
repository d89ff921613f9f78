"""Points in space, and where each came from."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import UsageError
from .columns import for_kernels

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

NEURON, BRIDGE, CAP = 0, 1, 2
"""What a point is: a trained neuron or a measured point, a sample of a bridged gap, a sample of a closing cap."""

CROSSING, ADDED, BORDER = NEURON, BRIDGE, CAP
"""The same numbers on the boundary of a window, which has no networks: where gray levels cross a bound, beside a voxel
that was added so that the boundary touches itself nowhere, on the border of the volume, whatever voxel is behind it. In
both, 0 is measured."""

KINDS = (NEURON, BRIDGE, CAP)

COLORS = ("red", "green", "blue")
"""The attributes that together are a point's color, uint8."""

RING, SIDE, TRACK = "ring", "side", "track"
"""The attributes of neurons where a slice has several rings: which ring, what side it is on (`contours.SIDES`; odd ones
are around what is outside), and which contour it is from slice to slice."""

STRUCTURE = "structure"
"""The attribute of contours that somebody drew: the structure that each point is of. Slices that they are not on were
left out, or do not have them: nobody knows."""


@dataclass(frozen=True)
class PointSet:
    """The set P of the paper: positions, and the slice and neuron behind each.

    Attributes
    ----------
    positions : (n, 3) float array
        Patient millimeters (x, y, z), LPS; or the cloud's own unit.
    slices : (n,) int32 array
        The slice of each point, -1 where there is none.
    neurons : (n,) int32 array
        Its number within the network of that slice, -1 where it is not a neuron.
    kinds : (n,) uint8 array
        ``NEURON``, ``BRIDGE`` or ``CAP``; measured points of a cloud count as ``NEURON``. Of a window's boundary:
        ``CROSSING``, ``ADDED`` or ``BORDER``.
    attributes : mapping of str to (n,) or (n, c) array
        What else is known of each point, by name: `COLORS`, ``intensity`` and the like.
    frame : str
        As the file of a cloud names it, ``"LPS"`` or ``"RAS"`` where it is a patient's; else ``"unknown"``.
    notes : tuple of str
        What the reader decided or dropped, one line each, without patient data.
    unit : str or None
        Unit of the positions as the file of a cloud states it; None where it states none.

    Examples
    --------
    >>> import numpy as np
    >>> from tomomesh import PointSet
    >>> cloud = PointSet.from_positions(np.eye(3))
    >>> len(cloud), cloud.slices.tolist(), cloud.frame
    (3, [-1, -1, -1], 'unknown')
    """

    positions: NDArray[np.float64]
    slices: NDArray[np.int32]
    neurons: NDArray[np.int32]
    kinds: NDArray[np.uint8]
    attributes: Mapping[str, NDArray[Any]] = field(default_factory=dict)
    frame: str = "unknown"
    notes: tuple[str, ...] = ()
    unit: str | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "positions", for_kernels(self.positions, np.float64))
        for name, values in self.attributes.items():
            if values.ndim not in (1, 2) or len(values) != len(self.positions):
                raise UsageError(
                    "an attribute does not fit its points",
                    found=f"{name}: shape = {values.shape}",
                    expected=f"({len(self)},) or ({len(self)}, c)",
                )

    @classmethod
    def from_positions(cls, positions: NDArray[np.float64]) -> PointSet:
        """Take an (n, 3) cloud about which nothing else is known.

        Raises
        ------
        UsageError
            Where the positions are no (n, 3) array of finite numbers.
        """
        placed = np.asarray(positions, np.float64)
        if placed.ndim != 2 or placed.shape[1] != 3:
            raise UsageError("points are three numbers each", found=f"shape = {placed.shape}", expected="(n, 3)")
        if not np.isfinite(placed).all():
            row = int(np.flatnonzero(~np.isfinite(placed).all(axis=1))[0])
            raise UsageError("a point is not finite", found=f"row = {row}", expected="finite coordinates")
        unknown = np.full(len(placed), -1, np.int32)
        return cls(placed, unknown, unknown, np.zeros(len(placed), np.uint8))

    def __len__(self) -> int:
        return len(self.positions)

    def joined(self, *others: PointSet) -> PointSet:
        """Append the points of other sets; attributes that not all of them have are dropped."""
        sets = (self, *others)
        shared = {
            name: [one.attributes[name] for one in sets]
            for name, values in self.attributes.items()
            if all(name in one.attributes and one.attributes[name].shape[1:] == values.shape[1:] for one in others)
        }
        return PointSet(
            np.concatenate([one.positions for one in sets]),
            np.concatenate([one.slices for one in sets]),
            np.concatenate([one.neurons for one in sets]),
            np.concatenate([one.kinds for one in sets]),
            {name: np.concatenate(columns) for name, columns in shared.items()},
            self.frame,
            self.notes,
            self.unit,
        )
