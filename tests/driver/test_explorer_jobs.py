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
import pytest

from thud.explorer import jobs as module
from thud.explorer.jobs import Jobs
from thud.explorer.server import TIME_LIMIT

if TYPE_CHECKING:
    from collections.abc import AsyncGenerator
    from multiprocessing.connection import Connection


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
            group.start_soon(listen, Jobs(1, TIME_LIMIT))
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
    monkeypatch.setattr(module, "_run_tasks", send_half)
    last = anyio.run(reports_of, Jobs(1, 0.5))[-1]
    assert list(last) == ["error"]
    assert "0.5 s" in last["error"]
    assert not workers()


def kill(pid: int) -> None:
    """Kill a child; return once it has ended, as until then it counts as running."""
    os.kill(pid, signal.SIGKILL)
    os.waitid(os.P_PID, pid, os.WEXITED | os.WNOWAIT)


def test_lost_server_of_forks_is_a_sentence_and_begins_again(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    async def lose(jobs: Jobs) -> None:
        forks = vars(forkserver)["_forkserver"]
        with monkeypatch.context() as patch:
            # As where it is killed after it was found to run.
            patch.setattr(forks, "ensure_running", lambda: None)
            kill(vars(forks)["_forkserver_pid"])
            assert (await reports_of(jobs))[-1]["error"]
        assert "answer" in (await reports_of(jobs))[-1]

    anyio.run(lose, Jobs(1, TIME_LIMIT))


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

    anyio.run(end_elsewhere, Jobs(1, TIME_LIMIT))


@pytest.mark.slow
def test_kept_process_works_again_until_it_is_late() -> None:
    async def work(jobs: Jobs) -> None:
        await reports_of(jobs)
        (first,) = workers()
        await reports_of(jobs)
        assert workers() == [first]
        # Nobody reads that it has ended.
        os.kill(first, signal.SIGKILL)
        while workers():  # noqa: ASYNC110 - another process is no event
            await anyio.sleep(0.05)
        assert "answer" in (await reports_of(jobs))[-1]
        (second,) = workers()
        os.kill(second, signal.SIGSTOP)
        assert (await reports_of(jobs))[-1] is late
        assert not workers()
        assert "answer" in (await reports_of(jobs))[-1]

    late = {"answer": None}
    anyio.run(work, Jobs(1, 5.0, late=late, reuse=True))


def test_works_have_places_and_those_that_wait_end() -> None:
    async def crowd(jobs: Jobs) -> None:
        reports = [jobs.run("case", LONG) for _ in range(4)]
        async with anyio.create_task_group() as group:

            async def wait(some: AsyncGenerator[dict[str, Any], None]) -> None:
                async for _ in some:
                    pass

            for some in reports:
                group.start_soon(wait, some)
            with anyio.fail_after(60):
                while len(workers()) < 2:  # noqa: ASYNC110 - another process is no event
                    await anyio.sleep(0.05)
            await anyio.sleep(0.5)
            assert len(workers()) == 2
            group.cancel_scope.cancel()
        assert not workers()
        with anyio.fail_after(60):
            assert "answer" in (await reports_of(jobs))[-1]

    anyio.run(crowd, Jobs(2, TIME_LIMIT))


def test_answer_that_nobody_reads_keeps_no_place() -> None:
    async def rest(jobs: Jobs) -> None:
        reports = jobs.run("case", {})
        with anyio.fail_after(60):
            while "answer" not in await anext(reports):
                pass
            assert "answer" in (await reports_of(jobs))[-1]
        await reports.aclose()

    anyio.run(rest, Jobs(1, TIME_LIMIT))
