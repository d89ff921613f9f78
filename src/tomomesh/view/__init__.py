"""The page on which a study, its networks and its surface are looked at: a local server for one browser."""

from __future__ import annotations

from importlib.util import find_spec

from ..errors import UsageError

NEEDED = ("starlette", "uvicorn", "websockets")


def require_view() -> None:
    """Refuse to start where the packages of the page are not installed.

    Raises
    ------
    UsageError
    """
    missing = [name for name in NEEDED if find_spec(name) is None]
    if missing:
        raise UsageError(f"the page needs {', '.join(missing)}", hint='pip install "tomomesh[view]"')
