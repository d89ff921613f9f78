"""Find the smallest closing at which a shell of cubes keeps the outside out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..progress import Progress, silent
from .shell import close_shell
from .walls import HELD, Walls, walls

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .shell import Shell

WIDEST = 8
"""Largest closing that is tried by itself, cubes."""
LEAKING = 1
"""Closing of a shell that none makes hold, as of a sheet or a thin slab: it fills single holes."""
HOPELESS = 0.1
"""Share of the occupied cubes that must tell of an inside for the surfaces to be looked at one by one."""


@dataclass(frozen=True)
class Held:
    """A shell, its walls, and whether they keep the outside out.

    Attributes
    ----------
    shell : Shell
    walls : Walls
    holds : bool
    """

    shell: Shell
    walls: Walls
    holds: bool


def hold(
    cells: NDArray[np.int64],
    closing: int | None = None,
    *,
    cavities: bool = False,
    threads: int = 0,
    progress: Progress = silent,
) -> Held:
    """Close a shell by a given number of cubes, or by the fewest that make it hold.

    Parameters
    ----------
    cells : (c, 3) int64 array
        Positions (x, y, z) of the cubes that hold points.
    closing : int, optional
    cavities : bool
        Also take the objects inside of objects: their walls face inward, those inside of these outward again.
    threads : int
    progress : callable

    Returns
    -------
    Held
        Where no closing up to `WIDEST` holds, closed by `LEAKING`.
    """
    tried = range(WIDEST + 1) if closing is None else [closing]
    for count, steps in enumerate(tried):
        progress("closing", count, len(tried))
        shell = close_shell(cells, steps, threads=threads)
        if closing is None and _share(shell) < HOPELESS:
            continue
        found = walls(shell)
        if found.holds or closing is not None:
            progress("closing", len(tried), len(tried))
            return Held(shell, _with_cavities(shell, found) if cavities else found, found.holds)
    progress("closing", len(tried), len(tried))
    shell = close_shell(cells, LEAKING, threads=threads)
    return Held(shell, walls(shell), False)


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
