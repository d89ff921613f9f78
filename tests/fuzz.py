"""Damage to the bytes of valid files, and what may come of reading them."""

from __future__ import annotations

import os
import re
import struct
import tracemalloc
from typing import TYPE_CHECKING, Any

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tomomesh.errors import TomomeshError

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    Edit = Callable[[bytearray], None]

LONG = int(os.environ.get("TOMOMESH_FUZZ", "0"))
"""Examples a target; 0 is the short, repeatable run of the suite."""

SHORT = 40
HEAD = 600
"""Most edits fall on the first bytes, where the headers are."""

PEAK_BYTES = 2**25
"""What Python and NumPy may hold at once for a file of some kilobytes; its package may be loaded on the way."""

EXIT_CODES = (4, 5, 6, 7)

NUMBERS = tuple(
    struct.pack(order + kind, value)
    for order in "<>"
    for kind, values in (
        ("H", (0, 1, 0x7FFF, 0x8000, 0xFFFF)),
        ("I", (0, 1, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF, 0x00010000)),
        ("Q", (0, 2**31, 2**40, 2**63 - 1, 2**64 - 1)),
        ("f", (0.0, -1.0, 1e-30, 1e30, float("nan"), float("inf"))),
        ("d", (0.0, -1.0, 1e-300, 1e300, float("nan"), float("-inf"))),
    )
    for value in values
)
"""Counts, sizes, offsets and lengths that a careless reader believes."""

WORDS = (
    b"", b"0", b"-1", b"1", b"nan", b"inf", b"1e999", b"1e-300", b"0x10", b"99999999999", b"9" * 5000, b"3276700",
    b"-0.0", b"1_0", "١".encode(), b"\xff\xfe", b"\0", b" ", b"\n", b"../../x", b"/dev/zero", b"%s%n", b"true",
)  # fmt: skip
"""What may stand in place of a number in a text."""


def _place(share: float, length: int) -> int:
    """Turn a share into a place: the first half of all shares falls on the head, the others anywhere."""
    return int(share * 2 * min(HEAD, length)) if share < 0.5 else int((2 * share - 1) * length)


@st.composite
def edits(draw: st.DrawFn) -> Edit:
    """Draw one edit: flipped bits, another number, another word, something inserted, dropped or repeated."""
    kind = draw(st.sampled_from(["flip", "number", "word", "insert", "drop", "repeat", "bytes"]))
    share, amount = draw(st.floats(0, 0.999)), draw(st.integers(1, 64))
    number, word, some = draw(st.sampled_from(NUMBERS)), draw(st.sampled_from(WORDS)), draw(st.binary(max_size=12))

    def edit(raw: bytearray) -> None:
        at = _place(share, len(raw))
        if kind == "flip" and raw:
            raw[at] ^= 1 << amount % 8
        elif kind in ("number", "bytes"):
            new = number if kind == "number" else some
            raw[at : at + len(new)] = new
        elif kind == "word":
            _replace_word(raw, at, word)
        elif kind == "insert":
            raw[at:at] = some + word
        elif kind == "drop":
            del raw[at : at + amount]
        elif kind == "repeat":
            raw[at:at] = raw[at : at + amount] * (1 + amount % 5)

    return edit


def _replace_word(raw: bytearray, at: int, word: bytes) -> None:
    found = re.compile(rb"[-+.\w]+").search(raw, at)
    if found and len(found[0]) < 40:
        raw[found.start() : found.end()] = word


def fuzz(
    read: Callable[[Path], Any], path: Path, *, codes: tuple[int, ...] = EXIT_CODES, most: int = PEAK_BYTES
) -> None:
    """Read a valid file over and over, damaged: each time a result or one line, and little memory.

    Parameters
    ----------
    read : callable
        Reads a path; whatever it raises must be of tomomesh's own kind.
    path : Path
        The valid file. Its damaged copies take its place, so that what lies beside it is found.
    codes : tuple of int
        Exit codes that the errors may have.
    most : int
        Bytes that may be held at once.
    """
    whole = path.read_bytes()
    read(path)

    @settings(max_examples=LONG or SHORT, derandomize=not LONG, suppress_health_check=list(HealthCheck))
    @given(st.lists(edits(), min_size=1, max_size=5), st.none() | st.floats(0, 0.999))
    def damaged(chosen: list[Edit], cut: float | None) -> None:
        raw = bytearray(whole)
        for edit in chosen:
            edit(raw)
        path.write_bytes(raw if cut is None else raw[: int(cut * len(raw))])
        fault, peak = _outcome(read, path)
        assert peak < most, f"{peak} bytes"
        if fault is not None:
            assert str(fault).isprintable()
            assert fault.exit_code in (*codes, 3)  # 3: what it names beside it is gone

    damaged()


def _outcome(read: Callable[[Path], Any], path: Path) -> tuple[TomomeshError | None, int]:
    """Return the error, if there was one, and the most memory that was held."""
    tracemalloc.start()
    try:
        read(path)
    except TomomeshError as fault:
        return fault, tracemalloc.get_traced_memory()[1]
    else:
        return None, tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
