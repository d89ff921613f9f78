"""Run the command line as a user does, and look at everything that it leaves."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tracemalloc
from typing import TYPE_CHECKING

from tomomesh.cli import main

if TYPE_CHECKING:
    from pathlib import Path

    from _pytest.capture import CaptureFixture

ERROR = re.compile(r"^error: .+\. ?(File: .+\.)? ?(Found: .+\.)? ?(Expected: .+\.)? ?(Try: .+\.)?$")
"""What every fault looks like."""

PEAK_BYTES = 2**26
"""Most that Python and NumPy may hold when a small file is refused."""


def contents(folder: Path) -> dict[str, object]:
    """Return what stands in a folder: the bytes of files, the ends of links, and the names of whatever else."""
    found: dict[str, object] = {}
    for path in sorted(folder.rglob("*")):
        name = str(path.relative_to(folder))
        if path.is_symlink():
            found[name] = path.readlink()
        elif path.is_file():
            found[name] = path.read_bytes(), path.stat().st_mtime_ns
        else:
            found[name] = path.stat().st_mode
    return found


def refused(line: list[str], code: int, folder: Path, capsys: CaptureFixture[str]) -> str:
    """Run a command that must fail, and return its one line.

    All of `folder` must be as before: no output, no temporary file, no change of what was read. Nothing but the
    line, and stages that came to an end, may be said; and the memory must stay small.
    """
    before = contents(folder)
    capsys.readouterr()
    tracemalloc.start()
    try:
        assert main(line) == code, capsys.readouterr().err
        assert tracemalloc.get_traced_memory()[1] < PEAK_BYTES
    finally:
        tracemalloc.stop()
    heard = capsys.readouterr()
    assert heard.out == ""
    *stages, said = heard.err.splitlines()
    assert not any("error" in stage or "Traceback" in stage for stage in stages)
    assert ERROR.match(said), said
    assert said.isprintable()
    assert contents(folder) == before
    return said


def reconstructing(study: str | Path, folder: Path, *options: str) -> list[str]:
    """Return the line that reconstructs a study, and writes all that there is to write into a folder."""
    names = {"--points": "p.ply", "--labels": "l.nii.gz", "--report": "r.json", "--save-settings": "s.toml"}
    outputs = [word for option, name in names.items() for word in (option, str(folder / name))]
    return ["reconstruct", str(study), "-o", str(folder / "m.ply"), *outputs, "--figures", str(folder / "f"), *options]


def as_program(
    line: list[str], *, before: str = "", env: dict[str, str] | None = None
) -> subprocess.CompletedProcess[str]:
    """Run a command in a process of its own, after some Python of the test's."""
    code = f"import sys\n{before}\nfrom tomomesh.__main__ import main\nsys.argv[1:] = {line!r}\nsys.exit(main())"
    return subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        encoding="utf-8",
        errors="replace",
        check=False,
        env={**os.environ, **(env or {})},
    )
