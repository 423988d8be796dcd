"""Measurement of all drops in signals of one source."""

from __future__ import annotations

import math
from collections import deque
from concurrent.futures import BrokenExecutor
from contextlib import ExitStack
from dataclasses import dataclass, fields, replace
from functools import partial
from typing import TYPE_CHECKING

from threadpoolctl import threadpool_limits
from tqdm import tqdm

from thud.base.checks import refuse
from thud.base.errors import NumericalError
from thud.base.processes import no_interrupt_in_processes, process_pool
from thud.recordings.assumptions import with_assumptions
from thud.recordings.choice import choose, require_chosen
from thud.recordings.drops import search_drops
from thud.recordings.load_cells import repair_cells
from thud.recordings.measured_drop import measure_drop
from thud.recordings.quantization import find_quantization
from thud.recordings.response import correct_window
from thud.recordings.ringing import find_ringing, is_in_record
from thud.recordings.same_drops import (
    Record,
    refuse_copy,
    refuse_same_drops,
    refuse_simultaneous_channels,
)
from thud.recordings.tones import remove_tones

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence
    from concurrent.futures import ProcessPoolExecutor

    from thud.recordings.config import Config
    from thud.recordings.drops import Window
    from thud.recordings.measured_drop import Drop
    from thud.recordings.signal import Signal

# Minimum number of drops, or duration of a signal, s, for processes, which take a second to start.
MIN_FOR_POOL = 40
MIN_DURATION = 600.0


@dataclass(frozen=True)
class Origin:
    """Signal from which drops were measured: attributes of `Signal`, and the number of drops."""

    name: str
    path: str
    checksum: str
    date: str
    calibration: str
    sample_rate: float
    steps: tuple[str, ...]
    warnings: tuple[str, ...]
    drops: int

    @classmethod
    def of(cls, signal: Signal, drops: int, notes: tuple[str, ...]) -> Origin:
        """Return the origin of a number of drops of a signal, with notes on others."""
        names = (field.name for field in fields(cls)[:-1])
        origin = cls(**{name: getattr(signal, name) for name in names}, drops=drops)
        return replace(origin, steps=(*origin.steps, *notes))


def _section(config: Config) -> tuple[str, ...]:
    """Return a sentence on the section that was searched for drops, if it is not the whole file."""
    if config.begin is None and config.end is None:
        return ()
    end = "the end" if config.end is None else f"{config.end:g} s"
    return (f"searched for drops from {config.begin or 0:g} s to {end} only",)


def measure_signals(
    signals: Iterable[Signal],
    config: Config,
    *,
    progress: bool = False,
    workers: int = 1,
) -> tuple[tuple[Drop, ...], tuple[Origin, ...], float | None]:
    """Return the drops of signals, their origins, and the relative uncertainty of the force.

    The uncertainty is the largest of all signals, None if it is unknown for any of them. The
    arguments are those of `read_recording`. Raise InputError if there are no signals, a drop
    cannot be measured, or two signals record the same drop.
    """
    records: list[Record] = []
    searched: list[tuple[str, list[Window]]] = []
    origins: list[Origin] = []
    uncertainties: list[float | None] = []
    count = 0
    # BLAS threads slow down the many small matrix products.
    with threadpool_limits(1, "blas"), _Processes(workers) as processes:
        for signal in signals:
            if config.calibration_uncertainty is not None:
                signal = replace(signal, calibration_uncertainty=config.calibration_uncertainty)  # noqa: PLW2901
            refuse_copy(signal, records)
            # The processes start during the search for drops.
            if signal.path and signal.n_sample > MIN_DURATION * signal.sample_rate:
                processes.start()
            search = search_drops(
                signal, config.begin or 0.0, config.end or math.inf, progress=progress
            )
            windows, left_out = choose(search.windows, count + 1, config.drops, config.leave_out)
            count += len(search.windows)
            refuse_simultaneous_channels(search.windows, searched)
            searched.append((signal.path, search.windows))
            measured = _measure(windows, config, processes, progress=progress)
            notes = (*_section(config), *search.ignored, *left_out)
            records.append(Record(signal.name, signal.path, signal.checksum, tuple(measured)))
            uncertainties.append(signal.calibration_uncertainty)
            origins.append(Origin.of(signal, len(windows), notes))
    if not records:
        refuse("there are no recordings", "one file or more")
    require_chosen(count, sum(len(r.drops) for r in records), config.drops, config.leave_out)
    refuse_same_drops(records)
    known = [uncertainty for uncertainty in uncertainties if uncertainty is not None]
    uncertainty = max(known) if len(known) == len(uncertainties) else None
    drops = tuple(drop for record in records for drop in record.drops)
    return drops, tuple(origins), uncertainty


def _measure(
    windows: Sequence[Window],
    config: Config,
    processes: _Processes,
    *,
    progress: bool,
) -> list[Drop]:
    """Return the drops in the windows of one signal."""
    if not windows:
        return []
    signal = windows[0].signal
    # A signal in memory would be copied to the processes with each window.
    if signal.path and len(windows) >= MIN_FOR_POOL:
        processes.start()
    call = partial(measure_window, config=config)
    results = processes.map(call, windows) if signal.path else map(call, windows)
    return list(
        tqdm(
            results, total=len(windows), unit="drop", desc=signal.name, disable=not progress,
            leave=False,
        )
    )  # fmt: skip


def _limit_threads() -> None:
    """Limit the BLAS libraries that this module loads to one thread."""
    threadpool_limits(1, "blas")


class _Processes(ExitStack):
    """Pool of processes that measure drops; a context manager."""

    def __init__(self, workers: int) -> None:
        super().__init__()
        self.workers = workers
        self._pool: ProcessPoolExecutor | None = None

    def start(self) -> None:
        """Start the processes, without waiting for them."""
        if self.workers < 2 or self._pool:  # noqa: PLR2004 - 1 is this process
            return
        self._pool = self.enter_context(process_pool(self.workers, _limit_threads))
        with no_interrupt_in_processes():
            for _ in range(self.workers):
                self._pool.submit(int)

    def map(self, call: Callable[[Window], Drop], windows: Sequence[Window]) -> Iterator[Drop]:
        """Yield the results of calls in order; without a pool, this process makes the calls."""
        if not self._pool:
            yield from map(call, windows)
            return
        calls = deque(self._pool.submit(call, window) for window in windows)
        try:
            while calls:
                # The queue must not keep a yielded result in memory.
                yield calls.popleft().result()
        except BrokenExecutor as error:
            message = (
                f"{windows[0].signal.name}: a process that measured drops has died; allowed: "
                "measure again, or with one worker"
            )
            raise NumericalError(message) from error
        finally:
            for future in calls:
                future.cancel()


def measure_window(window: Window, config: Config) -> Drop:
    """Return the drop in a window, after correction of the responses of the instruments."""
    steps, warnings = tuple[str, ...](), tuple[str, ...]()
    window = replace(window, quantization=find_quantization(window))
    if window.signal.cells:
        window, steps, warnings = repair_cells(window)
    window, notes, further = remove_tones(window)
    steps, warnings = (*steps, *notes), (*warnings, *further)
    chain, plate, recorded = config.chain, config.resonance, window
    if chain is not None:
        window, notes, further = correct_window(window, chain)
        steps, warnings = (*steps, *notes), (*warnings, *further)
    drop = measure_drop(window, config.conditions(window.signal.calibration_uncertainty))
    # A copy without the cached factors of the background, which are no longer needed.
    contact = replace(drop.contact, background=replace(drop.contact.background))
    ringing = find_ringing(contact, chain)
    rings = {str(ringing): 0.0} if ringing else {}
    drop = replace(
        drop,
        contact=contact,
        steps=(*steps, *drop.steps),
        # A flat top stays flat without tones.
        warnings=tuple(dict.fromkeys((*warnings, *drop.warnings, *rings))),
        level_effects=drop.level_effects | rings,
        ringing=ringing,
        plate_recorded=None if plate is None else is_in_record(recorded, contact, plate),
    )
    return with_assumptions(drop, config)
