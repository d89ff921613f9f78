"""What takes long to find out, and is asked for again."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable, Hashable


class Remembered:
    """The last few answers, each found out once however many ask at a time.

    Parameters
    ----------
    most : int
        How many are remembered.

    Examples
    --------
    >>> known = Remembered(1)
    >>> known.of("a", lambda: 1), known.of("a", lambda: 2), known.of("b", lambda: 3), known.of("a", lambda: 4)
    (1, 1, 3, 4)
    """

    def __init__(self, most: int) -> None:
        self._most, self._lock = most, threading.Lock()
        self._found: dict[Hashable, Any] = {}

    def of(self, key: Hashable, find: Callable[[], Any]) -> Any:
        """Return the answer to a question; a fault is none, and raised."""
        with self._lock:
            found = self._found[key] if key in self._found else find()
            others = [pair for pair in self._found.items() if pair[0] != key]
            self._found = dict([*others, (key, found)][-self._most :])  # at once, for those who do not wait
            return found

    def known(self, key: Hashable) -> Any:
        """Return an answer that is remembered, without waiting.

        Raises
        ------
        LookupError
            Where it is not.
        """
        return self._found[key]

    def clear(self) -> None:
        """Forget all, once what is being found out is found."""
        with self._lock:
            self._found = {}
