"""The server of the page under load, and against those who do it harm."""

from __future__ import annotations

import json
import signal
import socket
import time
from contextlib import closing, suppress
from http.client import HTTPConnection
from typing import TYPE_CHECKING

import psutil
import pytest
from explorer_server import Served, drag, place_of, serve, solve_at

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

SHELL = {"model": {"name": "hollow_sphere"}}
SLOW = {"model": {"name": "finite_element"}, "mesh": {"polar_elements": 600}}


@pytest.fixture
def server() -> Iterator[Served]:
    with serve() as found:
        yield found


def processes_of(server: Served) -> set[psutil.Process]:
    """Return the processes that a server has started, and theirs."""
    return set(psutil.Process(server[1].pid).children(recursive=True))


def await_end(processes: set[psutil.Process]) -> None:
    """Wait until processes have ended; one that nobody waits for stays as a zombie."""

    def is_alive(process: psutil.Process) -> bool:
        with suppress(psutil.NoSuchProcess):
            return bool(process.status() != psutil.STATUS_ZOMBIE)
        return False

    await_that(lambda: not any(map(is_alive, processes)))


def await_that(condition: Callable[[], bool]) -> None:
    end = time.monotonic() + 20
    while not condition():
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


def test_works_end_with_their_user_and_their_server(server: Served) -> None:
    host, port, token = place_of(server[0])
    # Starts the process that forks the others; the one of this case computes the next one.
    assert solve_at(server[0], SHELL)
    before = processes_of(server) - {max(processes_of(server), key=lambda one: one.pid)}

    def begin() -> HTTPConnection:
        connection = HTTPConnection(host, port, timeout=60)
        connection.request("POST", "/solve", json.dumps(SLOW), {"X-Thud-Token": token})
        return connection

    one, other = begin(), begin()
    await_that(lambda: len(processes_of(server) - before) == 2)
    one.close()
    await_that(lambda: len(processes_of(server) - before) == 1)
    works = processes_of(server) - before
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


def test_version_6_of_this_machine_is_served() -> None:
    with serve("--host", "::1") as (address, _):
        host, port, _ = place_of(address)
        assert host == "[::1]"
        assert solve_at(address, SHELL)
        with closing(HTTPConnection(host.strip("[]"), port, timeout=60)) as connection:
            # As a page that has found the address by another name.
            connection.request("GET", "/", headers={"Host": "rebound.example"})
            response = connection.getresponse()
            assert response.status == 400
            assert response.headers["X-Content-Type-Options"] == "nosniff"


def test_body_of_an_answer_waits_for_no_acknowledgment(monkeypatch: pytest.MonkeyPatch) -> None:
    server = pytest.importorskip("thud.explorer.server")
    monkeypatch.setattr("uvicorn.Server.run", lambda _self, sockets: sockets)
    with socket.create_server(("127.0.0.1", 0)) as listener:
        server.run_server(None, listener)
        with socket.create_connection(listener.getsockname()), listener.accept()[0] as connection:
            assert connection.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY)
