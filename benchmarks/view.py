"""How soon is the page up, does it follow a hand on a large CT, and what does it take of memory and disk?"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from contextlib import contextmanager
from importlib.metadata import distribution
from pathlib import Path
from statistics import median, quantiles
from typing import TYPE_CHECKING, Any

import nibabel
import numpy as np

from bench import at_most, header, note

if TYPE_CHECKING:
    from collections.abc import Iterator

SHAPE, SPACING = (600, 512, 512), (0.7, 0.7, 1.0)
"""Slices, rows and columns: 315 MB of 16 bits."""
STEPS = 60
EXTRA = ("starlette", "uvicorn", "websockets", "anyio", "idna", "h11", "click", "typing_extensions")
"""What the extra `view` brings over the core, its own needs included."""
PAGE_UP, MEDIAN, MOST, DISK = 3.0, 60.0, 150.0, 120.0
SOFTWARE = ("--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--no-sandbox")
BROWSERS = ("chromium", "chromium-browser", "google-chrome")
MB = 1e6
LARGEST = 1.3 * 2 * SHAPE[0] * SHAPE[1] * SHAPE[2] / MB + 350.0
"""Megabytes that the program may take: 1.3 volumes and 350."""

AFTER_INPUT = """
([name, doing]) => new Promise((done) => {
  const canvas = document.querySelector(`.plane-${name} canvas`);
  const handle = document.querySelector(".handle.lower");
  const seen = () => `${canvas.dataset.slice} ${canvas.dataset.lower}`;
  const before = seen(), start = performance.now();
  const look = () => seen() === before ? requestAnimationFrame(look) : done(performance.now() - start);
  if (doing === "slice") canvas.dispatchEvent(new WheelEvent("wheel", { deltaY: -100, cancelable: true }));
  else handle.dispatchEvent(new KeyboardEvent("keydown", { key: doing, bubbles: true }));
  requestAnimationFrame(look);
})
"""
"""From an input to the frame in which the slice, or the window on it, is drawn."""


def main() -> None:
    argparse.ArgumentParser(description=__doc__).parse_args()
    header("The page in the browser", "starlette", "uvicorn", "websockets")
    note("load of the machine before", f"{os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")
    at_most("size of the extra on disk", _disk(), DISK, "MB")
    with tempfile.TemporaryDirectory() as folder:
        study = _ct(Path(folder) / "ct.nii")
        _measure(study)


def _measure(study: Path) -> None:
    from playwright.sync_api import sync_playwright

    program = next(filter(None, map(shutil.which, BROWSERS)))
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=program, args=list(SOFTWARE))
        page = browser.new_page(viewport={"width": 1280, "height": 720})
        sent: list[int] = []
        page.on("response", lambda answer: sent.append(_voxels_in(answer)))
        with _served(study, "--lower", "200", "--keep", "all") as (process, address, start):
            page.goto(address)
            page.wait_for_selector("#tab-study")
            at_most("page up, from the command", time.perf_counter() - start, PAGE_UP, "s")
            page.wait_for_selector(".plane-axial canvas[data-slice]", timeout=120_000)
            note("first slices of the CT, from the command", f"{time.perf_counter() - start:.1f} s")
            page.wait_for_selector(".chips button", timeout=120_000)
            note("histogram and windows, from the command", f"{time.perf_counter() - start:.1f} s")
            page.wait_for_selector(".rows .row", timeout=600_000)
            note("components of the window, from the command", f"{time.perf_counter() - start:.1f} s")
            for plane in ("axial", "coronal", "sagittal"):
                _latency(page, f"a slice moved, {plane}", [(plane, "slice")] * STEPS)
            keys = ["ArrowRight", "ArrowLeft"] * (STEPS // 2)
            _latency(page, "a handle of the window moved", [("axial", key) for key in keys])
            slice_bytes = SHAPE[0] * SHAPE[1] * 2
            at_most("largest answer over one slice", max(sent) / slice_bytes, 1.0, "x")
            at_most("memory at its peak", _peak(process), LARGEST, "MB")
        with _served(study, "--preset", "bone") as (process, address, _):
            page.goto(address)
            page.wait_for_selector(".rows .row", timeout=600_000)
            at_most("memory at its peak, where a body is looked for", _peak(process), LARGEST, "MB")
        browser.close()


def _voxels_in(answer: Any) -> int:
    """Return the bytes of an answer that holds numbers; the page's own files are no study's."""
    numbers = answer.headers.get("content-type") == "application/octet-stream"
    return int(answer.headers.get("content-length", 0)) if numbers else 0


def _latency(page: Any, figure: str, inputs: list[tuple[str, str]]) -> None:
    found = [float(page.evaluate(AFTER_INPUT, list(one))) for one in inputs]
    at_most(f"{figure}, median", median(found), MEDIAN, "ms")
    at_most(f"{figure}, 95 %", quantiles(found, n=20)[-1], MOST, "ms")


@contextmanager
def _served(study: Path, *window: str) -> Iterator[tuple[subprocess.Popen[str], str, float]]:
    start = time.perf_counter()
    command = [sys.executable, "-m", "tomomesh", "view", str(study), "--no-browser", *window]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    assert process.stderr is not None
    try:
        line = process.stderr.readline()
        found = re.search(r"http\S+", line)
        assert found, line + process.stderr.read()
        yield process, found[0], start
    finally:
        process.send_signal(signal.SIGINT)
        process.communicate()


def _peak(process: subprocess.Popen[str]) -> float:
    status = Path(f"/proc/{process.pid}/status").read_text()
    found = re.search(r"VmHWM:\s*(\d+)", status)
    assert found
    return 1024 * int(found[1]) / MB


def _disk() -> float:
    files = [Path(str(file.locate())) for name in EXTRA for file in distribution(name).files or ()]
    return sum(file.stat().st_size for file in files if file.is_file()) / MB


def _ct(path: Path) -> Path:
    """Write a CT of a made-up body: skin, fat, ribs all around, lungs, a spine, a table, and noise."""
    image = nibabel.Nifti1Image(np.broadcast_to(np.int16(0), SHAPE[::-1]), np.diag([*SPACING, 1.0]))
    image.header.set_xyzt_units("mm")
    raw = bytearray(image.header.binaryblock)
    raw[108:112] = np.array([352], "<f4").tobytes()
    rng = np.random.default_rng(0)
    with path.open("wb") as file:
        file.write(bytes(raw) + bytes(4))
        for place in np.linspace(-1, 1, SHAPE[0]):
            file.write((_slice(float(place)) + rng.normal(0, 20, SHAPE[1:])).astype("<i2").tobytes())
    return path


def _slice(place: float) -> Any:
    """Return a slice at a place from -1 to 1 along the body, in Hounsfield units."""
    j, i = np.mgrid[-1 : 1 : SHAPE[1] * 1j, -1 : 1 : SHAPE[2] * 1j]
    wide = np.sqrt(1 - 0.8 * place**2)
    away = np.hypot(j / (0.7 * wide), i / (0.9 * wide))
    levels = np.select([away < 0.8, away < 0.85, away < 0.88, away < 0.93, away < 1], [50, 900, 50, -80, 40], -1000)
    for side in (-0.35, 0.35):
        levels[np.hypot((i - side) / (0.28 * wide), j / (0.4 * wide)) < 1] = -850
    levels[np.hypot(i, j - 0.45 * wide) < 0.09] = 700
    levels[(np.abs(j - 0.85) < 0.01) & (np.abs(i) < 0.8)] = 400
    return levels


if __name__ == "__main__":
    main()
