"""The server of the page under load, and against those who do it harm."""

from __future__ import annotations

import json
import socket
import time
from contextlib import closing
from http.client import HTTPConnection
from typing import TYPE_CHECKING

import psutil
import pytest
from explorer_server import Served, answer_of, drag, place_of, serve

if TYPE_CHECKING:
    from collections.abc import Iterator

SHELL = {"model": {"name": "hollow_sphere"}}
SLOW = {"model": {"name": "finite_element"}, "mesh": {"polar_elements": 600}}


@pytest.fixture
def server() -> Iterator[Served]:
    """Return the address of a server, and its process."""
    with serve() as found:
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


def test_ten_users_drag_without_an_error(server: Served) -> None:
    assert len(drag(server[0], users=10, steps=30)) == 300


def test_idle_and_slow_connections_hinder_nobody(server: Served) -> None:
    host, port, token = place_of(server[0])
    begun = b"POST /solve HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 50\r\nX-Thud-Token: "
    slow = [socket.create_connection((host, port)) for _ in range(300)]
    for i, one in enumerate(slow):
        one.sendall((b"", b"POST /so", begun + token.encode() + b"\r\n\r\n{")[i % 3])
    with closing(HTTPConnection(host, port, timeout=60)) as connection:
        assert answer_of(connection, token, SHELL)["verdict"] == "does not conform"
    for one in slow:
        one.close()


def test_works_end_with_their_user_and_their_server(server: Served) -> None:
    host, port, token = place_of(server[0])
    with closing(HTTPConnection(host, port, timeout=60)) as connection:
        # Starts the process that forks the others.
        assert answer_of(connection, token, {**SHELL, "sampling": {"substeps": 1000}})
    before = processes_of(server)

    def begin() -> HTTPConnection:
        connection = HTTPConnection(host, port, timeout=60)
        connection.request("POST", "/solve", json.dumps(SLOW), {"X-Thud-Token": token})
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
    end = time.monotonic() + 20
    while any(map(alive, works)):
        assert time.monotonic() < end
        time.sleep(0.05)
    other.close()


def test_version_6_of_this_machine_is_served() -> None:
    with serve("--host", "::1") as (address, _):
        host, port, token = place_of(address)
        assert host == "[::1]"
        with closing(HTTPConnection(host.strip("[]"), port, timeout=60)) as connection:
            assert answer_of(connection, token, SHELL)
            # As a page that has found the address by another name.
            connection.request("GET", "/", headers={"Host": "rebound.example"})
            assert connection.getresponse().status == 400
