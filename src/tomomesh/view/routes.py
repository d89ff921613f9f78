"""How the page asks, and what it is answered: bodies and errors as JSON."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from starlette.concurrency import run_in_threadpool
from starlette.responses import JSONResponse, Response
from starlette.routing import Route

from ..errors import TomomeshError, UsageError

if TYPE_CHECKING:
    from collections.abc import Callable

    from starlette.requests import Request

    Answer = Callable[..., Any]

MOST = 1 << 20
"""Bytes of a body: choices are short."""


def get(path: str, answer: Answer) -> Route:
    """Answer a question: ``answer(session, **names of the path, **query)`` gives JSON or a `Response`."""

    async def asked(request: Request) -> Response:
        named = {**request.query_params, **request.path_params}
        return await _answered(answer, request, named)

    return Route(path, asked, methods=["GET"], name=path)


def post(path: str, answer: Answer) -> Route:
    """Do what is asked: ``answer(session, body)``, of a body of JSON."""

    async def asked(request: Request) -> Response:
        return await _answered(answer, request, {"body": await _body(request)})

    return Route(path, asked, methods=["POST"], name=path)


async def _body(request: Request) -> Any:
    """Return what was sent, {} for nothing, None for what is no JSON."""
    sent = bytearray()
    async for part in request.stream():
        sent += part
        if len(sent) > MOST:
            return None
    try:
        import json

        return json.loads(sent) if sent else {}
    except ValueError:
        return None


async def _answered(answer: Answer, request: Request, named: dict[str, Any]) -> Response:
    try:
        if named.get("body", {}) is None:
            raise UsageError("the request is no JSON, or too long")
        found = await run_in_threadpool(answer, request.app.state.session, **named)
    except TomomeshError as error:
        return JSONResponse({"error": str(error), "flags": list(error.flags)}, 400)
    except (TypeError, ValueError, LookupError) as fault:
        return JSONResponse({"error": f"there is no such thing to ask for ({type(fault).__name__})", "flags": []}, 404)
    return found if isinstance(found, Response) else JSONResponse(found)


def levels(array: Any, **headers: Any) -> Response:
    """Answer with numbers as they lie in the memory, little-endian, and how they lie there in headers."""
    data = array.astype(array.dtype.newbyteorder("<"), order="C", copy=False)
    sent = {"x-dtype": data.dtype.str.lstrip("<|"), "x-shape": ",".join(map(str, data.shape))}
    sent |= {f"x-{name}": str(value) for name, value in headers.items()}
    return Response(data.tobytes(), media_type="application/octet-stream", headers=sent)
