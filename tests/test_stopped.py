"""Work ends wherever it says where it is, at once and for good: nothing goes on, and the same again is the same."""

from __future__ import annotations

import threading
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from tomomesh import Settings, phantom, reconstruct, reconstruct_points

if TYPE_CHECKING:
    from collections.abc import Callable

    from tomomesh.results import Surface

    Work = Callable[..., Surface]

HEAD = phantom((12, 32, 32), (7.5, 7.5, 12.0))
BALL = np.random.default_rng(0).normal(size=(600, 3))
BALL *= 20 / np.linalg.norm(BALL, axis=1, keepdims=True)
WAYS: dict[str, dict[str, Any]] = {
    "ring": {"neurons": 40}, "contours": {}, "voxels": {}, "sphere": {"neurons": 60}, "paper": {"neurons": 40},
}  # fmt: skip
WORKS: dict[str, Work] = {
    **{name: partial(reconstruct, HEAD.volume, lower=HEAD.lower, way=name, **asked) for name, asked in WAYS.items()},
    "points": partial(reconstruct_points, BALL),
    "open": partial(reconstruct_points, BALL[BALL[:, 2] > 0], open=True),
    "filled": partial(reconstruct_points, np.random.default_rng(1).normal(size=(4000, 3)), filled=True),
    "paper's points": partial(reconstruct_points, BALL, Settings().by_the_paper()),
}


class Stopped(BaseException):
    """Raised by a progress that wants no more."""


@pytest.mark.parametrize("name", WORKS)
def test_at_every_stage(name: str) -> None:
    work, said = WORKS[name], list[str]()
    whole = work(progress=lambda stage, done, total: said.append(stage))
    for stage in dict.fromkeys(said):
        for nth in {1, (said.count(stage) + 1) // 2, said.count(stage)}:
            stopped_at(work, stage, nth)
    again = work()
    assert again.mesh.vertices.tobytes() == whole.mesh.vertices.tobytes()
    assert again.mesh.faces.tobytes() == whole.mesh.faces.tobytes()


def stopped_at(work: Work, stage: str, nth: int) -> None:
    """Stop where a stage is told of for the n-th time: nothing is told after that, and no thread is left at work."""
    before, told = set(threading.enumerate()), list[str]()

    def progress(name: str, done: int, total: int) -> None:
        told.append(name)
        if told.count(stage) == nth:
            raise Stopped

    with pytest.raises(Stopped):
        work(progress=progress)
    assert told[-1] == stage
    assert told.count(stage) == nth
    assert {one for one in threading.enumerate() if not one.daemon} <= before
