"""A real browser, headless and with a WebGL of its own: Chromium, where it and Playwright are there."""

from __future__ import annotations

import shutil
from contextlib import ExitStack, contextmanager
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

NAMES = ("chromium", "chromium-browser", "google-chrome")
SOFTWARE = ("--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")
NO_WEBGL = ("--disable-gpu", "--disable-3d-apis")


@contextmanager
def chromium() -> Iterator[Callable[..., Any]]:
    """Hand over what starts a browser with some options, or skip and say so; all are closed in the end."""
    playwright = pytest.importorskip("playwright.sync_api", reason="Playwright is not installed")
    program = next(filter(None, map(shutil.which, NAMES)), None)
    if program is None:
        pytest.skip(f"none of {', '.join(NAMES)} is installed")
    with playwright.sync_playwright() as started, ExitStack() as stack:

        def launch(*options: str) -> Any:
            browser = started.chromium.launch(executable_path=program, args=["--no-sandbox", *options])
            stack.callback(browser.close)
            return browser

        yield launch


class Watched:
    """A page of a file, with whatever it complains of and asks for."""

    def __init__(self, browser: Any, file: Path, **options: Any) -> None:
        self.page = browser.new_page(viewport={"width": 1280, "height": 720}, **options)
        self.complaints: list[str] = []
        self.requests: list[str] = []
        self.page.on("console", lambda message: self.complaints.append(message.text))
        self.page.on("pageerror", lambda error: self.complaints.append(str(error)))
        self.page.on("request", lambda request: self.requests.append(request.url))
        self.page.goto(file.as_uri())

    def require_quiet(self, file: Path) -> None:
        """Check that nothing was said, and nothing asked for but the file itself."""
        assert self.complaints == []
        assert [url for url in self.requests if not url.startswith("data:")] == [file.as_uri()]

    def pixels(self) -> str:
        """Return what the canvas shows after the next frame."""
        self.drawn()
        shown: str = self.page.evaluate("document.querySelector('canvas.view-canvas').toDataURL()")
        return shown

    def drawn(self) -> float:
        """Return the share of the canvas that is not the color of its first pixel, after the next frame."""
        share: float = self.page.evaluate(
            """() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => {
              const canvas = document.querySelector("canvas.view-canvas");
              const copy = document.createElement("canvas");
              [copy.width, copy.height] = [canvas.width, canvas.height];
              const pen = copy.getContext("2d");
              pen.drawImage(canvas, 0, 0);
              const pixels = new Uint32Array(pen.getImageData(0, 0, copy.width, copy.height).data.buffer);
              done(pixels.filter((pixel) => pixel !== pixels[0]).length / pixels.length);
            })))"""
        )
        return share
