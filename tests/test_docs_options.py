"""Help and pages say what the tables say."""

from __future__ import annotations

import argparse
import importlib.util
import re
from pathlib import Path
from typing import Any

import pytest

from tomomesh import io
from tomomesh.cli.options import build_parser, formats
from tomomesh.cli.options.formats import either
from tomomesh.cli.shell import _actions

DOCS = Path(__file__).parents[1] / "docs"
PAGE = (DOCS / "command-line.md").read_text(encoding="utf-8")
(SUBPARSERS,) = (action for action in build_parser()._actions if isinstance(action, argparse._SubParsersAction))
COMMANDS: dict[str, argparse.ArgumentParser] = dict(SUBPARSERS.choices)


def maker() -> Any:
    """Return the program that makes the tables of the page."""
    spec = importlib.util.spec_from_file_location("options_page", DOCS / "options.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


class TestPage:
    def test_tables_are_those_of_the_settings(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        module = maker()
        copy = tmp_path / "page.md"
        copy.write_text(re.sub(r"\| `--.*\n", "", PAGE), encoding="utf-8")
        monkeypatch.setattr(module, "PAGE", copy)
        module.write()
        made, _, _ = copy.read_text(encoding="utf-8").partition("<!-- end run -->")
        assert made == PAGE.partition("<!-- end run -->")[0]

    def test_every_command_and_option_is_on_it(self) -> None:
        for command in COMMANDS:
            assert f"### {command}\n" in PAGE, command
        for action in _actions(build_parser()):
            for option in action.option_strings:
                assert option in ("-h", "--help", "--version") or re.search(rf"{option}(?![\w-])", PAGE), option


class TestFormats:
    @pytest.mark.parametrize(
        ("named", "table"),
        [
            (formats.MESH_FORMATS, set(io.MESH_WRITERS)),
            (formats.POINT_FORMATS, set(io.POINT_WRITERS)),
            (formats.LABEL_FORMATS, set(io.LABEL_WRITERS)),
            (formats.CHECKED_FORMATS, set(io.MESH_READERS)),
            (formats.CLOUD_FORMATS, set(io.POINT_READERS)),
            (formats.STUDY_FORMATS + formats.HEADER_FORMATS, set(io.VOLUME_READERS)),
        ],
    )
    def test_the_parser_names_what_the_tables_hold(self, named: tuple[str, ...], table: set[str]) -> None:
        assert {f".{name}" for name in named} == table
        assert len(named) == len(table)

    def test_help_names_every_format(self) -> None:
        for command, option, suffixes in [
            ("reconstruct", "--output", formats.STUDY_MESH_FORMATS), ("reconstruct", "--points", formats.POINT_FORMATS),
            ("reconstruct", "--labels", formats.LABEL_FORMATS), ("segment", "--output", formats.POINT_FORMATS),
            ("surface", "--output", formats.MESH_FORMATS),
        ]:  # fmt: skip
            (action,) = (one for one in COMMANDS[command]._actions if option in one.option_strings)
            assert either(suffixes) in (action.help or "")
        (checked,) = (one for one in COMMANDS["check"]._actions if one.dest == "mesh")
        assert checked.help == either(formats.CHECKED_FORMATS)
