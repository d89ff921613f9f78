"""What the cubes of a cloud join though its points lie apart: parted by smaller cubes, or told of by their place."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import scipy

from ...cuberille.faces import TIGHT
from ...cuberille.leak_test import HOPELESS, SURE, close_leaks
from ...cuberille.neighbors import once_each
from ...cuberille.parting import joint, neck
from ...cuberille.partition import cubes_over
from ...measure.tree import Tree
from ...model.cubes import cells_of, keys_of
from ...model.mesh import TriMesh
from ...pointcloud.facing import facing_pairs
from ...pointcloud.stars import keys_between
from ...stage import Stage
from .samples import NOISE

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from ...cuberille.bitmasks import Bitmask
    from ...measure.intersections import CrossingFaces
    from ...pointcloud.samples import Samples
    from ...progress import Progress
    from ...settings import Settings
    from .shell import Shell

    Floats = NDArray[np.float64]

SMALL, FINER = 0.5, 2
"""Edge of the small cubes, sampling distances, and how many times finer than others that is, about."""
SMALLER = 0.75
"""The same, edges of the cubes before, over which nothing is gained: where noise asks for large ones."""
CLOSINGS = (0, 1, 2)
"""Closings of the small cubes that are tried: two of them span what one of the others does."""
BURIED = 1.5
"""Distance from the surface, sampling distances, from which a sample has no say in it."""
FEWER = 0.5
"""Share of the samples without a say of another shell that may be left for this one to be taken instead."""
LOST = 0.001
"""The same, over all samples, that may be without a say in addition: a loop of a lace is more."""
OFF, TURNED = 0.25, 0.5
"""Distance from the mesh, sampling distances, and cosine of the angle between the normals, over and under which it
passes a sample by: all that are joined do both, a rounded edge only one."""
PASSED, BESIDE = 24, 4.0
"""Samples passed by that tell of a joint, within how many sampling distances of one of them: 36 and more where turns of
a coil were joined, at most 17 in the clouds of docs/clouds.md (cat, skull, fandisk; measured)."""
FACING, TAKEN_IN = 2.0, 0.1
"""How near, sampling distances, two samples lie that face one another, and how far off, over the noise, the mesh passes
a pair by that it has joined; of more noise than that nothing is said, for its normals face anywhere (bunny and wingnut
of .1 % noise were warned of). It passes 2 to 12 pairs by where rods cross 1 s apart (six seeds), none in the clouds of
docs/clouds.md. With .25 s two seeds of six have none; 2.5 s changes nothing of it."""
NO_PAIRS = np.empty((0, 2), np.int64)
"""Of samples in noise, and of those that the mesh follows."""


def may_join(shell: Shell, samples: Samples, *, threads: int = 0) -> bool:
    """Tell whether a shell may have joined what is near one another.

    Either it has points deep inside; or it has handles, and samples face one another that its cubes can join. In noise
    these face anywhere, and handles suffice.
    """
    test = shell.leak_test
    if not test.tight or joint(test.shell) is not None:
        return test.tight
    if test.faces.handles == 0 or not _is_clean(samples):
        return test.faces.handles > 0
    widest = 2 * (1 + test.shell.closing) * shell.cell  # along each axis, of cubes that touch once they are dilated
    pairs = facing_pairs(samples, float(np.linalg.norm(widest)), threads=threads)
    steps = np.abs(np.diff(samples.positions[pairs], axis=1)[:, 0])
    return bool((steps <= widest).all(axis=1).any())


def apart(
    shell: Shell, samples: Samples, origin: Floats, settings: Settings, progress: Progress,
    by_normals: Callable[[Shell], Shell],
) -> Shell:  # fmt: skip
    """Return a shell, or one that joins less: of small cubes, or of what the normals say is inside.

    The normals are asked where points still lie deep inside, or cubes of the two sizes disagree about the handles;
    but not in noise, of which small cubes make handles.
    """
    small, noisy = of_small_cubes(shell, samples, settings, progress), _is_noisy(samples)
    first, second = (small, shell) if is_nearer(small, shell, samples, fewer=noisy) else (shell, small)
    agree = noisy or _handles(first) == _handles(second) or not second.leak_test.tight
    if agree and joint(first.leak_test.shell, first.finer) is None:
        return first if first is shell else _with_neck(first, shell, origin)
    if first.by_normals:  # which have been asked
        return first
    third = by_normals(first)
    if is_nearer(third, first, samples, fewer=True):
        return third
    sure = agree or (third is not first and _handles(third) == _handles(first))
    return first if sure else replace(first, doubt=_disagreement(first, second, origin))


def _with_neck(small: Shell, shell: Shell, origin: Floats) -> Shell:
    """Tell of a neck that small cubes have left of a joint."""
    buried = shell.middles(shell.leak_test.shell.buried())
    cubes = np.floor((buried - small.lowest) / small.cell).astype(np.int64)
    found = neck(small.leak_test.shell, cubes)
    if found is None:
        return small
    where = place_in_words(small.middles(found) + origin)
    return replace(small, doubt=f"two parts hang together by a few cubes around {where}, which may be two objects")


def _handles(shell: Shell) -> int:
    return shell.leak_test.faces.handles


def _disagreement(shell: Shell, other: Shell, origin: Floats) -> str:
    """Say how many handles two shells have, and where they are farthest from one another."""
    middles, others = (one.middles(one.leak_test.faces.cells) for one in (shell, other))
    farthest = middles[np.argmax(scipy.spatial.cKDTree(others).query(middles)[0])] + origin
    counts = f"{_handles(shell)} with those of {shell.cell.min():.3g}, {_handles(other)} with {other.cell.min():.3g}"
    return f"cubes of two sizes disagree about the handles, {counts}, most around {place_in_words(farthest)}"


def of_small_cubes(shell: Shell, samples: Samples, settings: Settings, progress: Progress) -> Shell:
    """Return the shell of small cubes that hold the triangles between neighbors; the one before where it leaks."""
    spacing, noise = float(np.median(samples.spacing)), float(np.median(samples.noise))
    cell = np.full(3, max(SMALL * spacing, NOISE[1] * noise))
    if settings.cubes.cell_mm or cell[0] > SMALLER * shell.cell.min():
        return shell
    threads = settings.run.threads
    lowest, keys = cubes_over(np.concatenate([samples.positions, shell.spanned]), cell)
    between = keys_between(samples, lowest, cell, threads=threads, progress=progress)
    cells = cells_of(once_each(np.concatenate([keys, between])))
    cavities = settings.cubes.surface != "outer"
    test = close_leaks(cells, CLOSINGS, cavities=cavities, threads=threads, progress=progress)
    return replace(shell, cell=cell, lowest=lowest, cubes=len(cells), leak_test=test, finer=FINER)


def is_nearer(other: Shell, shell: Shell, samples: Samples, *, fewer: bool) -> bool:
    """Tell whether another shell is surely tight, loses no part, and has other (or fewer) handles or joins less."""
    if other is shell or other.leak_test.two_sided < SURE:
        return False
    handles, before = _handles(other), _handles(shell)
    left, had = _without_say(other, samples), _without_say(shell, samples)
    if left > had + LOST * len(samples.positions) or _leaks_more(other, shell, samples):
        return False
    return handles < before or not fewer if handles != before else left < FEWER * had


def _is_noisy(samples: Samples) -> bool:
    """Tell whether noise leaves no room for the small cubes."""
    return NOISE[1] * float(np.median(samples.noise)) > SMALL * float(np.median(samples.spacing))


def _without_say(shell: Shell, samples: Samples) -> int:
    reach, order = BURIED * float(np.median(samples.spacing)), np.arange(len(samples.positions), dtype=np.int32)
    tree = Tree.of_points(shell.middles(shell.leak_test.faces.cells))
    return int(np.count_nonzero(tree.nearest(samples.positions, order=order, enough=reach)[0] > reach))


def _leaks_more(other: Shell, shell: Shell, samples: Samples) -> bool:
    """Tell whether a part, however small, tells of no inside in another shell though it does in this one.

    What leaks lies under `HOPELESS`; where noise lets half of a part tell of an inside, .12 of it still does in small
    cubes that are right (the skull of docs/clouds.md, whose false handle they take away).
    """
    reach = BESIDE * float(np.median(samples.spacing))
    looked_at = _places(other, other.leak_test.shell.occupied & ~other.leak_test.shell.witnesses)
    _, once = np.unique(keys_of(np.floor(looked_at / reach).astype(np.int64)), return_index=True)
    shares = (_share_around(looked_at[once], one, reach) for one in (other, shell))
    return any(after < HOPELESS and before >= TIGHT for after, before in zip(*shares, strict=True))


def _share_around(places: Floats, shell: Shell, reach: float) -> Floats:
    """Return the share of the occupied cubes within reach of each place that tell of an inside."""
    test = shell.leak_test.shell
    told, there = (
        scipy.spatial.cKDTree(_places(shell, one)).query_ball_point(places, reach, return_length=True)
        for one in (test.witnesses, test.occupied)
    )
    return np.asarray(told / np.maximum(there, 1))


def _places(shell: Shell, bitmask: Bitmask) -> Floats:
    """Return the middles of a set of a shell's cubes."""
    return shell.middles(shell.leak_test.shell.blocks.cells(bitmask))


def follows(
    shell: Shell, mesh: TriMesh, samples: Samples, origin: Floats, tangled: CrossingFaces, *, threads: int = 0
) -> Stage[None]:
    """Say where points lie deep inside of a mesh, or it passes them by; its faces were last looked at by `tangled`."""
    if not shell.leak_test.tight or shell.doubt:
        return Stage(None)
    deep = joint(shell.leak_test.shell, shell.finer)
    inside = None if deep is None else shell.middles(deep)
    place = passed_by(mesh, samples, tangled, threads=threads) if inside is None else inside
    if place is None:
        return Stage(None)
    where = f"points lie deep inside of the surface around {place_in_words(place + origin)}"
    return Stage(None, warnings=(f"{where}: what is nearer than the cubes can part was joined",))


def place_in_words(place: Floats) -> str:
    """Say where a place (3,) is."""
    return "(" + ", ".join(f"{c:.6g}" for c in place) + ")"


def passed_by(
    mesh: TriMesh, samples: Samples, tangled: CrossingFaces | None = None, *, threads: int = 0
) -> Floats | None:
    """Return the place (3,) where a mesh passes samples by, facing pairs or most; None if it follows all but a few."""
    spacing, noise = float(np.median(samples.spacing)), float(np.median(samples.noise))
    enough = min(OFF * spacing, TAKEN_IN * spacing + noise)
    tree = (tangled and tangled.handed_over()) or Tree.of_faces(mesh, threads=threads)
    order = np.arange(len(samples.positions), dtype=np.int32)  # that of their cubes
    away, face = tree.nearest(samples.positions, order=order, enough=enough, threads=threads)
    del tree, order  # before rows of the samples are made
    asked = away > TAKEN_IN * spacing + noise if _is_clean(samples) else np.zeros(len(away), np.bool_)
    between = facing_pairs(samples, FACING * spacing, asked, threads=threads) if asked.any() else NO_PAIRS
    taken_in = away[between].max(axis=1, initial=0)
    if len(between):
        return np.asarray(samples.positions[between[taken_in.argmax()]].mean(axis=0))
    off = np.flatnonzero(away > OFF * spacing)
    normals = TriMesh(mesh.vertices, mesh.faces[face[off]]).face_vectors
    across = np.abs((normals * samples.normals[off]).sum(axis=1)) / np.maximum(np.linalg.norm(normals, axis=1), 1e-300)
    passed = samples.positions[off[across < TURNED]]
    if len(passed) < PASSED:
        return None
    beside = scipy.spatial.cKDTree(passed).query_ball_point(passed, BESIDE * spacing, return_length=True)
    return np.asarray(passed[beside.argmax()]) if beside.max() >= PASSED else None


def _is_clean(samples: Samples) -> bool:
    """Tell whether there is so little noise that normals tell which samples face one another."""
    return float(np.median(samples.noise)) <= TAKEN_IN * float(np.median(samples.spacing))
