"""A mesh that is opened, in a real browser: seen first, measured after."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import pytest

pytest.importorskip("starlette")
pytest.importorskip("uvicorn")
pytest.importorskip("websockets")

from looked_at import looking_at
from pages import served
from tomomesh import phantom, write_mesh

if TYPE_CHECKING:
    from pathlib import Path


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
