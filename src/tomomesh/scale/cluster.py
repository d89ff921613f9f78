"""Dask workers: our own on this machine, or those of a cluster that is there."""

from __future__ import annotations

import json
import logging
import math
import os
import signal
import sys
import threading
import warnings
from collections import Counter
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from importlib import import_module
from multiprocessing import resource_tracker
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import ResourceError, UnreadableError, UsageError
from ..io.files.private import private_folder
from ..kernels.threads import cores
from ..pointcloud.forecast import free_memory

if TYPE_CHECKING:
    from collections.abc import Iterator

LOOPBACK = "127.0.0.1"
ANSWER_S = 10.0
"""How long a scheduler may take to answer: Dask's own clients give it 30, in which a user would think that we hang."""
START_S = 120.0
"""How long the first of our own workers may take to start. Measured: 2 to 5 s on two busy cores."""
AGAIN = 1
"""How often Dask gives a task whose worker died to another one, before we run it by itself."""
LOGGERS = ("distributed", "distributed.client", "tornado", "tornado.application")
"""Those that Dask gives handlers of their own."""

QUIET = logging.NullHandler()
"""With it a logger prints nothing by itself, and whoever listens to logs hears it as before."""

UNWATCHED = {
    "distributed.worker.profile.enabled": False,
    "distributed.admin.tick.interval": "1s",
    "distributed.admin.system-monitor.interval": "10s",
}
"""How often Dask looks at itself, for a dashboard that no one sees here. Measured: two idle workers and their scheduler
take .02 CPU seconds a second so, .09 with a profile 100 times a second and ticks 50 times, as Dask has it."""


@dataclass(frozen=True)
class Cluster:
    """Workers that tasks can be given to.

    Attributes
    ----------
    client : distributed.Client
    at_once : dict
        How many tasks each machine works on at once, by its host.
    share : float
        Bytes that a task may take beside as many others.
    most : float
        Bytes that a task may take by itself.
    pooled : bool
        Whether all take from the same memory, so that fewer at once may take more each.
    """

    client: Any
    at_once: dict[str, int]
    share: float
    most: float
    pooled: bool

    @property
    def slots(self) -> int:
        """How many tasks are worked on at once."""
        return sum(self.at_once.values())

    def fitting(self, size: float) -> int:
        """Return how many tasks of so many bytes may be worked on at once: `slots`, its halves, and at last 1, or 0."""
        if size > self.most:
            return 0
        count = self.slots
        while count > 1 and size > self.share * (self.slots / count if self.pooled else 1):
            count = count // 2 if self.pooled else 1
        return count


@contextmanager
def local(workers: int) -> Iterator[Cluster]:
    """Start workers on this machine, each a process with one task at a time, and end them however the block ends.

    They listen on loopback alone, for who has the keys that are made for this run. A worker that dies is replaced.
    None is killed for what memory it takes: a task's share is what is free at the start over the workers, and of
    those that need more fewer are worked on at once.

    Raises
    ------
    UsageError
        Where Dask is not installed.
    ResourceError
        Where no worker starts.
    """
    with ExitStack() as stack:
        with _unbroken():
            required()
            stack.enter_context(_unheard())
            stack.enter_context(_configured(max(cores() // workers, 1), stack.enter_context(private_folder())))
            try:
                client = _started(workers, stack)
            except (OSError, RuntimeError):  # no time, no room for processes, no place to listen at
                raise ResourceError("no worker could be started", hint="fewer --workers, or none") from None
        yield Cluster(client, {LOOPBACK: workers}, free_memory() / workers, math.inf, pooled=True)


def _started(workers: int, stack: ExitStack) -> Any:
    """Start workers and return their client, as soon as one of them is there."""
    from distributed import Client, LocalCluster

    with _deaf_children():
        here = LocalCluster(
            n_workers=0, threads_per_worker=1, host=LOOPBACK, security=True, memory_limit=0,
            silence_logs=logging.CRITICAL, dashboard_address=f"{LOOPBACK}:0", scheduler_kwargs={"dashboard": False},
        )  # fmt: skip
    stack.callback(_end, here)
    here.scale(workers)
    client = stack.enter_context(Client(here, set_as_default=False))
    client.wait_for_workers(1, timeout=START_S)
    return client


@contextmanager
def connected(scheduler: str) -> Iterator[Cluster]:
    """Connect to a cluster that is there; its workers stay as they are.

    Parameters
    ----------
    scheduler : str
        The address of its scheduler, as ``tcp://host:8786``, or the path of its scheduler file.

    Raises
    ------
    UsageError
        Where Dask is not installed.
    UnreadableError
        Where no scheduler answers.
    """
    required()
    with _unheard():
        client = _client(scheduler)
        try:
            yield _cluster_of(client, scheduler)
        finally:
            with suppress(OSError):
                client.close(timeout=1)


def _cluster_of(client: Any, scheduler: str) -> Cluster:
    """Return the workers of a scheduler; the first may come in hours, where there is a queue."""
    try:
        client.wait_for_workers(1)
        workers = client.scheduler_info(n_workers=-1)["workers"].values()
    except OSError:
        raise UnreadableError("the scheduler is gone", file=scheduler) from None
    limits = [(one["memory_limit"] or math.inf, one["nthreads"]) for one in workers]
    at_once = Counter[str]()
    for one in workers:
        at_once[one["host"]] += one["nthreads"]
    share, most = min(limit / tasks for limit, tasks in limits), max(limit for limit, _ in limits)
    return Cluster(client, dict(at_once), share, most, pooled=False)


def required() -> None:
    """Refuse to go on without Dask, in one line that says what to install.

    Raises
    ------
    UsageError
    """
    try:
        for package in ("dask", "distributed", "cryptography"):
            import_module(package)
    except ImportError:
        raise UsageError(
            "several processes and clusters need a package that is not installed", found=f"{package} = not installed",
            hint='pip install "tomomesh[scale]"',
        ) from None  # fmt: skip


def _client(scheduler: str) -> Any:
    from distributed import Client

    path = Path(scheduler)
    place = {"scheduler_file": scheduler} if path.is_file() else {"address": scheduler}
    try:
        if path.is_file():
            json.loads(path.read_bytes())["address"]
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of versions that differ
            return Client(**place, timeout=ANSWER_S, set_as_default=False)
    except (OSError, ValueError, LookupError, TypeError) as fault:
        raise UnreadableError(
            "no scheduler answers there", file=scheduler, found=type(fault).__name__,
            expected="a running scheduler's address, as tcp://host:8786, or the file that it wrote",
        ) from None  # fmt: skip


def _end(here: Any) -> None:
    """Kill our own workers: what they write is whole or not there, and to wait for them would take a study's time."""
    with _unbroken():
        for nanny in here.workers.values():
            nanny.close_gracefully()
            if nanny.pid:
                with suppress(ProcessLookupError):
                    os.kill(nanny.pid, getattr(signal, "SIGKILL", signal.SIGTERM))
        here.close()


@contextmanager
def _configured(threads: int, folder: Path) -> Iterator[None]:
    """Set Dask up for workers of ours; what it puts into the environment for them is taken out again."""
    import dask

    alone = {name: str(threads) for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")}
    settings = {
        "temporary-directory": str(folder),
        "distributed.scheduler.allowed-failures": AGAIN,
        "distributed.scheduler.work-stealing": False,  # slabs stay where their neighbors' strips go to
        "distributed.scheduler.worker-saturation": 1.0,  # no task waits on a worker, and dies with it
        **UNWATCHED,
        "distributed.scheduler.http.routes": [],
        "distributed.worker.http.routes": [],
        "distributed.nanny.pre-spawn-environ": alone | {"PYTHONWARNINGS": "ignore"},
    }
    before = dict(os.environ)
    try:
        with dask.config.set(settings):
            yield
    finally:
        for name in os.environ.keys() - before:
            del os.environ[name]
        os.environ.update(before)


@contextmanager
def _unheard() -> Iterator[None]:
    """Keep what Dask logs from stderr: what matters of it is told in our own words."""
    logging.getLogger("asyncio").addHandler(QUIET)  # for good: of what an interrupt leaves it tells when that is freed
    handlers = [handler for name in LOGGERS for handler in logging.getLogger(name).handlers]
    before = [handler.level for handler in handlers]
    for handler in handlers:
        handler.setLevel(logging.CRITICAL + 1)
    try:
        yield
    finally:
        for handler, level in zip(handlers, before, strict=True):
            handler.setLevel(level)


@contextmanager
def _deaf_children() -> Iterator[None]:
    """Let threads that are made here, and all processes that they start, not hear Ctrl-C: this process ends them."""
    if sys.platform == "win32":
        yield
        return
    resource_tracker.ensure_running()  # the thread that starts it hears signals again
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def _unbroken() -> Iterator[None]:
    """Answer Ctrl-C and SIGTERM at the end of the block: half-started workers cannot be ended, Dask waits for them."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    came: list[int] = []
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    for number in before:
        signal.signal(number, lambda number, frame: came.append(number))
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, signal.SIG_DFL if handler is None else handler)
    if came:
        signal.raise_signal(came[0])
