"""Pictures of a result, drawn without a display (Fig. 1-10)."""

from __future__ import annotations

from .drawing.page import save
from .gallery import draw_all

__all__ = ["draw_all", "save"]
