"""Killed at any call while it writes: the old file or the new one, whole, and nothing else for long."""

from __future__ import annotations

import os
import subprocess
import sys
from collections import Counter
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from pathlib import Path

pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="processes cannot be forked here")

KILL_AT_EACH_CALL = """
import os, signal, sys
from pathlib import Path
from tomomesh.io import replacing

folder, way, count = Path(sys.argv[1]), sys.argv[2], 0
if way == "named" and hasattr(os, "O_TMPFILE"):
    del os.O_TMPFILE
if way == "copied":
    def no_links(*names, **options):
        raise PermissionError
    os.link = no_links

def die_at(number):
    def count_down(frame, event, argument):
        nonlocal number
        number -= event == "c_call"
        if number == 0:
            os.kill(os.getpid(), signal.SIGKILL)
    sys.setprofile(count_down)

def write():
    with replacing(folder / "m") as file:
        file.write(b"new" * 9999)
        file.write(b"end")

def killed(number):
    child = os.fork()
    if not child:
        die_at(number)
        write()
        sys.setprofile(None)
        os._exit(0)
    return os.waitpid(child, 0)[1] == signal.SIGKILL

while True:
    count += 1
    (folder / "m").write_bytes(b"old")
    dead = killed(count)
    found = (folder / "m").read_bytes()
    left = sorted(path.name for path in folder.iterdir() if path.name != "m")
    print(["old", "new", "torn"][2 if found not in (b"old", b"new" * 9999 + b"end") else found != b"old"], len(left))
    if left:
        write()
        assert [path.name for path in folder.iterdir()] == ["m"], "the next write leaves nothing of the one before"
    if not dead:
        break
"""


def ended(program: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run a program without threads of NumPy's, which no fork would survive."""
    alone = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}
    line = [sys.executable, "-c", program, *arguments]
    return subprocess.run(line, capture_output=True, text=True, check=False, env=alone)


@pytest.mark.parametrize("way", ["nameless", "named", "copied"])
def test_killed_at_every_call_the_file_is_the_old_or_the_new_one(tmp_path: Path, way: str) -> None:
    done = ended(KILL_AT_EACH_CALL, str(tmp_path), way)
    assert done.returncode == 0, done.stderr
    tally = Counter(line.split()[0] for line in done.stdout.splitlines())
    left = [int(line.split()[1]) for line in done.stdout.splitlines()]
    assert set(tally) == {"old", "new"}
    assert tally["old"] > 5
    assert max(left) <= 1
    if way == "nameless" and hasattr(os, "O_TMPFILE"):
        assert sum(left) < 5  # the calls between the hidden name and the last one


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() != 0, reason="only root may mount a small disk")
def test_a_full_disk_leaves_the_old_file(tmp_path: Path) -> None:
    from tomomesh.errors import OutputError
    from tomomesh.io import replacing

    mounted = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", tmp_path], check=False)
    if mounted.returncode:
        pytest.skip("no small disk can be mounted here")
    try:
        (tmp_path / "m").write_bytes(b"old")
        with pytest.raises(OutputError, match="no space left"), replacing(tmp_path / "m") as file:
            file.write(bytes(2**17))
        assert [path.name for path in tmp_path.iterdir()] == ["m"]
        assert (tmp_path / "m").read_bytes() == b"old"
    finally:
        subprocess.run(["umount", tmp_path], check=True)
