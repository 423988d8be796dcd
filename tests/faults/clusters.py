"""Studies on a Dask scheduler whose workers, scheduler or connection are killed, stopped or cut."""

from __future__ import annotations

import signal
import socket
import time
from contextlib import suppress
from threading import Event, Thread, Timer
from typing import TYPE_CHECKING, NamedTuple
from urllib.parse import urlsplit

import psutil
from forks import Order, forks
from kills import judge, prepare
from scenarios import NEW, SCENARIOS, cluster

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable
    from pathlib import Path

    from campaign import Finding, Tries
    from scenarios import Cluster

HOST = "127.0.0.1"
# Time in which a study without trouble ends, s.
USUAL = 1.0
WORKERS = 2


class Connection:
    """Connections to a server through this process, which can be cut, or hold back what is sent."""

    def __init__(self, port: int) -> None:
        self._port = port
        self._sockets: list[socket.socket] = []
        self._flows = Event()
        self._flows.set()
        self._door = socket.create_server((HOST, 0))
        self.port = self._door.getsockname()[1]
        self._threads = [Thread(target=self._accept, daemon=True)]
        self._threads[0].start()

    def _accept(self) -> None:
        with suppress(OSError):
            while True:
                near = self._door.accept()[0]
                self._sockets.append(near)
                far = socket.create_connection((HOST, self._port))
                self._sockets.append(far)
                for ends in ((near, far), (far, near)):
                    self._threads.append(Thread(target=self._forward, args=ends, daemon=True))
                    self._threads[-1].start()

    def _forward(self, source: socket.socket, target: socket.socket) -> None:
        with suppress(OSError):
            while content := source.recv(65536):
                self._flows.wait()
                target.sendall(content)
            target.shutdown(socket.SHUT_WR)

    def hold(self) -> None:
        """Hold back what is sent from now on."""
        self._flows.clear()

    def cut(self) -> None:
        """End all connections, and take no more."""
        # Closing alone does not wake up a thread that waits for the next one.
        with suppress(OSError):
            self._door.shutdown(socket.SHUT_RDWR)
        self._threads[0].join()
        self._flows.set()
        for one in self._sockets:
            with suppress(OSError):
                one.shutdown(socket.SHUT_RDWR)
        for thread in self._threads:
            thread.join()
        for one in (self._door, *self._sockets):
            one.close()


def _send(processes: Iterable[psutil.Process], number: int) -> int:
    """Send a signal; return how many were there."""
    hit = 0
    for one in processes:
        with suppress(psutil.NoSuchProcess):
            one.send_signal(number)
            hit += 1
    return hit


class Trouble(NamedTuple):
    """What happens, to how many, and whether the cluster can be used afterwards."""

    strike: Callable[[Cluster, Connection], object]
    harmless: bool = False


TROUBLES = {
    "worker killed": Trouble(
        lambda one, _: _send(one.workers()[:1], signal.SIGKILL), harmless=True
    ),
    "worker stopped": Trouble(lambda one, _: _send(one.workers()[:1], signal.SIGSTOP)),
    "workers killed": Trouble(lambda one, _: _send(one.workers(), signal.SIGKILL)),
    "workers stopped": Trouble(lambda one, _: _send(one.workers(), signal.SIGSTOP)),
    "scheduler killed": Trouble(lambda one, _: _send([one.process], signal.SIGKILL)),
    "scheduler stopped": Trouble(lambda one, _: _send([one.process], signal.SIGSTOP)),
    "connection held": Trouble(lambda _, way: way.hold() or 1, harmless=True),
    "connection cut": Trouble(lambda _, way: way.cut() or 1, harmless=True),
}


def check_clusters(tries: Tries, folder: Path) -> Iterable[Finding]:
    """Let a study on a scheduler meet trouble, then go on with it in threads."""
    place = folder / "cluster"
    for number, chance in tries:
        name, trouble = list(TROUBLES.items())[number % len(TROUBLES)]
        old, delay = chance.random() < 0.5, chance.uniform(0, USUAL)
        prepare(place, "sweep", old=old)
        while len(cluster().workers()) < WORKERS:
            time.sleep(0.1)
        way = Connection(urlsplit(cluster().address).port or 0)
        hit: list[object] = []
        timer = Timer(delay, lambda: hit.append(trouble.strike(cluster(), way)))  # noqa: B023 - joined below
        timer.start()
        command = SCENARIOS["dask"].given(NEW, f"tcp://{HOST}:{way.port}")
        done = forks().run(Order(command, str(place)))
        timer.cancel()
        timer.join()
        way.cut()
        if not trouble.harmless:
            cluster().end()
            cluster.cache_clear()
        when = f"after {delay:.2f} s" if hit and hit[0] else "too late"
        yield judge("sweep", place, done, f"{name} {when}", old=old)
