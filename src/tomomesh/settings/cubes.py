"""Cubes, the shell of them, and what is taken of it.

The greatest values, 64 cubes and 1,000 passes, are far beyond use and keep a slip of the keyboard from taking hours.
"""

from __future__ import annotations

from dataclasses import dataclass

from .parameter import Group, param


@dataclass(frozen=True)
class CubeSettings(Group):
    """Space partition, cuberille and low-pass filter (Fig. 8)."""

    cell_mm: tuple[float, ...] | None = param(
        None, "edge of the cubes, one or one an axis (x y z), in a cloud's unit; by default what the points ask for",
        unit="mm", above=0, length=(1, 3),
    )  # fmt: skip
    cell_from: str = param(
        "adjacent",
        "what r, the edge of the cubes, is: the widest distance of neurons that are neighbors along a network or from "
        "slice to slice (adjacent), or of a neuron from the one nearest to it (nearest)",
        choices=("adjacent", "nearest"),
        paper="nearest",
    )
    cell_factor: float = param(1.0, "dilation factor on the edge of the cubes, for coarser models", above=0)
    caps: bool = param(True, "close the inside of rings that have nothing above or below")
    closing: int | None = param(
        None, "cubes by which gaps in the shell are closed; by default the fewest that keep the outside out",
        kind=int, unit="cubes", low=0, high=64,
    )  # fmt: skip
    stacks: str = param(
        "auto",
        "take points on parallel slices as contours, and close what lies between their insides; none never does",
        choices=("auto", "none"),
    )
    tracking: str = param(
        "scan",
        "how the faces of the cubes are found, which are the same: by a scan, or followed from face to face (faces)",
        choices=("scan", "faces"),
        paper="faces",
    )
    largest: bool = param(False, "keep the largest surface alone, where cubes make it; elsewhere --keep largest does")
    allow_leaks: bool = param(
        False, "write the surface even where the outside leaks in, or where it encloses less than half of its window"
    )
    filled: bool = param(
        False, "take points as filling a solid, not as lying on its surface, and write the boundary of what they fill"
    )
    fill_holes: bool = param(
        False, "cap the holes of a cloud's surface along their borders, however wide, and mark the faces as filled"
    )
    open: bool = param(False, "write an open surface as a one-sided sheet with its borders")
    surface: str = param(
        "auto",
        "the outer surfaces, or all, with what lies in cavities; auto is outer for rings, networks and nearest points, "
        "else all",
        choices=("auto", "outer", "all"),
    )
    divide: bool = param(
        True,
        "divide the voxels of thick slices into such as are nearly cubes, and move what is in each to where its "
        "neighbors have theirs; without, levels are interpolated linearly from slice to slice",
    )
    shared_walls: bool = param(
        False, "with --each-label, let neighbors share the walls between them to the bit, so that there is neither a "
        "gap nor an overlap"
    )  # fmt: skip
    low_pass: int = param(3, "passes of the low-pass filter over the cuberille", unit="passes", low=0, high=1000)
