"""Signals of one source to drops and where they come from."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from threadpoolctl import threadpool_limits

from thud.checks import refuse
from thud.recordings.drops import find_windows
from thud.recordings.estimates import Estimate, measure_drop
from thud.recordings.plate import REACH
from thud.recordings.plate_correction import correct_window

if TYPE_CHECKING:
    from collections.abc import Iterable

    from thud.recordings.config import Config
    from thud.recordings.drops import Window
    from thud.recordings.estimates import Drop
    from thud.recordings.signal import Signal


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
    signals: Iterable[Signal], config: Config, *, progress: bool = False
) -> tuple[tuple[Drop, ...], tuple[Origin, ...], float | None]:
    """Return the drops of signals, their origins, and the relative uncertainty of the force.

    The last is the largest of the signals, and None where it is not known of one.

    Raises
    ------
    InputError
        Where there are no signals, or a drop cannot be measured.
    """
    drops: list[Drop] = []
    origins: list[Origin] = []
    uncertainties: list[float | None] = []
    for given in signals:
        signal = given
        if config.calibration_uncertainty is not None:
            signal = replace(given, calibration_uncertainty=config.calibration_uncertainty)
        # Its many small products are slower by threads.
        with threadpool_limits(1, "blas"):
            windows = find_windows(signal, progress=progress)
            drops += [measure_window(window, config) for window in windows]
        uncertainties.append(signal.calibration_uncertainty)
        origins.append(Origin.of(signal, len(windows)))
    if not drops:
        refuse("there are no recordings", "one file or more")
    known = [one for one in uncertainties if one is not None]
    uncertainty = max(known) if len(known) == len(uncertainties) else None
    return tuple(drops), tuple(origins), uncertainty


def measure_window(window: Window, config: Config) -> Drop:
    """Return what the drop in a window tells, the resonance of the plate taken out before."""
    steps, remarks = tuple[str, ...](), tuple[str, ...]()
    if config.plate is not None:
        window, steps, remarks = correct_window(window, config.plate.resonance)
    drop = measure_drop(
        window,
        height=config.height,
        mass=config.mass,
        calibration_uncertainty=window.signal.calibration_uncertainty or 0.0,
    )
    if config.plate is None:
        return drop
    time = drop.contact_time
    # The correction ends at its reach: an edge is spread over half a period of that.
    spread = 1 / (2 * REACH * config.plate.resonance.resonance)
    return replace(
        drop,
        contact_time=Estimate(time.value, math.hypot(time.uncertainty, spread)),
        steps=(*steps, *drop.steps),
        remarks=(*remarks, *drop.remarks),
    )
