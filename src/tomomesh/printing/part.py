"""The part to print, one arrow a line: mesh -> scaled -> mended -> cut flat -> hollowed -> drained."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

from ..errors import GeometryError, UsageError
from ..measure.topology import check_promise, topology
from ..measure.winding import linings
from ..model.units import MM
from ..progress import Progress, silent
from .cavity import hollowed
from .drains import drained
from .flat_base import direction_of, stood
from .pieces import largest_piece, without_cavities
from .solids import require_solids
from .thicken import ROOM, ROUNDS, thickened
from .verdict import verdict

if TYPE_CHECKING:
    from ..model.mesh import TriMesh
    from ..settings import Settings
    from ..settings.printing import PrintSettings

PRINTED_MM = {**MM, "unknown": 1.0}
"""Millimeters in the unit of a cloud or a mesh; one that is unknown is taken for them."""


MIRRORED = {"anterior": "posterior", "posterior": "anterior", "left": "right", "right": "left"}
"""Where a side of LPS lies in RAS."""

LOW_END = 3.0
"""How many times as much is added where a cut has left a wall thin: half of it lies below the base and is cut off, and
in half a disk of radius R the ball that touches the arc at 30 degrees, as walls are measured, has a diameter of 2/3 R.
With half of it 4 % of a cap of .4 mm stay thin, with two thirds none, and some faces pass through others (measured)."""


@dataclass(frozen=True)
class Part:
    """A mesh to print.

    Attributes
    ----------
    mesh : TriMesh
        In printed millimeters.
    per_unit : float
        Printed millimeters in a unit of the object's coordinates.
    settings : Settings
    notes : tuple of str
        What was asked for and changed nothing.
    """

    mesh: TriMesh
    per_unit: float
    settings: Settings
    notes: tuple[str, ...] = ()

    @cached_property
    def report(self) -> dict[str, Any]:
        """Whether it can be printed, key by key in docs/printing.md; measured on first use."""
        told = verdict(self.mesh, self.settings.printing, threads=self.settings.run.threads)
        return told | {"notes": [*self.notes, *told["notes"]]}


def resized(mesh: TriMesh, factor: float) -> TriMesh:
    """Return a mesh with every coordinate times a factor."""
    return mesh if factor == 1 else mesh.moved(factor * mesh.vertices)


def turned(asked: PrintSettings, frame: str) -> PrintSettings:
    """Return the settings for a frame: the way down is that of LPS, against which RAS is turned by half a turn."""
    return replace(asked, down=MIRRORED.get(asked.down, asked.down)) if frame == "RAS" else asked


def require_printing(settings: Settings) -> None:
    """Refuse what cannot be printed, and what needs a package that is not installed.

    Raises
    ------
    UsageError
    """
    if settings.cubes.open and settings.printing.asked:
        raise UsageError("a sheet encloses nothing to print", found="--open", expected="a closed surface")
    require_solids(settings.printing)


def make_part(mesh: TriMesh, settings: Settings, *, unit: str = "mm", progress: Progress = silent) -> Part:
    """Make a part to print of a closed mesh: scale, mend, cut, hollow and drain it, as far as asked for.

    Parameters
    ----------
    mesh : TriMesh
    settings : Settings
    unit : str
        A key of `PRINTED_MM`, of the mesh's coordinates; those of the part are millimeters.
    progress : callable

    Returns
    -------
    Part
        What is promised of every mesh that is written holds of its mesh.

    Raises
    ------
    GeometryError
        Where the mesh is not closed, manifold and outward.
    EmptyError
        Where nothing is left above the base, or there is no room for a cavity.
    """
    require_printing(settings)
    found = topology(mesh, cavities=linings(mesh))
    if not found.sound:
        faults = ", ".join(f"{name} = {count}" for name, count in found.faults.items() if count)
        raise GeometryError(
            "the mesh encloses no solid", found=faults, expected="a closed, outward 2-manifold", hint="`tomomesh check`"
        )
    asked, threads = settings.printing, settings.run.threads
    if unit not in PRINTED_MM:
        raise GeometryError(
            "the unit of what is to be printed has no known length", found=f"unit = {unit}",
            expected="a unit of length, as mm", hint="--units",
        )  # fmt: skip
    per_unit = asked.scale * PRINTED_MM[unit]
    made = resized(mesh, per_unit)
    if asked.one_piece:
        made = largest_piece(made)
    if asked.fill_cavities:
        made = without_cavities(made)
    if asked.thicken is not None:
        made = thickened(made, asked.thicken, threads=threads, progress=progress)
    if asked.flat_base is not None:
        made = _stood(made, asked, threads, progress)
    if asked.hollow is not None:
        made = hollowed(made, asked.hollow, threads=threads, progress=progress)
    notes: tuple[str, ...] = ()
    if asked.drain is not None:
        notes = () if linings(made) else ("there is no cavity to drain: --hollow makes one",)
        made = drained(made, asked.drain, asked.down)
    check_promise(made, cavities=linings(made))
    return Part(made, per_unit, settings, notes)


def _stood(mesh: TriMesh, asked: PrintSettings, threads: int, progress: Progress) -> TriMesh:
    """Cut a mesh flat, and thicken what the cut has left thin, as the low end of a shell; then cut that flat too."""
    assert asked.flat_base is not None
    made = stood(mesh, asked.flat_base, asked.down)
    if asked.thicken is None:
        return made
    for _ in range(ROUNDS):
        thick = thickened(made, asked.thicken, room=LOW_END * ROOM, threads=threads, progress=progress)
        if thick is made:
            break
        made = stood(thick, _below(thick, made, asked.down), asked.down)
    return made


def _below(mesh: TriMesh, other: TriMesh, down: str) -> float:
    """Return how much farther down a mesh reaches than another."""
    way = direction_of(down)
    return float((mesh.vertices @ way).max() - (other.vertices @ way).max())
