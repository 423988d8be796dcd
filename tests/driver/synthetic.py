"""Synthetic recordings: pulses of known truth with the faults that recordings have."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

import thud
from thud.level.estimate import UNKNOWN, Estimate
from thud.recordings.background import Background, remove_background, uniform_cells
from thud.recordings.config import Config
from thud.recordings.contact import Contact, find_contact
from thud.recordings.drops import Section, cut_section, find_drops
from thud.recordings.measured_drop import Drop
from thud.recordings.signal import Signal

if TYPE_CHECKING:
    from collections.abc import Iterable

    from thud.level.estimate import Contribution
    from thud.recordings.instruments import Plate, RecorderFilter

# Exponents of the power spectra of noise.
COLOURS = {"white": 0, "pink": 1, "brown": 2}
# Below this, Hz, the spectra of coloured noise are even.
FLAT_BELOW = 1.0


def coloured_noise(
    n: int, rate: float, deviation: float, colour: str, rng: np.random.Generator
) -> np.ndarray:
    """Return noise of an expected standard deviation from 1 Hz to half the rate."""
    if n == 0:
        return np.zeros(0)
    power = COLOURS[colour]
    if power == 0:
        return rng.normal(0, deviation, n)
    # Ten seconds: slow parts are drawn from a longer record than is kept.
    length = 2 * max(n, int(5 * rate))
    frequency = np.fft.rfftfreq(length, 1 / rate)
    density = 1 / np.maximum(frequency, FLAT_BELOW) ** power
    density *= deviation**2 / (density.sum() * rate / length)
    draws = rng.normal(size=(2, len(frequency)))
    spectrum = (draws[0] + 1j * draws[1]) * np.sqrt(density * rate * length / 4)
    start = int(rng.integers(0, length - n))
    return np.fft.irfft(spectrum, length)[start : start + n]


def noise_density(rate: float, deviation: float, colour: str) -> float:
    """Return the one-sided density at 1 Hz, N2/Hz, of `coloured_noise`."""
    half = rate / 2
    integral = {"white": half, "pink": 1 + np.log(half), "brown": 2 - 1 / half}[colour]
    return deviation**2 / integral


def band_limited(
    force: np.ndarray, sample_rate: float, rate: float, time: np.ndarray
) -> np.ndarray:
    """Return a pulse at times, s, what is above half of a rate removed.

    The low-pass is a raised cosine between 0.4 and 0.5 of the rate: an anti-aliasing filter.
    """
    length = 1 << int(np.ceil(np.log2(2 * len(force) + 8)))
    spectrum = np.fft.rfft(force, length)
    frequency = np.fft.rfftfreq(length, 1 / sample_rate)
    if rate < sample_rate:
        edge = np.clip((frequency / rate - 0.4) / 0.1, 0, 1)
        spectrum *= 0.5 + 0.5 * np.cos(np.pi * edge)
    # Eight times as many samples, between which a line misses by less than 1e-3 of a step.
    fine = 8 * np.fft.irfft(spectrum, 8 * length)
    places = np.arange(-4 * len(force), 12 * len(force))
    grid, fine = places / (8 * sample_rate), fine[places]
    return np.interp(time, grid, fine, left=0.0, right=0.0)


def half_sine(
    rate: float, start: float, n: int, peak: float = 1500.0, duration: float = 0.02
) -> np.ndarray:
    """Return samples of a half-sine pulse that starts `start` s after the first."""
    time = np.arange(n) / rate - start
    return np.where((time > 0) & (time < duration), peak * np.sin(np.pi * time / duration), 0.0)


# Amplitudes of the harmonics of hum, over the first.
HARMONICS = (1.0, 0.5, 0.3)


def make_recording(  # noqa: PLR0913 - each is one fault
    force: np.ndarray,
    sample_rate: float,
    *,
    rate: float | None = None,
    noise_db: float = np.inf,
    colour: str = "white",
    offset: float = 0.0,
    drift: float = 0.0,
    hum: tuple[float, float] = (50.0, 0.0),
    before: float = 0.1,
    after: float = 0.1,
    seed: int = 0,
    drops: tuple[tuple[float, float], ...] = ((0.0, 1.0),),
) -> tuple[np.ndarray, np.ndarray]:
    """Return a recording, N, and the force in it without faults.

    Parameters
    ----------
    force
        A pulse that starts at first touch, N, at `sample_rate`; its contact ends with it.
    rate
        Rate of the recording, Hz; points of the pulse are interpolated.
    before, after
        Quiet before the first touch and after the end of the last pulse, s.
    drops
        Time of each first touch since the first, s, and the factor of its force.
    """
    rng = np.random.default_rng(seed)
    rate = rate or sample_rate
    duration = (len(force) - 1) / sample_rate
    n = int((before + drops[-1][0] + duration + after) * rate)
    time = np.arange(n) / rate - before
    grid = np.arange(len(force)) / sample_rate
    clean = np.zeros(n)
    for start, factor in drops:
        clean += factor * np.interp(time - start, grid, force, left=0.0, right=0.0)
    recording = clean + offset + drift * time
    frequency, amplitude = hum
    for k, part in enumerate(HARMONICS, start=1):
        phase = rng.uniform(0, 2 * np.pi)
        recording += amplitude * part * np.sin(2 * np.pi * k * frequency * time + phase)
    deviation = float(np.max(force)) * 10 ** (-noise_db / 20)
    return recording + coloured_noise(n, rate, deviation, colour, rng), clean


# A half-sine of 1500 N and 20 ms, N, its rate, Hz, and the closed form of its levels, dB.
FINE = 192e3
HALF_SINE = half_sine(FINE, 0.0, 3842)
LEVELS = np.array([38.3125, 30.6046, 19.2578, 8.9323, -0.4390])
# It is above 1 % of its peak for this time, s.
ABOVE = 0.02 * (1 - 2 * np.arcsin(0.01) / np.pi)


def half_sines(
    rate: float,
    noise_db: float,
    *drops: tuple[float, float],
    **how: Any,  # noqa: ANN401
) -> np.ndarray:
    """Return a recording of a half-sine and further ones, N; see `make_recording`."""
    several = ((0.0, 1.0), *drops)
    return make_recording(HALF_SINE, FINE, rate=rate, noise_db=noise_db, drops=several, **how)[0]


def make_drop(  # noqa: PLR0913 - what a recording may be
    deviation: float = 0.0, rate: float = 25600.0, *, before: float = 0.1, after: float = 0.1,
    seed: int = 0, density: float | None = None,
) -> Drop:  # fmt: skip
    """Return a half-sine with white noise, known by its density, whose offset was removed."""
    time = (np.arange(round((before + 0.02 + after) * rate)) - round(before * rate)) / rate
    noise = np.random.default_rng(seed).normal(scale=deviation, size=len(time))
    quiet = (time < 0) | (time > 0.02)
    if deviation:
        noise -= noise[quiet].mean()
    gate = (round(before * rate) - 4, round((before + 0.02) * rate) + 5)
    variances = np.array([max(density or 2 * deviation**2 / rate, 1e-30), 0, 0, 0, 0])
    # The offset of white noise, from all the quiet.
    n_cell = len(uniform_cells(*gate, rate)[0])
    offset = np.full((n_cell, n_cell), variances[0] / 2 * rate / quiet.sum())
    touch, release = Estimate(before, 0), Estimate(before + 0.02, 0)
    force = half_sine(rate, before, len(time)) + noise
    return Drop(
        name=f"drop {seed + 1}", onset=before,
        contact=Contact(
            touch, release, touch, release, 0, force,
            np.zeros(len(time)), gate, offset,
            Background((np.zeros(1), np.ones(1)), np.zeros(1), variances, 1500.0), rate,
        ),
        contact_time=Estimate(0.02, 0), restitution=UNKNOWN, peak_force=Estimate(1500, 0),
        impulse=UNKNOWN, effective_mass=UNKNOWN,
    )  # fmt: skip


def cut_drops(signal: Signal) -> list[Section]:
    """Return the sections of the drops in a signal."""
    return [cut_section(signal, pulse) for pulse in find_drops(signal)[0]]


def only_section(force: np.ndarray, rate: float, **signal: Any) -> Section:  # noqa: ANN401
    """Return the section of the only drop in a force, N; a signal may have more properties."""
    (section,) = cut_drops(replace(Signal.from_array(force, rate, "file.wav"), **signal))
    return section


def recording_of(force: np.ndarray, rate: float, **stated: Any) -> thud.Recording:  # noqa: ANN401
    """Return the recording of a force, N, with what is stated of it."""
    return thud.read_recording(Signal.from_array(force, rate, "file.wav"), config=Config(**stated))


def parts(contributions: Iterable[Contribution]) -> dict[str, float]:
    """Return the uncertainties of contributions by name."""
    return {part.name: part.uncertainty for part in contributions}


def with_force(drop: Drop, force: np.ndarray, white: float | None = None) -> Drop:
    """Return a drop with another force, N, and another density of white noise, N2/Hz."""
    contact = replace(drop.contact, force=force)
    if white is not None:
        variances = np.array([white, *contact.background.variances[1:]])
        contact = replace(contact, background=replace(contact.background, variances=variances))
    return replace(drop, contact=contact)


def uncertain_contact(ratio: float) -> tuple[Section, Contact]:
    """Return a contact whose time has a ratio to its uncertainty, of begin and end alike."""
    section = only_section(half_sine(24e3, 0.1, 5300) + 5.0, 24e3)
    contact = find_contact(section, *remove_background(section))
    deviation = (contact.end.value - contact.begin.value) / ratio / np.sqrt(2)
    ends = {n: replace(getattr(contact, n), uncertainty=deviation) for n in ("begin", "end")}
    return section, replace(contact, **ends)


def felt(force: np.ndarray, rate: float, instrument: Plate | RecorderFilter) -> np.ndarray:
    """Return a force after an instrument, by its response to the spectrum of the force."""
    length = 2**17
    frequency = np.fft.rfftfreq(length, 1 / rate)
    spectrum = np.fft.rfft(force, length) * instrument.response(frequency)
    return np.fft.irfft(spectrum, length)[: len(force)]
