"""Pools of processes that end with their parent process."""

from __future__ import annotations

import os
import signal
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import get_context
from threading import RLock, Thread
from typing import TYPE_CHECKING

from tqdm import tqdm

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from multiprocessing import connection


@contextmanager
def process_pool(
    width: int, prepare: Callable[[], object] | None = None
) -> Iterator[ProcessPoolExecutor]:
    """Open a pool of processes that call `prepare` first; an interrupt ends their work."""
    # Forked processes would inherit locks of threads that they do not have.
    context = get_context("spawn")
    end, release = context.Pipe(duplex=False)
    with end, release, ProcessPoolExecutor(width, context, _start, (end, prepare)) as processes:
        try:
            yield processes
        except KeyboardInterrupt:
            release.close()
            raise


@contextmanager
def no_interrupt_in_processes() -> Iterator[None]:
    """Block Ctrl-C, which terminals send to all processes, in processes started meanwhile."""
    usual = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, usual)


def _start(end: connection.Connection, prepare: Callable[[], object] | None) -> None:
    """End with the parent process, or when the other end of a pipe closes."""
    # The default lock is a semaphore of the system, which would remain after such an end.
    tqdm.set_lock(RLock())

    def end_with_it() -> None:
        end.poll(None)
        os._exit(1)

    Thread(target=end_with_it, daemon=True).start()
    if prepare:
        prepare()
