"""How long work says where it is, and how it is stopped."""

from __future__ import annotations

from collections.abc import Callable

Progress = Callable[[str, int, int], None]
"""Called as ``progress(stage, done, total)``. Whatever it raises ends the work and reaches the caller."""


def silent(stage: str, done: int, total: int) -> None:
    """Report nothing."""
