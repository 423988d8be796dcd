"""Slow work of the explorer in processes of its own."""

from __future__ import annotations

import os
import signal
from threading import Timer

import anyio
import psutil

from thud.explorer.jobs import Jobs

LONG = {
    "model": {"name": "finite_element"},
    "mesh": {"radial_elements": 16, "polar_elements": 512},
}


def workers() -> list[int]:
    """Return the processes that the server of forks has started."""
    return [one.pid for child in psutil.Process().children() for one in child.children()]


def test_process_that_was_stopped_ends_with_its_page() -> None:
    late = []

    def kill(pid: int) -> None:
        late.append(pid)
        os.kill(pid, signal.SIGKILL)

    async def listen(jobs: Jobs) -> None:
        async for _ in jobs.run("case", LONG):
            pass

    async def stop_and_leave() -> None:
        async with anyio.create_task_group() as group:
            group.start_soon(listen, Jobs(1))
            while not workers():  # noqa: ASYNC110 - another process is no event
                await anyio.sleep(0.05)
            (pid,) = workers()
            os.kill(pid, signal.SIGSTOP)
            await anyio.sleep(0.3)
            timer = Timer(10.0, kill, (pid,))
            timer.start()
            group.cancel_scope.cancel()
        timer.cancel()

    anyio.run(stop_and_leave)
    assert not late
    assert not workers()
