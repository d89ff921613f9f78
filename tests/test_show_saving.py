"""Pictures as files: the same bytes, nothing of the machine, no display."""

from __future__ import annotations

import io
import subprocess
import sys
from typing import TYPE_CHECKING

import matplotlib
import numpy as np
import pytest
from PIL import Image

from test_show import pixels, round_mesh
from tomomesh.errors import OutputError
from tomomesh.show import save
from tomomesh.show.space import draw_shaded

if TYPE_CHECKING:
    from pathlib import Path

    from tomomesh.model.mesh import TriMesh


@pytest.fixture(scope="module")
def ball() -> TriMesh:
    return round_mesh()


class TestSaving:
    def test_repeats_its_bytes(self, ball: TriMesh) -> None:
        files = [io.BytesIO() for _ in range(3)]
        figure = draw_shaded(ball)
        save(figure, files[0])
        save(figure, files[1])
        save(draw_shaded(ball), files[2])
        assert files[0].getvalue() == files[1].getvalue() == files[2].getvalue()

    def test_writes_a_png_without_date_or_software(self, ball: TriMesh, tmp_path: Path) -> None:
        file = tmp_path / "ball.png"
        figure = draw_shaded(ball)
        save(figure, file)
        with Image.open(file) as picture:
            assert picture.format == "PNG"
            assert set(picture.info) <= {"dpi"}
            np.testing.assert_array_equal(np.asarray(picture.convert("RGBA")), pixels(figure))

    def test_says_where_it_cannot_write(self, ball: TriMesh, tmp_path: Path) -> None:
        with pytest.raises(OutputError, match="cannot be written"):
            save(draw_shaded(ball), tmp_path / "nowhere" / "ball.png")

    def test_leaves_the_callers_style_alone(self, ball: TriMesh) -> None:
        before = dict(matplotlib.rcParams)
        first, second = io.BytesIO(), io.BytesIO()
        save(draw_shaded(ball), first)
        assert dict(matplotlib.rcParams) == before
        with matplotlib.rc_context({"font.size": 30, "axes.titlesize": 40}):
            save(draw_shaded(ball), second)
        assert first.getvalue() == second.getvalue()

    def test_needs_no_display(self) -> None:
        code = "import sys, tomomesh.show; print('matplotlib.pyplot' in sys.modules, 'tkinter' in sys.modules)"
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
        assert done.stdout.split() == ["False", "False"]
