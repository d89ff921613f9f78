"""``tomomesh view``: the page in a browser."""

from __future__ import annotations

import sys
import webbrowser
from typing import TYPE_CHECKING

from ..errors import UsageError
from .options import build_parser

if TYPE_CHECKING:
    from argparse import Namespace
    from collections.abc import Sequence
    from typing import Any

    from ..settings import Settings
    from ..view.opened import Opened

ANYWHERE = "anybody-who-has-the-address-may-see-it"
"""What ``--i-know`` wants to be told, for other hosts than this machine."""
LOCAL = ("127.0.0.1", "localhost")


def view(chosen: Namespace, settings: Settings, given: dict[str, Any]) -> None:
    """Serve the page until Ctrl-C."""
    if chosen.host not in LOCAL and chosen.i_know != ANYWHERE:
        raise UsageError(
            "whoever reaches this host and has the address sees the study", found=f"--host {chosen.host}",
            expected=f"--i-know {ANYWHERE}, and TLS in front (docs/view.md)",
        )  # fmt: skip
    from ..view import require_view

    require_view()
    from ..view.doors import public_origin
    from ..view.reach import Reach, browsed
    from ..view.server import serve
    from ..view.session import Session
    from .commands import run
    from .outputs.write import write_one

    def ran(words: Sequence[str]) -> None:
        run(build_parser().parse_args(words))

    public = "" if chosen.public_url is None else public_origin(chosen.public_url)
    opened = _opened(chosen.looked_at, chosen.labels_in)

    def started(address: str) -> None:
        print(f"open {address}\nCtrl-C ends it", file=sys.stderr, flush=True)
        if not chosen.no_browser:
            webbrowser.open(address)

    folder = None if chosen.browse is None else browsed(chosen.browse)
    session = Session(opened, given, Reach(opened.words, folder), write=write_one, run=ran)
    host = "127.0.0.1" if chosen.host in LOCAL else chosen.host
    serve(session, started, host=host, port=chosen.port, public=public)


def _opened(path: str | None, beside: str | None) -> Opened:
    from ..view.opened import Opened, kind_of

    kind = "nothing" if path is None else kind_of(path)
    if beside and kind != "study":
        raise UsageError("a label map lies beside a study", found=f"--labels-in, and {kind}", expected="STUDY")
    return Opened(kind, () if path is None else (path,), beside or "")
