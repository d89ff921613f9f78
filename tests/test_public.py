"""The public names, and the example of the README."""

from __future__ import annotations

import doctest
import pkgutil
import re
from pathlib import Path

import numpy as np
import pytest

import tomomesh
from tomomesh.errors import UsageError
from tomomesh.segmentation.networks.training import train_study
from tomomesh.segmentation.signal import pixels_of
from tomomesh.settings import NetworkSettings
from tomomesh.som.region import train_region

PAGES = sorted(Path(__file__).parents[1].glob("docs/*.md"))


def test_public_names_are_found_and_no_others() -> None:
    assert set(dir(tomomesh)) == set(tomomesh.__all__)
    for name in tomomesh.__all__:
        assert getattr(tomomesh, name) is not None
    with pytest.raises(AttributeError, match="nothing"):
        tomomesh.nothing  # noqa: B018


def test_every_module_can_be_imported_under_another_name() -> None:
    # `import a.b as c` looks `b` up on `a`: a public function of that name would hide the module
    homes = {name for _, name, _ in pkgutil.iter_modules(tomomesh.__path__)}
    assert homes.isdisjoint(tomomesh.__all__)


def test_the_readmes_example_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    readme = (Path(__file__).parents[1] / "README.md").read_text(encoding="utf-8")
    example = re.search(r"```python\n(.*?)```", readme, re.DOTALL)
    assert example is not None
    monkeypatch.chdir(tmp_path)
    exec(example[1], {})
    assert (tmp_path / "skull.ply").exists()


@pytest.mark.parametrize("name", sorted({*tomomesh.__all__} - {"__version__"}))
def test_a_public_name_has_an_example_that_runs(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (example,) = doctest.DocTestFinder(recurse=False).find(getattr(tomomesh, name), name, globs={})
    assert any(line.want for line in example.examples)
    assert doctest.DocTestRunner().run(example).failed == 0


@pytest.mark.parametrize("page", [path for path in PAGES if ">>> " in path.read_text("utf-8")], ids=lambda p: p.name)
def test_the_examples_of_a_page_run(page: Path) -> None:
    found = doctest.DocTestParser().get_doctest(page.read_text("utf-8"), {}, page.name, str(page), 0)
    assert doctest.DocTestRunner().run(found).failed == 0


def test_what_is_no_study_is_refused() -> None:
    with pytest.raises(UsageError, match="from_stored"):
        tomomesh.reconstruct(np.zeros((5, 9, 9)))  # type: ignore[arg-type]


def test_a_picture_is_trained_as_its_slice_is() -> None:
    row, column = np.mgrid[:80, :80] - 39.5
    band = np.abs(np.hypot(row / 30, column / 25) - 1) < 0.1
    settings = NetworkSettings(neurons=40, signal="region", even=False, neighborhood="bubble")  # not unshrunk
    slices = train_study(band[None], settings)
    picture = train_region(pixels_of(band), settings)
    np.testing.assert_allclose(picture.codebook, slices.codebooks[0], atol=1e-9)


def test_numpy_numbers_are_numbers() -> None:
    settings = tomomesh.Settings().replace(
        low_pass=np.int64(2), stiffness=np.float32(0.5), cell_mm=np.array([2.0, 3.0, 5.0])
    )
    assert settings.cubes.low_pass == 2
    assert settings.cubes.cell_mm == (2.0, 3.0, 5.0)
