"""Numbers after an option, with spaces or with commas between them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tomomesh.cli import main
from tomomesh.cli.options import build_parser
from tomomesh.cli.options.parameters import joined

ROI = ["-1", "2.5", "-3", "4", "5e1", "66"]


def parsed(*words: str) -> dict[str, Any]:
    found: dict[str, Any] = vars(build_parser().parse_args(joined(["reconstruct", "study.npy", "-o", "m.stl", *words])))
    return found


@pytest.mark.parametrize(
    ("option", "values", "name"),
    [
        ("--spacing", ["1", "1.5", "2"], "spacing"),
        ("--cell", ["1", "1.5", "2"], "cell_mm"),
        ("--cell-mm", ["1", "1.5", "2"], "cell_mm"),
        ("--alpha", [".5", "1e-2"], "alpha"),
        ("--roi", ROI, "roi"),
    ],
)
def test_both_are_taken_by_every_option(option: str, values: list[str], name: str) -> None:
    commas = ",".join(values)
    ways = [[option, *values], [option, commas], [f"{option}={commas}"], [option, ", ".join(values)]]
    ways += [[option, values[0] + ",", *values[1:]]] if option == "--spacing" else []
    for way in ways if option not in ("--cell", "--cell-mm") else ways[:3]:
        found = np.ravel(parsed(*way)[name]).astype(float)
        np.testing.assert_array_equal(found, [float(value) for value in values])


def test_what_follows_is_left_alone() -> None:
    found = parsed("--spacing", "1,1,2", "--select", "1,2,3", "--lower", "-5,6,7", "--cell", "3", "--seed", "7")
    assert found["select"] == (1, 2, 3)
    assert found["lower"] == (-5, 6, 7)
    assert found["seed"] == 7
    first = vars(build_parser().parse_args(joined(["reconstruct", "--spacing", "1,1,2", "1,2", "-o", "m.stl"])))
    assert first["study"] == ["1,2"]


@pytest.mark.parametrize(
    "words", [["--spacing", "1,1"], ["--spacing", "1,1,2,3"], ["--roi", "1,2"], ["--spacing", "1,a,2"]]
)
def test_too_few_are_refused_and_too_many(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["inspect", "study.npy", *words]) == 2
    assert "error" in capsys.readouterr().err
