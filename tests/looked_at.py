"""The app in a real browser: what it complains of and whom it asks are faults."""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from browsers import SOFTWARE, chromium

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pages import Page

WIDTH, HEIGHT = 1280, 720
"""Of a laptop."""


@contextmanager
def looking_at(page: Page, *, scheme: str = "light", refused: bool = False) -> Iterator[Any]:
    """Open a page in a browser; no script may fail in it, and nothing be asked of anybody else.

    Parameters
    ----------
    page : Page
        One that is served, and was not entered.
    scheme : {"light", "dark"}
    refused : bool
        Whether the server is to refuse something, which the browser says, too.
    """
    faults: list[str] = []
    with chromium() as launch:
        seen = launch(*SOFTWARE).new_page(viewport={"width": WIDTH, "height": HEIGHT}, color_scheme=scheme)
        seen.on("console", lambda said: faults.append(said.text) if said.type == "error" else None)
        seen.on("pageerror", lambda fault: faults.append(str(fault)))
        seen.on("request", lambda asked: None if _ours(asked.url, page) else faults.append(asked.url))
        seen.goto(f"{page.address}?token={page.token}")
        yield seen
    left = [one for one in faults if not (refused and "400 (Bad Request)" in one)]
    assert left == [], left


def _ours(url: str, page: Page) -> bool:
    return url.startswith((page.address, "blob:", "data:"))
