"""Change the program in one place at a time, and see whether its tests notice.

    python benchmarks/mutants.py [--area networks ...] [--count 20] [--seed 0] [--folder DIR]

A mutant is a copy of the program with one small fault: a comparison turned, a sign, a constant half as large again, a
`not` dropped, an `and` for an `or`, a statement left out. Those of a seed are drawn evenly from an area's modules, and
each is shown to the tests that are there for the area, the quick ones first. A test that fails, or that takes
ten times as long as without a fault, has killed it. All that lies in an error's message, a type or a docstring
stays as it is. Kernels are compiled once, in a cache of the copy's own; a mutant of a kernel runs in plain Python.
"""

from __future__ import annotations

import argparse
import ast
import os
import random
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
        "twins_som laws_networks som_measures som_training som_topologies som_estimator laws_lines several_contours"),
    "cuberille": (["cuberille/*.py", "kernels/cuberille/*.py"],
        "laws_cubes twins_geometry laws_faces laws_bitmasks laws_tracker laws_shell laws_surface laws_fit forecast"),
    "dynamics": (["dynamics/*.py", "kernels/dynamics/*.py"],
        "collapse laws_fit convergence laws_surface space voxels laws_attributes sheet clouds"),
    "points": (["segmentation/sample.py", "pointcloud/*.py", "kernels/pointcloud/*.py"],
        "laws_attributes convergence laws_lines laws_surface open sheet clouds forecast end_to_end"),
    "frames": (["io/**/frames.py", "io/**/affine.py"],
        "frames io_nifti_pairs places io_nifti io_nrrd io_metaimage io_outputs io_agreement"),
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
PATIENCE = 10
ALWAYS = ("-x", "-q", "-p", "no:cacheprovider", "-n0", "--no-header")


@dataclass(frozen=True)
class Mutant:
    """A place in a module, and what stands there instead."""

    path: Path
    node: ast.expr | ast.stmt
    after: str

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


def run(copy: Path, test: str, plain: bool) -> None:
    """Run a file of tests in this process, a fork that knows nothing of the program yet, and end it."""
    home = str(copy / "src")
    os.environ |= {"XDG_CACHE_HOME": str(copy / "cache"), "NUMBA_DISABLE_JIT": str(int(plain)), "PYTHONPATH": home}
    import_module("numba.core.config").reload_config()
    os.chdir(copy)
    sys.path.insert(0, home)
    with Path(os.devnull).open("w") as nothing, redirect_stdout(nothing), redirect_stderr(nothing):
        os._exit(pytest.main([*ALWAYS, test]))


def passes(copy: Path, area: str, *, plain: bool, most_s: float | None = None) -> bool:
    """Tell whether all tests of an area pass in time; those of kernels in plain Python are laws and twins."""
    names = [name for name in AREAS[area][1].split() if name.startswith(("laws", "twins")) or not plain]
    return all(ends_well((copy, f"tests/test_{name}.py", plain), most_s) for name in names)


def ends_well(what: tuple[Path, str, bool], most_s: float | None) -> bool:
    """Tell whether a fork that runs a file of tests ends in time, and without a fault."""
    child = get_context("fork").Process(target=run, args=what, daemon=True)
    child.start()
    child.join(most_s)
    child.kill()
    return child.exitcode == 0


def judged(copy: Path, area: str, chosen: list[Mutant]) -> Iterator[tuple[Mutant, bool]]:
    """Yield each mutant, and whether it survives."""
    usual: dict[bool, float] = {}
    for stamp, mutant in enumerate(chosen, int(time.time())):
        plain, path = "kernels" in mutant.path.parts, copy / mutant.path
        if plain not in usual:
            began = time.perf_counter()
            if not passes(copy, area, plain=plain):
                raise SystemExit(f"the tests of {area} fail without a fault (compiled: {not plain})")
            usual[plain] = time.perf_counter() - began
        path.write_text(mutant.source(), encoding="utf-8")
        os.utime(path, (stamp, stamp))  # Python tells an old module from a new one by seconds
        yield mutant, passes(copy, area, plain=plain, most_s=PATIENCE * usual[plain])
        shutil.copy2(ROOT / mutant.path, path)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--area", nargs="*", choices=AREAS, default=list(AREAS))
    parser.add_argument("--count", type=int, default=20, help="mutants an area")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--folder", type=Path, help="where the copy stays, so that its kernels need no compiling again")
    chosen = parser.parse_args()
    for name in BEFORE:
        import_module(name)
    with tempfile.TemporaryDirectory() as temporary:
        copy = (chosen.folder or Path(temporary)) / ROOT.name
        shutil.copytree(ROOT, copy, ignore=shutil.ignore_patterns(".*", "__pycache__"), dirs_exist_ok=True)
        if not (shared := copy.parent / "shared").is_symlink():
            shared.symlink_to(ROOT.parent / shared.name)
        for area in chosen.area:
            found, told = mutants(area), Counter[bool]()
            some = random.Random(chosen.seed).sample(found, min(chosen.count, len(found)))
            for mutant, lives in judged(copy, area, some):
                told[lives] += 1
                print("SURVIVED" if lives else "killed  ", mutant, flush=True)
            print(f"{area}: {told[False]} of {told.total()} killed, of {len(found)} that there are\n", flush=True)


if __name__ == "__main__":
    main()
