"""Slow work of the explorer in processes of its own."""

from __future__ import annotations

import os
import signal
import struct
import time
from multiprocessing import forkserver
from threading import Timer
from typing import TYPE_CHECKING, Any

import anyio
import psutil

from thud.explorer import jobs as module
from thud.explorer.jobs import Jobs

if TYPE_CHECKING:
    from multiprocessing.connection import Connection

    import pytest

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


def send_half(far: Connection, *_: object) -> None:
    """Send the length of a report without the report."""
    os.write(far.fileno(), struct.pack("!i", 1000))
    time.sleep(60)


async def reports_of(jobs: Jobs) -> list[dict[str, Any]]:
    """Return the reports of a quick work."""
    return [report async for report in jobs.run("case", {"model": {"name": "hollow_sphere"}})]


def test_process_that_stops_while_it_sends_is_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "LONGEST", 0.5)
    monkeypatch.setattr(module, "_work", send_half)
    last = anyio.run(reports_of, Jobs(1))[-1]
    assert list(last) == ["error"]
    assert "0.5 s" in last["error"]
    assert not workers()


def test_lost_server_of_forks_is_a_sentence_and_begins_again(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    async def lose(jobs: Jobs) -> None:
        forks = vars(forkserver)["_forkserver"]
        with monkeypatch.context() as patch:
            # As where it is killed after it was found to run.
            patch.setattr(forks, "ensure_running", lambda: None)
            os.kill(vars(forks)["_forkserver_pid"], signal.SIGKILL)
            assert (await reports_of(jobs))[-1]["error"]
        assert "answer" in (await reports_of(jobs))[-1]

    anyio.run(lose, Jobs(1))


def test_reports_are_ended_by_another_task() -> None:
    async def end_elsewhere(jobs: Jobs) -> None:
        reports = jobs.run("case", LONG)
        async with anyio.create_task_group() as group:
            group.start_soon(anext, reports)
        async with anyio.create_task_group() as group:
            group.start_soon(anext, reports)
        await reports.aclose()
        assert not workers()
        with anyio.fail_after(60):
            assert "answer" in (await reports_of(jobs))[-1]

    anyio.run(end_elsewhere, Jobs(1))
