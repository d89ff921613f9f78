"""Every label of a label map as a surface of its own: the map is laid out once, and each label looked at in its box."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from .begin import laid_out, settled
from .errors import EmptyError, UsageError
from .pipeline import reconstructed
from .progress import Progress, silent
from .segmentation.labels import MOST

if TYPE_CHECKING:
    from collections.abc import Callable

    from .model.mesh import TriMesh
    from .model.volume import Volume
    from .results import Surface
    from .segmentation.study import LaidOut
    from .settings import Settings


class LabelSurfaces(Mapping[int, "Surface"]):
    """The labels of a label map, and the surface of each, which is made whenever it is asked for.

    Parameters
    ----------
    read : callable
        Hands over the study, and the label map beside it or None.
    settings : Settings
        Its ``select`` are the labels; where it has none, all but 0 are.
    progress : callable
    given : mapping
        Parameters that were asked for, of which those without effect are told.
    kept : bool
        Whether all stages of a surface are kept; else as `tomomesh.pipeline.reconstruct_once` leaves it.
    """

    def __init__(
        self, read: Callable[[], tuple[Volume, Volume | None]], settings: Settings, progress: Progress = silent,
        given: Mapping[str, Any] | None = None, *, kept: bool = True,
    ) -> None:  # fmt: skip
        if settings.window.keep_at or settings.window.drop_at:
            raise UsageError(
                "components are picked by places of one surface alone",
                found="--keep-at or --drop-at, and a surface a label",
                hint="each label on its own, by --select",
            )  # fmt: skip
        self._settings, self._given, self._kept, self._progress = settings, given or {}, kept, progress
        self._study = laid_out(*read(), settings, progress, labelled=True)
        self._numbers = settings.window.select or self._all()

    def _all(self) -> tuple[int, ...]:
        labels = self._study.labels
        assert labels is not None
        numbers = tuple(number for number in labels.numbers.tolist() if number)
        if not numbers:
            raise EmptyError("the label map holds no label", found="0 alone", expected="labels beside 0")
        if labels.volume.unit == "HU" or len(numbers) > MOST:
            found = f"{len(numbers)} levels, unit = {labels.volume.unit}"
            raise UsageError(
                "the label map may be a study of gray levels", found=found, hint="--select with its labels"
            )
        return numbers

    @property
    def walls(self) -> TriMesh | None:
        """All walls of the map, each once, in millimeters: once a surface that shares them has been made."""
        labels = self._study.labels
        return None if labels is None or labels.walls is None else labels.walls.mesh

    def _with_walls(self, progress: Progress) -> LaidOut:
        """Let the walls between all labels of the map come to rest, whichever of them are asked for."""
        from .isosurface.walls.walls import walls_between

        study, settings = self._study, self._settings
        labels = study.labels
        assert labels is not None
        if labels.walls is not None:
            return study
        on_study = replace(labels, volume=replace(study.volume, voxels=labels.volume.voxels))
        walls = walls_between(
            on_study, settings.fit, inside=study.inside, divide=settings.cubes.divide, threads=settings.run.threads,
            progress=progress,
        )  # fmt: skip
        return replace(study, labels=replace(labels, walls=walls))

    def __iter__(self) -> Iterator[int]:
        return iter(dict.fromkeys(self._numbers))

    def __len__(self) -> int:
        return len(set(self._numbers))

    def __contains__(self, number: object) -> bool:
        return number in self._numbers

    def __getitem__(self, number: int) -> Surface:
        """Return the surface that `tomomesh.reconstruct` makes with ``select=(number,)``; raises as it does."""
        return self.surface(number, self._progress)

    def surface(self, number: int, progress: Progress) -> Surface:
        """Return the same, with a progress of its own."""
        settings = self._settings.replace(select=(number,))
        if settings.cubes.shared_walls:
            self._study = self._with_walls(progress)
        return reconstructed(lambda: self._study, settings, self._given, progress, kept=self._kept)


def reconstruct_labels(
    volume: Volume,
    settings: Settings | None = None,
    *,
    labels: Volume | None = None,
    progress: Progress = silent,
    **changes: Any,
) -> LabelSurfaces:
    """Turn every label of a label map into a closed surface of its own, in one pass over the map.

    Parameters
    ----------
    volume : Volume
    settings : Settings, optional
        Its ``select`` are the labels; where it has none, all but 0 are.
    labels : Volume, optional
        A label map on the study's grid; where not given, the study is the label map itself.
    progress, **changes
        As in `tomomesh.reconstruct`.

    Returns
    -------
    LabelSurfaces
        A mapping of labels to surfaces, to the byte those of `tomomesh.reconstruct` with this label alone. Each is
        made when it is looked up, and raises then what `tomomesh.reconstruct` raises. With ``shared_walls`` they are
        parts of one net over the walls between all labels of the map, whichever are looked up.

    Raises
    ------
    TomomeshError
        Where there is no label map, or no label.

    Examples
    --------
    >>> import numpy as np
    >>> from tomomesh import Volume, reconstruct_labels
    >>> stored = np.zeros((4, 4, 8), np.uint8)
    >>> stored[1:3, 1:3, 1:3], stored[1:3, 1:3, 3:7] = 2, 5
    >>> found = reconstruct_labels(Volume.from_stored(stored, np.eye(4)))
    >>> {label: surface.report["quality"]["closed"] for label, surface in found.items()}
    {2: True, 5: True}
    """
    settings = settled(settings, changes, every=True)
    return LabelSurfaces(lambda: (volume, labels), settings, progress, changes)
