"""How soon does the program answer, and (with --fresh) how soon does a new user have a mesh."""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING

from bench import at_most, header, median_times, note

if TYPE_CHECKING:
    from collections.abc import Mapping

PROJECT = Path(__file__).parents[1]
MEGABYTE = 1e6


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--fresh", action="store_true", help="also install into a new environment")
    fresh = parser.parse_args().fresh
    header("Start, demo" + (" and installation" if fresh else ""))
    python = Path(sys.executable)
    _answer(python)
    with tempfile.TemporaryDirectory() as folder:
        _demo(python, folder)
        at_most("demo, everything cached, median of 3", _settled(python, folder), 6, "s")
    if fresh:
        with tempfile.TemporaryDirectory() as folder:
            _install(Path(folder))


def _answer(python: Path) -> None:
    tomomesh = str(python.with_name("tomomesh"))
    ours, peer = median_times(
        lambda: _run(tomomesh, "--help"), lambda: _run(str(python), "-c", "import numpy"), repeats=21
    )
    note("tomomesh --help", f"{1e3 * ours:.0f} ms")
    note("import numpy", f"{1e3 * peer:.0f} ms")
    at_most("--help over import numpy", ours / peer, 2, "x")


def _install(folder: Path) -> None:
    """Follow the README in a new environment, with empty caches for kernels and fonts."""
    start = time.perf_counter()
    _run(sys.executable, "-m", "venv", str(folder / ".venv"))
    python = folder / ".venv" / "bin" / "python"
    _run(str(python), "-m", "pip", "install", "-qq", str(PROJECT))
    at_most("new environment and installation", time.perf_counter() - start, 60, "s")
    files = [path for path in (folder / ".venv").rglob("*") if path.is_file() and not path.is_symlink()]
    inside = sum(path.stat().st_size for path in files if "site-packages" in path.parts)
    at_most("site-packages", inside / MEGABYTE, 650, "MB")
    caches = {"XDG_CACHE_HOME": str(folder / "cache"), "XDG_CONFIG_HOME": str(folder / "config")}
    at_most("first demo, nothing cached", _demo(python, str(folder), caches), 25, "s")
    at_most("further demos there, median of 3", _settled(python, str(folder), caches), 6, "s")


def _settled(python: Path, folder: str, caches: Mapping[str, str] | None = None) -> float:
    return median(_demo(python, folder, caches) for _ in range(3))


def _demo(python: Path, folder: str, caches: Mapping[str, str] | None = None) -> float:
    start = time.perf_counter()
    _run(str(python.with_name("tomomesh")), "demo", "--quiet", "-o", f"{folder}/demo", caches=caches)
    return time.perf_counter() - start


def _run(*command: str, caches: Mapping[str, str] | None = None) -> None:
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, env={**os.environ, **(caches or {})})


if __name__ == "__main__":
    main()
