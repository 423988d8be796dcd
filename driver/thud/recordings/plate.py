"""The force plate: correction of its first resonance, and the standard's demands on it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.fft import next_fast_len

from thud.base.checks import refuse, refuse_value, require_number
from thud.level.levels import get_bands

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from thud.base._schema import BandSet

# What the standard asks of a force plate: flat between these frequencies, Hz, up to this force, N,
# and linear to this share. It gives no tolerance for "flat"; that of the linearity is taken.
FLAT = (0.2, 1000.0)
RANGE = 5000.0
TOLERANCE = 0.02
# Minimum ratio of the resonance and the highest band edge: from there on a resonance that is wrong
# by 1 % makes the force at that edge wrong by 2 r**2 / (1 - r**2) = 2 %, the standard's tolerance.
CLEARANCE = math.sqrt(2)
# The correction reaches up to twice the resonance, where it multiplies the noise by 3.
REACH = 2.0


@dataclass(frozen=True)
class Plate:
    """A force plate as a mass on a spring, whose deformation is measured.

    Attributes
    ----------
    frequency : float
        First resonance, Hz.
    quality : float
        Quality factor of the resonance.
    mass : float, optional
        Moving mass of the plate alone, kg; needed with an added mass.
    added_mass : float
        Mass fixed on the plate since `frequency` and `quality` were measured, kg.
    frequency_uncertainty : float
        Relative standard uncertainty of the resonance.
    """

    frequency: float
    quality: float
    mass: float | None = None
    added_mass: float = 0.0
    frequency_uncertainty: float = 0.0

    def __post_init__(self) -> None:
        """Refuse what no plate has."""
        for name in ("frequency", "quality", "added_mass", "frequency_uncertainty"):
            require_number(f"plate: {name}", getattr(self, name))
        if self.frequency <= 0:
            refuse_value("plate: frequency", self.frequency, "frequency > 0, Hz")
        if self.quality <= 0:
            refuse_value("plate: quality", self.quality, "quality > 0")
        if self.added_mass < 0:
            refuse_value("plate: added_mass", self.added_mass, "added_mass >= 0, kg")
        if not 0 <= self.frequency_uncertainty < 1:
            refuse_value("plate: frequency_uncertainty", self.frequency_uncertainty, "0 to 1")
        if self.mass is not None:
            require_number("plate: mass", self.mass)
        if (self.mass is not None or self.added_mass) and not (self.mass or 0.0) > 0:
            refuse_value("plate: mass", self.mass, "mass > 0, kg, where a mass is added")

    @property
    def loading(self) -> float:
        """Moving mass with the added mass over that without it."""
        return 1.0 + self.added_mass / self.mass if self.mass else 1.0

    @property
    def resonance(self) -> float:
        """Resonance with the added mass, Hz; stiffness and damping stay."""
        return self.frequency / math.sqrt(self.loading)

    def response(self, frequency: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Return the force measured over the force applied, at frequencies in Hz."""
        ratio = frequency / self.resonance
        quality = self.quality * math.sqrt(self.loading)
        return np.asarray(1 / (1 - ratio**2 + 1j * ratio / quality))

    def passed(self, frequency: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the part of the force that its correction keeps, at frequencies in Hz."""
        octaves = np.log2(np.maximum(frequency, 1e-9) / (REACH * self.resonance))
        return np.asarray(np.cos(np.pi / 2 * np.clip(octaves, 0, 1)) ** 2)

    def correction(self, sample_rate: float) -> str:
        """Return a sentence on what `correct_plate` does at a rate, Hz."""
        highest = min(REACH * self.resonance, sample_rate / 2)
        gain = 1 / abs(self.response(np.array([highest]))[0])
        mass = f" with {self.added_mass:g} kg added" if self.added_mass else ""
        return (
            f"force plate: resonance of {self.resonance:.4g} Hz, quality {self.quality:g}{mass}, "
            f"taken out up to {highest:.4g} Hz; noise there times {gain:.2g}"
        )

    def level_uncertainty(self, bands: BandSet = "octave") -> NDArray[np.float64]:
        """Return what the uncertainty of the resonance makes of corrected levels, dB.

        At the upper edge of each band: 20 lg of 1 + 2 r**2 / (1 - r**2) times the relative one.
        """
        square = (get_bands(bands).upper / self.resonance) ** 2
        return np.asarray(
            20 / math.log(10) * 2 * square / np.abs(1 - square) * self.frequency_uncertainty
        )


@dataclass(frozen=True)
class PlateCheck:
    """One demand on the force plate.

    Attributes
    ----------
    demand : str
        ``"flat above"`` (0.2 Hz), ``"flat below"`` (1000 Hz), ``"range"`` or ``"linear"``.
    met : bool or None
        Whether it is met; None where it is not known.
    sentence : str
        What was found, with numbers.
    """

    demand: str
    met: bool | None
    sentence: str


def correct_plate(
    force: NDArray[np.float64], sample_rate: float, plate: Plate, bands: BandSet = "third"
) -> NDArray[np.float64]:
    """Return the force that was applied to a plate, N, shape (n_sample,), from the measured one.

    F = F_m + F_m' / (w0 Q) + F_m'' / w0**2, by the Fourier transform. Up to twice the resonance it
    is exact; above, where it would only amplify noise, it falls to zero within an octave.

    Parameters
    ----------
    force : ndarray, shape (n_sample,)
        Measured force, N; quiet at both ends.
    sample_rate
        Samples per second, Hz.
    plate
        Resonance, quality factor, added mass.
    bands
        Bands that are to be read from the force.

    Raises
    ------
    InputError
        Where the resonance is below 1.41 times the highest band edge.
    """
    edge = get_bands(bands).upper[-1]
    if plate.resonance < CLEARANCE * edge:
        refuse(
            f"plate: the resonance, {plate.resonance:.4g} Hz, is too near to the bands, which "
            f"reach up to {edge:.4g} Hz, for a correction",
            f"{CLEARANCE * edge:.4g} Hz or more",
        )
    reach = REACH * plate.resonance
    # The response to one sample has died away after some periods of the reach.
    room = math.ceil(20 * sample_rate / reach)
    padded = np.pad(force, room, mode="edge")
    length = next_fast_len(len(padded) + room, real=True)
    frequency = np.asarray(np.fft.rfftfreq(length, 1 / sample_rate), dtype=np.float64)
    # About the first value, so that the end that wraps around is no step.
    origin = padded[0]
    spectrum = np.fft.rfft(padded - origin, length) / plate.response(frequency)
    spectrum *= plate.passed(frequency)
    corrected: NDArray[np.float64] = (
        np.fft.irfft(spectrum, length)[room : room + len(force)] + origin
    )
    return corrected


def check_plate(
    plate: Plate | None = None,
    *,
    corrected: bool = False,
    time_constant: float | None = None,
    full_scale: float | None = None,
    calibration: Sequence[tuple[float, float]] | None = None,
) -> tuple[PlateCheck, ...]:
    """Return whether a force plate meets the standard: 0.2 to 1000 Hz, 0 to 5000 N, linear to 2 %.

    Parameters
    ----------
    plate
        Resonance and quality factor; without it the upper frequency is not known.
    corrected
        Whether the resonance is taken out, so that only its uncertainty is left.
    time_constant
        Time constant of the amplifier, s (a charge amplifier's high-pass); infinite for a static
        one.
    full_scale
        Largest force that the plate and its recorder can read, N.
    calibration : sequence of tuple
        Forces applied and indicated, N.
    """
    return (
        _check_low(time_constant),
        _check_high(plate, corrected=corrected),
        _check_range(full_scale),
        _check_linearity(calibration),
    )


def _check_low(time_constant: float | None) -> PlateCheck:
    """Check the lowest frequency: a first-order high-pass."""
    demand, low = "flat above", FLAT[0]
    if time_constant is None:
        return PlateCheck(demand, None, f"the response at {low:g} Hz is not known (time constant)")
    if not time_constant > 0:
        refuse_value("plate: time_constant", time_constant, "time_constant > 0, s")
    loss = 1 - 1 / math.hypot(1, 1 / (2 * math.pi * low * time_constant))
    needed = 1 / (2 * math.pi * low * math.sqrt((1 - TOLERANCE) ** -2 - 1))
    return PlateCheck(
        demand,
        loss <= TOLERANCE,
        f"at {low:g} Hz the plate reads {100 * loss:.2g} % too little (time constant "
        f"{time_constant:g} s; {100 * TOLERANCE:g} % need {needed:.1f} s)",
    )


def _check_high(plate: Plate | None, *, corrected: bool) -> PlateCheck:
    """Check the highest frequency: the resonance, or what its correction leaves."""
    demand, high = "flat below", FLAT[1]
    if plate is None:
        return PlateCheck(demand, None, f"the response up to {high:g} Hz is not known (resonance)")
    if corrected and not plate.frequency_uncertainty:
        told = f"the response up to {high:g} Hz is not known (uncertainty of the resonance)"
        return PlateCheck(demand, None, told)
    frequency = np.linspace(0.0, high, 1001, dtype=np.float64)
    response = np.abs(plate.response(frequency))
    if corrected:
        # Expanded uncertainty of the resonance, both ways.
        shift = 1.96 * plate.frequency_uncertainty
        missed = [
            np.abs(plate.response(frequency / (1 + sign * shift))) / response for sign in (-1, 1)
        ]
        deviation = max(float(np.abs(m - 1).max()) for m in missed)
        how = f"after the correction, whose resonance is known to {100 * shift:.2g} %"
    else:
        deviation = float(np.abs(response - 1).max())
        needed = high * math.sqrt(1 + 1 / TOLERANCE)
        how = f"without correction; {100 * TOLERANCE:g} % need a resonance of {needed:.0f} Hz"
    return PlateCheck(
        demand,
        deviation <= TOLERANCE,
        f"up to {high:g} Hz the plate with its resonance of {plate.resonance:.4g} Hz is up to "
        f"{100 * deviation:.2g} % off ({how})",
    )


def _check_range(full_scale: float | None) -> PlateCheck:
    """Check the largest force."""
    if full_scale is None:
        return PlateCheck("range", None, f"whether the plate reads up to {RANGE:g} N is not known")
    require_number("plate: full_scale", full_scale)
    return PlateCheck(
        "range",
        full_scale >= RANGE,
        f"the plate reads up to {full_scale:.4g} N; the standard asks for {RANGE:g} N",
    )


def _check_linearity(calibration: Sequence[tuple[float, float]] | None) -> PlateCheck:
    """Check the linearity: deviation from the best line through zero, over the value itself."""
    demand = "linear"
    if calibration is None:
        return PlateCheck(demand, None, "the linearity is not known (pairs of forces)")
    table = np.asarray(calibration, dtype=np.float64)
    if table.ndim != 2 or table.shape[1] != 2 or len(table) < 2 or not (table > 0).all():  # noqa: PLR2004
        refuse("plate: calibration is no list of pairs", "two or more pairs of forces, N, above 0")
    applied, indicated = table.T
    # Of relative deviations, so that small forces count as much as large ones.
    slope = float(np.mean(indicated / applied))
    relative = indicated / (slope * applied) - 1
    worst = int(np.argmax(np.abs(relative)))
    reach = "" if applied.max() >= RANGE else f"; above {applied.max():.4g} N it is not known"
    met = bool(abs(relative[worst]) <= TOLERANCE)
    return PlateCheck(
        demand,
        None if met and reach else met,
        f"from {applied.min():.4g} to {applied.max():.4g} N the plate is linear within "
        f"{100 * abs(relative[worst]):.2g} % (worst at {applied[worst]:.4g} N){reach}",
    )
