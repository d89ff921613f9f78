"""Pictures as files: the same bytes, nothing of the machine, no display."""

from __future__ import annotations

import io
import subprocess
import sys
from typing import TYPE_CHECKING

import numpy as np
import pytest
from PIL import Image

from test_show import pixels, round_mesh
from tomomesh.errors import OutputError
from tomomesh.show import save
from tomomesh.show.drawing.page import Page
from tomomesh.show.space import draw_shaded

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from tomomesh.model.mesh import TriMesh


@pytest.fixture(scope="module")
def ball() -> TriMesh:
    return round_mesh()


class TestSaving:
    def test_repeats_its_bytes(self, ball: TriMesh) -> None:
        files = [io.BytesIO() for _ in range(3)]
        page = draw_shaded(ball)
        save(page, files[0])
        save(page, files[1])
        save(draw_shaded(ball), files[2])
        assert files[0].getvalue() == files[1].getvalue() == files[2].getvalue()

    def test_writes_a_png_without_date_or_software(self, ball: TriMesh, tmp_path: Path) -> None:
        file = tmp_path / "ball.png"
        page = draw_shaded(ball)
        save(page, file)
        with Image.open(file) as picture:
            assert picture.format == "PNG"
            assert set(picture.info) <= {"dpi"}
            assert picture.mode == "RGB"
            np.testing.assert_array_equal(np.asarray(picture), pixels(page))

    def test_says_where_it_cannot_write(self, ball: TriMesh, tmp_path: Path) -> None:
        with pytest.raises(OutputError, match="cannot be written"):
            save(draw_shaded(ball), tmp_path / "nowhere" / "ball.png")

    def test_a_notebook_shows_the_file(self, ball: TriMesh) -> None:
        file, page = io.BytesIO(), draw_shaded(ball)
        save(page, file)
        assert page._repr_png_() == file.getvalue()

    def test_needs_no_display_and_no_other_library(self) -> None:
        code = "import sys, tomomesh.show; print({'matplotlib', 'tkinter', 'vtk', 'trimesh'} & {*sys.modules})"
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
        assert done.stdout.strip() == "set()"

    @pytest.mark.parametrize("threads", ["1", "3"])
    def test_threads_change_no_byte(self, ball: TriMesh, threads: str, monkeypatch: pytest.MonkeyPatch) -> None:
        here = io.BytesIO()
        save(draw_shaded(ball), here)
        monkeypatch.setattr("os.cpu_count", lambda: int(threads))
        there = io.BytesIO()
        save(draw_shaded(ball), there)
        assert here.getvalue() == there.getvalue()


class TestLetters:
    @pytest.mark.parametrize("text", ["", "mm", "1,234 mm²", "µm³", "a – b × c"])
    def test_cover_their_box(self, text: str) -> None:
        """Ink of capitals and of raised letters lies in the width that is told, and somewhere of it."""
        page = Page(3, 1)
        word = page.write(text, (60.0, 80.0), size=20)
        rows, columns = np.nonzero((pixels(page) < 255).any(axis=2))
        left, _, right, _ = word.box
        assert (len(columns) > 0) == bool(text)
        if text:
            assert columns.min() >= left - 2
            assert columns.max() <= right + 2
            assert columns.max() - columns.min() > 0.6 * (right - left)
            assert rows.max() >= 75

    def test_turned_words_lie_on_their_side(self) -> None:
        level, upright = Page(3, 3), Page(3, 3)
        level.write("height z", (225.0, 225.0), align=0.5)
        upright.write("height z", (225.0, 225.0), align=0.5, upward=True)
        spans = [[np.ptp(each) for each in np.nonzero((pixels(page) < 255).any(axis=2))] for page in (level, upright)]
        assert spans[0] == pytest.approx(spans[1][::-1], abs=2)

    def test_every_letter_that_is_written_is_in_the_font(self) -> None:
        """None of them is the box that stands for a letter that is missing."""
        missing = _ink("\uffff")
        for letter in "".join(map(chr, range(33, 127))) + "²³µ×–":
            assert not np.array_equal(_ink(letter), missing), letter


def _ink(letter: str) -> NDArray[np.uint8]:
    page = Page(0.5, 0.5)
    page.write(letter, (20.0, 50.0), size=20)
    return pixels(page)
