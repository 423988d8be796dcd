"""Conditions of the recorder model: what is recorded, with which fault, and what is stated."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cache
from itertools import product
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import scipy.signal
from recorder_model import KINDS, Cells, Chain, Filter, Mode, Scene, Weight

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray
    from recorder_model import Array

# Plate, amplifier and filter where a condition has no other: stated unless it is about them. Flat
# up to FLAT, Hz, and static.
FLAT = 20e3
STATIC = 1e6
# Groups whose faults may be refused: no measurement can be right, or known to be right.
REFUSABLE = {"clipping", "duplicates", "channels", "offset step", "calibrate", "samples"}


class Contact(NamedTuple):
    """Samples per second, first and stop index of the contact, and random numbers."""

    rate: float
    first: int
    stop: int
    rng: np.random.Generator

    def noise(self, values: Array) -> Array:
        """Return normal noise of deviation 1."""
        return self.rng.normal(size=len(values))


# Damages values, N.
Fault = Callable[["Array", Contact], "NDArray[Any]"]


@dataclass(frozen=True)
class Condition:
    """What is recorded, and what the configuration states of it."""

    group: str  # part of the campaign
    name: str
    is_stated: bool = True  # whether everything is stated
    chain: Chain = field(default_factory=Chain)
    scene: Scene = field(default_factory=Scene)
    kind: str = ""  # of the pulse; empty: each in turn
    ball: Mapping[str, float] = field(default_factory=dict)  # attributes that are not random
    config: Mapping[str, Any] = field(default_factory=dict)  # keys besides those of any recording
    # Standard uncertainties that are stated, and from which errors are drawn: calibration
    # (relative), mass, kg, height, m, f0 and cutoff of the filter (relative).
    uncertainties: Mapping[str, float] = field(default_factory=dict)
    cells: Cells | None = None  # load cells in channels of their own
    plate_stated: bool = True  # whether plate and filter are stated
    filter_stated: bool = True
    files: str = "one"  # or a kind of copies
    weight: Weight | None = None  # record of a mass for `calibrate` in place of a drop
    taps: tuple[tuple[float, float], ...] = ()  # for `calibrate --tap`: duration, s, and peak, N
    refusable: bool = False  # whether it may be refused, besides faults of `REFUSABLE`
    fault: Fault | None = None  # damages the samples
    cause: str = ""  # codes of warnings or words of refusals, one of which names the fault

    @property
    def drops(self) -> int:
        """Number of different drops in the files."""
        return {"two drops": 2, "five drops": 5}.get(self.files, 1)

    @property
    def may_be_refused(self) -> bool:
        """Whether a refusal is right."""
        return self.refusable or (not self.is_stated and self.group in REFUSABLE)


@cache
def conditions() -> tuple[Condition, ...]:
    """Return all conditions."""
    found: list[Condition] = []

    def add(group: str, name: str, **more: Any) -> None:  # noqa: ANN401 - of `Condition`
        found.append(Condition(group, name, **more))

    for part in _PARTS:
        part(add)
    return tuple(found)


def _surroundings(add: Callable[..., None]) -> None:
    """Add clean records, noise, hum, drift, spikes."""
    for kind, rate in product(KINDS, (8e3, 51.2e3)):
        add("clean", f"{kind}, {rate / 1e3:g} kHz", chain=Chain(rate), kind=kind)
    for rate in (2.5e3, 4e3, 10e3, 16e3, 25e3, 44.1e3, 96e3, 192e3):
        add("clean", f"{rate / 1e3:g} kHz", chain=Chain(rate))
    for slope, deviation in product((0.0, 1.0, 2.0), (0.2, 1.5, 5.0, 15.0, 50.0)):
        chain = Chain(25e3, noises=((deviation, slope),))
        add("noise", f"1/f{slope:g}, {deviation:g} N", chain=chain)
    for sizes in ((1.0, 2.0, 4.0), (5.0, 5.0, 5.0)):
        noises = tuple((size, float(slope)) for slope, size in enumerate(sizes))
        add("noise", f"white, pink, brown {sizes} N", chain=Chain(noises=noises))
    chains: dict[str, dict[str, Any]] = {
        **{f"hum {f:g} Hz, {a:g} N": {"hum": (f, a)}
           for f, a in product((50.0, 60.0), (2.0, 10.0, 60.0))},
        **{f"tremor {size:g} N": {"tremor": size} for size in (2.0, 10.0)},
        **{f"drift {size:g} N/s": {"drift": size} for size in (5.0, 50.0)},
        **{f"offset {size:g} N": {"offset": size} for size in (-300.0, 1000.0)},
        **{f"{rate:g} spikes/s of {size:g} N": {"spikes": rate, "spike_size": size}
           for rate, size in ((20.0, 50.0), (100.0, 20.0), (5.0, 300.0))},
    }  # fmt: skip
    for name, keys in chains.items():
        add("surroundings", name, chain=Chain(**keys))
    config = {"polarity": "negative"}
    add("surroundings", "negative", chain=Chain(negative=True), config=config)


def _instruments(add: Callable[..., None]) -> None:
    """Add droop, and plates that are stated or not."""
    for tau, is_stated in product((0.2, 0.5, 1.0, 2.0, 5.0, 20.0), (True, False)):
        config = {"plate": {"time_constant": tau if is_stated else STATIC}}
        name = f"time constant {tau:g} s{'' if is_stated else ', untold'}"
        add("droop", name, is_stated=is_stated, chain=Chain(25e3, time_constant=tau), config=config)

    def plate(*modes: Mode, rate: float = 51.2e3, **stated: float) -> dict[str, Any]:
        found = {"chain": Chain(rate, modes)} if modes else {}
        return found | ({"config": {"plate": stated}} if stated else {"plate_stated": False})

    known = {"uncertainties": {"f0": 0.003}}
    for f0, q in product((1050.0, 1200.0, 1600.0, 2100.0, 3000.0), (3.0, 8.0, 25.0, 60.0)):
        add("plate", f"{f0:g} Hz, Q {q:g}", **plate(Mode(f0, q), f0=f0, Q=q), **known)
    more = plate(Mode(1600.0, 25.0), rate=10e3, f0=1600.0, Q=25.0)
    add("plate", "1600 Hz, Q 25, 10 kHz", **more, **known)
    more = plate(Mode(900.0, 25.0), f0=900.0, Q=25.0)
    add("plate", "900 Hz, Q 25", **more, refusable=True)

    def unstated(name: str, more: dict[str, Any]) -> None:
        add("plate untold", name, is_stated=False, **more)

    for f0, q in product((900.0, 1000.0, 1200.0, 1600.0, 2200.0, 3000.0), (3.0, 8.0, 25.0, 60.0)):
        unstated(f"{f0:g} Hz, Q {q:g}", plate(Mode(f0, q)))
    for f0, q in ((1200.0, 10.0), (2000.0, 20.0), (3000.0, 30.0)):
        unstated(f"stated {f0:g} Hz not there", plate(f0=f0, Q=q, f0_uncertainty=0.005))
    for ratio in (0.9, 1.1):
        more = plate(Mode(1600.0, 25.0), f0=1600.0 * ratio, Q=25.0, f0_uncertainty=0.005)
        unstated(f"1600 Hz stated times {ratio:g}", more)
    for f1, f2, share in ((1600.0, 2700.0, 0.15), (1200.0, 1900.0, 0.3), (2000.0, 2600.0, -0.1)):
        modes = Mode(f1, 25.0, 1 - share), Mode(f2, 30.0, share)
        name = f"second mode {f2:g} Hz of {share:g}"
        unstated(name, plate(*modes, f0=f1, Q=25.0, f0_uncertainty=0.005))
        unstated(f"{name}, no plate stated", plate(*modes))
    unstated("1200 Hz, Q 8, 8 kHz", plate(Mode(1200.0, 8.0), rate=8e3))
    noisy = Chain(noises=((5.0, 0.0),), modes=(Mode(1200.0, 25.0),))
    unstated("1200 Hz, Q 25, noise 5 N", {"chain": noisy, "plate_stated": False})
    unstated("9 kHz, Q 30", plate(Mode(9000.0, 30.0)))
    unstated("flat, not stated", plate())


def _filters(add: Callable[..., None]) -> None:
    """Add filters that are stated or not, and converters."""
    cases = [(51.2e3, "bessel", 4, cutoff) for cutoff in (1.5e3, 2e3, 3e3, 5e3, 10e3)]
    cases += [(51.2e3, "butterworth", 4, cutoff) for cutoff in (1e3, 1.5e3, 2.5e3, 5e3)]
    cases += [(rate, "butterworth", 4, rate / 4) for rate in (2.5e3, 5e3, 10e3)]
    cases += [(51.2e3, "bessel", 2, 3e3), (51.2e3, "butterworth", 8, 1.2e3)]
    for rate, kind, order, cutoff in cases:
        chain = Chain(rate, filter=Filter(kind, order, cutoff))
        name = f"{kind} {order}, {cutoff:g} Hz, {rate / 1e3:g} kHz"
        config = {"filter": {"kind": kind, "order": order, "cutoff": cutoff}}
        add("filter", name, chain=chain, config=config, uncertainties={"cutoff": 0.005})
        add("filter untold", name, is_stated=False, chain=chain, filter_stated=False)
    chains = {f"flat, not stated, {rate / 1e3:g} kHz": Chain(rate) for rate in (2.5e3, 51.2e3)}
    for rate in (2.5e3, 5e3, 25e3):
        elliptic = Filter("elliptic", 6, 0.4 * rate)
        chains[f"elliptic 6, {rate / 1e3:g} kHz"] = Chain(rate, filter=elliptic)
    for name, chain in chains.items():
        add("filter untold", name, is_stated=False, chain=chain, filter_stated=False)

    few = Chain(25e3, full_scale=4e3, noises=((0.3, 0.0),))
    for full_scale, bits in product((4e3, 20e3), (8, 10, 12, 14, 16, 24)):
        chain = replace(few, bits=bits, full_scale=full_scale)
        add("quantization", f"{bits} bit, ±{full_scale / 1e3:g} kN", chain=chain)
    for bits in (8, 12):
        chain = Chain(bits=bits, full_scale=4e3, noises=((0.01, 0.0),), offset=0.0)
        add("quantization", f"{bits} bit, no noise, no offset", chain=chain)


def _samples(add: Callable[..., None]) -> None:
    """Add clipping, jumps of the offset, and faults of samples."""
    for scale in (900.0, 600.0):
        chain = Chain(full_scale=scale, offset=0.0)
        add("clipping", f"±{scale:g} N", is_stated=False, chain=chain)
    places = {"at the middle": (0.5, 0.0), "over the contact": (0.0, 1.0)}
    steps = [(size, *item) for size in (2.0, 15.0, 60.0, -30.0) for item in places.items()]
    steps += [(15.0, "at first touch", (0.0, 0.0)), (15.0, "at release", (1.0, 0.0))]
    for size, name, place in steps:
        add("offset step", f"{size:g} N {name}", is_stated=False, scene=Scene(step=(size, *place)))

    plain, quiet = Chain(25_600.0), Chain(25_600.0, noises=((0.3, 0.0),), offset=0.0)
    silent, held = "constant_background", "is held|constant_background"
    clipped = "drop_like_bounce|restitution_impossible|restitutions_differ"
    faults: dict[str, tuple[Fault, str, Chain]] = {
        "packets of 2 ms exchanged": (_exchange, "jump", plain),
        "3 ms held over the touch": (_hold, held, plain),
        "zero outside, offset 12 N": (_silence, silent, replace(quiet, offset=12.0)),
        "zero outside, offset 60 N": (_silence, silent, replace(quiet, offset=60.0)),
        "gate of 40 N": (lambda v, _: np.where(np.abs(v) < 40.0, 0.0, v), silent, quiet),
        "needles of 60 N": (_add_needles, "spikes", plain),
        "missing codes of 8 N": (lambda v, _: _codes(v) & ~8, held, quiet),
        "missing codes of 32 N": (lambda v, _: _codes(v) & ~32, held, quiet),
        "noise of 1 % of the force": (lambda v, at: v * (1 + 0.01 * at.noise(v)), "", plain),
        "noise of 5 % of the force": (lambda v, at: v * (1 + 0.05 * at.noise(v)), "", plain),
        "amplifier up to 900 N": (lambda v, _: 900.0 * np.tanh(v / 900.0), clipped, plain),
        "amplifier up to 500 N": (lambda v, _: 500.0 * np.tanh(v / 500.0), clipped, plain),
        "line over 3 ms": (_draw_line, "filled by a line|jump", plain),
    }
    filtered: dict[str, tuple[Fault, str, Chain]] = {
        "multiplexed cells": (_multiplex, "aliasing", plain),
        "multiplexed cells, 5 kHz": (_multiplex, "aliasing", Chain(5e3)),
        "2 kHz drawn up to 48 kHz": (_draw_up, "noise_ends", Chain(48e3)),
        "mean over 1 ms": (
            lambda v, _: np.convolve(v, np.full(25, 1 / 25), mode="same"), "noise_ends", plain
        ),
        "low-pass of 700 Hz": (
            lambda v, at: scipy.signal.sosfiltfilt(
                scipy.signal.butter(4, 700.0, fs=at.rate, output="sos"), v
            ), "noise_ends", plain,
        ),
    }  # fmt: skip
    scene = Scene(before=0.3, after=0.2, bounces=1)
    for stated, some in ((True, faults), (False, filtered)):
        for name, (fault, cause, chain) in some.items():
            add("samples", name, is_stated=False, chain=chain, scene=scene, fault=fault,
                cause=cause, filter_stated=stated)  # fmt: skip


def _codes(values: Array) -> NDArray[np.int64]:
    """Return whole newtons."""
    return np.rint(values).astype(np.int64)


def _exchange(values: Array, at: Contact) -> Array:
    """Exchange two packets of 2 ms of the contact."""
    size = int(2e-3 * at.rate)
    start = int(at.rng.integers(at.first, at.stop - 2 * size))
    values[start : start + 2 * size] = np.roll(values[start : start + 2 * size], size)
    return values


def _hold(values: Array, at: Contact) -> Array:
    """Hold a sample for 3 ms around the touch."""
    start = at.first - int(at.rng.uniform(0.1, 0.9) * 3e-3 * at.rate)
    values[start : start + int(3e-3 * at.rate)] = values[start]
    return values


def _draw_line(values: Array, at: Contact) -> Array:
    """Draw a line over 3 ms of the contact."""
    size = int(3e-3 * at.rate)
    start = int(at.rng.integers(at.first - size // 2, at.stop - size // 2))
    values[start : start + size] = np.linspace(values[start], values[start + size], size)
    return values


def _silence(values: Array, at: Contact) -> Array:
    """Set zero outside the contact with its margins."""
    values[: at.first - int(2e-3 * at.rate)] = 0.0
    values[at.stop + int(3e-3 * at.rate) :] = 0.0
    return values


def _add_needles(values: Array, at: Contact) -> Array:
    """Add a sample of 60 N each 10 ms."""
    period = int(0.01 * at.rate)
    values[int(at.rng.integers(period)) :: period] += 60.0
    return values


def _multiplex(values: Array, at: Contact) -> Array:
    """Take each sample from the next of four cells."""
    shares = 1 + at.rng.uniform(-0.3, 0.3, 4)
    return values * np.resize(4 * shares / shares.sum(), len(values))


def _draw_up(values: Array, at: Contact) -> Array:
    """Take samples at 2 kHz and lines between them."""
    time = np.arange(len(values)) / at.rate
    coarse = np.arange(at.rng.uniform(0, 5e-4), time[-1], 5e-4)
    return np.interp(time, coarse, np.interp(coarse, time, values))


def _scenes(add: Callable[..., None]) -> None:
    """Add steps and taps, short backgrounds, and bounces."""
    near = tuple((begin, 0.015, 25.0) for begin in (-2.6, -2.0, -1.4))
    walk = ((-3.5, 0.65, 750.0), (-2.9, 0.65, 760.0))
    stood, left, leaves = (-10.0, 1.0, 750.0), (-1.5, 0.4, -750.0), (2.0, 0.4, -750.0)
    laid = ((-3.5, 0.08, 24.5), (-2.9, 0.1, -24.5), (-2.2, 0.05, 40.0), (-1.9, 0.06, -40.0))
    caught = ((0.95, 0.15, 60.0), (1.4, 0.3, -60.0))
    heels = ((-3.45, 0.025, 250.0), (-2.85, 0.03, 300.0))
    four = tuple((begin, 0.012, 150.0) for begin in (-2.0, -1.5, 1.4, 1.9))
    scenes = {
        "steps beside the plate": Scene(before=3.0, taps=near),
        "steps on the plate before": Scene(before=4.0, treads=walk),
        "a man on the plate, steps off before": Scene(before=3.0, loads=(stood, left)),
        "a man steps off after": Scene(before=1.0, after=4.0, loads=(stood, leaves)),
        "handling before": Scene(before=4.0, loads=laid, taps=((-3.4, 0.02, 30.0),)),
        "tap of 150 N before": Scene(before=2.0, taps=((-1.2, 0.010, 150.0),)),
        "taps of 150 N": Scene(before=2.5, after=2.5, taps=four),
        "tap of 60 N 30 ms before": Scene(before=1.0, taps=((-0.030, 0.005, 60.0),)),
        "tap of 100 N 100 ms after": Scene(before=1.0, taps=((0.12, 0.005, 100.0),)),
        "steps with heels on the plate before": Scene(before=4.0, treads=walk, taps=heels),
        "ball caught": Scene(before=0.5, after=2.0, loads=caught),
    }
    for name, scene in scenes.items():
        add("footsteps", name, is_stated=False, chain=Chain(10e3), scene=scene)
    for before in (0.002, 0.005, 0.01, 0.02, 0.05):
        # Part of the 2 ms may be a soft begin of the pulse.
        few, name = before < 0.003, f"{1e3 * before:g} ms before"
        add("pre-trigger", name, scene=Scene(before=before), refusable=few)
    for after in (0.005, 0.01, 0.02, 0.1):
        add("pre-trigger", f"{1e3 * after:g} ms after", scene=Scene(after=after, bounces=0))
    for chain in (Chain(hum=(50.0, 5.0)), Chain(drift=20.0), Chain(noises=((3.0, 1.0),))):
        sizes = chain.hum[1], chain.drift, chain.noises[0][0]
        name = "10 and 20 ms, hum {:g} N, {:g} N/s, noise {:g} N".format(*sizes)
        add("pre-trigger", name, chain=chain, scene=Scene(0.01, 0.02, 0))
    for count, after in ((0, 0.3), (1, 0.002), (1, -0.008), (2, 0.2), (3, 0.1)):
        name = f"{count} bounces, {1e3 * after:g} ms after"
        add("bounces", name, scene=Scene(after=after, bounces=count))
    balls = [{"restitution": restitution} for restitution in (0.6, 0.72, 0.88)]
    balls += [{"deformation": deformation} for deformation in (0.0, 0.003)]
    for ball in [*balls, {"height": 0.7}]:
        add("bounces", str(ball), ball=ball)
    for missing in ("height", "mass"):
        add("bounces", f"{missing} unknown", config={missing: None}, scene=Scene(bounces=2))


def _files(add: Callable[..., None]) -> None:
    """Add copies of files, and load cells in channels."""
    for files in ("twice", "five times", "overlapping", "saved again", "shifted"):
        add("duplicates", files, is_stated=False, files=files, chain=Chain(25e3))
    for files in ("two drops", "five drops"):
        add("duplicates", files, files=files, chain=Chain(25e3))
    equal, cells, one = Cells((0.004,) * 4), Cells(), "250 N/V"
    listed = [f"{1 / s!r} N/V" for s in cells.sensitivities]
    stated: tuple[tuple[str, bool, Cells, dict[str, Any]], ...] = (
        ("sum, one calibration", True, equal, {"channels": "sum", "calibration": one}),
        ("sum, list", True, cells, {"channels": "sum", "calibration": listed}),
        ("expression", True, cells, {"channels": "F1+F2+F3+F4", "calibration": listed}),
        ("list of names", True, cells,
         {"channels": ["F1", "F2", "F3", "F4"], "calibration": listed}),
        ("not summed", False, equal, {"calibration": one}),
        ("not summed, no mass or height", False, equal,
         {"calibration": one, "mass": None, "height": None}),
        ("one of four", False, equal, {"calibration": one, "channel": "F1"}),
        ("one calibration, unequal", False, cells, {"channels": "sum", "calibration": one}),
        ("sum of three", False, equal, {"channels": "F1+F2+F3", "calibration": one}),
    )  # fmt: skip
    for name, is_stated, some, config in stated:
        add("channels", name, is_stated=is_stated, chain=Chain(10e3), config=config, cells=some)


def _stated(add: Callable[..., None]) -> None:
    """Add errors of what is stated, and records with many disturbances."""
    for name, uncertainties in (
        ("calibration 0.5 %", {"calibration": 0.005}),
        ("calibration 2 %", {"calibration": 0.02}),
        ("mass 10 g", {"mass": 0.01}),
        ("height 5 mm", {"height": 0.005}),
        ("all", {"calibration": 0.007, "mass": 0.005, "height": 0.003}),
    ):
        add("stated errors", name, uncertainties=uncertainties)
    for key, size in (("calibration", 0.02), ("mass", 0.03), ("height", 0.02)):
        more = {"config": {f"{key}_uncertainty": None}, "uncertainties": {key: size}}
        add("stated errors untold", f"{key}, not stated", is_stated=False, **more)
    rng = np.random.default_rng(271828)
    for index in range(30):
        tau = [math.inf, math.inf, 20.0, 5.0, 1.0][rng.integers(5)]
        plate: dict[str, float] = {} if math.isinf(tau) else {"time_constant": tau}
        modes: tuple[Mode, ...] = ()
        rate = float(rng.choice([8e3, 10e3, 16e3, 25e3, 44.1e3, 51.2e3, 96e3]))
        if rng.random() < 0.4:
            frequency = float(rng.uniform(1100, min(3000, rate / 5)))
            modes = (Mode(frequency, float(np.exp(rng.uniform(1.4, 4.0)))),)
            plate |= {"f0": frequency, "Q": modes[0].quality}
        chain = Chain(
            rate, modes, time_constant=tau, bits=int(rng.choice([12, 16, 24])),
            full_scale=float(rng.choice([5e3, 6e3, 10e3])),
            noises=((float(np.exp(rng.uniform(-1.5, 1.5))), float(rng.integers(3))), (0.3, 0.0)),
            offset=rng.uniform(-200, 200), drift=rng.uniform(-10, 10),
            hum=(float(rng.choice([50.0, 60.0])), float(np.exp(rng.uniform(-2, 2)))),
            tremor=float(rng.choice([0.0, 0.5])),
        )  # fmt: skip
        quiet = (float(np.exp(rng.uniform(-4, end))) for end in (0, -1))
        scene = Scene(*quiet, int(rng.integers(3)))
        errors = {"f0": 0.003} if modes else {}
        if rng.random() < 0.5:
            errors |= {"calibration": 0.005, "mass": 0.002, "height": 0.003}
        config = {"plate": plate} if plate else {}
        add("mixed", f"mixed {index + 1}", chain=chain, scene=scene, config=config,
            uncertainties=errors)  # fmt: skip


def _calibrations(add: Callable[..., None]) -> None:
    """Add records of a known mass, and taps on the plate."""
    quiet = Chain(1e4, full_scale=500.0, noises=((0.1, 0.0),))
    for tau, off in product((math.inf, 30.0, 10.0, 5.0, 2.0), (0.0, 8.0)):
        chain, name = replace(quiet, time_constant=tau), f"on{' and off' if off else ''}, {tau:g} s"
        weight = Weight(off=off, end=off + 4 if off else 8.0)
        add("calibrate", name, is_stated=math.isinf(tau), chain=chain, weight=weight)
    for name, keys in (
        ("drift", {"drift": 0.3}),
        ("hum 5 N", {"hum": (50.0, 5.0)}),
        ("tremor 1 N", {"tremor": 1.0}),
    ):
        add("calibrate", f"on, {name}", chain=replace(quiet, **keys), weight=Weight())
    droops: dict[str, dict[str, Any]] = {
        "two of 3 s": {"time_constant": 3.0, "second_time_constant": 3.0},
        "3 and 20 s": {"time_constant": 3.0, "second_time_constant": 20.0},
        "5 s, 0.02 N of brown noise": {"noises": ((0.1, 0.0), (0.02, 2.0))},
        "5 s, drift": {"drift": 0.3},
        "5 s, laid on in 1 s": {},
    }
    for name, keys in droops.items():
        weight = Weight() if keys else Weight(rise=1.0, knock=60.0)
        chain = replace(quiet, **({"time_constant": 5.0} | keys))
        add("calibrate", f"on, {name}", is_stated=False, chain=chain, weight=weight)
    taps = ((0.0005, 400.0), (0.0008, 300.0), (0.0012, 500.0))
    for f0, quality in product((1050.0, 1600.0, 2500.0), (5.0, 15.0, 50.0)):
        # It decays while the hammer touches the plate.
        brief, name = quality < 4e-3 * f0, f"{f0:g} Hz, Q {quality:g}"
        add("tap", name, chain=Chain(modes=(Mode(f0, quality),)), taps=taps, refusable=brief)
    one = Chain(modes=(Mode(1300.0, 20.0),))
    chains = {
        "20 kHz": replace(one, rate=20e3),
        "noise 5 N": replace(one, noises=((5.0, 0.0),)),
        "hum 5 N": replace(one, hum=(50.0, 5.0)),
        "pink noise 2 N": replace(one, noises=((2.0, 1.0),)),
        "second mode": Chain(modes=(Mode(1300.0, 20.0, 0.8), Mode(2300.0, 30.0, 0.2))),
        "near mode": Chain(modes=(Mode(1300.0, 20.0, 0.7), Mode(1500.0, 30.0, 0.3))),
    }
    for name, chain in chains.items():
        add("tap", name, chain=chain, taps=taps)
    add("tap", "one tap", chain=one, taps=taps[:1])
    add("tap", "soft taps", chain=one, taps=((0.003, 200.0),) * 3)


_PARTS = (
    _surroundings, _instruments, _filters, _samples, _scenes, _files, _stated, _calibrations,
)  # fmt: skip
