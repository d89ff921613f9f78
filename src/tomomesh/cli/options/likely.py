"""What was likely meant by what was typed: an option, a command, a file of another command."""

from __future__ import annotations

from difflib import get_close_matches
from pathlib import Path
from typing import TYPE_CHECKING

from ...errors import FormatError
from .formats import CHECKED_FORMATS, CLOUD_FORMATS, HEADER_FORMATS, STUDY_FORMATS, TILE_FORMATS

if TYPE_CHECKING:
    from argparse import Namespace
    from collections.abc import Collection

USUAL = {
    "lower": ("threshold", "iso", "isovalue", "isolevel", "iso-value", "level-set", "min", "hu", "low", "lt", "window"),
    "upper": ("max", "high", "ht"),
    "preset": ("tissue",),
    "smooth": ("smoothing", "smooth-iterations", "sigma", "laplacian", "taubin"),
    "target-faces": (
        "decimate",
        "decimation",
        "decimate-ratio",
        "simplify",
        "faces",
        "n-faces",
        "num-faces",
        "max-faces",
        "triangles",
        "reduce",
        "reduction",
        "target-reduction",
    ),
    "labels-in": ("seg", "seg-file", "segmentation", "labelmap", "mask", "mask-in"),
    "select": ("label", "labels-list", "organ", "segment", "segment-number", "roi-number", "roi-subset"),
    "structure": ("organ", "roi-name", "contour"),
    "output": ("out", "outfile", "output-file", "output-dir", "save", "destination"),
    "cell": ("voxel-size", "voxelsize", "resolution", "grid", "pitch"),
    "keep": ("keep-largest", "largest-component", "lcc", "remove-islands", "islands", "min-size"),
    "drop-at": ("remove-component", "exclude", "erase"),
    "fill-holes": ("close-holes", "hole-size", "fill"),
    "edge": ("edge-length", "mesh-size", "max-edge"),
    "threads": ("jobs", "cores", "n-jobs"),
    "neurons": ("nodes", "n-neurons"),
    "epochs": ("iter", "n-iter"),
    "seed": ("random-state", "random-seed"),
    "spacing": ("pixel-size", "voxel-spacing", "spacing-xy", "spacing-x", "spacing-y"),
    "series": ("series-number", "series-id", "series-uid"),
    "slices": ("axis", "plane", "orientation"),
    "report": ("log", "stats"),
    "quiet": ("q", "silent"),
}
"""Options by which other programs call what ours do."""
SEVERAL = ("--workers", "--scheduler", "--slab")
"""Options of a study larger than the memory that a cloud has not: one process takes it, for any limit."""
COMMANDS = {
    "reconstruct": ("convert", "mesh", "run", "extract", "marching-cubes", "volume", "isosurface", "dicom2stl"),
    "surface": ("points", "cloud", "poisson", "pointcloud"),
    "check": ("validate", "verify", "quality", "stats"),
    "inspect": ("info", "show", "view", "list", "header"),
    "network": ("som", "train"),
    "print": ("hollow", "repair"),
}
"""Commands that other programs have for what ours do."""
STUDIES = {f".{name}" for name in (*STUDY_FORMATS, *HEADER_FORMATS)}
CLOUDS = {f".{name}" for name in CLOUD_FORMATS}
MESHES = {f".{name}" for name in CHECKED_FORMATS}
KINDS = {
    "reconstruct": ("study", STUDIES), "segment": ("study", STUDIES), "inspect": ("study", STUDIES),
    "surface": ("cloud", CLOUDS), "check": ("mesh", MESHES), "print": ("mesh", MESHES),
}  # fmt: skip
"""Command to the argument that it reads, and the kinds of file that it can."""


def likely_option(word: str, known: Collection[str]) -> str:
    """Return the option that was likely meant by one that there is not, given all that there are; "" where none is."""
    name = word.partition("=")[0].lstrip("-").replace("_", "-")
    usual = [option for option, others in USUAL.items() if name in others]
    near = get_close_matches(name, [option.lstrip("-") for option in known], 1, 0.7)
    return next((f"--{option}" for option in (*usual, *near) if f"--{option}" in known), "")


def likely_instead(word: str, known: Collection[str]) -> str:
    """Return what a command has in place of an option of another's, given all that it has; "" where it has nothing."""
    return (
        "--memory SIZE, as 4GB: one process takes the cloud"
        if word.partition("=")[0] in SEVERAL and "--memory" in known
        else ""
    )


def likely_output(words: Collection[str]) -> str:
    """Return the option for a mesh that is named last, where no output is; "" where no mesh is."""
    last = [*words][-1]
    return f"-o {last}" if Path(last).suffix.lower() in MESHES and not _is_there(last) else ""


def likely_command(word: str, known: Collection[str]) -> str:
    """Return the command line that was likely meant by a word that is no command; "" where none is."""
    if _is_there(word):
        suffix = _suffix_of(word)
        command = "surface" if suffix in CLOUDS - STUDIES - MESHES else "check" if suffix in MESHES else "reconstruct"
        return f"tomomesh {command} {word}" + ("" if command == "check" else " -o mesh.stl")
    usual = [command for command, others in COMMANDS.items() if word.lower() in others]
    near = get_close_matches(word.lower(), [*known], 1, 0.6)
    return f"tomomesh {(usual or near)[0]}" if usual or near else ""


def require_kind(chosen: Namespace) -> None:
    """Refuse a file that another command reads, naming it.

    Raises
    ------
    FormatError
    """
    argument, own = KINDS.get(chosen.command, ("", set()))
    path = getattr(chosen, argument, None)
    if not isinstance(path, str) or not _is_there(path):
        return
    is_folder = Path(path).is_dir()
    suffix = _of_folder(path) if chosen.command == "surface" and is_folder else _suffix_of(path)
    if suffix == ".dcm" and not is_folder:
        return  # it may hold contours
    other = _reading(suffix) if suffix not in own else ""
    if other:
        raise FormatError(
            f"`tomomesh {chosen.command}` does not read such a file", file=path,
            found="a folder" if is_folder else f"suffix = {suffix}",
            hint=f"tomomesh {other} {path}" + ("" if other == "check" else " -o mesh.stl"),
        )  # fmt: skip


def _of_folder(path: str) -> str:
    """Return the kind of the files in a folder: tiles of a cloud, else slices."""
    kinds = {f".{name}" for name in TILE_FORMATS}
    return next((kind for kind in map(_suffix_of, map(str, Path(path).iterdir())) if kind in kinds), ".dcm")


def _is_there(path: str) -> bool:
    """Tell whether a path leads to something that may be looked at."""
    try:
        Path(path).stat()
    except (OSError, ValueError):
        return False
    return True


def _suffix_of(path: str) -> str:
    from ...io.files.source import suffix_of  # which NumPy comes with: `--help` has no need of it

    return suffix_of(path)


def _reading(suffix: str) -> str:
    """Return the command that reads a kind of file; "" where none does."""
    return next((name for name in ("reconstruct", "surface", "check") if suffix in KINDS[name][1]), "")
