"""The settings' JSON schema: valid, accepts whatever the settings write, and refuses what they refuse."""

from __future__ import annotations

import json
from functools import cache
from typing import TYPE_CHECKING, Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from conftest import law
from tomomesh.errors import UsageError
from tomomesh.settings import Settings, parameters

if TYPE_CHECKING:
    from dataclasses import Field

jsonschema: Any = pytest.importorskip("jsonschema", reason="the package jsonschema is not installed")

SCHEMA = Settings.json_schema()
JUDGE = jsonschema.Draft202012Validator(SCHEMA)
ENTRIES = list(parameters())
BOUND = {"damping", "trim", "roi"}
"""Parameters that a rule ties to others, or that have a hole in their range: the settings refuse more of these."""

WORDS = [choice for _, entry in ENTRIES for choice in entry.metadata["choices"]]


@st.composite
def numbers(draw: st.DrawFn, entry: Field[Any]) -> float:
    """Draw numbers about the limits of a parameter; whole ones are int, for JSON Schema takes 3.0 for an integer."""
    meta = entry.metadata
    limits = [meta[name] for name in ("low", "above", "high") if abs(meta[name]) < 1e300]
    near = [int(limit) + step for limit in limits for step in (-1, 0, 1)] + [limit + 1e-9 for limit in limits]
    value = draw(st.one_of(st.sampled_from([0, *near]), st.integers(-9, 9999), st.floats(-99, 99, width=32)))
    return int(value) if value == int(value) else value


@cache  # a strategy anew for each example takes longer than the example
def values(entry: Field[Any]) -> st.SearchStrategy[Any]:
    single = st.one_of(
        numbers(entry),
        st.sampled_from([*WORDS, *entry.metadata["choices"] * 9, "", " ", "1"]),
        st.booleans(),
        st.none(),
        st.text(max_size=3),
    )
    return st.one_of(single, numbers(entry), st.lists(single, max_size=8), st.lists(numbers(entry), max_size=8))


def test_it_is_a_schema_and_json() -> None:
    jsonschema.Draft202012Validator.check_schema(SCHEMA)
    assert json.loads(json.dumps(SCHEMA, allow_nan=False)) == SCHEMA


def test_it_says_of_every_parameter_what_the_table_says() -> None:
    for group, entry in ENTRIES:
        told = SCHEMA["properties"][group]["properties"][entry.name]
        assert told["description"] == entry.metadata["help"]
        assert told.get("unit", "") == entry.metadata["unit"]
        plain = list(entry.default) if isinstance(entry.default, tuple) else entry.default
        assert told["default"] == plain
    assert sum(len(group["properties"]) for group in SCHEMA["properties"].values()) == len(ENTRIES)


@pytest.mark.parametrize("settings", [Settings(), Settings.for_paper()])
def test_it_accepts_the_defaults_and_the_papers_choices(settings: Settings) -> None:
    JUDGE.validate(settings.to_dict())


@law(1500)
@given(st.data())
def test_it_accepts_and_refuses_what_the_settings_do(data: st.DataObject) -> None:
    group, entry = data.draw(st.sampled_from(ENTRIES))
    value = data.draw(values(entry))
    try:
        settings = Settings.from_dict({group: {entry.name: value}})
    except UsageError:
        assert entry.name in BOUND or not JUDGE.is_valid({group: {entry.name: value}})
    else:
        assert JUDGE.is_valid({group: {entry.name: value}})
        JUDGE.validate(settings.to_dict())


@pytest.mark.parametrize("sections", [{"fit": {"stepp": 1}}, {"fits": {}}, {"fit": 3}, []])
def test_it_refuses_what_is_no_entry(sections: Any) -> None:
    assert not JUDGE.is_valid(sections)


@pytest.mark.parametrize(
    ("cells", "valid"), [([1.0], True), ([1, 2], False), ([1, 2, 3], True), ([1, 2, 3, 4], False), (2, True)]
)
def test_lengths_with_a_gap_between_them(cells: Any, valid: bool) -> None:
    assert JUDGE.is_valid({"cubes": {"cell_mm": cells}}) is valid


@pytest.mark.parametrize(("name", "valid"), [("Liver", True), ("1", True), ("", False), (" \t", False), (1, False)])
def test_texts_are_not_blank(name: Any, valid: bool) -> None:
    assert JUDGE.is_valid({"cloud": {"structure": name}}) is valid
