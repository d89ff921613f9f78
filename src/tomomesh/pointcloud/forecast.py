"""Whether the surface of a cloud will fit into the memory, before any of it is made.

Measured on spheres and tori of 0.1 to 1 million points, evenly spread, at random and noisy, on two scans of 50,000
points, and at cubes of 0.25 to 4 times the usual edge: the cuberille of an area A has 1.41 to 1.58 A / cell^2 faces
(1.5 is the mean over all directions of a plane), and the peak of the whole run grows by 520 to 690 bytes for each of
them, whatever the closing; sorting and settling the points takes 350 to 390 bytes for each, before. The figures below
hold a quarter more.
"""

from __future__ import annotations

import math
import os
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import ResourceError
from ..memory.limit import free_disk

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from .samples import Samples

SETTLED = 480
"""Bytes for each point while the points are settled. Measured, as those below: tests hold a run's peak under their
sum."""
MEASURED = 100
"""Bytes for each point while the distances to the mesh are measured."""
FACE = {True: 1600, False: 690}
"""Bytes for each face of the cuberille, whether its triangles are made even or not: that takes most of them. The latter
is a quarter more than ten million points took, 547."""
SIDES = 0.5
"""Mean, over all directions of a plane, of its extent along an axis."""
MOST = 1e100
"""Root of the bytes that are told at most."""
UNITS = ("bytes", "KiB", "MiB", "GiB", "TiB")


def require_room_for_points(count: int, *, each: int = SETTLED) -> None:
    """Refuse a cloud whose points alone, with so many bytes each, would not fit into the memory there is.

    Raises
    ------
    ResourceError
        Naming what is needed and what is there.
    """
    room, where, more = _room()
    if each * count >= room:
        raise ResourceError(
            f"the points would not fit {where}",
            found=f"{count} points need {bytes_in_words(each * count)}",
            expected=f"at most {bytes_in_words(room)}",
            hint=f"fewer points, or {more}",
        )


def require_room(count: int, samples: Samples, cell: NDArray[np.float64], *, even: bool = True) -> None:
    """Refuse cubes whose surface would not fit into the memory there is.

    Parameters
    ----------
    count : int
        Points of the cloud.
    samples : Samples
        Their spacing tells the area of the surface.
    cell : (3,) float array
        Edge of the cubes along each axis.
    even : bool
        Whether triangles are made even.

    Raises
    ------
    ResourceError
        Naming what is needed, what is there, and the smallest edge that would fit.
    """
    require_room_for_points(count, each=MEASURED)
    edge, (room, where, more) = float(cell.min()), _room()
    sides = cell / edge
    faces = SIDES * float((samples.spacing**2).sum() * sides.sum() / sides.prod())  # were the smallest edge 1
    least = math.sqrt(FACE[even] * faces / (room - MEASURED * count))
    if edge >= least:
        return
    need = MEASURED * count + min(math.sqrt(FACE[even] * faces) / edge, MOST) ** 2
    plain = "--no-remesh, " if even else ""
    raise ResourceError(
        f"the surface would not fit {where}",
        found=f"cell = {edge:.4g} needs {bytes_in_words(need)}",
        expected=f"at most {bytes_in_words(room)}, so a cell of at least {_rounded_up(least)}",
        hint=f"{plain}a larger --cell, or {more}",
    )


def _room() -> tuple[float, str, str]:
    """Return how many bytes more there may be, where they lie, and what would give more."""
    disk = free_disk()
    if disk is not None:
        return disk, "onto the disk beyond the limit of the memory", "TMPDIR=FOLDER, one on a disk with more room"
    return free_memory(), "into the memory", "a machine with more memory, or --memory, which uses a disk"


def free_memory(root: Path = Path("/")) -> float:
    """Return how many bytes more this process may use; infinity where the system does not say.

    Parameters
    ----------
    root : path
        Where the folders ``proc`` and ``sys`` of Linux are.
    """
    return max(min(_of_machine(root), _of_groups(root), _of_addresses(root)), 0.0)


def _of_machine(root: Path) -> float:
    """Return what the machine can give without swapping; all that it has where it does not tell."""
    for line in _lines(root / "proc/meminfo"):
        if line.startswith("MemAvailable:"):
            return 1024.0 * int(line.split()[1])
    try:
        return float(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"))
    except (AttributeError, OSError, ValueError):
        return math.inf


def _of_groups(root: Path) -> float:
    """Return what the control groups of the process, and those that they are in, leave it."""
    rooms = [math.inf]
    for line in _lines(root / "proc/self/cgroup"):
        _, controllers, path = line.split(":", 2)
        if controllers == "":
            top, most, used, freed = root / "sys/fs/cgroup", "memory.max", "memory.current", "inactive_file"
        elif "memory" in controllers.split(","):
            top, most = root / "sys/fs/cgroup/memory", "memory.limit_in_bytes"
            used, freed = "memory.usage_in_bytes", "total_inactive_file"
        else:
            continue
        own = top / path.strip("/")
        for group in (own, *own.parents):
            if group.is_relative_to(top):
                rooms.append(_number(group / most) - _number(group / used, 0.0) + _cached(group, freed))
    return min(rooms)


def _cached(group: Path, name: str) -> float:
    """Return the bytes of files that a group gives up when it needs them."""
    found = [float(line.split()[1]) for line in _lines(group / "memory.stat") if line.split()[0] == name]
    return found[0] if found else 0.0


def _of_addresses(root: Path) -> float:
    """Return what the limit on addresses (``ulimit -v``) leaves."""
    try:
        import resource
    except ImportError:
        return math.inf
    most, _ = resource.getrlimit(resource.RLIMIT_AS)
    if most == resource.RLIM_INFINITY:
        return math.inf
    pages = [int(line.split()[0]) for line in _lines(root / "proc/self/statm")]
    return float(most - resource.getpagesize() * sum(pages))


def _number(path: Path, default: float = math.inf) -> float:
    """Return the number in a file, or what stands for no limit."""
    lines = _lines(path)
    return float(lines[0]) if lines and lines[0].strip().isdigit() else default


def _lines(path: Path) -> list[str]:
    try:
        return path.read_text(encoding="ascii", errors="replace").splitlines()
    except OSError:
        return []


def bytes_in_words(size: float) -> str:
    """Put a number of bytes into words."""
    power = min(int(math.log2(max(size, 1.0)) // 10), len(UNITS) - 1)
    return f"{size / 1024**power:.3g} {UNITS[power]}"


def _rounded_up(edge: float) -> str:
    """Return an edge to two digits, not below itself."""
    step = 10.0 ** (math.floor(math.log10(edge)) - 1)
    return f"{math.ceil(edge / step) * step:.2g}"
