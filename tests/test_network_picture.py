"""One picture as the region of a network: the figure is what is on the paper, bright or dark."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from PIL import Image

from tomomesh.cli import main

if TYPE_CHECKING:
    from pathlib import Path

    from _pytest.capture import CaptureFixture

ROWS, COLUMNS = np.mgrid[:40, :50]
FIGURE = (ROWS - 18) ** 2 + (COLUMNS - 30) ** 2 < 81


def trained(folder: Path, gray: Any, capsys: CaptureFixture[str], *options: str) -> dict[str, Any]:
    Image.fromarray(np.asarray(gray, np.uint8)).save(folder / "p.png")
    line = ["network", str(folder / "p.png"), "-o", str(folder / "n"), "--neurons", "20", "--json", *options]
    assert main(line) == 0
    report: dict[str, Any] = json.loads(capsys.readouterr().out)
    return report


@pytest.mark.parametrize("color", [False, True])
@pytest.mark.parametrize("dark", [False, True])
def test_the_figure_is_what_is_on_the_paper(
    tmp_path: Path, capsys: CaptureFixture[str], dark: bool, color: bool
) -> None:
    gray = np.where(FIGURE ^ dark, 230, 20)
    report = trained(tmp_path, np.stack([gray] * 3, axis=-1) if color else gray, capsys)
    assert report["network"]["inputs"] == FIGURE.sum()
    assert any("border" in warning for warning in report["warnings"]) == dark


def test_a_window_that_is_asked_for_is_taken(tmp_path: Path, capsys: CaptureFixture[str]) -> None:
    report = trained(tmp_path, np.where(FIGURE, 20, 230), capsys, "--lower", "100")
    assert report["network"]["inputs"] == (~FIGURE).sum()
    assert report["warnings"] == []
