"""Names of results: of safe letters, no two the same."""

from __future__ import annotations

import string

from hypothesis import given
from hypothesis import strategies as st

from conftest import law
from tomomesh.io.studies.naming import LONGEST, distinct_names, safe_name

TEXTS = st.text(st.characters(), max_size=300)


@law(80)
@given(st.lists(st.tuples(st.sampled_from("aAbB./-"), TEXTS | st.sampled_from(["a", "A", "a-2"])), max_size=12))
def test_no_two_are_the_same_in_any_case(names: list[tuple[str, str]]) -> None:
    found = distinct_names([short for short, _ in names], [full for _, full in names])
    assert len({name.casefold() for name in found}) == len(found) == len(names)
    assert found == distinct_names([short for short, _ in names], [full for _, full in names])


@law(300)
@given(TEXTS)
def test_a_name_is_one_on_every_system(text: str) -> None:
    name = safe_name(text)
    assert name
    assert len(name.encode()) <= LONGEST
    assert name[0] not in ".-"
    assert not set(name) & set(string.whitespace + "/\\:*?\"'<>|;&$`(){}[]!#=+@%^~,\0\x1b")
    assert safe_name(name) == name


def test_plain_names_stay_as_they_are() -> None:
    assert distinct_names(["scan_1.5-T", "Schädel"], ["x", "y"]) == ["scan_1.5-T", "Schädel"]
    assert distinct_names(["a", "a", "b"], ["a.nii", "a.mha", "b.nii"]) == ["a.nii", "a.mha", "b"]
