"""A real browser that looks at the page: Chromium, without a window, its 3-D drawn by software."""

from __future__ import annotations

import shutil
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, Literal

import pytest

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pages import Page

NAMES = ("chromium", "chromium-browser", "google-chrome")
WITHOUT_SCREEN = ["--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--no-sandbox"]
WIDTH, HEIGHT = 1280, 720
"""Of a laptop."""


def browser_here() -> str:
    """Return the browser of this machine; skip the test where there is none."""
    pytest.importorskip("playwright")
    found = [path for name in NAMES if (path := shutil.which(name))]
    if not found:
        pytest.skip(f"no browser is here: {', '.join(NAMES)}")
    return found[0]


@contextmanager
def looking_at(page: Page, *, scheme: Literal["light", "dark"] = "light", refused: bool = False) -> Iterator[Any]:
    """Open a page in a browser; no script may fail in it, and nothing be asked of anybody else.

    Parameters
    ----------
    page : Page
        One that is served, and was not entered.
    scheme : {"light", "dark"}
    refused : bool
        Whether the server is to refuse something, which the browser says, too.
    """
    path = browser_here()
    from playwright.sync_api import sync_playwright

    faults: list[str] = []
    with sync_playwright() as tools:
        browser = tools.chromium.launch(executable_path=path, args=WITHOUT_SCREEN)
        seen = browser.new_page(viewport={"width": WIDTH, "height": HEIGHT}, color_scheme=scheme)
        seen.on("console", lambda said: faults.append(said.text) if said.type == "error" else None)
        seen.on("pageerror", lambda fault: faults.append(str(fault)))
        seen.on("request", lambda asked: None if _ours(asked.url, page) else faults.append(asked.url))
        seen.goto(f"{page.address}?token={page.token}")
        yield seen
        browser.close()
    assert [one for one in faults if not (refused and "400 (Bad Request)" in one)] == []


def _ours(url: str, page: Page) -> bool:
    return url.startswith((page.address, "blob:", "data:"))
