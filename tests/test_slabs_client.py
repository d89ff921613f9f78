"""Slabs among Dask's workers: the same values as in memory, whatever becomes of a worker."""

from __future__ import annotations

import os
import pickle
import signal
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from tomomesh.errors import FormatError, ResourceError, TomomeshError
from tomomesh.slabs import keep
from tomomesh.slabs.keep import LARGE, File, InMemory, OnDisk, mapped, put_away
from tomomesh.slabs.on_client import OnClient

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from tomomesh.slabs.keep import Slabs

pytest.importorskip("dask", reason="the extra `scale` is not installed")

LONG = LARGE // 8 + 1
"""Numbers that are kept in a file."""


@dataclass(frozen=True)
class Row:
    number: int
    large: NDArray[np.float64]
    small: tuple[NDArray[np.int64], str]


def begin(number: int) -> Row:
    return Row(number, np.arange(LONG, dtype=np.float64) + number, (np.arange(number), "a"))


def beside(own: Row, others: Sequence[Row]) -> Row:
    total = own.large + sum(one.large.sum() for one in others)
    return Row(own.number, total, (own.small[0][::-1], own.small[1] + "b"))


def told(row: Row) -> tuple[int, bytes, bytes, str]:
    return row.number, row.large.tobytes(), row.small[0].tobytes(), row.small[1]


def run(slabs: Slabs) -> list[tuple[int, bytes, bytes, str]]:
    kept = slabs.each(begin, range(4))
    for _ in range(3):
        kept = slabs.each(beside, kept, [kept[max(n - 1, 0) : n + 2] for n in range(4)])
    return slabs.fetch(slabs.each(told, kept))


def dies_once(row: Row, place: Path) -> Row:
    """Kill the worker that comes first, and all that it has kept."""
    if not place.exists():
        place.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return row


def dies(_: int) -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def refused(_: int) -> None:
    raise FormatError("a chunk is missing", file="a.zarr", found="missing = 1 of 2", flags=("--fill-chunks",))


class TestSameValues:
    def test_in_memory_on_disk_and_on_workers(self, client: Any, tmp_path: Path) -> None:
        expected = run(InMemory())
        assert run(OnDisk(tmp_path)) == expected
        assert run(OnClient(client)) == expected
        assert not any(tmp_path.iterdir())

    def test_what_is_handed_over_holds_arrays_that_can_be_written(self, client: Any, tmp_path: Path) -> None:
        """Each its own: what is written to one is in no other."""
        for slabs in (OnDisk(tmp_path), OnClient(client)):
            kept = slabs.each(begin, [1])
            (one,), (other,) = slabs.fetch(kept), slabs.fetch(kept)
            one.large[:] = 0
            assert other.large[0] == 1.0

    def test_a_value_on_disk_goes_to_others_whole(self, tmp_path: Path) -> None:
        (kept,) = OnDisk(tmp_path).each(begin, [2])
        sent = mapped(pickle.loads(pickle.dumps(kept)))
        assert told(sent) == told(begin(2))

    def test_our_own_workers_hand_over_where_arrays_are_and_no_bytes_of_them(self, client: Any) -> None:
        """And what is fetched is there still when its worker has let go of it."""
        kept = OnClient(client).each(begin, [3])
        sent = client.gather(kept)[0]
        assert len(pickle.dumps(sent)) < LARGE / 8
        del kept
        assert told(mapped(sent.value)) == told(begin(3))

    def test_workers_of_others_hand_over_the_arrays(self, client: Any, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(client, "cluster", None)
        slabs = OnClient(client)
        assert len(pickle.dumps(client.gather(slabs.each(begin, [3]))[0])) > LARGE
        assert run(slabs) == run(InMemory())


@pytest.mark.skipif(not Path("/proc/self/fd").exists(), reason="this system does not list what a process has open")
class TestLentFiles:
    """A file that a process has lent is opened by another one as long as it is open there."""

    def lent(self, folder: Path) -> Row:
        found: Row = put_away(begin(4), File(folder, lent=True))
        return found

    def test_the_same_values(self, tmp_path: Path) -> None:
        sent = pickle.dumps(kept := self.lent(tmp_path))
        received = pickle.loads(sent)
        del kept
        assert len(sent) < LARGE / 8
        assert told(mapped(received)) == told(mapped(pickle.loads(pickle.dumps(received)))) == told(begin(4))
        assert not any(tmp_path.iterdir())

    def test_one_that_is_closed_is_not_there(self, tmp_path: Path) -> None:
        sent = pickle.dumps(self.lent(tmp_path))
        with pytest.raises(FileNotFoundError):
            pickle.loads(sent)

    def test_no_other_file_is_taken_for_it(self, tmp_path: Path) -> None:
        """Numbers of open files are used again."""
        file, other = File(tmp_path, lent=True), File(tmp_path, lent=True)
        kept = [put_away(begin(4), one) for one in (file, other)]
        sent = pickle.dumps(kept[0])
        os.dup2(other.handle.fileno(), file.handle.fileno())
        with pytest.raises(FileNotFoundError):
            pickle.loads(sent)


def _raised(fault: type[Exception]) -> None:
    raise fault


class TestFaults:
    def test_what_is_gone_when_it_is_opened_is_asked_for_again(
        self, client: Any, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        """As where its worker dies after it has told where it is."""
        slabs, opened, gone = OnClient(client), keep._borrowed, [FileNotFoundError]
        monkeypatch.setattr(keep, "_borrowed", lambda *where: _raised(gone.pop()) if gone else opened(*where))
        assert told(slabs.fetch(slabs.each(begin, [5]))[0]) == told(begin(5))
        assert not gone

    def test_a_worker_that_dies_with_what_it_kept(self, here: Any, client: Any, tmp_path: Path) -> None:
        """Its slabs are made again from the beginning by those that are left."""
        here.scheduler.allowed_failures = 1
        slabs = OnClient(client)
        kept = slabs.each(beside, first := slabs.each(begin, range(4)), [[one] for one in first])
        kept = slabs.each(dies_once, kept, [tmp_path / "died"] * 4)
        found = slabs.fetch(slabs.each(told, kept))
        here.scheduler.allowed_failures = 0
        own = [begin(n) for n in range(4)]
        assert found == [told(beside(row, [row])) for row in own]

    @pytest.mark.parametrize(
        ("work", "kind", "said"),
        [
            (refused, FormatError, "a chunk is missing. File: a.zarr [missing = 1 of 2]."),
            (dies, ResourceError, "every worker that took a slab died. Try: a smaller --slab, or"),
        ],
    )
    def test_each_is_one_line(self, client: Any, work: Any, kind: type[TomomeshError], said: str) -> None:
        slabs = OnClient(client)
        with pytest.raises(kind) as caught:
            slabs.fetch(slabs.each(work, [0]))
        assert str(caught.value).startswith(said)
        assert caught.value.flags == (("--fill-chunks",) if work is refused else ())
