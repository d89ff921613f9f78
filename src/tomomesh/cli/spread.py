"""Studies of a batch among Dask workers: what each needs, what is shown of them, and which paths they are told."""

from __future__ import annotations

import math
import sys
from argparse import Namespace
from dataclasses import dataclass, replace
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .. import io
from ..errors import ResourceError, TomomeshError, UsageError, printable
from .bars import Bars
from .outputs.checks import make_folder
from .records import COLUMNS, row_of_fault

if TYPE_CHECKING:
    from collections.abc import Callable, Generator, Sequence
    from contextlib import AbstractContextManager

    from ..scale.cluster import Cluster
    from ..scale.tasks import Told
    from ..settings import Settings
    from .records import Row

    Done = Callable[[io.Study, Namespace, Settings, Path], Row]

SMALL_BYTES = 280e6
"""What a small run takes, as docs/ways.md states. It, and the two below, are measured: the peaks of runs of a CT's bone
and skin, and of white matter in two label maps, were .59 to .76 of their sum."""
A_BYTE = 3.0
"""Bytes for each of the stored study's, as docs/ways.md states of the way that takes most."""
SURFACE = 5400.0
"""Bytes of a surface for each voxel on a side of the study, were it a cube of 16 bits a voxel: these surfaces had 13 to
21 triangles for each, of 330 bytes or less."""
NAMED = 4
"""Most studies that a line of progress names."""


@dataclass(frozen=True)
class Batch:
    """Many studies, and what is done with each.

    Attributes
    ----------
    studies : sequence of Study
    chosen : Namespace
    settings : Settings
    folder : Path
        Of the results.
    done : callable
        Makes the row of one study: the same wherever it is done.
    columns : tuple of str
        Of the table.
    of : str
        What its studies are called.
    """

    studies: Sequence[io.Study]
    chosen: Namespace
    settings: Settings
    folder: Path
    done: Done
    columns: tuple[str, ...] = COLUMNS
    of: str = "studies"

    def place(self, number: int) -> str:
        """Say which study has a number, from 0."""
        return printable(f"{number + 1}/{len(self.studies)} {self.studies[number].name}")


def spread_rows(batch: Batch) -> Generator[tuple[int, Row]]:
    """Yield the number of each study, from 0, and its row, as workers have done them.

    Raises
    ------
    TomomeshError
        Where there are no workers, and none any more.
    """
    from ..scale.tasks import Tasks

    studies, chosen = batch.studies, batch.chosen
    with _workers(chosen, len(studies)) as cluster, Bars(quiet=chosen.quiet) as bars:
        make_folder(batch.folder)
        shown = _Shown(batch, bars)
        plain = Namespace(**vars(chosen) | {"study": None, "output": None, "settings": None})
        sent = replace(batch, studies=(), chosen=plain, folder=batch.folder.absolute())
        work = partial(_on_worker, batch=sent, made_by=version("tomomesh"))
        tasks = Tasks(work, [*map(_absolute, studies)], shown.need, shown.hear, shown.warn)
        for number, result in tasks.done_on(cluster):
            shown.over(number)
            with bars.aside():
                yield number, _row(result, studies[number].name, chosen)


def _workers(chosen: Namespace, count: int) -> AbstractContextManager[Cluster]:
    from ..scale import cluster

    if not chosen.quiet:
        print("waiting for workers", file=sys.stderr)
    return cluster.connected(chosen.scheduler) if chosen.scheduler else cluster.local(min(chosen.workers, count))


def _need(study: io.Study, settings: Settings) -> float:
    """Return how many bytes a study takes, about; see `SMALL_BYTES` and what follows it."""
    try:
        stored = io.voxel_bytes(study, settings.read)
    except Exception:  # it cannot be read, which its row will tell
        return SMALL_BYTES
    return SMALL_BYTES + A_BYTE * stored + SURFACE * math.cbrt(stored / 2) ** 2


def _row(result: Any, name: str, chosen: Namespace) -> Row:
    """Return a study's row, where files are named as they were typed, not by the full paths that workers are given."""
    row: Row = row_of_fault(name, result) if isinstance(result, TomomeshError) else result
    named = (chosen.study, chosen.labels_in, chosen.output)
    for path in (Path(one) for one in named if isinstance(one, str)):
        if not path.is_absolute():
            full, typed = (printable(str(one)) for one in (Path.cwd() / path, path))
            error = row["error"].replace(f"{full}/", "" if path == Path() else f"{typed}/")
            row = row | {"error": error.replace(full, typed)}
    return row


def check_workers(chosen: Namespace) -> None:
    """Refuse numbers of workers that there cannot be, and two kinds of them.

    Raises
    ------
    UsageError
    """
    if chosen.workers is not None and chosen.scheduler:
        raise UsageError("a cluster has its own workers", found="--workers and --scheduler", expected="one of them")
    if chosen.workers is not None and chosen.workers < 1:
        raise UsageError("there must be a worker", found=f"--workers {chosen.workers}", expected="at least 1")


def _absolute(study: io.Study) -> io.Study:
    return replace(study, path=study.path.absolute(), files=tuple(file.absolute() for file in study.files))


def _on_worker(study: io.Study, told: Told, *, batch: Batch, made_by: str) -> Row:
    """Do a study on a worker, which must be of the same version."""
    if version("tomomesh") != made_by:
        other = ResourceError("a worker is of another version", expected=f"tomomesh {made_by}")
        return row_of_fault(study.name, other)
    return batch.done(study, Namespace(**vars(batch.chosen) | {"told": told}), batch.settings, batch.folder)


class _Shown:
    """What is shown of studies that are worked on at once."""

    def __init__(self, batch: Batch, bars: Bars) -> None:
        self._batch, self._bars = batch, bars
        self._underway: dict[int, str] = {}
        self._over: set[int] = set()
        self._sized = 0

    def need(self, study: io.Study) -> float:
        """Return how many bytes a study takes; thousands of headers on a far disk take their time."""
        size, self._sized = _need(study, self._batch.settings), self._sized + 1
        self._bars("headers", self._sized, len(self._batch.studies))
        if self._sized == len(self._batch.studies):
            self._bars(self._batch.of, 0, self._sized)
        return size

    def hear(self, number: int, stage: str, done: int, total: int) -> None:
        """Take note of where a study is; called from a thread of Dask's, also when the study is over."""
        self._underway[number] = f"{printable(self._batch.studies[number].name)} {stage} {done}/{total}"
        self._tell()

    def warn(self, number: int, why: str) -> None:
        """Say why fewer studies are done beside one."""
        if not self._batch.chosen.quiet:
            with self._bars.aside():
                print(f"{self._batch.place(number)}: {why}", file=sys.stderr)

    def over(self, number: int) -> None:
        """Count a study that is over."""
        self._over.add(number)
        self._tell()
        self._bars(self._batch.of, len(self._over), len(self._batch.studies))

    def _tell(self) -> None:
        words = [words for number, words in sorted(self._underway.copy().items()) if number not in self._over]
        self._bars.beside = "; ".join(words[:NAMED] + [f"{len(words) - NAMED} more"] * (len(words) > NAMED))
