"""Change the program in one place at a time, and see whether its tests notice.

    python benchmarks/mutants.py [--area networks ...] [--count 20] [--seed 0] [--folder DIR]

A mutant is a copy of the program with one small fault: a comparison turned, a sign, a constant half as large again, a
`not` dropped, an `and` for an `or`, a statement left out. Those of a seed are drawn evenly from an area's modules, and
each is shown to the tests that are there for the area: first those that name the module, then the others, the quick
ones first. A test that fails has killed it, or work that takes twice as long as without a fault and ten CPU seconds
more. All that lies in an error's message, a type or a docstring stays as it is. Kernels are compiled once, in a cache
of the copy's own; a mutant of a kernel runs in plain Python, where some files of tests are left out.
"""

from __future__ import annotations

import argparse
import ast
import os
import pkgutil
import random
import resource
import shutil
import sys
import tempfile
import time
from collections import Counter
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
from importlib import import_module
from multiprocessing import get_context
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from collections.abc import Iterator

ROOT = Path(__file__).parents[1]
AREAS: dict[str, tuple[list[str], str]] = {
    "networks": (["som/*.py", "kernels/som/*.py"],
        "twins_som laws_networks laws_tiles som_measures som_training som_topologies som_estimator laws_lines "
        "several_contours"),
    "cuberille": (["cuberille/*.py", "kernels/cuberille/*.py"],
        "laws_bitmasks laws_cubes laws_tracker laws_faces laws_shell twins_geometry laws_spacing laws_surface laws_fit "
        "forecast two_walls"),
    "dynamics": (["dynamics/*.py", "kernels/dynamics/*.py"],
        "twins_dynamics laws_fit laws_rest collapse laws_attributes laws_surface convergence space voxels sheet "
        "clouds ways"),
    "points": (["segmentation/sample.py", "pointcloud/*.py", "kernels/pointcloud/*.py"],
        "twins_points laws_clouds laws_spacing laws_attributes laws_tiles laws_lines laws_surface laws_matching "
        "convergence open sheet clouds forecast two_walls ways end_to_end"),
    "frames": (["io/frames.py", "io/volumes/affine.py", "model/volume.py"],
        "volume io_nifti_pairs places frames io_nifti io_nrrd io_metaimage io_outputs io_agreement"),
}  # fmt: skip
TURNED: dict[type[ast.AST], Any] = {
    ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt, ast.Eq: ast.NotEq, ast.NotEq: ast.Eq,
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult, ast.Pow: ast.Mult, ast.Mod: ast.Mult,
    ast.BitAnd: ast.BitOr, ast.BitOr: ast.BitAnd, ast.LShift: ast.RShift, ast.RShift: ast.LShift,
    ast.And: ast.Or, ast.Or: ast.And, ast.Is: ast.IsNot, ast.IsNot: ast.Is,
}  # fmt: skip
OPPOSITE: dict[type[ast.AST], Any] = {ast.Lt: ast.Gt, ast.Gt: ast.Lt, ast.LtE: ast.GtE, ast.GtE: ast.LtE}
SILENT = (ast.Raise, ast.JoinedStr, ast.Import, ast.ImportFrom)
BEFORE = ("numba", "scipy.spatial", "scipy.stats", "trimesh", "nibabel", "pydicom", "skimage.measure", "matplotlib")
"""Libraries that are imported once, for all mutants."""
LONG = {"laws_surface", "convergence", "two_walls", "ways", "forecast", "end_to_end", "several_contours"}
"""Files of tests that take too long in plain Python."""
PATIENCE, LEAST_S = 2, 10
ALWAYS = ("-x", "-q", "-p", "no:cacheprovider", "-n0", "--no-header")


@dataclass(frozen=True)
class Mutant:
    """A place in a module, and what stands there instead."""

    path: Path
    node: ast.expr | ast.stmt
    after: str

    @property
    def module(self) -> str:
        """Return the dotted name of the module."""
        return ".".join(self.path.relative_to("src").with_suffix("").parts)

    @property
    def plain(self) -> bool:
        """Tell whether it runs in plain Python."""
        return "kernels" in self.path.parts

    def source(self) -> str:
        """Return the whole module with its fault."""
        lines = (ROOT / self.path).read_bytes().splitlines(keepends=True)
        first, last = self.node.lineno - 1, (self.node.end_lineno or 0) - 1
        head, tail = lines[first][: self.node.col_offset], lines[last][self.node.end_col_offset :]
        after = f"({self.after})" if isinstance(self.node, ast.expr) else self.after
        return b"".join([*lines[:first], head, after.encode(), tail, *lines[last + 1 :]]).decode()

    def __str__(self) -> str:
        where = f"{self.path.relative_to('src/tomomesh')}:{self.node.lineno}"
        return f"{where}: {ast.unparse(self.node)[:70]} -> {self.after[:70]}"


def faults(node: ast.AST) -> Iterator[ast.AST]:
    """Yield what may stand instead of a node."""
    match node:
        case ast.Compare(ops=[op]):
            kinds = [table[type(op)] for table in (TURNED, OPPOSITE) if type(op) in table]
            yield from (ast.Compare(node.left, [kind()], node.comparators) for kind in kinds)
        case ast.BinOp(op=op) if type(op) in TURNED:
            yield ast.BinOp(node.left, TURNED[type(op)](), node.right)
        case ast.BoolOp(op=op):
            yield ast.BoolOp(TURNED[type(op)](), node.values)
        case ast.UnaryOp(op=ast.Not() | ast.USub() | ast.Invert()):
            yield node.operand
        case ast.Constant(value=bool(value)):
            yield ast.Constant(not value)
        case ast.Constant(value=int(value)):
            yield ast.Constant(value + 1)
        case ast.Constant(value=float(value)):
            yield ast.Constant(value * 1.5 or 0.5)
        case ast.AugAssign() | ast.Expr(value=ast.Call()):
            yield ast.Pass()


def read(node: ast.AST) -> Iterator[ast.AST]:
    """Yield a node and those under it that are run, outside of messages and types."""
    if isinstance(node, SILENT) or (isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test)):
        return
    yield node
    for name, value in ast.iter_fields(node):
        if name not in ("annotation", "returns", "decorator_list"):
            for child in value if isinstance(value, list) else [value]:
                yield from read(child) if isinstance(child, ast.AST) else ()


def mutants(area: str) -> list[Mutant]:
    """Return all mutants of an area's modules, in order."""
    home = ROOT / "src" / "tomomesh"
    paths = sorted({path for pattern in AREAS[area][0] for path in home.glob(pattern)})
    return [
        Mutant(path.relative_to(ROOT), node, ast.unparse(other))
        for path in paths
        for node in read(ast.parse(path.read_bytes()))
        for other in faults(node)
        if isinstance(node, (ast.expr, ast.stmt))
    ]


def prepare(copy: Path) -> None:
    """Import the kernels of the copy, and what else no mutant changes, once for all forks."""
    os.environ |= {"XDG_CACHE_HOME": str(copy / "cache"), "PYTHONPATH": str(copy / "src")}
    sys.path.insert(0, str(copy / "src"))
    for name in BEFORE:
        import_module(name)
    kernels = import_module("tomomesh.kernels")
    for module in pkgutil.walk_packages(kernels.__path__, "tomomesh.kernels."):
        import_module(module.name)


def run(copy: Path, names: list[str], plain: bool, most_s: int) -> None:
    """Run files of tests in this process, a fork that knows of the program at most its kernels, and end it."""
    resource.setrlimit(resource.RLIMIT_CPU, (most_s, most_s))
    if plain:
        os.environ["NUMBA_DISABLE_JIT"] = "1"
        import_module("numba.core.config").reload_config()
        for name in [name for name in sys.modules if name.startswith("tomomesh")]:
            del sys.modules[name]
    os.chdir(copy)
    with Path(os.devnull).open("w") as nothing, redirect_stdout(nothing), redirect_stderr(nothing):
        os._exit(pytest.main([*ALWAYS, *(f"tests/test_{name}.py" for name in names)]))


def passes(copy: Path, names: list[str], plain: bool, most_s: int = resource.RLIM_INFINITY) -> bool:
    """Tell whether a fork that runs files of tests ends without a fault, in so many seconds of work."""
    child = get_context("fork").Process(target=run, args=(copy, names, plain, most_s))
    child.start()
    child.join()
    return child.exitcode == 0


def shown(mutant: Mutant, area: str) -> list[str]:
    """Return an area's files of tests in the order that kills soonest; a kernel sees those that are short."""
    names = [name for name in AREAS[area][1].split() if not (mutant.plain and name in LONG)]
    return sorted(names, key=lambda name: mutant.module not in (ROOT / "tests" / f"test_{name}.py").read_text())


def judged(copy: Path, area: str, chosen: list[Mutant]) -> Iterator[tuple[Mutant, bool]]:
    """Yield each mutant, and whether it survives."""
    usual_s: dict[bool, int] = {}
    for stamp, mutant in enumerate(chosen, int(time.time())):
        plain, path, names = mutant.plain, copy / mutant.path, shown(mutant, area)
        if plain not in usual_s:
            began = work_s()
            if not passes(copy, names, plain):
                raise SystemExit(f"the tests of {area} fail without a fault (compiled: {not plain})")
            usual_s[plain] = work_s() - began
        path.write_text(mutant.source(), encoding="utf-8")
        os.utime(path, (stamp, stamp))  # Python tells an old module from a new one by seconds
        yield mutant, passes(copy, names, plain, PATIENCE * usual_s[plain] + LEAST_S)
        shutil.copy2(ROOT / mutant.path, path)


def work_s() -> int:
    """Return the CPU seconds of all forks so far."""
    return int(sum(resource.getrusage(resource.RUSAGE_CHILDREN)[:2]))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--area", nargs="*", choices=AREAS, default=list(AREAS))
    parser.add_argument("--count", type=int, default=20, help="mutants an area")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--folder", type=Path, help="where the copy stays, so that its kernels need no compiling again")
    chosen = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        copy = (chosen.folder or Path(temporary)) / ROOT.name
        shutil.copytree(ROOT, copy, ignore=shutil.ignore_patterns(".*", "__pycache__"), dirs_exist_ok=True)
        if not (shared := copy.parent / "shared").is_symlink():
            shared.symlink_to(ROOT.parent / shared.name)
        prepare(copy)
        for area in chosen.area:
            found, told = mutants(area), Counter[bool]()
            some = random.Random(chosen.seed).sample(found, min(chosen.count, len(found)))
            for mutant, lives in judged(copy, area, some):
                told[lives] += 1
                print("SURVIVED" if lives else "killed  ", mutant, flush=True)
            print(f"{area}: {told[False]} of {told.total()} killed, of {len(found)} that there are\n", flush=True)


if __name__ == "__main__":
    main()
