"""The server of the page under load, and against those who do it harm."""

from __future__ import annotations

import json
import signal
import socket
import subprocess
import time
from contextlib import closing, suppress
from http.client import HTTPConnection
from typing import TYPE_CHECKING

import psutil
import pytest
from explorer_server import Served, drag, place_of, serve, solve_at

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

SHELL = {"model": {"name": "hollow_sphere"}}
SLOW = {"model": {"name": "finite_element"}, "mesh": {"polar_elements": 600}}


@pytest.fixture
def server(request: pytest.FixtureRequest) -> Iterator[Served]:
    """Return the address of a server, and its process; a parameter is what runs before it."""
    with serve(before=getattr(request, "param", "pass")) as found:
        yield found


def processes_of(server: Served) -> set[psutil.Process]:
    """Return the processes that a server has started, and theirs."""
    return set(psutil.Process(server[1].pid).children(recursive=True))


def alive(process: psutil.Process) -> bool:
    """Return whether a process runs; one that has ended may still be listed."""
    try:
        return bool(process.status() != psutil.STATUS_ZOMBIE)
    except psutil.NoSuchProcess:
        return False


def await_end(processes: set[psutil.Process]) -> None:
    """Wait until processes have ended."""
    end = time.monotonic() + 20
    while any(map(alive, processes)):
        assert time.monotonic() < end
        time.sleep(0.05)


@pytest.mark.slow
def test_ten_users_drag_without_an_error(server: Served) -> None:
    assert len(drag(server[0], users=10, steps=30)) == 300


def test_idle_and_slow_connections_hinder_nobody(server: Served) -> None:
    host, port, token = place_of(server[0])
    begun = b"POST /solve HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 50\r\nX-Thud-Token: "
    slow = [socket.create_connection((host, port)) for _ in range(300)]
    for i, one in enumerate(slow):
        one.sendall((b"", b"POST /so", begun + token.encode() + b"\r\n\r\n{")[i % 3])
    assert solve_at(server[0], SHELL)["result"] == "does_not_conform"
    for one in slow:
        one.close()


# Busy machines are slow.
PATIENT = "from thud.explorer import server; server.QUICK_TIME_LIMIT = 60.0"


@pytest.mark.parametrize("server", [PATIENT], indirect=True)
def test_works_end_with_their_user_and_their_server(server: Served) -> None:
    host, port, token = place_of(server[0])
    # Starts the process that forks the others, and the one of quick works.
    assert solve_at(server[0], {**SHELL, "sampling": {"substeps": 1000}})
    before = processes_of(server)

    def begin() -> HTTPConnection:
        connection = HTTPConnection(host, port, timeout=60)
        connection.request("POST", "/solve", json.dumps(SLOW), {"X-Thud-Token": token})
        # The first report is there before the work begins.
        assert connection.getresponse().readline()
        return connection

    def await_works(count: int) -> set[psutil.Process]:
        end = time.monotonic() + 20
        while len(works := processes_of(server) - before) != count:
            assert time.monotonic() < end
            time.sleep(0.05)
        return works

    one, other = begin(), begin()
    await_works(2)
    one.close()
    works = await_works(1)
    server[1].kill()
    server[1].wait(20)
    await_end(works)
    other.close()


def abandon(server: Served, values: object, count: int) -> None:
    """Ask for works and leave."""
    host, port, token = place_of(server[0])
    body = json.dumps(values).encode()
    head = f"POST /solve HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: {len(body)}\r\n"
    for _ in range(count):
        with socket.create_connection((host, port)) as connection:
            connection.sendall(f"{head}X-Thud-Token: {token}\r\n\r\n".encode() + body)


# Estimated at 0.09 s, and not far above.
MODAL = {"model": {"name": "modal_ball"}, "sampling": {"substeps": 8}}


@pytest.mark.slow
def test_abandoned_works_hinder_neither_a_user_nor_the_end(server: Served) -> None:
    for values in (SLOW, MODAL, SHELL):
        abandon(server, values, 60)
    assert solve_at(server[0], SHELL)
    for values in (SLOW, MODAL, SHELL):
        abandon(server, values, 60)
    works = processes_of(server)
    server[1].send_signal(signal.SIGTERM)
    assert server[1].wait(20) == 128 + signal.SIGTERM
    await_end(works)


HANGING = "import asyncio, uvicorn; uvicorn.Server.shutdown = lambda *_, **__: asyncio.sleep(600)"


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.slow
def test_second_signal_ends_a_server_that_hangs(number: signal.Signals, tmp_path: Path) -> None:
    before = f"import tempfile; tempfile.tempdir = {str(tmp_path)!r}; {HANGING}"
    with serve(before=before) as server:
        assert solve_at(server[0], SHELL)
        abandon(server, SLOW, 60)
        works = processes_of(server)
        server[1].send_signal(number)
        with pytest.raises(subprocess.TimeoutExpired):
            server[1].wait(1)
        server[1].send_signal(number)
        assert server[1].wait(20) == 128 + number
    await_end(works)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("files", [200, 1000])
@pytest.mark.slow
def test_unfinished_heads_hinder_nobody_and_fill_no_log(files: int, tmp_path: Path) -> None:
    limit = f"import resource; resource.setrlimit(resource.RLIMIT_NOFILE, ({files}, {files}))"
    kinds = (b"", b"POST /so", b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nX: ")
    with (tmp_path / "screen").open("w+") as screen, serve(before=limit, screen=screen) as server:
        host, port, _ = place_of(server[0])
        heads = []
        for i in range(3 * files // 2):
            heads.append(socket.create_connection((host, port), 60))
            heads[-1].sendall(kinds[i % 3])
        assert solve_at(server[0], SHELL)
        for one in heads:
            one.close()
        screen.seek(0)
        assert len(screen.readlines()) < 5


def test_heads_have_a_time() -> None:
    before = "from thud.explorer import connections; connections.HEAD_TIME = 0.5"
    with serve(before=before) as server:
        host, port, _ = place_of(server[0])
        for text in (b"", b"GET", b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\nGET"):
            with socket.create_connection((host, port), 20) as connection:
                connection.sendall(text)
                # A byte now and then makes it no longer.
                sent = 0
                with suppress(ConnectionError):
                    for sent in range(100):  # noqa: B007 - how many there were
                        time.sleep(0.05)
                        connection.sendall(b"x")
                assert sent < 99


@pytest.mark.slow
def test_answers_have_to_be_read() -> None:
    before = "from thud.explorer import connections; connections.HEAD_TIME = 0.5"
    count = 20_000
    ask = b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n" * count
    read = 0
    with serve(before=before) as server:
        host, port, _ = place_of(server[0])
        # What was sent may still be read; then the connection is gone.
        with socket.create_connection((host, port), 20) as connection, suppress(ConnectionError):
            connection.sendall(ask)
            time.sleep(5)
            while part := connection.recv(2**20):
                read += len(part)
    assert read < count * 10_000


def test_version_6_of_this_machine_is_served() -> None:
    with serve("--host", "::1") as (address, _):
        host, port, _ = place_of(address)
        assert host == "[::1]"
        assert solve_at(address, SHELL)
        with closing(HTTPConnection(host.strip("[]"), port, timeout=60)) as connection:
            # As a page that has found the address by another name.
            connection.request("GET", "/", headers={"Host": "rebound.example"})
            assert connection.getresponse().status == 400


def test_body_of_an_answer_does_not_wait_for_an_acknowledgment(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    connections = pytest.importorskip("thud.explorer.connections")
    monkeypatch.setattr("thud.explorer.connections._Server.run", lambda _self, sockets: sockets)
    with socket.create_server(("127.0.0.1", 0)) as listener:
        connections.run_server(None, listener, tmp_path)
        with socket.create_connection(listener.getsockname()), listener.accept()[0] as connection:
            assert connection.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY)
