"""Slabs among the workers of a Dask client: a result stays with a worker, and its arrays on that worker's disk."""

from __future__ import annotations

import os
import tempfile
import warnings
from collections import Counter
from dataclasses import dataclass
from functools import cached_property, partial
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import ResourceError, TomomeshError, UnreadableError
from ..kernels.threads import share_cores
from .keep import File, bytes_of, mapped, put_away

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from .keep import Kept

DIED = "KilledWorker"
"""Dask's name for what becomes of a task that has lost as many workers as it may."""
OWN = (TomomeshError, MemoryError, OSError)
"""What work raises on a worker that is raised here as it would be without one."""
LOCAL = "distributed.deploy.local"
"""Dask's module of what starts workers on its own machine."""


@dataclass(frozen=True)
class OnClient:
    """Gives each slab's work to a worker; what a worker kept that died is made again, from the beginning if need be.

    Attributes
    ----------
    client : distributed.Client
        Or whatever submits and gathers as it does.
    """

    client: Any

    def each(self, work: Callable[..., Any], *columns: Sequence[Any]) -> list[Kept]:
        """Give out some work once a slab, see `tomomesh.slabs.keep.Slabs`, and do not wait for it.

        Raises
        ------
        UnreadableError
            Where the scheduler is gone.
        """
        rows = [list(entries) for entries in zip(*columns, strict=True)]
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # of masks that are sent along, each to one worker
                return [self.client.submit(self._done, work, row, pure=False) for row in rows]
        except Exception:
            raise _gone() from None

    def fetch(self, kept: Sequence[Kept]) -> list[Any]:
        """Wait for values and bring them here.

        Raises
        ------
        TomomeshError, MemoryError, OSError
            What the work has raised.
        ResourceError
            Where every worker that took it died, or could not take it.
        UnreadableError
            Where the scheduler is gone.
        """
        try:
            found = self._gathered(list(kept))
        except Exception as fault:
            failed = any(one.status == "error" for one in kept)
            raise (_of_work(fault) if failed else _gone()) from None
        return list(_values(found))

    @cached_property
    def _done(self) -> Callable[..., _AtWorker]:
        """What a worker is told: how many it works beside, who may open its files, and of which version it must be."""
        return partial(_done, beside=self._beside, near=self._near, made_by=version("tomomesh"))

    def _gathered(self, kept: list[Kept]) -> Any:
        try:
            return self.client.gather(kept)
        except FileNotFoundError:  # a worker has died since it told where its arrays are: others make them again
            return self.client.gather(kept)

    @cached_property
    def _beside(self) -> int:
        """How many tasks a machine works on at once, at most."""
        at_once = Counter[str]()
        for one in self.client.scheduler_info(n_workers=-1)["workers"].values():
            at_once[one["host"]] += one["nthreads"]
        return max(at_once.values(), default=1)

    @cached_property
    def _near(self) -> bool:
        """Whether the workers are this process's own, and can open each other's files: then no array is sent."""
        if type(getattr(self.client, "cluster", None)).__module__ != LOCAL:
            return False
        worker = self.client.submit(os.getpid, pure=False).result()
        return os.access(f"/proc/{worker}/cwd", os.R_OK)  # Linux asks for the same right as for files


@dataclass(frozen=True)
class _AtWorker:
    """What a worker keeps of a slab."""

    value: Any

    def __sizeof__(self) -> int:
        """Tell Dask how much there would be to send."""
        return bytes_of(self.value)


def _values(kept: Any) -> Any:
    """Return what is kept, in lists and tuples too."""
    if isinstance(kept, list | tuple):
        return type(kept)(map(_values, kept))
    return mapped(kept.value, own=True) if isinstance(kept, _AtWorker) else kept


def _done(work: Callable[..., Any], row: list[Any], *, beside: int, near: bool, made_by: str) -> _AtWorker:
    """Do a slab's work on a worker of the same version, with the cores that others on its machine leave to it."""
    if version("tomomesh") != made_by:
        raise ResourceError("a worker is of another version", found=version("tomomesh"), expected=f"tomomesh {made_by}")
    share_cores(max((os.cpu_count() or 1) // beside, 1))
    return _AtWorker(put_away(work(*_values(row)), File(Path(tempfile.gettempdir()), lent=near)))


def _of_work(fault: Exception) -> Exception:
    """Say in one line what became of a task."""
    if isinstance(fault, OWN):
        return fault
    name = type(fault).__name__
    if name == DIED:
        return ResourceError("every worker that took a slab died", hint="a smaller --slab, or workers with more memory")
    return ResourceError("a worker could not take a slab", found=name, expected="the same tomomesh on every worker")


def _gone() -> UnreadableError:
    return UnreadableError("the scheduler is gone", hint="the same command again, once there is one")
