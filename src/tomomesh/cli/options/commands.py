"""The options of each command."""

from __future__ import annotations

import argparse
from textwrap import fill
from typing import Any

from ...ways import WAYS
from .formats import (
    CHECKED,
    CLOUD,
    CLOUD_FORMATS,
    MESH,
    MESH_FORMATS,
    POINT,
    POINT_FORMATS,
    STUDY,
    STUDY_FORMATS,
    STUDY_MESH,
    STUDY_MESH_FORMATS,
)
from .groups import HTML, add_each, add_outputs, add_scale, add_settings, add_streams, add_study

STAGE_ONE = ("read", "crop", "window", "network")
STAGE_TWO = ("cubes", "fit", "printing")
TOLD = ("completion", "man")
"""Commands that are made from this parser alone, and import nothing heavy either."""
SHELLS = ("bash", "zsh", "fish", "tcsh")
CUTS = ("scale", "flat_base", "one_piece", "fill_cavities", "thicken", "hollow", "drain")
"""Parameters that change a part."""
MESH_ONLY = ("local_origin", "smooth", "allow_far", "remesh", "edge", "target_faces")
"""Parameters of the run that matter to meshes alone."""
STUDY_ONLY = ("frame", "shared_walls")
"""Parameters that matter to studies of a user's own alone."""
SURFACE_ONLY = (
    "cell_mm", "cell_factor", "closing", "fill_holes", "stacks", "largest", "allow_leaks", "surface", "low_pass",
    "shared_walls", *MESH_ONLY,
)  # fmt: skip
"""Parameters that do not matter to the points."""


def add_commands(commands: Any) -> None:
    """Add all commands, in the order in which the help lists them."""
    for add in (_demo, _reconstruct, _segment, _surface, _network, _inspect, _check, _print, _view, _completion, _man):
        add(commands)


def _demo(commands: Any) -> None:
    demo = _command(commands, "demo", "the built-in head, everything it can show")
    demo.add_argument("-o", "--output", default="tomomesh-demo", metavar="FOLDER", help="default: %(default)s")
    demo.add_argument("--html", metavar="FILE.html", help=f"{HTML} (default: FOLDER/report.html)")
    add_settings(demo, ("network", *STAGE_TWO, "run"), without=STUDY_ONLY)


def _reconstruct(commands: Any) -> None:
    main = _command(commands, "reconstruct", "a study of slices in, a closed surface out", epilog=_ways("study"))
    add_study(main)
    main.add_argument(
        "-o", "--output", required=True, metavar="MESH",
        help=f"{STUDY_MESH}, or - with --format; with --each or --each-label, a folder",
    )  # fmt: skip
    add_streams(main, STUDY_FORMATS, STUDY_MESH_FORMATS)
    add_each(main)
    add_scale(main)
    add_outputs(main, "points", "labels", "mask_out", "figures", "html", "slicer").add_argument(
        "--patient", action="store_true", help="copy the patient's fields of a DICOM study into MESH.dcm"
    )
    add_settings(main, (*STAGE_ONE, *STAGE_TWO, "run"))


def _segment(commands: Any) -> None:
    stage_one = _command(commands, "segment", "stage one alone: the neurons of all slices as points")
    add_study(stage_one)
    stage_one.add_argument("-o", "--output", required=True, metavar="POINTS", help=f"{POINT}, or - with --format")
    add_streams(stage_one, STUDY_FORMATS, POINT_FORMATS)
    add_outputs(stage_one, "labels", "figures")
    add_settings(stage_one, (*STAGE_ONE, "cubes", "run"), without=SURFACE_ONLY)


def _surface(commands: Any) -> None:
    in_short = "stages two and three alone: points in, a closed surface out"
    stage_two = _command(commands, "surface", in_short, epilog=_ways("points"))
    stage_two.add_argument("cloud", metavar="POINTS", help=f"{CLOUD}, or - with --input-format")
    stage_two.add_argument("-o", "--output", required=True, metavar="MESH", help=f"{MESH}, or - with --format")
    add_streams(stage_two, CLOUD_FORMATS, MESH_FORMATS, usual="xyz")
    stage_two.add_argument(
        "--memory", metavar="SIZE",
        help="memory to take, about, as 4GB: arrays beyond it lie on the disk of TMPDIR (Linux; default: no limit)",
    )  # fmt: skip
    add_outputs(stage_two, "figures", "html")
    add_settings(stage_two, ("cloud", "crop", *STAGE_TWO, "run"), without=("slice_range", *STUDY_ONLY))


def _network(commands: Any) -> None:
    network = _command(commands, "network", "one network on a test region or a picture, as the paper's Fig. 1 and 2")
    network.add_argument("region", metavar="REGION", help="square, triangle, cube, or one picture (PNG or TIFF)")
    network.add_argument("-o", "--output", default="tomomesh-network", metavar="FOLDER", help="default: %(default)s")
    network.add_argument("--film", action="store_true", help="write the training as an animated GIF too")
    add_outputs(network)
    add_settings(
        network, ("window", "network", "run"),
        without=(
            "slices", "way", "signal", "contours", "space", "select", "keep", "keep_at", "drop_at", "units",
            "precision", *MESH_ONLY, *STUDY_ONLY,
        ),
    )  # fmt: skip


def _inspect(commands: Any) -> None:
    inspect = _command(commands, "inspect", "what is in a study: size, spacing, frame, gray levels, windows")
    inspect.add_argument(
        "study", metavar="STUDY", nargs="+", help=f"{STUDY}, or its slices one by one, or - with --input-format"
    )
    add_streams(inspect, STUDY_FORMATS)
    inspect.add_argument("--json", action="store_true", help="print the findings as JSON")
    add_settings(inspect, ("read", "crop"), paper=False)


def _check(commands: Any) -> None:
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
    check.add_argument("--html", metavar="FILE.html", help=HTML)
    check.add_argument("--json", action="store_true", help="print the report as JSON")
    check.add_argument("--print", dest="print_check", action="store_true", help="tell whether it can be printed, too")
    add_settings(
        check, ("read", "crop", "window", "printing"), without=(*CUTS, "print_check"),
        paper=False,
    )  # fmt: skip


def _print(commands: Any) -> None:
    part = _command(commands, "print", "a closed mesh in, a part to print out: scaled, cut flat, hollowed")
    part.add_argument("mesh", metavar="MESH", help=CHECKED)
    part.add_argument("-o", "--output", required=True, metavar="MESH", help=MESH)
    part.add_argument("--report", metavar="FILE.json", help="write the report")
    part.add_argument("--html", metavar="FILE.html", help=HTML)
    part.add_argument("--json", action="store_true", help="print the report as JSON in place of the summary")
    part.add_argument("--quiet", action="store_true", help="print nothing but errors")
    add_settings(
        part, ("printing", "run"), without=("seed", "print_check", *MESH_ONLY, *STUDY_ONLY),
        paper=False,
    )  # fmt: skip


def _view(commands: Any) -> None:
    view = _command(commands, "view", "a study, points, a mesh or the folder of a run, in the browser")
    view.add_argument(
        "looked_at",
        metavar="STUDY|POINTS|MESH|RUN",
        nargs="?",
        help=f"{STUDY}; or {CLOUD}; or {CHECKED}; or the folder of a run",
    )
    view.add_argument("--labels-in", metavar="FILE", help="a label map beside STUDY, whose labels can be chosen")
    view.add_argument("--browse", metavar="FOLDER", help="let the page open all studies, points and meshes below it")
    view.add_argument("--no-browser", action="store_true", help="print the address, and open no browser")
    view.add_argument("--port", type=int, default=0, metavar="N", help="where to listen (default: a free port)")
    view.add_argument(
        "--host", default="127.0.0.1", metavar="NAME", help="listen for other machines too; see docs/view.md"
    )
    view.add_argument(
        "--public-url", metavar="URL", help="what a proxy with TLS in front is called, as https://view.example.org"
    )
    view.add_argument("--i-know", metavar="WORDS", help="the words that --host asks for")
    add_settings(view, (*STAGE_ONE, "cloud", *STAGE_TWO, "run"))


def _completion(commands: Any) -> None:
    completion = _command(commands, "completion", "the script that completes commands and options in a shell")
    completion.add_argument("shell", metavar="SHELL", choices=SHELLS, help=", ".join(SHELLS))


def _man(commands: Any) -> None:
    _command(commands, "man", "the manual page, for man and groff")


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
