"""Studies on a Dask scheduler whose workers, scheduler or connection are killed, stopped or cut."""

from __future__ import annotations

import atexit
import signal
import socket
import subprocess
import sys
from contextlib import suppress
from functools import cache
from threading import Event, Thread, Timer
from typing import TYPE_CHECKING, NamedTuple
from urllib.parse import urlsplit

import psutil
from campaign import Finding
from forks import Order, forks
from kills import judge_again, judge_end, judge_files, prepare
from scenarios import CLUSTER, NEW, SCENARIOS

if TYPE_CHECKING:
    import random
    from collections.abc import Callable, Iterable
    from pathlib import Path

HOST = "127.0.0.1"
# Time in which a study without trouble ends, s.
USUAL = 1.0


class Connection:
    """Connections to a server through this process, which can be cut, or hold back what is sent."""

    def __init__(self, port: int) -> None:
        self._port = port
        self._sockets: list[socket.socket] = []
        self._flows = Event()
        self._flows.set()
        self._door = socket.create_server((HOST, 0))
        self.port = self._door.getsockname()[1]
        Thread(target=self._accept, daemon=True).start()

    def _accept(self) -> None:
        with suppress(OSError):
            while True:
                ends = (self._door.accept()[0], socket.create_connection((HOST, self._port)))
                self._sockets += ends
                for source, target in (ends, ends[::-1]):
                    Thread(target=self._forward, args=(source, target), daemon=True).start()

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
        self._door.close()
        for one in self._sockets:
            with suppress(OSError):
                one.shutdown(socket.SHUT_RDWR)
        self._flows.set()


class Cluster(NamedTuple):
    """A scheduler, its process, which restarts two workers, and its port."""

    process: psutil.Popen
    port: int

    def workers(self) -> list[psutil.Process]:
        """Return the processes that compute."""
        children = self.process.children()
        return [one for one in children if "spawn_main" in " ".join(one.cmdline())]

    def end(self) -> None:
        """End all processes."""
        with suppress(psutil.NoSuchProcess):
            for one in (*self.process.children(recursive=True), self.process):
                with suppress(psutil.NoSuchProcess):
                    one.kill()
            self.process.wait()


@cache
def cluster() -> Cluster:
    """Return a cluster that ends with this process, at the latest."""
    process = psutil.Popen(
        [sys.executable, "-c", CLUSTER], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    port = urlsplit(process.stdout.readline().strip()).port
    assert port
    found = Cluster(process, port)
    atexit.register(found.end)
    return found


def _send(processes: Iterable[psutil.Process], number: int) -> None:
    for one in processes:
        with suppress(psutil.NoSuchProcess):
            one.send_signal(number)


# What happens to whom; of the last the cluster itself stays whole.
TROUBLES: dict[str, Callable[[Cluster, Connection], None]] = {
    "worker killed": lambda one, _: _send(one.workers()[:1], signal.SIGKILL),
    "worker stopped": lambda one, _: _send(one.workers()[:1], signal.SIGSTOP),
    "workers killed": lambda one, _: _send(one.workers(), signal.SIGKILL),
    "workers stopped": lambda one, _: _send(one.workers(), signal.SIGSTOP),
    "scheduler killed": lambda one, _: one.process.kill(),
    "scheduler stopped": lambda one, _: _send([one.process], signal.SIGSTOP),
    "connection held": lambda _, way: way.hold(),
    "connection cut": lambda _, way: way.cut(),
}


def check_clusters(tries: list[tuple[int, random.Random]], folder: Path) -> Iterable[Finding]:
    """Let a study on a scheduler meet trouble, then go on with it in threads."""
    place = folder / "cluster"
    for number, chance in tries:
        trouble = list(TROUBLES)[number % len(TROUBLES)]
        old, delay = chance.random() < 0.5, chance.uniform(0, USUAL)
        prepare(place, "sweep", old=old)
        way = Connection(cluster().port)
        command = SCENARIOS["dask"].command
        words = [{"SCHEDULER": f"tcp://{HOST}:{way.port}"}.get(word, word) for word in command]
        timer = Timer(delay, TROUBLES[trouble], (cluster(), way))
        timer.start()
        done = forks().run(
            Order([*(word.replace("IN", NEW) for word in words), "--replace"], str(place))
        )
        timer.cancel()
        timer.join()
        way.cut()
        if not trouble.startswith("connection") and not trouble.endswith("worker killed"):
            cluster().end()
            cluster.cache_clear()
        word = judge_end(done)
        last = (done.said.splitlines() or [""])[-1]
        if done.code and not last.startswith("thud-driver: "):
            word = word or "crashed: no sentence"
        word = word or judge_files("sweep", place, old=old, done=done.code == 0)
        again = forks().run(Order(SCENARIOS["sweep"].given(NEW), str(place)))
        word, _, what = (word or judge_again("sweep", place, again, old=old)).partition(": ")
        detail = f"{trouble} after {delay:.2f} s, old {old}: {done}, {again}, {what}"
        yield Finding(word or f"{trouble}, {'refused' if done.code else 'done'}", detail)
