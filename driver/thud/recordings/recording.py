"""A recording: measured drops of one source, and their assessment."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, ClassVar, Literal, TypeAlias

import numpy as np

from thud.base.checks import require_choice
from thud.base.extras import data_frame
from thud.base.note import Note
from thud.case.case import Case
from thud.level.assessment import ImpactOrRecording, assess_levels
from thud.recordings.checks import outliers
from thud.recordings.checks.plate import check_plate
from thud.recordings.config import Config
from thud.recordings.instruments import CALIBRATION, check_instruments, instrument_uncertainties
from thud.recordings.measured_drop import ESTIMATES
from thud.recordings.quantities import GRAVITY, IMPULSE, check_estimates, drop_estimates
from thud.recordings.recorded_levels import average_levels, mean_force, measure_levels

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from thud.base._schema import BandSet, LevelsForce, LevelsMethod, LimitsSource
    from thud.impact.impact import Impact
    from thud.level.assessment import Verdict
    from thud.level.estimate import Estimate
    from thud.recordings.measured_drop import Drop
    from thud.recordings.read_recording import Stages
    from thud.recordings.recorded_levels import AverageLevels


# Quantities besides the levels that are assessed.
ASSESSED = ("contact_time", "restitution", "peaks", "mass", "drop_height")


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
        config, plate, recorder = self.config, self.config.resonance, self.config.recorder_filter
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
