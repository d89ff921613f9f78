"""Draw the screens of docs/images anew, from the built-in head in a real browser: ``python docs/screens.py``.

It needs Chromium, Playwright and the extra ``view``, and takes no look at any patient.
"""

from __future__ import annotations

import io
import re
import shutil
import subprocess
import sys
import tempfile
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import nibabel
import numpy as np
from PIL import Image
from playwright.sync_api import sync_playwright

from tomomesh import phantom
from tomomesh.cli import main

if TYPE_CHECKING:
    from collections.abc import Iterator

IMAGES = Path(__file__).parent / "images"
SIZE = {"width": 1280, "height": 720}
SOFTWARE = ("--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")
QUALITY = 80
"""Of WebP: letters stay sharp, and no screen takes more than 100 kB."""


def draw() -> None:
    """Open the head, work on it as a user would, and keep a screen of each part."""
    program = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))))
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as started:
        study, report = Path(folder, "head.nii.gz"), Path(folder, "report.html")
        head = phantom()
        to_ras = np.diag([-1.0, -1.0, 1.0, 1.0]) @ head.volume.affine
        nibabel.save(nibabel.Nifti1Image(np.asarray(head.volume.voxels).T, to_ras), study)
        browser = started.chromium.launch(executable_path=program, args=[*SOFTWARE])
        tab = browser.new_page(viewport=SIZE, color_scheme="light")
        with served(study, "--lower", str(head.lower)) as address:
            work(tab, address)
        main(["demo", "-o", folder, "--html", str(report), "--quiet"])
        tab.goto(report.as_uri())
        keep(tab, "view-report")
        browser.close()


def work(tab: Any, address: str) -> None:
    """Go through the parts of the page."""
    tab.goto(address)
    tab.wait_for_selector(".rows .row")
    keep(tab, "view-study")
    tab.click("#tab-networks")
    tab.click("#net-train")
    tab.wait_for_selector("#net-train:disabled")
    tab.wait_for_selector("#net-train:enabled")
    tab.focus("#net-canvas")
    tab.keyboard.press("End")
    keep(tab, "view-networks")
    tab.click("#tab-surface")
    tab.click("text=Make the surface")
    tab.wait_for_selector("text=Make it again", timeout=300_000)
    tab.locator("select:has(option[value=thickness])").select_option("distance")
    keep(tab, "view-surface")


@contextmanager
def served(study: Path, *words: str) -> Iterator[str]:
    """Serve the page, and give its address."""
    command = [sys.executable, "-m", "tomomesh", "view", study.name, *words, "--no-browser"]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True, cwd=study.parent)
    assert process.stderr is not None
    try:
        found = re.search(r"http\S+", process.stderr.readline())
        assert found
        yield found[0]
    finally:
        process.terminate()
        process.communicate()


def keep(tab: Any, name: str) -> None:
    """Keep what the page shows, once it stands still."""
    tab.wait_for_timeout(2000)
    with Image.open(io.BytesIO(tab.screenshot())) as shown:
        shown.convert("RGB").save(IMAGES / f"{name}.webp", quality=QUALITY, method=6)


if __name__ == "__main__":
    draw()
