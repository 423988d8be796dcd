"""Errors of drops in random recordings against the bounds that noise sets.

    python tests/validation/recording_bounds.py [realisations [first seed]]

prints tables by level and colour of the noise; the bounds are derived in
docs/recordings_theory.md, section 6.
"""

from __future__ import annotations

import math
import sys
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import cache
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING
from unittest import mock

import numpy as np

import thud
from thud.base.errors import InputError
from thud.impact.contact_time import contact_span
from thud.level.estimate import Estimate
from thud.recordings import background as background_module
from thud.recordings.background import MAINS, Background, cell_means, uniform_cells
from thud.recordings.contact import Contact, band_functionals, find_contact
from thud.recordings.drops import Section
from thud.recordings.recorded_levels import measure_levels
from thud.recordings.signal import Signal

if TYPE_CHECKING:
    from collections.abc import Iterator

    from thud.recordings.measured_drop import Drop

sys.path.insert(0, str(Path(__file__).parents[1] / "driver"))
from synthetic import HARMONICS, coloured_noise, noise_density

NOISES = (60, 50, 40, 30, 20)
COLOURS = ("white", "pink", "brown")
RATES = (8e3, 16e3, 24e3, 44.1e3, 48e3, 51.2e3, 96e3)
# Shapes of pulses: file of the model, and how often they are drawn. Both finite elements have
# 2.08 MPa, with the damping law of Kelvin and Voigt and with a fractional one.
SHAPES = {
    "half sine": ("", 0.4),
    "shell": ("rubber_ball_100cm", 0.18),
    "modal": ("comparison/3_modes", 0.14),
    "viscous elements": ("rubber_ball_fe_viscous", 0.14),
    "fractional elements": ("recordings/ball", 0.14),
}
FINE = 192_000.0
HEIGHT, MASS, GRAVITY = 1.0, 2.5, 9.81
BANDS = thud.get_bands()
# Deviations that hold 95 %.
COVERAGE = 1.96
# Bounds of cells of the whole background, s from the contact.
ALL_DISTANCES = np.concatenate([background_module.DISTANCES, np.arange(0.104, 1.0, 4e-3)])
QUANTITIES = (*(f"{band:g} Hz" for band in BANDS.nominal), "e", "t_c")


@cache
def pulse(shape: str) -> tuple[np.ndarray, float]:
    """Return the samples of a pulse at FINE from first touch on, N, and the time to release, s."""
    file, _ = SHAPES[shape]
    if not file:
        time = np.arange(int(0.02 * FINE) + 1) / FINE
        return 1500 * np.sin(np.pi * time / 0.02), 0.02
    case = thud.read_case(Path(__file__).parents[2] / f"inputs/{file}.nml")
    impact = thud.solve(replace(case, sampling=thud.Sampling(FINE, 0.05)))
    last = int(np.ceil(impact.exact_contact_time * FINE)) + 1
    return impact.floor_force[:last], impact.exact_contact_time


@dataclass
class Draw:
    """One random recording."""

    seed: int
    shape: str
    noise: int
    colour: str
    rate: float
    before: float
    after: float
    offset: float
    drift: float
    mains: float
    hum: float

    @classmethod
    def random(cls, seed: int) -> Draw:
        """Return the draw of a seed."""
        rng = np.random.default_rng(seed)
        return cls(
            seed,
            list(SHAPES)[rng.choice(len(SHAPES), p=[part for _, part in SHAPES.values()])],
            NOISES[seed % 5],
            COLOURS[seed // 5 % 3],
            RATES[rng.integers(len(RATES))] * rng.uniform(1, 1.0001),
            *np.exp(rng.uniform(np.log(0.005), 0, 2)),
            rng.uniform(-0.05, 0.05),
            rng.uniform(-0.05, 0.05),
            MAINS[rng.integers(2)],
            10 ** rng.uniform(-4, -2),
        )


@dataclass
class Result:
    """Errors and bounds: energies of five octaves, restitution, contact time.

    `pull` is the error of the reported value over its stated deviation, of a level in dB; not
    positive where a level is an upper bound that holds.
    """

    error: np.ndarray
    bound: np.ndarray
    pull: np.ndarray


def realise(seed: int) -> tuple[Draw, Result | str]:
    """Return the errors of one random recording, or why it was refused."""
    draw = Draw.random(seed)
    rng = np.random.default_rng(10_000_000 + seed)
    force, contact_time = pulse(draw.shape)
    peak, rate = float(force.max()), draw.rate
    n = int((draw.before + contact_time + draw.after) * rate)
    onset = draw.before + rng.uniform() / rate
    time = np.arange(n) / rate - onset
    clean = np.interp(time, np.arange(len(force)) / FINE, force, left=0, right=0)
    deviation = peak * 10 ** (-draw.noise / 20)
    record = clean + peak * (draw.offset + draw.drift * time)
    for k, part in enumerate(HARMONICS, start=1):
        wave = np.sin(2 * np.pi * k * draw.mains * time + rng.uniform(0, 2 * np.pi))
        record += draw.hum * peak * part * wave
    record += coloured_noise(n, rate, deviation, draw.colour, rng)
    try:
        recording = thud.read_recording(Signal.from_array(record, rate), height=HEIGHT, mass=MASS)
    except InputError as error:
        return draw, str(error)
    drop, levels = recording.drops[0], measure_levels(recording.drops)
    np.testing.assert_allclose(levels.level[0], recording.levels(), rtol=0, atol=1e-9)
    oracle, restitution = oracle_drop(draw, clean, onset, contact_time, deviation, drop)
    pairs = zip(BANDS.lower, BANDS.upper, strict=True)
    energy, bounds = np.array([band_bound(oracle, *edges) for edges in pairs]).T
    found = 10 ** (levels.measured[0] / 10) - 10 ** (levels.background[0] / 10)
    pull = (levels.level[0] - 10 * np.log10(energy)) / levels.uncertainty[0]
    pull = np.where(levels.flag[0] == "background", np.maximum(-pull, 0), pull)
    begin, end = contact_span(force, FINE)
    late = drop.contact_time.value - (end - begin)
    bounce = drop.restitution.value - restitution.value
    flank = flank_bound(oracle, record)
    gravity = GRAVITY * flank / np.sqrt(2 * GRAVITY * HEIGHT)
    stated = drop.restitution.uncertainty, drop.contact_time.uncertainty
    return draw, Result(
        np.array([*(found - energy), bounce, late]),
        np.array([*bounds, np.hypot(restitution.uncertainty, gravity), flank]),
        np.array([*pull, bounce / stated[0], late / stated[1]]),
    )


def band_bound(oracle: Drop, lower: float, upper: float) -> tuple[float, float]:
    """Return the energy of a band, N2 s, and the deviation of its best unbiased estimate."""
    force = oracle.force[slice(*oracle.gate)]
    functionals = band_functionals(len(force), oracle.sample_rate, lower, upper)
    value, covariance = functionals @ force, oracle.contact.covariance_of(functionals)
    variance = 4 * float(value @ covariance @ value) + 2 * float((covariance**2).sum())
    return float(value @ value), float(np.sqrt(variance))


def oracle_drop(  # noqa: PLR0913, PLR0917 - what is known of a recording
    draw: Draw, clean: np.ndarray, onset: float, contact_time: float, deviation: float, drop: Drop
) -> tuple[Drop, Estimate]:
    """Return the drop of the best linear estimate: noise and contact are known; no error."""
    rate = draw.rate
    first, last = int(np.ceil(onset * rate)), int((onset + contact_time) * rate) + 1
    variances, peak = np.zeros(5), float(clean.max())
    variances[COLOURS.index(draw.colour)] = noise_density(rate, deviation, draw.colour)
    variances[0] = max(variances[0], 1e-12 * peak**2)
    variances[3 + MAINS.index(draw.mains)] = (draw.hum * peak) ** 2 / 2
    distances = np.unique(np.rint(ALL_DISTANCES * rate).astype(int))
    before = first - distances[distances <= first][::-1]
    after = last + distances[distances <= len(clean) - last]
    background = Background(*cell_means(clean, rate, before, after), variances, peak)
    covariance = background.error_covariance(uniform_cells(first, last, rate))
    begin = onset - first / rate
    touch, release = Estimate(begin, 0), Estimate(begin + contact_time, 0)
    contact = Contact(
        touch, release, touch, release, first, clean[first:last], np.zeros(last - first),
        (0, last - first), covariance, background, rate,
    )  # fmt: skip
    speed = np.sqrt(2 * GRAVITY * HEIGHT)
    ones = np.full((1, last - first), 1 / rate)
    spread = float(np.sqrt(contact.covariance_of(ones)[0, 0])) / (MASS * speed)
    truth = clean.sum() / rate / (MASS * speed) - 1 - GRAVITY * contact_time / speed
    return replace(drop, contact=contact), Estimate(float(truth), spread)


def flank_bound(oracle: Drop, record: np.ndarray) -> float:
    """Return the deviation of the contact time, s, of this method where the noise is known.

    The search for drops has given the contact to the sample.
    """
    contact = oracle.contact
    span = contact.start, contact.start + len(contact.force)
    section = Section("record", record, oracle.sample_rate, 0, span)
    with mock.patch.object(background_module, "DISTANCES", ALL_DISTANCES):
        force, background = background_module.remove_background(section, contact.background)
    found = find_contact(section, force, background)
    return math.hypot(found.begin.uncertainty, found.end.uncertainty)


def realise_all(count: int, first: int = 0) -> list[tuple[Draw, Result | str]]:
    """Return a number of realisations."""
    for shape in SHAPES:
        pulse(shape)
    with ProcessPoolExecutor(2) as pool:
        return list(pool.map(realise, range(first, first + count), chunksize=10))


def columns(results: list[Result]) -> tuple[np.ndarray, np.ndarray]:
    """Return errors over bounds, and errors over stated deviations: [n, n_quantity] each."""
    ratio = np.array([r.error / r.bound for r in results])
    return ratio, np.array([r.pull for r in results])


def table(results: list[tuple[Draw, Result | str]]) -> Iterator[str]:
    """Yield the lines of the report."""
    yield "root mean square of error/bound, and part within 1.96 stated deviations"
    yield " " * 21 + "".join(f"{name:>14s}" for name in QUANTITIES)
    measured = [(d, r) for d, r in results if isinstance(r, Result)]
    for colour, noise in product((*COLOURS, "all"), (*NOISES, 0)):
        some = [r for d, r in measured if noise in {0, d.noise} and colour in {"all", d.colour}]
        if not some:
            continue
        ratio, pull = columns(some)
        rms = np.sqrt(np.mean(ratio**2, axis=0))
        cover = np.mean(np.abs(pull) <= COVERAGE, axis=0)
        row = "".join(f"{a:7.2f} {100 * b:4.0f} %" for a, b in zip(rms, cover, strict=True))
        yield f"{noise or '':>3} dB {colour:6s} {len(some):4d} |{row}"
    for noise in NOISES:
        if some := [r for d, r in measured if d.noise == noise]:
            yield _absolute(noise, some)
    for draw, text in results:
        if isinstance(text, str):
            yield f"refused: {draw}: {text}"


def _absolute(noise: int, results: list[Result]) -> str:
    """Return a line on errors of contact time and restitution, and the largest ones."""
    error, pull = (np.abs([getattr(r, name) for r in results]) for name in ("error", "pull"))
    late = 1e3 * error[:, 6]
    return (
        f"{noise} dB: contact time within 0.1 ms {100 * np.mean(late < 0.1):.1f} %, rms "
        f"{np.sqrt(np.mean(late**2)):.3f}, maximum {late.max():.3f} ms; restitution within 0.01 "
        f"{100 * np.mean(error[:, 5] < 0.01):.1f} %; largest errors over stated deviations "
        + " ".join(f"{worst:.1f}" for worst in pull.max(axis=0))
    )


if __name__ == "__main__":
    found = realise_all(*map(int, sys.argv[1:] or ["1000"]))
    sys.stdout.write("\n".join(table(found)) + "\n")
