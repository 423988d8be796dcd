"""Slow work in processes of its own, which end when nobody waits for them."""

from __future__ import annotations

import os
import resource
import tempfile
import threading
from multiprocessing import forkserver, get_context
from typing import TYPE_CHECKING, Any

import anyio
from tqdm import tqdm

from thud._api import progress
from thud.errors import InputError, ThudError
from thud.explorer.answer import answer_case, answer_recording, new_case
from thud.explorer.downloads import DOWNLOADS

if TYPE_CHECKING:
    from collections.abc import AsyncGenerator, Callable
    from multiprocessing.connection import Connection

# Works by name; each takes plain data.
WORKS: dict[str, Callable[..., Any]] = {
    "case": lambda values: answer_case(new_case(values)),
    "recording": answer_recording,
    "download": lambda what, values: DOWNLOADS[what][0](values),
}
# What bad values raise: those of wrong types stop where they are first used.
REFUSALS = (ThudError, TypeError, ValueError, KeyError, OverflowError)
# Time between two reports, s, and the longest that a work may take.
INTERVAL = 0.05
LONGEST = 300.0
# Largest memory of a work, bytes: small files can hold long recordings.
MEMORY = 4_000_000_000


class Jobs:
    """Place of a few works at a time; others wait."""

    def __init__(self, width: int) -> None:
        """Take the number of processes."""
        # A server that has modules loaded forks each process at once.
        self._context = get_context("forkserver")
        self._context.set_forkserver_preload([__name__])
        forkserver.ensure_running()
        # What ends the reports need not be the task that asked for them.
        self._places = anyio.Semaphore(width)

    async def run(self, work: str, *arguments: object) -> AsyncGenerator[dict[str, Any], None]:
        """Yield reports ``{"done": part}``, at last ``{"answer": …}`` or ``{"error": sentence}``.

        The first report comes before the work begins. The process is ended, and its temporary files
        are removed, where the caller stops to ask.
        """
        yield {"done": 0.0}
        async with self._places:
            with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
                near, far = self._context.Pipe()
                process = self._context.Process(
                    target=_work, args=(far, folder, work, arguments), daemon=True
                )
                try:
                    with far:
                        process.start()
                    end = anyio.current_time() + LONGEST
                    report: dict[str, Any] = {"done": 0.0}
                    while "done" in report:
                        report = {
                            "error": f"the work takes longer than {LONGEST:g} s; allowed: less"
                        }
                        # A thread that is left still waiting ends with the process.
                        with anyio.CancelScope(deadline=end):
                            report = await anyio.to_thread.run_sync(
                                near.recv, abandon_on_cancel=True
                            )
                        yield report
                except (EOFError, OSError):
                    yield {"error": "the work ended without an answer, perhaps for want of memory"}
                finally:
                    if process.pid is not None:
                        process.kill()
                        process.join()


def _work(far: Connection, folder: str, work: str, arguments: tuple[Any, ...]) -> None:
    """Do a work in this process, and report; end with the server."""
    tempfile.tempdir = folder
    # The usual lock is a semaphore of the system, which a process that is killed leaves behind.
    tqdm.set_lock(threading.RLock())
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    over = threading.Event()

    def report() -> None:
        try:
            while not over.wait(INTERVAL):
                far.send({"done": progress()})
        except OSError:
            os._exit(1)

    thread = threading.Thread(target=report, daemon=True)
    thread.start()
    last: dict[str, Any]
    try:
        last = {"answer": WORKS[work](*arguments)}
    except MemoryError:
        last = {"error": f"the work needs more than {MEMORY / 1e9:g} GB of memory; allowed: less"}
    except (*REFUSALS, OSError) as error:
        last = {"error": str(error) or InputError.__name__}
    over.set()
    thread.join()
    far.send(last)
