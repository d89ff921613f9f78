"""The house is as it is said to be: its rooms, their sizes and names, and every name in the pages and docstrings.

ARCHITECTURE.md draws the tree in an indented block that begins with the line ``src/tomomesh/``. Below it each level is
indented by two spaces more. A line is a folder, which ends in ``/``, or one or several modules with single spaces
between them; what they hold follows after two spaces at least. ``__init__`` and ``__main__`` may be left out. The block
ends at the first line that is not indented deeper than ``src/tomomesh/``.
"""

from __future__ import annotations

import ast
import builtins
import inspect
import json
import keyword
import pkgutil
import re
import tomllib
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from hypothesis import settings as hypothesis_settings

import tomomesh
from tomomesh.settings import Settings

if TYPE_CHECKING:
    from collections.abc import Iterator

ROOT = Path(__file__).parents[1]
SOURCE = ROOT / "src" / "tomomesh"
MODULES = {path.relative_to(SOURCE).with_suffix("").as_posix(): path for path in sorted(SOURCE.rglob("*.py"))}
PAGES = [*(ROOT / name for name in ("README.md", "CONTRIBUTING.md", "ARCHITECTURE.md", "SECURITY.md"))]
PAGES += [ROOT / "CHANGELOG.md", ROOT / "findings" / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
PAGES += sorted((ROOT / "docs").glob("*.ipynb"))

IMPLIED = ("__init__", "__main__")
LONGEST, FULLEST = 300, 16
SAYING_NOTHING = {"utils", "util", "helpers", "common", "base", "core", "misc"}

DOTTED = re.compile(r"`([A-Za-z_]\w*(?:\.\w+)+)(?:\([^`]*\))?`")
PATHS = re.compile(r"`((?:[\w.-]+/)+(?:[\w-]+\.py)?)(?:: \w+)?`")
BARE = re.compile(r"`([A-Za-z_]\w*)(?:\([^`]*\))?`")
GONE = {"tomomesh.io.stated", "QuadMesh.cubes"}
"""Names that the changelog says are no more."""
FOREIGN = {
    "fastmath", "parallel",  # options of Numba
    "apply_rescale", "vtkContourFilter", "vtkFlyingEdges3D", "vtkMarchingCubes", "vtkSynchronizedTemplates3D",
    "AnatomicalOrientation", "CenterOfRotation", "thicknesses", "qfac",  # fields of formats
    "dev54_t1", "dev54_synth_t1", "visit2", "X_mm",  # of files
    "_NAME",  # an end of names
    "wall_p1_mm", "changed",  # a key with a number in it; what findings/run prints
}  # fmt: skip
"""What else stands between backticks alone in a page and is no name or word of ours."""
OTHER_FILES = re.compile(r"\.(html|json|csv|toml|gz|tif|stl|ply|npz|cff|txt)$")


@cache
def modules() -> dict[str, Any]:
    """Import every module but the program's first lines."""
    names = (found.name for found in pkgutil.walk_packages(tomomesh.__path__, "tomomesh."))
    return {name: import_module(name) for name in names if not name.endswith("__main__")}


@cache
def classes() -> dict[str, list[type]]:
    """Return our classes by their bare names."""
    found: dict[str, list[type]] = {}
    for name, module in modules().items():
        for one in vars(module).values():
            if inspect.isclass(one) and one.__module__ == name:
                found.setdefault(one.__name__, []).append(one)
    return found


def has(owner: Any, names: list[str]) -> bool:
    """Tell whether attributes of attributes exist; fields of a class count, what they hold does not matter."""
    if not names:
        return True
    if hasattr(owner, names[0]):
        return has(getattr(owner, names[0]), names[1:])
    annotated = inspect.isclass(owner) and any(names[0] in vars(c).get("__annotations__", {}) for c in owner.__mro__)
    return annotated and len(names) == 1


def is_ours(name: str, inside: str = "tomomesh") -> bool:
    """Tell whether a dotted name is found in a package or above it, or in a class of ours, or in the settings."""
    first, *rest = name.split(".")
    if first == "tomomesh":
        return found_from("tomomesh", rest)
    homes = [inside.rsplit(".", n)[0] for n in range(inside.count(".") + 1)]
    if any(found_from(home, [first, *rest]) for home in homes):
        return True
    return any(has(owner, rest) for owner in classes().get(first, [])) or has(Settings(), [first, *rest])


def found_from(home: str, names: list[str]) -> bool:
    """Tell whether a package has a module or a name, and that what follows."""
    for module_names in range(len(names), -1, -1):
        module = modules().get(".".join([home, *names[:module_names]]), tomomesh if home == "tomomesh" else None)
        if module is not None and (module is not tomomesh or module_names == 0):
            return has(module, names[module_names:])
    return False


def is_theirs(name: str) -> bool:
    """Tell whether a dotted name is found in another library, or in Python."""
    first, *rest = name.split(".")
    if hasattr(builtins, first):
        return has(getattr(builtins, first), rest)
    try:
        return has(import_module(first), rest) or bool(import_module(name))
    except ImportError:
        return False


def is_key(name: str) -> bool:
    """Tell whether the page on the report has a row for a key, alone or under its section."""
    page = (ROOT / "docs" / "report.md").read_text(encoding="utf-8")
    rows = {key for cell in re.findall(r"^\| *([^|]*)", page, re.MULTILINE) for key in re.findall("`([^`]+)`", cell)}
    section, _, key = name.partition(".")
    return name in rows or (key in rows and any(row.startswith(f"{section}.") for row in rows))


def text_of(page: Path) -> str:
    """Return what a page says of the present: of a changelog what is added and changed, of a notebook its prose."""
    text = page.read_text(encoding="utf-8")
    if page.suffix == ".ipynb":
        return "\n".join("".join(cell["source"]) for cell in json.loads(text)["cells"] if cell["cell_type"] != "code")
    if page.name == "CHANGELOG.md":
        return "".join(re.findall(r"^### (?:Added|Changed)\n(.*?)(?=^##)", text, re.MULTILINE | re.DOTALL))
    return text


@cache
def bare_names() -> set[str]:
    """Return the names of modules, functions, classes, parameters and fields, and every whole text."""
    found = set[str]()
    for name, path in MODULES.items():
        found |= set(name.split("/"))
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.FunctionDef | ast.ClassDef):
                found.add(node.name)
            elif isinstance(node, ast.arg):
                found.add(node.arg)
            elif isinstance(node, ast.Constant) and isinstance(node.value, str):
                found.add(node.value)
            elif isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
                found.add(node.target.id)
    return found


def docstrings(tree: ast.Module) -> Iterator[tuple[str, set[str]]]:
    """Yield every docstring, and every text under a constant, with the parameters that are known there."""
    for node in ast.walk(tree):
        body = getattr(node, "body", None)
        arguments = {a.arg for a in ast.walk(node) if isinstance(a, ast.arg)} if hasattr(node, "args") else set()
        for line in body if isinstance(body, list) else []:
            if (
                isinstance(line, ast.Expr)
                and isinstance(line.value, ast.Constant)
                and isinstance(line.value.value, str)
            ):
                yield line.value.value, arguments


def drawn(page: str) -> set[str]:
    """Return the modules of the tree in the page on the architecture, by their paths."""
    lines = page.split("\n")
    first = next(n for n, line in enumerate(lines) if line.strip() == "src/tomomesh/")
    margin, folders, found = len(lines[first]) - len(lines[first].lstrip()), [""], set()
    for line in lines[first + 1 :]:
        deep = (len(line) - len(line.lstrip()) - margin) // 2
        if not line.strip() or deep < 1:
            break
        names, folders = re.split(r" {2,}", line.strip())[0].split(" "), folders[:deep]
        if names[0].endswith("/"):
            folders.append(folders[-1] + names[0])
        else:
            found |= {folders[-1] + name.removesuffix(".py") for name in names}
    return found


class TestRooms:
    def test_the_tree_lists_every_module_and_no_other(self) -> None:
        there = {name for name in MODULES if name.rpartition("/")[2] not in IMPLIED}
        listed = {name for name in drawn(PAGES[2].read_text(encoding="utf-8")) if name not in IMPLIED}
        assert sorted(there - listed) == sorted(listed - there) == []

    @pytest.mark.parametrize("name", MODULES)
    def test_a_module_is_short_and_its_name_says_what_it_holds(self, name: str) -> None:
        assert len(MODULES[name].read_text(encoding="utf-8").splitlines()) <= LONGEST
        assert SAYING_NOTHING.isdisjoint(name.split("/"))

    @pytest.mark.parametrize("folder", sorted({path.parent for path in MODULES.values()}), ids=lambda f: f.name)
    def test_a_folder_has_sixteen_modules_at_most(self, folder: Path) -> None:
        assert len([path for path in folder.glob("*.py") if path.stem not in IMPLIED]) <= FULLEST


def test_the_drawing_of_the_layers_is_what_is_checked() -> None:
    page = PAGES[2].read_text(encoding="utf-8").partition("## Who may import whom\n\n")[2]
    (drawing,) = re.findall(r"\A((?: {4}.*\n)+)", page)
    tools = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]
    (layers,) = (one["layers"] for one in tools["importlinter"]["contracts"] if one["name"] == "One direction")
    checked = [named(layer.replace("tomomesh.", "")) for layer in layers]
    assert [named(layer) for layer in drawing.split("->")] == checked


def named(layer: str) -> set[str]:
    return {name.strip() for name in layer.split("|")}


class TestNames:
    @pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
    def test_what_a_page_names_is_there(self, page: Path) -> None:
        names = {name for name in DOTTED.findall(text_of(page)) if not OTHER_FILES.search(name)} - GONE
        files = {name for name in names if name.endswith((".py", ".md"))}
        lost = {name for name in files if not any(ROOT.rglob(name))}
        code = {name for name in names - files if not is_key(name)}
        assert sorted(lost | {name for name in code if not (is_ours(name) or is_theirs(name))}) == []

    @pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
    def test_what_a_page_names_without_its_module_is_there(self, page: Path) -> None:
        names = set(BARE.findall(text_of(page))) - bare_names() - FOREIGN
        lost = {name for name in names if not (is_key(name) or hasattr(builtins, name) or keyword.iskeyword(name))}
        assert sorted(lost) == []

    def test_names_that_are_no_more_are_found_out(self) -> None:
        assert not any(is_ours(name) or is_theirs(name) for name in GONE)
        assert bare_names().isdisjoint({"voxelwise", "studywise", "networkwise", *FOREIGN})
        assert {"voxels", "surface_near_points", "LevelCrossings", "stiffness"} <= bare_names()

    def test_what_the_notebook_imports_is_there(self) -> None:
        (page,) = (page for page in PAGES if page.suffix == ".ipynb")
        cells = json.loads(page.read_text(encoding="utf-8"))["cells"]
        code = [ast.parse("".join(cell["source"])) for cell in cells if cell["cell_type"] == "code"]
        taken = [node for cell in code for node in ast.walk(cell) if isinstance(node, ast.ImportFrom)]
        names = [f"{node.module}.{name.name}" for node in taken for name in node.names]
        assert len([name for name in names if name.startswith("tomomesh.")]) > 10
        assert [name for name in names if not (is_ours(name) or is_theirs(name))] == []

    @pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
    def test_where_a_page_points_to_is_there(self, page: Path) -> None:
        found = PATHS.findall(text_of(page))
        assert [path for path in found if not ((ROOT / path).exists() or (SOURCE / path).exists())] == []

    @pytest.mark.parametrize("name", MODULES)
    def test_what_a_docstring_names_is_there(self, name: str) -> None:
        home, lost = ".".join(["tomomesh", *name.split("/")[:-1]]), set()
        for text, arguments in docstrings(ast.parse(MODULES[name].read_text(encoding="utf-8"))):
            names = {*DOTTED.findall(text), *re.findall(r"\btomomesh(?:\.\w+)+", text)} if text else set()
            code = {n for n in names if not OTHER_FILES.search(n) and n.split(".")[0] not in arguments}
            lost |= {n for n in code if not (is_ours(n, home) or is_theirs(n))}
        assert sorted(lost) == []


def test_no_law_asserts_time() -> None:
    assert hypothesis_settings().deadline is None
    tests = [path for path in sorted(Path(__file__).parent.glob("*.py")) if path.name != "conftest.py"]
    calls = (node for path in tests for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))))
    assert not [node.lineno for node in calls if isinstance(node, ast.keyword) and node.arg == "deadline"]
