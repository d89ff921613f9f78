"""What is chosen in the page can be taken back, and the command line repeats it."""

from __future__ import annotations

import shlex
from typing import TYPE_CHECKING, Any

import pytest

pytest.importorskip("starlette")

from hypothesis import given
from hypothesis import strategies as st

from conftest import law
from tomomesh.cli.commands import settings_of
from tomomesh.cli.options import build_parser
from tomomesh.cli.options.parameters import joined
from tomomesh.settings import Settings
from tomomesh.view.opened import Opened
from tomomesh.view.session import Choices, Session

if TYPE_CHECKING:
    from argparse import Namespace

WINDOWS = st.one_of(
    st.fixed_dictionaries({}, optional={"lower": st.floats(-2000, 3000), "upper": st.floats(3001, 4000)}),
    st.fixed_dictionaries({"preset": st.just("bone")}),
    st.fixed_dictionaries({"select": st.lists(st.integers(1, 300), min_size=1, max_size=4, unique=True).map(tuple)}),
)
VALUES: dict[str, st.SearchStrategy[Any]] = {
    "neurons": st.integers(3, 500),
    "remesh": st.just(False),
    "fill_holes": st.just(True),
    "roi": st.tuples(*(st.floats(low, low + 50) for low in (-100, 0, -100, 0, -100, 0))),
    "slice_range": st.tuples(st.integers(0, 5), st.integers(6, 90)),
    "way": st.sampled_from(["ring", "contours", "paper"]),
    "alpha": st.tuples(st.floats(0.5, 1), st.floats(0.01, 0.4)),
    "cell_mm": st.tuples(st.floats(0.5, 5)) | st.tuples(*[st.floats(0.5, 5)] * 3),
    "smooth": st.floats(0.1, 4),
    "drop_at": st.lists(st.tuples(*[st.floats(-500, 500)] * 3), min_size=1, max_size=3).map(tuple),
}
OTHERS = st.fixed_dictionaries({}, optional=VALUES)
CHOICES = st.tuples(WINDOWS, OTHERS).map(lambda both: both[0] | both[1])


def parsed(command: str) -> Namespace:
    chosen: Namespace = build_parser().parse_args(joined(shlex.split(command)[1:]))
    return chosen


@law(100)
@given(CHOICES)
def test_the_command_line_repeats_the_choices(choices: dict[str, Any]) -> None:
    session = Session(Opened("study", ("a study/of mine.nii",)), choices)
    chosen = parsed(session.command)
    assert chosen.command == "reconstruct"
    assert chosen.study == ["a study/of mine.nii"]
    assert settings_of(chosen) == session.settings


@law(50)
@given(st.lists(OTHERS, max_size=6), st.data())
def test_undo_takes_every_choice_back(steps: list[dict[str, Any]], data: st.DataObject) -> None:
    choices, seen = Choices(), [Choices()]
    for step in steps:
        changed = choices.then(step)
        seen += [changed] if changed.values != choices.values else []
        choices = changed
    back = data.draw(st.integers(0, len(seen) - 1))
    for _ in range(back):
        choices = choices.back()
    assert choices.values == seen[len(seen) - 1 - back].values
    for _ in range(back):
        choices = choices.forth()
    assert choices.values == seen[-1].values


def test_at_the_ends_there_is_nothing_to_take_back() -> None:
    assert Choices().back() == Choices().forth() == Choices()


def test_a_choice_of_none_is_the_default_again() -> None:
    session = Session(Opened(), {"neurons": 40})
    assert session.choose({"neurons": None})["choices"] == {}
    assert session.settings == Settings()
    assert session.undo()["choices"] == {"neurons": 40}


def test_the_state_says_whether_what_was_made_is_of_these_choices() -> None:
    session = Session(Opened(), {"neurons": 40})
    session.keep("reconstruct", object(), session.choices.values)
    assert session.state["made"] == {"reconstruct": True}
    assert session.choose({"neurons": 41})["made"] == {"reconstruct": False}
    assert session.undo()["made"] == {"reconstruct": True}


def test_a_mesh_is_checked_which_writes_no_mesh() -> None:
    assert Session(Opened("mesh", ("a mesh.stl",))).command == "tomomesh check 'a mesh.stl'"
