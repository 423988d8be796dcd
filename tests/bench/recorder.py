"""Recordings of a recorder model, measured: which errors are silent, and what intervals cover.

    .venv/bin/python tests/bench/recorder.py [--part NAME] [--seeds N] [--first N]

Each condition of `tests/validation/recorder_conditions.py` is recorded with several seeds, written
to files with a configuration, and measured. If everything is stated in the configuration, 95 % of
the intervals should contain the truth. Otherwise the record has a fault that nobody states.
An error is silent and material if it exceeds three stated standard uncertainties (with few degrees
of freedom, what covers as much), and 0.1 dB, 0.1 ms, 0.01 of restitution or 0.5 % of a peak or a
calibration, and no warning concerns it. The exit code is 1 if there is one, if the coverage is
outside 93 to 97 % by more than chance, if what can be measured is refused, or if something else is
measured as a drop.
"""

from __future__ import annotations

import argparse
import math
import sys
import tempfile
import zlib
from collections import defaultdict
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import soundfile
from scipy.special import ndtr, stdtrit
from threadpoolctl import threadpool_limits

import thud
from thud.base.errors import InputError
from thud.recordings.calibration import calibrate
from thud.recordings.plate_tap import calibrate_tap

sys.path += [str(Path(__file__).parents[1] / name) for name in ("faults", "validation")]
from damage import toml
from recorder_conditions import FLAT, STATIC, Condition, Contact, conditions
from recorder_model import (
    GRAVITY,
    KINDS,
    Ball,
    Cells,
    Chain,
    Truth,
    convert,
    drop_pulse,
    electric,
    plate_force,
    tap_record,
    weight_record,
    write_sound,
    write_table,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

    from recorder_model import Array, Pulse

    from thud.base.note import Note

LEVELS = tuple(f"{band} Hz" for band in ("31.5", "63", "125", "250", "500"))
CONTACT, RESTITUTION, PEAK, CALIBRATION = "contact", "restitution", "peak", "calibration"
RESONANCE, QUALITY = "f0", "Q"
# Errors that matter: dB, s, and relative ones of peak, calibration, resonance and quality.
MATERIAL = {**dict.fromkeys(LEVELS, 0.1), CONTACT: 1e-4, RESTITUTION: 0.01, PEAK: 5e-3,
            CALIBRATION: 5e-3, RESONANCE: 5e-3, QUALITY: 0.05}  # fmt: skip
# Stated standard uncertainties that an error must exceed.
DEVIATIONS = 3.0
COVERAGE = (0.93, 0.97)
# What warnings concern, by their codes; the others concern everything.
FORCE, SIZE = {*LEVELS, CONTACT, PEAK}, {*LEVELS, PEAK, RESTITUTION, CALIBRATION}
CONCERNS: dict[str, set[str]] = {
    **{code: set() for code in ("effective_mass", "peaks_unknown", "restitution_partly_known",
                                "no_bounce", "plate_low", "plate_high", "plate_range")},
    **dict.fromkeys(("plate_rings", "plate_rings_differently", "plate_assumed", "share_assumed",
                     "filter_assumed", "plate_estimated", "plate_not_recorded", "plate_unclear",
                     "plate_not_flat", "noise_ends"), FORCE),
    "aliasing": {"500 Hz"},
    "restitution_impossible": SIZE,
}  # fmt: skip
# Two restitutions that differ concern the restitution if they differ by more than 0.01, and the
# force from 0.02 on, 1 % of an impulse.
SUSPECT = 0.02
# Relative standard deviation of the clock of a recorder.
CLOCK = 1e-4


@dataclass(frozen=True)
class Value:
    """Measured quantity: error, its standard uncertainty and degrees of freedom."""

    error: float
    uncertainty: float
    concerned: bool = False
    freedom: float = math.inf

    def is_within(self, deviations: float) -> bool:
        """Whether the error is within so many deviations of a normal distribution."""
        is_normal = math.isinf(self.freedom)
        factor = deviations if is_normal else float(stdtrit(self.freedom, ndtr(deviations)))
        return abs(self.error) <= factor * self.uncertainty + 1e-12

    def is_inside(self) -> bool:
        """Whether the 95 % interval contains the truth."""
        return self.is_within(1.96)

    def is_silent(self, quantity: str) -> bool:
        """Whether the error is material and nothing tells of it."""
        is_material = abs(self.error) > MATERIAL[quantity]
        return is_material and not self.is_within(DEVIATIONS) and not self.concerned


@dataclass(frozen=True)
class Outcome:
    """What came of one record: values by quantity and codes of warnings, or a refusal."""

    condition: Condition
    seed: int
    values: dict[str, Value] = field(default_factory=dict)
    drops: int = 0
    refusal: str = ""
    warnings: tuple[str, ...] = ()

    @property
    def silent(self) -> list[str]:
        """The quantities whose errors are silent and material."""
        return [quantity for quantity, value in self.values.items() if value.is_silent(quantity)]

    @property
    def warned(self) -> int:
        """Number of material errors beyond the uncertainty that a warning concerns."""
        pairs = self.values.items()
        return sum(v.concerned and replace(v, concerned=False).is_silent(q) for q, v in pairs)

    @property
    def miscounted(self) -> bool:
        """Whether something else counts as a drop, or a drop does not."""
        # What rounds off a drop makes its bounce another one, which a warning tells.
        is_right = self.drops == self.condition.drops or self.condition.group == "samples"
        return bool(self.values) and not is_right


# --- one record -------------------------------------------------------------------------------


def measure(condition: Condition, seed: int) -> Outcome:
    """Record a condition with a seed, measure it, and compare with the truth."""
    text = f"{condition.group}/{condition.name}".encode()
    rng = np.random.default_rng([zlib.crc32(text), seed])
    with tempfile.TemporaryDirectory() as directory, threadpool_limits(1, "blas"):
        folder = Path(directory)
        try:
            if condition.weight or condition.taps:
                known = _tapped if condition.taps else _calibrated
                values, notes = known(condition, folder, rng)
                return Outcome(condition, seed, values, 1, warnings=codes(notes))
            paths, config, truth = record(condition, seed, folder, rng)
            recording = thud.read_recording(paths, config=config)
            values, said = dict(compare(recording, truth)), codes(recording.notes)
            if condition.fault and said:  # of damaged samples, nothing is right
                values = {name: replace(value, concerned=True) for name, value in values.items()}
            return Outcome(condition, seed, values, len(recording.drops), warnings=said)
        except InputError as error:
            return Outcome(condition, seed, refusal=str(error).replace(directory, ""))


def record(
    condition: Condition, seed: int, folder: Path, rng: np.random.Generator
) -> tuple[list[Path], Path, Truth]:
    """Write the files and the configuration of a record, and return them with the truth."""
    drawn = {
        "mass": rng.uniform(2.4, 2.6), "height": rng.uniform(0.95, 1.05),
        "restitution": rng.uniform(0.72, 0.85), "deformation": rng.uniform(0, 0.003),
    }  # fmt: skip
    ball = Ball(**{**drawn, **condition.ball})
    pulse, truth = drop_pulse(kind_of(condition, seed), ball, rng)
    errors = {key: size * rng.normal() for key, size in condition.uncertainties.items()}
    chain = replace(condition.chain, gain=1 + errors.get("calibration", 0.0))
    config = configuration(condition, ball, errors)

    def take(one: Pulse, name: str) -> Path:
        force = plate_force(one, ball, chain, condition.scene, rng)
        if condition.cells:
            return _write_cells(condition.cells, force, folder / name, chain, rng)
        values = electric(force, chain, condition.scene, one.duration, rng)
        if condition.fault:
            before = condition.scene.before
            first, stop = (int(end * chain.rate) + 1 for end in (before, before + one.duration))
            values = condition.fault(values, Contact(chain.rate, first, stop, rng))
        return _write(values, folder / name, chain)

    if condition.cells or condition.files == "one":
        paths = [take(pulse, "drop")]
    elif condition.files.endswith("drops"):
        # Drops of one ball differ in the contact time, and with it in the levels.
        paths = [take(_varied(pulse, rng), f"drop_{k}") for k in range(condition.drops)]
    else:
        paths = _copies(take(_varied(pulse, rng), "drop"), condition.files, chain)
    path = folder / "lab.toml"
    path.write_text(toml({key: value for key, value in config.items() if value is not None}))
    return paths, path, truth


def configuration(condition: Condition, ball: Ball, errors: Mapping[str, float]) -> dict[str, Any]:
    """Return what is stated of a record, with errors."""
    chain, uncertainties = condition.chain, condition.uncertainties
    config: dict[str, Any] = {
        "polarity": "positive", "mass": ball.mass + errors.get("mass", 0.0),
        "height": ball.height + errors.get("height", 0.0),
        "mass_uncertainty": uncertainties.get("mass", 0.0),
        "height_uncertainty": uncertainties.get("height", 0.0),
        "calibration": f"{chain.full_scale!r} N/FS",
        "calibration_uncertainty": uncertainties.get("calibration", 0.0),
    }  # fmt: skip
    config |= condition.config
    if condition.plate_stated:
        tau, plate = chain.time_constant, condition.config.get("plate", {})
        config["plate"] = {
            "time_constant": STATIC if math.isinf(tau) else tau, "full_scale": chain.full_scale,
            **({"share": chain.modes[0].share} if "f0" in plate and condition.is_stated else {}),
            **({} if "f0" in plate else {"flat_limit": FLAT}), **plate,
        }  # fmt: skip
    if condition.filter_stated:
        config["filter"] = condition.config.get("filter", {"kind": "none"})
    for table, key in (("plate", "f0"), ("filter", "cutoff")):
        if key in uncertainties:
            value = config[table][key] * (1 + errors[key])
            config[table] = {**config[table], key: value, f"{key}_uncertainty": uncertainties[key]}
    return config


def kind_of(condition: Condition, seed: int) -> str:
    """Return the kind of the pulse of a record."""
    return condition.kind or KINDS[(zlib.crc32(condition.name.encode()) + seed) % len(KINDS)]


def _varied(pulse: Pulse, rng: np.random.Generator) -> Pulse:
    """Return a further drop of the same ball: the contact time varies by 1 %."""
    stretch = 1 + 0.01 * rng.normal()
    return pulse.scaled(1 / stretch, stretch)


def _write(values: Array, stem: Path, chain: Chain) -> Path:
    return write_sound(stem.with_suffix(".wav"), convert(values, chain), chain)


def _write_cells(
    cells: Cells, force: Array, stem: Path, chain: Chain, rng: np.random.Generator
) -> Path:
    """Write the load cells as a table in V."""
    step = 10 / 2**23
    volts = np.rint(cells.volts(force, chain, rng) / step) * step
    return write_table(
        stem.with_suffix(".csv"), {f"F{k} [V]": one for k, one in enumerate(volts, 1)}, chain.rate
    )


def _copies(path: Path, files: str, chain: Chain) -> list[Path]:
    """Return a file several times, as they are given by mistake."""
    if files in {"twice", "five times"}:
        return [path] * (2 if files == "twice" else 5)
    values, rate = soundfile.read(path, dtype="int32")
    copy = path.with_name("copy.flac" if files == "saved again" else "copy.wav")
    part = {
        "overlapping": values[int(0.05 * chain.rate) :],
        "saved again": values,
        "shifted": np.concatenate([values[: int(0.1 * chain.rate)], values]),
    }[files]
    soundfile.write(copy, part, rate, "PCM_24")
    return [path, copy]


def codes(notes: Iterable[Note]) -> tuple[str, ...]:
    """Return the codes of warnings."""
    return tuple(note.code for note in notes if note.is_warning)


def concern(note: Note) -> set[str]:
    """Return the quantities that a warning concerns."""
    if note.code == "uncertainty_not_stated":
        return SIZE if "calibration" in str(note.others["names"]) else {RESTITUTION}
    if note.code == "restitutions_differ":
        named = {RESTITUTION} if abs(note.value) >= MATERIAL[RESTITUTION] else set()
        return named | {*LEVELS, PEAK} if abs(note.value) >= SUSPECT else named
    return CONCERNS.get(note.code, set(MATERIAL))


def compare(recording: Any, truth: Truth) -> Iterator[tuple[str, Value]]:  # noqa: ANN401
    """Yield the quantities of a recording with their errors."""
    concerned: set[str] = set().union(*(concern(n) for n in recording.notes if n.is_warning))
    estimates = dict(zip(LEVELS, recording.level_estimates(), strict=True))
    estimates[CONTACT] = recording.estimates["contact_time"]
    estimates[RESTITUTION] = recording.estimates["restitution"]
    true = {**dict(zip(LEVELS, truth.levels, strict=True)), CONTACT: truth.contact_time,
            RESTITUTION: truth.restitution}  # fmt: skip
    for quantity, one in estimates.items():
        if math.isfinite(one.value):
            error = float(one.value - true[quantity])
            error = min(error, 0.0) if one.upper_bound else error
            yield quantity, Value(error, one.uncertainty, quantity in concerned, one.freedom)
    peaks = np.array(
        [(one.peak_force.value, one.peak_force.uncertainty) for one in recording.drops]
    )
    count, mean = len(peaks), float(peaks[:, 0].mean())
    variance = float((peaks[:, 1] ** 2).mean()) / count
    variance += float(peaks[:, 0].var(ddof=1)) / count if count > 1 else 0.0
    relative = math.hypot(math.sqrt(variance) / mean, recording.calibration_uncertainty or 0.0)
    freedom = count - 1 if count > 1 else math.inf
    yield PEAK, Value(mean / truth.peak - 1, relative, PEAK in concerned, freedom)


def _calibrated(
    condition: Condition, folder: Path, rng: np.random.Generator
) -> tuple[dict[str, Value], tuple[Note, ...]]:
    weight, chain = condition.weight, condition.chain
    assert weight is not None
    path = _write(weight_record(weight, chain, rng), folder / "weight", chain)
    found = calibrate(path, force=weight.mass * GRAVITY, uncertainty=1e-4, unit="FS")
    error = float(found.chain.split()[0]) / chain.full_scale - 1
    concerned = any(CALIBRATION in concern(note) for note in found.notes if note.is_warning)
    return {CALIBRATION: Value(error, found.uncertainty, concerned)}, found.notes


def _tapped(
    condition: Condition, folder: Path, rng: np.random.Generator
) -> tuple[dict[str, Value], tuple[Note, ...]]:
    chain, mode = condition.chain, condition.chain.modes[0]
    record = tap_record(condition.taps, chain, rng)
    found = calibrate_tap(_write(record, folder / "tap", chain))
    # As an error of the recorder's clock.
    clock = 1 + CLOCK * rng.normal()
    return {
        RESONANCE: Value(clock * found.frequency / mode.frequency - 1, found.frequency_uncertainty),
        QUALITY: Value(found.quality / mode.quality - 1, found.quality_uncertainty),
    }, ()


# --- report -----------------------------------------------------------------------------------


def summary(outcomes: list[Outcome]) -> Iterator[str]:
    """Yield a table by groups; what is inside, of records of which all is stated."""
    columns: dict[str, tuple[str, ...]] = {
        "levels": LEVELS, "contact time": (CONTACT,), "restitution": (RESTITUTION,),
        "peak": (PEAK,), "calibration": (CALIBRATION,), "f0, Q": (RESONANCE, QUALITY),
    }  # fmt: skip

    def row(*cells: object) -> str:
        return f"| {' | '.join(map(str, cells))} |"

    yield row("conditions", "records", "refused", *columns, "silent", "warned", "miscounted",
              "said to ring")  # fmt: skip
    yield row(*["---"] * (7 + len(columns)))
    groups = defaultdict(list)
    for outcome in outcomes:
        name = outcome.condition.group.removesuffix(" untold")
        groups[name + ", not all stated" * (not outcome.condition.is_stated)].append(outcome)
    for name, members in groups.items():
        cells = []
        for quantities in columns.values():
            values = [o.values[q] for o in members for q in quantities if q in o.values]
            inside = sum(value.is_inside() for value in values)
            hidden = not values or name.endswith("not all stated")
            cells.append("" if hidden else f"{100 * inside / len(values):.0f} %")
        refused = sum(bool(outcome.refusal) for outcome in members)
        silent = sum(len(outcome.silent) for outcome in members)
        others = sum(o.warned for o in members), sum(o.miscounted for o in members)
        rings = sum(any(code.startswith("plate_rings") for code in o.warnings) for o in members)
        yield row(name, len(members), refused, *cells, silent, *others, rings)


def by_chance(outcomes: list[Outcome]) -> float:
    """Return how many errors are silent on average if all are normal with their uncertainties."""
    values = [pair for outcome in outcomes for pair in outcome.values.items()]
    return sum(
        2 * float(ndtr(-max(DEVIATIONS, MATERIAL[quantity] / value.uncertainty)))
        for quantity, value in values if value.uncertainty and not value.concerned
    )  # fmt: skip


def coverage(outcomes: list[Outcome]) -> Iterator[tuple[str, bool]]:
    """Yield a line for each quantity where all is stated, and whether it is within the limits."""
    for quantity in MATERIAL:
        inside = [o.values[quantity].is_inside() for o in outcomes if quantity in o.values]
        if not inside:
            continue
        fraction, chance = float(np.mean(inside)), 1.96 * math.sqrt(0.95 * 0.05 / len(inside))
        met = COVERAGE[0] - chance <= fraction <= COVERAGE[1] + chance
        limits = f"(93 to 97 %, ± {100 * chance:.1f} % by chance){'' if met else ': missed'}"
        yield f"{quantity:12s} {100 * fraction:5.1f} % of {len(inside)} {limits}", met


def main() -> int:
    """Measure all records and print the tables; return the exit code."""
    parser = argparse.ArgumentParser(description=str(__doc__).split("\n", maxsplit=1)[0])
    parser.add_argument("--part", default="", help="groups whose name begins so")
    parser.add_argument("--seeds", type=int, default=3, help="records of each condition")
    parser.add_argument("--first", type=int, default=0, help="first seed")
    options = parser.parse_args()
    count = len(conditions())
    tasks = [(k, options.first + n) for k in range(count) for n in range(options.seeds)
             if conditions()[k].group.startswith(options.part)]  # fmt: skip
    with ProcessPoolExecutor(2) as pool:
        outcomes = list(pool.map(_measure_task, tasks, chunksize=2))
    print("\n".join(summary(outcomes)), end="\n\n")
    wrong = []
    for o in outcomes:
        refused = o.refusal and not o.condition.may_be_refused
        if o.silent or o.miscounted or refused:
            silent = [f"{q} {o.values[q].error:+.4g}" for q in o.silent]
            wrong.append(o)
            print(f"{o.condition.group}: {o.condition.name}, seed {o.seed}, "
                  f"{o.drops} drops: {silent} {o.refusal}")  # fmt: skip
    covered = list(coverage([o for o in outcomes if o.condition.is_stated]))
    print(*(line for line, _ in covered), sep="\n")
    for is_stated in (True, False):
        some = [o for o in outcomes if o.condition.is_stated is is_stated]
        print(
            f"{'stated' if is_stated else 'not all stated'}: {sum(len(o.silent) for o in some)} of "
            f"{sum(len(o.values) for o in some)} values silent and material ({by_chance(some):.1f} "
            f"if errors are normal), {sum(o.warned for o in some)} with a warning; "
            f"{sum(bool(o.refusal) for o in some)} of {len(some)} records refused"
        )
    return int(bool(wrong) or not all(met for _, met in covered))


def _measure_task(task: tuple[int, int]) -> Outcome:
    condition = conditions()[task[0]]
    # Functions of faults are not sent between processes.
    return replace(measure(condition, task[1]), condition=replace(condition, fault=None))


if __name__ == "__main__":
    sys.exit(main())
