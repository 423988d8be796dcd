"""Model of a recorder: pulses with known levels, and the chain from force plate to file.

It shares nothing with thud but the definitions of the measured quantities. Pulses are sums of terms
with closed transforms, from which their levels, impulse and peak follow. Plate and filters are
applied in the frequency domain on a fine grid, of which the record takes every n-th sample.
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import scipy.fft
import scipy.optimize
import scipy.signal
import scipy.special
import soundfile

sys.path.insert(0, str(Path(__file__).parents[1] / "driver"))
from synthetic import coloured_noise

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]
    Complex = NDArray[np.complex128]

GRAVITY = 9.81
# Exact mid-band frequencies of the octaves 31.5 to 500 Hz, Hz (base 10), and the ratio of an edge.
MIDDLES = 1000 * 10 ** (0.3 * np.arange(-5, 0))
EDGE = 10**0.15
# Limit of the force of which the peak is reported, Hz, and threshold of the contact time.
LIMIT, THRESHOLD = 1250.0, 0.01
# Width of the moving average of the force in this definition, s.
WIDTH = 1e-4
# Least level of the octave of 250 Hz, dB.
MIN_LEVEL = 6.0
# Least rate of the grid on which the chain is computed, Hz, and its length around a pulse, s.
FINE_RATE = 200_000.0
BEFORE, AFTER = 0.05, 0.45
# Colours of noise by the negative slope of their spectra.
COLOURS = ("white", "pink", "brown")


# --- pulses -----------------------------------------------------------------------------------

# Terms of a pulse: the force at times, s, from first touch to the end, and the integral of force
# times exp(-2 pi i f t), in closed form.


@dataclass(frozen=True)
class SinePower:
    """sin(pi t / duration) to a power."""

    duration: float
    power: float

    def force(self, time: Array) -> Array:
        """Return the force at times, s."""
        return np.sin(np.pi * np.clip(time / self.duration, 0, 1)) ** self.power

    def transform(self, frequency: Array) -> Complex:
        """Return the transform by gamma functions (Gradshteyn and Ryzhik, 3.892.1)."""
        p, turns = self.power, frequency * self.duration
        gammas = scipy.special.gamma(1 + p / 2 + turns) * scipy.special.gamma(1 + p / 2 - turns)
        size = self.duration * scipy.special.gamma(p + 1) / 2**p / gammas
        return np.asarray(size * np.exp(-1j * np.pi * turns))


@dataclass(frozen=True)
class Skewed:
    """x**a (1 - x)**b exp(-c x) with x = t / duration: beta pulse, and gamma pulse that ends."""

    duration: float
    a: float
    b: float
    c: float = 0.0

    def force(self, time: Array) -> Array:
        """Return the force at times, s."""
        x = np.clip(time / self.duration, 0, 1)
        return x**self.a * (1 - x) ** self.b * np.exp(-self.c * x)

    def transform(self, frequency: Array) -> Complex:
        """Return the transform by Kummer's function."""
        z = -self.c - 2j * np.pi * np.asarray(frequency) * self.duration
        size = self.duration * scipy.special.beta(self.a + 1, self.b + 1)
        return np.asarray(size * scipy.special.hyp1f1(self.a + 1, self.a + self.b + 2, z))


@dataclass(frozen=True)
class Cosine:
    """Raised cosine around a time, or a tone burst with this envelope."""

    middle: float
    width: float
    frequency: float = 0.0
    phase: float = 0.0

    def force(self, time: Array) -> Array:
        """Return the force at times, s."""
        late = time - self.middle
        envelope = np.where(
            np.abs(late) < self.width / 2, 0.5 + 0.5 * np.cos(2 * np.pi * late / self.width), 0
        )
        return envelope * np.cos(2 * np.pi * self.frequency * late + self.phase)

    def transform(self, frequency: Array) -> Complex:
        """Return the transform: shifted transforms of the envelope, each of three sincs."""

        def envelope(f: Array) -> Array:
            turns = f * self.width
            sides = np.sinc(turns - 1) + np.sinc(turns + 1)
            return self.width * (np.sinc(turns) / 2 + sides / 4)

        up = np.exp(1j * self.phase) * envelope(frequency - self.frequency)
        down = np.exp(-1j * self.phase) * envelope(frequency + self.frequency)
        return np.asarray((up + down) / 2 * np.exp(-2j * np.pi * frequency * self.middle))


Term = SinePower | Skewed | Cosine


@lru_cache
def gauss(count: int) -> tuple[Array, Array]:
    """Return nodes and weights of Gauss and Legendre on 0 to 1."""
    nodes, weights = np.polynomial.legendre.leggauss(count)
    return (nodes + 1) / 2, weights / 2


def panels(edges: Array, count: int) -> tuple[Array, Array]:
    """Return nodes and weights of a composite rule."""
    nodes, weights = gauss(count)
    width = np.diff(edges)
    return (edges[:-1, None] + width[:, None] * nodes).ravel(), np.outer(width, weights).ravel()


@dataclass(frozen=True)
class Pulse:
    """Force of one contact, N, from first touch to release: amplitudes and terms."""

    duration: float
    terms: tuple[tuple[float, Term], ...]

    def force(self, time: Array) -> Array:
        """Return the force at times from first touch, s."""
        total = sum(amplitude * term.force(time) for amplitude, term in self.terms)
        return np.where((time > 0) & (time < self.duration), total, 0.0)

    def scaled(self, factor: float, stretch: float = 1.0) -> Pulse:
        """Return the pulse times a factor, and stretched in time."""
        longer = tuple((factor * size, _stretched(term, stretch)) for size, term in self.terms)
        return Pulse(self.duration * stretch, longer)

    def transform(self, frequency: Array) -> Complex:
        """Return the transform in closed form, N s."""
        return np.asarray(sum(a * term.transform(frequency) for a, term in self.terms))

    def levels(self) -> Array:
        """Return the force exposure levels in the octaves, dB re 1 N and 1 s."""
        ends = np.append(MIDDLES / EDGE, MIDDLES[-1] * EDGE)
        nodes, weights = panels(ends, 24)
        energy = 2 * weights * np.abs(self.transform(nodes)) ** 2
        return 10 * np.log10(energy.reshape(len(MIDDLES), -1).sum(1))

    @property
    def impulse(self) -> float:
        """Time integral, N s."""
        return float(self.transform(np.zeros(1))[0].real)

    def contact(self) -> tuple[float, float]:
        """Return the first and the last time at 1 % of the peak, s from first touch.

        The force is averaged over 0.1 ms within the contact.
        """
        time = np.linspace(0, self.duration, 20_001)
        force = self.force(time)
        threshold = THRESHOLD * force.max()

        def above(t: float) -> float:
            nodes, weights = gauss(8)
            begin, end = max(t - WIDTH / 2, 0), min(t + WIDTH / 2, self.duration)
            return float(weights @ self.force(begin + (end - begin) * nodes)) - threshold

        inside = np.flatnonzero(force > threshold)
        ends = []
        for index, outside in ((inside[0], 0.0), (inside[-1], self.duration)):
            # A force that rises by more than 1 % within half the width is above it from its begin.
            is_jump = above(outside) >= 0
            ends.append(outside if is_jump else scipy.optimize.brentq(above, outside, time[index]))
        return float(ends[0]), float(ends[1])

    def peak(self) -> float:
        """Return the maximum of the force below 1.25 kHz, N."""
        nodes, weights = panels(np.linspace(0, LIMIT, 13), 24)
        spectrum = 2 * weights * self.transform(nodes)
        time = np.linspace(0, self.duration, 2001)
        return float((np.exp(2j * np.pi * np.outer(time, nodes)) @ spectrum).real.max())


def _stretched(term: Term, factor: float) -> Term:
    if not isinstance(term, Cosine):
        return replace(term, duration=term.duration * factor)
    return Cosine(term.middle * factor, term.width * factor, term.frequency / factor, term.phase)


def half_cosine(duration: float, peak: float) -> Pulse:
    """Return a tap: a single raised cosine."""
    return Pulse(duration, ((peak, Cosine(duration / 2, duration)),))


# --- drops ------------------------------------------------------------------------------------

KINDS = ("sine", "beta", "gamma", "cosines", "hertz", "exponential")
# Ranges of duration, s, and of the parameters of `Skewed` by kind.
SKEWED = {
    "beta": ((0.018, 0.024), (0.9, 1.3), (1.2, 1.8), (0.0, 0.0)),
    "gamma": ((0.020, 0.026), (0.9, 1.3), (1.3, 1.7), (0.5, 2.0)),
    "hertz": ((0.020, 0.026), (1.5, 1.5), (1.5, 1.7), (0.0, 1.0)),
}


def _base(kind: str, rng: np.random.Generator) -> Pulse:
    """Return a pulse of a kind without ripple, of arbitrary size."""
    draw = rng.uniform
    terms: list[tuple[float, Term]]
    if kind in SKEWED:
        duration, *powers = (draw(*ends) for ends in SKEWED[kind])
        terms = [(1.0, Skewed(duration, *powers))]
    elif kind == "sine":
        duration = draw(0.0165, 0.022)
        terms = [(1.0, SinePower(duration, draw(1.0, 1.4)))]
    elif kind == "cosines":
        duration = draw(0.022, 0.027)
        second = Cosine(draw(0.3, 0.4) * duration, draw(0.35, 0.5) * duration)
        terms = [(1.0, Cosine(duration / 2, duration)), (draw(0.15, 0.35), second)]
    else:
        duration, power, slow = draw(0.019, 0.024), draw(1.0, 1.3), draw(0.6, 1.4)
        rise = Skewed(duration, 0.0, power, slow + draw(7, 14))
        terms = [(1.0, Skewed(duration, 0.0, power, slow)), (-1.0, rise)]
    return Pulse(duration, tuple(terms))


def random_pulse(kind: str, impulse: float, rng: np.random.Generator) -> Pulse:
    """Return a pulse of a kind and an impulse, N s, with ripple, a burst.

    Pulses with a negative force, with less than 6 dB in the octave of 250 Hz, or with other than 8
    to 15 dB in that of 500 Hz, are drawn again.
    """
    while True:
        base = _base(kind, rng)
        base = base.scaled(impulse / base.impulse)
        width = rng.uniform(0.005, 0.010)
        middle = rng.uniform(max(0.3 * base.duration, width / 2), 0.5 * base.duration)
        ripple = Cosine(middle, width, rng.uniform(300, 600), rng.uniform(0, 2 * np.pi))
        pulse = Pulse(base.duration, (*base.terms, (rng.uniform(30, 300), ripple)))
        pulse = pulse.scaled(impulse / pulse.impulse)
        force, levels = pulse.force(np.linspace(0, pulse.duration, 801)), pulse.levels()
        is_ball = force.min() >= 0 and 900 < force.max() < 3000
        if is_ball and levels[-2] > MIN_LEVEL and 8 < levels[-1] < 15:
            return pulse


@dataclass(frozen=True)
class Ball:
    """Ball and drop: kg, m, restitution, and what the center is lower by at release, m."""

    mass: float = 2.5
    height: float = 1.0
    restitution: float = 0.8
    deformation: float = 0.0

    @property
    def velocity(self) -> float:
        """Velocity at first touch, m/s."""
        return math.sqrt(2 * GRAVITY * self.height)


@dataclass(frozen=True)
class Truth:
    """True values of one drop, in SI units, levels in dB."""

    levels: Array
    contact_time: float
    restitution: float
    peak: float
    impulse: float


def drop_pulse(kind: str, ball: Ball, rng: np.random.Generator) -> tuple[Pulse, Truth]:
    """Return the pulse of a drop, whose impulse follows from mass and velocities."""
    momentum = ball.mass * ball.velocity * (1 + ball.restitution)
    pulse = random_pulse(kind, momentum, rng)
    pulse = pulse.scaled(1 + ball.mass * GRAVITY * pulse.duration / momentum)
    begin, end = pulse.contact()
    truth = Truth(pulse.levels(), end - begin, ball.restitution, pulse.peak(), pulse.impulse)
    return pulse, truth


def bounces(pulse: Pulse, ball: Ball, count: int) -> list[tuple[float, Pulse]]:
    """Return first touches, s after that of the drop, and pulses of the bounces that follow."""
    found = []
    touch, velocity, restitution, last = 0.0, ball.velocity, ball.restitution, pulse
    for _ in range(count):
        rebound = restitution * velocity
        landing = math.sqrt(rebound**2 - 2 * GRAVITY * ball.deformation)
        touch += last.duration + (rebound + landing) / GRAVITY
        restitution = min(restitution + 0.02, 0.95)
        stretch = (landing / ball.velocity) ** -0.1
        longer = pulse.scaled(1.0, stretch)
        momentum = ball.mass * (landing * (1 + restitution) + GRAVITY * longer.duration)
        last = longer.scaled(momentum / longer.impulse)
        velocity = landing
        found.append((touch, last))
    return found


# --- chain ------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Mode:
    """Mode of the plate: Hz, quality, and share of the static deformation."""

    frequency: float
    quality: float
    share: float = 1.0


def plate_response(modes: tuple[Mode, ...], frequency: Array) -> Complex:
    """Return measured over applied force; the shares add to one."""
    response = np.zeros(len(frequency), dtype=complex)
    for mode in modes:
        r = frequency / mode.frequency
        response += mode.share / (1 - r**2 + 1j * r / mode.quality)
    return response


DESIGNS = {
    "bessel": partial(scipy.signal.bessel, norm="mag"),
    "butterworth": scipy.signal.butter,
    "elliptic": lambda order, *more, **how: scipy.signal.ellip(order, 0.1, 80, *more, **how),
}


@dataclass(frozen=True)
class Filter:
    """Anti-aliasing filter: ``"bessel"``, ``"butterworth"``, ``"elliptic"`` or ``"fir"``.

    The cutoff, Hz, is that of 3 dB; of an elliptic filter (0.1 dB ripple, 80 dB) the edge of the
    passband; of a FIR filter of a delta-sigma converter the middle of its transition. The static
    response is one.
    """

    kind: str
    order: int
    cutoff: float

    def response(self, frequency: Array) -> Complex:
        """Return the response at frequencies, Hz."""
        relative = frequency / self.cutoff
        if self.kind == "fir":
            # Symmetric, so that its delay is taken out: a raised-cosine transition, 10 % wide.
            x = np.clip((np.abs(relative) - 0.907) / 0.186, 0, 1)
            return np.asarray(0.5 + 0.5 * np.cos(np.pi * x), dtype=complex)
        poles = DESIGNS[self.kind](self.order, 1.0, analog=True, output="zpk")
        static, response = (scipy.signal.freqs_zpk(*poles, w)[1] for w in (np.zeros(1), relative))
        return np.asarray(response / static)


@dataclass(frozen=True)
class Chain:
    """From plate to file."""

    rate: float = 51_200.0  # Hz
    modes: tuple[Mode, ...] = ()  # of the plate
    filter: Filter | None = None  # none: a FIR filter at half the rate
    time_constant: float = math.inf  # of the amplifier, s
    second_time_constant: float = math.inf  # s
    bits: int = 24  # of the converter
    full_scale: float = 10_000.0  # N
    # Deviation, N, and slope of the spectrum: 0 white, 1 pink, 2 brown.
    noises: tuple[tuple[float, float], ...] = ((0.5, 0.0),)
    offset: float = 20.0  # N
    drift: float = 0.0  # N/s
    hum: tuple[float, float] = (50.0, 0.0)  # Hz, and amplitude of the fundamental, N
    tremor: float = 0.0  # deviation of the vibration of the building at 5 to 12 Hz, N
    spikes: float = 0.0  # of one sample: mean number per second
    spike_size: float = 0.0  # N
    gain: float = 1.0  # indicated over true force
    negative: bool = False  # whether compression is negative in the file

    def response(self, frequency: Array) -> Complex:
        """Return the response of plate and filter at frequencies, Hz."""
        filter_ = self.filter or Filter("fir", 0, self.rate / 2)
        response = filter_.response(frequency)
        return response * plate_response(self.modes, frequency) if self.modes else response

    def pass_pulse(self, pulse: Pulse, touch: float) -> tuple[int, Array]:
        """Return the index of the first sample, and samples of a pulse that begins at a time."""
        factor = math.ceil(FINE_RATE / self.rate)
        fine = factor * self.rate
        first = math.floor((touch - BEFORE) * self.rate)
        length = scipy.fft.next_fast_len(int((BEFORE + AFTER) * fine), real=True)
        length += -length % factor
        time = first / self.rate + np.arange(length) / fine - touch
        frequency = np.fft.rfftfreq(length, 1 / fine)
        spectrum = scipy.fft.rfft(pulse.force(time)) * self.response(frequency)
        return first, scipy.fft.irfft(spectrum, length)[::factor]

    def pass_events(self, events: list[tuple[float, Pulse]], count: int) -> Array:
        """Return the first samples of pulses that begin at times, s, N."""
        force = np.zeros(count)
        for touch, event in events:
            first, samples = self.pass_pulse(event, touch)
            low, high = max(first, 0), min(first + len(samples), count)
            if low < high:
                force[low:high] += samples[low - first : high - first]
        return force


@dataclass(frozen=True)
class Scene:
    """What the plate and the recorder go through; times, s, count from first touch."""

    before: float = 0.3  # length of the record before first touch, s
    after: float = 0.3  # length after the last touch of the ball, s
    bounces: int = 1
    # Taps on the plate: time, s, duration, s, and peak, N.
    taps: tuple[tuple[float, float, float], ...] = ()
    # Loads: time, s, duration of the change, s, and change, N.
    loads: tuple[tuple[float, float, float], ...] = ()
    # Steps on the plate, of two humps each: time, s, duration, s, and force, N.
    treads: tuple[tuple[float, float, float], ...] = ()
    # Jump of the offset, N, at a part of the contact, over a part of it.
    step: tuple[float, float, float] = (0.0, 0.5, 0.0)


def _ramp(x: Array) -> Array:
    """Return a smooth rise from 0 to 1 where x goes from 0 to 1."""
    x = np.clip(x, 0, 1)
    return np.asarray(x**3 * (10 - 15 * x + 6 * x**2))


def tread(x: Array) -> Array:
    """Return a step of a foot with two humps, over its duration, of height one."""
    rise = _ramp(x / 0.25) * _ramp((1 - x) / 0.25)
    return np.asarray(rise * (1 - 0.25 * np.sin(np.pi * np.clip(x, 0, 1)) ** 8))


def plate_force(
    pulse: Pulse, ball: Ball, chain: Chain, scene: Scene, rng: np.random.Generator
) -> Array:
    """Return samples of the force behind plate and filter, N, without noise or droop."""
    landings = [(0.0, pulse), *bounces(pulse, ball, scene.bounces)]
    onset = scene.before + rng.uniform() / chain.rate
    events = [(onset + touch, landing) for touch, landing in landings]
    count = int((events[-1][0] + landings[-1][1].duration + scene.after) * chain.rate)
    events += [(onset + time, half_cosine(length, peak)) for time, length, peak in scene.taps]
    force = chain.pass_events(events, count)
    time = np.arange(count) / chain.rate - onset
    for begin, length, change in scene.loads:
        force += change * _ramp((time - begin) / length)
    for begin, length, size in scene.treads:
        force += size * tread((time - begin) / length)
    return force


def electric(
    force: Array, chain: Chain, scene: Scene, duration: float, rng: np.random.Generator
) -> Array:
    """Return what amplifier and surroundings make of a force, N; `duration` of the contact, s."""
    n, rate = len(force), chain.rate
    values = chain.gain * droop(force, rate, chain.time_constant)
    values = droop(values, rate, chain.second_time_constant)
    time = np.arange(n) / rate
    jump, where, width = scene.step
    if jump:
        begin = scene.before + where * duration
        values += jump * _ramp((time - begin) / max(width * duration, 1e-9))
    values += chain.offset + chain.drift * (time - scene.before)
    fundamental, amplitude = chain.hum
    if amplitude:
        fundamental += rng.uniform(-0.1, 0.1)
        for order, share in ((1, 1.0), (2, 0.15), (3, 0.3), (4, 0.05), (5, 0.1)):
            if order * fundamental < rate / 2:
                phase = 2 * np.pi * (order * fundamental * time + rng.uniform())
                values += amplitude * share * np.sin(phase)
    if chain.tremor:
        for frequency in rng.uniform(5, 12, 6):
            phase = 2 * np.pi * (frequency * time + rng.uniform())
            values += chain.tremor / math.sqrt(3) * np.sin(phase)
    for deviation, slope in chain.noises:
        if deviation:
            values += coloured_noise(n, rate, deviation, COLOURS[int(slope)], rng)
    if chain.spikes:
        where = np.flatnonzero(rng.uniform(size=n) < chain.spikes / rate)
        values[where] += chain.spike_size * rng.choice([-1, 1], len(where))
    return values


def droop(force: Array, rate: float, time_constant: float) -> Array:
    """Return a force behind a high-pass of the first order, from rest at the first sample."""
    if math.isinf(time_constant):
        return force.copy()
    ratio = 1 / (2 * time_constant * rate)
    # The charge that leaks, by the trapezoidal rule.
    leak = scipy.signal.lfilter(
        np.array([ratio, ratio]) / (1 + ratio), [1, -(1 - ratio) / (1 + ratio)], force
    )
    return np.asarray(force - leak)


def convert(values: Array, chain: Chain) -> NDArray[np.int64]:
    """Return the codes of the converter for forces, N."""
    top = 2 ** (chain.bits - 1)
    codes = np.rint((-values if chain.negative else values) / chain.full_scale * top)
    return np.clip(codes, -top, top - 1).astype(np.int64)


def write_sound(path: Path, codes: NDArray[np.int64], chain: Chain) -> Path:
    """Write codes, shape (n_sample,) or (n_sample, n_channel), as a WAV file of full scale."""
    bits = 16 if chain.bits <= 16 else 24
    kind, width = (np.int16, 16) if bits == 16 else (np.int32, 32)
    shifted = (codes << (width - chain.bits)).astype(kind)
    soundfile.write(path, shifted, round(chain.rate), f"PCM_{bits}")
    return path


def write_table(path: Path, columns: dict[str, Array], rate: float) -> Path:
    """Write columns with their titles as a table with times."""
    count = len(next(iter(columns.values())))
    table = np.column_stack([np.arange(count) / rate, *columns.values()])
    formats = ["%.9f", *["%.9g"] * len(columns)]
    np.savetxt(path, table, formats, ",", header=",".join(["Time [s]", *columns]), comments="")
    return path


# --- load cells -------------------------------------------------------------------------------


@dataclass(frozen=True)
class Cells:
    """Four load cells under the plate: V/N of each, V of offset, and where the ball lands."""

    sensitivities: tuple[float, ...] = (0.004, 0.00385, 0.0042, 0.0041)
    offsets: tuple[float, ...] = (0.02, -0.01, 0.05, 0.0)
    position: tuple[float, float] = (0.1, -0.15)

    def shares(self) -> Array:
        """Return the part of the force on each cell; they add to one."""
        x, y = self.position
        return np.array([(1 + sx * x) * (1 + sy * y) / 4 for sx in (-1, 1) for sy in (-1, 1)])

    def volts(self, force: Array, chain: Chain, rng: np.random.Generator) -> Array:
        """Return the voltages of the cells, shape (4, n_sample), with noise of their own."""
        deviation = sum(size for size, _ in chain.noises) / 2
        noise = [coloured_noise(len(force), chain.rate, deviation, "white", rng) for _ in range(4)]
        forces = self.shares()[:, None] * force + np.array(noise)
        return np.array(self.sensitivities)[:, None] * forces + np.array(self.offsets)[:, None]


# --- calibration ------------------------------------------------------------------------------


@dataclass(frozen=True)
class Weight:
    """Record of a known mass put on and taken off: kg, and times in s; zero time: never."""

    mass: float = 10.0
    on: float = 3.0
    off: float = 0.0
    end: float = 8.0
    rise: float = 0.15
    knock: float = 20.0


def weight_record(weight: Weight, chain: Chain, rng: np.random.Generator) -> Array:
    """Return the record of a known mass, N, in samples of the chain's rate."""
    n = int(weight.end * chain.rate)
    time = np.arange(n) / chain.rate
    load = weight.mass * GRAVITY
    force = load * _ramp((time - weight.on) / weight.rise)
    if weight.off:
        force -= load * _ramp((time - weight.off) / weight.rise)
    for begin in (weight.on + weight.rise, weight.off):
        if begin:
            late = np.maximum(time - begin, 0)
            force += weight.knock * np.exp(-late / 0.05) * np.sin(2 * np.pi * 12 * late)
    return electric(force, chain, Scene(), 0.0, rng)


def tap_record(
    taps: tuple[tuple[float, float], ...], chain: Chain, rng: np.random.Generator
) -> Array:
    """Return the record of taps with a hammer, each a duration, s, and a peak, N."""
    starts = (0.5 * k + rng.uniform() / chain.rate for k in range(1, len(taps) + 1))
    events = [(start, half_cosine(*tap)) for start, tap in zip(starts, taps, strict=True)]
    force = chain.pass_events(events, int(0.5 * (len(taps) + 1) * chain.rate))
    return electric(force, chain, Scene(), 0.0, rng)
