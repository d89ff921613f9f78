"""Build the parser from the table of settings. Imports nothing heavy, so that ``--help`` starts at once."""

from __future__ import annotations

import argparse
from dataclasses import fields
from textwrap import fill
from typing import TYPE_CHECKING, Any, NoReturn

from .. import __version__
from ..errors import UsageError
from ..settings import Settings, option_of, parameters
from ..ways import WAYS
from .faults import likely_command, likely_option
from .formats import (
    CHECKED,
    CLOUD,
    CLOUD_FORMATS,
    LABEL,
    MESH,
    MESH_FORMATS,
    POINT,
    POINT_FORMATS,
    STUDY,
    STUDY_FORMATS,
    STUDY_MESH,
    STUDY_MESH_FORMATS,
)
from .parameter_options import add_parameter

if TYPE_CHECKING:
    from collections.abc import Sequence

STAGE_ONE = ("read", "crop", "window", "network")
STAGE_TWO = ("cubes", "fit", "printing")
TOLD = ("completion", "man")
"""Commands that are made from this parser alone, and import nothing heavy either."""
SHELLS = ("bash", "zsh", "fish", "tcsh")


CUTS = ("scale", "flat_base", "one_piece", "fill_cavities", "thicken", "hollow", "drain")
"""Parameters that change a part."""
MESH_ONLY = ("local_origin", "smooth", "allow_far", "remesh", "edge", "target_faces")
"""Parameters of the run that matter to meshes alone."""
STUDY_ONLY = ("frame",)
"""Parameters of the run that matter to studies alone."""
SURFACE_ONLY = (
    "cell_mm", "cell_factor", "closing", "stacks", "largest", "allow_leaks", "surface", "low_pass", *MESH_ONLY,
)  # fmt: skip
"""Parameters that do not matter to the points."""


class _Parser(argparse.ArgumentParser):
    """A parser whose faults are tomomesh's own one-line errors, and that takes no abbreviations."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(allow_abbrev=False, **kwargs)
        self.commands: dict[str, argparse.ArgumentParser] = {}

    def error(self, message: str) -> NoReturn:
        """Raise instead of printing a page and leaving."""
        raise UsageError(message, hint=f"`{self.prog} --help`")

    def parse_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Parse; of an option or a command that there is not, say which was likely meant."""
        words = list(args or ())
        commands = [*self.commands]
        if words and not words[0].startswith("-") and words[0] not in commands:
            meant = likely_command(words[0], commands)
            raise UsageError(
                "there is no such command", found=words[0], expected=" | ".join(commands),
                hint=meant or f"`{self.prog} --help`",
            )  # fmt: skip
        found, unknown = self.parse_known_args(words, namespace)
        if unknown:
            own = self.commands[found.command]
            meant = likely_option(unknown[0], own._option_string_actions) if unknown[0].startswith("-") else ""
            given = unknown[0].partition("=")
            value = f"={given[2]}" if given[1] else "".join(f" {word}" for word in unknown[1:2])
            said = f"unrecognized arguments: {' '.join(unknown)}"
            raise UsageError(said, hint=f"{meant}{value}" if meant else f"`{own.prog} --help`")
        return found


def build_parser() -> argparse.ArgumentParser:
    """Return the parser of all commands."""
    parser = _Parser(
        prog="tomomesh",
        description="Slices or points in, a closed surface mesh with its proof out.",
        epilog="Exit codes: 0 ok, 2 usage, 3 not found, 4 bad file, 5 geometry needs a decision, 6 empty result, "
        "7 over a limit, 8 output not written, 9 internal check failed, 10 some studies of a batch failed, "
        "130 interrupted.",
    )
    parser.add_argument("--version", action="version", version=f"tomomesh {__version__}")
    commands = parser.add_subparsers(
        title="Commands", dest="command", required=True, metavar="COMMAND", parser_class=_Parser
    )

    demo = _command(commands, "demo", "the built-in head, everything it can show")
    demo.add_argument("-o", "--output", default="tomomesh-demo", metavar="FOLDER", help="default: %(default)s")
    _add_settings(demo, ("network", *STAGE_TWO, "run"), without=STUDY_ONLY)

    main = _command(commands, "reconstruct", "a study of slices in, a closed surface out", epilog=_ways("study"))
    _add_study(main)
    main.add_argument(
        "-o", "--output", required=True, metavar="MESH", help=f"{STUDY_MESH}, or - with --format; with --each, a folder"
    )
    _add_streams(main, STUDY_FORMATS, STUDY_MESH_FORMATS)
    _add_each(main)
    _add_outputs(main, "points", "labels", "mask_out", "figures").add_argument(
        "--patient", action="store_true", help="copy the patient's fields of a DICOM study into MESH.dcm"
    )
    _add_settings(main, (*STAGE_ONE, *STAGE_TWO, "run"))

    stage_one = _command(commands, "segment", "stage one alone: the neurons of all slices as points")
    _add_study(stage_one)
    stage_one.add_argument("-o", "--output", required=True, metavar="POINTS", help=f"{POINT}, or - with --format")
    _add_streams(stage_one, STUDY_FORMATS, POINT_FORMATS)
    _add_outputs(stage_one, "labels", "figures")
    _add_settings(stage_one, (*STAGE_ONE, "cubes", "run"), without=SURFACE_ONLY)

    in_short = "stages two and three alone: points in, a closed surface out"
    stage_two = _command(commands, "surface", in_short, epilog=_ways("points"))
    stage_two.add_argument("cloud", metavar="POINTS", help=f"{CLOUD}, or - with --input-format")
    stage_two.add_argument("-o", "--output", required=True, metavar="MESH", help=f"{MESH}, or - with --format")
    _add_streams(stage_two, CLOUD_FORMATS, MESH_FORMATS, usual="xyz")
    _add_outputs(stage_two, "figures")
    _add_settings(stage_two, ("cloud", *STAGE_TWO, "run"), without=STUDY_ONLY)

    network = _command(commands, "network", "one network on a test region or a picture, as the paper's Fig. 1 and 2")
    network.add_argument("region", metavar="REGION", help="square, triangle, cube, or one picture (PNG or TIFF)")
    network.add_argument("-o", "--output", default="tomomesh-network", metavar="FOLDER", help="default: %(default)s")
    network.add_argument("--film", action="store_true", help="write the training as an animated GIF too")
    _add_outputs(network)
    _add_settings(
        network, ("window", "network", "run"),
        without=(
            "slices", "way", "signal", "contours", "space", "select", "keep", "units", "precision", *MESH_ONLY,
            *STUDY_ONLY,
        ),
    )  # fmt: skip

    inspect = _command(commands, "inspect", "what is in a study: size, spacing, frame, gray levels, windows")
    inspect.add_argument(
        "study", metavar="STUDY", nargs="+", help=f"{STUDY}, or its slices one by one, or - with --input-format"
    )
    _add_streams(inspect, STUDY_FORMATS)
    inspect.add_argument("--json", action="store_true", help="print the findings as JSON")
    _add_settings(inspect, ("read", "crop"), paper=False)

    check = _command(commands, "check", "the quality report of any mesh")
    check.add_argument("mesh", metavar="MESH", help=CHECKED)
    check.add_argument(
        "--against", metavar="MESH|STUDY",
        help="what it should equal: a mesh, or the voxels of a window or of labels (--select) of a study; Dice's "
        "coefficient, and distances both ways",
    )  # fmt: skip
    check.add_argument(
        "--mesh-frame", choices=("lps", "ras", "voxel"),
        help="what the coordinates of MESH are in, where a study is beside it (default: as its file states, else lps)",
    )  # fmt: skip
    check.add_argument("--report", metavar="FILE.json", help="write the report")
    check.add_argument("--json", action="store_true", help="print the report as JSON")
    check.add_argument("--print", dest="print_check", action="store_true", help="tell whether it can be printed, too")
    _add_settings(
        check, ("read", "crop", "window", "printing"), without=(*CUTS, "print_check"),
        paper=False,
    )  # fmt: skip

    part = _command(commands, "print", "a closed mesh in, a part to print out: scaled, cut flat, hollowed")
    part.add_argument("mesh", metavar="MESH", help=CHECKED)
    part.add_argument("-o", "--output", required=True, metavar="MESH", help=MESH)
    part.add_argument("--report", metavar="FILE.json", help="write the report")
    part.add_argument("--json", action="store_true", help="print the report as JSON in place of the summary")
    part.add_argument("--quiet", action="store_true", help="print nothing but errors")
    _add_settings(
        part, ("printing", "run"), without=("seed", "print_check", *MESH_ONLY, *STUDY_ONLY),
        paper=False,
    )  # fmt: skip

    completion = _command(commands, "completion", "the script that completes commands and options in a shell")
    completion.add_argument("shell", metavar="SHELL", choices=SHELLS, help=", ".join(SHELLS))
    _command(commands, "man", "the manual page, for man and groff")
    parser.commands = dict(commands.choices)
    return parser


def _command(commands: Any, name: str, text: str, *, epilog: str | None = None) -> argparse.ArgumentParser:
    parser: argparse.ArgumentParser = commands.add_parser(
        name, help=text, description=f"{text[0].upper()}{text[1:]}.", epilog=epilog,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )  # fmt: skip
    return parser


def _ways(input: str) -> str:
    """List the ways to a surface from a study, or from points."""
    own = {name: text for name, text in WAYS.items() if input in text.partition(":")[0].partition(",")[0]}
    each = [fill(f"{name:10}{text}", 78, initial_indent="  ", subsequent_indent=12 * " ") for name, text in own.items()]
    return "\n".join(["Ways to the surface, of which the first that applies is taken:", *each])


def _add_study(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "study",
        metavar="STUDY",
        nargs="*",
        help=f"{STUDY}, or its slices one by one, or - with --input-format; --labels-in may stand in its place",
    )
    parser.add_argument(
        "--labels-in",
        metavar="FILE",
        help="a label map or a DICOM segmentation on the study's grid or a part of it, or alone: "
        "its labels of --select are the window",
    )


def _add_streams(
    parser: argparse.ArgumentParser, read: Sequence[str], written: Sequence[str] = (), *, usual: str = "nii"
) -> None:
    """Add the options that name formats where no suffix does."""
    group = parser.add_argument_group("Streams")
    group.add_argument(
        "--input-format", choices=read,
        help=f"what is read from standard input (default {usual}), or from a file whose suffix does not tell",
    )  # fmt: skip
    if written:
        group.add_argument("--format", choices=written, help="what is written to standard output (-o -)")


def _add_each(parser: argparse.ArgumentParser) -> None:
    """Add the options of a batch."""
    group = parser.add_argument_group("Many studies")
    group.add_argument(
        "--each",
        action="store_true",
        help="STUDY is a folder of studies, each reconstructed into the folder MESH: NAME.stl (or --format), its "
        "report NAME.json, and all in reports.csv; what is finished is passed over",
    )
    group.add_argument("--force", action="store_true", help="reconstruct again what is finished")


def _add_outputs(parser: argparse.ArgumentParser, *files: str) -> Any:
    """Add the options that name further files; what is shown goes with `_add_settings`."""
    kinds = {
        "points": ("FILE", f"write the points: {POINT}"),
        "labels": ("FILE", f"write the regions on the study's own grid: {LABEL}"),
        "mask_out": ("FILE", f"write the voxels inside the mesh on the study's own grid: {LABEL}"),
        "figures": ("FOLDER", "write the pictures"),
    }
    group = parser.add_argument_group("More results")
    for name in files:
        metavar, text = kinds[name]
        group.add_argument(option_of(name), metavar=metavar, help=text)
    group.add_argument("--report", metavar="FILE.json", help="write the report")
    group.add_argument("--save-settings", metavar="FILE.toml", help="write the settings of this run, to repeat it")
    return group


def _add_settings(
    parser: argparse.ArgumentParser, groups: tuple[str, ...], *, without: tuple[str, ...] = (), paper: bool = True
) -> None:
    """Add an option for each parameter of some groups but a few, and those that choose or show them all."""
    sections = {
        entry.name: parser.add_argument_group(_title(entry.name)) for entry in fields(Settings) if entry.name in groups
    }
    for group, entry in parameters():
        if group in sections and entry.name not in without:
            add_parameter(sections[group], entry)
    if "window" in sections:
        sections["window"].add_argument(
            "--auto", action="store_true", help="take Otsu's threshold, as is done where no window is given"
        )
    if paper:
        run = sections["run"]
        run.add_argument("--paper", action="store_true", help="take the paper's own choices as defaults")
        run.add_argument("--settings", metavar="FILE.toml", help="read settings; options given here win over them")
        run.add_argument("--quiet", action="store_true", help="print nothing but errors")
        run.add_argument("--json", action="store_true", help="print the report as JSON in place of the summary")


def _title(section: str) -> str:
    """Return the first line of a group's docstring."""
    return (getattr(Settings(), section).__doc__ or section).splitlines()[0].rstrip(".")
