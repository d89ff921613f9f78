"""Who may come in to the page, and what the page may do."""

from __future__ import annotations

import base64
import os
import signal
import socket
import subprocess
import sys
from typing import TYPE_CHECKING

import pytest

pytest.importorskip("starlette")
pytest.importorskip("uvicorn")

from pages import HERE, Page, served
from tomomesh.errors import UsageError
from tomomesh.view.doors import public_origin

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping


@pytest.fixture(scope="module")
def page() -> Iterator[Page]:
    with served() as page:
        assert page.ask("/")[0] == 403  # before the token
        page.enter()
        yield page


def test_our_own_page_comes_in(page: Page) -> None:
    status, headers, body = page.ask("/")
    assert status == 200
    assert headers["content-type"].startswith("text/html")
    assert b'<script type="module" src="app.js">' in body
    assert page.state()["opened"]["kind"] == "nothing"


def test_the_token_opens_once(page: Page) -> None:
    status, headers, _ = page.ask(f"/?token={page.token}", headers={"Cookie": ""})
    assert status == 403
    assert "set-cookie" not in headers


def test_the_cookie_is_kept_from_scripts_and_other_sites() -> None:
    with served() as fresh:
        _, headers, _ = fresh.ask(f"/?token={fresh.token}", headers={"Cookie": ""})
        kept = {part.strip().partition("=")[0] for part in headers["set-cookie"].split(";")[1:]}
        assert kept == {"HttpOnly", "SameSite", "Path"}
        assert "SameSite=Strict" in headers["set-cookie"]


@pytest.mark.parametrize("path", ["/", "/api/state", "/app.js", "/api/schema", "/three.js"])
def test_nothing_without_the_ticket(page: Page, path: str) -> None:
    for cookie in ("", page.cookie[:-1], page.cookie + "x", "tomomesh=1", page.cookie.partition("=")[0] + "="):
        assert page.ask(path, headers={"Cookie": cookie})[0] == 403


@pytest.mark.parametrize("host", ["evil.example", "127.0.0.1", "127.0.0.1:1", "0.0.0.0", "evil.example:80", "[::1]"])
def test_no_other_host(page: Page, host: str) -> None:
    assert page.ask("/api/state", headers={"Host": host})[0] == 403


@pytest.mark.parametrize("origin", ["", "http://evil.example", "null", "http://127.0.0.1", "http://127.0.0.1:1"])
def test_no_change_from_another_page(page: Page, origin: str) -> None:
    assert page.ask("/api/choose", {"neurons": 40}, headers={"Origin": origin})[0] == 403
    assert page.state()["choices"] == {}


def test_no_reading_by_another_page(page: Page) -> None:
    assert page.ask("/api/state", headers={"Sec-Fetch-Site": "cross-site"})[0] == 403
    assert page.ask("/api/state", headers={"Sec-Fetch-Site": "same-origin"})[0] == 200


def handshake(page: Page, headers: Mapping[str, str]) -> str:
    """Ask for a WebSocket, and return the first line of the answer."""
    sent = {
        "Host": f"{HERE}:{page.port}", "Origin": page.address.rstrip("/"), "Cookie": page.cookie,
        "Upgrade": "websocket", "Connection": "Upgrade", "Sec-WebSocket-Version": "13",
        "Sec-WebSocket-Key": base64.b64encode(os.urandom(16)).decode(), **headers,
    }  # fmt: skip
    with socket.create_connection((HERE, page.port)) as link:
        lines = ["GET /api/events HTTP/1.1", *(f"{name}: {value}" for name, value in sent.items() if value), "", ""]
        link.sendall("\r\n".join(lines).encode())
        return link.recv(4096).partition(b"\r\n")[0].decode()


def test_events_for_our_own_page_alone(page: Page) -> None:
    assert "101" in handshake(page, {})
    wrong = [{"Origin": "http://evil.example"}, {"Origin": ""}, {"Cookie": ""}, {"Host": "evil.example"}]
    for headers in wrong:
        assert "403" in handshake(page, headers)


@pytest.mark.parametrize("path", ["/", "/app.js", "/api/state", "/no-such-page", "/api/choose"])
def test_every_answer_bears_the_policy(page: Page, path: str) -> None:
    _, headers, _ = page.ask(path)
    policy = dict(one.strip().split(" ", 1) for one in headers["content-security-policy"].split(";"))
    assert policy["default-src"] == "'none'"
    assert policy["script-src"] == policy["style-src"] == policy["connect-src"] == "'self'"
    assert "unsafe" not in headers["content-security-policy"]
    assert headers["cache-control"] == "no-store"
    assert headers["x-content-type-options"] == "nosniff"


@pytest.mark.parametrize(
    "path",
    ["/../app.py", "/%2e%2e/app.py", "/..%2fapp.py", "/page/app.js", "/app.py", "/__init__.py", "/.html", "/%00"],
)
def test_no_path_outside(page: Page, path: str) -> None:
    status, _, body = page.ask(path)
    assert status == 404
    assert b"import" not in body


@pytest.mark.parametrize("body", [[], "x", {"no_such": 1}, {"neurons": "many"}, {"neurons": -1}, {"lower": [1] * 9}])
def test_choices_that_are_none(page: Page, body: object) -> None:
    status, _, data = page.ask("/api/choose", body)
    assert status == 400
    assert b"error" in data
    assert page.state()["choices"] == {}


def test_it_listens_on_this_machine_alone() -> None:
    for host in ("0.0.0.0", "::", "example.org"):
        command = [sys.executable, "-m", "tomomesh", "view", "--host", host, "--no-browser"]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        assert done.returncode == 2
        assert done.stderr.startswith("error: whoever reaches this host")


PROXY = "https://view.example.org"


@pytest.fixture(scope="module")
def behind() -> Iterator[Page]:
    """A page behind a proxy that hands on the host that it is asked for."""
    with socket.create_server((HERE, 0)) as free:
        port = free.getsockname()[1]
    command = [
        sys.executable,
        "-m",
        "tomomesh",
        "view",
        "--no-browser",
        "--port",
        str(port),
        "--public-url",
        PROXY + ":443/",
    ]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr is not None
        address, _, token = process.stderr.readline().removeprefix("open ").strip().partition("/?token=")
        assert address == PROXY
        yield Page(process, port, token)
        process.send_signal(signal.SIGINT)


def test_a_proxy_with_tls_is_our_own_origin(behind: Page) -> None:
    proxied = {"Host": "view.example.org", "Origin": PROXY}
    status, headers, _ = behind.ask(f"/?token={behind.token}", headers=proxied)
    assert (status, headers["location"]) == (303, "/")
    assert {"HttpOnly", "SameSite=Strict", "Secure"} <= {part.strip() for part in headers["set-cookie"].split(";")}
    assert behind.ask(f"/?token={behind.token}", headers=proxied)[0] == 403
    behind.cookie = headers["set-cookie"].partition(";")[0]
    assert behind.ask("/api/choose", {"neurons": 40}, headers=proxied)[0] == 200
    assert "101" in handshake(behind, proxied)
    for wrong in (
        {"Origin": "http://view.example.org"}, {"Origin": f"http://{HERE}:{behind.port}"}, {"Host": "evil.example"},
        {"Host": "view.example.org:443"}, {"Cookie": ""},
    ):  # fmt: skip
        assert behind.ask("/api/choose", {"neurons": 41}, headers=proxied | wrong)[0] == 403
        assert "403" in handshake(behind, proxied | wrong)
    assert behind.ask("/api/choose", {"neurons": 42}, headers={"Origin": PROXY})[0] == 403  # of this machine's own host
    assert behind.state()["choices"] == {"neurons": 40}


@pytest.mark.parametrize(
    "address",
    ["http://view.example.org", "https://", "view.example.org", "https://a@b.org", "https://b.org/view", "https://b.org?x",
     "https://b.org:x", "https://b.org:99999", "https://b.org#x", "", "https://[::1", "https:///x"],
)  # fmt: skip
def test_a_proxy_is_named_by_its_origin_alone(address: str) -> None:
    with pytest.raises(UsageError, match="--public-url"):
        public_origin(address)


@pytest.mark.parametrize("address", ["https://b.org", "https://B.org/", "https://b.org:443"])
def test_origins_are_as_browsers_write_them(address: str) -> None:
    assert public_origin(address) == "https://b.org"
    assert public_origin("https://[::1]:8443") == "https://[::1]:8443"
