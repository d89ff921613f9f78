"""How to run, and what becomes of the mesh at the end.

At most 1,024 threads: more than the cores of any machine, and fewer than a system refuses. A closed mesh has 4 faces.
"""

from __future__ import annotations

from dataclasses import dataclass

from .parameter import Group, param


@dataclass(frozen=True)
class RunSettings(Group):
    """How to run; no result depends on the number of threads."""

    seed: int = param(0, "seed of everything drawn at random", low=0)
    threads: int = param(0, "threads; 0 is one a core", low=0, high=1024)
    units: str | None = param(
        None,
        "unit that the numbers of a cloud, or of a mesh to print, are in; by default the one that the file states, "
        "else mm; studies are always in mm",
        kind=str,
        choices=("mm", "cm", "m", "unknown"),
    )
    frame: str = param(
        "lps",
        "what the coordinates of a study's mesh and points are written in: patient millimeters to the left, posterior "
        "and superior (lps) or to the right, anterior and superior (ras), or the indices (i, j, k) of the file's own "
        "voxels (voxel)",
        choices=("lps", "ras", "voxel"),
    )
    precision: int = param(
        64,
        "bits of the coordinates in .ply and .vtp, which some viewers want to be 32; 64 all the same where 32 would "
        "let vertices fall together or move visibly",
        choices=(64, 32),
    )
    local_origin: bool = param(
        False, "count a cloud's coordinates from its lowest corner, which report and file name: for STL far from 0"
    )
    smooth: float = param(
        0.0, "length below which detail is taken from the mesh, in a cloud's unit; its volume stays, and the report "
        "says how far vertices moved", unit="mm", low=0,
    )  # fmt: skip
    allow_far: bool = param(
        False, "write the mesh even where its volume, or its distance from the window, is far from the window's own"
    )
    remesh: bool = param(
        True, "make the triangles of the mesh even, along the same surface: leave those that its way has made",
        paper=False,
    )  # fmt: skip
    edge: float | None = param(
        None,
        "usual edge of an even triangle, shorter where the surface bends and longer where it is flat; by default as "
        "the mesh has faces",
        unit="mm",
        above=0,
    )
    target_faces: int | None = param(
        None, "most faces of the mesh, whose edges are made longer where it has more", kind=int, unit="faces", low=4
    )

    @property
    def even(self) -> bool:
        """Whether even triangles are asked for."""
        return self.remesh or self.edge is not None or self.target_faces is not None
