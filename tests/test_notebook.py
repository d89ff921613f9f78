"""The notebook of the documentation runs, and measures what it says."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

import nbformat
import pytest
from nbclient import NotebookClient

from conftest import COMPILED

if TYPE_CHECKING:
    from nbformat import NotebookNode

NOTEBOOK = Path(__file__).parents[1] / "docs" / "networks.ipynb"


@pytest.fixture(scope="module")
def written() -> NotebookNode:
    notebook: NotebookNode = nbformat.read(NOTEBOOK, as_version=4)  # type: ignore[no-untyped-call]
    return notebook


@pytest.fixture(scope="module")
def executed(tmp_path_factory: pytest.TempPathFactory) -> NotebookNode:
    if not COMPILED:
        pytest.skip("a head takes too long in plain Python")
    folder = tmp_path_factory.mktemp("notebook")
    notebook = nbformat.read(NOTEBOOK, as_version=4)  # type: ignore[no-untyped-call]
    client = NotebookClient(notebook, timeout=120, kernel_name="python3", resources={"metadata": {"path": str(folder)}})
    found = client.execute()
    assert list(folder.iterdir()) == []
    return found


def told(notebook: NotebookNode) -> list[tuple[str, list[str]]]:
    """Return what each cell printed, in however many pieces, and which kinds of picture it drew."""
    code = [cell.outputs for cell in notebook.cells if cell.cell_type == "code"]
    words = ["".join(output.text for output in outputs if output.output_type == "stream") for outputs in code]
    drawn = [[kind for output in outputs for kind in sorted(output.get("data", {}))] for outputs in code]
    return list(zip(words, drawn, strict=True))


def test_is_kept_with_its_pictures(written: NotebookNode, executed: NotebookNode) -> None:
    """Who reads it where nothing runs sees what it draws; and what it says is what it says when it is run."""
    nbformat.validate(written)
    assert told(written) == told(executed)
    assert sum(kinds.count("image/png") for _, kinds in told(written)) == 6


def test_measures_what_it_says(executed: NotebookNode) -> None:
    found: dict[str, Any] = json.loads(executed.cells[-1].outputs[0].text)
    assert found["moved"] == {"chain": 4, "ring": 5}
    assert found["triangle"]["dead_neurons"] == 0
    assert found["triangle"]["quantization_error"] < 0.08
    assert found["skull"]["self_crossings"] == 0
    assert found["skull"]["bridged"] == 1
    assert 400 < found["skull"]["perimeter_mm"] < 500
    assert found["off_bone"]["ring"] <= 2 < found["off_bone"]["grid"]
    assert 11 <= found["slices_with_gaps"] <= 12


def without_pixels(text: str) -> str:
    """Leave out the bytes of a picture, which depend on the version of who packs them."""
    return re.sub(r"(data:image/\w+;base64,)[\w+/=]{1000,}", r"\1", text)


def test_a_result_shows_itself(written: NotebookNode, executed: NotebookNode) -> None:
    """In 3-D where it is run; the copy in the repository is without the frame, and so without three.js."""
    kept, made = (
        next(cell.outputs[0].data for cell in notebook.cells if cell.id == "cell-shown")
        for notebook in (written, executed)
    )
    before, frame, after = re.split(r"(<iframe .*</iframe>\n)", made["text/html"], flags=re.DOTALL)
    assert without_pixels(kept["text/html"]) == without_pixels(before + after)
    assert 'sandbox="allow-scripts"' in frame
    assert kept["text/markdown"] == made["text/markdown"]
    assert kept["text/plain"] == made["text/plain"]


def test_draws_its_figures(executed: NotebookNode) -> None:
    kinds = [
        kind
        for cell in executed.cells
        if cell.cell_type == "code"
        for output in cell.outputs
        for kind in output.get("data", {})
        if kind.startswith("image/")
    ]
    assert kinds.count("image/gif") == 2
    assert kinds.count("image/png") == 6
    assert not [
        output for cell in executed.cells for output in cell.get("outputs", []) if output.get("name") == "stderr"
    ]
