"""Tasks that know nothing of one another, each done once, whatever becomes of the workers."""

from __future__ import annotations

import time
from dataclasses import dataclass
from itertools import islice
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
        Called as ``warn(number, why)`` for a task that fewer others, or none, are done beside.
    """

    work: Callable[[Item, Told], Any]
    items: Sequence[Item]
    need: Callable[[Item], float]
    hear: Callable[[int, str, int, int], None]
    warn: Callable[[int, str], None]

    def done_on(self, cluster: Cluster) -> Generator[tuple[int, Any]]:
        """Yield the number of each item and its result, or the error that it never will have one, as they come.

        Of those that need more than a worker's share fewer are worked on at once, after the others; what lost its
        worker is done by itself, at the end.

        Raises
        ------
        BatchError
            Where the scheduler is gone.
        """
        groups = self._by_size(cluster)
        for number, size in groups.pop(0, {}).items():
            yield number, _too_large(size, cluster.most)
        running, lost = _Running(cluster, self), list[int]()
        try:
            for at_once, group in sorted(groups.items(), reverse=True):
                self._explain(group, at_once, cluster)
                for number, result in running.first_tries([*group], at_once):
                    if isinstance(result, DiedError):
                        lost.append(number)
                    else:
                        yield number, result
            for number in sorted(lost):
                self.warn(number, "by itself, as its worker died")
                yield from running.results([number], 1)
        finally:
            running.end()

    def _by_size(self, cluster: Cluster) -> dict[int, dict[int, float]]:
        """Return the sizes of the items by their numbers, in groups by how many of such a size fit at once."""
        groups: dict[int, dict[int, float]] = {}
        for number, size in enumerate(map(self.need, self.items)):
            groups.setdefault(cluster.fitting(size), {})[number] = size
        return groups

    def _explain(self, group: dict[int, float], at_once: int, cluster: Cluster) -> None:
        """Say of which items fewer are worked on at once, and why."""
        beside = f"beside {at_once - 1} more at most" if at_once > 1 else "by itself"
        for number, size in group.items() if at_once < cluster.slots else ():
            share = bytes_in_words(cluster.share)
            self.warn(number, f"{beside}, as it needs about {bytes_in_words(size)}, and a worker's share is {share}")


class _Running:
    """The tasks that a cluster has been given."""

    def __init__(self, cluster: Cluster, tasks: Tasks[Any]) -> None:
        self._cluster, self._tasks, self._topic = cluster, tasks, f"tomomesh-{uuid4().hex}"
        self._pending: dict[Any, int] = {}
        cluster.client.subscribe_topic(self._topic, lambda event: tasks.hear(*event[1]))

    def first_tries(self, numbers: Sequence[int], at_once: int) -> Generator[tuple[int, Any]]:
        """Do many; where no kernel is compiled yet, one before the others, or all would compile the same."""
        first = 0 if kernels().exists() else 1
        yield from self.results(numbers[:first], 1)
        yield from self.results(numbers[first:], at_once)

    def results(self, numbers: Sequence[int], at_once: int) -> Generator[tuple[int, Any]]:
        """Yield the number and the result of each as it is done; the whole cluster's number at once is up to Dask."""
        from distributed import CancelledError, as_completed

        client, slots = self._cluster.client, self._cluster.slots
        first = len(numbers) if at_once == slots else at_once
        waiting = iter(numbers[first:])
        try:
            coming = as_completed([self._submitted(number, at_once) for number in numbers[:first]], loop=client.loop)
            for future in coming:
                number = self._pending.pop(future)
                if future.cancelled():
                    raise _gone()
                for another in islice(waiting, 1):
                    coming.add(self._submitted(another, at_once))
                yield number, _result(future)
        except (OSError, CancelledError):
            raise _gone() from None

    def _submitted(self, number: int, at_once: int) -> Any:
        whole = at_once == self._cluster.slots
        sharing = self._cluster.at_once if whole else dict.fromkeys(self._cluster.at_once, at_once)
        told = {"key": f"{self._topic}-{number}-{at_once}", "topic": self._topic, "number": number}
        given = self._tasks.work, self._tasks.items[number], sharing, told
        future = self._cluster.client.submit(_run, *given, key=told["key"], pure=False)
        self._pending[future] = number
        return future

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


def _run(work: Callable[[Any, Told], Any], item: Any, sharing: dict[str, int], told: dict[str, Any]) -> Any:
    """Do a task on a worker, with the cores of its machine that others there leave to it."""
    from dask.system import CPU_COUNT
    from distributed import get_worker
    from distributed.comm import get_address_host

    worker = get_worker()
    share_cores(max(CPU_COUNT // sharing.get(get_address_host(worker.address), worker.state.nthreads), 1))
    return work(item, Told(worker, **told))
