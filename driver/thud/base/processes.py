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
    from collections.abc import Iterator
    from multiprocessing import connection


@contextmanager
def process_pool(n_process: int) -> Iterator[ProcessPoolExecutor]:
    """Open a pool of processes; an interrupt ends the processes."""
    # Forked processes would inherit locks held by threads that they do not have.
    context = get_context("spawn")
    child_end, parent_end = context.Pipe(duplex=False)
    pool = ProcessPoolExecutor(n_process, context, _start, (child_end,))
    with child_end, parent_end, pool as processes:
        try:
            yield processes
        except KeyboardInterrupt:
            parent_end.close()
            raise


@contextmanager
def no_interrupt_in_processes() -> Iterator[None]:
    """Block Ctrl-C, which terminals send to all processes, in processes started in this context."""
    previous = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, previous)


def _start(pipe: connection.Connection) -> None:
    """Let this process exit when the parent ends or closes its end of the pipe."""
    # The default lock is a semaphore of the system, which would outlive such an exit.
    tqdm.set_lock(RLock())

    def exit_with_parent() -> None:
        pipe.poll(None)
        os._exit(1)

    Thread(target=exit_with_parent, daemon=True).start()
