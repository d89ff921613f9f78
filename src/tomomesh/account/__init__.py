"""The account of a run: what each stage found, how long it took, and how good the mesh is."""

from __future__ import annotations

from .account import SECTIONS, Account

__all__ = ["SECTIONS", "Account"]
