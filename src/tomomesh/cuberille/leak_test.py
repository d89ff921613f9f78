"""The leak test: find the smallest closing at which a shell of cubes keeps the outside out."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ..progress import Progress, silent
from .closing import close_shell
from .faces import TIGHT, Faces, exposed_faces
from .parting import close_apart

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

    from .closing import Shell

CLOSINGS = tuple(range(9))
"""Closings that are tried by themselves, cubes: the widest closes holes of 16; a ring of 58 cubes is 18 wide."""
LEAKING = 1
"""Closing of a shell that none makes tight, as of a sheet or a thin slab: it fills single holes."""
SURE = 0.8
"""Share of occupied cubes that tell of an inside from which no wider closing is tried: what is tight and has an inside
lies above (measured, see `TIGHT`)."""
HOPELESS = 0.1
"""Share of the occupied cubes that must tell of an inside for the surfaces to be looked at one by one: what leaks lies
below (measured, see `TIGHT`)."""


@dataclass(frozen=True)
class LeakTest:
    """A shell, its faces, and whether the outside leaks in.

    Attributes
    ----------
    shell : Shell
    faces : Faces
    two_sided : float
        Least share, over the surfaces, of occupied cubes that tell of an inside: near 1 where the shell is tight, near
        0 where the outside leaks in, and the surface would run along both sides of the shell.
    """

    shell: Shell
    faces: Faces
    two_sided: float

    @property
    def tight(self) -> bool:
        """Whether the outside stays out."""
        return self.two_sided >= TIGHT

    def is_better_than(self, other: LeakTest) -> bool:
        """Tell which is nearer to the object: where both are tight, the one of fewer handles: noise makes handles."""
        if self.tight and other.tight and self.faces.handles != other.faces.handles:
            return self.faces.handles < other.faces.handles
        return self.two_sided > other.two_sided


def close_leaks(
    cells: NDArray[np.int64],
    closings: Iterable[int] = CLOSINGS,
    *,
    cavities: bool = False,
    tracking: str = "scan",
    threads: int = 0,
    progress: Progress = silent,
) -> LeakTest:
    """Close a shell by the fewest cubes that make it tight.

    Parameters
    ----------
    cells : (c, 3) int64 array
        Positions (x, y, z) of the cubes that hold points.
    closings : iterable of int
        What to try, cubes.
    cavities : bool
        Also take the objects inside of objects: their faces look inward, those inside of these outward again.
    tracking : str
        How faces are found (see `exposed_faces`).
    threads : int
    progress : callable

    Returns
    -------
    LeakTest
        The first that is surely tight, else the best that is tight; closed by `LEAKING` where none is at all.
    """
    tried = list(closings)
    best: LeakTest | None = None
    for count, steps in enumerate(tried):
        progress("closing", count, len(tried))
        shell = close_shell(cells, steps, threads=threads)
        if len(tried) > 1 and _share(shell) < HOPELESS:
            continue
        found = exposed_faces(shell, tracking=tracking)
        tested = LeakTest(shell, found, found.least_two_sided)
        best = tested if best is None or tested.two_sided >= SURE or tested.is_better_than(best) else best
        if tested.two_sided >= SURE:
            break
    progress("closing", len(tried), len(tried))
    if best is None:
        shell = close_shell(cells, LEAKING, threads=threads)
        best = LeakTest(shell, exposed_faces(shell, tracking=tracking), 0.0)
    best = _parted(best, cells, tracking) if best.tight else best
    return replace(best, faces=_with_cavities(best.shell, best.faces, tracking)) if cavities else best


def _parted(test: LeakTest, cells: NDArray[np.int64], tracking: str) -> LeakTest:
    """Part what the closing joined, where every part is surely tight by itself."""
    shell = close_apart(test.shell, cells)
    if shell is None:
        return test
    faces = exposed_faces(shell, tracking=tracking)
    more = int((~faces.debris).sum()) > int((~test.faces.debris).sum())
    return LeakTest(shell, faces, faces.least_two_sided) if more and faces.least_two_sided >= SURE else test


def _share(shell: Shell) -> float:
    """Return the share of occupied cubes that tell of an inside."""
    rows = len(shell.blocks)
    there, told = (int(np.bitwise_count(bitmask[:rows]).sum()) for bitmask in (shell.occupied, shell.witnesses))
    return told / max(there, 1)


def _with_cavities(shell: Shell, found: Faces, tracking: str) -> Faces:
    """Append the faces of what lies in the cavities, as far as that is tight itself."""
    if len(shell.within) == 0:
        return found
    inner = close_shell(shell.within, shell.closing, threads=shell.blocks.threads)
    within = exposed_faces(inner, tracking=tracking)
    within = within.only(within.two_sided >= TIGHT)
    return found.joined(_with_cavities(inner, within, tracking).turned())
