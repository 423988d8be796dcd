"""A force history as the target of a fit."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import stats
from scipy.signal import ZoomFFT

from thud.checks import refuse, refuse_value, require_choice, require_whole
from thud.impact import FORCES, Impact
from thud.levels import RECORDED_BAND
from thud.record import MIN_ROWS, Record, read_record
from thud.recordings.recording import Recording
from thud.studies.fitting.misfit import Misfit, require_positive

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from thud._schema import LevelsForce
    from thud.recordings.estimates import Drop

# Part of that frequency that rounded times leave open.
SAME = 1e-5
# A record must hold the whole pulse: mean of its last millisecond over its peak.
OPEN_END = 0.1
END = 1e-3
# A warning needs this many independent values during contact and otherwise, this probability of
# Fisher's F, and a residual above this part of the peak force, which exceeds sampling errors.
MIN_FREEDOM = 5
SURE = 0.999
NUMERICAL = 1e-4
# Quiet with fewer independent values in the band does not tell the noise.
MIN_QUIET = 50


@dataclass(frozen=True, eq=False)
class ForceTarget:
    """A force history to be fitted.

    Model and record are compared in the frequencies up to `below`: their discrete Fourier
    transforms over the time of the record. White noise of the record is white there too, so that
    the residuals are independent and a shift in time is a phase; what lies above is noise, or
    numerical ripple.

    Attributes
    ----------
    record : Recording, Impact or pair of array_like
        The force; of arrays: time, s, and force, N, both of shape (n_sample,).
    noise : float or None
        Standard deviation of the noise of one sample, N; None: that of the quiet around a measured
        drop, in the compared band, and otherwise it is estimated from the residual.
    force : str or None
        ``"floor"`` (what a force plate measures) or ``"elastic"``: the force of the model, and
        of an impact as target.
    time_shift : bool or None
        The time of first touch is fitted too; None: unless the target is an impact.
    below : float
        Highest frequency that is compared, Hz.
    window : tuple of float or None
        Begin and end, s, of the part of the record that counts; None: all of it. The time of a
        measured drop is 0 at first touch.
    drop : int
        Number of the drop of a recording that has several, from 1.
    """

    record: Recording | Impact | tuple[ArrayLike, ArrayLike]
    noise: float | None = None
    force: LevelsForce | None = None
    time_shift: bool | None = None
    below: float = RECORDED_BAND
    window: tuple[float, float] | None = None
    drop: int = 1

    def misfit(self) -> ForceMisfit:
        """Return what the fit needs of the target."""
        if self.force is not None:
            require_choice("target: force", self.force, FORCES)
        kind = self.force or (self.record.judged() if isinstance(self.record, Impact) else "floor")
        if self.noise is not None:
            require_positive("noise", self.noise, "N")
        require_positive("below", self.below, "Hz")
        count = len(self.record.drops) if isinstance(self.record, Recording) else 1
        require_whole("target: drop", self.drop, 1, count)
        time, force, rate = self._samples()
        if self.window is not None:
            time, force = _cut(time, force, self.window)
        shift = not isinstance(self.record, Impact) if self.time_shift is None else self.time_shift
        if not 2 / len(time) * rate <= self.below < rate / 2:
            refuse(
                f"target: below = {self.below} is not allowed",
                f"{2 / len(time) * rate:g} <= below < {rate / 2:g} Hz",
            )
        last = force[time > time[-1] - END].mean()
        if last > OPEN_END * force.max():
            refuse(
                f"target: the force ends with {last / force.max():.0%} of its peak",
                "a record of a whole impact",
            )
        noise = self.noise
        if noise is None and isinstance(self.record, Recording):
            noise = _quiet_noise(self.record.drops[self.drop - 1], self.below)
        return ForceMisfit(time, force, rate, noise, kind, self.below, free_shift=shift)

    def _samples(self) -> Record:
        given = self.record
        if isinstance(given, Recording):
            drop = given.drops[self.drop - 1]
            return Record(drop.time, drop.force, drop.sample_rate)
        if isinstance(given, Impact):
            return Record(given.time, given.force(self.force), given.sample_rate)
        try:
            table = np.column_stack([np.asarray(column, dtype=np.float64) for column in given])
        except (TypeError, ValueError) as error:
            refuse(
                "target cannot be used",
                "a ForceTarget, LevelTarget, Recording or Impact, or two arrays of one length: "
                "time, s, and force, N",
                error,
            )
        return read_record(table, "target")


def _quiet_noise(drop: Drop, below: float) -> float | None:
    """Return the deviation of white noise that has the density of the quiet below a frequency, N.

    The deviation of the samples would count what is above that frequency. None where there is too
    little quiet.
    """
    first, stop = drop.gate
    power, count = 0.0, 0
    for quiet in (drop.force[:first], drop.force[stop:]):
        number = 1 + int(below * len(quiet) / drop.sample_rate)
        if len(quiet) > 1:
            spectrum = np.fft.rfft(quiet, norm="ortho")[:number]
            power += float((_parts(spectrum) ** 2).sum())
            count += 2 * len(spectrum) - 1
    return float(np.sqrt(power / count)) if count >= MIN_QUIET and power > 0 else None


def _cut(
    time: NDArray[np.float64], force: NDArray[np.float64], window: tuple[float, float]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    try:
        begin, end = map(float, window)
    except (TypeError, ValueError, OverflowError):
        begin = end = np.nan
    inside = (time >= begin) & (time <= end)
    if np.count_nonzero(inside) < MIN_ROWS or not force[inside].max() > 0:
        refuse_value(
            "target: window",
            window,
            f"begin and end, s, of an impact between {time[0]:g} and {time[-1]:g}",
        )
    return time[inside], force[inside]


class ForceMisfit(Misfit):
    """How far the force of an impact is from a record, by frequency."""

    deviation_unit = "N"

    def __init__(  # noqa: PLR0913, PLR0917 - what `ForceTarget.misfit` has checked
        self,
        time: NDArray[np.float64],
        force: NDArray[np.float64],
        sample_rate: float,
        noise: float | None,
        kind: LevelsForce,
        below: float,
        *,
        free_shift: bool,
    ) -> None:
        self.time, self.force, self.sample_rate = time, force, sample_rate
        self.kind, self.known_noise, self.free_shift = kind, noise is not None, free_shift
        self.unit_deviation = noise or 1.0
        self.below = below
        self.period = len(time) / sample_rate
        self.frequency = np.arange(int(below * self.period * (1 + SAME)) + 1) / self.period
        # Orthonormal: white noise of a deviation in time is white noise of that deviation here.
        self.spectrum = np.fft.rfft(force, norm="ortho")[: len(self.frequency)]
        self.size = 2 * len(self.frequency) - 1
        self._transforms: dict[tuple[int, float], ZoomFFT] = {}

    def model_spectrum(self, impact: Impact, shift: float) -> NDArray[np.complex128]:
        """Return the transform of the force of an impact that begins at a time, s."""
        count = len(self.frequency)
        shape = len(impact.time), impact.sample_rate
        if shape not in self._transforms:
            band = [0.0, count / self.period]
            self._transforms[shape] = ZoomFFT(shape[0], band, count, fs=shape[1])
        turned = self._transforms[shape](impact.force(self.kind)).astype(np.complex128)
        turned *= self.sample_rate / impact.sample_rate / np.sqrt(len(self.time))
        phase = np.exp(-2j * np.pi * self.frequency * (shift - self.time[0]))
        result: NDArray[np.complex128] = turned * phase
        return result

    def residual(self, impact: Impact, shift: float) -> NDArray[np.float64]:
        """Return model minus target over standard deviation, shape (size,)."""
        return _parts(self.model_spectrum(impact, shift) - self.spectrum) / self.unit_deviation

    def shift_derivative(self, impact: Impact, shift: float) -> NDArray[np.float64]:
        """Return the derivative of the residual with the time of first touch, 1/s."""
        turned = -2j * np.pi * self.frequency * self.model_spectrum(impact, shift)
        return _parts(turned) / self.unit_deviation

    def first_shift(self, impact: Impact) -> float:
        """Return the time of first touch at which impact and record correlate most, s."""
        product = self.spectrum * self.model_spectrum(impact, self.time[0]).conj()
        count = 16 * len(product)
        lag = np.argmax(np.fft.irfft(product, count)) / count
        # A pulse that begins shortly before the record does not begin at its end.
        return float(self.time[0] + (lag - (lag > 3 / 4)) * self.period)

    def target_vector(self) -> NDArray[np.float64]:
        """Return the target over standard deviation, shape (size,)."""
        return _parts(self.spectrum) / self.unit_deviation

    def history_columns(self, impact: Impact, shift: float) -> dict[str, NDArray[np.float64]]:
        """Return target and model side by side, s and N: columns by their names."""
        target = self.history(self.spectrum)
        model = self.history(self.model_spectrum(impact, shift))
        return {
            "time_s": self.time,
            "record_N": self.force,
            "target_N": target,
            "model_N": model,
            "residual_N": model - target,
        }

    def columns(self, impact: Impact, shift: float) -> dict[str, list[object]]:
        """Return target and model side by side, s and N: columns by their names."""
        columns = self.history_columns(impact, shift)
        return {name: column.tolist() for name, column in columns.items()}

    def doubt(self, impact: Impact, shift: float, count: int) -> str:
        """Return how the residual differs during contact from before and after, where it does.

        Noise is the same throughout; what the model cannot follow is there during contact only.
        """
        residual = self.history(self.model_spectrum(impact, shift) - self.spectrum)
        inside = (self.time >= shift) & (self.time <= shift + impact.contact_time)
        rate = 2 * self.frequency[-1] / self.sample_rate
        during, else_ = rate * inside.sum() - count, rate * (~inside).sum()
        if min(during, else_) < MIN_FREEDOM:
            return ""
        square = (residual[inside] ** 2).sum() / during
        other = (residual[~inside] ** 2).sum() / else_
        numerical = (NUMERICAL * self.force.max()) ** 2
        if square < max(stats.f.ppf(SURE, during, else_) * other, numerical):
            return ""
        return (
            f"the residual is {np.sqrt(square):.3g} N during the contact and {np.sqrt(other):.3g} "
            "N otherwise: the model does not follow the force to within the noise, and the "
            "intervals are too narrow"
        )

    def history(self, spectrum: NDArray[np.complex128]) -> NDArray[np.float64]:
        """Return the history of a transform, N, shape (n_sample,)."""
        whole: NDArray[np.float64] = np.fft.irfft(spectrum, len(self.time), norm="ortho")
        return whole


def _parts(spectrum: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Return a transform as independent real numbers with the sum of squares of its history."""
    rest = np.sqrt(2) * spectrum[1:]
    return np.concatenate([spectrum[:1].real, rest.real, rest.imag])
