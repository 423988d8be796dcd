"""A measured force, for comparison with models."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from thud.columns import read_table
from thud.display import MAKERS, Displayed
from thud.errors import InputError
from thud.levels import force_exposure_levels, judge, peak_count

if TYPE_CHECKING:
    import os

    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from thud._schema import BandSet, LevelsForce, LevelsMethod, LimitsSource
    from thud.criteria import Conformity

# Fraction of the maximum force below which a recording counts as noise.
NOISE = 0.01
# Minimum number of samples.
MIN_ROWS = 8
# Minimum and maximum sampling interval, s.
STEPS = (1e-9, 1e3)
# Fractions of the sampling interval by which any times, and rounded times, may miss an even grid.
JITTER = 1e-3
ROUNDED = 0.25
# Significant decimal digits of a float.
DIGITS = 17


@dataclass(frozen=True, eq=False)
class Recording(Displayed):
    """Recorded force of one impact.

    Attributes
    ----------
    time : ndarray, shape (n_sample,)
        Time since the force first exceeds 1 % of its maximum, s.
    record : ndarray, shape (n_sample,)
        Force, N.
    sample_rate : float
        Samples per second, Hz.
    origin : float
        Time in the file at which the force first exceeds 1 % of its maximum, s.
    """

    time: NDArray[np.float64]
    record: NDArray[np.float64]
    sample_rate: float
    origin: float = 0.0

    @classmethod
    def from_csv(cls, path: str | os.PathLike[str]) -> Recording:
        """Read a file of two columns, time in s and force in N; see `thud.columns.read_table`.

        Raises
        ------
        InputError
            Where the file is missing or has fewer than eight samples, times that are not evenly
            spaced, or a force that is not mainly positive.
        """
        return cls.from_arrays(read_table(path), str(path))

    @classmethod
    def from_arrays(cls, table: NDArray[np.float64], name: str = "recording") -> Recording:
        """Return the recording of a table with the columns time, s, and force, N."""
        rows, columns = table.shape
        if rows < MIN_ROWS or columns != len(("time", "force")):
            message = (
                f"{name}: {rows} rows of {columns} numbers; allowed: {MIN_ROWS} rows or more "
                "of time, s, and force, N"
            )
            raise InputError(message)
        if not np.isfinite(table).all():
            message = f"{name}: a value is not finite; allowed: real numbers"
            raise InputError(message)
        time, force = table.T
        begin, step = _even_grid(time, name)
        if force.max() <= 0 and not force.min() < 0:
            message = f"{name}: the force is nowhere positive; allowed: the force on the floor, N"
            raise InputError(message)
        if -force.min() > force.max():
            message = (
                f"{name}: the force is mostly negative, {force.min():.4g} to {force.max():.4g} N; "
                "allowed: the force on the floor, positive in compression (change its sign)"
            )
            raise InputError(message)
        first = np.flatnonzero(force > NOISE * force.max())[0]
        time = (np.arange(rows) - first) * step
        return cls(time, force.copy(), 1 / step, begin + first * step)

    def __repr__(self) -> str:
        """Return the main numbers of the recording, without its arrays."""
        return (
            f"<Recording, {len(self.time)} samples at {self.sample_rate:g} Hz: "
            f"contact {1e3 * self.contact_time:.2f} ms, peak {self.peak_force:.0f} N>"
        )

    def rows(self) -> list[tuple[str, ...]]:
        """Return header and rows of text."""
        return self.conformity().rows()

    @property
    def touch_time(self) -> float:
        """Time of first touch, s: 0."""
        return 0.0

    @property
    def contact_time(self) -> float:
        """Time during which the force exceeds 1 % of its maximum, s."""
        above = np.flatnonzero(self.record > NOISE * self.record.max())
        return float((above[-1] - above[0] + 1) / self.sample_rate)

    @property
    def peak_force(self) -> float:
        """Maximum force, N."""
        return float(self.record.max())

    @property
    def restitution(self) -> float:
        """Not known from one impact: NaN."""
        return float("nan")

    def judged(self, force: LevelsForce | None = None) -> LevelsForce:  # noqa: ARG002 - there is one
        """Return the force that a force plate measures: ``"floor"``."""
        return "floor"

    @property
    def level_method(self) -> LevelsMethod:
        """Method of the levels: ``"exact"``."""
        return "exact"

    def force(self, kind: LevelsForce | None = None) -> NDArray[np.float64]:  # noqa: ARG002 - there is one
        """Return the force, N, shape (n_sample,), for any `kind`."""
        return self.record

    def peak(self, force: LevelsForce | None = None) -> float:  # noqa: ARG002 - there is one
        """Return the maximum force, N."""
        return self.peak_force

    def levels(
        self,
        bands: BandSet = "octave",
        method: LevelsMethod | None = None,
        force: LevelsForce | None = None,
    ) -> NDArray[np.float64]:
        """Return the force exposure levels, dB, shape (n_band,); see `Impact.levels`."""
        return force_exposure_levels(
            self.force(force), self.sample_rate, bands, method or self.level_method
        )

    def conformity(
        self, source: LimitsSource = "rubber_ball", force: LevelsForce | None = None
    ) -> Conformity:
        """Return the verdict of the standards; see `Impact.conformity`.

        Restitution, mass and drop height are not known from one record: NaN.
        """
        return judge(
            self.levels(force=force),
            self.contact_time,
            self.restitution,
            peak_count(self.record, self.sample_rate),
            math.nan,
            math.nan,
            source,
        )

    def plot(self, source: LimitsSource = "rubber_ball") -> Figure:
        """Return a figure of the force, and of its octave levels over the limits of a source."""
        figure: Figure = MAKERS["figure"](self, source)
        return figure


def _even_grid(time: NDArray[np.float64], name: str) -> tuple[float, float]:
    """Return start and step, s, of the even grid that fits times best.

    Times may miss it by their rounding to the last written digit: at 44.1 kHz, the sixth decimal
    is a twentieth of a step.
    """
    place = np.arange(len(time)) - (len(time) - 1) / 2
    with np.errstate(over="ignore", invalid="ignore"):
        step = float(place @ time / (place @ place))
    minimum, maximum = STEPS
    if not minimum <= step <= maximum:
        message = (
            f"{name}: the times rise by {step:.4g} s from row to row; "
            f"allowed: {minimum:g} to {maximum:g} s"
        )
        raise InputError(message)
    miss = np.abs(time - time.mean() - place * step) / step
    allowed = max(JITTER, min(ROUNDED, _last_digit(time) / step))
    worst = int(np.argmax(miss))
    if miss[worst] > allowed:
        message = (
            f"{name}: the times are not evenly spaced: row {worst + 1}, {time[worst]:.9g} s, is "
            f"{miss[worst]:.2g} steps of {step:.4g} s off an even grid; allowed: one sampling "
            f"rate, to {allowed:.2g} steps"
        )
        raise InputError(message)
    return float(time.mean() + place[0] * step), step


def _last_digit(time: NDArray[np.float64]) -> float:
    """Return the unit of the last digit of times, s, by decimals or by significant digits."""
    size = np.abs(time)
    # Rounding error of numbers of this size.
    rounding = 4 * np.spacing(size.max())
    scale = 10.0 ** np.floor(np.log10(np.maximum(size, rounding)))
    worth = 0.0
    for unit in (np.full_like(scale, scale.max()), scale):
        for power in range(DIGITS):
            digit = unit * 10.0**-power
            if (np.abs(time - digit * np.rint(time / digit)) <= rounding).all():
                worth = max(worth, float(digit.max()))
                break
    return worth
