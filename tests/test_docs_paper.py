"""The page on the paper names functions that exist, and settings as `--paper` takes them."""

from __future__ import annotations

import re
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

from tomomesh.settings import UNSET, Settings, parameters

PAGE = (Path(__file__).parents[1] / "docs" / "paper.md").read_text(encoding="utf-8")
TABLES = re.findall(r"^\| step \|.*\n\|[-|]+\n((?:\|.*\n)+)", PAGE, re.MULTILINE)
STEPS = [[cell.strip() for cell in line.split("|")[1:-1]] for table in TABLES for line in table.splitlines()]
SETTINGS = re.findall(r"`(\w+)\.(\w+) = ([^`]+)`", PAGE)
FUNCTIONS = sorted(set(re.findall(r"`([a-z_]\w*(?:\.\w+)+)`", PAGE)))


def found(name: str) -> Any:
    """Import what a dotted name inside the package says: the longest module, then attributes."""
    parts = name.split(".")
    for modules in range(len(parts), 0, -1):
        try:
            owner: Any = import_module(".".join(["tomomesh", *parts[:modules]]))
        except ModuleNotFoundError:
            continue
        for part in parts[modules:]:
            owner = getattr(owner, part)
        return owner
    raise AssertionError(name)


@pytest.mark.parametrize("name", FUNCTIONS)
def test_every_function_is_there(name: str) -> None:
    assert found(name) is not None


@pytest.mark.parametrize("row", STEPS, ids=lambda row: row[0])
def test_every_step_has_a_function_and_says_what_becomes_of_it(row: list[str]) -> None:
    """What is neither followed, nor chosen, nor different has no row; what is different says how."""
    names = re.findall(r"`([^`]+)`", row[2])
    assert len(names) == 1
    assert callable(found(names[0]))
    assert row[1]
    assert any(row[3:])


@pytest.mark.parametrize(("group", "name", "value"), SETTINGS)
def test_every_setting_is_as_under_paper(group: str, name: str, value: str) -> None:
    taken = getattr(getattr(Settings.for_paper(), group), name)
    assert (f"{taken:g}" if isinstance(taken, float) else str(taken)) == value


def test_every_choice_of_the_paper_is_named() -> None:
    ours = {(group, entry.name) for group, entry in parameters() if entry.metadata["paper"] is not UNSET}
    assert ours <= {(group, name) for group, name, _ in SETTINGS}


@pytest.mark.parametrize(
    "words",
    ["caps", "closing", "composition", "debris", "anti-collapse", "drawn at random", "no return", "median", "low pass"],
)
def test_every_known_difference_is_listed(words: str) -> None:
    assert any(words in " ".join([row[0], row[5]]).lower() for row in STEPS if row[5])


def test_readme_and_theory_lead_here() -> None:
    root = Path(__file__).parents[1]
    assert "(docs/paper.md)" in (root / "README.md").read_text(encoding="utf-8")
    assert "(paper.md)" in (root / "docs" / "theory.md").read_text(encoding="utf-8")
