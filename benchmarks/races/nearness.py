"""How near are meshes of 50,000 points without noise, beside MeshLib, whose vertices are the points themselves."""

from __future__ import annotations

import tempfile
from pathlib import Path

from arena import TOMOMESH, Arena, Method, environment
from bench import at_least, at_most, holds, note
from peers import DATA, SHAPES

MESHLIB = Method("meshlib")
NEARER = 0.85
"""Most of MeshLib's distance, mean of both sides, that is allowed."""


def main() -> None:
    if not DATA.exists():
        print("not measured: there is no shared data beside the project")
        return
    environment()
    with tempfile.TemporaryDirectory() as folder:
        arena = Arena(Path(folder))
        for name, shape in SHAPES.items():
            case = arena.drawn(shape.path)
            ours, peer = (arena.scored(method, case) for method in (TOMOMESH, MESHLIB))
            if "cd" not in peer:
                note(f"{name}: distance", "not measured: there is no MeshLib")
                continue
            for figure in ("cd", "nc", "genus"):
                note(f"{name}: {figure}", f"{ours[figure]:.4g}; MeshLib {peer[figure]:.4g}")
            at_most(f"{name}: cd over MeshLib's", ours["cd"] / peer["cd"], NEARER)
            at_least(f"{name}: nc beyond MeshLib's", ours["nc"] - peer["nc"], 0)
            holds(f"{name}: genus right", ours["genus"] == shape.genus)


if __name__ == "__main__":
    main()
