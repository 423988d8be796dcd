"""A force history as the target of a fit, compared by frequency."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from scipy.signal import zoom_fft

from thud.base.checks import refuse, refuse_value, require_choice, require_whole
from thud.base.immutable import Immutable
from thud.base.note import Note
from thud.impact.compute import compute
from thud.impact.impact import Impact
from thud.level.levels import FORCES, RECORDED_BAND
from thud.recordings.background import OFFSET
from thud.recordings.drops import MAX_BACKGROUND
from thud.recordings.formats import MIN_SAMPLES
from thud.recordings.recording import Recording
from thud.studies.fitting.comparison import (
    MIN_FREEDOM,
    Comparison,
    Own,
    color_warning,
    contact_warning,
    misfit_ratio,
    require_positive,
)
from thud.studies.fitting.record import (
    MIN_BACKGROUND,
    Noise,
    Record,
    find_pulse,
    find_quiet,
    find_tones,
    fit_quiet,
    on_grid,
    read_record,
    record_noise,
)

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import ArrayLike, NDArray

    from thud.base._schema import LevelsForce
    from thud.case.case import Case
    from thud.recordings.background import Background
    from thud.studies.arrays import Array


# A record must hold the whole pulse: maximum mean of its last millisecond over its peak.
OPEN_END = 0.1
END = 1e-3
# Maximum number of compared values: the memory of their covariance grows with its square, to 2 GB.
MAX_COMPARED = 8000
# Relative tolerance of the highest frequency, because times are rounded.
ROUNDING = 1e-5
# Parameters of a record alone.
SHIFT, GAIN = "time_shift", "gain"
OWN = {SHIFT: Own("s", 1e-3), GAIN: Own("", 1.0, 1.0)}
# Minimum residual over peak force for a test: smaller ones are sampling errors.
NUMERICAL = 1e-4


@dataclass(frozen=True, eq=False)
class ForceTarget(Immutable):
    """A force history to be fitted.

    Model and record are compared at the frequencies up to `below`, by their discrete Fourier
    transforms over the time of the record, in which a shift in time is a phase. Above it there is
    noise, or numerical ripple. The residuals are weighted by the covariance of the noise (white,
    pink, brown, hum of 50 and 60 Hz and tones), estimated from the background before and after the
    pulse (generalized least squares), and of an unknown offset. Only 0.1 s of background on each
    side counts. Time of first touch and offset are fitted, unless the target is an impact.

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
    below : float
        Highest frequency that is compared, Hz.
    window : tuple of float or None
        Begin and end, s, of the compared part of the record; None: the pulse with 0.1 s on each
        side. The time of a measured drop is 0 at first touch.
    drop : int
        Number of the drop of a recording that has several, from 1.
    gain : float or None
        Relative standard uncertainty of the calibration: a factor of the record is fitted, which is
        1 within this uncertainty; infinite: any factor; None: the factor is 1.
    fixed : mapping of str to object
        Keys of ball, drop and model that are different for this record, such as the drop height.
    """

    record: Recording | Impact | tuple[ArrayLike, ArrayLike]
    noise: float | None = None
    force: LevelsForce | None = None
    below: float = RECORDED_BAND
    window: tuple[float, float] | None = None
    drop: int = 1
    gain: float | None = None
    fixed: Mapping[str, object] = field(default_factory=dict)

    def compare(self) -> ForceComparison:
        """Return the comparison of an impact with the record."""
        if self.force is not None:
            require_choice("force", self.force, FORCES)
        if self.noise is not None:
            require_positive("noise", self.noise, "N")
        require_positive("below", self.below, "Hz")
        if self.gain is not None and self.gain != np.inf:
            require_positive("gain", self.gain, "relative standard uncertainty, or infinite")
        record, pulse = self._record()
        _require_record(record, self.below)
        (time, force, rate), exact = record, isinstance(self.record, Impact)
        count = int(self.below * (len(time) / rate) * (1 + ROUNDING)) + 1
        spectrum = np.fft.rfft(force, norm="ortho")[:count]
        quiet = find_quiet(force, rate, pulse, self.below)
        known = quiet.freedom >= MIN_BACKGROUND
        background = None
        if known and quiet.deviation > NUMERICAL * force.max():
            background = fit_quiet(quiet, find_tones(quiet, self.below))
        noise = record_noise(
            np.arange(len(time)) / rate - quiet.middle, rate, 2 * count - 1,
            background=background, white=self.noise, offset=0.0 if exact else OFFSET * quiet.peak,
        )  # fmt: skip
        known_noise = background is not None or self.noise is not None
        own = {} if exact else {SHIFT: OWN[SHIFT]}
        if self.gain is not None:
            own[GAIN] = OWN[GAIN]._replace(deviation=self.gain)
            if not known_noise and self.gain < np.inf:
                refuse(
                    f"gain = {self.gain:g} is not allowed without a known noise",
                    f"noise, {MIN_BACKGROUND / 2 / self.below:.3g} s of background, or inf",
                )
        assessed = self.record.assessed_force() if isinstance(self.record, Impact) else "floor"
        return ForceComparison(
            weighted_target=noise.whiten @ on_grid(spectrum), known_noise=known_noise,
            noise_freedom=quiet.freedom if background and self.noise is None else None,
            unit_deviation=self.noise or (noise.deviation if known_noise else 1.0),
            absorbed=(not exact) + 2 * len(background.tones if background else ()), own=own,
            record=record, kind=self.force or assessed, below=self.below, spectrum=spectrum,
            noise=noise, background=background,
            short=np.nan if known or exact or self.noise else quiet.seconds,
        )  # fmt: skip

    def _record(self) -> tuple[Record, tuple[int, int]]:
        """Return the compared part of the record, and its pulse: first sample, and stop."""
        source = self.record
        count = len(source.drops) if isinstance(source, Recording) else 1
        require_whole("drop", self.drop, 1, count)
        if isinstance(source, Recording):
            drop = source.drops[self.drop - 1]
            # Hum and offset that were removed are added: the fit estimates them itself.
            record = Record(drop.time, drop.force + drop.contact.removed, drop.sample_rate)
        elif isinstance(source, Impact):
            record = Record(source.time, source.force(self.force), source.sample_rate)
        else:
            try:
                table = np.column_stack([np.asarray(column, dtype=np.float64) for column in source])
            except (TypeError, ValueError) as error:
                refuse(
                    "the record cannot be used",
                    "a ForceTarget, LevelTarget, Recording or Impact, or two arrays of one length: "
                    "time, s, and force, N",
                    error,
                )
            record = read_record(table)
        time, force, rate = record if self.window is None else _cut(record, self.window)
        if isinstance(source, Recording):
            gate = np.searchsorted(time, drop.time[[drop.gate[0], drop.gate[1] - 1]])
            first, stop = int(gate[0]), min(int(gate[1]) + 1, len(force))
        elif isinstance(source, Impact):
            first, stop = 0, len(force)
        else:
            first, stop = find_pulse(force, rate)
            if self.window is None:
                room = int(MAX_BACKGROUND * rate)
                begin = max(first - room, 0)
                time, force = time[begin : stop + room], force[begin : stop + room]
                first, stop = first - begin, stop - begin
        return Record(time, force, rate), (first, stop)


@dataclass(frozen=True, eq=False, kw_only=True)
class ForceComparison(Comparison["Impact"]):
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
    noise : Noise
        Noise on a grid of ``n = 2 n_frequency - 1`` points.
    background : Background or None
        Noise of the background; None where it is too short or another one is stated.
    short : float
        Length of a background, s, that is too short to determine the noise, and should; else NaN.
    """

    unit = "N"
    has_alternatives = True
    record: Record
    kind: LevelsForce
    below: float
    spectrum: NDArray[np.complex128]
    noise: Noise
    background: Background | None
    short: float

    @property
    def band_fraction(self) -> float:
        """Fraction of the deviation of white noise that lies in the compared band."""
        return float(np.sqrt(len(self.weighted_target) / len(self.record.time)))

    def solve(self, case: Case) -> Impact:
        """Return the impact of a case."""
        return compute(case)

    def own_value(self, name: str, own: Array) -> float:
        """Return a parameter of this record alone, or its fixed value if it is not fitted."""
        return float(dict(zip(self.own, own, strict=True)).get(name, OWN[name].start))

    def spectrum_of(self, impact: Impact, own: Array) -> NDArray[np.complex128]:
        """Return the Fourier coefficients of the force of an impact at the times of the record."""
        time, _, rate = self.record
        count, period = len(self.spectrum), len(time) / rate
        force = impact.elastic_force if self.kind == "elastic" else impact.floor_force
        own_rate = impact.sample_rate
        turned = zoom_fft(force, [0.0, count / period], count, fs=own_rate).astype(np.complex128)
        turned *= rate / own_rate / np.sqrt(len(time))
        shift = self.own_value(SHIFT, own)
        phase = np.exp(-2j * np.pi * (np.arange(count) / period) * (shift - time[0]))
        result: NDArray[np.complex128] = self.own_value(GAIN, own) * turned * phase
        return result

    def start(self, result: Impact) -> Array:
        """Return the time shift of maximum correlation, s, and a gain of 1."""
        own = super().start(result)
        if SHIFT in self.own:
            own[0] = self.record.time[0]
            product = self.spectrum * self.spectrum_of(result, own).conj()
            count = 16 * len(product)
            lag = np.argmax(np.fft.irfft(product, count)) / count
            # A pulse that begins shortly before the record does not begin at its end.
            period = len(self.record.time) / self.record.sample_rate
            own[0] += (lag - (lag > 3 / 4)) * period
        return own

    def misfit(self, result: Impact, own: Array) -> Array:
        """Return model minus target over standard deviation, shape (n,)."""
        difference = on_grid(self.spectrum - self.spectrum_of(result, own))
        weighted: Array = self.noise.whiten @ -difference
        return weighted

    def columns(self, result: Impact, own: Array) -> dict[str, Array]:
        """Return target and model side by side, s and N: columns by their names."""
        model = self.spectrum_of(result, own)
        under = self.noise.background(on_grid(self.spectrum - model))
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

    def is_exact(self, result: Impact, own: Array) -> bool:
        """Return whether residuals are too small to be tested: numerical errors."""
        difference = on_grid(self.spectrum - self.spectrum_of(result, own))
        unexplained = difference - self.noise.background(difference)
        return bool(np.sqrt(np.mean(unexplained**2)) < NUMERICAL * self.record.force.max())

    def warnings(
        self, result: Impact, own: Array, residual: Array, freedom: float, unit: float
    ) -> list[Note]:
        """Return warnings where residuals of unit variance are not noise.

        Weighted noise is stationary and independent; errors of the model occur during contact only.
        """
        notes = super().warnings(result, own, residual, freedom, unit)
        if self.is_exact(result, own):
            return notes
        parameters = self.size - self.absorbed - round(freedom)
        residual = residual[: len(self.weighted_target)]
        inside = self._inside(result, own)
        notes += contact_warning(residual, inside, parameters, unit) or color_warning(residual)
        if not np.isnan(self.short):
            notes.append(Note("background_too_short", value=1e3 * self.short, unit="ms"))
        return notes

    def excess(self, result: Impact, own: Array, residual: Array) -> float:
        """Return by how much residuals exceed noise, of the whole record or during contact."""
        inside = residual[: len(self.weighted_target)][self._inside(result, own)]
        return max(misfit_ratio(part) for part in (residual, inside) if len(part) > MIN_FREEDOM)

    def _inside(self, impact: Impact, own: Array) -> NDArray[np.bool_]:
        """Return which residuals lie in the contact."""
        count, period = len(self.weighted_target), len(self.record.time) / self.record.sample_rate
        time = self.record.time[0] + np.arange(count) * period / count
        begin = self.own_value(SHIFT, own)
        inside: NDArray[np.bool_] = (time >= begin) & (time <= begin + impact.contact_time)
        return inside


def _cut(record: Record, window: tuple[float, float]) -> Record:
    """Return a record between two times; raise InputError if it has no impact."""
    time, force, rate = record
    try:
        begin, end = map(float, window)
    except (TypeError, ValueError, OverflowError):
        begin = end = np.nan
    inside = (time >= begin) & (time <= end)
    if np.count_nonzero(inside) < MIN_SAMPLES or not force[inside].max() > 0:
        refuse_value(
            "window", window, f"begin and end, s, of an impact between {time[0]:g} and {time[-1]:g}"
        )
    return Record(time[inside], force[inside], rate)


def _require_record(record: Record, below: float) -> None:
    """Raise InputError if a record cannot be compared up to a frequency, Hz, or has no end."""
    time, force, rate = record
    if not 2 / len(time) * rate <= below < rate / 2:
        refuse(
            f"below = {below} is not allowed",
            f"{2 / len(time) * rate:g} <= below < {rate / 2:g} Hz",
        )
    if (count := 2 * below * len(time) / rate) > MAX_COMPARED:
        refuse(
            f"{len(time) / rate:g} s up to {below:g} Hz are {count:.0f} values",
            f"up to {MAX_COMPARED}: a shorter window, or a lower frequency in below",
        )
    low = np.quantile(force, 0.1)
    last = (force[time > time[-1] - END].mean() - low) / (force.max() - low)
    if last > OPEN_END:
        refuse(f"the force ends with {last:.0%} of its peak", "a record of a whole impact")
