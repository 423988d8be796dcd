"""Force plate and recorder filter: what is stated, its correction, its effects on levels and peak.

What is stated is corrected, and its uncertainty contributes to the levels. What is not stated may
change them by any amount between nothing and an assumed response, a rectangular distribution.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from thud.base.checks import refuse, refuse_value, require_pair, require_whole
from thud.base.note import Note
from thud.base.toml_tables import TomlTable, between, key, one_of
from thud.level.estimate import RECTANGULAR
from thud.level.levels import get_bands

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from numpy.typing import NDArray

    from thud.base._schema import BandSet
    from thud.recordings.config import Config
    from thud.recordings.drops import Section
    from thud.recordings.measured_drop import Drop

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
# Requirements of the standard on a force plate: a flat response between these frequencies, Hz, and
# linearity within this relative tolerance, which is used for flatness too.
FLAT = (0.2, 1000.0)
TOLERANCE = 0.02
# If no filter is stated, it is assumed to be at worst a Bessel filter of this order whose cutoff is
# this fraction of the sample rate.
ASSUMED_ORDER = 4
ASSUMED_CUTOFF = 0.25
# Change of a level per relative change of a force, dB.
AMPLITUDE_DECIBEL = 20 / math.log(10)
# Effect on an octave above which a correction that the record does not confirm is a warning, dB.
MIN_WARNED = 0.1
# Length of the spectrum of a pulse, in lengths of the pulse: the lowest band holds three lines.
PADDING = 16
# Contributions to the uncertainty; those of instruments that are not stated are half the width of
# a rectangular distribution.
CALIBRATION = "calibration"
ASSUMED_PLATE, ASSUMED_SHARE, ASSUMED_FILTER = ASSUMED = (
    "plate, assumed",
    "share of the plate's resonance, assumed",
    "recorder filter, assumed",
)
# Share of a resonance in the static response that may be instead of the whole, if it is not stated.
MIN_SHARE = 0.5


def _to_linearity(name: str, value: object) -> tuple[tuple[float, float], ...]:
    """Return pairs of an applied and an indicated force, N."""
    pairs = value if isinstance(value, list | tuple) else []
    if len(pairs) < 2:  # noqa: PLR2004
        refuse_value(name, value, "two or more pairs [applied, indicated], N")
    return tuple(require_pair(name, pair, "[applied, indicated]", 1e-3, 1e9) for pair in pairs)


def plate_response(
    frequency: NDArray[np.float64], f0: float, quality: float, share: float = 1.0
) -> NDArray[np.complex128]:
    """Return the ratio of measured and applied force of a resonance, at frequencies in Hz."""
    ratio = frequency / f0
    return np.asarray(1 + share * (1 / (1 - ratio**2 + 1j * ratio / quality) - 1))


def filter_response(
    frequency: NDArray[np.float64], kind: str, order: int, cutoff: float
) -> NDArray[np.complex128]:
    """Return the ratio of output and input of a low-pass filter, at frequencies in Hz."""
    # SciPy is slow to import, and a configuration is read by every command.
    from scipy.signal import bessel, butter, freqs_zpk

    if kind == "bessel":
        zpk = bessel(order, cutoff, analog=True, output="zpk", norm="mag")
    else:
        zpk = butter(order, cutoff, analog=True, output="zpk")
    return np.asarray(freqs_zpk(*zpk, worN=frequency)[1])


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
        return plate_response(frequency, self.f0, self.Q, self.share or 1.0)

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
        return filter_response(frequency, self.kind, self.order or 1, self.cutoff)

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


def correct(section: Section, *instruments: Plate | RecorderFilter | None) -> Section:
    """Return a section of the applied force, and of its bounce, with notes on the instruments.

    Those that are None are not stated, or flat. Faults must be repaired before: a spike would ring
    in the correction.
    """
    chain = Chain(tuple(instrument for instrument in instruments if instrument is not None))
    if not chain.instruments:
        return section
    rate = section.sample_rate
    return replace(
        section,
        force=correct_force(section.force, rate, chain),
        bounce=section.bounce and correct(section.bounce, *instruments),
        chain=chain,
        notes=(*section.notes, *(instrument.note(rate) for instrument in chain.instruments)),
    )


class Effect(NamedTuple):
    """How the recorded force may differ from the applied one by an instrument.

    Attributes are the contribution to the uncertainty, the gain, a function of frequencies in Hz,
    and the code of the warning if the instrument is assumed.
    """

    name: str
    gain: Gain
    code: str = ""


def find_effects(drops: Sequence[Drop], config: Config) -> list[Effect]:
    """Return how the recorded force in drops may differ from the applied one."""
    plate, recorder = config.corrected
    effects = []
    if plate and plate.f0_uncertainty:
        higher = replace(plate, f0=plate.f0 * (1 + plate.f0_uncertainty))
        effects.append(Effect("plate", lambda f: higher.response(f) / plate.response(f)))
    if recorder and recorder.cutoff_uncertainty:
        shifted = replace(recorder, cutoff=recorder.cutoff * (1 + recorder.cutoff_uncertainty))
        gain: Gain = lambda f: shifted.response(f) / recorder.response(f)  # noqa: E731
        effects.append(Effect("recorder filter", gain))
    seen = {drop.plate_recorded for drop in drops}
    if plate is None:
        ringing = [(drop.ringing.frequency, drop.ringing.quality) for drop in drops if drop.ringing]
        limit = config.plate.flat_limit if config.plate else None
        # Else a mass on a spring that is TOLERANCE off at the limit of its flat response.
        worst = ((limit or FLAT[1]) * math.sqrt(1 + 1 / TOLERANCE), 100.0)
        code = "plate_estimated" if ringing else "" if limit else "plate_assumed"
        f0, quality = np.median(ringing or [worst], axis=0)
        effects.append(Effect(ASSUMED_PLATE, lambda f: 1 / plate_response(f, f0, quality), code))
    elif False in seen and True not in seen:
        effects.append(Effect(ASSUMED_PLATE, plate.response, "plate_not_recorded"))
    if plate and plate.share is None:
        # A force that was corrected for the whole share is multiplied by it.
        smaller = replace(plate, share=MIN_SHARE)
        gain = lambda f: plate.response(f) / smaller.response(f)  # noqa: E731
        effects.append(Effect(ASSUMED_SHARE, gain, "share_assumed"))
    if config.filter is None:
        cutoff = ASSUMED_CUTOFF * min(drop.contact.effective_rate for drop in drops)
        gain = lambda f: filter_response(f, "bessel", ASSUMED_ORDER, cutoff)  # noqa: E731
        effects.append(Effect(ASSUMED_FILTER, gain, "filter_assumed"))
    return effects


def instrument_uncertainties(
    drops: Sequence[Drop], config: Config, calibration: float | None, bands: BandSet = "octave"
) -> dict[str, NDArray[np.float64]]:
    """Return the standard uncertainties of the levels by the instruments, dB, shape (n_band,).

    They are by their names; `calibration` is the relative standard uncertainty of the force.
    """
    gains = {effect.name: effect.gain for effect in find_effects(drops, config)}
    changes = mean_level_changes(drops, gains, bands)
    stated = np.full(len(get_bands(bands).nominal), AMPLITUDE_DECIBEL * (calibration or 0.0))
    return {CALIBRATION: stated} | {
        name: np.abs(change) / (RECTANGULAR if name in ASSUMED else 1.0)
        for name, change in changes.items()
    }


def mean_level_changes(
    drops: Sequence[Drop], gains: Mapping[str, Gain], bands: BandSet = "octave"
) -> dict[str, NDArray[np.float64]]:
    """Return the changes of the mean level of drops by gains of the force, dB, shape (n_band,)."""
    from scipy.fft import next_fast_len

    edges = get_bands(bands)
    before = np.zeros(len(edges.nominal))
    after = {name: before.copy() for name in gains}
    contacts = [drop.contact for drop in drops]
    for rate in {contact.sample_rate for contact in contacts}:
        forces = [contact.gated for contact in contacts if contact.sample_rate == rate]
        length = next_fast_len(PADDING * max(map(len, forces)), real=True)
        energy = np.sum([np.abs(np.fft.rfft(force, length)) ** 2 for force in forces], axis=0)
        energy /= rate * length
        frequency = np.asarray(np.fft.rfftfreq(length, 1 / rate), dtype=np.float64)
        first, stop = np.searchsorted(frequency, [edges.lower, edges.upper])
        below = np.append(0.0, np.cumsum(energy))
        before += below[stop] - below[first]
        for name, gain in gains.items():
            below = np.append(0.0, np.cumsum(energy * np.abs(gain(frequency)) ** 2))
            after[name] += below[stop] - below[first]
    with np.errstate(invalid="ignore"):  # a band above half the rate
        return {name: 10 * np.log10(values / before) for name, values in after.items()}


def check_instruments(
    drops: Sequence[Drop], config: Config, uncertainties: Mapping[str, NDArray[np.float64]]
) -> list[Note]:
    """Return a warning for each assumption on the instruments that matters.

    `uncertainties` are those of `instrument_uncertainties` in octaves.
    """
    (plate, _), nominal = config.corrected, get_bands("octave").nominal
    notes = []
    for name, _, code in find_effects(drops, config):
        if code:
            half_widths = RECTANGULAR * uncertainties[name]
            band = int(np.nanargmax(half_widths))
            others = {
                "band": float(nominal[band]),
                "percent": 100 * TOLERANCE,
                "frequency": plate.f0 if plate else FLAT[1],
            }
            notes.append(Note(code, value=float(half_widths[band]), unit="dB", others=others))
    rate, nominal_rate = min(
        (drop.contact.effective_rate, drop.contact.sample_rate) for drop in drops
    )
    if config.filter is None and rate < nominal_rate:
        notes.append(Note("noise_ends", value=rate / 4, unit="Hz"))
    limit = config.plate.flat_limit if config.plate else None
    if limit is not None and limit < FLAT[1]:
        notes.append(Note("plate_not_flat", value=limit, low=FLAT[1], unit="Hz"))
    if plate and {drop.plate_recorded for drop in drops} == {None}:
        change = np.nanmax(np.abs(mean_level_changes(drops, {"": plate.response})[""]))
        if change > MIN_WARNED:
            others = {"frequency": plate.f0}
            notes.append(Note("plate_unclear", value=float(change), unit="dB", others=others))
    return notes
