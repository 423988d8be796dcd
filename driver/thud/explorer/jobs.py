"""Computations in their own processes, which end when nobody waits for them."""

from __future__ import annotations

import os
import resource
import signal
import tempfile
import threading
from contextlib import suppress
from multiprocessing import forkserver, get_context
from typing import TYPE_CHECKING, Any

import anyio
from tqdm import tqdm

from thud.base.bridge import progress
from thud.base.errors import InputError, ThudError
from thud.explorer.answer import answer_case, answer_quickly, answer_recording, new_case
from thud.explorer.downloads import DOWNLOADS

if TYPE_CHECKING:
    from collections.abc import AsyncGenerator, Callable
    from multiprocessing.connection import Connection
    from multiprocessing.context import ForkServerProcess

    Report = dict[str, Any]

# Functions of the tasks by name; each takes plain data.
TASKS: dict[str, Callable[..., Any]] = {
    "quick case": lambda values: answer_quickly(new_case(values)),
    "case": lambda values: answer_case(new_case(values)),
    "recording": answer_recording,
    "download": lambda name, values: DOWNLOADS[name][0](values),
}
# Errors of bad values: those of wrong types are raised at their first use.
REFUSALS = (ThudError, TypeError, ValueError, KeyError, OverflowError)
# Time between two reports, s.
INTERVAL = 0.05
# Maximum memory of a task, bytes: small files can hold long recordings.
MAX_MEMORY = 4_000_000_000


class Jobs:
    """Processes that compute a few answers at a time; other requests wait."""

    def __init__(
        self, width: int, limit: float, *, late: Report | None = None, reuse: bool = False
    ) -> None:
        """Take the number of processes and what they may do.

        Parameters
        ----------
        width
            Maximum number of tasks at a time.
        limit
            Maximum time of a task, s.
        late
            The last report of a task that takes longer; by default an error.
        reuse
            A process does one task after the other: for tasks that leave nothing behind.
        """
        # A server that has modules loaded forks each process at once.
        self._context = get_context("forkserver")
        self._context.set_forkserver_preload([__name__])
        forkserver.ensure_running()
        # What ends the reports need not be the task that asked for them.
        self._slots = anyio.Semaphore(width)
        self._limit = limit
        message = f"the computation takes longer than {limit:g} s; allowed: less"
        self._late = late or {"error": message}
        self._reuse = reuse
        self._idle: list[tuple[ForkServerProcess, Connection]] = []

    async def run(self, task: str, *arguments: object) -> AsyncGenerator[Report, None]:
        """Yield reports ``{"done": fraction}``, then ``{"answer": …}`` or ``{"error": message}``.

        The first report comes before the task begins. If the caller stops asking, the process is
        ended and its temporary files are removed.
        """
        report: Report = {"done": 0.0}
        yield report
        async with self._slots:
            with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
                process, near, far = self._take()
                reusable = False
                try:
                    if far:
                        with far:
                            await anyio.to_thread.run_sync(process.start)
                    end = anyio.current_time() + self._limit
                    report = await self._call(end, _exchange, near, (folder, task, arguments))
                    while "done" in report:
                        yield report
                        report = await self._call(end, near.recv)
                    reusable = self._reuse and report is not self._late
                except (EOFError, OSError):
                    message = "the computation ended without an answer, perhaps for lack of memory"
                    report = {"error": message}
                finally:
                    if reusable:
                        self._idle.append((process, near))
                    else:
                        _kill(process)
        # The slot is free by now: the reader may be slow.
        yield report

    def close(self) -> None:
        """End the processes that wait for tasks."""
        while self._idle:
            _kill(self._idle.pop()[0])

    def _take(self) -> tuple[ForkServerProcess, Connection, Connection | None]:
        """Return a process and its connection; of a new process also the end that it takes."""
        while self._idle:
            process, near = self._idle.pop()
            # The connection of a process that has ended is at its end.
            if not near.poll():
                return process, near, None
            _kill(process)
        near, far = self._context.Pipe()
        return self._context.Process(target=_do_tasks, args=(far,), daemon=True), near, far

    async def _call(
        self, end: float, function: Callable[..., Report], *arguments: object
    ) -> Report:
        """Return the report of a function in a thread, or the late report after a time.

        A thread that still waits then ends with the process.
        """
        with anyio.CancelScope(deadline=end):
            return await anyio.to_thread.run_sync(function, *arguments, abandon_on_cancel=True)
        return self._late


def _exchange(near: Connection, task: object) -> Report:
    """Send a task; return its first report."""
    near.send(task)
    report: Report = near.recv()
    return report


def _kill(process: ForkServerProcess) -> None:
    if process.pid is not None:
        process.kill()
        process.join()


def _do_tasks(far: Connection) -> None:
    """Do tasks in this process and report; end with the server."""
    # An interrupt may reach the whole process group; the server ends this process itself.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # The usual lock is a semaphore of the system, which a process that is killed leaves behind.
    tqdm.set_lock(threading.RLock())
    resource.setrlimit(resource.RLIMIT_AS, (MAX_MEMORY, MAX_MEMORY))
    with suppress(EOFError, OSError):
        while True:
            tempfile.tempdir, task, arguments = far.recv()
            far.send(_last_report(far, task, arguments))


def _last_report(far: Connection, task: str, arguments: tuple[Any, ...]) -> Report:
    """Return the last report of a task; send the others meanwhile."""
    over = threading.Event()

    def report() -> None:
        try:
            while not over.wait(INTERVAL):
                far.send({"done": progress()})
        except OSError:
            os._exit(1)

    thread = threading.Thread(target=report, daemon=True)
    thread.start()
    try:
        return {"answer": TASKS[task](*arguments)}
    except MemoryError:
        limit = f"{MAX_MEMORY / 1e9:g} GB"
        return {"error": f"the computation needs more than {limit} of memory; allowed: less"}
    except (*REFUSALS, OSError) as error:
        return {"error": str(error) or InputError.__name__}
    finally:
        over.set()
        thread.join()
