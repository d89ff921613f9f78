"""The whole way, one arrow a line: read -> select -> choose the way -> way -> finish."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

from .begin import begin, begun_on, laid_out, settled
from .finish import compare_with, finish
from .memory.heap import give_back
from .memory.limit import memory_limit
from .model.points import PointSet
from .progress import Progress, silent
from .segmentation.selection import STEPS
from .segmentation.study import lay_out
from .stage import Stage, folded

if TYPE_CHECKING:
    from collections.abc import Callable, Collection

    import numpy as np
    from numpy.typing import NDArray

    from .begin import Begun
    from .model.mesh import TriMesh
    from .model.volume import Volume
    from .results import Segmentation, Surface
    from .segmentation.study import LaidOut
    from .settings import Settings
    from .stage import Later


def reconstruct(
    volume: Volume,
    settings: Settings | None = None,
    *,
    labels: Volume | None = None,
    truth: TriMesh | None = None,
    progress: Progress = silent,
    **changes: Any,
) -> Surface:
    """Turn a study of slices into a closed surface (Reyes Aldasoro & Algorri 2000).

    Parameters
    ----------
    volume : Volume
    settings : Settings, optional
    labels : Volume, optional
        A label map on the study's grid, for ``select``; where not given, the study is the label map itself.
    truth : TriMesh, optional
        The exact surface, where it is known; the report then holds the distance to it, caps aside.
    progress : callable
        Called as ``progress(stage, done, total)``; raise in it to stop.
    **changes
        Parameters by their bare names, as ``neurons=80``; the report warns of those that have no effect beside the
        others. ``way`` is what the surface is made from, by default as the window needs it (docs/ways.md).

    Returns
    -------
    Surface

    Raises
    ------
    TomomeshError
        Of the kind that fits; see `tomomesh.errors`.

    Examples
    --------
    >>> from tomomesh import phantom, reconstruct
    >>> head = phantom((12, 32, 32), (7.5, 7.5, 12.0))
    >>> found = reconstruct(head.volume, lower=head.lower, neurons=40)
    >>> found.report["quality"]["closed"], found.report["quality"]["genus"]
    (True, 0)
    """
    settings = settled(settings, changes)
    return reconstructed(
        lambda: _laid_out(volume, labels, settings, progress), settings, changes, progress, truth=truth
    )


def reconstruct_once(
    read: Callable[[], tuple[Volume, Volume | None]], settings: Settings, *, progress: Progress = silent, **changes: Any
) -> Surface:
    """Reconstruct a study that nobody looks at again: what no later step needs is let go as soon as that is known.

    Parameters
    ----------
    read : callable
        Hands over the study, and the label map beside it or None, and keeps neither.
    settings, progress, **changes
        As in `reconstruct`.

    Returns
    -------
    Surface
        The mesh, its points and its report are those of `reconstruct`; the study's voxels, its window, networks and
        the surface before the fit are left out.
    """
    settings = settled(settings, changes)
    return reconstructed(lambda: _laid_out(*read(), settings, progress), settings, changes, progress, kept=False)


def segment(
    volume: Volume,
    settings: Settings | None = None,
    *,
    labels: Volume | None = None,
    progress: Progress = silent,
    **changes: Any,
) -> Segmentation[Any]:
    """Run stage one alone: window, networks, regions, points.

    Parameters and errors are those of `reconstruct`.

    Examples
    --------
    >>> from tomomesh import phantom, segment
    >>> head = phantom((12, 32, 32), (7.5, 7.5, 12.0))
    >>> found = segment(head.volume, lower=head.lower, neurons=40)
    >>> found.report["networks"]["trained"]
    12
    """
    settings = settled(settings, changes)
    progress("window", 0, STEPS)
    study = lay_out(volume, labels, settings, labelled=settings.window.select is not None)
    return _segmented(begun_on(study, settings, changes, progress), progress)


def reconstruct_points(
    points: PointSet | NDArray[np.float64],
    settings: Settings | None = None,
    *,
    memory: str | float | None = None,
    progress: Progress = silent,
    **changes: Any,
) -> Surface:
    """Turn any unoriented points into a closed surface: stages two and three alone.

    Parameters
    ----------
    points : PointSet or (n, 3) array
        Positions; their order and repetitions change nothing.
    memory : str or number, optional
        Bytes, as ``"4GB"``, that the work is to take at most: see `tomomesh.memory_limit`, which may also be around
        what comes before and after, as reading and writing.
    settings, progress, **changes
        As in `reconstruct`.

    Returns
    -------
    Surface

    Examples
    --------
    >>> import numpy as np
    >>> from tomomesh import reconstruct_points
    >>> turn = np.arange(500) + 0.5
    >>> z, angle = 1 - turn / 250, 2.4 * turn
    >>> flat = np.sqrt(1 - z**2)
    >>> ball = np.column_stack([flat * np.cos(angle), flat * np.sin(angle), z])
    >>> found = reconstruct_points(ball)
    >>> round(found.report["quality"]["volume_mm3"] / (4 / 3 * np.pi), 2)
    1.0
    """
    settings = settled(settings, changes)
    with memory_limit(memory):
        made = _of_points(points, settings, changes, progress)
    if memory is None:
        return made
    stages = (one if isinstance(one, Stage) else partial(_limited, memory, one) for one in made.stages)
    return replace(made, stages=tuple(stages))


def _of_points(
    points: PointSet | NDArray[np.float64], settings: Settings, given: Collection[str], progress: Progress
) -> Surface:
    from .printing.part import turned
    from .ways.clouds.points import take_points

    cloud = points if isinstance(points, PointSet) else PointSet.from_positions(points)
    taken = take_points(cloud, settings)
    settings = replace(settings, printing=turned(settings.printing, cloud.frame))
    begun = begin(settings, given, input=taken.value.input)
    made = begun.value.surface(taken.value, settings, progress)
    give_back()
    done, later = finish(replace(made.value, place=taken.value.place), settings, progress)
    return replace(done.value, way=begun.value.name, settings=settings, stages=(taken, begun, made, done, *later))


def _limited(memory: str | float, later: Later) -> Stage[Any]:
    """Make a stage within a limit of memory."""
    with memory_limit(memory):
        return later()


def reconstructed(
    lay: Callable[[], LaidOut], settings: Settings, given: Collection[str], progress: Progress,
    *, truth: TriMesh | None = None, kept: bool = True,
) -> Surface:  # fmt: skip
    """Take a study that was laid out to a surface; see `reconstruct` and `reconstruct_once`.

    Parameters
    ----------
    lay : callable
        Hands over the study, and need not keep it.
    settings : Settings
    given : collection of str
        The parameters that were asked for.
    progress : callable
    truth : TriMesh, optional
    kept : bool
        Whether all stages are kept.
    """
    return finished(begun_on(lay(), settings, given, progress), progress, truth=truth, kept=kept)


def finished(begun: Begun, progress: Progress, *, truth: TriMesh | None = None, kept: bool = True) -> Surface:
    """Take a study whose way is known to a surface; see `reconstructed`."""
    way, settings, taken = begun.way, begun.settings, begun.taken
    found = _segmented(begun, progress)
    del begun
    found = found if kept else found.without_voxels()
    give_back()
    made = way.surface(found, taken, progress)
    surface, told = made.value if kept else made.value.bare(), folded(None, made)
    del made
    found = found if kept else found.bare()
    give_back()
    done, later = finish(replace(surface, segmentation=found), settings, progress)
    known = () if truth is None else (compare_with(done.value, truth),)
    return replace(done.value, way=found.way, settings=settings, stages=(*found.stages, told, done, *known, *later))


def _laid_out(volume: Volume, labels: Volume | None, settings: Settings, progress: Progress) -> LaidOut:
    return laid_out(volume, labels, settings, progress, labelled=settings.window.select is not None)


def _segmented(begun: Begun, progress: Progress) -> Segmentation[Any]:
    """Run stage one."""
    way = begun.way
    assert way.segment is not None
    found = way.segment(begun.kept, begun.taken, progress)
    stages = (folded(None, begun.told, found), *found.value.stages)
    return replace(found.value, way=way.name, settings=begun.settings, stages=stages)
