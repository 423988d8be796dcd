"""Conditions of the bench of the recorder model: what is recorded, and what is stated of it."""

from __future__ import annotations

import math
import sys
import zlib
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "validation"))
from recorder_model import KINDS, Cells, Chain, Filter, Mode, Scene, Weight

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

# Whether everything is stated.
TOLD, UNTOLD = True, False
# Plate, amplifier and filter where a condition has no other: stated unless it is about them. Flat
# up to FLAT, Hz, and static.
FLAT = 20e3
STATIC = 1e6


# Groups whose faults may be refused: no measurement can be right, or known to be right.
REFUSABLE = {"clipping", "duplicates", "channels", "offset step", "calibrate"}


@dataclass(frozen=True)
class Condition:
    """What is recorded, and what the configuration states of it.

    Attributes
    ----------
    group, name : str
        Part of the bench, and the condition.
    told : bool
        Whether everything is stated.
    chain, scene : Chain, Scene
        Recorder, and what it goes through.
    kind : str
        Kind of the pulse; empty: each in turn.
    ball : mapping
        Attributes of the ball that are not random.
    config : mapping
        Keys of the configuration, besides those of any recording.
    uncertainties : mapping
        Standard uncertainties that are stated, and from which errors are drawn: calibration
        (relative), mass, kg, height, m, f0 and cutoff of the filter (relative).
    cells : Cells or None
        Load cells in channels of their own.
    plate_told, filter_told : bool
        Whether plate and filter are stated.
    files : str
        ``"one"``, ``"table"``, or a kind of copies.
    weight : Weight or None
        Record of a mass for `calibrate` in place of a drop.
    taps : tuple of (float, float)
        Taps on the plate for `calibrate --tap`: duration, s, and peak, N.
    refusable : bool
        Whether it may be refused, besides faults of `REFUSABLE`.
    """

    group: str
    name: str
    told: bool = True
    chain: Chain = field(default_factory=Chain)
    scene: Scene = field(default_factory=Scene)
    kind: str = ""
    ball: Mapping[str, float] = field(default_factory=dict)
    config: Mapping[str, Any] = field(default_factory=dict)
    uncertainties: Mapping[str, float] = field(default_factory=dict)
    cells: Cells | None = None
    plate_told: bool = True
    filter_told: bool = True
    files: str = "one"
    weight: Weight | None = None
    taps: tuple[tuple[float, float], ...] = ()
    refusable: bool = False

    @property
    def drops(self) -> int:
        """Number of different drops in the files."""
        return {"two drops": 2, "five drops": 5}.get(self.files, 1)

    @property
    def may_be_refused(self) -> bool:
        """Whether a refusal is right."""
        return self.refusable or (not self.told and self.group in REFUSABLE)


def _clean() -> Iterator[Condition]:
    for kind in KINDS:
        for rate in (8e3, 51.2e3):
            yield Condition("clean", f"{kind}, {rate / 1e3:g} kHz", chain=Chain(rate), kind=kind)
    for rate in (2.5e3, 4e3, 10e3, 16e3, 25e3, 44.1e3, 96e3, 192e3):
        yield Condition("clean", f"{rate / 1e3:g} kHz", chain=Chain(rate))


def _noise() -> Iterator[Condition]:
    for name, slope in (("white", 0.0), ("pink", 1.0), ("brown", 2.0)):
        for deviation in (0.2, 1.5, 5.0, 15.0, 50.0):
            chain = Chain(25e3, noises=((deviation, slope),))
            yield Condition("noise", f"{name}, {deviation:g} N", chain=chain)
    for deviations in ((1.0, 2.0, 4.0), (5.0, 5.0, 5.0)):
        noises = tuple((size, float(slope)) for slope, size in enumerate(deviations))
        yield Condition("noise", f"white, pink, brown {deviations} N", chain=Chain(noises=noises))


def _surroundings() -> Iterator[Condition]:
    for mains in (50.0, 60.0):
        for amplitude in (2.0, 10.0, 60.0):
            chain = Chain(hum=(mains, amplitude))
            yield Condition("surroundings", f"hum {mains:g} Hz, {amplitude:g} N", chain=chain)
    for tremor in (2.0, 10.0):
        yield Condition("surroundings", f"tremor {tremor:g} N", chain=Chain(tremor=tremor))
    for drift in (5.0, 50.0):
        yield Condition("surroundings", f"drift {drift:g} N/s", chain=Chain(drift=drift))
    for offset in (-300.0, 1000.0):
        yield Condition("surroundings", f"offset {offset:g} N", chain=Chain(offset=offset))
    for rate, size in ((20.0, 50.0), (100.0, 20.0), (5.0, 300.0)):
        chain = Chain(spikes=rate, spike_size=size)
        yield Condition("surroundings", f"{rate:g} spikes/s of {size:g} N", chain=chain)
    chain = Chain(negative=True)
    yield Condition("surroundings", "negative", chain=chain, config={"polarity": "negative"})


def _droop() -> Iterator[Condition]:
    for tau in (0.2, 0.5, 1.0, 2.0, 5.0, 20.0):
        for told in (True, False):
            config = {"plate": {"time_constant": tau if told else STATIC}}
            name = f"time constant {tau:g} s{'' if told else ', untold'}"
            chain = Chain(25e3, time_constant=tau)
            yield Condition("droop", name, told, chain, config=config)


def _plate() -> Iterator[Condition]:
    for f0 in (1050.0, 1200.0, 1600.0, 2100.0, 3000.0):
        for quality in (3.0, 8.0, 25.0, 60.0):
            chain = Chain(modes=(Mode(f0, quality),))
            config = {"plate": {"f0": f0, "Q": quality}}
            yield Condition(
                "plate", f"{f0:g} Hz, Q {quality:g}", chain=chain, config=config,
                uncertainties={"f0": 0.003},
            )  # fmt: skip
    chain = Chain(10e3, modes=(Mode(1600.0, 25.0),))
    config = {"plate": {"f0": 1600.0, "Q": 25.0}}
    yield Condition(
        "plate", "1600 Hz, Q 25, 10 kHz", chain=chain, config=config, uncertainties={"f0": 0.003}
    )
    chain = Chain(modes=(Mode(900.0, 25.0),))
    config = {"plate": {"f0": 900.0, "Q": 25.0}}
    yield Condition("plate", "900 Hz, Q 25", chain=chain, config=config, refusable=True)


def _plate_untold() -> Iterator[Condition]:
    for f0 in (900.0, 1000.0, 1200.0, 1600.0, 2200.0, 3000.0):
        for quality in (3.0, 8.0, 25.0, 60.0):
            chain = Chain(modes=(Mode(f0, quality),))
            yield Condition(
                "plate untold", f"{f0:g} Hz, Q {quality:g}", UNTOLD, chain, plate_told=False
            )
    for f0, quality in ((1200.0, 10.0), (2000.0, 20.0), (3000.0, 30.0)):
        config = {"plate": {"f0": f0, "Q": quality, "f0_uncertainty": 0.005}}
        yield Condition("plate untold", f"stated {f0:g} Hz not there", UNTOLD, config=config)
    for ratio in (0.9, 1.1):
        config = {"plate": {"f0": 1600.0 * ratio, "Q": 25.0, "f0_uncertainty": 0.005}}
        chain = Chain(modes=(Mode(1600.0, 25.0),))
        yield Condition(
            "plate untold", f"1600 Hz stated times {ratio:g}", UNTOLD, chain, config=config
        )
    for f1, f2, share in ((1600.0, 2700.0, 0.15), (1200.0, 1900.0, 0.3), (2000.0, 2600.0, -0.1)):
        chain = Chain(modes=(Mode(f1, 25.0, 1 - share), Mode(f2, 30.0, share)))
        config = {"plate": {"f0": f1, "Q": 25.0, "f0_uncertainty": 0.005}}
        name = f"second mode {f2:g} Hz of {share:g}"
        yield Condition("plate untold", name, UNTOLD, chain, config=config)
        yield Condition("plate untold", f"{name}, no plate stated", UNTOLD, chain, plate_told=False)
    chain = Chain(8e3, modes=(Mode(1200.0, 8.0),))
    yield Condition("plate untold", "1200 Hz, Q 8, 8 kHz", UNTOLD, chain, plate_told=False)
    chain = Chain(noises=((5.0, 0.0),), modes=(Mode(1200.0, 25.0),))
    yield Condition("plate untold", "1200 Hz, Q 25, noise 5 N", UNTOLD, chain, plate_told=False)
    chain = Chain(modes=(Mode(9000.0, 30.0),))
    yield Condition("plate untold", "9 kHz, Q 30", UNTOLD, chain, plate_told=False)
    yield Condition("plate untold", "flat, not stated", UNTOLD, plate_told=False)


def _filter() -> Iterator[Condition]:
    cases = [(51.2e3, "bessel", 4, cutoff) for cutoff in (1.5e3, 2e3, 3e3, 5e3, 10e3)]
    cases += [(51.2e3, "butterworth", 4, cutoff) for cutoff in (1e3, 1.5e3, 2.5e3, 5e3)]
    cases += [(rate, "butterworth", 4, rate / 4) for rate in (2.5e3, 5e3, 10e3)]
    cases += [(51.2e3, "bessel", 2, 3e3), (51.2e3, "butterworth", 8, 1.2e3)]
    for rate, kind, order, cutoff in cases:
        chain = Chain(rate, filter=Filter(kind, order, cutoff))
        name = f"{kind} {order}, {cutoff:g} Hz, {rate / 1e3:g} kHz"
        config = {"filter": {"kind": kind, "order": order, "cutoff": cutoff}}
        yield Condition("filter", name, TOLD, chain, config=config, uncertainties={"cutoff": 0.005})
        yield Condition("filter untold", name, UNTOLD, chain, filter_told=False)
    for rate in (2.5e3, 5e3, 25e3):
        chain = Chain(rate, filter=Filter("elliptic", 6, 0.4 * rate))
        yield Condition(
            "filter untold", f"elliptic 6, {rate / 1e3:g} kHz", UNTOLD, chain, filter_told=False
        )
    for rate in (2.5e3, 51.2e3):
        name = f"flat, not stated, {rate / 1e3:g} kHz"
        yield Condition("filter untold", name, UNTOLD, Chain(rate), filter_told=False)


def _quantization() -> Iterator[Condition]:
    for full_scale in (4e3, 20e3):
        for bits in (8, 10, 12, 14, 16, 24):
            name = f"{bits} bit, ±{full_scale / 1e3:g} kN"
            chain = Chain(25e3, bits=bits, full_scale=full_scale, noises=((0.3, 0.0),))
            yield Condition("quantization", name, chain=chain)
    for bits in (8, 12):
        chain = Chain(bits=bits, full_scale=4e3, noises=((0.01, 0.0),), offset=0.0)
        yield Condition("quantization", f"{bits} bit, no noise, no offset", chain=chain)
    chain = Chain(25e3, bits=8, full_scale=4e3, noises=((0.3, 0.0),))
    yield Condition("quantization", "8 bit as a table, V", chain=chain, files="table")
    chain = Chain(25e3, bits=12, full_scale=20e3, noises=((0.3, 0.0),))
    yield Condition("quantization", "12 bit as a table, V", chain=chain, files="table")


def _offset_step() -> Iterator[Condition]:
    for size in (2.0, 15.0, 60.0, -30.0):
        for name, where, width in (("at the middle", 0.5, 0.0), ("over the contact", 0.0, 1.0)):
            scene = Scene(step=(size, where, width))
            yield Condition("offset step", f"{size:g} N {name}", UNTOLD, scene=scene)
    yield Condition(
        "offset step", "15 N at first touch", UNTOLD, scene=Scene(step=(15.0, 0.0, 0.0))
    )
    yield Condition("offset step", "15 N at release", UNTOLD, scene=Scene(step=(15.0, 1.0, 0.0)))


def _duplicates() -> Iterator[Condition]:
    for files in ("twice", "five times", "overlapping", "saved again", "shifted"):
        yield Condition("duplicates", files, UNTOLD, files=files, chain=Chain(25e3))
    for files in ("two drops", "five drops"):
        yield Condition("duplicates", files, TOLD, files=files, chain=Chain(25e3))


def _footsteps() -> Iterator[Condition]:
    near = tuple((begin, 0.015, 25.0) for begin in (-2.6, -2.0, -1.4))
    walk = ((-3.5, 0.65, 750.0), (-2.9, 0.65, 760.0))
    back = ((1.8, 0.7, 780.0), (2.4, 0.7, 780.0))
    stood, left, leaves = (-10.0, 1.0, 750.0), (-1.5, 0.4, -750.0), (2.0, 0.4, -750.0)
    laid = ((-3.5, 0.08, 24.5), (-2.9, 0.1, -24.5), (-2.2, 0.05, 40.0), (-1.9, 0.06, -40.0))
    caught = ((0.95, 0.15, 60.0), (1.4, 0.3, -60.0))
    bumps = (40.0, 150.0, 80.0, 200.0, 60.0, 120.0, 90.0, 180.0, 50.0, 70.0)
    handled = tuple((0.3 * k - 3.6, 0.006 + 0.0015 * k, peak) for k, peak in enumerate(bumps))
    heels = ((-3.45, 0.025, 250.0), (-2.85, 0.03, 300.0))
    four = tuple((begin, 0.012, 150.0) for begin in (-2.0, -1.5, 1.4, 1.9))
    scenes = {
        "steps beside the plate": Scene(before=3.0, taps=near),
        "steps on the plate before": Scene(before=4.0, treads=walk),
        "a man on the plate, steps off before": Scene(before=3.0, loads=(stood, left)),
        "a man steps off after": Scene(before=1.0, after=4.0, loads=(stood, leaves)),
        "a man steps on after": Scene(before=1.0, after=4.0, treads=back),
        "handling before": Scene(before=4.0, loads=laid, taps=((-3.4, 0.02, 30.0),)),
        "tap of 60 N before": Scene(before=2.0, taps=((-1.2, 0.004, 60.0),)),
        "tap of 100 N before": Scene(before=2.0, taps=((-1.2, 0.006, 100.0),)),
        "tap of 150 N before": Scene(before=2.0, taps=((-1.2, 0.010, 150.0),)),
        "taps of 150 N": Scene(before=2.5, after=2.5, taps=four),
        "tap of 60 N 30 ms before": Scene(before=1.0, taps=((-0.030, 0.005, 60.0),)),
        "tap of 100 N 100 ms after": Scene(before=1.0, taps=((0.12, 0.005, 100.0),)),
        "heel of 300 N after": Scene(before=1.0, after=3.0, taps=((2.0, 0.03, 300.0),)),
        "ten bumps of 40 to 200 N before": Scene(before=4.0, taps=handled),
        "steps with heels on the plate before": Scene(before=4.0, treads=walk, taps=heels),
        "tap of 300 N before": Scene(before=2.0, taps=((-1.2, 0.012, 300.0),)),
        "ball caught": Scene(before=0.5, after=2.0, loads=caught),
    }
    for name, scene in scenes.items():
        yield Condition("footsteps", name, UNTOLD, Chain(10e3), scene)


def _channels() -> Iterator[Condition]:
    equal = Cells((0.004,) * 4)
    rate = Chain(10e3)
    cells = Cells()
    listed = [f"{1 / s!r} N/V" for s in cells.sensitivities]
    names = ["F1", "F2", "F3", "F4"]
    one = "250 N/V"
    stated: tuple[tuple[str, bool, Cells, dict[str, Any]], ...] = (
        ("sum, one calibration", True, equal, {"channels": "sum", "calibration": one}),
        ("sum, list", True, cells, {"channels": "sum", "calibration": listed}),
        ("expression", True, cells, {"channels": "F1+F2+F3+F4", "calibration": listed}),
        ("list of names", True, cells, {"channels": names, "calibration": listed}),
        ("not summed", False, equal, {"calibration": one}),
        ("one of four", False, equal, {"calibration": one, "channel": "F1"}),
        ("one calibration, unequal", UNTOLD, cells, {"channels": "sum", "calibration": one}),
        ("sum of three", False, equal, {"channels": "F1+F2+F3", "calibration": one}),
    )  # fmt: skip
    for name, told, cell, config in stated:
        yield Condition("channels", name, told, rate, config=config, cells=cell)
    for files in ("newtons", "sound"):
        for missing in (False, True):
            config = {"mass": None, "height": None} if missing else {}
            name = f"not summed, {files}{', no mass or height' if missing else ''}"
            yield Condition("channels", name, UNTOLD, rate, config=config, cells=equal, files=files)
    config = {"channels": "sum"}
    yield Condition("channels", "sum, sound", TOLD, rate, config=config, cells=equal, files="sound")
    yield Condition(
        "channels", "sum, newtons", TOLD, rate, config=config, cells=equal, files="newtons"
    )


def _pretrigger() -> Iterator[Condition]:
    for before in (0.002, 0.005, 0.01, 0.02, 0.05):
        # Part of the 2 ms may be a soft begin of the pulse.
        few, name = before < 0.003, f"{1e3 * before:g} ms before"
        yield Condition("pre-trigger", name, scene=Scene(before=before), refusable=few)
    for after in (0.005, 0.01, 0.02, 0.1):
        scene = Scene(after=after, bounces=0)
        yield Condition("pre-trigger", f"{1e3 * after:g} ms after", scene=scene)
    scene = Scene(0.01, 0.02, 0)
    for chain in (Chain(hum=(50.0, 5.0)), Chain(drift=20.0), Chain(noises=((3.0, 1.0),))):
        disturbances = chain.hum[1], chain.drift, chain.noises[0][0]
        name = "10 and 20 ms, hum {:g} N, {:g} N/s, noise {:g} N".format(*disturbances)
        yield Condition("pre-trigger", name, chain=chain, scene=scene)


def _bounces() -> Iterator[Condition]:
    for count, after in ((0, 0.3), (1, 0.002), (1, -0.008), (2, 0.2), (3, 0.1)):
        scene = Scene(after=after, bounces=count)
        yield Condition("bounces", f"{count} bounces, {1e3 * after:g} ms after", scene=scene)
    for restitution in (0.6, 0.72, 0.88):
        ball = {"restitution": restitution}
        yield Condition("bounces", f"restitution {restitution:g}", ball=ball)
    for deformation in (0.0, 0.003):
        ball = {"deformation": deformation}
        yield Condition("bounces", f"{1e3 * deformation:g} mm lower at release", ball=ball)
    yield Condition("bounces", "0.5 m", ball={"height": 0.7})
    for height, mass in (({"height": None}, {}), ({}, {"mass": None})):
        missing = "height" if height else "mass"
        yield Condition(
            "bounces", f"{missing} unknown", config={**height, **mass}, scene=Scene(bounces=2)
        )


def _stated_errors() -> Iterator[Condition]:
    for name, uncertainties in (
        ("calibration 0.5 %", {"calibration": 0.005}),
        ("calibration 2 %", {"calibration": 0.02}),
        ("mass 10 g", {"mass": 0.01}),
        ("height 5 mm", {"height": 0.005}),
        ("all", {"calibration": 0.007, "mass": 0.005, "height": 0.003}),
    ):
        yield Condition("stated errors", name, uncertainties=uncertainties)
    for key, uncertainty in (("calibration", 0.02), ("mass", 0.03), ("height", 0.02)):
        config, uncertainties = {f"{key}_uncertainty": None}, {key: uncertainty}
        name = f"{key}, not stated"
        yield Condition(
            "stated errors untold", name, UNTOLD, config=config, uncertainties=uncertainties
        )


def _mixed() -> Iterator[Condition]:
    rng = np.random.default_rng(271828)
    for index in range(30):
        tau = [math.inf, math.inf, 20.0, 5.0, 1.0][rng.integers(5)]
        config: dict[str, Any] = {}
        plate: dict[str, float] = {} if math.isinf(tau) else {"time_constant": tau}
        modes: tuple[Mode, ...] = ()
        rate = float(rng.choice([8e3, 10e3, 16e3, 25e3, 44.1e3, 51.2e3, 96e3]))
        if rng.random() < 0.4:
            mode = Mode(
                float(rng.uniform(1100, min(3000, rate / 5))), float(np.exp(rng.uniform(1.4, 4.0)))
            )
            modes = (mode,)
            plate |= {"f0": mode.frequency, "Q": mode.quality}
        if plate:
            config["plate"] = plate
        chain = Chain(
            rate, modes, time_constant=tau, bits=int(rng.choice([12, 16, 24])),
            full_scale=float(rng.choice([5e3, 6e3, 10e3])),
            noises=((float(np.exp(rng.uniform(-1.5, 1.5))), float(rng.integers(3))), (0.3, 0.0)),
            offset=rng.uniform(-200, 200), drift=rng.uniform(-10, 10),
            hum=(float(rng.choice([50.0, 60.0])), float(np.exp(rng.uniform(-2, 2)))),
            tremor=float(rng.choice([0.0, 0.5])),
        )  # fmt: skip
        scene = Scene(
            float(np.exp(rng.uniform(-4, 0))),
            float(np.exp(rng.uniform(-4, -1))),
            int(rng.integers(3)),
        )
        uncertainties = (
            {"calibration": 0.005, "mass": 0.002, "height": 0.003} if rng.random() < 0.5 else {}
        )
        uncertainties |= {"f0": 0.003} if modes else {}
        yield Condition(
            "mixed",
            f"mixed {index + 1}",
            TOLD,
            chain,
            scene,
            config=config,
            uncertainties=uncertainties,
        )  # fmt: skip


def _clipping() -> Iterator[Condition]:
    for scale in (900.0, 600.0):
        yield Condition("clipping", f"±{scale:g} N", UNTOLD, Chain(full_scale=scale, offset=0.0))


def _calibrate() -> Iterator[Condition]:
    for tau in (math.inf, 30.0, 10.0, 5.0, 2.0):
        for name, off, end in (("on", 0.0, 8.0), ("on and off", 8.0, 12.0)):
            chain = Chain(1e4, time_constant=tau, full_scale=500.0, noises=((0.1, 0.0),))
            text = f"{name}, time constant {tau:g} s"
            weight = Weight(off=off, end=end)
            yield Condition("calibrate", text, math.isinf(tau), chain, weight=weight)
    quiet = Chain(1e4, full_scale=500.0, noises=((0.1, 0.0),))
    for name, chain in (
        ("on, drift", replace(quiet, drift=0.3)),
        ("on, hum 5 N", replace(quiet, hum=(50.0, 5.0))),
        ("on, tremor 1 N", replace(quiet, tremor=1.0)),
    ):
        yield Condition("calibrate", name, TOLD, chain, weight=Weight())
    droops = replace(quiet, time_constant=5)
    for name, chain in (
        ("on, two of 3 s", replace(droops, time_constant=3, second_time_constant=3)),
        ("on, 3 and 20 s", replace(droops, time_constant=3, second_time_constant=20)),
        ("on, 5 s, 0.02 N of brown noise", replace(droops, noises=((0.1, 0.0), (0.02, 2.0)))),
        ("on, 5 s, drift", replace(droops, drift=0.3)),
    ):
        yield Condition("calibrate", name, UNTOLD, chain, weight=Weight())
    weight = Weight(rise=1.0, knock=60.0)
    yield Condition(
        "calibrate", "laid on in 1 s", UNTOLD, replace(quiet, time_constant=5), weight=weight
    )


def _tap() -> Iterator[Condition]:
    taps = ((0.0005, 400.0), (0.0008, 300.0), (0.0012, 500.0))
    for f0 in (1050.0, 1600.0, 2500.0):
        for quality in (5.0, 15.0, 50.0):
            chain = Chain(modes=(Mode(f0, quality),))
            # It decays while the hammer touches the plate.
            brief, name = quality < 4e-3 * f0, f"{f0:g} Hz, Q {quality:g}"
            yield Condition("tap", name, chain=chain, taps=taps, refusable=brief)
    mode = Mode(1300.0, 20.0)
    for name, chain in (
        ("20 kHz", Chain(20e3, modes=(mode,))),
        ("noise 5 N", Chain(modes=(mode,), noises=((5.0, 0.0),))),
        ("hum 5 N", Chain(modes=(mode,), hum=(50.0, 5.0))),
        ("pink noise 2 N", Chain(modes=(mode,), noises=((2.0, 1.0),))),
        ("second mode", Chain(modes=(Mode(1300.0, 20.0, 0.8), Mode(2300.0, 30.0, 0.2)))),
        ("near mode", Chain(modes=(Mode(1300.0, 20.0, 0.7), Mode(1500.0, 30.0, 0.3)))),
    ):
        yield Condition("tap", name, chain=chain, taps=taps)
    yield Condition("tap", "one tap", chain=Chain(modes=(mode,)), taps=taps[:1])
    yield Condition("tap", "soft taps", chain=Chain(modes=(mode,)), taps=((0.003, 200.0),) * 3)


@cache
def conditions() -> tuple[Condition, ...]:
    """Return all conditions."""
    groups = (
        _clean, _noise, _surroundings, _droop, _plate, _plate_untold, _filter, _quantization,
        _offset_step, _duplicates, _footsteps, _channels, _pretrigger, _bounces, _stated_errors,
        _mixed, _clipping, _calibrate, _tap,
    )  # fmt: skip
    return tuple(condition for group in groups for condition in group())


def kind_of(condition: Condition, seed: int) -> str:
    """Return the kind of the pulse of a record."""
    offset = zlib.crc32(condition.name.encode())
    return condition.kind or KINDS[(offset + seed) % len(KINDS)]
