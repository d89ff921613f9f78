"""The surface and what is saved of it, in a real browser; folders of runs, meshes and points by themselves."""

from __future__ import annotations

import json
import shlex
import shutil
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

pytest.importorskip("starlette")
pytest.importorskip("uvicorn")
pytest.importorskip("websockets")

from browsers import NO_WEBGL, SOFTWARE, chromium
from pages import ENDLESS, HERE, served
from studies import write_nifti
from tomomesh import phantom
from tomomesh.cli import main

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

HEAD = phantom((14, 40, 40), (6.0, 6.0, 11.0))
CUBE = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)]) * 10.0
SIDES = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
MOST = 60_000
"""Milliseconds in which what is waited for comes, also on a machine that is busy."""


@pytest.fixture(scope="module")
def launch() -> Iterator[Callable[..., Any]]:
    with chromium() as launch:
        yield launch


@pytest.fixture(scope="module")
def browser(launch: Callable[..., Any]) -> Any:
    return launch(*SOFTWARE)


@contextmanager
def seen(browser: Any, *arguments: str | Path, **options: Any) -> Iterator[Any]:
    """Open a page, and check in the end that it has complained of nothing and asked for nothing from elsewhere."""
    complaints: list[str] = []
    asked: list[str] = []
    with served(*arguments) as page:
        tab = browser.new_page(viewport={"width": 1280, "height": 720}, **options)
        tab.set_default_timeout(MOST)
        tab.on("console", lambda message: complaints.append(message.text))
        tab.on("pageerror", lambda error: complaints.append(str(error)))
        tab.on("request", lambda request: asked.append(request.url))
        tab.goto(f"{page.address}?token={page.token}")
        yield tab
        tab.close()
    assert complaints == []
    assert all(f"//{HERE}:" in url or url.startswith(("data:", "blob:")) for url in asked)


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("study") / "head.nii"
    return write_nifti(path, np.asarray(HEAD.volume.voxels), HEAD.volume.affine)


@pytest.fixture(scope="module")
def run(study: Path) -> Path:
    """The folder that a run has left."""
    folder = study.parent / "run"
    folder.mkdir()
    named = {"-o": "mesh.ply", "--points": "points.ply", "--report": "report.json", "--save-settings": "settings.toml"}
    words = [word for option, name in named.items() for word in (option, str(folder / name))]
    assert main(["reconstruct", str(study), "--lower", str(HEAD.lower), *words, "--quiet"]) == 0
    return folder


def write_cube(path: Path, sides: Sequence[tuple[int, ...]]) -> Path:
    corners = [f"v {x} {y} {z}" for x, y, z in CUBE]
    triangles = [face for a, b, c, d in sides for face in ((a, b, c), (a, c, d))]
    path.write_text("\n".join([*corners, *("f " + " ".join(str(n + 1) for n in face) for face in triangles)]) + "\n")
    return path


def make(tab: Any) -> None:
    """Make the surface by a click."""
    tab.click("#tab-surface")
    tab.click("text=Make the surface")
    tab.wait_for_selector("text=Make it again")
    tab.wait_for_selector(".view[aria-label^=Fitted]")


def pixels(tab: Any) -> bytes:
    """Return what the 3-D view shows, once it is drawn."""
    tab.wait_for_timeout(300)
    shown: bytes = tab.locator("canvas.view-canvas").screenshot()
    return shown


def command(tab: Any) -> list[str]:
    return shlex.split(tab.inner_text("#command"))[1:]


def saved(tab: Any, name: str, suffix: str) -> bytes:
    """Save a file by its button."""
    row = tab.locator(f".save:has(strong:text-is('{name}'))")
    if row.locator("option").count() > 1:
        row.locator("select").select_option(suffix)
    with tab.expect_download() as download:
        row.get_by_role("button", name="Save").click()
    return Path(download.value.path()).read_bytes()


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_the_surface_is_made_looked_at_and_saved(browser: Any, study: Path, tmp_path: Path, scheme: str) -> None:
    with seen(browser, study, "--lower", str(HEAD.lower), color_scheme=scheme) as tab:
        make(tab)
        shown = {pixels(tab)}
        for stage in ("Smoothed", "Triangulated", "Cuberille", "Cubes", "Points"):
            tab.keyboard.press("[")
            tab.wait_for_selector(f".view[aria-label^={stage}]")
            shown.add(pixels(tab))
        assert len(shown) == 6  # each looks otherwise
        tab.keyboard.press("]")
        tab.get_by_label("Step", exact=True).press("End")
        tab.wait_for_selector(".view[aria-label^=Fitted]")
        for color in ("distance", "thickness", "filled"):
            with tab.expect_response(lambda answer, name=color: answer.url.endswith(f"?color={name}")):
                tab.locator("select:has(option[value=thickness])").select_option(color)
            shown.add(pixels(tab))
        assert len(shown) == 9
        whole = pixels(tab)
        with tab.expect_response(lambda answer: "/api/place/" in answer.url):
            tab.keyboard.press("c")
        assert pixels(tab) != whole
        with tab.expect_response(lambda answer: "/outline/axial/3" in answer.url):
            tab.get_by_label("Slice of the cut").fill("3")
        tab.click("#tab-saving")
        words = command(tab)
        for suffix in (".stl", ".ply"):
            words[words.index("-o") + 1] = str(tmp_path / f"mesh{suffix}")
            assert main([*words, "--quiet"]) == 0
            assert saved(tab, "The mesh", suffix) == (tmp_path / f"mesh{suffix}").read_bytes()


def test_the_saved_page_is_that_of_the_command_line(
    browser: Any, study: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with seen(browser, study, "--lower", str(HEAD.lower)) as tab:
        make(tab)
        tab.click("#tab-saving")
        assert main([*command(tab), "--html", "report.html"]) == 0
        assert saved(tab, "The report", ".html") == (tmp_path / "report.html").read_bytes()
        found = json.loads(saved(tab, "The report", ".json"))
        assert found["written"] == {"unit": "mm", "frame": "LPS"}


def test_undo_changes_the_command_and_tells_that_the_surface_is_older(browser: Any, study: Path) -> None:
    with seen(browser, study, "--lower", str(HEAD.lower)) as tab:
        tab.wait_for_selector("button:has-text('otsu')")  # until then nobody knows what there is to choose
        tab.fill("[aria-label='upper bound']", "255")
        tab.keyboard.press("Enter")
        tab.wait_for_selector("#command:has-text('--upper 255')")
        make(tab)
        tab.click("#undo")
        tab.wait_for_selector("text=Choices have changed")
        assert "--upper" not in command(tab)
        tab.click("#redo")
        tab.wait_for_selector("#command:has-text('--upper 255')")
        tab.wait_for_selector("text=Choices have changed", state="hidden")


def test_a_second_click_is_no_second_run_and_stop_stops(browser: Any, study: Path) -> None:
    with seen(browser, study, "--lower", str(HEAD.lower), *ENDLESS) as tab:
        tab.click("#tab-surface")
        tab.wait_for_selector(".surface .first:enabled")
        begun: list[str] = []
        tab.on("response", lambda answer: begun.append(answer.url) if "/api/reconstruct" in answer.url else None)
        tab.keyboard.press("m")
        tab.wait_for_selector(".surface .first:disabled")
        tab.keyboard.press("m")
        tab.click("#work-stop")
        tab.wait_for_selector(".toast:has-text('stopped')")
        tab.wait_for_selector("text=Make the surface")
        assert len(begun) == 1


def test_a_click_on_a_problem_leads_to_its_place(browser: Any, tmp_path: Path) -> None:
    with seen(browser, write_cube(tmp_path / "open.obj", SIDES[:-1])) as tab:
        tab.wait_for_selector(".view[aria-label^=Fitted]")
        first = tab.locator(".problems li").first
        assert "open there" in first.inner_text()
        before = pixels(tab)
        first.get_by_role("button").click()
        tab.wait_for_timeout(1000)
        assert pixels(tab) != before
        assert command(tab) == ["check", str(tmp_path / "open.obj")]


def test_a_run_is_shown_with_its_own_report(browser: Any, run: Path) -> None:
    with seen(browser, run) as tab:
        tab.wait_for_selector(".view[aria-label^=Fitted]")
        tab.wait_for_selector("[aria-label='Search the report']")
        tab.fill("[aria-label='Search the report']", "timings.fit")
        assert tab.locator(".report tbody tr").count() >= 1  # no check tells that
        words = ["reconstruct", "STUDY", "--settings", str(run / "settings.toml"), "-o", "mesh.ply"]
        assert command(tab) == words
        tab.keyboard.press("Escape")
        tab.get_by_label("Step", exact=True).press("Home")
        tab.wait_for_selector(".view[aria-label^=Points]")


def test_what_a_run_tells_repeats_it(run: Path, study: Path, tmp_path: Path) -> None:
    words = ["reconstruct", str(study), "--settings", str(run / "settings.toml"), "-o", str(tmp_path / "mesh.ply")]
    assert main([*words, "--quiet"]) == 0
    assert (tmp_path / "mesh.ply").read_bytes() == (run / "mesh.ply").read_bytes()


def test_a_report_of_another_mesh_is_not_believed(browser: Any, run: Path, tmp_path: Path) -> None:
    shutil.copy(run / "report.json", tmp_path / "report.json")
    with seen(browser, write_cube(tmp_path / "mesh.obj", SIDES).parent) as tab:
        tab.wait_for_selector(".view[aria-label^=Fitted]")
        assert "12 triangles" in tab.inner_text(".surface .side")
        assert tab.locator(".report tr", has_text="timings").count() == 0


def test_one_of_several_meshes_is_opened_by_a_click(browser: Any, tmp_path: Path) -> None:
    write_cube(tmp_path / "a.obj", SIDES)
    write_cube(tmp_path / "b.obj", SIDES[:-1])
    with seen(browser, tmp_path) as tab:
        tab.wait_for_selector("text=the folder holds several meshes")
        tab.locator("tr", has_text="b.obj").get_by_role("button", name="Open").click()
        tab.wait_for_selector(".view[aria-label^=Fitted]")
        assert "10 triangles" in tab.inner_text(".surface .side")


def test_points_alone_become_a_surface(browser: Any, run: Path) -> None:
    with seen(browser, run / "points.ply") as tab:
        make(tab)
        assert command(tab) == ["surface", str(run / "points.ply"), "-o", "mesh.stl"]


@pytest.mark.parametrize("name", ["broken.stl", "broken.ply", "folder"])
def test_what_cannot_be_read_is_one_line_in_the_page(browser: Any, tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    if path.suffix:
        path.write_bytes(b"solid nothing")
    else:
        path.mkdir()
    with seen(browser, path) as tab:
        line = tab.locator(".refused:visible, .surface .empty:visible").filter(has_text=name).first
        line.wait_for()
        assert "\n" not in line.inner_text()


def test_without_webgl_the_report_and_the_files_are_there(launch: Callable[..., Any], run: Path) -> None:
    with seen(launch(*NO_WEBGL), run) as tab:
        tab.wait_for_selector("text=This browser draws nothing in 3-D")
        tab.wait_for_selector(".report tbody tr:nth-child(21)")
