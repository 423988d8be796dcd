"""Where blocks are computed: threads, processes, or the workers of a Dask scheduler."""

from __future__ import annotations

import logging
import os
import time
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ThreadPoolExecutor, wait
from contextlib import contextmanager, suppress
from threading import Event, Thread
from typing import TYPE_CHECKING, Any

from thud.base.bridge import api
from thud.base.checks import refuse, refuse_value, require_choice, require_whole, shown
from thud.base.errors import NumericalError, ThudError
from thud.base.extras import require_extra
from thud.base.processes import no_interrupt_in_processes, process_pool
from thud.impact.ensemble import MAX_THREADS
from thud.studies.samples import Block, evaluate

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

    from numpy.typing import NDArray

    Keep = Callable[[Block, dict[str, NDArray[Any]]], None]

BACKENDS = ("threads", "processes", "dask")
# Maximum time until the scheduler replies, s.
SCHEDULER_TIMEOUT = 5.0
# Maximum time without any worker, s.
WORKER_TIMEOUT = 60.0
# Time between two checks of the workers, s.
CHECK_INTERVAL = 5.0


def run_blocks(
    blocks: Iterable[Block],
    keep: Keep,
    backend: str | None = None,
    workers: int | None = None,
    scheduler: str | None = None,
) -> None:
    """Compute blocks in any order; `keep` takes each with its results as soon as it is done.

    For the other arguments see `thud.studies.kind.RunOptions`. Raises NumericalError if the
    backend loses a block.
    """
    backend, workers, scheduler = checked_backend(backend, workers, scheduler)
    with _open(backend, workers, scheduler) as (executor, width, check):
        running: dict[Future[dict[str, NDArray[Any]]], Block] = {}
        try:
            for block in blocks:
                if len(running) >= 2 * width:
                    _collect(running, keep, check)
                with no_interrupt_in_processes():
                    running[executor.submit(evaluate, block)] = block
            while running:
                _collect(running, keep, check)
        except BaseException as error:
            # After an error running blocks are completed and kept; an interrupt ends them.
            interrupted = isinstance(error, KeyboardInterrupt)
            for future in [] if interrupted else list(running):
                if future.cancel():
                    del running[future]
            done, _ = wait(running, timeout=0 if interrupted else None)
            for future in done:
                if not future.cancelled() and not future.exception():
                    with suppress(OSError):
                        keep(running[future], future.result())
            raise


def checked_backend(
    backend: str | None, workers: int | None, scheduler: str | None
) -> tuple[str, int | None, str | None]:
    """Return a backend, number of workers and scheduler that belong together."""
    backend = backend or ("dask" if scheduler else BACKENDS[0])
    require_choice("backend", backend, BACKENDS)
    if (backend == "dask") != (scheduler is not None):
        refuse_value(
            f"backend = {backend!r} with scheduler",
            scheduler,
            "the address of a scheduler for dask, none for other backends",
        )
    if workers is not None:
        if scheduler:
            refuse(f"workers = {shown(workers)} is not allowed for dask", "none: Dask has its own")
        require_whole("workers", workers, 1, MAX_THREADS)
    return backend, workers, scheduler


def _collect(
    running: dict[Future[dict[str, NDArray[Any]]], Block], keep: Keep, check: Callable[[], None]
) -> None:
    """Keep the blocks that are done, at least one; check the workers meanwhile."""
    done, _ = wait(running, CHECK_INTERVAL, FIRST_COMPLETED)
    while not done:
        check()
        done, _ = wait(running, CHECK_INTERVAL, FIRST_COMPLETED)
    for future in done:
        try:
            result = future.result()
        except ThudError:
            raise
        except Exception as error:
            del running[future]
            reason = f"{type(error).__name__}: {error}".partition("\n")[0].removesuffix(": ")
            message = _lost(f"the backend lost a block of samples ({reason})")
            raise NumericalError(message) from error
        keep(running[future], result)
        del running[future]


@contextmanager
def _open(
    backend: str, workers: int | None, scheduler: str | None
) -> Iterator[tuple[Executor, int, Callable[[], None]]]:
    """Open a backend; yield its executor, number of parallel blocks, and check of its workers.

    An interrupt ends the blocks that are running.
    """
    if scheduler is not None:
        with _dask(scheduler) as opened:
            yield opened
        return
    width = workers or min(len(os.sched_getaffinity(0)), MAX_THREADS)
    if backend == "threads":
        with ThreadPoolExecutor(width) as threads:
            try:
                yield threads, width, lambda: None
            except KeyboardInterrupt:
                threads.shutdown(wait=False, cancel_futures=True)
                api.end_calls()
                raise
        return
    with process_pool(width) as processes:
        yield processes, width, lambda: None


@contextmanager
def _dask(address: str) -> Iterator[tuple[Executor, int, Callable[[], None]]]:
    with require_extra("dask"):
        from distributed import Client
        from distributed.comm.addressing import parse_address
        from distributed.comm.registry import get_backend
    with _silent("distributed", "tornado", "asyncio"):
        try:
            # A client for an unknown kind of address would fail again when it is deleted.
            get_backend(parse_address(address)[0])
            client = _connected(Client, address)
        except (OSError, ValueError, TypeError) as error:
            refuse(
                f"scheduler = {shown(address)} does not answer within {SCHEDULER_TIMEOUT:g} s",
                "the address of a running scheduler, such as tcp://host:8786",
                error,
            )
        with client:
            width = _wait_for_cores(client)
            if not width:
                refuse(
                    f"scheduler = {shown(address)} has no worker after {SCHEDULER_TIMEOUT:g} s",
                    "a scheduler with workers",
                )
            with client.get_executor() as executor:
                try:
                    yield executor, width, _new_check(client)
                except KeyboardInterrupt:
                    executor.shutdown(wait=False)
                    raise


def _connected(kind: type, address: str) -> Any:  # noqa: ANN401 - of an optional package
    """Return a client of a scheduler; raise OSError if it does not answer in time.

    The client has no time limit after it has connected. Another thread therefore waits for the
    client, and closes a client that is late.
    """
    connection: Future[Any] = Future()
    late = Event()

    def connect() -> None:
        try:
            # The default client would also manage file locks, which belong to this process.
            client = kind(address, timeout=SCHEDULER_TIMEOUT, set_as_default=False)
        except Exception as error:  # noqa: BLE001 - raised by `result`
            connection.set_exception(error)
            return
        if late.is_set():
            client.close()
        connection.set_result(client)

    Thread(target=connect, daemon=True).start()
    try:
        return connection.result(SCHEDULER_TIMEOUT + 1)
    except TimeoutError:
        late.set()
        raise


def _cores(client: Any) -> int:  # noqa: ANN401 - of an optional package
    """Return the number of cores of all workers; raise OSError if the scheduler does not answer."""
    return sum(client.sync(client.scheduler.ncores, callback_timeout=SCHEDULER_TIMEOUT).values())


def _wait_for_cores(client: Any) -> int:  # noqa: ANN401 - of an optional package
    """Return the number of cores of all workers, 0 if none starts in time."""
    end = time.monotonic() + SCHEDULER_TIMEOUT
    cores = 0
    with suppress(OSError):
        while not (cores := _cores(client)) and time.monotonic() < end:
            time.sleep(0.1)
    return cores


def _new_check(client: Any) -> Callable[[], None]:  # noqa: ANN401 - of an optional package
    """Return a check that raises NumericalError if the scheduler or all workers are lost.

    The scheduler drops unresponsive workers, see `distributed.scheduler.worker-ttl`.
    """
    last_seen = time.monotonic()

    def check() -> None:
        nonlocal last_seen
        try:
            cores = _cores(client)
        except OSError as error:
            message = _lost(f"the scheduler does not answer within {SCHEDULER_TIMEOUT:g} s")
            raise NumericalError(message) from error
        if cores:
            last_seen = time.monotonic()
        elif time.monotonic() - last_seen > WORKER_TIMEOUT:
            raise NumericalError(_lost("the scheduler has no worker left"))

    return check


def _lost(cause: str) -> str:
    return f"{cause}; finished samples are kept; allowed: run the study again"


@contextmanager
def _silent(*packages: str) -> Iterator[None]:
    """Silence the loggers of packages: their failures are raised as one message."""
    names = [name for name in logging.root.manager.loggerDict if name.partition(".")[0] in packages]
    loggers = [logger for name in names if not (logger := logging.getLogger(name)).disabled]
    for logger in loggers:
        logger.disabled = True
    try:
        yield
    finally:
        for logger in loggers:
            logger.disabled = False
