"""Find the smallest closing at which a shell of cubes keeps the outside out."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ..progress import Progress, silent
from .closing import close_shell
from .faces import HELD, Walls, walls

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

    from .closing import Shell

CLOSINGS = tuple(range(9))
"""Closings that are tried by themselves, cubes."""
LEAKING = 1
"""Closing of a shell that none makes hold, as of a sheet or a thin slab: it fills single holes."""
SURE = 0.8
"""Share of occupied cubes that tell of an inside from which no wider closing is tried."""
HOPELESS = 0.1
"""Share of the occupied cubes that must tell of an inside for the surfaces to be looked at one by one."""


@dataclass(frozen=True)
class Held:
    """A shell, its walls, and whether they keep the outside out.

    Attributes
    ----------
    shell : Shell
    walls : Walls
    two_sided : float
        Least share, over the surfaces, of occupied cubes that tell of an inside: near 1 where the shell holds, near
        0 where the outside leaks in and the surface would be two-walled.
    """

    shell: Shell
    walls: Walls
    two_sided: float

    @property
    def holds(self) -> bool:
        """Whether the outside stays out."""
        return self.two_sided >= HELD

    def is_better_than(self, other: Held) -> bool:
        """Tell which is nearer to the object: where both hold, the one of fewer handles, for noise makes handles."""
        if self.holds and other.holds and self.walls.handles != other.walls.handles:
            return self.walls.handles < other.walls.handles
        return self.two_sided > other.two_sided


def hold(
    cells: NDArray[np.int64],
    closings: Iterable[int] = CLOSINGS,
    *,
    cavities: bool = False,
    threads: int = 0,
    progress: Progress = silent,
) -> Held:
    """Close a shell by the fewest cubes that make it hold.

    Parameters
    ----------
    cells : (c, 3) int64 array
        Positions (x, y, z) of the cubes that hold points.
    closings : iterable of int
        What to try, cubes.
    cavities : bool
        Also take the objects inside of objects: their walls face inward, those inside of these outward again.
    threads : int
    progress : callable

    Returns
    -------
    Held
        The first that surely holds, else the best that holds; closed by `LEAKING` where none holds at all.
    """
    tried = list(closings)
    best: Held | None = None
    for count, steps in enumerate(tried):
        progress("closing", count, len(tried))
        shell = close_shell(cells, steps, threads=threads)
        if len(tried) > 1 and _share(shell) < HOPELESS:
            continue
        found = walls(shell)
        held = Held(shell, found, found.least_two_sided)
        best = held if best is None or held.two_sided >= SURE or held.is_better_than(best) else best
        if held.two_sided >= SURE:
            break
    progress("closing", len(tried), len(tried))
    if best is None:
        shell = close_shell(cells, LEAKING, threads=threads)
        best = Held(shell, walls(shell), 0.0)
    return replace(best, walls=_with_cavities(best.shell, best.walls)) if cavities else best


def _share(shell: Shell) -> float:
    """Return the share of occupied cubes that tell of an inside."""
    rows = len(shell.blocks)
    there, told = (int(np.bitwise_count(board[:rows]).sum()) for board in (shell.occupied, shell.witnesses))
    return told / max(there, 1)


def _with_cavities(shell: Shell, found: Walls) -> Walls:
    """Append the walls of what lies in the cavities, as far as they hold themselves."""
    if len(shell.within) == 0:
        return found
    inner = close_shell(shell.within, shell.closing, threads=shell.blocks.threads)
    within = walls(inner)
    within = within.only(within.two_sided >= HELD)
    return found.joined(_with_cavities(inner, within).turned())
