"""What takes long to find out, and is asked for again."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable, Hashable


class Held:
    """The last few answers, each found out once however many ask at a time.

    Parameters
    ----------
    most : int
        How many are held.

    Examples
    --------
    >>> held = Held(1)
    >>> held.of("a", lambda: 1), held.of("a", lambda: 2), held.of("b", lambda: 3), held.of("a", lambda: 4)
    (1, 1, 3, 4)
    """

    def __init__(self, most: int) -> None:
        self._most, self._lock = most, threading.Lock()
        self._found: dict[Hashable, Any] = {}

    def of(self, key: Hashable, find: Callable[[], Any]) -> Any:
        """Return the answer to a question; a fault is none, and raised."""
        with self._lock:
            found = self._found.pop(key) if key in self._found else find()
            self._found[key] = found
            while len(self._found) > self._most:
                del self._found[next(iter(self._found))]
            return found

    def known(self, key: Hashable) -> Any:
        """Return an answer that is held, without waiting.

        Raises
        ------
        LookupError
            Where it is not.
        """
        return self._found[key]

    def clear(self) -> None:
        """Forget all, once what is being found out is found."""
        with self._lock:
            self._found.clear()
