"""A force history as the target of a fit, compared by frequency."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from scipy.signal import zoom_fft

from thud.base.checks import refuse, refuse_value, require_choice, require_whole
from thud.base.immutable import Immutable
from thud.base.note import Note
from thud.impact.impact import Impact
from thud.level.levels import FORCES, RECORDED_BAND
from thud.recordings.formats import MIN_SAMPLES
from thud.recordings.recording import Recording
from thud.studies.fitting.comparison import Comparison, require_positive
from thud.studies.fitting.force_record import Record, read_record
from thud.studies.fitting.record_noise import (
    MIN_BACKGROUND,
    Weights,
    find_pulse,
    find_quiet,
    new_weights,
    trimmed,
    wave_size,
)
from thud.studies.fitting.residual_tests import (
    MIN_FREEDOM,
    change_warning,
    color_warning,
    contact_warning,
    misfit_ratio,
)

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import ArrayLike, NDArray

    from thud.base._schema import LevelsForce
    from thud.recordings.background import Background
    from thud.studies.arrays import Array


# A record must hold the whole pulse: maximum mean of its last millisecond over its peak.
OPEN_END = 0.1
END = 1e-3
# Maximum number of compared values: the memory of their covariance grows with its square, to 2 GB.
MAX_COMPARED = 8000
# Relative tolerance of the highest frequency, because times are rounded.
ROUNDING = 1e-5
# Parameters of a record alone, with their units and scales, and their values if they are known.
SHIFT, GAIN = "time_shift", "gain"
SCALES = {SHIFT: ("s", 1e-3), GAIN: ("", 1.0)}
DEFAULTS = {SHIFT: 0.0, GAIN: 1.0}
# Minimum residual over peak force for a test: smaller ones are sampling errors.
NUMERICAL = 1e-4


@dataclass(frozen=True, eq=False)
class ForceTarget(Immutable):
    """A force history to be fitted.

    Model and record are compared at the frequencies up to `below`, by their discrete Fourier
    transforms over the time of the record, in which a shift in time is a phase. Above it there is
    noise, or numerical ripple. The residuals are weighted by the covariance of the noise (white,
    pink, brown, and hum of 50 and 60 Hz), estimated from the background before and after the pulse
    (generalized least squares); offset and tones are nuisance parameters. Only 0.1 s of background
    on each side counts.

    Attributes
    ----------
    record : Recording, Impact or pair of array_like
        The force; of arrays: time, s, and force, N, both of shape (n_sample,).
    noise : float or None
        Standard deviation of white noise of one sample, N; None: the noise is that of the
        background, or white and estimated from the residual if the background has less than 50
        independent values.
    force : str or None
        ``"floor"`` (what a force plate measures) or ``"elastic"``: the force of the model, and
        of an impact as target.
    time_shift : bool or None
        The time of first touch is fitted too; None: unless the target is an impact.
    below : float
        Highest frequency that is compared, Hz.
    window : tuple of float or None
        Begin and end, s, of the compared part of the record; None: the pulse with 0.1 s on each
        side. The time of a measured drop is 0 at first touch.
    drop : int
        Number of the drop of a recording that has several, from 1.
    offset : bool or None
        An offset is a nuisance parameter; None: where there is enough background.
    gain : float or None
        Relative standard uncertainty of the calibration: a factor of the record is fitted, which is
        1 within this uncertainty; infinite: any factor; None: the factor is 1.
    fixed : mapping of str to object
        Keys of ball, drop and model that are different for this record, such as the drop height.
    """

    record: Recording | Impact | tuple[ArrayLike, ArrayLike]
    noise: float | None = None
    force: LevelsForce | None = None
    time_shift: bool | None = None
    below: float = RECORDED_BAND
    window: tuple[float, float] | None = None
    drop: int = 1
    offset: bool | None = None
    gain: float | None = None
    fixed: Mapping[str, object] = field(default_factory=dict)

    def compare(self) -> ForceComparison:
        """Return the comparison of an impact with the record."""
        self._require_options()
        time, force, rate = self._samples()
        if self.window is not None:
            time, force = _cut(time, force, self.window)
        elif not isinstance(self.record, Impact | Recording):
            part = trimmed(force, rate)
            time, force = time[part], force[part]
        if not 2 / len(time) * rate <= self.below < rate / 2:
            refuse(
                f"target: below = {self.below} is not allowed",
                f"{2 / len(time) * rate:g} <= below < {rate / 2:g} Hz",
            )
        if (count := 2 * self.below * len(time) / rate) > MAX_COMPARED:
            refuse(
                f"target: {len(time) / rate:g} s up to {self.below:g} Hz are {count:.0f} values",
                f"up to {MAX_COMPARED}: a shorter window, or a lower frequency in below",
            )
        low = np.quantile(force, 0.1)
        last = (force[time > time[-1] - END].mean() - low) / (force.max() - low)
        if last > OPEN_END:
            refuse(
                f"target: the force ends with {last:.0%} of its peak", "a record of a whole impact"
            )
        return compare_force(self, Record(time, force, rate), self._pulse(time, force, rate))

    def _require_options(self) -> None:
        if self.force is not None:
            require_choice("target: force", self.force, FORCES)
        if self.noise is not None:
            require_positive("noise", self.noise, "N")
        require_positive("below", self.below, "Hz")
        count = len(self.record.drops) if isinstance(self.record, Recording) else 1
        require_whole("target: drop", self.drop, 1, count)
        for name in ("time_shift", "offset"):
            value = getattr(self, name)
            if value is not None and not isinstance(value, bool):
                refuse_value(f"target: {name}", value, "true, false")
        if self.gain is not None and self.gain != np.inf:
            require_positive("gain", self.gain, "relative standard uncertainty, or infinite")

    def _pulse(self, time: Array, force: Array, rate: float) -> tuple[int, int]:
        """Return the first sample of the pulse, and the stop (exclusive)."""
        if isinstance(self.record, Impact):
            return 0, len(force)
        if not isinstance(self.record, Recording):
            return find_pulse(force, rate)
        drop = self.record.drops[self.drop - 1]
        first, stop = np.searchsorted(time, drop.time[[drop.gate[0], drop.gate[1] - 1]])
        return int(first), min(int(stop) + 1, len(force))

    def _samples(self) -> Record:
        record = self.record
        if isinstance(record, Recording):
            drop = record.drops[self.drop - 1]
            # Hum and offset that were removed are added: the fit estimates them itself.
            return Record(drop.time, drop.force + drop.contact.removed, drop.sample_rate)
        if isinstance(record, Impact):
            return Record(record.time, record.force(self.force), record.sample_rate)
        try:
            table = np.column_stack([np.asarray(column, dtype=np.float64) for column in record])
        except (TypeError, ValueError) as error:
            refuse(
                "target cannot be used",
                "a ForceTarget, LevelTarget, Recording or Impact, or two arrays of one length: "
                "time, s, and force, N",
                error,
            )
        return read_record(table, "target")


@dataclass(frozen=True, eq=False, kw_only=True)
class ForceComparison(Comparison):
    """A record, prepared for a fit; see `Comparison` for the other attributes.

    Attributes
    ----------
    record : Record
        Times, s, force, N, and sample rate, Hz.
    kind : str
        ``"floor"`` or ``"elastic"``: the force of the model.
    below : float
        Highest frequency that is compared, Hz.
    spectrum : ndarray, shape (n_frequency,)
        Fourier coefficients of the record up to this frequency, N.
    weights : Weights
        Weights of the residuals on a grid of ``2 n_frequency - 1`` points.
    prior : float or None
        Known relative uncertainty of the gain, which adds one residual.
    background : Background or None
        Noise of the background; None where it is too short or another one is stated.
    offset : bool
        An offset is a nuisance parameter.
    tones : tuple of float
        Frequencies, Hz, of hum that is a nuisance parameter.
    short : float
        Length of a background, s, that is too short to determine the noise, and should; else NaN.
    """

    unit = "N"
    record: Record
    kind: LevelsForce
    below: float
    spectrum: NDArray[np.complex128]
    weights: Weights
    prior: float | None
    background: Background | None
    offset: bool
    tones: tuple[float, ...]
    short: float

    @property
    def band_fraction(self) -> float:
        """Fraction of the deviation of white noise that lies in the compared band."""
        return float(np.sqrt(len(self.weights.matrix) / len(self.record.time)))

    @property
    def _period(self) -> float:
        """Length of the record, s."""
        return len(self.record.time) / self.record.sample_rate

    def spectrum_of(self, impact: Impact, own: Array) -> NDArray[np.complex128]:
        """Return the Fourier coefficients of the force of an impact at the times of the record."""
        time, _, rate = self.record
        count, period = len(self.spectrum), self._period
        force, own_rate = impact.force(self.kind), impact.sample_rate
        turned = zoom_fft(force, [0.0, count / period], count, fs=own_rate).astype(np.complex128)
        turned *= rate / own_rate / np.sqrt(len(time))
        shift = self.own_value(SHIFT, own)
        phase = np.exp(-2j * np.pi * (np.arange(count) / period) * (shift - time[0]))
        result: NDArray[np.complex128] = self.own_value(GAIN, own) * turned * phase
        return result

    def own_value(self, name: str, own: Array) -> float:
        """Return a parameter of this record alone, or its fixed value if it is not fitted."""
        return float(dict(zip(self.own, own, strict=True)).get(name, DEFAULTS[name]))

    def own_start(self, impact: Impact) -> Array:
        """Return the time shift of maximum correlation, s, and a gain of 1."""
        begin = self.record.time[0]
        own = np.array([{SHIFT: begin, GAIN: 1.0}[name] for name in self.own])
        if SHIFT in self.own:
            product = self.spectrum * self.spectrum_of(impact, own).conj()
            count = 16 * len(product)
            lag = np.argmax(np.fft.irfft(product, count)) / count
            # A pulse that begins shortly before the record does not begin at its end.
            own[0] += (lag - (lag > 3 / 4)) * self._period
        return own

    def residual(self, impact: Impact, own: Array) -> Array:
        """Return model minus target over standard deviation, shape (size,)."""
        weighted: Array = self.weights.matrix @ -self._difference(impact, own)
        if self.prior is None:
            return weighted
        return np.append(weighted, (self.own_value(GAIN, own) - 1) / self.prior)

    def own_derivatives(self, impact: Impact, own: Array) -> Array:
        """Return the derivatives of the residual by its own parameters, shape (size, n_own)."""
        model = self.spectrum_of(impact, own)
        turn = -2j * np.pi * (np.arange(len(model)) / self._period)
        slopes = {SHIFT: turn * model, GAIN: model / self.own_value(GAIN, own)}
        result = np.zeros((self.size, len(self.own)))
        for i, name in enumerate(self.own):
            result[: len(self.weights.matrix), i] = self.weights.matrix @ on_grid(slopes[name])
        if self.prior is not None:
            result[-1, list(self.own).index(GAIN)] = 1 / self.prior
        return result

    def _difference(self, impact: Impact, own: Array) -> Array:
        """Return record − model on the grid, N."""
        return on_grid(self.spectrum - self.spectrum_of(impact, own))

    def columns(self, impact: Impact, own: Array) -> dict[str, Array]:
        """Return target and model side by side, s and N: columns by their names."""
        model = self.spectrum_of(impact, own)
        under = self.weights.background(on_grid(self.spectrum - model))
        target, force, background = (
            np.fft.irfft(spectrum, len(self.record.time), norm="ortho")
            for spectrum in (self.spectrum, model, np.fft.rfft(under, norm="ortho"))
        )
        return {
            "time_s": self.record.time,
            "record_N": self.record.force,
            "target_N": target,
            "background_N": background,
            "model_N": force,
            "residual_N": force + background - target,
        }

    def nuisances(self, impact: Impact, own: Array) -> dict[str, tuple[float, float]]:
        """Return offset and amplitudes of tones, if fitted, with their standard errors, N."""
        value, covariance = self.weights.estimates(self._difference(impact, own))
        result = {}
        if self.offset:
            result["offset"] = float(value[0]), float(np.sqrt(covariance[0, 0]))
        for i, tone in enumerate(self.tones, start=int(self.offset)):
            pair = np.array([i, i + len(self.tones)])
            result[f"hum of {tone:.4g} Hz"] = wave_size(value[pair], covariance[np.ix_(pair, pair)])
        return result

    def is_exact(self, impact: Impact, own: Array) -> bool:
        """Return whether residuals are too small to be tested: numerical errors."""
        difference = self._difference(impact, own)
        unexplained = difference - self.weights.background(difference)
        return bool(np.sqrt(np.mean(unexplained**2)) < NUMERICAL * self.record.force.max())

    def warnings(
        self, impact: Impact, own: Array, residual: Array, unit: float, count: int
    ) -> list[Note]:
        """Return warnings where residuals of unit variance are not noise.

        Weighted noise is stationary and independent; errors of the model occur during contact only.
        `unit` is the unit of the residuals, N, and `count` the number of fitted parameters.
        """
        if self.is_exact(impact, own):
            return []
        before, inside, after = self._phases(impact, own)
        residual = residual[: len(self.weights.matrix)]
        result = contact_warning(residual, inside, count, unit)
        if not result:
            result = color_warning(residual) + change_warning(residual, before, after)
        if not np.isnan(self.short):
            result.append(Note("background_too_short", value=1e3 * self.short, unit="ms"))
        return result

    def excess(self, impact: Impact, own: Array, residual: Array) -> float:
        """Return by how much residuals exceed noise, of the whole record or during contact."""
        inside = residual[: len(self.weights.matrix)][self._phases(impact, own)[1]]
        return max(misfit_ratio(part) for part in (residual, inside) if len(part) > MIN_FREEDOM)

    def _phases(self, impact: Impact, own: Array) -> list[NDArray[np.bool_]]:
        """Return which residuals lie before, in and after the contact."""
        count = len(self.weights.matrix)
        grid = self.record.time[0] + np.arange(count) * self._period / count
        begin = self.own_value(SHIFT, own)
        before, after = grid < begin, grid > begin + impact.contact_time
        return [before, ~(before | after), after]


def compare_force(target: ForceTarget, record: Record, pulse: tuple[int, int]) -> ForceComparison:
    """Return a record, prepared for a fit; `pulse` are its first sample and its stop."""
    (time, force, rate), source = record, target.record
    count = int(target.below * (len(time) / rate) * (1 + ROUNDING)) + 1
    spectrum = np.fft.rfft(force, norm="ortho")[:count]
    quiet = find_quiet(force, rate, pulse, target.below)
    known = quiet.freedom >= MIN_BACKGROUND
    shown = known and quiet.deviation > NUMERICAL * force.max()
    offset = known if target.offset is None else target.offset
    tones = quiet.tones() if shown else ()
    background = quiet.background(tones) if shown else None
    at = np.arange(len(time)) / rate - quiet.middle
    weights = new_weights(
        at, rate, 2 * count - 1,
        background=background, noise=target.noise, offset=offset, tones=tones,
    )  # fmt: skip
    known_noise = shown or target.noise is not None
    exact = isinstance(source, Impact)
    names = [SHIFT] if (not exact if target.time_shift is None else target.time_shift) else []
    weighted, prior = weights.matrix @ on_grid(spectrum), None
    if target.gain is not None:
        names.append(GAIN)
        if target.gain < np.inf:
            prior = target.gain
            weighted = np.append(weighted, 1 / prior)
    if prior is not None and not known_noise:
        refuse(
            f"target: gain = {prior:g} is not allowed without a known noise",
            f"noise, {MIN_BACKGROUND / 2 / target.below:.3g} s of background, or inf",
        )
    assessed = source.assessed_force() if isinstance(source, Impact) else "floor"
    return ForceComparison(
        weighted_target=weighted, known_noise=known_noise,
        noise_freedom=quiet.freedom if shown and target.noise is None else None,
        unit_deviation=target.noise or (weights.deviation() if known_noise else 1.0),
        absorbed=offset + 2 * len(tones), own={name: SCALES[name] for name in names},
        record=record, kind=target.force or assessed, below=target.below, spectrum=spectrum,
        weights=weights, prior=prior, background=background, offset=offset, tones=tones,
        short=quiet.seconds if not (known or target.offset is not None or exact) else np.nan,
    )  # fmt: skip


def on_grid(spectrum: NDArray[np.complex128]) -> Array:
    """Return the history of Fourier coefficients on the grid of the residuals."""
    result: Array = np.fft.irfft(spectrum, 2 * len(spectrum) - 1, norm="ortho")
    return result


def _cut(time: Array, force: Array, window: tuple[float, float]) -> tuple[Array, Array]:
    try:
        begin, end = map(float, window)
    except (TypeError, ValueError, OverflowError):
        begin = end = np.nan
    inside = (time >= begin) & (time <= end)
    if np.count_nonzero(inside) < MIN_SAMPLES or not force[inside].max() > 0:
        refuse_value(
            "target: window",
            window,
            f"begin and end, s, of an impact between {time[0]:g} and {time[-1]:g}",
        )
    return time[inside], force[inside]
