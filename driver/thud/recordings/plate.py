"""The force plate: response of its first resonance, and the requirements of the standard."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from thud.base.checks import refuse, refuse_value, require_number
from thud.base.units import frequency_text
from thud.level.estimate import NORMAL_FACTOR
from thud.level.levels import get_bands

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from thud.base._schema import BandSet

# Requirements of the standard on a force plate: a flat response between these frequencies, Hz, and
# up to this force, N, and linearity within this relative tolerance, which is used for flatness too.
FLAT = (0.2, 1000.0)
RANGE = 5000.0
TOLERANCE = 0.02
# Minimum ratio 1/r of resonance and highest band edge: an error of 1 % of the resonance causes an
# error of 2 r**2 / (1 - r**2) = 2 % of the force at this edge, the tolerance of the standard.
MIN_RATIO = math.sqrt(2)
# Duration of the ringing of a plate: periods per quality factor.
RINGING = 2.0


@dataclass(frozen=True)
class Plate:
    """A force plate whose first mode of vibration is excited by the force on it.

    Attributes are the frequency of the first resonance, Hz, its quality factor, the relative
    standard uncertainty of the frequency, and the share of the mode in the static response: 1 for a
    mass on a spring, whose deformation is measured.
    """

    frequency: float
    quality: float
    frequency_uncertainty: float = 0.0
    share: float = 1.0

    def __post_init__(self) -> None:
        """Raise InputError for impossible values."""
        for name in ("frequency", "quality", "frequency_uncertainty", "share"):
            require_number(f"plate: {name}", getattr(self, name))
        if self.frequency <= 0:
            refuse_value("plate: frequency", self.frequency, "frequency > 0, Hz")
        if self.quality <= 0:
            refuse_value("plate: quality", self.quality, "quality > 0")
        if not 0 <= self.frequency_uncertainty < 1:
            refuse_value("plate: frequency_uncertainty", self.frequency_uncertainty, "0 to 1")
        if not 0 < self.share <= 1:
            refuse_value("plate: share", self.share, "share > 0, up to 1")

    def response(self, frequency: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Return the ratio of measured and applied force, at frequencies in Hz."""
        ratio = frequency / self.frequency
        return np.asarray(1 + self.share * (1 / (1 - ratio**2 + 1j * ratio / self.quality) - 1))

    @property
    def highest(self) -> float:
        """Highest corrected frequency, Hz: above the resonance the response falls to 1/3 there."""
        return self.frequency * math.sqrt(1 + self.share / (4 / 3 - self.share))

    @property
    def decay(self) -> float:
        """Duration of the ringing, s."""
        return RINGING * self.quality / self.frequency

    def describe(self, sample_rate: float) -> str:
        """Describe the correction at a sample rate, Hz."""
        highest = min(self.highest, sample_rate / 2)
        gain = 1 / abs(self.response(np.array([highest]))[0])
        return (
            f"force plate: resonance of {frequency_text(self.frequency)}, "
            f"quality {self.quality:g}, corrected up to {frequency_text(highest)}; "
            f"noise there times {gain:.2g}"
        )

    def require_above(self, edge: float) -> None:
        """Raise InputError if the resonance is below 1.41 times the highest edge of bands, Hz."""
        if self.frequency < MIN_RATIO * edge:
            refuse(
                f"plate: the resonance, {frequency_text(self.frequency)}, is too close "
                f"to the bands, which reach up to {frequency_text(edge)}, for a correction",
                f"{frequency_text(MIN_RATIO * edge)} or more",
            )

    def level_uncertainty(self, bands: BandSet = "octave") -> NDArray[np.float64]:
        """Return the standard uncertainty of corrected levels due to that of the resonance, dB.

        At the upper edge of each band, r times the resonance, a relative error of the resonance
        changes the response of the mode by 2 r**2 / (1 - r**2) times as much.
        """
        square = (get_bands(bands).upper / self.frequency) ** 2
        mode = self.share / (1 - square)
        change = 2 * square / (1 - square) * mode / (1 - self.share + mode)
        return np.asarray(20 / math.log(10) * np.abs(change) * self.frequency_uncertainty)


@dataclass(frozen=True)
class PlateCheck:
    """A requirement on the force plate, whether it is met (None if unknown), and the reason.

    Requirements: ``"flat above"`` (0.2 Hz), ``"flat below"`` (1000 Hz), ``"range"``, ``"linear"``.
    """

    requirement: str
    met: bool | None
    reason: str


def check_plate(
    plate: Plate | None = None,
    *,
    time_constant: float | None = None,
    full_scale: float | None = None,
    linearity: Sequence[tuple[float, float]] | None = None,
) -> tuple[PlateCheck, ...]:
    """Check a plate by the standard: flat from 0.2 to 1000 Hz, 0 to 5000 N, linear within 2 %.

    The resonance of the plate is corrected. The time constant, s, is that of the amplifier (a
    high-pass), infinite if static. The full scale, N, is that of plate and recorder. The linearity
    is pairs of the force applied and the force indicated, N.
    """
    return (
        _check_low(time_constant),
        _check_high(plate),
        _check_range(full_scale),
        _check_linearity(linearity),
    )


def _check_low(time_constant: float | None) -> PlateCheck:
    """Check the lowest frequency of a first-order high-pass."""
    requirement, low = "flat above", FLAT[0]
    if time_constant is None:
        return PlateCheck(
            requirement, None, f"the response at {low:g} Hz is not known (time constant)"
        )
    if not time_constant > 0:
        refuse_value("plate: time_constant", time_constant, "time_constant > 0, s")
    loss = 1 - 1 / math.hypot(1, 1 / (2 * math.pi * low * time_constant))
    needed = 1 / (2 * math.pi * low * math.sqrt((1 - TOLERANCE) ** -2 - 1))
    return PlateCheck(
        requirement,
        loss <= TOLERANCE,
        f"at {low:g} Hz the plate reads {100 * loss:.2g} % too little (time constant "
        f"{time_constant:g} s; {100 * TOLERANCE:g} % need {needed:.1f} s)",
    )


def _check_high(plate: Plate | None) -> PlateCheck:
    """Check the highest frequency by the deviation that remains after the correction."""
    requirement, high = "flat below", FLAT[1]
    if plate is None or not plate.frequency_uncertainty:
        missing = "resonance" if plate is None else "uncertainty of the resonance"
        return PlateCheck(
            requirement, None, f"the response up to {high:g} Hz is not known ({missing})"
        )
    frequency = np.linspace(0.0, high, 1001, dtype=np.float64)
    response = np.abs(plate.response(frequency))
    # Expanded uncertainty of the resonance, in both directions.
    shift = NORMAL_FACTOR * plate.frequency_uncertainty
    ratios = [np.abs(plate.response(frequency / (1 + sign * shift))) / response for sign in (-1, 1)]
    deviation = max(float(np.abs(ratio - 1).max()) for ratio in ratios)
    return PlateCheck(
        requirement,
        deviation <= TOLERANCE,
        f"up to {high:g} Hz the plate with its resonance of "
        f"{frequency_text(plate.frequency)} is up to {100 * deviation:.2g} % off "
        "(after the correction, whose resonance is known to "
        f"{100 * shift:.2g} %)",
    )


def _check_range(full_scale: float | None) -> PlateCheck:
    if full_scale is None:
        return PlateCheck("range", None, f"whether the plate reads up to {RANGE:g} N is not known")
    require_number("plate: full_scale", full_scale)
    return PlateCheck(
        "range",
        full_scale >= RANGE,
        f"the plate reads up to {full_scale:.4g} N; the standard asks for {RANGE:g} N",
    )


def _check_linearity(linearity: Sequence[tuple[float, float]] | None) -> PlateCheck:
    """Check the linearity by the relative deviation from the best line through zero."""
    requirement = "linear"
    if linearity is None:
        return PlateCheck(requirement, None, "the linearity is not known (pairs of forces)")
    table = np.asarray(linearity, dtype=np.float64)
    if table.ndim != 2 or table.shape[1] != 2 or len(table) < 2 or not (table > 0).all():  # noqa: PLR2004
        refuse("plate: linearity is not a list of pairs", "two or more pairs of forces, N, above 0")
    applied, indicated = table.T
    # Relative deviations give small forces as much weight as large ones.
    slope = float(np.mean(indicated / applied))
    relative = indicated / (slope * applied) - 1
    worst = int(np.argmax(np.abs(relative)))
    restriction = "" if applied.max() >= RANGE else f"; above {applied.max():.4g} N it is not known"
    met = bool(abs(relative[worst]) <= TOLERANCE)
    return PlateCheck(
        requirement,
        None if met and restriction else met,
        f"from {applied.min():.4g} to {applied.max():.4g} N the plate is linear within "
        f"{100 * abs(relative[worst]):.2g} % (worst at {applied[worst]:.4g} N){restriction}",
    )
