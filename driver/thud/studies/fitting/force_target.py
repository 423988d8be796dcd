"""A force history as the target of a fit."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from thud.base.checks import refuse, refuse_value, require_choice, require_number, require_whole
from thud.base.immutable import Immutable
from thud.impact.impact import Impact
from thud.level.levels import FORCES, RECORDED_BAND
from thud.recordings.formats import MIN_SAMPLES
from thud.recordings.recording import Recording
from thud.studies.fitting.force_misfit import ForceMisfit
from thud.studies.fitting.force_record import Record, read_record
from thud.studies.fitting.misfit import require_positive
from thud.studies.fitting.record_noise import MIN_HUM, find_pulse, trimmed

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import ArrayLike, NDArray

    from thud.base._schema import LevelsForce

# A record must hold the whole pulse: maximum mean of its last millisecond over its peak.
OPEN_END = 0.1
END = 1e-3
# Maximum number of compared values: the memory of their covariance grows with its square, to 2 GB.
MAX_COMPARED = 8000


@dataclass(frozen=True, eq=False)
class ForceTarget(Immutable):
    """A force history to be fitted.

    Model and record are compared at the frequencies up to `below`, by their discrete Fourier
    transforms over the time of the record, in which a shift in time is a phase. Above it there is
    noise, or numerical ripple. The residuals are weighted by the covariance of the noise (white,
    pink and brown), estimated from the background before and after the pulse (generalized least
    squares); offset and hum are nuisance parameters. Only 0.1 s of background on each side counts.

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
    hum : float or None
        Frequency, Hz, of hum whose first five harmonics are nuisance parameters; 0: no hum; None:
        hum of 50 or 60 Hz and other tones as found in the background.
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
    hum: float | None = None
    gain: float | None = None
    fixed: Mapping[str, object] = field(default_factory=dict)

    def misfit(self) -> ForceMisfit:
        """Return the misfit of the target."""
        if self.force is not None:
            require_choice("target: force", self.force, FORCES)
        self._require_numbers()
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
        return ForceMisfit(self, Record(time, force, rate), self._pulse(time, force, rate))

    def _require_numbers(self) -> None:
        if self.noise is not None:
            require_positive("noise", self.noise, "N")
        require_positive("below", self.below, "Hz")
        count = len(self.record.drops) if isinstance(self.record, Recording) else 1
        require_whole("target: drop", self.drop, 1, count)
        if self.hum is not None:
            require_number("target: hum", self.hum)
            if self.hum and not MIN_HUM <= self.hum <= self.below:
                allowed = f"0, or {MIN_HUM:g} to {self.below:g} Hz"
                refuse_value("target: hum", self.hum, allowed)
        for name in ("time_shift", "offset"):
            value = getattr(self, name)
            if value is not None and not isinstance(value, bool):
                refuse_value(f"target: {name}", value, "true, false")
        if self.gain is not None and self.gain != np.inf:
            require_positive("gain", self.gain, "relative standard uncertainty, or infinite")

    def _pulse(
        self, time: NDArray[np.float64], force: NDArray[np.float64], rate: float
    ) -> tuple[int, int]:
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


def _cut(
    time: NDArray[np.float64], force: NDArray[np.float64], window: tuple[float, float]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
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
