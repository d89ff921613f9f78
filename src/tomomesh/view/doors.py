"""Who may come in: the one browser that was handed the address, from this machine, for our own page."""

from __future__ import annotations

import secrets
from http.cookies import CookieError, SimpleCookie
from typing import TYPE_CHECKING, Any
from urllib.parse import parse_qs, urlsplit

from ..errors import UsageError

if TYPE_CHECKING:
    from collections.abc import Collection

    from starlette.types import ASGIApp, Message, Receive, Scope, Send

POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; connect-src 'self'; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
"""What the page may load: nothing from anywhere else, and no script or style that stands in the page itself."""
SENT = {
    "content-security-policy": POLICY,
    "x-content-type-options": "nosniff",
    "referrer-policy": "no-referrer",
    "cross-origin-resource-policy": "same-origin",
    "cross-origin-opener-policy": "same-origin",
    "cache-control": "no-store",
}
"""With every answer. Nothing is stored: slices are a patient's."""
HTTPS = 443
"""The port that browsers leave out."""
READING = ("GET", "HEAD")
"""Requests that change nothing."""


class Doors:
    """An application behind its doors.

    The address that is opened holds a token, which is taken once and becomes a cookie that no script can read and no
    other site's page can send. Every request must bear it, name a host that is ours (or another site's name could lead
    here), and where it changes something, or is a WebSocket, come from our own page.

    Parameters
    ----------
    app : ASGI application
    origins : collection of str
        What the page's own origin may be, ``http://127.0.0.1:8000`` or what a proxy in front is called: ``Host`` is
        what follows the scheme.
    """

    def __init__(self, app: ASGIApp, origins: Collection[str]) -> None:
        self._app, self._schemes = app, {host: scheme for scheme, _, host in (one.partition("://") for one in origins)}
        self.token: str = secrets.token_urlsafe(32)
        self._ticket = secrets.token_urlsafe(32)
        self._name = "tomomesh-" + secrets.token_hex(4)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Let a request in, or refuse it."""
        if scope["type"] == "lifespan":
            await self._app(scope, receive, send)
            return
        headers = {name.decode("latin-1"): value.decode("latin-1") for name, value in scope["headers"]}
        scheme = self._schemes.get(headers.get("host", ""))
        if scheme is None:
            await _refuse(scope, receive, send, "the host is not ours")
        elif self._hands_over(scope):
            await self._welcome(send, secure=scheme == "https")
        elif not self._bears_ticket(headers):
            await _refuse(scope, receive, send, "open the address that tomomesh has printed; it opens once")
        elif not _is_ours(scope, headers, f"{scheme}://{headers['host']}"):
            await _refuse(scope, receive, send, "the request is another page's")
        else:
            await self._app(scope, receive, _with_headers(send))

    def _hands_over(self, scope: Scope) -> bool:
        """Tell whether the address bears the token, which is void from then on."""
        if scope["type"] != "http" or scope["method"] != "GET" or scope["path"] != "/" or not self.token:
            return False
        given = parse_qs(scope["query_string"].decode("latin-1")).get("token", [""])[0]
        if not secrets.compare_digest(given.encode(), self.token.encode()):
            return False
        self.token = ""
        return True

    async def _welcome(self, send: Send, *, secure: bool) -> None:
        cookie = f"{self._name}={self._ticket}; HttpOnly; SameSite=Strict; Path=/{'; Secure' if secure else ''}"
        await _answer(send, 303, "", {"location": "/", "set-cookie": cookie})

    def _bears_ticket(self, headers: dict[str, str]) -> bool:
        try:
            found = SimpleCookie(headers.get("cookie", "")).get(self._name)
        except CookieError:
            return False
        return found is not None and secrets.compare_digest(found.value.encode(), self._ticket.encode())


def public_origin(address: str) -> str:
    """Return the origin of what a proxy in front is called, as browsers write it.

    Raises
    ------
    UsageError
        For what is no ``https://HOST``: with a path the page's own addresses would lead beside it.

    Examples
    --------
    >>> public_origin("https://View.example.org:443/")
    'https://view.example.org'
    """
    try:
        found = urlsplit(address.rstrip("/").lower())
        port, host = found.port, found.hostname or ""
    except ValueError:  # a port that is none
        found, port, host = urlsplit(""), None, ""
    host = f"[{host}]" if ":" in host else host
    told = f"{host}:{port}" if port is not None else host
    if host and found.geturl() == f"https://{told}":
        return f"https://{host if port == HTTPS else told}"
    raise UsageError(
        "a proxy in front is named by its origin alone", found=f"--public-url {address}",
        expected="https://HOST or https://HOST:PORT",
    )  # fmt: skip


def _is_ours(scope: Scope, headers: dict[str, str], origin: str) -> bool:
    """Tell whether a request that changes something comes from our own page."""
    if scope["type"] == "http" and scope["method"] in READING:
        return headers.get("sec-fetch-site", "none") in ("none", "same-origin")
    return headers.get("origin") == origin


def _with_headers(send: Send) -> Send:
    async def sent(message: Message) -> None:
        if message["type"] == "http.response.start":
            more = [(name.encode(), value.encode()) for name, value in SENT.items()]
            message = {**message, "headers": [*message.get("headers", ()), *more]}
        await send(message)

    return sent


async def _refuse(scope: Scope, receive: Receive, send: Send, why: str) -> None:
    if scope["type"] == "websocket":
        await receive()
        await send({"type": "websocket.close", "code": 1008, "reason": why})
    else:
        await _answer(send, 403, f"{why}\n", {"content-type": "text/plain; charset=utf-8"})


async def _answer(send: Send, status: int, text: str, headers: dict[str, str]) -> None:
    sent: dict[str, Any] = {**SENT, **headers}
    named = [(name.encode(), value.encode()) for name, value in sent.items()]
    await send({"type": "http.response.start", "status": status, "headers": named})
    await send({"type": "http.response.body", "body": text.encode()})
