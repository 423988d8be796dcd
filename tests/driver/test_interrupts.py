"""Interrupts of long work, from Python, from ``thud`` and from ``thud-driver``."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from conftest import MINIMAL, names_in, python

import thud

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

# The aim is one second; machines that test may be busy.
LIMIT = 20.0
HEIGHTS = np.linspace(0.5, 1.5, 64)
SLOW_SHELL = thud.Case(model=thud.HollowSphere(), sampling=thud.Sampling(4e6, 0.025, 1000))
# All of these take longer than that, some of them minutes.
FINE = {"radial_elements": 16, "polar_elements": 512}
WORK: dict[str, Callable[[], object]] = {
    "finite elements": lambda: thud.solve(model="finite_element", **FINE),
    "bounces": lambda: thud.solve(model="finite_element", bounces=100, duration=10.0),
    "modes in contact": lambda: thud.solve(sample_rate=2e5, duration=1.0, substeps=400),
    "shell": lambda: thud.solve(SLOW_SHELL),
    "batches": lambda: thud.solve_many({"height": HEIGHTS}, SLOW_SHELL, threads=2),
    "drops": lambda: thud.solve_many(
        {"height": HEIGHTS}, thud.Case(model=thud.FiniteElement(**FINE)), threads=2
    ),
}
LONG = "&ball /\n&drop /\n&model name = 'finite_element' /\n&mesh {} /\n".format(
    " ".join(f"{key} = {value}" for key, value in FINE.items())
)
# One line, and nothing else.
INTERRUPTED = re.compile(r"[^\n]*interrupted\n\Z")
DRIVER = [sys.executable, "-m", "thud"]


@contextmanager
def sender(delay: float) -> Iterator[None]:
    """Send SIGINT to this process after a while, unless the block has ended before."""
    command = f"sleep {delay}; kill -INT {os.getpid()}"
    with subprocess.Popen(["/bin/sh", "-c", command]) as process:
        try:
            yield
        finally:
            process.kill()


def interrupt(work: Callable[[], object], delay: float = 0.2) -> None:
    """Interrupt work, which has to end within the limit, and not by itself."""
    start = time.monotonic()
    with sender(delay), pytest.raises(KeyboardInterrupt):
        work()
    assert time.monotonic() < start + delay + LIMIT


def ended(process: subprocess.Popen[str], number: int) -> str:
    """Send a signal to a process that has to end within the limit; return its errors.

    They end with the last of the processes that it has started.
    """
    process.send_signal(number)
    _, errors = process.communicate(timeout=LIMIT)
    assert process.returncode == 128 + number
    return errors


@pytest.mark.parametrize("work", WORK.values(), ids=WORK)
def test_interrupt_ends_a_call_and_leaves_the_interpreter_whole(work: Callable[[], object]) -> None:
    before = thud.solve(model="hollow_sphere").floor_force
    interrupt(work)
    assert np.array_equal(thud.solve(model="hollow_sphere").floor_force, before)


def test_threads_of_the_blas_are_those_of_the_process_after_a_call() -> None:
    code = """
import ctypes, sys, numpy as np, thud
with open("/proc/self/maps", encoding="utf-8") as file:
    paths = {line.split(maxsplit=5)[-1].strip() for line in file if "openblas" in line}
libraries = [ctypes.CDLL(path) for path in sorted(paths)]
blas = [library for library in libraries if hasattr(library, "openblas_set_num_threads")]
if not blas:
    sys.exit(3)
for library in blas:
    library.openblas_set_num_threads(2)
before = [library.openblas_get_num_threads() for library in blas]
for work in (
    lambda: thud.solve(model="modal_ball"),
    lambda: thud.solve(drop=thud.Drop(height=1000.0), model="modal_ball"),
    lambda: thud.solve_many({"height": [0.9, 1.0]}, thud.Case(model=thud.ModalBall()), threads=2),
    lambda: thud.solve_many({"height": np.linspace(0.9, 1.0, 40)}, threads=2),
    lambda: thud.free_modes(),
):
    try:
        work()
    except thud.ThudError:
        pass
    assert [library.openblas_get_num_threads() for library in blas] == before
"""
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "2"}
    done = python("-W", "ignore", "-c", code, env=environment, timeout=6 * LIMIT)
    if done.returncode == 3:
        pytest.skip("no OpenBLAS whose threads can be counted")
    assert done.returncode == 0


def test_interrupt_ends_calls_in_other_threads() -> None:
    with ThreadPoolExecutor(2) as threads:
        futures = [threads.submit(WORK["finite elements"]) for _ in range(2)]
        interrupt(futures[0].result)
    assert all(isinstance(future.exception(), KeyboardInterrupt) for future in futures)


def test_call_goes_on_where_the_handler_returns() -> None:
    seen: list[int] = []
    # Some times as long as until the signal.
    options: dict[str, Any] = {"sample_rate": 2e5, "substeps": 40}
    expected = thud.solve(**options).floor_force
    for handler in (lambda number, _: seen.append(number), signal.SIG_IGN):
        usual = signal.signal(signal.SIGINT, handler)
        try:
            with sender(0.1):
                found = thud.solve(**options)
        finally:
            signal.signal(signal.SIGINT, usual)
        assert np.array_equal(found.floor_force, expected)
    assert seen == [signal.SIGINT]


def test_forked_process_does_not_wait_for_calls_of_its_parent() -> None:
    code = """
import os, signal, threading, time, thud
solve = thud.solve
long = lambda: solve(model="finite_element", radial_elements=16, polar_elements=512)
threading.Thread(target=long, daemon=True).start()
time.sleep(0.3)
child = os.fork()
if child:
    os._exit(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
timer = threading.Timer(0.3, signal.raise_signal, [signal.SIGINT])
timer.start()
try:
    long()
except KeyboardInterrupt:
    thud.solve()
    os._exit(7)
"""
    assert python("-c", code, timeout=2 * LIMIT).returncode == 7


@pytest.mark.parametrize(("number", "copies"), [(signal.SIGINT, 2), (signal.SIGTERM, 1)])
def test_executable_ends_samples_and_leaves_nothing(
    executable: str, number: int, copies: int, tmp_path: Path
) -> None:
    (tmp_path / "long.nml").write_text(LONG)
    (tmp_path / "samples.csv").write_text("height\n" + "1.0\n" * 8)
    command = [executable, "long.nml", "--samples", "samples.csv", "--threads", "2"]
    with subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.PIPE, text=True) as process:
        while not list(tmp_path.glob("outputs/.long_samples.*.new/samples.csv")):
            time.sleep(0.01)
        # Some callers send a signal to the process and to its group.
        for _ in range(copies - 1):
            process.send_signal(number)
            time.sleep(0.01)
        assert "interrupted" in ended(process, number)
    assert not list((tmp_path / "outputs").iterdir())


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_interrupted_cases_keep_those_that_are_done(number: int, tmp_path: Path) -> None:
    (tmp_path / "short.nml").write_text(MINIMAL)
    (tmp_path / "long.nml").write_text(LONG)
    command = [*DRIVER, "run", "-q", "--no-figures", "short.nml", "long.nml"]
    with subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.PIPE, text=True) as process:
        while not (tmp_path / "outputs/short/summary.nml").exists():
            time.sleep(0.01)
        time.sleep(0.2)
        assert INTERRUPTED.match(ended(process, number))
    assert names_in(tmp_path / "outputs") == ["short"]
    assert thud.read_results(tmp_path / "outputs/short").contact_time > 0


@pytest.mark.slow
def test_interrupted_study_waits_for_no_block(tmp_path: Path) -> None:
    (tmp_path / "study.toml").write_text(
        "parameters.height = {low = 0.9, high = 1.1}\ndesign = {kind = 'random', size = 40}\n"
        "fixed = {model = 'finite_element', radial_elements = 16, polar_elements = 512}\n"
    )
    command = [*DRIVER, "sweep", "-q", "study.toml", "--workers", "2"]
    with subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.PIPE, text=True) as process:
        while not (tmp_path / "outputs/study/study.partial").exists():
            assert process.poll() is None
            time.sleep(0.01)
        time.sleep(1.0)
        assert INTERRUPTED.match(ended(process, signal.SIGINT))
