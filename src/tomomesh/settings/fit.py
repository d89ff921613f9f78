"""The dynamic mesh.

Where the numbers come from: with normalized masses the damping 1 is critical, and a time step up to 1 is stable on
every mesh (docs, theory). Of a sum of stiffness of .25, .5, 1 and 3 k_d, .25 draws a ring of 58 neurons least off its
points, by .34 mm against .46 to 1.77, and rests soonest, after 11 steps against 15 to 93 (measured); 200 are room for
worse.
"""

from __future__ import annotations

from dataclasses import dataclass

from ..errors import UsageError
from .parameter import Group, param


@dataclass(frozen=True)
class FitSettings(Group):
    """Dynamic mass-spring mesh (eq. 5-7)."""

    attraction: str = param(
        "auto",
        "what draws a vertex: the nearest point, or the surface that the points around it describe; "
        "auto is the surface for clouds and rings, and the nearest point for other networks",
        choices=("auto", "nearest", "surface"),
        paper="nearest",
    )
    stiffness: float = param(0.25, "sum of the structural stiffness at a vertex over k_d", low=0, paper=0.5)
    damping: float = param(1.0, "damping over critical damping", above=0)
    step: float = param(0.8, "time step, in units of 1/omega; at most the damping and its inverse", above=0, high=1)
    tolerance: float = param(
        1e-3,
        "speed and acceleration of every vertex under which it rests",
        unit="cube edges",
        above=0,
    )
    max_steps: int = param(200, "most steps", unit="steps", low=0)
    springs: str = param(
        "quads",
        "springs along the sides of squares or of triangles",
        choices=("quads", "triangles"),
        paper="triangles",
    )
    limit: str = param(
        "clamp",
        "where a vertex would move over one cube edge: clamp its step, or shorten the time step",
        choices=("clamp", "shorten"),
        paper="shorten",
    )
    allow_returns: bool = param(
        False,
        "let a vertex return to the point that it left last, as the paper's words do: the mesh may then never rest",
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        stable = min(self.damping, 1 / self.damping)
        if self.step > stable:
            raise UsageError(
                "the time step is above the stable limit",
                found=f"--step = {self.step:g}, --damping = {self.damping:g}",
                expected=f"--step at most {stable:g}, the smaller of --damping and its inverse",
            )
