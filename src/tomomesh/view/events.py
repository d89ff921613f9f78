"""What is told to the page without being asked: a WebSocket."""

from __future__ import annotations

import asyncio
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from starlette.routing import WebSocketRoute
from starlette.websockets import WebSocketDisconnect

if TYPE_CHECKING:
    from collections.abc import Callable

    from starlette.websockets import WebSocket

MOST = 1_000
"""Events that may wait for a page; one that is so far behind is gone, or asleep, and asks for the state anyway."""


class Events:
    """Those who listen, and what they are told."""

    def __init__(self) -> None:
        self._listening: dict[asyncio.Queue[dict[str, Any]], asyncio.AbstractEventLoop] = {}

    def tell(self, event: dict[str, Any]) -> None:
        """Tell all pages; from any thread."""
        for queue, loop in [*self._listening.items()]:
            with suppress(RuntimeError):  # the loop has ended, and the page with it
                loop.call_soon_threadsafe(_put, queue, event)

    async def listen(self, page: WebSocket, first: Callable[[], dict[str, Any]]) -> None:
        """Send a page its events until it leaves; ``first`` tells what may have passed before it listened."""
        await page.accept()
        queue: asyncio.Queue[dict[str, Any]] = asyncio.Queue(MOST)
        self._listening[queue] = asyncio.get_running_loop()
        _put(queue, first())
        sending = asyncio.create_task(_send(page, queue))
        try:
            while True:
                await page.receive_text()
        except WebSocketDisconnect:
            pass
        finally:
            del self._listening[queue]
            sending.cancel()


def _put(queue: asyncio.Queue[dict[str, Any]], event: dict[str, Any]) -> None:
    with suppress(asyncio.QueueFull):
        queue.put_nowait(event)


async def _send(page: WebSocket, queue: asyncio.Queue[dict[str, Any]]) -> None:
    with suppress(WebSocketDisconnect, RuntimeError):
        while True:
            await page.send_json(await queue.get())


async def _listen(page: WebSocket) -> None:
    session = page.app.state.session
    await session.events.listen(page, lambda: {"event": "state", "state": session.state})


ROUTES = [WebSocketRoute("/api/events", _listen)]
