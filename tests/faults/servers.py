"""The explorer with hostile pages: each gets an answer, and the next user what it asks for."""

from __future__ import annotations

import atexit
import http.client
import json
import os
import socket
import sys
import tempfile
import time
from contextlib import ExitStack, closing
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any
from unittest import mock

import psutil

sys.path.insert(0, str(Path(__file__).parents[1] / "driver"))
from explorer_server import place_of, serve

from thud.base._schema import GROUPS, MODELS

if TYPE_CHECKING:
    import random
    import subprocess

TOKEN = "x-thud-token"  # noqa: S105 - its name
# Answers of a server that is well; seconds that one may take.
WELL = (200, 400, 403, 404, 405, 411, 413, 422, 431)
PATIENCE = 60
VALUES: list[Any] = [0, -1, 1e300, 1e-300, "NaN", "1", None, True, [], [1, [2]], {}, "x" * 2000,
                     2**70, 10**400, "é\0", -0.0, 1.5, [1e9] * 500]  # fmt: skip
CASE = b'{"model": {"name": "hollow_sphere"}}'
LONG = {"model": {"name": "finite_element"}, "mesh": {"radial_elements": 16, "polar_elements": 512}}


@cache
def explorer() -> tuple[str, subprocess.Popen[str], Path, bytes]:
    """Return address, process, screen and first answer of a server that ends with this process."""
    stack = ExitStack()
    atexit.register(stack.close)
    # It works while the files that attempts leave are counted.
    folder = Path(tempfile.mkdtemp(dir="..")).resolve()
    screen = folder / "screen"
    stack.enter_context(mock.patch.dict(os.environ, TMPDIR=str(folder)))
    address, process = stack.enter_context(serve(screen=stack.enter_context(screen.open("w"))))
    return address, process, screen, _ask(address, "/solve", CASE)[1]


def _ask(address: str, path: str, body: bytes, **headers: str) -> tuple[int, bytes]:
    """Return status and content of an answer."""
    host, port, token = place_of(address)
    with closing(http.client.HTTPConnection(host, port, timeout=PATIENCE)) as connection:
        connection.request("POST", path, body, {TOKEN: token, **headers})
        answer = connection.getresponse()
        return answer.status, answer.read()


def attempt(chance: random.Random) -> tuple[str, str]:
    """Ask the explorer what no page would, then what one does."""
    kind = chance.choice([_hostile_case, _hostile_request, _killed_work])
    address, process, screen, expected = explorer()
    if wrong := kind(address, chance):
        return wrong
    if process.poll() is not None or "Traceback" in screen.read_text():
        explorer.cache_clear()
        return "crashed", f"{kind.__name__}: {process.poll()}, {screen.read_text()[-1000:]}"
    status, content = _ask(address, "/solve", CASE)
    if (status, content) != (200, expected):
        return "mixed", f"{kind.__name__}: {status}, {content[:300]!r}"
    return kind.__name__[1:], ""


def _judged(status: int, content: bytes) -> tuple[str, str] | None:
    text = content.decode("utf-8", "replace")
    if status not in WELL or "Traceback" in text:
        return "crashed", f"{status}, {text[:500]}"
    return ("NaN", text) if status == 200 and "NaN" in text else None


def _hostile_case(address: str, chance: random.Random) -> tuple[str, str] | None:
    groups: Any = {}
    for _ in range(chance.randint(0, 4)):
        name = chance.choice([*GROUPS, *MODELS, "model", "floor", "room", "x"])
        known = vars(GROUPS[name]()) if name in GROUPS else ("mass",)
        keys = [*known, "name", "drop.height", "é"]
        groups[name] = {chance.choice(keys): chance.choice(VALUES) for _ in range(2)}
    body = json.dumps(chance.choice([groups, groups, [groups], chance.choice(VALUES)])).encode()
    if chance.random() < 0.3:
        at = chance.randrange(len(body) + 1)
        body = body[:at] + chance.randbytes(3) + body[at:]
    files = [f"/download/{name}" for name in ("case.nml", "force.csv", "case.py")]
    return _judged(*_ask(address, chance.choice(["/solve", *files]), body))


def _begin(address: str, path: str, body: bytes, sent: int | None = None) -> socket.socket:
    """Return the connection of a request of which no more than so many bytes are sent."""
    host, port, token = place_of(address)
    head = f"POST {path} HTTP/1.1\r\nHost: {host}\r\nContent-Length: {len(body)}\r\n"
    connection = socket.create_connection((host, port), PATIENCE)
    connection.sendall((f"{head}{TOKEN}: {token}\r\n\r\n".encode() + body)[:sent])
    return connection


def _hostile_request(address: str, chance: random.Random) -> None:
    """Send what is no request, or half of one, and leave."""
    long = b"GET " + b"/x" * 40_000 + b" HTTP/1.1\r\n\r\n"
    text = chance.choice((chance.randbytes(300), b"GET / HTTP/9\r\n\r\n", long))
    half = _begin(address, "/measure", b"RIFF" * 20_000, chance.randint(0, 300))
    with half, socket.create_connection(place_of(address)[:2], PATIENCE) as connection:
        connection.sendall(text)
        time.sleep(chance.uniform(0, 0.05))


def _killed_work(address: str, chance: random.Random) -> tuple[str, str] | None:
    """Kill the process that works: its page says so."""
    with _begin(address, "/solve", json.dumps(LONG).encode()) as connection:
        answer = http.client.HTTPResponse(connection)
        time.sleep(chance.uniform(0, 0.2))
        while not (workers := _workers()):
            time.sleep(0.01)
        for worker in workers:
            worker.kill()
        answer.begin()
        content = answer.read()
    return None if b"ended without an answer" in content else ("wrong", repr(content[-300:]))


def _workers() -> list[psutil.Process]:
    """Return the processes that are at work; others wait for quick works."""
    forks = [child.children() for child in psutil.Process(explorer()[1].pid).children()]
    idle = (psutil.STATUS_SLEEPING, psutil.STATUS_ZOMBIE)
    return [one for some in forks for one in some if one.is_running() and one.status() not in idle]
