"""Computations in separate processes, which are killed if the caller stops waiting."""

from __future__ import annotations

import os
import signal
import sys
import tempfile
import threading
from contextlib import suppress
from multiprocessing import get_context, parent_process
from typing import TYPE_CHECKING, Any

import anyio
from tqdm import tqdm

from thud.base.errors import ThudError
from thud.explorer.answer import answer_case, new_case
from thud.explorer.downloads import DOWNLOADS
from thud.explorer.fits import fit_press, fit_recording
from thud.explorer.improve import improve
from thud.explorer.messages import describe_error
from thud.explorer.recording import answer_recording, calibration_report

if TYPE_CHECKING:
    from collections.abc import AsyncGenerator, Callable
    from multiprocessing.connection import Connection
    from multiprocessing.context import ForkServerContext, SpawnContext
    from multiprocessing.process import BaseProcess

    Report = dict[str, Any]

# Functions of the tasks by name; arguments and return values are plain data.
TASKS: dict[str, Callable[..., Any]] = {
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
# Maximum memory of a task, bytes, as small files can hold long recordings.
MAX_MEMORY = 4_000_000_000


class Jobs:
    """Processes that run a limited number of tasks concurrently; other tasks wait."""

    def __init__(self, width: int, time_limit: float) -> None:
        """Start the server that forks the processes.

        Parameters
        ----------
        width
            Maximum number of concurrent tasks.
        time_limit
            Maximum duration of a task, s.
        """
        self._context = _new_context()
        self._slots = anyio.Semaphore(width)
        self._time_limit = time_limit
        self._idle: list[tuple[BaseProcess, Connection]] = []

    async def run(self, task: str, *arguments: object) -> AsyncGenerator[Report, None]:
        """Yield the report of a task: ``{"answer": …}`` or ``{"error": message}``.

        If the caller stops iterating, the process is killed and its temporary files are removed;
        otherwise it runs further tasks.
        """
        async with self._slots:
            with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
                process, connection, child_end = self._take()
                request, is_finished = (folder, task, arguments), False
                try:
                    if child_end:
                        with child_end:
                            await anyio.to_thread.run_sync(process.start)
                    with anyio.fail_after(self._time_limit):
                        # An abandoned thread ends when its process is killed.
                        report = await anyio.to_thread.run_sync(
                            _exchange, connection, request, abandon_on_cancel=True
                        )
                    is_finished = True
                except TimeoutError:
                    limit = f"{self._time_limit:g} s"
                    report = {"error": f"the computation takes longer than {limit}; allowed: less"}
                except (EOFError, OSError):
                    message = "the computation ended without an answer, perhaps for lack of memory"
                    report = {"error": message}
                finally:
                    if is_finished:
                        self._idle.append((process, connection))
                    else:
                        _kill(process)
        # The slot is released before this report, as the caller may read it slowly.
        yield report

    def _take(self) -> tuple[BaseProcess, Connection, Connection | None]:
        """Return a process, its connection, and the child's end if the process is new."""
        while self._idle:
            process, connection = self._idle.pop()
            if process.is_alive():
                return process, connection, None
            _kill(process)
        connection, child_end = self._context.Pipe()
        process = self._context.Process(target=_run_tasks, args=(child_end,), daemon=True)
        return process, connection, child_end


def _new_context() -> ForkServerContext | SpawnContext:
    """Return how processes are started."""
    if sys.platform == "win32":
        return get_context("spawn")
    from multiprocessing import forkserver  # Windows has none.

    # The fork server has loaded the modules, so that new processes start immediately.
    context = get_context("forkserver")
    context.set_forkserver_preload([__name__])
    forkserver.ensure_running()
    return context


def _exchange(connection: Connection, request: object) -> Report:
    """Send a request to a process; return its report."""
    connection.send(request)
    report: Report = connection.recv()
    return report


def _kill(process: BaseProcess) -> None:
    if process.pid is not None:
        process.kill()
        process.join()


def _run_tasks(connection: Connection) -> None:
    """Run the tasks that arrive in this process until the server ends."""
    threading.Thread(target=_end_with_server, daemon=True).start()
    # An interrupt may reach the whole process group, but the server kills this process itself.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # The default lock is a semaphore of the system, which would outlive a killed process.
    tqdm.set_lock(threading.RLock())
    if sys.platform != "win32":
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (MAX_MEMORY, MAX_MEMORY))
    place = tempfile.gettempdir()
    with suppress(EOFError, OSError):
        while True:
            folder, task, arguments = connection.recv()
            tempfile.tempdir = folder
            os.chdir(folder)
            report = _run_task(task, arguments)
            # Windows does not remove a folder where a process is.
            os.chdir(place)
            connection.send(report)


def _end_with_server() -> None:
    """End this process, whatever it computes, if the server has been killed."""
    if server := parent_process():
        server.join()
        os._exit(1)


def _run_task(task: str, arguments: tuple[Any, ...]) -> Report:
    """Return the report of a task."""
    try:
        return {"answer": TASKS[task](*arguments)}
    except MemoryError:
        limit = f"{MAX_MEMORY / 1e9:g} GB"
        return {"error": f"the computation needs more than {limit} of memory; allowed: less"}
    except (*INPUT_ERRORS, OSError) as error:
        return describe_error(error)
