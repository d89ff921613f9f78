"""Files changed at random, and what readers say of them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from tomomesh.errors import TomomeshError

if TYPE_CHECKING:
    import random
    from collections.abc import Callable


def fault_of(read: Callable[..., Any], *arguments: Any, **options: Any) -> TomomeshError | None:
    """Return the error with which a reader ends, None where it reads."""
    try:
        read(*arguments, **options)
    except TomomeshError as error:
        return error
    return None


def changed(whole: bytes, rng: random.Random, start: int = 132) -> bytes:
    """Change single bytes anywhere after the start."""
    raw = bytearray(whole)
    for _ in range(rng.choice((1, 3, 9))):
        raw[rng.randrange(start, len(raw))] = rng.randrange(256)
    return bytes(raw)
