"""The force plate: response of its first resonance, and the requirements of the standard."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from thud.base.checks import refuse
from thud.base.note import Note
from thud.base.units import frequency_text
from thud.level.estimate import NORMAL_FACTOR
from thud.level.levels import get_bands
from thud.recordings.config_values import Number, Table, key, to_linearity

if TYPE_CHECKING:
    from collections.abc import Mapping

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


@dataclass(frozen=True)
class Plate(Table):
    """A force plate; the force on it excites its first mode of vibration, which is corrected."""

    title = "plate: "
    f0: float = key(Number(1.0, 1e6, "Hz"), "frequency of the first resonance", math.nan)
    Q: float = key(Number(0.5, 1e6), "quality factor of the first resonance", math.nan)
    f0_uncertainty: float | None = key(
        Number(0.0, 0.5), "relative standard uncertainty of the resonance"
    )
    share: float | None = key(
        Number(0.001, 1.0), "share of this mode in the static response, 1 for a mass on a spring"
    )
    flat_limit: float | None = key(
        Number(100.0, 1e6, "Hz"),
        "frequency up to which the response is flat within 2 %, if no resonance is stated",
    )
    time_constant: float | None = key(Number(1e-3, 1e9, "s"), "time constant of the amplifier")
    full_scale: float | None = key(
        Number(1.0, 1e9, "N"), "largest force that plate and recorder can measure"
    )
    linearity: tuple[tuple[float, float], ...] = key(
        to_linearity, "pairs of a force applied and the force indicated, N", ()
    )

    def __post_init__(self) -> None:
        """Raise InputError if a value is not allowed, or one is missing."""
        super().__post_init__()
        if {"f0", "Q", "f0_uncertainty", "share"} & set(self.stated):
            self.require("f0", "Q")
            if self.flat_limit is not None:
                refuse("and flat_limit are both stated", "one of them", name="plate: f0")

    def response(self, frequency: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Return the ratio of measured and applied force, at frequencies in Hz."""
        ratio = frequency / self.f0
        mode = 1 / (1 - ratio**2 + 1j * ratio / self.Q)
        return np.asarray(1 + self.mode_share * (mode - 1))

    @property
    def mode_share(self) -> float:
        """Share of the mode in the static response; 1 if it is not stated."""
        return self.share or 1.0

    @property
    def highest(self) -> float:
        """Highest corrected frequency, Hz: above the resonance the response falls to 1/3 there."""
        return self.f0 * math.sqrt(1 + self.mode_share / (4 / 3 - self.mode_share))

    def note(self, sample_rate: float) -> Note:
        """Return a note on the correction at a sample rate, Hz."""
        highest = min(self.highest, sample_rate / 2)
        gain = 1 / abs(self.response(np.array([highest]))[0])
        return Note(
            "plate_corrected", value=self.f0, high=highest, unit="Hz",
            others={"quality": self.Q, "gain": gain},
        )  # fmt: skip

    def require_above(self, edge: float) -> None:
        """Raise InputError if the resonance is below 1.41 times the highest edge of bands, Hz."""
        if self.f0 < MIN_RATIO * edge:
            refuse(
                f"plate: the resonance, {frequency_text(self.f0)}, is too close "
                f"to the bands, which reach up to {frequency_text(edge)}, for a correction",
                f"{frequency_text(MIN_RATIO * edge)} or more",
            )

    def level_uncertainty(self, bands: BandSet = "octave") -> NDArray[np.float64]:
        """Return the standard uncertainty of corrected levels due to that of the resonance, dB.

        At the upper edge of each band, r times the resonance, a relative error of the resonance
        changes the response of the mode by 2 r**2 / (1 - r**2) times as much.
        """
        square = (get_bands(bands).upper / self.f0) ** 2
        mode = self.mode_share / (1 - square)
        change = 2 * square / (1 - square) * mode / (1 - self.mode_share + mode)
        return np.asarray(20 / math.log(10) * np.abs(change) * (self.f0_uncertainty or 0.0))


@dataclass(frozen=True)
class PlateCheck:
    """A requirement on the force plate, whether it is met (None if unknown), and a note on it.

    Requirements: ``"flat above"`` (0.2 Hz), ``"flat below"`` (1000 Hz), ``"range"``, ``"linear"``.
    """

    requirement: str
    met: bool | None
    note: Note


def check_plate(plate: Plate) -> tuple[PlateCheck, ...]:
    """Check a plate by the standard: flat from 0.2 to 1000 Hz, 0 to 5000 N, linear within 2 %.

    The resonance of the plate is corrected.
    """
    return tuple(
        PlateCheck(requirement, *check(plate))
        for requirement, check in (
            ("flat above", _check_low),
            ("flat below", _check_high),
            ("range", _check_range),
            ("linear", _check_linearity),
        )
    )


def _note(code: str, value: float, others: Mapping[str, float | str], unit: str = "%") -> Note:
    return Note(code, "force plate", float(value), unit=unit, others=others)


def _unknown(what: str, keys: str) -> tuple[None, Note]:
    return None, _note("plate_unknown", math.nan, {"what": what, "keys": keys})


def _check_low(plate: Plate) -> tuple[bool | None, Note]:
    """Check the lowest frequency of a first-order high-pass."""
    low, time_constant = FLAT[0], plate.time_constant
    if time_constant is None:
        return _unknown(f"response at {low:g} Hz", "time_constant")
    loss = 1 - 1 / math.hypot(1, 1 / (2 * math.pi * low * time_constant))
    needed = 1 / (2 * math.pi * low * math.sqrt((1 - TOLERANCE) ** -2 - 1))
    others = {"frequency": low, "time_constant": time_constant, "needed": needed}
    return loss <= TOLERANCE, _note("plate_low", 100 * loss, others)


def _check_high(plate: Plate) -> tuple[bool | None, Note]:
    """Check the highest frequency by the deviation that remains after the correction."""
    high = FLAT[1]
    if not plate.f0_uncertainty:
        return _unknown(f"response up to {high:g} Hz", "f0, f0_uncertainty")
    frequency = np.linspace(0.0, high, 1001, dtype=np.float64)
    response = np.abs(plate.response(frequency))
    # Expanded uncertainty of the resonance, in both directions.
    shift = NORMAL_FACTOR * plate.f0_uncertainty
    ratios = [np.abs(plate.response(frequency / (1 + sign * shift))) / response for sign in (-1, 1)]
    deviation = max(float(np.abs(ratio - 1).max()) for ratio in ratios)
    others = {"frequency": high, "f0": plate.f0, "shift": 100 * shift}
    return deviation <= TOLERANCE, _note("plate_high", 100 * deviation, others)


def _check_range(plate: Plate) -> tuple[bool | None, Note]:
    if plate.full_scale is None:
        return _unknown("measuring range", "full_scale")
    note = _note("plate_range", plate.full_scale, {"required": RANGE}, "N")
    return plate.full_scale >= RANGE, note


def _check_linearity(plate: Plate) -> tuple[bool | None, Note]:
    """Check the linearity by the relative deviation from the best line through zero."""
    if not plate.linearity:
        return _unknown("linearity", "linearity")
    applied, indicated = np.array(plate.linearity).T
    # Relative deviations give small forces as much weight as large ones.
    slope = float(np.mean(indicated / applied))
    deviations = np.abs(indicated / (slope * applied) - 1)
    worst = int(np.argmax(deviations))
    forces = {"first": applied.min(), "last": applied.max(), "worst": applied[worst]}
    note = _note("plate_linear", 100 * deviations[worst], forces)
    met = bool(deviations[worst] <= TOLERANCE)
    return None if met and applied.max() < RANGE else met, note
