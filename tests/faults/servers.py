"""The explorer with hostile, absent and several users, its processes killed or stopped."""

from __future__ import annotations

import atexit
import http.client
import json
import signal
import socket
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple
from urllib.parse import urlsplit

import psutil
from campaign import Finding
from injection import PATIENCE

from thud.base._schema import GROUPS, MODELS

if TYPE_CHECKING:
    import random
    from collections.abc import Callable, Iterable

TOKEN = "x-thud-token"  # noqa: S105 - its name
HOST = "127.0.0.1"
# Answers of a server that is well.
WELL = (200, 400, 403, 404, 405, 411, 413, 422, 431)
VALUES: list[Any] = [0, -1, 1e300, 1e-300, "NaN", "1", None, True, [], [1, [2]], {}, "x" * 2000,
                     2**70, 10**400, "é\0", -0.0, 1.5, [1e9] * 500]  # fmt: skip
LONG = {"model": {"name": "finite_element"}, "mesh": {"radial_elements": 16, "polar_elements": 512}}
# Bytes that a server may keep of users that have left, and lines that it may log of them.
GROWTH, LINES = 50e6, 10


class Explorer(NamedTuple):
    """A running explorer, and what it writes to the screen."""

    process: subprocess.Popen[str]
    screen: Path
    port: int
    token: str

    def ask(self, path: str, body: bytes | None = None, **headers: str) -> tuple[int, bytes]:
        """Return status and content of an answer."""
        with closing(http.client.HTTPConnection(HOST, self.port, timeout=PATIENCE)) as connection:
            method = "GET" if body is None else "POST"
            connection.request(method, path, body, {TOKEN: self.token, **headers})
            answer = connection.getresponse()
            return answer.status, answer.read()

    def workers(self) -> list[psutil.Process]:
        """Return the processes that are at work, or stopped; others wait for quick works."""
        forks = [child.children() for child in psutil.Process(self.process.pid).children()]
        idle = (psutil.STATUS_SLEEPING, psutil.STATUS_ZOMBIE)
        return [
            one for some in forks for one in some if one.is_running() and one.status() not in idle
        ]

    def begin(self, path: str, body: bytes, *, sent: int | None = None) -> socket.socket:
        """Return the connection of a request of which no more than so many bytes are sent."""
        head = f"POST {path} HTTP/1.1\r\nHost: {HOST}\r\nContent-Length: {len(body)}\r\n"
        connection = socket.create_connection((HOST, self.port), PATIENCE)
        connection.sendall((f"{head}{TOKEN}: {self.token}\r\n\r\n".encode() + body)[:sent])
        return connection


@cache
def explorer() -> Explorer:
    """Return an explorer that ends with this process, at the latest."""
    screen = Path(tempfile.mkdtemp(prefix="thud_faults_"), "screen")
    with screen.open("w") as file:
        process = subprocess.Popen(
            [sys.executable, "-m", "thud", "explore", "--no-browser", "--port", "0"],
            stdout=subprocess.PIPE,
            stderr=file,
            text=True,
        )
    atexit.register(process.kill)
    assert process.stdout
    page = urlsplit(process.stdout.readline().removeprefix("Page: ").strip())
    assert page.port
    found = Explorer(process, screen, page.port, page.fragment.removeprefix("token="))
    found.ask("/about")
    return found


def check_explorer(tries: list[tuple[int, random.Random]], _: Path) -> Iterable[Finding]:
    """Ask the explorer what no page would, then what one does."""
    for number, chance in tries:
        kind = list(KINDS)[number % len(KINDS)]
        try:
            found = KINDS[kind](explorer(), chance)
        except (OSError, subprocess.TimeoutExpired) as error:
            late = isinstance(error, (TimeoutError, subprocess.TimeoutExpired))
            found = f"{'hung' if late else 'crashed'}: {error!r}"
        except (http.client.HTTPException, ValueError, LookupError) as error:
            found = f"lost: {error!r}"
        word, _, what = (found or _well(explorer())).partition(": ")
        if explorer().process.poll() is not None:
            word, what = "crashed", f"the server has ended: {what}"
            explorer.cache_clear()
        yield Finding(word or kind, f"{kind}: {what}")


def _well(server: Explorer) -> str:
    """Return the fault of a server that does not answer as usual, or has processes left."""
    if "Traceback" in (said := server.screen.read_text()):
        server.screen.write_text("")
        return f"crashed: {said[-1000:]}"
    status, content = server.ask("/solve", _case(1.0, "hollow_sphere"))
    if status != 200 or not _same(content, 1.0, "hollow_sphere"):
        return f"mixed: {status}, {content[:300]!r}"
    until = time.monotonic() + PATIENCE
    while left := server.workers():
        if time.monotonic() > until:
            return f"hung: {left} are left"
        time.sleep(0.05)
    return ""


def _case(height: float, model: str) -> bytes:
    """Return the request of a case; one of the models is answered at once, one by a process."""
    mesh = {"mesh": {"polar_elements": 40}} if model == "finite_element" else {}
    return json.dumps({"drop": {"height": height}, "model": {"name": model}, **mesh}).encode()


@cache
def _expected(height: float, model: str) -> dict[str, Any]:
    from thud.explorer.answer import answer_case, new_case

    found = answer_case(new_case(json.loads(_case(height, model))))
    return json.loads(json.dumps(found))  # type: ignore[no-any-return]


def _same(content: bytes, height: float, model: str) -> bool:
    """Return whether the last report of an answer is that of a case."""
    answer = json.loads(content.splitlines()[-1])["answer"]
    return bool(answer == _expected(height, model))


def _judged(status: int, content: bytes) -> str:
    text = content.decode("utf-8", "replace")
    if status not in WELL or "Traceback" in text:
        return f"crashed: {status}, {text[:500]}"
    return "NaN" if status == 200 and b"NaN" in content else ""


def _hostile_case(server: Explorer, chance: random.Random) -> str:
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
    downloads = [f"/download/{name}" for name in ("case.nml", "force.csv", "case.py")]
    return _judged(*server.ask(chance.choice(["/solve", *downloads]), body))


def _hostile_record(server: Explorer, chance: random.Random) -> str:
    name = chance.choice(["a.wav", "../../a.csv", "a.mat", "x" * 300 + ".tdms", ".uff", "a\0.csv"])
    body = chance.choice([b"", b"RIFF" + chance.randbytes(200), b"0,1\n" * 100, b"\xff" * 5000])
    height = chance.choice(["1", "NaN", "x", "-1", "1e999"])
    part = "--edge\r\nContent-Disposition: form-data; name="
    table = f'{part}"table"\r\n\r\n{{"height": {height}}}\r\n'
    file = f'{part}"file"; filename="{name}"\r\n\r\n'
    form = f"{table}{file}".encode() + body + b"\r\n--edge--\r\n"
    kind = {"Content-Type": "multipart/form-data; boundary=edge"}
    return _judged(*server.ask("/measure", form, **kind))


def _hostile_request(server: Explorer, chance: random.Random) -> str:
    """Send what is no request, or half of one, and leave."""
    long = b"GET " + b"/x" * 40_000 + b" HTTP/1.1\r\n\r\n"
    text = chance.choice((chance.randbytes(300), b"GET / HTTP/9\r\n\r\n", long))
    half = server.begin("/measure", b"RIFF" * 20_000, sent=chance.randint(0, 300))
    with half, socket.create_connection((HOST, server.port), PATIENCE) as connection:
        connection.sendall(text)
        time.sleep(chance.uniform(0, 0.05))
    return ""


def _stranger(server: Explorer, chance: random.Random) -> str:
    headers = chance.choice([{TOKEN: ""}, {TOKEN: "x" * 22}, {"Host": "evil.example"}])
    status, content = server.ask("/solve", b"{}", **headers)
    return "" if status in (400, 403) else f"mixed: {headers} gets {status}, {content[:100]!r}"


def _two_users(server: Explorer, chance: random.Random) -> str:
    def use(height: float) -> bool:
        models = [chance.choice(["hollow_sphere", "finite_element"]) for _ in range(3)]
        return all(_same(server.ask("/solve", _case(height, m))[1], height, m) for m in models)

    with ThreadPoolExecutor(4) as users:
        well = all(users.map(use, (0.5, 1.0, 0.7, 1.3)))
    return "" if well else "mixed: the answer of another user"


def _work(server: Explorer) -> http.client.HTTPResponse:
    """Begin work that takes minutes; return its answer, whose end ends the connection."""
    with server.begin("/solve", json.dumps(LONG).encode()) as connection:
        return http.client.HTTPResponse(connection)


def _leave(server: Explorer, chance: random.Random) -> str:
    """Close pages in the middle of slow and of quick works, which have to end; end some servers."""
    process = psutil.Process(server.process.pid)
    before = process.memory_info().rss
    bodies = [json.dumps(LONG).encode(), _case(1.0, "hollow_sphere"), _case(1.0, "modal_ball")]
    for _ in range(chance.choice([1, 10, 60])):
        path = chance.choice(["/solve", "/solve", "/download/force.csv"])
        with server.begin(path, chance.choice(bodies)):
            time.sleep(chance.choice([0, chance.uniform(0, 0.1)]))
    if chance.random() < 0.3:
        server.process.send_signal(chance.choice([signal.SIGTERM, signal.SIGINT]))
        explorer.cache_clear()
        server.process.wait(PATIENCE)
        return ""
    grown = process.memory_info().rss - before
    return _well(server) or (f"grown: {grown} bytes" if grown > GROWTH else "")


def _kill_work(server: Explorer, chance: random.Random) -> str:
    with _work(server) as answer:
        _signal(server, signal.SIGKILL, chance)
        answer.begin()
        content = answer.read()
    return "" if b"ended without an answer" in content else f"lost: {content[-300:]!r}"


def _stop_work(server: Explorer, chance: random.Random) -> str:
    """Stop a process: others are served, and it ends when its page leaves."""
    with _work(server):
        _signal(server, signal.SIGSTOP, chance)
        content = server.ask("/solve", _case(0.7, "finite_element"))[1]
    return "" if _same(content, 0.7, "finite_element") else "mixed: the answer beside a stopped one"


def _signal(server: Explorer, number: signal.Signals, chance: random.Random) -> None:
    time.sleep(chance.uniform(0, 0.2))
    while not (workers := server.workers()):
        time.sleep(0.01)
    for worker in workers:
        worker.send_signal(number)


KINDS: dict[str, Callable[[Explorer, Any], str]] = {
    "hostile case": _hostile_case,
    "hostile record": _hostile_record,
    "hostile request": _hostile_request,
    "stranger": _stranger,
    "two users": _two_users,
    "page left": _leave,
    "work killed": _kill_work,
    "work stopped": _stop_work,
}
