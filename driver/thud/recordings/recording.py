"""Recorded drops of one source: from files to levels, stage by stage, and their assessment."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, Literal, TypeAlias

import numpy as np
from threadpoolctl import threadpool_limits
from tqdm import tqdm

from thud.base.checks import refuse, require_choice, require_kind
from thud.base.extras import data_frame
from thud.base.note import Note
from thud.case.case import Case
from thud.level.assessment import ImpactOrRecording, assess_levels
from thud.recordings.checks import copies, outliers
from thud.recordings.checks.plate import check_plate
from thud.recordings.config import Config, parse_numbers, read_config
from thud.recordings.drops import Pulse, cut_section, find_drops
from thud.recordings.instruments import CALIBRATION, check_instruments, instrument_uncertainties
from thud.recordings.measured_drop import ESTIMATES, GRAVITY, IMPULSE, measure_stages
from thud.recordings.quantities import check_estimates, drop_estimates
from thud.recordings.recorded_levels import average_levels, mean_force, measure_levels
from thud.recordings.signal import Signal, open_signals

if TYPE_CHECKING:
    from collections.abc import Sequence

    import pandas as pd
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from thud.base._schema import BandSet, LevelsForce, LevelsMethod, LimitsSource
    from thud.impact.impact import Impact
    from thud.level.assessment import Verdict
    from thud.level.estimate import Estimate
    from thud.recordings.force_units import Calibration
    from thud.recordings.measured_drop import Drop, Stages
    from thud.recordings.recorded_levels import AverageLevels

    Source = str | os.PathLike[str] | Signal


# Quantities besides the levels that are assessed.
ASSESSED = ("contact_time", "restitution", "peaks", "mass", "drop_height")


def read_recording(  # noqa: PLR0913 - what everybody states has a keyword
    paths: Source | Iterable[Source],
    *,
    height: float | None = None,
    mass: float | None = None,
    calibration: Calibration | float | str | Sequence[Calibration | float | str] | None = None,
    config: Config | str | os.PathLike[str] | None = None,
    progress: bool = False,
) -> Recording:
    """Measure recorded drops of one source, from files with one or more drops each.

    Parameters
    ----------
    paths
        Files (docs/recordings_reading.md states the formats), or signals.
    height
        Drop height, m.
    mass
        Mass of the source, kg. Mass and height give the restitution by the impulse.
    calibration
        N per unit of the file, a chain of factors such as ``"4.1 pC/N, 10 mV/pC"``, or one for each
        load cell.
    config
        What else the laboratory states, or its file; other arguments override it.
    progress
        Show progress bars.

    Returns
    -------
    Recording

    Raises
    ------
    InputError
        If a file cannot be read or a drop cannot be measured.
    """
    if not isinstance(config, Config):
        config = Config() if config is None else read_config(config)
    config = config.updated(height=height, mass=mass, calibration=calibration)
    items = [paths] if isinstance(paths, str | os.PathLike | Signal) else paths
    require_kind("paths", items, Iterable)
    begin, end = config.begin or 0.0, math.inf if config.end is None else config.end
    origins: list[Origin] = []
    measured: list[list[Drop]] = []
    uncertainties: list[float | None] = []
    stages: Stages | None = None
    count = 0
    # BLAS threads slow down the many small matrix products.
    with threadpool_limits(1, "blas"):
        for signal in chain.from_iterable(open_signals(item, config) for item in items):
            pulses, ignored = find_drops(signal, begin, end, progress=progress)
            chosen, left_out = _choose(pulses, count + 1, signal.sample_rate, config)
            count += len(pulses)
            stated = config.calibration_uncertainty
            uncertainties.append(signal.calibration_uncertainty if stated is None else stated)
            measured.append([])
            for pulse in tqdm(
                chosen, unit="drop", desc=signal.name, disable=not progress, leave=False
            ):
                shown = measure_stages(cut_section(signal, pulse), config, uncertainties[-1])
                stages = stages or shown
                measured[-1].append(shown.drop)
            notes = [*signal.notes]
            length = signal.n_sample / signal.sample_rate
            if begin > 0 or end < length:
                last = min(end, length)
                notes.append(Note("section_searched", signal.name, low=begin, high=last, unit="s"))
            notes += (replace(note, subject=signal.name) for note in (*ignored, *left_out))
            origins.append(Origin(
                signal.name, signal.path, signal.checksum, signal.date, signal.calibration,
                signal.sample_rate, tuple(notes), len(measured[-1]),
            ))  # fmt: skip
    if not origins:
        refuse("there are no recordings", "one file or more")
    drops = tuple(chain.from_iterable(measured))
    for key, text in (("leave_out", ",".join(config.leave_out)), ("drops", config.drops)):
        highest = max(numbers.stop - 1 for numbers in parse_numbers(text, key)) if text else 0
        if highest > count:
            refuse(f"{key}: there is no drop {highest}", f"numbers from 1 to {count}", subject=key)
    if not drops:
        refuse("every drop is left out", "at least one drop")
    if len(origins) > 1:
        copies.check(origins, measured)
    name = Path(origins[0].path or origins[0].name).stem
    uncertainty = None if None in uncertainties else max(value or 0.0 for value in uncertainties)
    return Recording(name, drops, tuple(origins), config, uncertainty, stages)


def _choose(
    drops: Sequence[Pulse], first: int, rate: float, config: Config
) -> tuple[list[Pulse], list[Note]]:
    """Return the drops to be measured, and notes on those that are left out.

    The drops of a signal of a sample rate, Hz, have the numbers from `first` on. Without chosen
    numbers all are measured but those that say why not.
    """
    chosen: list[Pulse] = []
    notes: list[Note] = []
    for number, drop in enumerate(drops, start=first):
        reason = next((why for key, why in config.leave_out.items() if _holds(key, number)), None)
        if reason is not None:
            note = Note("drop_left_out", others={"reason": reason})
        elif config.drops and not _holds(config.drops, number):
            note = Note("drop_not_chosen", others={"chosen": config.drops})
        elif drop.left_out and not config.drops:
            note = drop.left_out
        else:
            chosen.append(drop)
            continue
        others = {**note.others, "time": drop.contact[0] / rate}
        notes.append(replace(note, value=number, others=others))
    return chosen, notes


def _holds(text: str, number: int) -> bool:
    return any(number in numbers for numbers in parse_numbers(text, "drops"))


@dataclass(frozen=True)
class Origin:
    """Signal from which drops were measured: attributes of `Signal`, and the number of drops.

    Its notes are those of the signal, and on pulses that are not measured.
    """

    name: str
    path: str
    checksum: str
    date: str
    calibration: str
    sample_rate: float
    notes: tuple[Note, ...]
    drops: int


@dataclass(frozen=True, eq=False)
class Recording(ImpactOrRecording):
    """Recorded drops of one source.

    `time` and `force` are those of the first drop, also in comparisons and fits. Levels and other
    quantities are averages over all drops.

    Attributes
    ----------
    name : str
        Name of the recording and of its results.
    drops : tuple of Drop
        The drops in order.
    origins : tuple of Origin
        The files of the drops.
    config : Config
        What the laboratory states; mass, kg, and height, m, may be None.
    calibration_uncertainty : float or None
        Relative standard uncertainty of the force; None if unknown.
    stages : Stages or None
        First drop after each stage of its measurement; None if the drops were not read from files.
    """

    # Of every `ImpactResult`: a recording has only the force on the floor, and no floor or room.
    touch_time: ClassVar[float] = 0.0
    case: ClassVar[Case] = Case(model=None)
    on_floor: ClassVar[None] = None
    room_level: ClassVar[None] = None

    name: str
    drops: tuple[Drop, ...]
    origins: tuple[Origin, ...]
    config: Config = field(default_factory=Config)
    calibration_uncertainty: float | None = None
    stages: Stages | None = field(default=None, repr=False, compare=False)
    _averages: dict[BandSet, AverageLevels] = field(default_factory=dict, init=False, repr=False)

    def __repr__(self) -> str:
        """Return the main numbers of the recording, without its samples."""
        number = len(self.drops)
        return (
            f"<Recording {self.name}: {number} drop{'s' * (number != 1)}, "
            f"contact {1e3 * self.contact_time:.2f} ms, peak {self.peak():.0f} N>"
        )

    def rows(self) -> list[tuple[str, ...]]:
        """Return the criteria as rows of text with a header."""
        return self.assess().rows()

    @property
    def time(self) -> NDArray[np.float64]:
        """Time of the first drop since first touch, s, shape (n_sample,)."""
        return self.drops[0].time

    @property
    def sample_rate(self) -> float:
        """Samples per second of the first drop, Hz."""
        return self.drops[0].sample_rate

    def assessed_force(self, _: LevelsForce | None = None) -> LevelsForce:
        """Return the force that a force plate measures: ``"floor"``."""
        return "floor"

    @property
    def limits_source(self) -> LimitsSource | None:
        """Source whose limits apply, by the configuration; None if it is the default."""
        return None if self.config.source == Config.source else self.config.source

    @property
    def mass(self) -> float:
        """Stated or effective mass, kg; NaN if unknown."""
        return self.estimates["mass"].value

    @property
    def impact_velocity(self) -> float:
        """Velocity at first touch from the stated drop height, m/s; NaN if none is stated."""
        return math.sqrt(2 * GRAVITY * self.config.height) if self.config.height else math.nan

    @property
    def contact_time(self) -> float:
        """Mean contact time, s."""
        return self.estimates["contact_time"].value

    @property
    def restitution(self) -> float:
        """Mean coefficient of restitution; NaN if unknown."""
        return self.estimates["restitution"].value

    @property
    def peak_force(self) -> float:
        """Mean maximum force below 1.25 kHz, N."""
        return float(np.mean([drop.peak_force.value for drop in self.drops]))

    @property
    def notes(self) -> tuple[Note, ...]:
        """Possible faults and processing of the recording, its files and its drops."""
        of_files = (note for origin in self.origins for note in origin.notes)
        return (*self.own_notes, *of_files, *(note for drop in self.drops for note in drop.notes))

    @cached_property
    def own_notes(self) -> tuple[Note, ...]:
        """Possible faults of the recording as a whole, and its outliers."""
        config = self.config
        notes = [
            *check_estimates(self.drops, self.estimates, config),
            *(note for met, note in check_plate(config.plate).values() if met is False),
            *config.check_dates(origin.date for origin in self.origins),
            *check_instruments(self.drops, config, self.average().instruments),
        ]
        lacking = dict.fromkeys(name for names in self.not_stated.values() for name in names)
        if lacking:
            notes.append(Note("uncertainty_not_stated", others={"names": ", ".join(lacking)}))
        return (*notes, *self.outliers)

    @property
    def not_stated(self) -> dict[str, tuple[str, ...]]:
        """Contributions that are not stated, by the quantity that they leave undecided."""
        config, (plate, recorder) = self.config, self.config.corrected
        is_stated = {
            CALIBRATION: self.calibration_uncertainty is not None,
            "resonance of the plate": plate is None or bool(plate.f0_uncertainty),
            "cutoff of the filter": recorder is None or bool(recorder.cutoff_uncertainty),
            "mass": config.mass is None or config.mass_uncertainty is not None,
            "drop height": config.height is None or config.height_uncertainty is not None,
        }
        by_impulse = any(IMPULSE in drop.restitutions for drop in self.drops)
        affecting = {
            "levels": (CALIBRATION, "resonance of the plate", "cutoff of the filter"),
            "mass": ("mass",) if config.mass else (CALIBRATION, "drop height"),
            "restitution": (*((CALIBRATION, "mass") if by_impulse else ()), "drop height"),
            "drop_height": ("drop height",),
        }
        return {
            quantity: tuple(name for name in names if not is_stated[name])
            for quantity, names in affecting.items()
        }

    def quantity(self, name: str) -> float:
        """Return a quantity, SI units, by its name, such as ``"contact_time"``; NaN if none."""
        if name in ESTIMATES and not hasattr(self, name):
            return float(np.mean([getattr(drop, name).value for drop in self.drops]))
        return super().quantity(name)

    def force(self, _: LevelsForce | None = None) -> NDArray[np.float64]:
        """Return the corrected force of the first drop, N, shape (n_sample,)."""
        return self.drops[0].force

    def mean_force(self) -> NDArray[np.float64]:
        """Return the force whose one-third-octave levels are those of the recording, N, shape (n,).

        It is that of the first drop within its gate, scaled in each band.
        """
        return mean_force(self.drops[0], self.average("third").level)

    def peak(self, _: LevelsForce | None = None) -> float:
        """Return the mean maximum force, N."""
        return self.peak_force

    def average(self, bands: BandSet = "octave") -> AverageLevels:
        """Return the energy average of the levels, whose budget includes the instruments."""
        if bands not in self._averages:
            levels, stated = measure_levels(self.drops, bands), self.calibration_uncertainty
            instruments = instrument_uncertainties(self.drops, self.config, stated, bands)
            average = average_levels(levels, instruments, self.not_stated["levels"])
            self._averages[bands] = average
        return self._averages[bands]

    def levels(
        self,
        bands: BandSet = "octave",
        method: LevelsMethod | None = None,
        force: LevelsForce | None = None,  # noqa: ARG002 - as for impacts
    ) -> NDArray[np.float64]:
        """Return the force exposure levels, energy average of the drops, dB, shape (n_band,).

        Raise InputError if the method is not ``"exact"``, the only one for recordings.
        """
        require_choice("method", method or "exact", ["exact"])
        return self.average(bands).level.copy()

    @cached_property
    def estimates(self) -> dict[str, Estimate]:
        """Contact time, restitution, peak count, mass and drop height with their budgets."""
        return drop_estimates(
            self.drops, self.config, self.calibration_uncertainty, self.not_stated
        )

    @cached_property
    def outliers(self) -> tuple[Note, ...]:
        """Drops that differ from the others; they are not excluded."""
        return outliers.check(self.drops, self.average().drops)

    def level_estimates(self, bands: BandSet = "octave") -> tuple[Estimate, ...]:
        """Return the average levels with their uncertainty budgets, dB, shape (n_band,)."""
        return self.average(bands).estimates

    def assess(
        self,
        source: LimitsSource | None = None,
        force: LevelsForce | None = None,  # noqa: ARG002 - as for impacts
    ) -> Verdict:
        """Assess the recording by the limits of a source, by default that of the configuration."""
        return assess_levels(
            self.level_estimates(),
            source=source or self.config.source,
            limits=self.config.limits,
            **{name: self.estimates[name] for name in ASSESSED},
        )

    def plot(self, ax: Axes | None = None, kind: Literal["levels", "force"] = "levels") -> Figure:
        """Draw the levels of the drops over the tolerance band, or their forces."""
        from thud.plot.recording_figures import recording_forces, recording_levels

        require_choice("kind", kind, ("levels", "force"))
        return (recording_levels if kind == "levels" else recording_forces)(self, ax)

    def to_xarray(self) -> xr.Dataset:
        """Return the force of the first drop, the average levels and the means over the drops.

        Raise InputError if xarray is not installed.
        """
        from thud.impact.datasets import impact_dataset

        histories = {"floor_force_N": self.force()}
        return impact_dataset(self, histories, {"recording": self.name})

    def to_dataframe(self) -> pd.DataFrame:
        """Return the forces of all drops over time, N and s since first touch, with their numbers.

        Raise InputError if pandas is not installed.
        """
        numbers = [np.full(len(drop.force), k) for k, drop in enumerate(self.drops, start=1)]
        forces = np.concatenate([drop.force for drop in self.drops])
        times = np.concatenate([drop.time for drop in self.drops])
        return data_frame({"drop": np.concatenate(numbers), "floor_force_N": forces}, times)


# A drop of a model or of a recording: both have force, levels and verdict under the same names.
ImpactResult: TypeAlias = "Impact | Recording"
