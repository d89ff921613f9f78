"""One word a thing: the words that the glossary drops stand in no name of the code, and it explains each word once."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
ROWS = [
    [cell.strip() for cell in line.strip("|").split("|")]
    for line in (ROOT / "docs" / "glossary.md").read_text(encoding="utf-8").splitlines()
    if line.startswith("| ")
][1:]
DROPPED = sorted({word for row in ROWS for word in re.split(r", ", row[2]) if word} - {"hold", "walls"})
"""Words that the code does without; *to hold* and *walls* are words of the language too, and of bones."""


def names() -> dict[str, set[str]]:
    """Return the words of all modules, functions and classes, each with where it stands."""
    found: dict[str, set[str]] = {}
    for path in (ROOT / "src" / "tomomesh").rglob("*.py"):
        defined = (ast.FunctionDef, ast.ClassDef)
        here = [
            node.name for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))) if isinstance(node, defined)
        ]
        for name in [path.stem, *here]:
            for word in re.findall(r"[a-z]+|[A-Z][a-z]*", name):
                found.setdefault(word.lower(), set()).add(f"{path.name}: {name}")
    return found


@pytest.mark.parametrize("word", DROPPED)
def test_no_name_has_a_word_that_was_dropped(word: str) -> None:
    assert names().get(word, set()) == set()


def test_words_are_explained_once_and_not_dropped() -> None:
    words = [row[0] for row in ROWS]
    assert len(set(words)) == len(words)
    assert not set(words) & set(DROPPED)
    assert len(DROPPED) >= 10
