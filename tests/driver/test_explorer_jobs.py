"""Slow work of the explorer in processes of its own."""

from __future__ import annotations

import gc
import os
import signal
import struct
import time
from multiprocessing import forkserver
from threading import Timer
from typing import TYPE_CHECKING, Any

import anyio
import psutil
import pytest

from thud.explorer import jobs as module
from thud.explorer.jobs import Jobs
from thud.explorer.server import TIME_LIMIT

if TYPE_CHECKING:
    from multiprocessing.connection import Connection

LONG = {"model": {"name": "finite_element"}, "mesh": {"radial_elements": 16, "polar_elements": 512}}
SHELL = {"model": {"name": "hollow_sphere"}}


async def report_of(jobs: Jobs, values: dict[str, Any] = SHELL) -> dict[str, Any]:
    (report,) = [report async for report in jobs.run("case", values)]
    return report


def workers() -> list[int]:
    """Return the processes that the server of forks has started."""
    return [one.pid for child in psutil.Process().children() for one in child.children()]


@pytest.fixture(autouse=True)
def _no_workers() -> None:
    """Wait for the end of the workers of an earlier test, whose connections are closed."""
    gc.collect()
    while workers():
        time.sleep(0.05)


def kill_child(pid: int) -> None:
    """Kill a child; return once it has ended, as until then it counts as running."""
    os.kill(pid, signal.SIGKILL)
    os.waitid(os.P_PID, pid, os.WEXITED | os.WNOWAIT)


async def await_workers(count: int) -> list[int]:
    with anyio.fail_after(60):
        while len(workers()) != count:  # noqa: ASYNC110 - another process is no event
            await anyio.sleep(0.05)
    return workers()


def test_process_that_was_stopped_ends_with_its_page() -> None:
    async def stop_and_leave() -> None:
        async with anyio.create_task_group() as group:
            group.start_soon(report_of, Jobs(1, TIME_LIMIT), LONG)
            (pid,) = await await_workers(1)
            os.kill(pid, signal.SIGSTOP)
            await anyio.sleep(0.3)
            timer = Timer(10.0, os.kill, (pid, signal.SIGKILL))
            timer.start()
            group.cancel_scope.cancel()
        # It would not end by itself.
        assert timer.is_alive()
        timer.cancel()

    anyio.run(stop_and_leave)
    assert not workers()


def send_half(far: Connection, *_: object) -> None:
    """Send the length of a report without the report."""
    os.write(far.fileno(), struct.pack("!i", 1000))
    time.sleep(60)


def test_process_that_stops_while_it_sends_is_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "_run_tasks", send_half)
    assert "0.5 s" in anyio.run(report_of, Jobs(1, 0.5))["error"]
    assert not workers()


def test_lost_server_of_forks_is_said_and_begins_again(monkeypatch: pytest.MonkeyPatch) -> None:
    async def lose(jobs: Jobs) -> None:
        forks = vars(forkserver)["_forkserver"]
        with monkeypatch.context() as patch:
            # As where it is killed after it was found to run.
            patch.setattr(forks, "ensure_running", lambda: None)
            kill_child(vars(forks)["_forkserver_pid"])
            assert (await report_of(jobs))["error"]
        assert "answer" in await report_of(jobs)

    anyio.run(lose, Jobs(1, TIME_LIMIT))


def test_process_works_again_until_it_is_late() -> None:
    async def work(jobs: Jobs) -> None:
        await report_of(jobs)
        (first,) = workers()
        await report_of(jobs)
        assert workers() == [first]
        # Nobody reads that it has ended.
        os.kill(first, signal.SIGKILL)
        await await_workers(0)
        assert "answer" in await report_of(jobs)
        (second,) = workers()
        os.kill(second, signal.SIGSTOP)
        vars(jobs)["_time_limit"] = 0.5
        assert "0.5 s" in (await report_of(jobs))["error"]
        assert not workers()
        vars(jobs)["_time_limit"] = TIME_LIMIT
        assert "answer" in await report_of(jobs)

    anyio.run(work, Jobs(1, TIME_LIMIT))


def test_works_have_places_and_those_that_wait_end() -> None:
    async def crowd(jobs: Jobs) -> None:
        async with anyio.create_task_group() as group:
            for _ in range(4):
                group.start_soon(report_of, jobs, LONG)
            await await_workers(2)
            await anyio.sleep(0.5)
            assert len(workers()) == 2
            group.cancel_scope.cancel()
        assert not workers()
        with anyio.fail_after(60):
            assert "answer" in await report_of(jobs)

    anyio.run(crowd, Jobs(2, TIME_LIMIT))


def test_answer_that_nobody_reads_keeps_no_place() -> None:
    async def rest(jobs: Jobs) -> None:
        reports = jobs.run("case", SHELL)
        with anyio.fail_after(60):
            assert "answer" in await anext(reports)
            assert "answer" in await report_of(jobs)
        await reports.aclose()

    anyio.run(rest, Jobs(1, TIME_LIMIT))
