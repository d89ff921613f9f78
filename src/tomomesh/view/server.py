"""Serve the page to one browser on this machine."""

from __future__ import annotations

import socket
from typing import TYPE_CHECKING

import uvicorn

from .app import application
from .doors import Doors

if TYPE_CHECKING:
    from collections.abc import Callable

    from .session import Session

HERE = "127.0.0.1"


class _Server(uvicorn.Server):
    """A server that says when it listens."""

    def __init__(self, config: uvicorn.Config, started: Callable[[], None]) -> None:
        super().__init__(config)
        self._started = started

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Begin to listen, and say so."""
        await super().startup(sockets)
        self._started()


def serve(
    session: Session, started: Callable[[str], None], *, host: str = HERE, port: int = 0, public: str = ""
) -> None:
    """Serve the page until Ctrl-C.

    Parameters
    ----------
    session : Session
        What it names and has not read yet is read meanwhile.
    started : callable
        Takes the address to open, token and all, once the page can be opened.
    host, port : str, int
        Where it listens: this machine alone, on a free port, unless asked otherwise.
    public : str
        The origin of a proxy in front, where there is one.
    """
    listening = socket.create_server((host, port))
    bound = listening.getsockname()[1]
    own = [f"http://{name}:{bound}" for name in ([host, "localhost"] if host == HERE else [host])]
    doors = Doors(application(session), [*own, *([public] if public else [])])
    config = uvicorn.Config(
        doors, log_level="critical", access_log=False, ws_max_size=1 << 16, lifespan="off", timeout_graceful_shutdown=1
    )

    def begun() -> None:
        started(f"{public or own[0]}/?token={doors.token}")
        if session.opened.words and not session.opened.ready:
            session.read(session.opened)

    try:
        _Server(config, begun).run([listening])
    finally:
        session.jobs.stop()
        listening.close()
