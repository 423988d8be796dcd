"""How far the force of an impact is from a record, by frequency."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from scipy import stats
from scipy.signal import ZoomFFT

from thud.base.checks import refuse
from thud.base.immutable import freeze
from thud.base.note import Note
from thud.impact.impact import Impact
from thud.studies.fitting.inference import UNLIKELY, misfit_ratio, residual_warnings
from thud.studies.fitting.misfit import GAIN, SHIFT, Misfit
from thud.studies.fitting.record_noise import (
    MIN_BACKGROUND,
    BackgroundRecord,
    Weights,
    hum_harmonics,
    new_weights,
    wave_size,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from thud.recordings.background import Background
    from thud.studies.fitting.force_record import Record
    from thud.studies.fitting.force_target import ForceTarget

    Array = NDArray[np.float64]

# Relative tolerance of the highest frequency, because times are rounded.
ROUNDING = 1e-5
# Minimum number of independent values of contact and of background for a comparison, and minimum
# residual over peak force for a test: smaller ones are sampling errors.
MIN_FREEDOM = 5
NUMERICAL = 1e-4
# Standard errors above which hum is reported; noise exceeds them with the probability UNLIKELY.
NOTABLE = float(np.sqrt(-2 * np.log(UNLIKELY)))
# Relative errors of clock and calibration whose effect a fit states.
CLOCK, CALIBRATION = 1e-3, 1e-2
# Scale of a shift in time, s.
SHIFT_SCALE = 1e-3


class ForceMisfit(Misfit):
    """How far the force of an impact is from a record, by frequency."""

    deviation_unit = "N"
    has_unknowns = True
    deviation_source = "noise, or 50 independent values of background,"

    def __init__(self, target: ForceTarget, record: Record, pulse: tuple[int, int]) -> None:
        self.time, self.force, self.sample_rate = record
        self.target, self.below = target, target.below
        source = target.record
        self.exact = isinstance(source, Impact)
        self.kind = target.force or (
            source.assessed_force() if isinstance(source, Impact) else "floor"
        )
        self.period = len(self.time) / self.sample_rate
        count = int(self.below * self.period * (1 + ROUNDING)) + 1
        self.frequency = freeze(np.arange(count) / self.period)
        self.count = 2 * len(self.frequency) - 1
        self.spectrum = freeze(np.fft.rfft(self.force, norm="ortho")[:count])
        self.background_record = BackgroundRecord(self.force, self.sample_rate, pulse, self.below)
        shown = (
            self.background_record.known
            and self.background_record.deviation() > NUMERICAL * self.force.max()
        )
        self.offset = self.background_record.known if target.offset is None else target.offset
        self.known_noise = shown or target.noise is not None
        self.noise_freedom = (
            self.background_record.freedom if shown and target.noise is None else None
        )
        self._known = shown
        self.own = {}
        if not self.exact if target.time_shift is None else target.time_shift:
            self.own[SHIFT] = "s", SHIFT_SCALE
        if target.gain is not None:
            self.own[GAIN] = "", 1.0
        # A known uncertainty of the gain adds one residual.
        self.prior = target.gain if target.gain is not None and target.gain < np.inf else None
        if self.prior is not None and not self.known_noise:
            refuse(
                f"target: gain = {self.prior:g} is not allowed without a known noise",
                f"noise, {MIN_BACKGROUND / 2 / self.below:.3g} s of background, or inf",
            )
        self.size = self.count + (self.prior is not None)
        self._transforms: dict[tuple[int, float], ZoomFFT] = {}

    @cached_property
    def tones(self) -> tuple[float, ...]:
        """Frequencies of hum that are nuisance parameters, Hz."""
        if self.target.hum is not None:
            return hum_harmonics(self.target.hum, self.below)
        return self.background_record.tones() if self._known else ()

    @cached_property
    def background(self) -> Background | None:
        """The noise of the background; None where it is too short."""
        return self.background_record.background(self.tones) if self._known else None

    @cached_property
    def weights(self) -> Weights:
        """The weights of the residuals."""
        return new_weights(
            self.background_record,
            self.count,
            background=self.background,
            noise=self.target.noise,
            offset=self.offset,
            tones=self.tones,
            mains=self.target.hum is None,
        )

    @property
    def band_fraction(self) -> float:
        """Fraction of the deviation of white noise that lies in the compared band."""
        return float(np.sqrt(self.count / len(self.time)))

    @property
    def absorbed(self) -> int:
        """Number of nuisance parameters that were projected out of the residuals."""
        return self.offset + 2 * len(self.tones)

    @cached_property
    def unit_deviation(self) -> float:
        """Deviation of white noise of the same power below `below`, N; 1 if it is not known."""
        return self.target.noise or (self.weights.deviation() if self.known_noise else 1.0)

    def model_spectrum(self, impact: Impact, own: Array) -> NDArray[np.complex128]:
        """Return the Fourier transform of the force of an impact on the time axis of the record."""
        count = len(self.frequency)
        shape = len(impact.time), impact.sample_rate
        if shape not in self._transforms:
            band = [0.0, count / self.period]
            self._transforms[shape] = ZoomFFT(shape[0], band, count, fs=shape[1])
        turned = self._transforms[shape](impact.force(self.kind)).astype(np.complex128)
        turned *= self.sample_rate / impact.sample_rate / np.sqrt(len(self.time))
        shift = self.value(SHIFT, own)
        phase = np.exp(-2j * np.pi * self.frequency * (shift - self.time[0]))
        result: NDArray[np.complex128] = self.value(GAIN, own) * turned * phase
        return result

    def value(self, name: str, own: Array) -> float:
        """Return one of its own parameters, or its fixed value if it is not fitted."""
        if name not in self.own:
            return {SHIFT: 0.0, GAIN: 1.0}[name]
        return float(own[list(self.own).index(name)])

    def residual(self, impact: Impact, own: Array) -> Array:
        """Return model minus target over standard deviation, shape (size,)."""
        difference = self._grid(self.model_spectrum(impact, own) - self.spectrum)
        return self._with_prior(self.weights.matrix @ difference, (self.value(GAIN, own) - 1))

    def own_derivatives(self, impact: Impact, own: Array) -> Array:
        """Return the derivatives of the residual by its own parameters, shape (size, n_own)."""
        model = self.model_spectrum(impact, own)
        slopes = {
            SHIFT: (-2j * np.pi * self.frequency * model, 0.0),
            GAIN: (model / self.value(GAIN, own), 1.0),
        }
        columns = [
            self._with_prior(self.weights.matrix @ self._grid(slopes[name][0]), slopes[name][1])
            for name in self.own
        ]
        return np.column_stack(columns) if columns else np.empty((self.size, 0))

    def _with_prior(self, weighted: Array, gain: float) -> Array:
        return weighted if self.prior is None else np.append(weighted, gain / self.prior)

    def own_start(self, impact: Impact) -> Array:
        """Return the time shift of maximum correlation, s, and a gain of 1."""
        start = {SHIFT: self.time[0], GAIN: 1.0}
        own = np.array([start[name] for name in self.own])
        if SHIFT not in self.own:
            return own
        product = self.spectrum * self.model_spectrum(impact, own).conj()
        count = 16 * len(product)
        lag = np.argmax(np.fft.irfft(product, count)) / count
        # A pulse that begins shortly before the record does not begin at its end.
        own[0] += (lag - (lag > 3 / 4)) * self.period
        return own

    def target_vector(self) -> Array:
        """Return the target over standard deviation, shape (size,)."""
        return self._with_prior(self.weights.matrix @ self._grid(self.spectrum), 1.0)

    def data(self) -> Array:
        """Return the record, N."""
        return self.force

    def columns(self, impact: Impact, own: Array) -> dict[str, Array]:
        """Return target and model side by side, s and N: columns by their names."""
        model = self.model_spectrum(impact, own)
        under = self.weights.background(self._grid(self.spectrum - model))
        background = self.history(np.fft.rfft(under, norm="ortho"))
        target, force = self.history(self.spectrum), self.history(model)
        return {
            "time_s": self.time,
            "record_N": self.force,
            "target_N": target,
            "background_N": background,
            "model_N": force,
            "residual_N": force + background - target,
        }

    def nuisances(self, impact: Impact, own: Array) -> dict[str, tuple[float, float]]:
        """Return offset and amplitude of hum, if fitted, with their standard errors, N."""
        value, covariance = self.weights.estimates(
            self._grid(self.spectrum - self.model_spectrum(impact, own))
        )
        result = {}
        if self.offset:
            result["offset"] = float(value[0]), float(np.sqrt(covariance[0, 0]))
        for i, tone in enumerate(self.tones, start=int(self.offset)):
            pair = np.array([i, i + len(self.tones)])
            result[f"hum of {tone:.4g} Hz"] = wave_size(value[pair], covariance[np.ix_(pair, pair)])
        if self.background is not None and self.target.hum is None:
            mains, size, error = self.background_record.mains(self.background, self.tones)
            if size > NOTABLE * error:
                result[f"hum of {mains:g} Hz"] = size, error
        return result

    def warnings(self, impact: Impact, own: Array, deviation: float, count: int) -> list[Note]:
        """Return warnings where residuals are not noise of a deviation, after `count` parameters.

        Weighted noise is stationary and independent; errors of the model occur during contact only.
        """
        if self.is_exact(impact, own):
            return []
        difference = self._grid(self.spectrum - self.model_spectrum(impact, own))
        weighted = self.weights.matrix @ difference / deviation
        time, inside = self._grid_time, self._inside(impact, own)
        begin, end = self._contact(impact, own)
        unit = deviation * self.unit_deviation
        result = _contact_warning(weighted, inside, count, unit)
        if not result:
            result = residual_warnings(weighted, time)
            result += _change_warning(weighted, time < begin, time > end)
        if not (self.background_record.known or self.target.offset is not None or self.exact):
            lasts = 1e3 * self.background_record.seconds
            result.append(Note("background_too_short", value=lasts, unit="ms"))
        return result

    def effect(self, impact: Impact, other: Impact, own: Array) -> Array:
        """Return the change of the residual by another impact; on a mobile floor by its force."""
        return super().effect(impact, other.on_floor or other, own)

    def assumed(self, impact: Impact, own: Array) -> dict[str, Array]:
        """Return the changes of the residual by errors of clock and calibration."""
        slow = 1 + CLOCK
        stretched = replace(impact, time=impact.time * slow, sample_rate=impact.sample_rate / slow)
        result = {f"clock {100 * CLOCK:g} % fast": self.effect(impact, stretched, own)}
        if GAIN not in self.own:
            model = self._grid(self.model_spectrum(impact, own))
            change = self._with_prior(self.weights.matrix @ (CALIBRATION * model), 0.0)
            result[f"calibration {100 * CALIBRATION:g} % high"] = change
        return result

    def is_exact(self, impact: Impact, own: Array) -> bool:
        """Return whether residuals are too small to be tested: numerical errors."""
        difference = self._grid(self.spectrum - self.model_spectrum(impact, own))
        unexplained = difference - self.weights.background(difference)
        return bool(np.sqrt(np.mean(unexplained**2)) < NUMERICAL * self.force.max())

    def excess(self, impact: Impact, own: Array, residual: Array) -> float:
        """Return by how much residuals exceed noise, of the whole record or during contact."""
        inside = residual[: self.count][self._inside(impact, own)]
        return max(misfit_ratio(part) for part in (residual, inside) if len(part) > MIN_FREEDOM)

    @cached_property
    def _grid_time(self) -> Array:
        """Times of the residuals, s."""
        result: Array = self.time[0] + np.arange(self.count) * self.period / self.count
        return result

    def _inside(self, impact: Impact, own: Array) -> NDArray[np.bool_]:
        """Return which residuals lie in the contact."""
        begin, end = self._contact(impact, own)
        return (self._grid_time >= begin) & (self._grid_time <= end)

    def _contact(self, impact: Impact, own: Array) -> tuple[float, float]:
        """Return begin and end of the contact, s."""
        begin = self.value(SHIFT, own)
        return begin, begin + impact.contact_time

    def history(self, spectrum: NDArray[np.complex128]) -> Array:
        """Return the history of a transform, N, shape (n_sample,)."""
        result: Array = np.fft.irfft(spectrum, len(self.time), norm="ortho")
        return result

    def _grid(self, spectrum: NDArray[np.complex128]) -> Array:
        """Return the history of a transform on the grid."""
        result: Array = np.fft.irfft(spectrum, self.count, norm="ortho")
        return result


def _contact_warning(
    weighted: Array, inside: NDArray[np.bool_], count: int, unit: float
) -> list[Note]:
    """Return a warning if residuals during contact exceed those before and after it."""
    inside_count, outside_count = int(inside.sum()) - count, int((~inside).sum())
    if min(inside_count, outside_count) < MIN_FREEDOM:
        return []
    square = float((weighted[inside] ** 2).sum()) / inside_count
    outside = float((weighted[~inside] ** 2).sum()) / outside_count
    if square < stats.f.isf(UNLIKELY, inside_count, outside_count) * outside:
        return []
    value, high = (unit * math.sqrt(part) for part in (square, outside))
    return [Note("residuals_in_contact", value=value, high=high, unit="N")]


def _change_warning(
    weighted: Array, before: NDArray[np.bool_], after: NDArray[np.bool_]
) -> list[Note]:
    """Return a warning if residuals before contact differ from those after it."""
    counts = int(before.sum()), int(after.sum())
    if min(counts) < MIN_FREEDOM:
        return []
    ratio = float(np.mean(weighted[after] ** 2) / np.mean(weighted[before] ** 2))
    tail = min(stats.f.sf(ratio, *counts[::-1]), stats.f.cdf(ratio, *counts[::-1]))
    if 2 * tail > UNLIKELY:
        return []
    return [Note("residuals_change", value=math.sqrt(ratio))]
