"""Slow work in processes of its own, which end when nobody waits for them."""

from __future__ import annotations

import threading
from multiprocessing import get_context
from typing import TYPE_CHECKING, Any

import anyio

from thud._api import progress
from thud.errors import InputError, ThudError
from thud.explorer.answer import answer_case, answer_recording, new_case

if TYPE_CHECKING:
    from collections.abc import AsyncIterator, Callable
    from multiprocessing.connection import Connection

# Works by name; each takes plain data.
WORKS: dict[str, Callable[..., dict[str, Any]]] = {
    "case": lambda values: answer_case(new_case(values)),
    "recording": answer_recording,
}
# Time between two reports, s, and the longest that a work may take.
INTERVAL = 0.05
LONGEST = 300.0


class Jobs:
    """Place of a few works at a time; others wait."""

    def __init__(self, width: int) -> None:
        """Take the number of processes."""
        # A server that has modules loaded forks each process at once.
        self._context = get_context("forkserver")
        self._context.set_forkserver_preload([__name__])
        self._limit = anyio.CapacityLimiter(width)

    async def run(self, work: str, *arguments: object) -> AsyncIterator[dict[str, Any]]:
        """Yield reports ``{"done": part}``, at last ``{"answer": …}`` or ``{"error": sentence}``.

        The process is ended where the caller stops to ask.
        """
        async with self._limit:
            near, far = self._context.Pipe()
            process = self._context.Process(target=_work, args=(far, work, arguments), daemon=True)
            process.start()
            far.close()
            try:
                with anyio.move_on_after(LONGEST) as limit:
                    while True:
                        report = await anyio.to_thread.run_sync(_next, near)
                        yield report
                        if "done" not in report:
                            return
                if limit.cancelled_caught:
                    yield {"error": f"the work takes longer than {LONGEST:g} s; allowed: less"}
            finally:
                near.close()
                process.kill()
                process.join()


def _next(near: Connection) -> dict[str, Any]:
    """Return the next report of a process."""
    try:
        report: dict[str, Any] = near.recv()
    except EOFError:
        report = {"error": "the work ended without an answer, perhaps for want of memory"}
    return report


def _work(far: Connection, work: str, arguments: tuple[Any, ...]) -> None:
    """Do a work in this process, and report."""
    over = threading.Event()

    def report() -> None:
        while not over.wait(INTERVAL):
            far.send({"done": progress()})

    thread = threading.Thread(target=report, daemon=True)
    thread.start()
    last: dict[str, Any]
    try:
        last = {"answer": WORKS[work](*arguments)}
    except (ThudError, OSError, MemoryError) as error:
        last = {"error": str(error) or InputError.__name__}
    over.set()
    thread.join()
    far.send(last)
