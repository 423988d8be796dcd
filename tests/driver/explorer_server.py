"""A running server of the page, and users that ask it, for tests and benchmarks."""

from __future__ import annotations

import json
import re
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing, contextmanager
from http.client import HTTPConnection
from itertools import chain
from typing import IO, TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Iterator

Served = tuple[str, "subprocess.Popen[str]"]


@contextmanager
def serve(*arguments: str, screen: IO[str] | None = None) -> Iterator[Served]:
    """Yield the address of a server, and its process; `screen` takes its errors."""
    command = [sys.executable, "-m", "thud", "explore", "--no-browser", *arguments]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=screen, text=True) as process:
        assert process.stdout is not None
        address = re.search(r"http\S+", process.stdout.readline())
        assert address
        try:
            yield address[0], process
        finally:
            process.send_signal(signal.SIGINT)
            process.wait(20)


def place_of(address: str) -> tuple[str, int, str]:
    """Return host, port and token of an address."""
    found = re.fullmatch(r"http://(.+):(\d+)/#token=(.+)", address)
    assert found
    return found[1], int(found[2]), found[3]


def answer_of(connection: HTTPConnection, token: str, values: dict[str, Any]) -> dict[str, Any]:
    """Return the answer to a case."""
    connection.request("POST", "/solve", json.dumps(values), {"X-Thud-Token": token})
    answer: dict[str, Any] = json.loads(connection.getresponse().read())["answer"]
    return answer


def solve_at(address: str, values: dict[str, Any]) -> dict[str, Any]:
    """Return the answer to a case over a connection of its own."""
    host, port, token = place_of(address)
    with closing(HTTPConnection(host.strip("[]"), port, timeout=60)) as connection:
        return answer_of(connection, token, values)


def drag(address: str, users: int, steps: int) -> list[float]:
    """Let users drag the height of models in turn, all at once; return the times of answers, s.

    An answer that is not that of the user's own case is a failure.
    """
    host, port, token = place_of(address)

    def ask(user: int) -> list[float]:
        model = ("hollow_sphere", "modal_ball")[user % 2]
        times = []
        with closing(HTTPConnection(host, port, timeout=60)) as connection:
            for step in range(steps):
                height = 0.5 + 0.1 * user + 0.0005 * step
                values = {"model": {"name": model}, "drop": {"height": height}}
                start = time.perf_counter()
                criteria = answer_of(connection, token, values)["criteria"]
                times.append(time.perf_counter() - start)
                assert abs(criteria[-1]["value"] - height) < 1e-6
        return times

    with ThreadPoolExecutor(users) as pool:
        return list(chain(*pool.map(ask, range(users))))
