"""A mesh that is opened, in a real browser: seen first, measured after."""

from __future__ import annotations

import json
import re
import shlex
from pathlib import Path

import pytest

pytest.importorskip("starlette")
pytest.importorskip("uvicorn")
pytest.importorskip("websockets")

from looked_at import looking_at
from pages import served
from test_show import round_mesh
from tomomesh import TriMesh, phantom, write_mesh
from tomomesh.cli import main


def test_a_mesh_is_drawn_and_measured_whenever_its_page_is_opened(tmp_path: Path) -> None:
    expect = pytest.importorskip("playwright.sync_api").expect
    path = tmp_path / "ball.stl"
    write_mesh(phantom((8, 24, 24), (8.0, 8.0, 16.0)).truth, path)
    with served(path) as page, looking_at(page) as seen:
        asked: list[str] = []
        seen.on("request", lambda request: asked.append(request.url.partition("?")[0].rpartition("/")[2]))
        seen.reload()
        expect(seen.locator("#surface")).to_contain_text("quality.closed", timeout=60_000)
        expect(seen.locator("#surface")).to_contain_text(re.compile(r"[\d,]+ triangles"))
        assert "[object Object]" not in seen.inner_text("#surface")
        assert asked.index("fitted") < asked.index("report")


def test_a_mesh_is_saved_in_another_format_as_the_command_does(tmp_path: Path) -> None:
    path = tmp_path / "a ball.ply"
    write_mesh(round_mesh(), path)
    with served(path) as page, looking_at(page) as seen:
        seen.click("#tab-saving")
        seen.wait_for_selector(".save button:enabled")
        assert seen.locator(".save").count() == 1
        for suffix in (".stl", ".3mf"):
            seen.select_option(".save select", suffix)
            with seen.expect_download() as saved:
                seen.click(".save button")
            words = shlex.split(seen.inner_text("pre.whole"))
            assert words == ["tomomesh", "print", str(path), "-o", "mesh.stl"]
            assert main([*words[1:-1], str(tmp_path / f"mesh{suffix}"), "--quiet"]) == 0
            assert Path(saved.value.path()).read_bytes() == (tmp_path / f"mesh{suffix}").read_bytes()


def test_an_open_mesh_is_not_saved_and_says_why(tmp_path: Path) -> None:
    path = tmp_path / "open.ply"
    write_mesh(TriMesh(round_mesh().vertices, round_mesh().faces[5:]), path)
    with served(path) as page:
        page.enter()
        page.ready()
        status, _, answer = page.ask("/save/mesh.stl")
        assert status == 400
        assert json.loads(answer)["error"].count("\n") == 0
        assert page.ask("/save/points.ply")[0] == 400
