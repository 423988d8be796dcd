"""Where blocks are computed: threads, processes, or the workers of a Dask scheduler."""

from __future__ import annotations

import logging
import os
import time
import warnings
from concurrent.futures import (
    FIRST_COMPLETED,
    Executor,
    Future,
    ThreadPoolExecutor,
    wait,
)
from contextlib import contextmanager, suppress
from threading import Event, Thread
from typing import TYPE_CHECKING, Any

from thud.base.bridge import api
from thud.base.checks import refuse, refuse_value, require_choice, require_whole, shown
from thud.base.errors import NumericalError, ThudError, WorkerWarning
from thud.base.extras import require_extra
from thud.base.processes import no_interrupt_in_processes, process_pool
from thud.impact.ensemble import MAX_THREADS
from thud.studies.evaluation import Block, evaluate

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

    from numpy.typing import NDArray

    Keep = Callable[[Block, dict[str, NDArray[Any]]], None]

BACKENDS = ("threads", "processes", "dask")
# Time limit for a scheduler to answer, s.
PATIENCE = 5
# Time after which a worker that is not heard of has its blocks taken away, s; they are heard of
# several times in that, also while they compute.
SILENCE = 60.0
# Time between two looks at the workers, s.
LOOK = 5.0


def run_blocks(
    blocks: Iterable[Block],
    keep: Keep,
    backend: str | None = None,
    workers: int | None = None,
    scheduler: str | None = None,
) -> None:
    """Compute blocks in any order; `keep` takes each with its results as soon as it is done.

    Backend, workers and scheduler are those of `thud.studies.kind.How`. Raises NumericalError where
    the backend loses a block.
    """
    backend, workers, scheduler = checked_backend(backend, workers, scheduler)
    with _open(backend, workers, scheduler) as (executor, width, look):
        running: dict[Future[dict[str, NDArray[Any]]], Block] = {}
        try:
            for block in blocks:
                if len(running) >= 2 * width:
                    _collect(running, keep, look)
                with no_interrupt_in_processes():
                    running[executor.submit(evaluate, block)] = block
            while running:
                _collect(running, keep, look)
        except BaseException as error:
            # Running blocks are waited for and kept. After an interrupt the backend ends them.
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
            "the address of a scheduler for dask, and only there",
        )
    if workers is not None:
        if scheduler:
            refuse(f"workers = {shown(workers)} is not allowed for dask", "those it has")
        require_whole("workers", workers, 1, MAX_THREADS)
    return backend, workers, scheduler


def _collect(
    running: dict[Future[dict[str, NDArray[Any]]], Block], keep: Keep, look: Callable[[], None]
) -> None:
    """Keep the blocks that are done, at least one; look after the workers meanwhile."""
    done, _ = wait(running, LOOK, FIRST_COMPLETED)
    while not done:
        look()
        done, _ = wait(running, LOOK, FIRST_COMPLETED)
    for future in done:
        try:
            found = future.result()
        except ThudError:
            raise
        except Exception as error:
            del running[future]
            said = f"{type(error).__name__}: {error}".partition("\n")[0].removesuffix(": ")
            message = _sentence(f"the backend lost a block of samples ({said})")
            raise NumericalError(message) from error
        keep(running[future], found)
        del running[future]


@contextmanager
def _open(
    backend: str, workers: int | None, scheduler: str | None
) -> Iterator[tuple[Executor, int, Callable[[], None]]]:
    """Open a backend; yield its executor, how many blocks run at once, and what looks after it.

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
                yield threads, width, _no_look
            except KeyboardInterrupt:
                threads.shutdown(wait=False, cancel_futures=True)
                api.end_calls()
                raise
        return
    with process_pool(width) as processes:
        yield processes, width, _no_look


def _no_look() -> None:
    """Threads and processes of this machine are waited for."""


@contextmanager
def _dask(address: str) -> Iterator[tuple[Executor, int, Callable[[], None]]]:
    with require_extra("dask"):
        from distributed import Client
        from distributed.comm.addressing import parse_address
        from distributed.comm.registry import get_backend
    with _silent("distributed", "tornado", "asyncio"):
        try:
            # A client of an unknown kind of address would fail again when deleted.
            get_backend(parse_address(address)[0])
            client = _connected(Client, address)
        except (OSError, ValueError, TypeError) as error:
            refuse(
                f"scheduler = {shown(address)} does not answer within {PATIENCE} s",
                "the address of a running one, such as tcp://host:8786",
                error,
            )
        with client:
            width = _width(client)
            if not width:
                refuse(
                    f"scheduler = {shown(address)} shows no worker within {PATIENCE} s",
                    "one with workers",
                )
            with client.get_executor() as executor:
                try:
                    yield executor, width, _Watch(client)
                except KeyboardInterrupt:
                    executor.shutdown(wait=False)
                    raise


def _connected(kind: type, address: str) -> Any:  # noqa: ANN401 - of an optional package
    """Return a client of a scheduler; raise OSError where it does not answer in time.

    The client's own limit does not count the time after the connection, so that another thread
    waits for it, which closes a client that comes too late.
    """
    found: Future[Any] = Future()
    late = Event()

    def connect() -> None:
        try:
            # The default client would also manage locks of files, which stay in this process.
            client = kind(address, timeout=PATIENCE, set_as_default=False)
        except Exception as error:  # noqa: BLE001 - for the one who waits
            found.set_exception(error)
            return
        if late.is_set():
            client.close()
        found.set_result(client)

    Thread(target=connect, daemon=True).start()
    try:
        return found.result(PATIENCE + 1)
    except TimeoutError:
        late.set()
        raise


def _width(client: Any) -> int:  # noqa: ANN401 - of an optional package
    """Return how many blocks run at once, 0 where no worker is there in time."""
    until = time.monotonic() + PATIENCE
    width = 0
    with suppress(TimeoutError, OSError):
        while not width and time.monotonic() < until:
            width = sum(client.sync(client.scheduler.ncores, callback_timeout=PATIENCE).values())
            time.sleep(0.0 if width else 0.1)
    return width


class _Watch:
    """Looks after the workers of a scheduler: takes blocks away from those that are not heard of.

    Raises NumericalError where none is left, or the scheduler does not answer.
    """

    def __init__(self, client: Any) -> None:  # noqa: ANN401 - of an optional package
        self._client = client
        self._seen = time.monotonic()

    def __call__(self) -> None:
        """Look once."""
        limit = SILENCE

        # Sent as it stands: the scheduler may have no thud.
        async def drop(dask_scheduler: Any) -> tuple[list[str], int]:  # noqa: ANN401
            workers = dask_scheduler.workers
            heard = {address: worker.last_seen for address, worker in workers.items()}
            silent = [address for address in heard if time.time() - heard[address] > limit]
            for address in silent:
                await dask_scheduler.remove_worker(address, stimulus_id="silent")
            return silent, len(workers)

        client = self._client
        try:
            # The public one waits for ever.
            silent, left = client.sync(client._run_on_scheduler, drop, callback_timeout=limit)  # noqa: SLF001
        except (TimeoutError, OSError) as error:
            message = _sentence(f"the scheduler does not answer within {limit:g} s")
            raise NumericalError(message) from error
        for address in silent:
            message = (
                f"the worker {address} was not heard of for {limit:g} s; others compute its blocks"
            )
            warnings.warn(message, WorkerWarning, stacklevel=2)
        if left:
            self._seen = time.monotonic()
        elif silent or time.monotonic() - self._seen > limit:
            message = _sentence("no worker of the scheduler is heard of")
            raise NumericalError(message)


def _sentence(what: str) -> str:
    return f"{what}; what was finished is kept; allowed: run the study again"


@contextmanager
def _silent(*names: str) -> Iterator[None]:
    """Silence the loggers of packages: one sentence reports what fails."""
    known = [name for name in logging.root.manager.loggerDict if name.partition(".")[0] in names]
    loggers = [logging.getLogger(other) for other in known]
    usual = [logger.disabled for logger in loggers]
    for logger in loggers:
        logger.disabled = True
    try:
        yield
    finally:
        for logger, disabled in zip(loggers, usual, strict=True):
            logger.disabled = disabled
