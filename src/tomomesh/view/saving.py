"""What leaves the page: every file as the command line writes it, sent as a download."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

from starlette.responses import Response

from .. import io
from ..errors import UsageError
from ..io.files.source import suffix_of
from ..settings import Settings
from .routes import get
from .surfaces import WORK, surface_of

if TYPE_CHECKING:
    from .session import Session

SETTINGS = "settings"


def _formats(session: Session) -> dict[str, list[str]]:
    """List what can be saved of what there is, each with its formats, the usual one first."""
    if session.opened.converts:
        return {"mesh": [*io.MESH_WRITERS]}
    formats = {SETTINGS: [".toml"]}
    if WORK in session.made and session.write is not None:
        formats |= {"mesh": [*io.MESH_WRITERS], "points": [*io.POINT_WRITERS], "report": [".html", ".json"]}
        if surface_of(session).segmentation is not None:
            formats |= {"mask": [*io.LABEL_WRITERS], "labels": [*io.LABEL_WRITERS]}
    return formats


def _save(session: Session, name: str) -> Response:
    """Write a file, named by what it is and its format, and send it."""
    what, suffix = name.partition(".")[0], suffix_of(name)
    if suffix not in _formats(session).get(what, ()):
        raise UsageError("there is no such file to save", found=name, expected="a file of /api/formats")
    with tempfile.TemporaryDirectory(prefix="tomomesh-") as folder:
        path = Path(folder, name)
        _write(session, what, path)
        data = path.read_bytes()
    headers = {"content-disposition": f'attachment; filename="{what}{suffix}"'}
    return Response(data, media_type="application/octet-stream", headers=headers)


def _write(session: Session, what: str, path: Path) -> None:
    """Write what there is as the command line does."""
    if what == SETTINGS:
        io.write_settings(session.settings, path)
    elif session.opened.converts:
        assert session.run is not None
        session.run([*session.opened.converting(str(path)), "--quiet"])
    else:
        made = session.made[WORK]
        assert session.write is not None
        settings = Settings().replace(**made.choices)
        session.write(what, made.value, settings, path, session.opened.command(settings))


ROUTES = [get("/api/formats", _formats), get("/save/{name}", _save)]
