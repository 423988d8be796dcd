"""Force plate and filter of the recorder: what is stated, and the correction of a force for it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from thud.base.checks import refuse, refuse_value, require_pair, require_whole
from thud.base.note import Note
from thud.base.toml_tables import TomlTable, between, key, one_of
from thud.level.levels import get_bands

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from thud.recordings.drops import Section

    Gain = Callable[[NDArray[np.float64]], NDArray[np.complex128]]

# Minimum response by which a spectrum is divided.
MIN_RESPONSE = 0.05
# Minimum ratio 1/r of resonance and highest band edge: an error of 1 % of the resonance causes an
# error of 2 r**2 / (1 - r**2) = 2 % of the force at this edge, the tolerance of the standard.
MIN_RATIO = math.sqrt(2)
# Filters, and response at the highest frequency at which they are corrected: there the correction
# amplifies the noise by 3.
KINDS = ("bessel", "butterworth")
MAX_ORDER = 12
LOWEST_RESPONSE = 1 / 3


def _to_linearity(name: str, value: object) -> tuple[tuple[float, float], ...]:
    """Return pairs of an applied and an indicated force, N."""
    pairs = value if isinstance(value, list | tuple) else []
    if len(pairs) < 2:  # noqa: PLR2004
        refuse_value(name, value, "two or more pairs [applied, indicated], N")
    return tuple(require_pair(name, pair, "[applied, indicated]", 1e-3, 1e9) for pair in pairs)


@dataclass(frozen=True)
class Plate(TomlTable):
    """A force plate; the force on it excites its first mode of vibration, which is corrected."""

    title = "plate: "
    f0: float = key(between(1.0, 1e6, "Hz"), "frequency of the first resonance", math.nan)
    Q: float = key(between(0.5, 1e6), "quality factor of the first resonance", math.nan)
    f0_uncertainty: float | None = key(
        between(0.0, 0.5), "relative standard uncertainty of the resonance"
    )
    share: float | None = key(
        between(0.001, 1.0),
        "share of this mode in the static response",
        hint="1 for a mass on a spring",
    )
    flat_limit: float | None = key(
        between(100.0, 1e6, "Hz"),
        "frequency up to which the response is flat within 2 %",
        hint="if no resonance is stated",
    )
    time_constant: float | None = key(between(1e-3, 1e9, "s"), "time constant of the amplifier")
    full_scale: float | None = key(
        between(1.0, 1e9, "N"), "largest force that plate and recorder can measure"
    )
    linearity: tuple[tuple[float, float], ...] = key(
        _to_linearity, "pairs of a force applied and the force indicated, N", ()
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
        return np.asarray(1 + (self.share or 1.0) * (mode - 1))

    @property
    def highest(self) -> float:
        """Highest corrected frequency, Hz: above the resonance the response falls to 1/3 there."""
        share = self.share or 1.0
        return self.f0 * math.sqrt(1 + share / (4 / 3 - share))

    def note(self, sample_rate: float) -> Note:
        """Return a note on the correction at a sample rate, Hz."""
        highest = min(self.highest, sample_rate / 2)
        gain = 1 / abs(self.response(np.array([highest]))[0])
        return Note(
            "plate_corrected", value=self.f0, high=highest, unit="Hz",
            others={"quality": self.Q, "gain": gain},
        )  # fmt: skip

    def limit(self, edge: float) -> tuple[str, float, float]:
        """Return what limits bands up to an edge, Hz, its frequency and the lowest one, Hz."""
        return "plate: the resonance", self.f0, MIN_RATIO * edge


@dataclass(frozen=True)
class RecorderFilter(TomlTable):
    """The low-pass filter of the recorder or amplifier, which is corrected."""

    title = "filter: "
    kind: str = key(
        one_of((*KINDS, "none")), "kind", hint="none if its response is flat in the bands"
    )
    order: int | None = key(partial(require_whole, low=1, high=MAX_ORDER), "order")
    cutoff: float = key(between(1.0, 1e9, "Hz"), "cutoff at -3 dB", math.nan)
    cutoff_uncertainty: float | None = key(
        between(0.0, 0.5), "relative standard uncertainty of the cutoff"
    )

    def __post_init__(self) -> None:
        """Raise InputError if a value is not allowed, or one is missing."""
        super().__post_init__()
        self.require("kind")
        if self.kind != "none":
            self.require("order", "cutoff")
        elif len(self.stated) > 1:
            refuse("filter: kind = 'none' has an order or a cutoff", "kind alone, or another kind")

    def response(self, frequency: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Return the ratio of output and input, at frequencies in Hz."""
        # SciPy is slow to import, and a configuration is read by every command.
        from scipy.signal import bessel, butter, freqs_zpk

        if self.kind == "bessel":
            zpk = bessel(self.order, self.cutoff, analog=True, output="zpk", norm="mag")
        else:
            zpk = butter(self.order, self.cutoff, analog=True, output="zpk")
        return np.asarray(freqs_zpk(*zpk, worN=frequency)[1])

    @property
    def highest(self) -> float:
        """Highest corrected frequency, Hz."""
        frequency = self.cutoff * np.geomspace(1, 8, 400)
        falling = np.abs(self.response(frequency))[::-1]
        return float(np.interp(LOWEST_RESPONSE, falling, frequency[::-1]))

    def note(self, sample_rate: float) -> Note:
        """Return a note on the correction at a sample rate, Hz."""
        highest = min(self.highest, sample_rate / 2)
        return Note(
            "filter_corrected", value=self.cutoff, high=highest, unit="Hz",
            others={"kind": self.kind.capitalize(), "order": self.order or 0},
        )  # fmt: skip

    def limit(self, edge: float) -> tuple[str, float, float]:
        """Return what limits bands up to an edge, Hz, its frequency and the lowest one, Hz."""
        return "filter: the cutoff", self.cutoff, self.cutoff * edge / self.highest


@dataclass(frozen=True)
class Chain:
    """Instruments in series whose responses are corrected: force plate, filter of the recorder."""

    instruments: tuple[Plate | RecorderFilter, ...]

    @property
    def highest(self) -> float:
        """Highest corrected frequency, Hz."""
        return min(instrument.highest for instrument in self.instruments)

    def response(self, frequency: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Return the ratio of measured and applied force, at frequencies in Hz."""
        responses = [instrument.response(frequency) for instrument in self.instruments]
        return np.asarray(np.prod(responses, axis=0))

    def correction(self, frequency: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Return the ratio of corrected and measured force, at frequencies in Hz."""
        octaves = np.log2(np.maximum(frequency, 1e-9) / self.highest)
        response = self.response(frequency)
        response *= np.maximum(MIN_RESPONSE / np.abs(response), 1)
        return np.asarray(np.cos(np.pi / 2 * np.clip(octaves, 0, 1)) ** 2 / response)


def filtered(
    force: NDArray[np.float64], sample_rate: float, gain: Gain, margin: int = 0
) -> NDArray[np.float64]:
    """Return a force filtered by a gain, N, shape (n_sample,), by Fourier transform.

    The gain is a function of the frequency, Hz. Before and after the force, N, its first and last
    value continue for a margin, in samples, in which the impulse response of the gain decays.
    """
    # SciPy is slow to import, and a configuration is read by every command.
    from scipy.fft import next_fast_len

    padded = np.pad(force, margin, mode="edge")
    length = next_fast_len(len(padded) + margin, real=True)
    factors = gain(np.asarray(np.fft.rfftfreq(length, 1 / sample_rate), dtype=np.float64))
    # The transform is periodic: without the first value, its ends meet without a step.
    origin = padded[0]
    result = np.fft.irfft(np.fft.rfft(padded - origin, length) * factors, length)
    return np.asarray(result[margin : margin + len(force)] + origin * factors[0].real)


def correct_force(
    force: NDArray[np.float64], sample_rate: float, chain: Chain
) -> NDArray[np.float64]:
    """Return the applied force, N, shape (n_sample,), from the measured one.

    This is exact up to the highest corrected frequency; above, it would only amplify noise, and is
    reduced to zero within an octave. The measured force, N, has background at both ends; the rate
    is in Hz. Raise InputError if a response does not allow a correction up to the highest edge of
    the one-third-octave bands.
    """
    edge = get_bands("third").upper[-1]
    for instrument in chain.instruments:
        name, frequency, lowest = instrument.limit(edge)
        if frequency < lowest:
            problem = f"{name}, {frequency:.5g} Hz, is too close to the bands up to {edge:.5g} Hz"
            refuse(problem, f"{lowest:.5g} Hz or more")
    # The impulse response decays within some periods of the highest corrected frequency.
    margin = math.ceil(20 * sample_rate / chain.highest)
    return filtered(force, sample_rate, chain.correction, margin)


def correct(section: Section, chain: Chain | None) -> Section:
    """Return a section of the applied force, and of its bounces, with notes on the instruments.

    Faults must be repaired before: a spike would ring in the correction.
    """
    if chain is None:
        return section
    rate = section.sample_rate
    return replace(
        section,
        force=correct_force(section.force, rate, chain),
        bounces=tuple(correct(bounce, chain) for bounce in section.bounces),
        chain=chain,
        notes=(*section.notes, *(instrument.note(rate) for instrument in chain.instruments)),
    )
