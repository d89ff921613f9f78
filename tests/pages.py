"""The page, served by the program itself, and asked without a browser."""

from __future__ import annotations

import http.client
import json
import os
import re
import signal
import subprocess
import sys
from contextlib import closing, contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping
    from pathlib import Path

HERE = "127.0.0.1"
ENDLESS = ("--network", "ring", "--training", "online", "--iterations", "30000000")
"""Choices with which a surface takes long on any machine, so that what stops it finds it at work."""


@dataclass
class Page:
    """A page that is served, and the ticket that was given for its token."""

    process: subprocess.Popen[str]
    port: int
    token: str
    cookie: str = ""

    @property
    def address(self) -> str:
        return f"http://{HERE}:{self.port}/"

    def ask(
        self, path: str, body: Any = None, *, method: str = "", headers: Mapping[str, str] | None = None
    ) -> tuple[int, dict[str, str], bytes]:
        """Ask as the page would, but for what is said otherwise; a header of "" is left out."""
        with closing(http.client.HTTPConnection(HERE, self.port, timeout=120)) as link:
            return self._asked(link, path, body, method, headers or {})

    def _asked(
        self, link: http.client.HTTPConnection, path: str, body: Any, method: str, headers: Mapping[str, str]
    ) -> tuple[int, dict[str, str], bytes]:
        sent = {"Host": f"{HERE}:{self.port}", "Cookie": self.cookie, "Origin": self.address.rstrip("/")}
        sent |= headers
        method = method or ("GET" if body is None else "POST")
        link.putrequest(method, path, skip_host=True)
        data = b"" if body is None else json.dumps(body).encode()
        for name, value in {**sent, "Content-Length": str(len(data))}.items():
            if value:
                link.putheader(name, value)
        link.endheaders(data)
        answer = link.getresponse()
        return answer.status, {name.lower(): value for name, value in answer.getheaders()}, answer.read()

    def enter(self) -> None:
        """Take the token to the door, and keep the ticket."""
        status, headers, _ = self.ask(f"/?token={self.token}")
        assert (status, headers["location"]) == (303, "/")
        self.cookie = headers["set-cookie"].partition(";")[0]

    def state(self, path: str = "/api/state", body: Any = None) -> Any:
        status, _, data = self.ask(path, body)
        assert status == 200, data
        return json.loads(data)

    def ready(self) -> Any:
        """Wait until no work is underway, and return the state; the test's own limit ends what never does."""
        while True:
            state = self.state()
            if state["job"] is None and (state["opened"]["ready"] or state["opened"]["kind"] == "nothing"):
                return state
            assert self.process.poll() is None
            assert not state["opened"]["refused"], state["opened"]["refused"]


@contextmanager
def served(*arguments: str | Path) -> Iterator[Page]:
    """Serve a page by the program, and end it by Ctrl-C."""
    command = [sys.executable, "-m", "tomomesh", "view", *map(str, arguments), "--no-browser"]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True, env=dict(os.environ))
    assert process.stderr is not None
    try:
        line = process.stderr.readline()
        found = re.search(r"http://127\.0\.0\.1:(\d+)/\?token=(\S+)", line)
        assert found, line + process.stderr.read()
        yield Page(process, int(found[1]), found[2])
    finally:
        process.send_signal(signal.SIGINT)
        process.communicate()
