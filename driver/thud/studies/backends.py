"""Where blocks are computed: threads of this process, or any executor."""

from __future__ import annotations

import logging
import os
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ThreadPoolExecutor, wait
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, Any

from thud.base.bridge import api
from thud.base.checks import refuse, require_whole, shown
from thud.base.errors import NumericalError, ThudError
from thud.base.extras import require_extra
from thud.impact.ensemble import MAX_THREADS
from thud.studies.samples import Block, evaluate

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

    from numpy.typing import NDArray

    Keep = Callable[[Block, dict[str, NDArray[Any]]], None]

# Maximum time until a scheduler replies and has a worker, s.
SCHEDULER_TIMEOUT = 5.0
# Number of blocks that an executor of the caller has at a time: its width is not known.
_SUBMITTED = 256


def run_blocks(
    blocks: Iterable[Block],
    keep: Keep,
    workers: int | None = None,
    executor: Executor | None = None,
) -> None:
    """Compute blocks in any order; `keep` takes each with its results as soon as it is done.

    For the other arguments see `thud.studies.kind.RunOptions`. An interrupt ends the threads.
    Raises NumericalError if the executor loses a block.
    """
    require_workers(workers, executor)
    if executor is not None:
        _run(blocks, keep, executor, _SUBMITTED)
        return
    width = workers or min(len(os.sched_getaffinity(0)), MAX_THREADS)
    with ThreadPoolExecutor(width) as threads:
        try:
            _run(blocks, keep, threads, 2 * width)
        except KeyboardInterrupt:
            threads.shutdown(wait=False, cancel_futures=True)
            api.end_calls()
            raise


def require_workers(workers: int | None, executor: Executor | None) -> None:
    """Raise InputError for a number of workers that is not allowed."""
    if workers is not None:
        if executor is not None:
            refuse(f"workers = {shown(workers)} with an executor", "none: it has its own workers")
        require_whole("workers", workers, 1, MAX_THREADS)


def _run(blocks: Iterable[Block], keep: Keep, executor: Executor, most: int) -> None:
    """Compute blocks, at most `most` at a time."""
    running: dict[Future[dict[str, NDArray[Any]]], Block] = {}
    try:
        for block in blocks:
            if len(running) >= most:
                _collect(running, keep)
            running[executor.submit(evaluate, block)] = block
        while running:
            _collect(running, keep)
    except BaseException as error:
        # After an error running blocks are completed and kept; an interrupt waits for none.
        started = [future for future in running if not future.cancel()]
        done, _ = wait(started, timeout=0 if isinstance(error, KeyboardInterrupt) else None)
        for future in done:
            if not future.cancelled() and not future.exception():
                with suppress(OSError):
                    keep(running[future], future.result())
        raise


def _collect(running: dict[Future[dict[str, NDArray[Any]]], Block], keep: Keep) -> None:
    """Keep the blocks that are done, at least one."""
    done, _ = wait(running, return_when=FIRST_COMPLETED)
    for future in done:
        try:
            result = future.result()
        except ThudError:
            raise
        except Exception as error:
            del running[future]
            reason = f"{type(error).__name__}: {error}".partition("\n")[0].removesuffix(": ")
            message = (
                f"the executor lost a block of samples ({reason}); finished samples are kept; "
                "allowed: run the study again"
            )
            raise NumericalError(message) from error
        keep(running[future], result)
        del running[future]


@contextmanager
def dask_executor(address: str) -> Iterator[Executor]:
    """Yield the executor of a Dask scheduler; raise InputError if it has no worker in time."""
    with require_extra("dask"):
        from distributed import Client
    # Failures are raised as one message.
    logging.disable(logging.CRITICAL)
    try:
        try:
            client = Client(  # type: ignore[no-untyped-call]
                address, timeout=SCHEDULER_TIMEOUT, set_as_default=False
            )
            client.wait_for_workers(1, timeout=SCHEDULER_TIMEOUT)
        except (OSError, ValueError, TypeError) as error:
            refuse(
                f"scheduler = {shown(address)} has no worker within {SCHEDULER_TIMEOUT:g} s",
                "the address of a running scheduler with workers, such as tcp://host:8786",
                error,
            )
        with client:
            executor = client.get_executor()  # type: ignore[no-untyped-call]
            try:
                yield executor
            finally:
                executor.shutdown(wait=False)
    finally:
        logging.disable(logging.NOTSET)
