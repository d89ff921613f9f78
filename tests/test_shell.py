"""Completion and the manual page: bash itself completes, groff itself sets the page, and no option is missing."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from typing import TYPE_CHECKING

import pytest

from tomomesh.cli import main
from tomomesh.cli.options import build_parser
from tomomesh.cli.options.commands import SHELLS
from tomomesh.cli.shell import _actions, completion, manual

if TYPE_CHECKING:
    from pathlib import Path

    from _pytest.capture import CaptureFixture

BASH = shutil.which("bash")
ASK = """
source "$0"
COMP_WORDS=("$@") COMP_CWORD=$(($# - 1)) COMPREPLY=()
_shtab_tomomesh 2> /dev/null
printf '%s\\n' "${COMPREPLY[@]}"
"""
OPTIONS = sorted({option for action in _actions(build_parser()) for option in action.option_strings} - {"-h"})


@pytest.fixture(scope="module")
def script(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The script for bash."""
    path = tmp_path_factory.mktemp("shell") / "tomomesh.bash"
    path.write_text(completion("bash"), encoding="utf-8")
    return path


@pytest.mark.skipif(BASH is None, reason="there is no bash here")
class TestBash:
    def complete(self, script: Path, *words: str) -> list[str]:
        assert BASH is not None
        line = [BASH, "--norc", "-c", ASK, str(script), "tomomesh", *words]
        done = subprocess.run(line, capture_output=True, text=True, check=True, cwd=script.parent)
        return done.stdout.split()

    def test_the_script_is_one(self, script: Path) -> None:
        assert BASH is not None
        done = subprocess.run([BASH, "-n", str(script)], capture_output=True, check=True)
        assert done.stderr == b""

    @pytest.mark.parametrize(
        ("words", "found"),
        [
            (["rec"], ["reconstruct"]),
            (["reconstruct", "--net"], ["--network"]),
            (["reconstruct", "--network", "s"], ["sphere"]),
            (["surface", "--alpha"], []),
            (["completion", "z"], ["zsh"]),
            (["reconstruct", "-o", "tomo"], ["tomomesh.bash"]),
            (["check", "tomo"], ["tomomesh.bash"]),
            (["reconstruct", "s.nii", "--figures", "tomo"], []),
        ],
    )
    def test_words_are_completed(self, script: Path, words: list[str], found: list[str]) -> None:
        assert self.complete(script, *words) == found


class TestScripts:
    @pytest.mark.parametrize("shell", SHELLS)
    def test_every_shell_has_one_that_names_commands_and_options(self, shell: str, capsys: CaptureFixture[str]) -> None:
        import shtab

        if shell not in shtab.SUPPORTED_SHELLS:
            pytest.skip(f"the installed shtab does not know {shell}")
        assert main(["completion", shell]) == 0
        said = capsys.readouterr().out
        for word in ("reconstruct", "network", "target-faces", "hexagonal"):
            assert word in said

    def test_another_shell_is_refused(self, capsys: CaptureFixture[str]) -> None:
        assert main(["completion", "csh"]) == 2
        assert "bash" in capsys.readouterr().err


class TestManual:
    def test_every_command_and_option_is_in_it(self) -> None:
        page = manual().replace("\\-", "-")
        for option in OPTIONS:
            assert option == "--help" or f"\\fB{option}\\fR" in page, option

    def test_no_line_is_taken_for_an_unknown_command(self) -> None:
        commands = {line.split()[0] for line in manual().splitlines() if line[:1] in (".", "'")}
        assert commands <= {".TH", ".SH", ".SS", ".TP", ".B", ".RS", ".RE"}

    def test_it_does_not_depend_on_the_terminal(self, monkeypatch: pytest.MonkeyPatch) -> None:
        page = manual()
        monkeypatch.setenv("COLUMNS", "40")
        assert manual() == page

    @pytest.mark.skipif(shutil.which("groff") is None, reason="there is no groff here")
    def test_groff_sets_it_without_losing_a_word(self) -> None:
        line = ["groff", "-man", "-ww", "-Tutf8", "-P-cbou", "-rLL=500n", "-rHY=0"]
        done = subprocess.run(line, input=manual().encode(), capture_output=True, check=True)
        assert not [fault for fault in done.stderr.decode().splitlines() if "cannot adjust" not in fault]
        text = " ".join(done.stdout.decode().replace("\u2010", "-").split())
        for action in _actions(build_parser()):
            if action.help and "--help" not in action.option_strings:
                assert _words(action.help % vars(action)) in _words(text), action.help

    def test_the_command_prints_it(self, capsys: CaptureFixture[str]) -> None:
        assert main(["man"]) == 0
        assert capsys.readouterr().out == manual()


def _words(text: str) -> str:
    """Keep what typesetting leaves as it is."""
    return re.sub(r"[^\w.<>=/|()]+", " ", text).strip()


class TestWithoutPackages:
    @pytest.mark.parametrize(("line", "package"), [(["completion", "bash"], "shtab"), (["man"], "argparse-manpage")])
    def test_the_extra_is_named(
        self, line: list[str], package: str, monkeypatch: pytest.MonkeyPatch, capsys: CaptureFixture[str]
    ) -> None:
        for name in ("shtab", "argparse_manpage", "argparse_manpage.manpage"):
            monkeypatch.setitem(sys.modules, name, None)
        assert main(line) == 2
        said = capsys.readouterr().err
        assert f"Expected: {package}." in said
        assert 'pip install "tomomesh[shell]"' in said

    @pytest.mark.parametrize("line", [["completion", "bash"], ["man"], ["--version"]])
    def test_nothing_heavy_is_imported(self, line: list[str]) -> None:
        code = f"import sys\ntry:\n from tomomesh.cli import main; main({line!r})\nexcept SystemExit: pass\n"
        code += "print('\\n', sorted({'numpy', 'numba', 'scipy', 'matplotlib', 'nibabel'} & set(sys.modules)))"
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
        assert done.stdout.splitlines()[-1].strip() == "[]"
