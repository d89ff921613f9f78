"""How does tomomesh stand against its peers on clouds: Open3D, PyMeshLab and VTK.

The peers are run at every depth, and the best of them counts. Their environment is made on first use.
"""

from __future__ import annotations

import argparse
import tempfile
from math import log
from pathlib import Path
from statistics import linear_regression, median
from typing import TYPE_CHECKING, NamedTuple

from arena import PINS, TOMOMESH, Arena, Case, Method, environment
from bench import SHARED, at_least, at_most, header, holds, note

if TYPE_CHECKING:
    from arena import Found

DATA = SHARED / "data"
CLOUDS = DATA / "clouds"


class Shape(NamedTuple):
    """A closed mesh, its genus, and what its marks allow: cd over the best peer's, handles lost in noise."""

    file: str
    genus: int
    clean: float = 0.75
    handles: int = 0

    @property
    def path(self) -> Path:
        return DATA / self.file


SHAPES = {
    "rocker-arm": Shape("common3d/rocker-arm.obj", 1),
    "fandisk": Shape("common3d/fandisk.obj", 0),
    "bunny": Shape("odedstein/bunny/bunny.obj", 0),
    "cat": Shape("odedstein/cat/cat-low-resolution.obj", 0),
    "wingnut": Shape("odedstein/wingnut/wingnut.obj", 0),
    "torus": Shape("odedstein/torus/torus.obj", 1),
    "skull": Shape("odedstein/skull/skull_low_resolution.obj", 2, clean=1, handles=1),
}
ROCKER_ARM = SHAPES["rocker-arm"].path

SCANS = {"00010009": 0, "00010045": 5, "00010071": 1, "00010089": 0}
"""The scans by the start of their names, and their genus."""

BUNNY = (
    0.201887, -0.289068, 0.539935, -0.001121,
    -0.143433, -0.575019, -0.254220, -0.001123,
    0.595413, -0.040506, -0.244317, 0.001200,
)  # fmt: skip
"""From the bunny's mesh to its noisy cloud, by rows: a rotation, a scale and a shift, found by registration. What
is left between them is normal, sigma 0.56 % of the diagonal, to the 99th percentile: they are one bunny."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("sections", nargs="*", help=f"of {', '.join(SECTIONS)}; all but {', '.join(LARGE)} if none")
    parser.add_argument("--fresh", action="store_true", help="run the peers anew, whatever the cache holds")
    args = parser.parse_args()
    if unknown := set(args.sections) - set(SECTIONS):
        parser.error(f"no section: {', '.join(sorted(unknown))}")
    if not DATA.exists():
        raise SystemExit("not measured: there is no shared data beside the project")
    environment()
    header("Clouds to surfaces, against " + ", ".join(pin.replace("==", " ") for pin in PINS))
    with tempfile.TemporaryDirectory() as folder:
        arena = Arena(Path(folder), fresh=args.fresh)
        arena.timed(TOMOMESH, arena.drawn(ROCKER_ARM).cloud, repeats=0)  # its kernels are compiled now
        for section in args.sections or [name for name in SECTIONS if name not in LARGE]:
            SECTIONS[section](arena)


class Meeting(NamedTuple):
    """What tomomesh found on a cloud, over the marks that the best peers set there."""

    found: Found
    cd: float
    nc: float


def _meet(arena: Arena, name: str, case: Case) -> Meeting:
    """Run tomomesh where the peers were run, and print how near each comes to the reference."""
    found, rivals = arena.scored(TOMOMESH, case), arena.rivals(case)
    best = min(rivals, key=lambda peer: rivals[peer]["cd"])
    note(f"{name}: cd", f"{found['cd']:.3f}; {best} {rivals[best]['cd']:.3f}")
    nc = max(abs(figures["nc"]) for figures in rivals.values())
    return Meeting(found, found["cd"] / rivals[best]["cd"], found["nc"] - nc)


def _clean(arena: Arena) -> None:
    for shape_name, shape in SHAPES.items():
        name = f"{shape_name}, clean"
        met = _meet(arena, name, arena.drawn(shape.path))
        _whole(name, met.found, shape.genus)
        _closed(name, met.found)
        at_most(f"{name}: self-intersections", met.found["selfx"], 0)
        at_most(f"{name}: cd over the best peer's", met.cd, shape.clean)
        at_least(f"{name}: nc beyond the best peer's", met.nc, 0)


def _noise(arena: Arena) -> None:
    for shape_name, shape in SHAPES.items():
        name = f"{shape_name}, noise 0.3 %"
        met = _meet(arena, name, arena.drawn(shape.path, noise=0.003))
        _whole(name, met.found, shape.genus, shape.handles)
        holds(f"{name}: outward", met.found["nc"] > 0)
        at_most(f"{name}: cd over the best peer's", met.cd, 0.95)


def _contours(arena: Arena) -> None:
    case = Case(CLOUDS / "contours" / "torus_sphere_5to1.xyz", arena.reference("make_solids"))
    for peer, rival in arena.rivals(case).items():
        note(f"contours, {peer}: components, genus, open edges, volume off", _solids(rival))
    found = arena.scored(TOMOMESH, case)
    note("contours: components, genus, open edges, volume off", _solids(found))
    holds("contours: a torus and a ball", (found["components"], found["genus"]) == (2, 1))
    _closed("contours", found)
    at_most("contours: volume off", 100 * abs(found["volume"]), 2.5, "%")


def _solids(found: Found) -> str:
    return f"{found['components']:.0f}, {found['genus']:g}, {found['boundary']:.0f}, {100 * found['volume']:.1f} %"


def _scans(arena: Arena) -> None:
    right = 0
    for name, genus in SCANS.items():
        (reference,) = (CLOUDS / "ppsurf_abc" / "03_meshes").glob(f"{name}*.ply")
        cloud = CLOUDS / "ppsurf_abc" / "04_pts_vis" / f"{reference.stem}.xyz.ply"
        met = _meet(arena, f"scan {name}", Case(cloud, reference))
        note(f"scan {name}: components, genus", f"{met.found['components']:.0f}, {met.found['genus']:g} of {genus}")
        right += met.found["genus"] == genus
        _closed(f"scan {name}", met.found)
        at_most(f"scan {name}: cd over the best peer's", met.cd, 1)
    at_least("scans of the right genus", right, 3)


def _bunny(arena: Arena) -> None:
    reference = arena.reference("place", SHAPES["bunny"].path, *BUNNY)
    met = _meet(arena, "noisy bunny", Case(CLOUDS / "wnnc" / "bunny_noised.xyz", reference))
    _whole("noisy bunny", met.found, 0)
    _closed("noisy bunny", met.found)
    at_most("noisy bunny: cd over the best peer's", met.cd, 1)


def _outliers(arena: Arena) -> None:
    for name in ("rocker-arm", "cat"):
        shape = SHAPES[name]
        without, found = (arena.scored(TOMOMESH, arena.drawn(shape.path, outliers=share)) for share in (0, 0.02))
        at_most(f"{name}, 2 % outliers: genus changed", abs(found["genus"] - without["genus"]), 0)
        at_most(f"{name}, 2 % outliers: cd over that without", found["cd"] / without["cd"], 1.2)


def _whole(name: str, found: Found, genus: int, handles: int = 0) -> None:
    at_most(f"{name}: components", found["components"], 1)
    at_most(f"{name}: handles wrong", abs(found["genus"] - genus), handles)


def _closed(name: str, found: Found) -> None:
    faults = sum(found[f"{weld}{kind}"] for weld in ("", "welded_") for kind in ("boundary", "nonmanifold"))
    at_most(f"{name}: boundary and non-manifold edges, welded too", faults, 0)
    holds(f"{name}: outward", found["nc"] > 0)


def _speed(arena: Arena) -> None:
    ratios = [_race(arena, name, shape) for name, shape in SHAPES.items()]
    for peer, mark, times in zip(RACE, RACE.values(), zip(*ratios, strict=True), strict=True):
        at_least(f"rocker-arm, clean: tomomesh against {peer}", times[0], mark, "x")
        note(f"median of the clean shapes: tomomesh against {peer}", f"{median(times):.3g} x")


RACE = {Method("pymeshlab", 9): 10.0, Method("pymeshlab", 7): 3.0}
"""How many times as fast as a peer one should be."""


def _race(arena: Arena, name: str, shape: Shape) -> list[float]:
    """Time tomomesh and its peers on one shape; return how many times as fast it is."""
    case = arena.drawn(shape.path)
    runs = {method: arena.timed(method, case.cloud) for method in (TOMOMESH, *RACE)}
    for method, run in runs.items():
        note(f"{name}, clean: {method}", f"{run['seconds']:.3g} s, {run['peak_mib']:.0f} MiB")
    return [runs[peer]["seconds"] / runs[TOMOMESH]["seconds"] for peer in RACE]


def _million(arena: Arena) -> None:
    case, peer = arena.drawn(ROCKER_ARM, 1_000_000), Method("pymeshlab", 10)
    found, rival = (arena.scored(method, case, repeats=3) for method in (TOMOMESH, peer))
    for method, run in ((TOMOMESH, found), (peer, rival)):
        note(f"1,000,000 points: {method}", f"{run['seconds']:.3g} s, {run['peak_mib']:.0f} MiB, cd {run['cd']:.3f}")
    _whole("1,000,000 points", found, 1)
    at_least(f"1,000,000 points: tomomesh against {peer}", rival["seconds"] / found["seconds"], 10, "x")
    at_most("1,000,000 points: peak of memory", found["peak_mib"] / 1024, 1.5, "GiB")
    at_most(f"1,000,000 points: cd over that of {peer}", found["cd"] / rival["cd"], 0.65)


def _growth(arena: Arena) -> None:
    sizes = (100_000, 300_000, 1_000_000, 3_000_000, 10_000_000)
    runs = [arena.timed(TOMOMESH, arena.drawn(ROCKER_ARM, size).cloud) for size in sizes]
    for size, run in zip(sizes, runs, strict=True):
        note(f"{size:,} points", f"{run['seconds']:.3g} s, {run['peak_mib']:.0f} MiB")
    times = [log(run["seconds"]) for run in runs]
    at_most("time grows as the points to the power", linear_regression([log(size) for size in sizes], times).slope, 1.1)
    at_most("10,000,000 points: peak of memory", runs[-1]["peak_mib"] / 1024, 10, "GiB")


SECTIONS = {
    "clean": _clean,
    "noise": _noise,
    "contours": _contours,
    "scans": _scans,
    "bunny": _bunny,
    "outliers": _outliers,
    "speed": _speed,
    "million": _million,
    "growth": _growth,
}
LARGE = ("million", "growth")
"""Sections that run only where they are named."""


if __name__ == "__main__":
    main()
