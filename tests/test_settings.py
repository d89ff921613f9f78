"""Settings: each limit holds and names its option, and nothing is lost on the way through a file."""

from __future__ import annotations

import math
import tomllib
from typing import TYPE_CHECKING, Any

import pytest
import tomli_w

from tomomesh.errors import UsageError
from tomomesh.settings import Settings, WindowSettings, limits_of, option_of, parameters

if TYPE_CHECKING:
    from dataclasses import Field

PARAMETERS = {entry.name: entry for _, entry in parameters()}
NUMBERS = {
    name: entry
    for name, entry in PARAMETERS.items()
    if entry.metadata["kind"] in (int, float) and not entry.metadata["choices"]
}
CHOICES = {name: entry for name, entry in PARAMETERS.items() if entry.metadata["choices"]}
SWITCHES = [name for name, entry in PARAMETERS.items() if entry.metadata["kind"] is bool]


def as_many(entry: Field[Any], value: Any) -> Any:
    """Repeat a value as often as the parameter takes it."""
    return (value,) * entry.metadata["length"][-1] if entry.metadata["length"] else value


def outside(entry: Field[Any]) -> list[Any]:
    """Return values just outside the limits of a number."""
    meta = entry.metadata
    step = 1 if meta["kind"] is int else 1e-9
    found = [meta["low"] - step] if math.isfinite(meta["low"]) else []
    found += [meta["high"] + step] if math.isfinite(meta["high"]) else []
    return found + ([meta["above"]] if math.isfinite(meta["above"]) else [])


def at_limits(entry: Field[Any]) -> list[Any]:
    """Return the values at the limits of a number, themselves allowed."""
    meta = entry.metadata
    limits = [limit for limit in (meta["low"], meta["high"]) if math.isfinite(limit)]
    return [meta["kind"](limit) for limit in limits if limit > meta["above"]]


def assert_refused(name: str, value: Any) -> None:
    with pytest.raises(UsageError, match=option_of(name)) as refused:
        Settings().replace(**{name: value})
    assert refused.value.exit_code == 2


class TestLimits:
    @pytest.mark.parametrize("name", NUMBERS)
    def test_refuse_what_lies_outside(self, name: str) -> None:
        for value in outside(NUMBERS[name]):
            assert_refused(name, as_many(NUMBERS[name], value))

    @pytest.mark.parametrize("name", NUMBERS)
    def test_are_allowed_themselves(self, name: str) -> None:
        for value in at_limits(NUMBERS[name]):
            Settings().replace(**{name: as_many(NUMBERS[name], value)})

    @pytest.mark.parametrize("name", NUMBERS)
    @pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, "3", True])
    def test_refuse_what_is_no_finite_number(self, name: str, value: Any) -> None:
        assert_refused(name, as_many(NUMBERS[name], value))

    @pytest.mark.parametrize("name", [n for n, e in NUMBERS.items() if e.metadata["kind"] is int])
    def test_refuse_fractions_of_whole_numbers(self, name: str) -> None:
        assert_refused(name, 3.5)

    @pytest.mark.parametrize("name", NUMBERS)
    def test_refuse_too_many_values(self, name: str) -> None:
        inside = PARAMETERS[name].default
        one = inside[0] if isinstance(inside, tuple) else 1 if inside is None else inside
        assert_refused(name, (one,) * (1 + max(3, *PARAMETERS[name].metadata["length"], 0)))

    @pytest.mark.parametrize("name", CHOICES)
    @pytest.mark.parametrize("value", ["nonsense", "", 1, ["auto"]])
    def test_refuse_values_that_are_no_choice(self, name: str, value: Any) -> None:
        assert_refused(name, value)

    @pytest.mark.parametrize("name", CHOICES)
    def test_allow_every_choice(self, name: str) -> None:
        for choice in CHOICES[name].metadata["choices"]:
            Settings().replace(**{name: choice})

    @pytest.mark.parametrize("name", SWITCHES)
    @pytest.mark.parametrize("value", [1, "yes", 0.0])
    def test_refuse_what_is_no_switch(self, name: str, value: Any) -> None:
        assert_refused(name, value)

    @pytest.mark.parametrize("name", [n for n, e in PARAMETERS.items() if e.default is not None])
    def test_refuse_none_where_a_value_is_needed(self, name: str) -> None:
        assert_refused(name, None)

    @pytest.mark.parametrize(("lower", "upper"), [(5.0, 5.0), (6.0, 5.0)])
    def test_refuse_an_empty_window(self, lower: float, upper: float) -> None:
        with pytest.raises(UsageError, match="the window is empty"):
            WindowSettings(lower=lower, upper=upper)

    def test_are_put_into_words(self) -> None:
        assert limits_of(PARAMETERS["neurons"]) == "a whole number at least 3, at most 4096"
        assert limits_of(PARAMETERS["step"]) == "a number over 0, at most 1"
        assert limits_of(PARAMETERS["lower"]) == "a number"


class TestTable:
    def test_has_every_name_once(self) -> None:
        assert len(list(parameters())) == len(PARAMETERS)

    @pytest.mark.parametrize("name", PARAMETERS)
    def test_has_help_and_a_default_within_its_own_limits(self, name: str) -> None:
        entry = PARAMETERS[name]
        assert entry.metadata["help"]
        if entry.default is not None:
            Settings().replace(**{name: entry.default})


class TestForPaper:
    def test_is_what_the_paper_has(self) -> None:
        paper = Settings.for_paper()
        network = paper.network
        assert (network.training, network.start, network.neighborhood) == ("online", "random", "bubble")
        assert (network.slices, network.signal, network.even, network.trim) == (
            "stored",
            "region",
            False,
            0.0,
        )
        assert (network.neuron_count, network.iterations) == (58, 10_000)
        assert (paper.fit.springs, paper.fit.limit, network.bridge) == ("triangles", "shorten", 0.0)
        assert (paper.cubes.cell_from, paper.cubes.tracking, paper.fit.stiffness) == ("nearest", "faces", 0.5)

    def test_differs_from_the_defaults_only_where_the_table_says(self) -> None:
        paper, default = Settings.for_paper().to_dict(), Settings().to_dict()
        changed = {key for group in default for key in default[group] if paper[group][key] != default[group][key]}
        named = {name for name, entry in PARAMETERS.items() if isinstance(entry.metadata["paper"], (str, bool, float))}
        assert changed == named


class TestFiles:
    @pytest.mark.parametrize("settings", [Settings(), Settings.for_paper()])
    def test_settings_return_from_their_sections(self, settings: Settings) -> None:
        assert Settings.from_dict(settings.to_dict()) == settings

    def test_settings_return_from_toml(self) -> None:
        settings = Settings().replace(cell_mm=(1.0, 2.0, 3.0), lower=-5.5, series=2, radius=(9.0, 0.7), seed=7)
        assert Settings.from_dict(tomllib.loads(tomli_w.dumps(settings.to_dict()))) == settings

    def test_a_section_changes_only_what_it_names(self) -> None:
        changed = Settings.from_dict({"fit": {"stiffness": 2.0}}, base=Settings.for_paper())
        assert changed == Settings.for_paper().replace(stiffness=2.0)

    @pytest.mark.parametrize(
        ("sections", "named"),
        [
            ({"nonsense": {}}, "nonsense"),
            ({"fit": {"nonsense": 1}}, "fit.nonsense"),
            ({"network": {"stiffness": 1.0}}, "network.stiffness"),
            ({"fit": 3}, "fit"),
        ],
    )
    def test_unknown_entries_are_named(self, sections: dict[str, Any], named: str) -> None:
        with pytest.raises(UsageError, match=named) as refused:
            Settings.from_dict(sections, file="my.toml")
        assert refused.value.exit_code == 2
        assert "my.toml" in str(refused.value)

    def test_unknown_names_are_named(self) -> None:
        with pytest.raises(UsageError, match="nonsense"):
            Settings().replace(nonsense=1)
