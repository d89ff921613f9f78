"""Tasks that know nothing of one another, each done once, whatever becomes of the workers."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Generic, TypeVar
from uuid import uuid4

from ..errors import BatchError, ResourceError
from ..kernels.native.code import folder as kernels
from ..kernels.threads import share_cores
from ..pointcloud.forecast import bytes_in_words

if TYPE_CHECKING:
    from collections.abc import Callable, Generator, Sequence

    from .cluster import Cluster

Item = TypeVar("Item")
EVERY_S = 0.5
"""Seconds from one word of a stage to the next: what is shown of it is drawn once a second."""


class DiedError(ResourceError):
    """A task has lost as many workers as Dask gives it."""


class GivenUpError(Exception):
    """Nobody wants the result any more."""


class Told:
    """The progress of a task (see `tomomesh.progress`), told to whoever listens, and the end of it when it is given up.

    Parameters
    ----------
    worker : distributed.Worker
    key : str
        Of the task.
    topic : str
        Under which it is told.
    number : int
        Of the item: no name goes into the scheduler's log.
    """

    def __init__(self, worker: Any, key: str, topic: str, number: int) -> None:
        self._worker, self._key, self._topic, self._number = worker, key, topic, number
        self._stage, self._said = "", 0.0

    def __call__(self, stage: str, done: int, total: int) -> None:
        """Tell where the task is.

        Raises
        ------
        GivenUpError
        """
        task = self._worker.state.tasks.get(self._key)
        if task is None or task.state == "cancelled":
            raise GivenUpError
        now = time.monotonic()
        if stage != self._stage or now - self._said >= EVERY_S:
            self._stage, self._said = stage, now
            self._worker.log_event(self._topic, [self._number, stage, done, total])


@dataclass(frozen=True)
class Tasks(Generic[Item]):
    """What is to be done with each of some items.

    Attributes
    ----------
    work : callable
        Called as ``work(item, progress)`` on a worker; a function that can be imported there, or a part of one.
    items : sequence
        What can be pickled.
    need : callable
        How many bytes an item will take, about.
    hear : callable
        Called as ``hear(number, stage, done, total)``, from another thread.
    warn : callable
        Called as ``warn(number, why)`` for a task that is run by itself.
    """

    work: Callable[[Item, Told], Any]
    items: Sequence[Item]
    need: Callable[[Item], float]
    hear: Callable[[int, str, int, int], None]
    warn: Callable[[int, str], None]

    def done_on(self, cluster: Cluster) -> Generator[tuple[int, Any]]:
        """Yield the number of each item and its result, or the error that it never will have one, as they come.

        What does not fit beside others, and whatever lost its worker, is done by itself after all others.

        Raises
        ------
        BatchError
            Where the scheduler is gone.
        """
        beside, alone, refused = self._by_size(cluster)
        yield from refused.items()
        running = _Running(cluster, self)
        try:
            for number, result in running.first_tries(beside):
                if isinstance(result, DiedError):
                    alone[number] = "its worker died"
                else:
                    yield number, result
            for number, why in sorted(alone.items()):
                self.warn(number, why)
                yield from running.results([number], by_itself=True)
        finally:
            running.end()

    def _by_size(self, cluster: Cluster) -> tuple[list[int], dict[int, str], dict[int, ResourceError]]:
        """Tell which items fit beside others, which by themselves, and which nowhere, and why."""
        beside, alone, refused = list[int](), dict[int, str](), dict[int, ResourceError]()
        for number, size in enumerate(map(self.need, self.items)):
            if size > cluster.most:
                refused[number] = _too_large(size, cluster.most)
            elif size > cluster.share:
                needs, share = bytes_in_words(size), bytes_in_words(cluster.share)
                alone[number] = f"it needs about {needs}, and a worker's share is {share}"
            else:
                beside.append(number)
        return beside, alone, refused


class _Running:
    """The tasks that a cluster has been given."""

    def __init__(self, cluster: Cluster, tasks: Tasks[Any]) -> None:
        self._cluster, self._tasks, self._topic = cluster, tasks, f"tomomesh-{uuid4().hex}"
        self._pending: dict[Any, int] = {}
        cluster.client.subscribe_topic(self._topic, lambda event: tasks.hear(*event[1]))

    def first_tries(self, numbers: Sequence[int]) -> Generator[tuple[int, Any]]:
        """Do many at once; where no kernel is compiled yet, one before, or all would compile the same."""
        first = 0 if kernels().exists() else 1
        yield from self.results(numbers[:first], by_itself=True)
        yield from self.results(numbers[first:], by_itself=False)

    def results(self, numbers: Sequence[int], *, by_itself: bool) -> Generator[tuple[int, Any]]:
        """Yield the number and the result of each as it is done."""
        from distributed import CancelledError, as_completed

        try:
            for number in numbers:
                self._pending[self._submitted(number, by_itself)] = number
            for future in as_completed([*self._pending], loop=self._cluster.client.loop):
                number = self._pending.pop(future)
                if future.cancelled():
                    raise _gone()
                yield number, _result(future)
        except (OSError, CancelledError):
            raise _gone() from None

    def _submitted(self, number: int, by_itself: bool) -> Any:
        key = f"{self._topic}-{number}-{int(by_itself)}"
        at_once = dict.fromkeys(self._cluster.at_once, 1) if by_itself else self._cluster.at_once
        given = (
            self._tasks.work,
            self._tasks.items[number],
            at_once,
            {"key": key, "topic": self._topic, "number": number},
        )
        return self._cluster.client.submit(_run, *given, key=key, pure=False)

    def end(self) -> None:
        """Give up what is not done."""
        client = self._cluster.client
        if client.status == "running":
            client.cancel([*self._pending])
            client.unsubscribe_topic(self._topic)


def _result(future: Any) -> Any:
    """Return what became of a task that is over; work itself raises nothing."""
    from distributed import KilledWorker

    fault = future.exception()
    if fault is None:
        return future.result()
    if isinstance(fault, KilledWorker):
        return DiedError(
            "every worker that took it died, in the end by itself",
            hint="a machine with more memory, for want of which processes are killed most often",
        )
    return ResourceError(
        "a worker could not take it", found=type(fault).__name__, expected="the same tomomesh on every worker"
    )


def _gone() -> BatchError:
    return BatchError("the scheduler is gone", hint="the same command again, which passes over what is finished")


def _too_large(size: float, most: float) -> ResourceError:
    return ResourceError(
        "it would not fit into the memory of any worker", found=f"about {bytes_in_words(size)}",
        expected=f"at most {bytes_in_words(most)}", hint="workers with more memory, or without a cluster",
    )  # fmt: skip


def _run(work: Callable[[Any, Told], Any], item: Any, at_once: dict[str, int], told: dict[str, Any]) -> Any:
    """Do a task on a worker, with the cores of its machine that others there leave to it."""
    from dask.system import CPU_COUNT
    from distributed import get_worker
    from distributed.comm import get_address_host

    worker = get_worker()
    share_cores(max(CPU_COUNT // at_once.get(get_address_host(worker.address), worker.state.nthreads), 1))
    return work(item, Told(worker, **told))
