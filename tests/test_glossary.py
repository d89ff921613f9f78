"""One word a thing: the words that the glossary drops stand in no name of the code, and it explains each word once."""

from __future__ import annotations

import ast
import re
from collections import Counter
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from collections.abc import Iterator

ROOT = Path(__file__).parents[1]
SOURCE = ROOT / "src" / "tomomesh"
ROWS = [
    [cell.strip() for cell in line.strip("|").split("|")]
    for line in (ROOT / "docs" / "glossary.md").read_text(encoding="utf-8").splitlines()
    if line.startswith("| ")
][1:]
DROPPED = sorted({word for row in ROWS for word in row[2].split(", ") if word})
WALLS = {
    "model/contours.py", "segmentation/contours/walls.py", "segmentation/space.py",  # of tissue
    "followed.py", "segmentation/outlines.py", "ways/choice.py",
    "measure/thickness.py", "settings/printing.py",  # of a solid
    "judgement.py", "ways/clouds/shell.py", "ways/cubes.py", "ways/sections.py",  # the report's *two walls*
    *(f"isosurface/walls/{name}.py" for name in ("__init__", "block", "net", "thick", "walls")),  # between two labels
    "kernels/isosurface/walls.py", "label_surfaces.py", "segmentation/labels.py", "segmentation/selection.py",
    "settings/cubes.py", "ways/walls.py",
}  # fmt: skip
"""Modules that may name walls. Nothing else has any: not a cell, a ray, a sheet or a contour's triangles."""
SEVERAL = {"Components", "Net", "Part", "Rest", "Segmentation", "Shell", "Shown", "Slices", "Stack"}
"""Classes of one name in several modules, whose packages say which is meant; none may be added."""


def bound(body: list[ast.stmt]) -> Iterator[str]:
    """Yield the constants of a module, or the fields of a class."""
    for line in body:
        targets = [line.target] if isinstance(line, ast.AnnAssign) else getattr(line, "targets", [])
        yield from (node.id for target in targets for node in ast.walk(target) if isinstance(node, ast.Name))


def named(source: str) -> Iterator[str]:
    """Yield the names of functions, classes, fields and constants."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            yield node.name
        if isinstance(node, ast.Module | ast.ClassDef):
            yield from bound(node.body)


def words_of(name: str) -> list[str]:
    """Return the words of a name, spelled as a function, a class or a constant."""
    return [word.lower() for word in re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+", name)]


@cache
def words() -> dict[str, set[tuple[str, str]]]:
    """Return the words of all names, each with the modules and names where it stands."""
    found: dict[str, set[tuple[str, str]]] = {}
    for path in SOURCE.rglob("*.py"):
        where = path.relative_to(SOURCE)
        for name in [*where.parts[:-1], path.stem, *named(path.read_text(encoding="utf-8"))]:
            for word in words_of(name):
                found.setdefault(word, set()).add((where.as_posix(), name))
    return found


def test_all_names_are_looked_at_and_taken_apart() -> None:
    source = "HOLD, LEAST = 1, 2\nclass Held:\n    wall: int = 0\n    def looks_on(self): pass\ndef drape(): local = 0"
    assert sorted(named(source)) == ["HOLD", "Held", "LEAST", "drape", "looks_on", "wall"]
    assert [words_of(name) for name in ("leak_test", "_LeakTest", "LEAK_TEST")] == [["leak", "test"]] * 3
    assert words_of("DICOM_Files2") == ["dicom", "files"]


@pytest.mark.parametrize("word", DROPPED)
def test_no_name_has_a_word_that_was_dropped(word: str) -> None:
    assert words().get(word, set()) == set()


def test_a_wall_is_of_tissue_or_of_a_solid() -> None:
    found = {where for word in ("wall", "walls", "walled") for where, _ in words().get(word, set())}
    assert sorted(found - WALLS) == []


def test_a_class_name_means_one_thing() -> None:
    classes = Counter(
        node.name
        for path in SOURCE.rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.ClassDef)
    )
    assert {name for name, times in classes.items() if times > 1} <= SEVERAL


def test_words_are_explained_once_and_not_dropped() -> None:
    explained = [row[0] for row in ROWS]
    assert len(set(explained)) == len(explained)
    assert not set(explained) & set(DROPPED)
    assert len(DROPPED) >= 10
