"""Computations in separate processes, which are killed if the caller stops waiting."""

from __future__ import annotations

import os
import resource
import signal
import tempfile
import threading
from collections.abc import Generator
from contextlib import suppress
from multiprocessing import forkserver, get_context
from typing import TYPE_CHECKING, Any

import anyio
from tqdm import tqdm

from thud.base.bridge import progress
from thud.base.errors import ThudError
from thud.explorer.answer import answer_case, answer_quickly, new_case
from thud.explorer.downloads import DOWNLOADS
from thud.explorer.fits import fit_press, fit_recording
from thud.explorer.improve import improve
from thud.explorer.messages import describe_error
from thud.explorer.recording import answer_recording, calibration_report

if TYPE_CHECKING:
    from collections.abc import AsyncGenerator, Callable
    from multiprocessing.connection import Connection
    from multiprocessing.context import ForkServerProcess

    Report = dict[str, Any]

# Functions of the tasks by name; arguments and return values are plain data. Generators yield begin
# and end of the fraction of the work that the next computation is.
TASKS: dict[str, Callable[..., Any]] = {
    "quick case": lambda values: answer_quickly(new_case(values)),
    "case": lambda values: answer_case(new_case(values)),
    "recording": answer_recording,
    "report": calibration_report,
    "improve": improve,
    "fit": fit_recording,
    "press": fit_press,
    **DOWNLOADS,
}
# Errors of invalid values; values of wrong types raise TypeError or ValueError when they are used.
INPUT_ERRORS = (ThudError, TypeError, ValueError, KeyError, OverflowError)
# Time between two reports, s.
INTERVAL = 0.05
# Maximum memory of a task, bytes, as small files can hold long recordings.
MAX_MEMORY = 4_000_000_000


class Jobs:
    """Processes that run a limited number of tasks concurrently; other tasks wait."""

    def __init__(
        self, width: int, time_limit: float, *, late: Report | None = None, reuse: bool = False
    ) -> None:
        """Start the server that forks the processes.

        Parameters
        ----------
        width
            Maximum number of concurrent tasks.
        time_limit
            Maximum duration of a task, s.
        late
            Last report of a task that exceeds the time limit; by default an error.
        reuse
            Use a process for several tasks; requires that tasks do not change global state.
        """
        # The fork server has loaded the modules, so that new processes start immediately.
        self._context = get_context("forkserver")
        self._context.set_forkserver_preload([__name__])
        forkserver.ensure_running()
        # A semaphore, as it may be released by another task of anyio than the one that acquired it.
        self._slots = anyio.Semaphore(width)
        self._time_limit = time_limit
        message = f"the computation takes longer than {time_limit:g} s; allowed: less"
        self._late = late or {"error": message}
        self._reuse = reuse
        self._idle: list[tuple[ForkServerProcess, Connection]] = []

    async def run(self, task: str, *arguments: object) -> AsyncGenerator[Report, None]:
        """Yield reports ``{"done": fraction}``, then ``{"answer": …}`` or ``{"error": message}``.

        The first report precedes the start of the task. If the caller stops iterating, the process
        is killed and its temporary files are removed.
        """
        report: Report = {"done": 0.0}
        yield report
        async with self._slots:
            with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
                process, connection, child_end = self._take()
                reusable = False
                try:
                    if child_end:
                        with child_end:
                            await anyio.to_thread.run_sync(process.start)
                    end = anyio.current_time() + self._time_limit
                    request = (folder, task, arguments)
                    report = await self._call(end, _exchange, connection, request)
                    while "done" in report:
                        yield report
                        report = await self._call(end, connection.recv)
                    reusable = self._reuse and report is not self._late
                except (EOFError, OSError):
                    message = "the computation ended without an answer, perhaps for lack of memory"
                    report = {"error": message}
                finally:
                    if reusable:
                        self._idle.append((process, connection))
                    else:
                        _kill(process)
        # The slot is released before this report, as the caller may read it slowly.
        yield report

    def _take(self) -> tuple[ForkServerProcess, Connection, Connection | None]:
        """Return a process, its connection, and the child's end if the process is new."""
        while self._idle:
            process, connection = self._idle.pop()
            # If the process has ended, its connection is readable (end of file).
            if not connection.poll():
                return process, connection, None
            _kill(process)
        connection, child_end = self._context.Pipe()
        process = self._context.Process(target=_run_tasks, args=(child_end,), daemon=True)
        return process, connection, child_end

    async def _call(
        self, end: float, function: Callable[..., Report], *arguments: object
    ) -> Report:
        """Return the report of a function in a thread, or the late report at time `end`.

        An abandoned thread ends when its process is killed.
        """
        with anyio.CancelScope(deadline=end):
            return await anyio.to_thread.run_sync(function, *arguments, abandon_on_cancel=True)
        return self._late


def _exchange(connection: Connection, request: object) -> Report:
    """Send a request to a process; return its first report."""
    connection.send(request)
    report: Report = connection.recv()
    return report


def _kill(process: ForkServerProcess) -> None:
    if process.pid is not None:
        process.kill()
        process.join()


def _run_tasks(connection: Connection) -> None:
    """Run the tasks that arrive in this process until the server ends."""
    # An interrupt may reach the whole process group, but the server kills this process itself.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # The default lock is a semaphore of the system, which would outlive a killed process.
    tqdm.set_lock(threading.RLock())
    resource.setrlimit(resource.RLIMIT_AS, (MAX_MEMORY, MAX_MEMORY))
    with suppress(EOFError, OSError):
        while True:
            tempfile.tempdir, task, arguments = connection.recv()
            connection.send(_run_task(connection, task, arguments))


def _run_task(connection: Connection, task: str, arguments: tuple[Any, ...]) -> Report:
    """Return the last report of a task, after sending reports of its progress."""
    finished = threading.Event()
    span = [0.0, 1.0]

    def report_progress() -> None:
        try:
            while not finished.wait(INTERVAL):
                begin, end = span
                connection.send({"done": begin + (end - begin) * progress()})
        except OSError:
            os._exit(1)

    thread = threading.Thread(target=report_progress, daemon=True)
    thread.start()
    try:
        return {"answer": _finish(TASKS[task](*arguments), span)}
    except MemoryError:
        limit = f"{MAX_MEMORY / 1e9:g} GB"
        return {"error": f"the computation needs more than {limit} of memory; allowed: less"}
    except (*INPUT_ERRORS, OSError) as error:
        return describe_error(error)
    finally:
        finished.set()
        thread.join()


def _finish(answer: Any, span: list[float]) -> Any:  # noqa: ANN401 - of any task
    """Return an answer, after the work of a generator; `span` is the fraction of its next step."""
    while isinstance(answer, Generator):
        try:
            span[:] = next(answer)
        except StopIteration as end:
            answer = end.value
    return answer
