"""A recording: drops of one source, measured, and what the standards say of it."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from threadpoolctl import threadpool_limits

from thud.checks import refuse, require_number
from thud.display import MAKERS, Displayed
from thud.levels import RECORDED_BAND, peak_count
from thud.recordings.config import Config, check_key, read_config
from thud.recordings.drops import find_windows
from thud.recordings.estimates import Estimate, measure_drop
from thud.recordings.excursion import doubt, scan
from thud.recordings.faults import repair
from thud.recordings.levels import (
    AverageLevels,
    average_levels,
    compare_methods,
    measure_levels,
)
from thud.recordings.plate import REACH, Plate, correct_plate
from thud.recordings.reading import open_signals
from thud.recordings.signal import Signal
from thud.recordings.verdict import (
    Contribution,
    Quantity,
    Verdict,
    average_estimates,
    decide,
    level_quantities,
)

if TYPE_CHECKING:
    from collections.abc import Iterable

    from matplotlib.figure import Figure
    from numpy.typing import ArrayLike, NDArray

    from thud._schema import BandSet, LevelsForce, LimitsSource
    from thud.recordings.estimates import Drop


# Length of the ringing of a plate that a piece of a signal takes along, periods times quality.
PERIODS = 2.0
# Prominence of a peak that counts, as part of the peak force, and the least of it in standard
# deviations of the noise.
PROMINENCE = 0.1
CLEAR_PEAK = 6.0


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


@dataclass(frozen=True, eq=False)
class Recording(Displayed):
    """Recorded drops of one source.

    Where one force is asked for (`time`, `force`, comparisons, fits) it is that of the first drop;
    levels and the other numbers are averages over all drops.

    Attributes
    ----------
    name : str
        Name of the recording, also of its results.
    drops : tuple of Drop
        The drops in order.
    origins : tuple of Origin
        The files.
    config : Config
        What the laboratory says; mass, kg, and height, m, may be None.
    calibration_uncertainty : float or None
        Relative standard uncertainty of the force; None where it is not known.
    """

    name: str
    drops: tuple[Drop, ...]
    origins: tuple[Origin, ...]
    config: Config = field(default_factory=Config)
    calibration_uncertainty: float | None = None

    def __repr__(self) -> str:
        """Return the main numbers of the recording, without its samples."""
        number = len(self.drops)
        return (
            f"<Recording {self.name}: {number} drop{'s' * (number != 1)}, "
            f"contact {1e3 * self.contact_time:.2f} ms, peak {self.peak():.0f} N>"
        )

    def rows(self) -> list[tuple[str, ...]]:
        """Return header and rows of text: the criteria."""
        return self.conformity().rows()

    @classmethod
    def from_array(  # noqa: PLR0913 - what a laboratory knows
        cls,
        force: ArrayLike,
        sample_rate: float,
        *,
        height: float | None = None,
        mass: float | None = None,
        calibration_uncertainty: float | None = None,
        name: str = "recording",
    ) -> Recording:
        """Measure the drops in a force record.

        Parameters
        ----------
        force : array_like, shape (n_sample,)
            Force, N, positive in compression, with quiet before and after each drop.
        sample_rate
            Samples per second, Hz.
        height, mass, calibration_uncertainty, name
            As `read_recording` takes them.

        Raises
        ------
        InputError
            One sentence: what cannot be measured.
        """
        config = _checked(
            Config(height=height, mass=mass, calibration_uncertainty=calibration_uncertainty)
        )
        signal = Signal.from_array(force, sample_rate, name)
        doubts = doubt(scan(signal.read, signal.n_sample, name), 1.0, name, assumed=False)
        return _recording([replace(signal, remarks=doubts)], config)

    @property
    def time(self) -> NDArray[np.float64]:
        """Time of the first drop since first touch, s, shape (n_sample,)."""
        return self.drops[0].time

    @property
    def record(self) -> NDArray[np.float64]:
        """Force of the first drop, corrected, N, shape (n_sample,)."""
        return self.drops[0].force

    @property
    def sample_rate(self) -> float:
        """Samples per second of the first drop, Hz."""
        return self.drops[0].sample_rate

    @property
    def touch_time(self) -> float:
        """Time of first touch, s: 0."""
        return 0.0

    @property
    def origin(self) -> float:
        """Time of first touch of the first drop in its file, s."""
        return self.drops[0].onset

    def judged(self, force: LevelsForce | None = None) -> LevelsForce:  # noqa: ARG002 - there is one
        """Return the force that a force plate measures: ``"floor"``."""
        return "floor"

    @property
    def level_method(self) -> str:
        """Method of the levels: ``"exact"``."""
        return "exact"

    @property
    def contact_time(self) -> float:
        """Mean contact time, s."""
        return self.quantities["contact_time"].value

    @property
    def restitution(self) -> float:
        """Mean coefficient of restitution; NaN where it is not known."""
        return self.quantities["restitution"].value

    @property
    def peak_force(self) -> float:
        """Mean maximum force below 1.25 kHz, N."""
        return float(np.mean([drop.peak_force.value for drop in self.drops]))

    @property
    def remarks(self) -> tuple[str, ...]:
        """What is doubtful: of files, drops and levels; a sentence each."""
        found = [remark for one in self.origins for remark in one.remarks]
        found += [f"{drop.name}: {remark}" for drop in self.drops for remark in drop.remarks]
        found += [str(outlier) for outlier in self.average().outliers]
        plate = self.config.plate
        missing = {
            "calibration": self.calibration_uncertainty is None,
            "resonance of the plate": plate is not None and plate.f0_uncertainty is None,
        }
        if math.isnan(self.quantities["peaks"].value):
            found.append("the number of peaks is not known: noise may have made some")
        known = sum(math.isfinite(drop.restitution.value) for drop in self.drops)
        if 0 < known < len(self.drops):
            found.append(f"the restitution is known of {known} of {len(self.drops)} drops")
        found += [
            f"the uncertainty of the {what} is not given; it is not part of the uncertainties"
            for what in missing
            if missing[what]
        ]
        return tuple(dict.fromkeys(found))

    @property
    def steps(self) -> tuple[str, ...]:
        """What was done to the signals; a sentence each."""
        found = [f"{one.name}: {step}" for one in self.origins for step in one.steps]
        found += [f"{drop.name}: {step}" for drop in self.drops for step in drop.steps]
        return tuple(dict.fromkeys(found))

    def force(self, kind: LevelsForce | None = None) -> NDArray[np.float64]:  # noqa: ARG002 - there is one
        """Return the force of the first drop, N, shape (n_sample,), for any `kind`."""
        return self.record

    def peak(self, force: LevelsForce | None = None) -> float:  # noqa: ARG002 - there is one
        """Return the mean maximum force, N."""
        return self.peak_force

    def average(self, bands: BandSet = "octave", method: str = "exact") -> AverageLevels:
        """Return the energy average of the levels of the drops, with its uncertainty.

        Parameters
        ----------
        bands
            ``"octave"`` or ``"third"``.
        method
            ``"exact"``, ``"fft"`` or ``"filter"``.
        """
        known = self._averages
        if (bands, method) not in known:
            drops = [measure_levels(drop, bands, method) for drop in self.drops]
            known[bands, method] = average_levels(drops)
        return known[bands, method]

    @cached_property
    def _averages(self) -> dict[tuple[str, str], AverageLevels]:
        return {}

    def levels(
        self,
        bands: BandSet = "octave",
        method: str | None = None,
        force: LevelsForce | None = None,  # noqa: ARG002 - there is one
    ) -> NDArray[np.float64]:
        """Return the force exposure levels, energy average of the drops, dB, shape (n_band,)."""
        return self.average(bands, method or self.level_method).level

    def agreement(self, bands: BandSet = "octave") -> dict[str, NDArray[np.float64]]:
        """Return the largest deviation of each method from ``"exact"`` in any drop, dB."""
        found = [compare_methods(drop, bands) for drop in self.drops]
        return {
            method: np.max([np.abs(one[method] - one["exact"]) for one in found], axis=0)
            for method in found[0]
        }

    @cached_property
    def quantities(self) -> dict[str, Quantity]:
        """Contact time, restitution, peaks, mass and drop height with their budgets."""
        shares = [
            drop.restitution_calibration
            for drop in self.drops
            if math.isfinite(drop.restitution.value)
        ]
        share = float(np.mean(shares)) if shares else 0.0
        peaks = float(np.max([_peaks(drop) for drop in self.drops]))
        config = self.config
        times = [drop.contact_time for drop in self.drops]
        # The flanks of all drops have one shape: what is wrong with it does not average.
        shared = min(time.uncertainty for time in times)
        edges = [Contribution("edges of the pulse", shared)] if len(times) > 1 else []
        return {
            "contact_time": average_estimates(times, *edges),
            "restitution": average_estimates(
                [drop.restitution for drop in self.drops],
                *([Contribution("calibration", share)] if share else []),
            ),
            "peaks": Quantity(peaks),
            "mass": Quantity(math.nan if config.mass is None else config.mass),
            "drop_height": Quantity(math.nan if config.height is None else config.height),
        }

    def conformity(
        self,
        source: LimitsSource | None = None,
        force: LevelsForce | None = None,  # noqa: ARG002 - there is one
    ) -> Verdict:
        """Return the verdict of the standards at 95 %, with the limits of the configuration.

        Parameters
        ----------
        source
            ``"rubber_ball"`` or ``"tyre"``; by default that of the configuration.
        force
            Not used: a force plate measures the force on the floor.
        """
        plate = _plate(self.config)
        return decide(
            level_quantities(
                self.average(),
                self.calibration_uncertainty,
                plate.level_uncertainty() if plate else None,
            ),
            source=source or self.config.source,
            limits=self.config.limits,
            **self.quantities,
        )

    def plot(self, what: Literal["levels", "force"] = "levels") -> Figure:
        """Draw the levels of the drops over the tolerance band, or their forces."""
        figure: Figure = MAKERS["recording"](self, what)
        return figure

    def report(self, directory: str | os.PathLike[str]) -> list[Path]:
        """Write the calibration report to a directory and return the paths of its files.

        Raises
        ------
        OSError
            Where they cannot be written.

        Warns
        -----
        ReportWarning
            Where there is no PDF, or no font for some letters.
        """
        paths: list[Path] = MAKERS["report"](self, directory)
        return paths

    def to_force_history(self, drop: int = 1) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return time since first touch, s, and force, N, of one contact, shape (n_sample,).

        The force is zero before and after: it may drive another program's floor.

        Parameters
        ----------
        drop
            Number of the drop, from 1.
        """
        if not 1 <= drop <= len(self.drops):
            refuse(f"drop = {drop} does not exist", f"1 to {len(self.drops)}")
        one = self.drops[drop - 1]
        gate = slice(*one.gate)
        return one.time[gate], one.force[gate]


def read_recording(  # noqa: PLR0913 - the keys of the configuration
    paths: str | os.PathLike[str] | Iterable[str | os.PathLike[str]],
    *,
    height: float | None = None,
    mass: float | None = None,
    source: LimitsSource | None = None,
    channel: int | str | None = None,
    unit: str | None = None,
    calibration: float | str | None = None,
    calibration_uncertainty: float | None = None,
    polarity: str | None = None,
    sample_rate: float | None = None,
    config: Config | str | os.PathLike[str] | None = None,
    progress: bool = False,
) -> Recording:
    """Read recorded drops of one source, from any number of files with one or many drops each.

    Parameters
    ----------
    paths
        Files; see docs/recordings_reading.md for the formats.
    height
        Drop height, m.
    mass
        Mass of the source, kg. With both, restitution follows from the impulse.
    source
        Source whose limits apply, ``"rubber_ball"`` or ``"tyre"``.
    channel, unit, calibration, polarity, sample_rate
        As `open_signals` takes them.
    calibration_uncertainty
        Relative standard uncertainty of the force, wherever its calibration comes from.
    config
        Configuration of the laboratory, or its file; the other arguments come first.
    progress
        Show a progress bar.

    Returns
    -------
    Recording

    Raises
    ------
    InputError
        One sentence: what cannot be read or measured.
    """
    known = config if isinstance(config, Config) else read_config(config) if config else Config()
    given: dict[str, Any] = {
        "height": height, "mass": mass, "source": source, "channel": channel, "unit": unit,
        "calibration": calibration, "calibration_uncertainty": calibration_uncertainty,
        "polarity": polarity, "sample_rate": sample_rate,
    }  # fmt: skip
    known = replace(known, **{key: value for key, value in given.items() if value is not None})
    files = [paths] if isinstance(paths, str | os.PathLike) else paths
    checked = _checked(known)
    signals = (signal for path in files for signal in _signals(path, checked))
    return _recording(signals, checked, progress=progress)


def _checked(config: Config) -> Config:
    """Return a configuration whose numbers are allowed."""
    if config.calibration_uncertainty is not None:
        check_key(
            "calibration_uncertainty", config.calibration_uncertainty, "calibration_uncertainty"
        )
    for key in ("height", "mass"):
        value = getattr(config, key)
        if value is None:
            continue
        require_number(key, value)
        if value <= 0:
            refuse(f"{key} = {value:g} is not allowed", f"{key} > 0")
    return config


def _recording(signals: Iterable[Signal], config: Config, *, progress: bool = False) -> Recording:
    """Return the drops of signals."""
    drops: list[Drop] = []
    origins: list[Origin] = []
    uncertainties: list[float | None] = []
    for given in signals:
        signal = given
        if config.calibration_uncertainty is not None:
            signal = replace(given, calibration_uncertainty=config.calibration_uncertainty)
        # Its many small products are slower by threads.
        with threadpool_limits(1, "blas"):
            found = _drops(signal, config, progress=progress)
        drops += found
        uncertainties.append(signal.calibration_uncertainty)
        origins.append(_origin(signal, len(found)))
    if not drops:
        refuse("there are no recordings", "one file or more")
    name = Path(origins[0].path or origins[0].name).stem
    known = [one for one in uncertainties if one is not None]
    uncertainty = max(known) if len(known) == len(uncertainties) else None
    return Recording(name, tuple(drops), tuple(origins), config, uncertainty)


def _peaks(drop: Drop) -> float:
    """Return the number of peaks of the force of a drop; NaN where noise may have made some."""
    force = drop.force[slice(*drop.gate)]
    count = peak_count(force, drop.sample_rate)
    # Slower noise than the contact tilts the pulse, and makes no peak.
    noise = drop.noise.deviation_between(1 / drop.contact_time.value, RECORDED_BAND)
    clear = PROMINENCE * drop.peak_force.value >= CLEAR_PEAK * noise
    return float(count) if clear or count == 1 else math.nan


def _signals(path: str | os.PathLike[str], config: Config) -> list[Signal]:
    return open_signals(
        path,
        channel=config.channel,
        unit=config.unit,
        calibration=config.calibration,
        polarity=config.polarity,
        sample_rate=config.sample_rate,
    )


def _plate(config: Config) -> Plate | None:
    """Return the resonance of the plate that is corrected."""
    given = config.plate
    if given is None:
        return None
    return Plate(given.f0, given.Q, frequency_uncertainty=given.f0_uncertainty or 0.0)


@dataclass(frozen=True, eq=False)
class _Corrected:
    """Samples of a signal without the resonance of its plate."""

    signal: Signal
    plate: Plate

    def __call__(self, start: int, stop: int) -> NDArray[np.float64]:
        """Return the force that was applied to the plate, N, shape (stop - start,)."""
        # What comes before rings on: some periods of the resonance.
        room = math.ceil(
            PERIODS * self.plate.quality * self.signal.sample_rate / self.plate.frequency
        )
        first, last = max(start - room, 0), min(stop + room, self.signal.n_sample)
        force = self.signal.read(first, last)
        corrected, _ = correct_plate(force, self.signal.sample_rate, self.plate)
        return corrected[start - first : stop - first]


@dataclass(frozen=True, eq=False)
class _Repaired:
    """Samples of a signal of which those from `start` on were repaired."""

    signal: Signal
    start: int
    force: NDArray[np.float64]

    def __call__(self, start: int, stop: int) -> NDArray[np.float64]:
        """Return the force, N, shape (stop - start,)."""
        force = self.signal.read(start, stop)
        first, last = max(start, self.start), min(stop, self.start + len(self.force))
        if first < last:
            force[first - start : last - start] = self.force[first - self.start : last - self.start]
        return force


def _drops(signal: Signal, config: Config, *, progress: bool) -> list[Drop]:
    """Return the drops of a signal, the plate's resonance taken out before."""
    plate = _plate(config)
    measure = partial(
        measure_drop,
        height=config.height,
        mass=config.mass,
        calibration_uncertainty=signal.calibration_uncertainty or 0.0,
    )
    if plate is None:
        return [measure(one) for one in find_windows(signal, progress=progress)]
    correction = correct_plate(np.zeros(8), signal.sample_rate, plate)[1]
    found = []
    for window in find_windows(signal, progress=progress):
        # What clips or drops out is what was recorded; corrected, a dropout would ring.
        force, steps, remarks = repair(window)
        repaired = replace(signal, samples=_Repaired(signal, window.start, force))
        applied = replace(signal, samples=_Corrected(repaired, plate), full_scale=None)
        bounces = tuple(replace(bounce, signal=applied) for bounce in window.bounces)
        drop = measure(replace(window, signal=applied, bounces=bounces))
        time = drop.contact_time
        # The correction ends at its reach: an edge is spread over half a period of that.
        spread = 1 / (2 * REACH * plate.resonance)
        found.append(
            replace(
                drop,
                contact_time=Estimate(time.value, math.hypot(time.uncertainty, spread)),
                steps=(*steps, correction, *drop.steps),
                remarks=(*remarks, *drop.remarks),
            )
        )
    return found


def _origin(signal: Signal, count: int) -> Origin:
    return Origin(
        signal.name,
        signal.path,
        signal.checksum,
        signal.date,
        signal.calibration,
        signal.sample_rate,
        count,
        signal.steps,
        signal.remarks,
    )
