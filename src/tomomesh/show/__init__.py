"""Pictures of a result, drawn without a display (Fig. 1-10)."""

from __future__ import annotations

from .gallery import draw_all
from .style import save

__all__ = ["draw_all", "save"]
