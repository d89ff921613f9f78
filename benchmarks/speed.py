"""Every mark of speed and memory in one table, beside the peer that is named: wall and CPU, and what is LOST.

Each race is a file of `races/`, run in a process of its own so that no race warms another.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from pathlib import Path

from bench import header

RACES = Path(__file__).parent / "races"


def main() -> None:
    names = sorted(path.stem for path in RACES.glob("[!_]*.py"))
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("races", nargs="*", help=f"of {', '.join(names)}; all if none")
    chosen = parser.parse_args().races or names
    if unknown := set(chosen) - set(names):
        parser.error(f"no race: {', '.join(sorted(unknown))}")
    header("Speed")
    for name in chosen:
        subprocess.run([sys.executable, "-m", f"races.{name}"], cwd=RACES.parent, check=True)


if __name__ == "__main__":
    main()
