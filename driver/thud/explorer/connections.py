"""Connections of the server: their maximum number, time limits and log."""

from __future__ import annotations

import asyncio
import logging
import os
import resource
import shutil
import socket
import time
from multiprocessing import active_children
from multiprocessing.util import get_temp_dir
from typing import TYPE_CHECKING

from uvicorn import Config, Server
from uvicorn.protocols.http.h11_impl import H11Protocol

if TYPE_CHECKING:
    from pathlib import Path
    from types import FrameType

    from starlette.applications import Starlette

# Time limit for receiving the head of a request, and for a client to continue reading an answer, s.
HEAD_TIME = 10
# Minimum time between two logged messages of the same kind, s.
LOG_INTERVAL = 60.0


# Maximum number of connections, a quarter of the allowed open files: tasks also open files.
_FILES, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
MAX_CONNECTIONS = 500 if _FILES == resource.RLIM_INFINITY else min(500, _FILES // 4)


def run_server(application: Starlette, listener: socket.socket, folder: Path) -> None:
    """Serve an application on a listening socket until a signal.

    A second signal ends the process immediately and removes the folder of temporary files.
    """
    config = Config(
        application,
        http=_Connection,
        log_level="warning",
        # As many are accepted at once; surplus connections close one or two rounds later.
        backlog=max(1, MAX_CONNECTIONS // 4),
        timeout_keep_alive=HEAD_TIME,
        timeout_graceful_shutdown=1,
    )
    throttle = _Throttle()
    for name in ("uvicorn.error", "asyncio"):
        logging.getLogger(name).addFilter(throttle)
    # asyncio sets this only on sockets that were made with IPPROTO_TCP; connections inherit it.
    # Without it the body of an answer may wait 40 ms for the acknowledgment of its head.
    listener.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    _Server(config, folder).run(sockets=[listener])


class _Server(Server):
    """Server that a second signal ends immediately."""

    def __init__(self, config: Config, folder: Path) -> None:
        super().__init__(config)
        self._folder = folder

    def handle_exit(self, sig: int, frame: FrameType | None) -> None:
        if self.should_exit:
            for process in active_children():
                process.kill()
            for folder in (self._folder, get_temp_dir()):
                shutil.rmtree(folder, ignore_errors=True)
            os._exit(128 + sig)
        super().handle_exit(sig, frame)


class _Connection(H11Protocol):
    """Connection with time limits for the head of each request and for reading each answer.

    If there are too many connections, the longest idle connection is closed.
    """

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        super().connection_made(transport)
        # The base class starts this timer only after an answer.
        self.timeout_keep_alive_task = self.loop.call_later(
            HEAD_TIME, self.timeout_keep_alive_handler
        )
        if len(self.connections) > MAX_CONNECTIONS:
            waiting = {
                connection: timer.when()
                for connection in self.connections
                if isinstance(connection, _Connection)
                and (timer := connection.timeout_keep_alive_task)
            }
            oldest = min(waiting, key=lambda connection: waiting[connection])
            self.connections.discard(oldest)
            oldest.transport.abort()

    def pause_writing(self) -> None:
        super().pause_writing()
        self._unread = self.loop.call_later(HEAD_TIME, self.transport.abort)

    def resume_writing(self) -> None:
        super().resume_writing()
        self._unread.cancel()

    def data_received(self, data: bytes) -> None:
        # The base class would cancel the timer at the first byte of a head.
        timer, self.timeout_keep_alive_task = self.timeout_keep_alive_task, None
        super().data_received(data)
        if timer and (self.cycle is None or self.cycle.response_complete):
            self.timeout_keep_alive_task = timer
        elif timer:
            timer.cancel()


class _Throttle(logging.Filter):
    """Filter that passes a message of each kind per interval, and none of cancelled tasks."""

    def __init__(self) -> None:
        super().__init__()
        self._latest: dict[str, float] = {}

    def filter(self, record: logging.LogRecord) -> bool:
        if record.exc_info and isinstance(record.exc_info[1], asyncio.CancelledError):
            return False
        kind = str(record.msg).partition("\n")[0]
        now = time.monotonic()
        if now < self._latest.get(kind, -LOG_INTERVAL) + LOG_INTERVAL:
            return False
        self._latest[kind] = now
        return True
