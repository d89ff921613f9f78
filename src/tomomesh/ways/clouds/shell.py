"""A shell of cubes around the samples of a cloud, what spans its holes, and whether it holds."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from ...cuberille.leak_test import SURE, close_leaks
from ...cuberille.neighbors import once_each
from ...cuberille.partition import cubes_over, is_flat
from ...errors import GeometryError
from ...model.cubes import cells_of
from ...opensurface.gaps import Gap, gaps
from ...pointcloud.bridges import bridges
from ...pointcloud.filling import fill_inside, made_up
from ...pointcloud.forecast import require_room
from ...pointcloud.solid import fills_solid
from ...stage import Stage, folded, timed
from ..sections import WIDE, count_walls, shell_found, walls_found
from .joints import apart, may_join, place_in_words
from .samples import ACROSS, cell_edges, lowest_corner, require_parts, too_wide

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...cuberille.leak_test import LeakTest
    from ...pointcloud.samples import Samples
    from ...progress import Progress
    from ...settings import Settings
    from .points import Points

    Floats = NDArray[np.float64]

SPANS = (5.0, 12.0)
"""Longest bridges that are tried, sampling distances. Chosen: half of them changes the distance by -0.3 %, twice by
-0.2 %."""
WIDEST = 6.0
"""Widest closing that is tried, sampling distances: large cubes are closed by fewer. Chosen: half and twice of it
change no case of benchmarks/constants.py."""
TRIED = ((0, 1, 2), (3, 4, 5, 6, 7, 8))
"""Closings that are tried before and after longer bridges, cubes: all that the leak test tries by itself. Chosen: a
closing of two joins what lies nearer than four cubes, about what the shorter bridges span."""
MET = 0.8
"""Share of the samples that must lie at a surface for it to be theirs: .96 and more do on the scans
that were measured. Chosen: half of it changes no case of few points, thin parts and holes; over 1 none is theirs."""
MADE_UP = 0.25
"""Share of a surface without samples from which it is refused, unless holes are to be filled: a third of a hemisphere's
is, and a sixth of a cube's that lacks a side: halfway. Half of it leaves out scans of a capsule and of a cube (.19,
.20), twice takes a hemisphere."""
OPEN = 0.4
"""Width of a border over that of all samples, from which they are of an open surface: .48 and more at the ends of tubes
and of a bowl, .31 and less in scans of closed objects."""
THIN = 0.5
"""Share of the cubes that lie at the surface of what is thin: .65 of a plate's in noise, .27 of a solid's of 20. Half
and twice change no case of few points and holes, none of which is laid around."""
BOTH_SIDES = (
    "the points lie on both sides of a part so thin that they cannot be told apart: the surface was laid around them, "
    "and may be wrong there"
)


@dataclass(frozen=True)
class Shell:
    """Cubes of an edge (3,) from a lowest corner, what spans their holes, and how they hold."""

    cell: Floats
    lowest: Floats
    cubes: int
    spanned: Floats
    leak_test: LeakTest
    by_normals: bool = False
    """Whether inside and outside were told apart by the normals alone."""
    doubt: str = ""
    """What of it is unsure, and where, in words."""
    finer: int = 1
    """How many times finer its cubes are than usual."""

    @property
    def is_thin(self) -> bool:
        """Whether all but a few of its cubes lie at its surface, as those of a thin plate do."""
        faces = self.leak_test.faces
        return len(np.unique(faces.cells[faces.occupied], axis=0)) >= THIN * self.cubes

    def middles(self, cells: NDArray[np.int64]) -> Floats:
        """Return where the middles of cubes (c, 3) are."""
        return np.asarray(self.lowest + self.cell * (cells + 0.5))

    def taken(self, settings: Settings) -> NDArray[np.bool_]:
        """Tell of each surface whether it is kept."""
        return self.leak_test.faces.worth_keeping(largest=settings.cubes.largest)


@timed("cubes")
def shell_around(points: Points, samples: Samples, settings: Settings, progress: Progress) -> Stage[Shell]:
    """Close a shell of cubes around a cloud; where it would leak, the normals may tell inside from outside.

    Raises
    ------
    GeometryError, ResourceError
        Where the cubes would be too small for the samples, or too many for the memory.
    """
    shell = _tightest(len(points.cloud), samples, settings, progress)
    doubted = not shell.leak_test.tight or shell.leak_test.shell.closing >= WIDE
    unsure = doubted and settings.cubes.closing is None and not _is_wide(shell, samples) and not _is_flat(samples)
    merged = len(samples.positions) + samples.strays < len(points.places)  # which says little of where they end
    if unsure and (settings.cubes.fill_holes or merged or not _is_open(_borders(shell, samples, settings), samples)):
        other = _by_normals(shell, samples, lowest_corner(points), settings, progress)
        shell = other if other.leak_test.is_better_than(shell.leak_test) else shell
    if settings.cubes.closing is None and may_join(shell, samples, threads=settings.run.threads):
        origin = lowest_corner(points)
        normals = partial(_by_normals, samples=samples, origin=origin, settings=settings, progress=progress)
        shell = apart(shell, samples, origin, settings, progress, normals)
    told = shell_found(shell.leak_test, shell.taken(settings), shell.cell, shell.cubes, len(shell.spanned))
    return folded(shell, told, Stage(None, warnings=(shell.doubt,) if shell.doubt else ()))


def _tightest(count: int, samples: Samples, settings: Settings, progress: Progress) -> Shell:
    """Return the shell that is tight with the least that is made up: short bridges, narrow closings, large cubes."""
    cubes, best = settings.cubes, None
    closings = TRIED if cubes.closing is None else ((cubes.closing,),)
    reach = WIDEST * float(np.median(samples.spacing))
    edges = cell_edges(samples, settings)
    require_parts(samples, edges[0], 3)
    for tried, span, cell in product(closings, SPANS, edges):
        require_room(count, samples, cell, even=settings.run.even)
        spanned = bridges(samples, float(cell.min()), span=span, threads=settings.run.threads, progress=progress)
        lowest, keys = cubes_over(np.concatenate([samples.positions, spanned]), cell)
        cells = cells_of(once_each(keys))
        steps = [k for k in tried if cubes.closing is not None or k * cell.min() <= reach]
        leak_test = close_leaks(
            cells, steps, cavities=cubes.surface != "outer", threads=settings.run.threads, progress=progress
        )  # fmt: skip
        if best is None or leak_test.two_sided >= SURE or leak_test.is_better_than(best.leak_test):
            best = Shell(cell, lowest, len(cells), spanned, leak_test)
        if leak_test.two_sided >= SURE:
            break
    assert best is not None
    return best


def _by_normals(shell: Shell, samples: Samples, origin: Floats, settings: Settings, progress: Progress) -> Shell:
    """Return a shell around what the normals say is inside; the one that leaks where they say nothing of the kind."""
    if not samples.normals.any():
        return shell
    places, threads = np.concatenate([samples.positions, shell.spanned]), settings.run.threads
    lowest, keys = cubes_over(places, shell.cell)
    leaky = close_leaks(cells_of(once_each(keys)), TRIED[-1][-1:], threads=threads, progress=progress)
    asked = float(shell.cell.min()) if settings.cubes.cell_mm else None
    found = fill_inside(samples, leaky, lowest, shell.cell, cell=asked, threads=threads, progress=progress)
    where = place_in_words(found.doubtful + origin)
    doubt = f"the shell of cubes does not hold: the normals tell inside from outside, least surely around {where}"
    cell = np.full(3, found.cell)
    other = Shell(cell, found.lowest, found.cubes, shell.spanned, found.leak_test, by_normals=True, doubt=doubt)
    share = float(made_up(other.middles(found.leak_test.faces.cells), samples, found.cell).mean())
    return shell if found.met < MET or (share > MADE_UP and not settings.cubes.fill_holes) else other


def _borders(shell: Shell, samples: Samples, settings: Settings) -> list[Gap]:
    """Find what the samples end at, the widest first; cubes wider than they lie apart would hide it."""
    edge = min(float(shell.cell.min()), float(np.median(samples.spacing)))
    return gaps(samples, edge, threads=settings.run.threads)


def _is_open(borders: list[Gap], samples: Samples) -> bool:
    """Tell whether a border is as wide as a part of the object."""
    return bool(borders) and borders[0].size > OPEN * float(np.linalg.norm(np.ptp(samples.positions, axis=0)))


def _is_wide(shell: Shell, samples: Samples) -> bool:
    """Tell whether the cubes are so much wider than the points lie apart that these have no say."""
    return float(shell.cell.min()) > ACROSS * float(np.median(samples.spacing))


def _is_flat(samples: Samples) -> bool:
    return is_flat(samples.positions, float(np.median(samples.spacing)))


def walls_of(shell: Shell, samples: Samples, points: Points, origin: Floats, settings: Settings) -> Stage[int]:
    """Count the walls of a shell.

    Raises
    ------
    GeometryError
        Where the outside leaks in, with the widest gap, or the points fill a solid.
    """
    tight = shell.leak_test.tight
    flat = not tight and _is_flat(samples)
    walls = count_walls(settings, tight=tight, flat=flat)
    if walls is not None and (tight or flat):
        return walls
    found = _borders(shell, samples, settings)
    if walls is not None:
        return folded(
            walls.value,
            walls,
            Stage(None, warnings=(f"the outside leaks in: {_leak(found, origin)}",) if found else ()),
        )
    if _is_wide(shell, samples):
        raise too_wide(shell.cell)
    if fills_solid(points.places):
        raise GeometryError(
            "the points fill a solid, and do not lie on its surface", found=f"{len(points.cloud)} points",
            expected="points on the surface of the object", hint="--filled, for the boundary of what they fill",
        )  # fmt: skip
    if shell.is_thin and not _is_open(found, samples):
        return walls_found(1, BOTH_SIDES)
    raise GeometryError(
        ("the points look like an open surface: " if found else "")
        + "the outside leaks into the shell of cubes, so its surface would have two walls",
        found=_leak(found, origin) if found else f"cell = {shell.cell.min():.4g}",
        expected="points all around the object, without gaps as wide as its holes",
        hint="--fill-holes to cap what is open, --open for a sheet with borders, or --allow-leaks",
    )


def _leak(borders: list[Gap], origin: Floats) -> str:
    """Say where the outside leaks in."""
    where = place_in_words(borders[0].place + origin)
    return f"{len(borders)} border(s), the widest a gap of {borders[0].size:.4g} around {where}"
