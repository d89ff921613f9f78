"""Bars of progress: a clock that goes on where a stage is silent, and lines where there is no terminal."""

from __future__ import annotations

import io
import sys
from threading import Event

import pytest
from tqdm import tqdm

from tomomesh.cli import bars
from tomomesh.cli.bars import Bars

SOON = 60.0


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


class TestBars:
    def test_the_clock_goes_on_in_a_silent_stage(self, monkeypatch: pytest.MonkeyPatch) -> None:
        again = Event()

        def refresh(bar: tqdm[int], nolock: bool = False, **_: object) -> None:
            if nolock and bar.n == 0:
                again.set()

        monkeypatch.setattr(sys, "stderr", Terminal())
        monkeypatch.setattr(bars, "TICK", 0.001)
        monkeypatch.setattr(tqdm, "refresh", refresh)
        with Bars() as progress:
            progress("voxels", 0, 1)
            assert again.wait(SOON)

    def test_leaves_through_an_interrupt_and_draws_no_more(self, monkeypatch: pytest.MonkeyPatch) -> None:
        screen = Terminal()
        monkeypatch.setattr(sys, "stderr", screen)
        monkeypatch.setattr(bars, "TICK", 0.001)
        progress = Bars()

        def stopped() -> None:
            with progress:
                progress("voxels", 0, 1)
                raise KeyboardInterrupt

        with pytest.raises(KeyboardInterrupt):
            stopped()
        drawn = screen.getvalue()
        assert "voxels" in drawn
        progress._tick()
        assert screen.getvalue() == drawn

    def test_says_one_line_a_stage_elsewhere(self, monkeypatch: pytest.MonkeyPatch) -> None:
        lines = io.StringIO()
        monkeypatch.setattr(sys, "stderr", lines)
        with Bars() as progress:
            progress("voxels", 0, 2)
            progress("voxels", 2, 2)
            assert lines.getvalue().startswith("voxels     2/2")

    def test_says_where_a_long_stage_is_now_and_then_elsewhere(self, monkeypatch: pytest.MonkeyPatch) -> None:
        """Also where it reports nothing; and never more after its end, nor as often as it reports."""
        lines, again = io.StringIO(), Event()
        say = Bars._say

        def said(bars: Bars) -> None:
            say(bars)
            again.set()

        monkeypatch.setattr(sys, "stderr", lines)
        monkeypatch.setattr(bars, "TICK", 0.001)
        monkeypatch.setattr(bars, "EVERY", 0.0)
        monkeypatch.setattr(Bars, "_say", said)
        with Bars() as progress:
            progress("fit", 3, 9)
            assert again.wait(SOON)
            progress("fit", 9, 9)
            told = lines.getvalue()
            again.clear()
            assert not again.wait(0.05)
        assert told.startswith("fit        3/9")
        assert told.splitlines()[-1].startswith("fit        9/9")
        assert lines.getvalue() == told

    def test_says_a_line_a_report_only_where_time_has_passed(self, monkeypatch: pytest.MonkeyPatch) -> None:
        lines = io.StringIO()
        monkeypatch.setattr(sys, "stderr", lines)
        monkeypatch.setattr(bars, "EVERY", 1e9)
        with Bars() as progress:
            for done in range(100):
                progress("fit", done, 100)
            assert lines.getvalue() == ""

    def test_what_stands_beside_is_said_with_it(self, monkeypatch: pytest.MonkeyPatch) -> None:
        for screen in (Terminal(), io.StringIO()):
            monkeypatch.setattr(sys, "stderr", screen)
            with Bars() as progress:
                progress("studies", 0, 1)
                progress.beside = "head fit 3/30"
                progress("studies", 1, 1)
            assert screen.getvalue().rstrip().endswith(", head fit 3/30")

    def test_it_is_put_away_while_something_else_is_printed(self, monkeypatch: pytest.MonkeyPatch) -> None:
        screen = Terminal()
        monkeypatch.setattr(sys, "stderr", screen)
        with Bars() as progress:
            progress("studies", 0, 2)
            with progress.aside():
                before = screen.getvalue()
                screen.write("a line\n")
            _, _, after = screen.getvalue().partition("a line\n")
        assert before.endswith("\r")
        assert before.split("\r")[-2].strip() == ""
        assert "studies" in after
