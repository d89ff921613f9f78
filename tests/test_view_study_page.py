"""The study in a real browser, by mouse and by keyboard, and the command line that repeats what was done."""

from __future__ import annotations

import shlex
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

pytest.importorskip("starlette")
pytest.importorskip("uvicorn")
pytest.importorskip("websockets")

from browsers import SOFTWARE, chromium
from pages import HERE, Page, served
from studies import AFFINES, sampled, setting, write_nifti, write_series
from tomomesh import phantom
from tomomesh.cli import main
from tomomesh.cli.commands import settings_of
from tomomesh.cli.options import build_parser
from tomomesh.cli.options.parameters import joined

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from tomomesh.settings import Settings

HEAD = phantom((27, 64, 64), (3.75, 3.75, 5.4))
LABELS = np.select([HEAD.volume.voxels > 200, HEAD.volume.voxels > 100], [2, 1], 0).astype(np.uint8)
SLICE = "Number(document.querySelector(`.plane-${name} canvas`).dataset.slice)"
DRAWN = ".plane-axial canvas[data-slice]"
LINE, AREA = 0.01, 0.02
"""Shares of a plane that a label's outline stays below, and that its inside fills."""


class Shown:
    """A page in a browser, with whatever it complains of and asks for."""

    def __init__(self, browser: Any, page: Page, **options: Any) -> None:
        self.tab = browser.new_page(viewport={"width": 1280, "height": 720}, **options)
        self.complaints: list[str] = []
        self.requests: list[str] = []
        self.tab.on("console", lambda message: self.complaints.append(message.text))
        self.tab.on("pageerror", lambda error: self.complaints.append(str(error)))
        self.tab.on("request", lambda request: self.requests.append(request.url))
        self.tab.goto(f"{page.address}?token={page.token}")

    def require_quiet(self) -> None:
        assert self.complaints == []
        assert all(f"//{HERE}:" in url or url.startswith(("data:", "blob:")) for url in self.requests)

    @property
    def settings(self) -> Settings:
        """The settings of the command line that is shown."""
        words = shlex.split(self.tab.inner_text("#command"))
        return settings_of(build_parser().parse_args(joined(words[1:])))

    def until(self, what: Callable[[Settings], bool]) -> Settings:
        """Wait until the command line holds."""
        for _ in range(200):
            if what(self.settings):
                return self.settings
            self.tab.wait_for_timeout(50)
        raise AssertionError(self.tab.inner_text("#command"))

    def wait(self, script: str, value: Any = None) -> None:
        """Wait until a script holds; the page's policy lets none be evaluated by the page itself."""
        for _ in range(200):
            if self.tab.evaluate(script, value):
                return
            self.tab.wait_for_timeout(50)
        raise AssertionError(script)

    def slice(self, plane: str) -> int:
        """Return the slice that a plane shows, once it is drawn."""
        canvas = self.tab.locator(f".plane-{plane} canvas")
        self.wait(
            "(name) => { const canvas = document.querySelector(`.plane-${name} canvas`);"
            " return canvas.dataset.slice === canvas.getAttribute('aria-valuenow'); }", plane,
        )  # fmt: skip
        return int(canvas.get_attribute("data-slice"))

    def drag(self, selector: str, start: tuple[float, float], end: tuple[float, float], **options: Any) -> None:
        """Drag from one place of an element to another, in parts of its sides."""
        box = self.tab.locator(selector).bounding_box()
        places = [(box["x"] + x * box["width"], box["y"] + y * box["height"]) for x, y in (start, end)]
        self.tab.mouse.move(*places[0])
        self.tab.mouse.down(**options)
        self.tab.mouse.move(*places[1], steps=5)
        self.tab.mouse.up(**options)

    def share(self, plane: str, holds: str, value: Any = None) -> float:
        """Return the share of a plane's pixels of which a script, of red, green, blue and a value, holds."""
        share: float = self.tab.evaluate(
            """([name, value]) => {
              const canvas = document.querySelector(`.plane-${name} canvas`);
              const copy = new OffscreenCanvas(canvas.width, canvas.height);
              const pen = copy.getContext("2d", { willReadFrequently: true });
              pen.drawImage(canvas, 0, 0);
              const pixels = pen.getImageData(0, 0, canvas.width, canvas.height).data;
              let found = 0;
              for (let n = 0; n < pixels.length; n += 4) found += Boolean(("""
            + holds
            + """)(pixels[n], pixels[n + 1], pixels[n + 2], value));
              return found / (canvas.width * canvas.height);
            }""",
            [plane, value],
        )
        return share

    def colors(self, plane: str) -> float:
        """Return the share of a plane's pixels that are not gray."""
        return self.share(plane, "(r, g, b) => Math.abs(r - b) > 40")

    def shares(self, plane: str) -> list[float]:
        """Return the share of a plane's pixels that have the color of each row of the list."""
        css = "(all) => all.map((one) => getComputedStyle(one).backgroundColor.match(/[0-9]+/g).map(Number))"
        near = (
            "(r, g, b, [red, green, blue]) => Math.max(Math.abs(r - red), Math.abs(g - green), Math.abs(b - blue)) < 4"
        )
        return [self.share(plane, near, color) for color in self.tab.locator(".rows .swatch").evaluate_all(css)]


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with chromium() as launch:
        yield launch(*SOFTWARE)


@contextmanager
def shown(browser: Any, *arguments: str | Path, **options: Any) -> Iterator[Shown]:
    with served(*arguments) as page:
        found = Shown(browser, page, **options)
        yield found
        found.require_quiet()
        found.tab.close()


@pytest.fixture
def head(browser: Any, tmp_path: Path) -> Iterator[Shown]:
    path = write_nifti(tmp_path / "head.nii", np.asarray(HEAD.volume.voxels), HEAD.volume.affine)
    with shown(browser, path, "--lower", str(HEAD.lower)) as page:
        page.tab.wait_for_selector(".rows .row")
        yield page


def test_slices_move_by_wheel_keys_and_crosshair(head: Shown) -> None:
    assert [head.slice(plane) for plane in ("axial", "coronal", "sagittal")] == [13, 32, 32]
    box = head.tab.locator(".plane-axial canvas").bounding_box()
    head.tab.mouse.move(box["x"] + 200, box["y"] + 90)
    head.tab.mouse.wheel(0, -100)
    head.wait("document.querySelector('.plane-axial canvas').dataset.slice === '14'")
    for key, plane, found in (
        ("a", "axial", 14), ("ArrowUp", "axial", 15), ("ArrowLeft", "axial", 14), ("PageDown", "axial", 4),
        ("Home", "axial", 0), ("End", "axial", 26), ("s", "sagittal", 32), ("PageUp", "sagittal", 42),
        ("Shift+ArrowUp", "axial", 26), ("Shift+ArrowDown", "axial", 25), ("Shift+ArrowRight", "coronal", 33),
    ):  # fmt: skip
        head.tab.keyboard.press(key)
        head.wait(f"([name, k]) => {SLICE} === k", [plane, found])
    head.tab.mouse.click(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    for plane in ("coronal", "sagittal"):
        head.wait(f"(name) => [31, 32].includes({SLICE})", plane)
    assert " at " in head.tab.inner_text(".under")


def test_the_window_follows_handles_keys_numbers_and_suggestions(head: Shown) -> None:
    tab, before = head.tab, head.settings.window.lower
    handle = tab.locator(".handle.lower").bounding_box()
    tab.mouse.move(handle["x"] + 7, handle["y"] + 60)
    tab.mouse.down()
    tab.mouse.move(handle["x"] - 90, handle["y"] + 60, steps=5)
    head.wait("(lower) => Number(document.querySelector('.plane-axial canvas').dataset.lower) < lower", before)
    assert head.settings.window.lower == before  # drawn, not chosen yet
    tab.mouse.up()
    dragged = head.until(lambda found: found.window.lower != before).window.lower
    assert isinstance(dragged, float)
    tab.focus(".handle.lower")
    tab.keyboard.press("ArrowRight")
    tab.keyboard.press("ArrowRight")
    assert head.until(lambda found: found.window.lower != dragged).window.lower == dragged + 2
    tab.focus(".handle.upper")
    tab.keyboard.press("PageDown")
    head.until(lambda found: found.window.upper is not None)
    tab.fill("[aria-label='upper bound']", "180")
    tab.keyboard.press("Enter")
    head.until(lambda found: found.window.upper == 180)
    tab.click(".chips button >> nth=1")
    head.until(lambda found: found.window.upper is None)
    tab.click(".chips button >> nth=0")
    assert head.until(lambda found: found.window.lower is None).window.upper is None
    for _ in range(3):
        tab.keyboard.press("Control+z")
    head.until(lambda found: found.window.upper is not None and found.window.upper != 180)


def test_what_is_kept_is_colored_and_a_contrast_changes_no_choice(head: Shown) -> None:
    head.slice("axial")
    kept = head.colors("axial")
    assert kept > 0.03
    before = head.tab.inner_text("#command")
    width = head.tab.input_value("[aria-label='contrast, width']")
    head.drag(".plane-coronal canvas", (0.4, 0.4), (0.6, 0.5), button="right")
    head.wait("(width) => document.querySelector(\"[aria-label='contrast, width']\").value !== width", width)
    head.tab.fill("[aria-label='Opacity of what is kept']", "0")
    head.tab.wait_for_timeout(200)
    assert head.colors("axial") < kept / 4  # the crosshair's lines
    assert head.tab.inner_text("#command") == before


def test_a_box_and_a_range_of_slices_are_the_part_that_is_kept(head: Shown) -> None:
    head.tab.keyboard.press("b")
    head.drag(".plane-axial canvas", (0.4, 0.3), (0.6, 0.7))
    roi = head.until(lambda found: found.crop.roi is not None).crop.roi
    assert roi is not None
    ends = HEAD.volume.to_mm(np.array([[-0.5, -0.5, -0.5], [63.5, 63.5, 26.5]]))
    whole = ends.T.ravel().tolist()
    assert roi[4:] == pytest.approx(whole[4:], abs=1e-3)
    assert whole[0] < roi[0] < roi[1] < whole[1]
    head.tab.fill("[aria-label='last slice']", "20")
    head.tab.keyboard.press("Enter")
    head.until(lambda found: found.crop.slice_range == (0, 20))
    head.tab.click("text=All of the study")
    assert head.until(lambda found: found.crop.roi is None).crop.slice_range is None


def test_a_box_by_the_keyboard_alone(head: Shown) -> None:
    head.tab.keyboard.press("a")
    head.tab.keyboard.press("b")
    head.tab.keyboard.press("Enter")
    head.wait("document.querySelector('.told').textContent.includes('One corner')")
    head.tab.keyboard.press("Escape")
    head.wait("!document.querySelector('.told').textContent.includes('One corner')")
    head.tab.keyboard.press("Enter")
    for _ in range(5):
        head.tab.keyboard.press("Shift+ArrowRight")
        head.tab.keyboard.press("Shift+ArrowDown")
    head.tab.keyboard.press("Enter")
    roi = head.until(lambda found: found.crop.roi is not None).crop.roi
    assert roi is not None
    sides = np.diff(np.reshape(roi, (3, 2)), axis=1).ravel()
    assert sides[:2] == pytest.approx(6 * 3.75)  # both corners included
    assert sides[2] == pytest.approx(27 * 5.4)
    head.tab.click("text=All of the study")
    head.until(lambda found: found.crop.roi is None)
    head.tab.keyboard.press("c")


def test_components_are_kept_and_dropped(browser: Any, tmp_path: Path) -> None:
    stored = np.zeros((12, 40, 40), np.int16)
    stored[2:10, 5:20, 5:20], stored[2:10, 25:35, 25:35] = 1000, 1000
    stored += np.random.default_rng(0).integers(0, 99, stored.shape, np.int16)
    path = write_nifti(tmp_path / "two.nii", stored, AFFINES["axial"])
    with shown(browser, path, "--lower", "500") as page:
        page.tab.wait_for_selector(".rows .row")
        assert page.tab.locator(".rows .row").count() == 2
        page.tab.click(".rows .row >> nth=1 >> text=only this")
        [place] = page.until(lambda found: found.window.keep_at is not None).window.keep_at or ()
        assert f"--keep-at {' '.join(f'{side:g}' for side in place)}" in page.tab.inner_text("#command")
        page.tab.click(".rows .picked >> text=not alone")
        page.until(lambda found: found.window.keep_at is None)
        page.wait("document.querySelectorAll('.rows .row').length === 2")
        page.tab.click(".rows .row .name >> nth=1")
        page.tab.focus(".plane-axial canvas")
        page.tab.wait_for_load_state("networkidle")  # the slice is there
        page.tab.keyboard.press("Enter")
        [left] = page.until(lambda found: found.window.drop_at is not None).window.drop_at or ()
        assert left == place
        page.wait("document.querySelectorAll('.rows .picked').length === 1")
        page.wait("document.querySelector('.told').textContent.includes('1 left out by place')")
        page.tab.wait_for_load_state("networkidle")
        page.tab.focus(".plane-axial canvas")
        page.tab.keyboard.press("Enter")
        page.until(lambda found: found.window.drop_at is None)
        page.tab.keyboard.press("Control+z")
        page.until(lambda found: found.window.drop_at == (place,))
        page.tab.click(".rows .picked >> text=bring back")
        page.until(lambda found: found.window.drop_at is None)


def test_labels_beside_a_study_are_chosen_and_give_the_commands_bytes(browser: Any, tmp_path: Path) -> None:
    gray = write_nifti(tmp_path / "gray.nii", np.asarray(HEAD.volume.voxels), HEAD.volume.affine)
    beside = write_nifti(tmp_path / "labels.nii", LABELS, HEAD.volume.affine)
    with shown(browser, gray, "--labels-in", beside) as page:
        page.tab.wait_for_selector(".rows input[type=checkbox]")
        page.tab.click(".rows input[type=checkbox] >> nth=0")
        page.until(lambda found: bool(found.window.select))
        page.wait("document.querySelector('.told').textContent.includes('voxels')")
        page.tab.click("#tab-surface")
        page.tab.keyboard.press("m")
        page.tab.wait_for_selector(".verdict")
        page.tab.click("#tab-saving")
        with page.tab.expect_download() as saved:
            page.tab.click(".save >> nth=0 >> text=Save")
        words = shlex.split(page.tab.inner_text("#command"))[1:-1]
        assert main([*words, str(tmp_path / "mesh.stl"), "--quiet"]) == 0
        assert Path(saved.value.path()).read_bytes() == (tmp_path / "mesh.stl").read_bytes()


def test_labels_beside_a_study_have_their_colors(browser: Any, tmp_path: Path) -> None:
    """Those that are chosen are filled, the others have an outline."""
    stored = np.zeros(HEAD.volume.shape, np.uint16)
    stored[4:22, 20:44, 14:30], stored[4:22, 20:44, 34:50] = 5, 601
    gray = write_nifti(tmp_path / "gray.nii", np.asarray(HEAD.volume.voxels), HEAD.volume.affine)
    beside = write_nifti(tmp_path / "labels.nii", stored, HEAD.volume.affine)

    with shown(browser, gray, "--labels-in", beside) as page:
        page.tab.wait_for_selector(".rows input[type=checkbox]")
        page.tab.locator("input[aria-label='Opacity of what is kept']").fill("1")
        page.wait("document.querySelector('.told').textContent.includes('voxels')")
        assert all(0 < share < LINE for share in page.shares("axial")[:2])
        page.tab.click(".rows input[type=checkbox] >> nth=1")
        page.until(lambda found: found.window.select == (601,))
        page.wait("document.querySelector('.told').textContent.includes('6.91K voxels')")
        page.tab.wait_for_load_state("networkidle")
        outline, inside = page.shares("axial")[:2]
        assert 0 < outline < LINE < AREA < inside
        box = page.tab.locator(".plane-axial canvas").bounding_box()
        page.tab.mouse.move(box["x"] + 0.58 * box["width"], box["y"] + 0.5 * box["height"])
        page.wait("document.querySelector('.under').textContent.includes('label 601')")


def test_labels_are_chosen_in_the_list_and_in_a_slice(browser: Any, tmp_path: Path) -> None:
    path = write_nifti(tmp_path / "labels.nii", LABELS, HEAD.volume.affine)
    with shown(browser, path) as page:
        page.tab.wait_for_selector(".rows .row")
        page.tab.click(".rows .row >> nth=1")
        page.until(lambda found: found.window.select == (2,))
        page.wait("document.querySelector('.told').textContent.includes('voxels')")
        page.tab.keyboard.press("p")
        box = page.tab.locator(".plane-axial canvas").bounding_box()
        j, i = np.argwhere(LABELS[13] == 1)[200]
        edge = min(box["width"], box["height"]) / 64  # its pixels are square
        place = {"x": box["width"] / 2 + (i - 31.5) * edge, "y": box["height"] / 2 + (j - 31.5) * edge}
        page.tab.locator(".plane-axial canvas").click(position=place)
        page.until(lambda found: found.window.select == (1, 2))
        page.tab.locator(".plane-axial canvas").click(position=place)
        page.until(lambda found: found.window.select == (2,))
        assert not page.tab.locator(".for-gray >> nth=0").is_visible()


def test_a_series_is_opened_from_the_table(browser: Any, tmp_path: Path) -> None:
    for n in (1, 2):
        edit = setting(SeriesInstanceUID=f"1.2.{n}", SeriesNumber=n, SeriesDescription=f"<b>series {n}</b>")
        write_series(tmp_path / "study" / str(n), sampled(AFFINES["axial"]), AFFINES["axial"], edit)
    with shown(browser, tmp_path / "study") as page:
        page.tab.wait_for_selector(".series")
        assert "2 series" in page.tab.inner_text(".refused >> nth=0")
        assert "<b>series 2</b>" in page.tab.inner_text(".series")
        page.tab.click(".series tbody tr >> nth=1 >> text=Open")
        page.tab.wait_for_selector(DRAWN)
        assert page.settings.read.series == 2


def test_a_refused_study_says_its_line_and_what_to_try(browser: Any, tmp_path: Path) -> None:
    write_series(tmp_path / "gap", sampled(AFFINES["axial"]), AFFINES["axial"], slices=[0, 1, 3, 4])
    with shown(browser, tmp_path / "gap") as page:
        page.tab.wait_for_selector(".opening .first")
        assert "slices are missing" in page.tab.inner_text(".refused >> nth=0")
        page.tab.click("text=Read it with --fill-gaps")
        page.tab.wait_for_selector(DRAWN)
        assert page.settings.read.fill_gaps


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_nothing_scrolls_and_all_can_be_read(browser: Any, tmp_path: Path, scheme: str) -> None:
    path = write_nifti(tmp_path / "head.nii", np.asarray(HEAD.volume.voxels), HEAD.volume.affine)
    with shown(browser, path, color_scheme=scheme) as page:
        page.tab.wait_for_selector(".rows .row")
        size = page.tab.evaluate("[document.documentElement.scrollWidth, document.documentElement.scrollHeight]")
        assert size == [1280, 720]
        unnamed = page.tab.evaluate(
            """[...document.querySelectorAll("#study button, #study input, #study select, #study [role=slider]")]
              .filter((one) => !(one.textContent.trim() || one.ariaLabel || one.closest("label"))).length"""
        )
        assert unnamed == 0
