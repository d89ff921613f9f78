"""Where methods meet on clouds: the peers' own environment, and the runs, each a process of its own.

Nothing of the peers or of the judges is ever imported beside tomomesh. What a peer found on a cloud is kept in the
user's cache folder; a time that becomes a ratio never is, for both its sides belong to one run.
"""

from __future__ import annotations

import hashlib
import json
import subprocess
import sys
import venv
from dataclasses import dataclass
from math import nan
from pathlib import Path
from typing import NamedTuple

import platformdirs

CACHE = Path(platformdirs.user_cache_dir("tomomesh")) / "peers"

PINS = (
    "open3d==0.20.0",
    "libusb-package==1.0.30.0",  # Open3D asks for libusb, which not every system has
    "meshlib==3.1.4.297",
    "pymeshlab==2025.7.post1",
    "pyvista==0.49.1",
    "vtk==9.7.2",
    "trimesh==5.2.0",
    "point-cloud-utils==0.34.0",
    "scipy==1.17.1",
    "networkx==3.6.1",
)


class Found(dict[str, float]):
    """What was measured of a surface, by the names of score.py and peer.py.

    It is empty where there is no surface: its figures are not numbers then, and pass no mark.
    """

    def __missing__(self, figure: str) -> float:
        return nan


class Method(NamedTuple):
    """A method of peer.py, and the depth of its octree where it has one."""

    name: str
    depth: int = 0

    def __str__(self) -> str:
        return f"{self.name} {self.depth}" if self.depth else self.name


TOMOMESH = Method("tomomesh")
PEERS = (*(Method(name, depth) for name in ("pymeshlab", "open3d") for depth in (7, 8, 9, 10)), Method("vtk"))


class Case(NamedTuple):
    """A cloud, and the surface that it was drawn from."""

    cloud: Path
    reference: Path


@dataclass(frozen=True)
class Arena:
    """Runs of methods on clouds.

    Attributes
    ----------
    scratch : Path
        A folder for surfaces.
    fresh : bool
        Run the peers anew, whatever the cache holds.
    """

    scratch: Path
    fresh: bool = False

    def drawn(self, mesh: Path, points: int = 50_000, *, noise: float = 0, outliers: float = 0) -> Case:
        """Draw a cloud from a mesh, unless the cache holds it."""
        source = _digest(mesh.read_bytes())
        cloud = CACHE / "clouds" / f"{mesh.stem}-{source}-{points}-{noise:g}-{outliers:g}.npy"
        if not cloud.exists():
            cloud.parent.mkdir(parents=True, exist_ok=True)
            cloud.write_bytes(self._made("cloud.npy", "draw", mesh, points, noise, outliers).read_bytes())
        return Case(cloud, mesh)

    def reference(self, *job: object) -> Path:
        """Make a reference that no file holds, by a job of peer.py and its arguments."""
        return self._made("reference.ply", *job)

    def _made(self, name: str, *job: object) -> Path:
        made = self.scratch / name
        if not _job(environment(), *job, made):
            raise SystemExit(f"not measured: {name} could not be made")
        return made

    def rivals(self, case: Case) -> dict[Method, Found]:
        """Return what the peers found that have a surface, from the cache where it is there."""
        key = _digest(case.cloud.read_bytes() + case.reference.read_bytes() + str(PINS).encode())
        found = {peer: self._kept(peer, case, key) for peer in PEERS}
        return {peer: figures for peer, figures in found.items() if "cd" in figures}

    def _kept(self, peer: Method, case: Case, key: str) -> Found:
        """Return what a peer found; what failed is not kept, for it may not fail again."""
        kept = CACHE / "found" / f"{case.cloud.stem}-{key}-{peer.name}-{peer.depth}.json"
        if kept.exists() and not self.fresh:
            return Found(json.loads(kept.read_text()))
        found = self.scored(peer, case)
        if "cd" in found:
            kept.parent.mkdir(parents=True, exist_ok=True)
            kept.write_text(json.dumps(found))
        return found

    def scored(self, method: Method, case: Case, repeats: int = 0) -> Found:
        """Run a method, and score its surface; see `timed`."""
        run = self.timed(method, case.cloud, repeats)
        return Found(run | _job(environment(), "score", self._surface, case.reference)) if run else run

    def timed(self, method: Method, cloud: Path, repeats: int = 3) -> Found:
        """Run a method once for its surface and its peak of memory, then again for its median seconds."""
        python = Path(sys.executable) if method == TOMOMESH else environment()
        return _job(python, "reconstruct", *method, cloud, self._surface, repeats)

    @property
    def _surface(self) -> Path:
        return self.scratch / "surface.ply"


def _job(python: Path, *job: object) -> Found:
    """Run one job of peer.py; a failure is told, and finds nothing."""
    command = [str(part) for part in (python, Path(__file__).with_name("peer.py"), *job)]
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    if run.returncode:
        print(" ".join(command[2:]), run.stderr.strip().rpartition("\n")[2], sep=": ", file=sys.stderr)
        return Found()
    return Found(json.loads(run.stdout.splitlines()[-1]))


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()[:12]


def environment() -> Path:
    """Return the interpreter of the peers' environment, made on first use."""
    folder = CACHE / "environment"
    python, done = folder / "bin" / "python", folder / "pins.json"
    if not done.exists() or done.read_text() != json.dumps(PINS):
        print(f"installing the peers into {folder}", file=sys.stderr)
        venv.create(folder, clear=True, with_pip=True)
        subprocess.run([python, "-m", "pip", "install", "-qq", *PINS], check=True)
        done.write_text(json.dumps(PINS))
    return python
