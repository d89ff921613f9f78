"""Tasks on a cluster: how many at once, what is heard of them, and that nothing of them stays."""

from __future__ import annotations

import math
import time
from typing import TYPE_CHECKING, Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from batches import until
from conftest import law
from tomomesh.kernels.threads import cores
from tomomesh.scale.cluster import Cluster
from tomomesh.scale.tasks import Tasks

if TYPE_CHECKING:
    from tomomesh.scale.tasks import Told

dask = pytest.importorskip("dask", reason="the extra `scale` is not installed")


def _echo(number: int, told: Told) -> tuple[int, int]:
    told("echo", 1, 1)
    return number, cores()


class TestTasks:
    @pytest.mark.parametrize("pooled", [True, False])
    def test_large_ones_are_done_by_themselves_and_too_large_ones_not(self, client: Any, pooled: bool) -> None:
        cluster = Cluster(client, {"127.0.0.1": 2}, share=10, most=100, pooled=pooled)
        heard: list[int] = []
        warned: dict[int, str] = {}
        tasks = Tasks(
            _echo, [50, 5, 200, 7, 60], float, lambda number, *stage: heard.append(number), warned.__setitem__
        )
        found = list(tasks.done_on(cluster))
        order = [number for number, _ in found]
        assert (order[0], sorted(order[1:3]), order[3:]) == (2, [1, 3], [0, 4])
        by_number = dict(found)
        assert by_number[2].exit_code == 7
        assert "Expected: at most 100 bytes" in str(by_number[2])
        assert warned.keys() == {0, 4}
        assert warned[0] == "by itself, as it needs about 50 bytes, and a worker's share is 10 bytes"
        until(lambda: sorted(heard) == [0, 1, 3, 4])
        half, whole = max(dask.system.CPU_COUNT // 2, 1), dask.system.CPU_COUNT
        assert by_number[1] == (5, half)
        assert by_number[3] == (7, half)
        assert by_number[0] == (50, whole)

    @law(100)
    @given(st.integers(1, 100), st.floats(1, 100), st.floats(1, 1e4))
    def test_as_many_as_fit_are_done_at_once(self, slots: int, share: float, size: float) -> None:
        """Of one memory; were there twice as many, they would not fit."""
        count = Cluster(None, {"a": slots}, share, math.inf, pooled=True).fitting(size)
        assert 1 <= count <= slots
        assert count == 1 or count * size <= slots * share * (1 + 1e-12)
        assert count == slots or (2 * count + 1) * size > slots * share

    def test_nothing_is_left_on_the_scheduler(self, client: Any) -> None:
        cluster = Cluster(client, {"127.0.0.1": 2}, share=10, most=100, pooled=True)
        tasks = Tasks(_forever, [0, 1], float, lambda *stage: None, lambda *why: None)
        coming = tasks.done_on(cluster)
        assert next(coming) == (0, "done")
        coming.close()
        until(lambda: not client.run_on_scheduler(lambda dask_scheduler: len(dask_scheduler.tasks)))
        until(lambda: not any(client.processing().values()))
        until(lambda: all(not count for count in client.run(_at_work).values()))


def _forever(item: int, told: Told) -> str:
    """Work until nobody wants it any more, but for one."""
    if item == 0:
        return "done"
    while True:
        told("working", 0, 1)
        time.sleep(0.01)


def _at_work(dask_worker: Any) -> int:
    return len(dask_worker.state.tasks)
