"""A page of a result in a real browser: it draws, searches and flies, asks for nothing, and is read without WebGL."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from browsers import NO_WEBGL, SOFTWARE, Watched, chromium
from test_show import round_mesh
from tomomesh import assess
from tomomesh.html.document import Contents, document
from tomomesh.html.index import index
from tomomesh.html.places import NOTE, PROBLEM, Problem, Spot
from tomomesh.html.scene import Values, scene_of_mesh
from tomomesh.show import draw_all
from tomomesh.show.drawing.page import png

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

COMMAND = "tomomesh check 'a ball.stl' --html a.html"


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    ball = round_mesh()
    drawn = {name: png(page) for name, page in draw_all(mesh=ball)}
    heights = {"height": Values(ball.vertices[:, 2], "height", "mm")}
    far = tuple(ball.vertices[0].tolist())
    told = Contents(
        "a ball.stl", {"quality": assess(ball), "versions": {"numpy": "2"}}, scene_of_mesh(ball, values=heights),
        command=COMMAND, pictures=drawn,
        problems=[Problem(PROBLEM, "a spot", (Spot(far, 0.5), Spot((0.0, 0.0, 0.0)))), Problem(NOTE, "n")],
    )  # fmt: skip
    path = tmp_path_factory.mktemp("pages") / "ball.html"
    path.write_text(document(told), encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def launch() -> Iterator[Any]:
    with chromium() as found:
        yield found


@pytest.fixture(scope="module")
def browser(launch: Any) -> Any:
    return launch(*SOFTWARE)


@pytest.fixture
def seen(browser: Any, file: Path) -> Iterator[Watched]:
    watched = Watched(browser, file)
    yield watched
    watched.require_quiet(file)
    watched.page.close()


def place_of(seen: Watched, name: str) -> Any:
    return seen.page.locator(f"#tool-{name}")


class TestPage:
    def test_draws_the_mesh_and_hides_the_picture(self, seen: Watched) -> None:
        assert 0.1 < seen.drawn() < 0.9
        assert seen.page.locator(".view-picture").is_hidden()
        assert seen.page.locator(".view-letter").count() == 6

    def test_every_tool_changes_what_is_drawn(self, seen: Watched) -> None:
        views = [seen.pixels()]

        def changed() -> bool:
            views.append(seen.pixels())
            return views[-1] != views[-2]

        place_of(seen, "wire").check()
        assert changed()
        place_of(seen, "color").select_option("height")
        assert changed()
        assert "height (mm)" in seen.page.locator(".view-legend").inner_text()
        place_of(seen, "axis").select_option("x")
        assert changed()
        place_of(seen, "cut").fill("900")
        assert changed()
        place_of(seen, "axis").select_option("")
        place_of(seen, "color").select_option("")
        place_of(seen, "wire").uncheck()
        assert changed()
        assert views[-1] == views[0]

    def test_keys_turn_zoom_and_fit(self, seen: Watched) -> None:
        first = seen.pixels()
        seen.page.locator("canvas.view-canvas").focus()
        for key in ("ArrowLeft", "ArrowUp", "Shift+ArrowRight", "+", "-", "w"):
            before = seen.pixels()
            seen.page.keyboard.press(key)
            assert seen.pixels() != before
        assert place_of(seen, "wire").is_checked()
        seen.page.keyboard.press("w")
        seen.page.keyboard.press("f")
        assert seen.pixels() == first

    def test_dragging_turns_and_the_wheel_zooms_once_it_has_the_focus(self, seen: Watched) -> None:
        box = seen.page.locator("canvas.view-canvas").bounding_box()
        middle = box["x"] + box["width"] / 2, min(box["y"] + box["height"] / 2, 700)
        share = seen.drawn()
        seen.page.mouse.move(*middle)
        seen.page.mouse.wheel(0, -300)
        assert seen.drawn() == share
        seen.page.mouse.down()
        seen.page.mouse.up()
        seen.page.mouse.wheel(0, -300)
        seen.page.wait_for_timeout(200)
        assert seen.drawn() > 1.1 * share

    def test_a_problem_is_flown_to(self, seen: Watched) -> None:
        share = seen.drawn()
        buttons = seen.page.locator("button.fly")
        assert buttons.count() == 1
        assert buttons.inner_text() == "Show the first"
        buttons.click()
        assert buttons.inner_text() == "Show 2 of 2"
        seen.page.wait_for_timeout(800)
        assert seen.drawn() != share
        view = seen.page.locator("#view").bounding_box()
        assert view["y"] > -1
        assert view["y"] + view["height"] < 721

    def test_search_leaves_the_rows_that_have_all_words(self, seen: Watched) -> None:
        rows, search = seen.page.locator("table.searched tbody tr:visible"), seen.page.locator("input.search")
        every = rows.count()
        search.fill("quality GENUS")
        assert 1 <= rows.count() < every
        assert all("genus" in text for text in rows.all_inner_texts())
        assert seen.page.locator("#found").inner_text() == f"{rows.count()} rows found"
        search.fill("no such key")
        assert rows.count() == 0
        assert seen.page.locator(".table-section:visible").count() == 0
        search.fill("")
        assert rows.count() == every

    def test_the_command_is_copied(self, browser: Any, file: Path) -> None:
        watched = Watched(browser, file)
        watched.page.context.grant_permissions(["clipboard-read", "clipboard-write"])
        watched.page.locator("button.copy").click()
        watched.page.wait_for_selector("button.copy:has-text('Copied')")
        assert watched.page.evaluate("navigator.clipboard.readText()") == COMMAND
        watched.page.close()

    def test_is_dark_where_the_system_is(self, browser: Any, file: Path) -> None:
        shades = []
        for scheme in ("light", "dark"):
            watched = Watched(browser, file, color_scheme=scheme)
            shades.append(watched.page.evaluate("getComputedStyle(document.body).backgroundColor"))
            watched.page.close()
        assert shades == ["rgb(255, 255, 255)", "rgb(20, 25, 30)"]

    @pytest.mark.parametrize("scheme", ["light", "dark"])
    def test_words_stand_out(self, browser: Any, file: Path, scheme: str) -> None:
        watched = Watched(browser, file, color_scheme=scheme)
        for selector in ("#verdict", ".checks span", "nav a", ".note", "td", "thead th", "pre", ".problem strong"):
            ink, paper = watched.page.evaluate(COLORS, selector)
            assert contrast(ink, paper) >= 4.5, selector
        watched.page.close()

    def test_on_paper_it_shows_the_picture_and_no_tools(self, seen: Watched) -> None:
        seen.page.emulate_media(media="print")
        assert seen.page.locator(".view-picture").is_visible()
        assert seen.page.locator("canvas.view-canvas").is_hidden()
        assert seen.page.locator("button:visible").count() == 0
        assert seen.page.locator("table.searched").first.is_visible()

    def test_is_read_without_script(self, browser: Any, file: Path) -> None:
        watched = Watched(browser, file, java_script_enabled=False)
        assert watched.page.locator(".view-picture").is_visible()
        assert watched.page.locator("button:visible").count() == 0
        assert watched.page.locator("table.searched tr").last.is_visible()
        watched.page.close()

    def test_nothing_else_may_run(self, browser: Any, file: Path, tmp_path: Path) -> None:
        other = tmp_path / "other.html"
        text = file.read_text(encoding="utf-8")
        for extra in (
            "<script>document.title = 'run'</script>",
            "<img src=http://localhost/x onerror=document.title=1>",
        ):
            other.write_text(text.replace("</main>", f"{extra}</main>"), encoding="utf-8")
            watched = Watched(browser, other)
            assert watched.page.title() == "a ball.stl - tomomesh"
            assert [one for one in watched.complaints if "Content Security Policy" in one]
            watched.page.close()


class TestWithoutWebGL:
    def test_the_picture_is_there_and_all_else_works(self, launch: Any, file: Path) -> None:
        watched = Watched(launch(*NO_WEBGL), file)
        assert watched.page.locator(".view-picture").is_visible()
        assert watched.page.evaluate("document.querySelector('.view-picture').naturalWidth") > 100
        assert watched.page.locator("canvas.view-canvas").count() == 0
        assert watched.page.locator("button.fly:visible").count() == 0
        watched.page.locator("input.search").fill("genus")
        assert watched.page.locator("#found").inner_text()
        watched.require_quiet(file)


class TestIndex:
    def test_leads_to_the_page_of_each(self, browser: Any, file: Path) -> None:
        path = file.parent / "index.html"
        rows: list[dict[str, Any]] = [
            {"name": "ball", "error": "", "sound": True},
            {"name": "b", "error": "it is broken"},
        ]
        path.write_text(index("all", rows, folder=""), encoding="utf-8")
        watched = Watched(browser, path)
        watched.page.locator("input.search").fill("broken")
        assert watched.page.locator("tbody tr:visible").count() == 1
        watched.page.locator("input.search").fill("")
        watched.require_quiet(path)
        watched.page.locator("tbody a").click()
        watched.page.wait_for_selector("canvas.view-canvas")
        assert watched.page.title() == "a ball.stl - tomomesh"
        assert watched.complaints == []
        watched.page.close()


COLORS = """(selector) => {
  const numbers = (text) => text.match(/[\\d.]+/g).map(Number);
  let element = document.querySelector(selector);
  const ink = numbers(getComputedStyle(element).color);
  let paper = [0, 0, 0, 0];
  for (; element && paper[3] === 0; element = element.parentElement) {
    paper = numbers(getComputedStyle(element).backgroundColor);
    if (paper.length === 3) paper.push(1);
  }
  return [ink.slice(0, 3), paper.slice(0, 3)];
}"""
"""The color of a text, and of what is behind it."""


def contrast(ink: list[float], paper: list[float]) -> float:
    """Return the contrast of two colors (WCAG 2.2, 1.4.3)."""
    shares = np.array([ink, paper]) / 255
    linear = np.where(shares <= 0.04045, shares / 12.92, ((shares + 0.055) / 1.055) ** 2.4)
    low, high = sorted(linear @ [0.2126, 0.7152, 0.0722])
    return float((high + 0.05) / (low + 0.05))
