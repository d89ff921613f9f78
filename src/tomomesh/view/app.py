"""The application: the page's files, and what each part of the page asks."""

from __future__ import annotations

from importlib.resources import files
from typing import TYPE_CHECKING, Any

from starlette.applications import Starlette
from starlette.responses import Response
from starlette.routing import Route

from ..settings import Settings
from . import events, saving, slices, studies, surfaces, windows
from .networks import asked, pictures
from .routes import get, post

if TYPE_CHECKING:
    from starlette.requests import Request

    from .session import Session

TYPES = {
    ".html": "text/html; charset=utf-8", ".js": "text/javascript; charset=utf-8", ".css": "text/css; charset=utf-8",
    ".svg": "image/svg+xml",
}  # fmt: skip
"""What the page's files are, by their suffix; no other is handed out."""
FOLDERS = ("view/page", "html/assets")
"""Where they are: the page's own, and what it shares with the report in one file."""


def application(session: Session) -> Starlette:
    """Return the application over a session."""
    routes = [
        get("/api/state", lambda session: session.state),
        get("/api/schema", lambda session: Settings.json_schema()),
        post("/api/choose", lambda session, body: session.choose(body)),
        post("/api/undo", lambda session, body: session.undo()),
        post("/api/redo", lambda session, body: session.redo()),
        post("/api/cancel", _cancel),
        *events.ROUTES,
        *studies.ROUTES,
        *slices.ROUTES,
        *windows.ROUTES,
        *surfaces.ROUTES,
        *saving.ROUTES,
        *asked.ROUTES,
        *pictures.ROUTES,
        Route("/", _page),
        Route("/{name}", _page),
    ]
    app = Starlette(routes=routes)
    app.state.session = session
    return app


def _cancel(session: Session, body: Any) -> dict[str, Any]:
    session.jobs.stop()
    return session.state


async def _page(request: Request) -> Response:
    """Hand out one of the page's own files, by its bare name."""
    name = request.path_params.get("name", "index.html")
    kind = TYPES.get(name[name.rfind(".") :])
    found = [file for folder in FOLDERS if (file := files("tomomesh") / folder / name).is_file()]
    if kind is None or "/" in name or "\\" in name or not found:
        return Response("there is no such page\n", 404, media_type="text/plain")
    return Response(found[0].read_bytes(), media_type=kind)
