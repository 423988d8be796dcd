"""Signals of one source to drops and where they come from."""

from __future__ import annotations

from collections import deque
from concurrent.futures import BrokenExecutor
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

from threadpoolctl import threadpool_limits
from tqdm import tqdm

from thud.checks import refuse
from thud.errors import NumericalError
from thud.processes import no_interrupt_in_processes, process_pool
from thud.recordings.drops import find_windows
from thud.recordings.estimates import measure_drop
from thud.recordings.kept import KeptDrops
from thud.recordings.plate_correction import correct_window

if TYPE_CHECKING:
    import os
    from collections.abc import Callable, Iterable, Iterator, Sequence

    from thud.recordings.config import Config
    from thud.recordings.drops import Window
    from thud.recordings.estimates import Drop
    from thud.recordings.signal import Signal

# Drops that are worth a process of their own, which takes about two seconds to start.
WORTH = 20


@dataclass(frozen=True)
class Origin:
    """Where drops come from.

    Attributes
    ----------
    name, path, checksum, date, calibration : str
        As those of a `Signal`; the checksum is SHA-256.
    sample_rate : float
        Samples per second, Hz.
    drops : int
        Number of drops that were found.
    steps, remarks : tuple of str
        What reading has done, and what is doubtful; a sentence each.
    """

    name: str
    path: str
    checksum: str
    date: str
    calibration: str
    sample_rate: float
    drops: int
    steps: tuple[str, ...]
    remarks: tuple[str, ...]

    @classmethod
    def of(cls, signal: Signal, drops: int) -> Origin:
        """Return the origin of a number of drops of a signal."""
        return cls(
            signal.name,
            signal.path,
            signal.checksum,
            signal.date,
            signal.calibration,
            signal.sample_rate,
            drops,
            signal.steps,
            signal.remarks,
        )


def measure_signals(
    signals: Iterable[Signal],
    config: Config,
    *,
    progress: bool = False,
    workers: int = 1,
    keep: str | os.PathLike[str] | None = None,
) -> tuple[tuple[Drop, ...], tuple[Origin, ...], float | None]:
    """Return the drops of signals, their origins, and the relative uncertainty of the force.

    The last is the largest of the signals, and None where it is not known of one. The others are
    those of `read_recording`.

    Raises
    ------
    InputError
        Where there are no signals, or a drop cannot be measured.
    """
    drops: list[Drop] = []
    origins: list[Origin] = []
    uncertainties: list[float | None] = []
    # Its many small products are slower by threads.
    with threadpool_limits(1, "blas"), KeptDrops(keep) as kept:
        for given in signals:
            signal = given
            if config.calibration_uncertainty is not None:
                signal = replace(given, calibration_uncertainty=config.calibration_uncertainty)
            windows = find_windows(signal, progress=progress)
            drops += _measure(windows, config, kept, progress=progress, workers=workers)
            uncertainties.append(signal.calibration_uncertainty)
            origins.append(Origin.of(signal, len(windows)))
    if not drops:
        refuse("there are no recordings", "one file or more")
    known = [one for one in uncertainties if one is not None]
    uncertainty = max(known) if len(known) == len(uncertainties) else None
    return tuple(drops), tuple(origins), uncertainty


def _measure(
    windows: Sequence[Window], config: Config, kept: KeptDrops, *, progress: bool, workers: int
) -> list[Drop]:
    """Return the drops in the windows of one signal, those that are kept among them."""
    signal = windows[0].signal
    found = kept.open(signal, config)
    left = [window for window in windows if window.start not in found]
    # An array would go to the processes with each of its windows.
    width = min(workers, len(left) // WORTH) if signal.path else 1
    with (
        tqdm(
            total=len(windows), initial=len(windows) - len(left), unit="drop", desc=signal.name,
            disable=not progress,
        ) as bar,
        _calls(partial(measure_window, config=config), left, width) as results,
    ):  # fmt: skip
        for window, drop in zip(left, results, strict=True):
            kept.add(window.start, drop)
            found[window.start] = drop
            bar.update()
    return [found[window.start] for window in windows]


@contextmanager
def _calls(
    measure: Callable[[Window], Drop], windows: Sequence[Window], width: int
) -> Iterator[Iterator[Drop]]:
    """Yield the results of calls in order, of more than one process where the width is larger."""
    if width <= 1:
        yield map(measure, windows)
        return
    with process_pool(width, partial(threadpool_limits, 1, "blas")) as pool:
        with no_interrupt_in_processes():
            calls = deque(pool.submit(measure, window) for window in windows)
        try:
            # What was taken is dropped, so that it is not held twice.
            yield (calls.popleft().result() for _ in windows)
        except BrokenExecutor as error:
            message = (
                f"{windows[0].signal.name}: a process that measured drops has died; allowed: "
                "measure again, or with one worker"
            )
            raise NumericalError(message) from error
        finally:
            for call in calls:
                call.cancel()


def measure_window(window: Window, config: Config) -> Drop:
    """Return what the drop in a window tells, the resonance of the plate taken out before."""
    steps, remarks = tuple[str, ...](), tuple[str, ...]()
    plate = config.resonance
    if plate is not None:
        window, steps, remarks = correct_window(window, plate)
    drop = measure_drop(
        window,
        height=config.height,
        mass=config.mass,
        calibration_uncertainty=window.signal.calibration_uncertainty or 0.0,
        mass_uncertainty=config.mass_uncertainty or 0.0,
        height_uncertainty=config.height_uncertainty or 0.0,
    )
    # Factors that the background has cached serve the fit alone, and are larger than all else.
    contact = replace(drop.contact, background=replace(drop.contact.background))
    drop = replace(drop, contact=contact)
    if plate is None:
        return drop
    return replace(drop, steps=(*steps, *drop.steps), remarks=(*remarks, *drop.remarks))
