"""Recordings of a recorder model, measured: which errors are silent, and what intervals cover.

    .venv/bin/python tests/bench/recorder.py [--part NAME] [--seeds N] [--first N] [--details]

Each condition is recorded with several seeds, written to files with a configuration, and measured.
Told: everything is stated in the configuration, so 95 % of the intervals should contain the truth.
Untold: the record has a fault that nobody states. An error is silent and material if it exceeds
three stated standard uncertainties (with few degrees of freedom, what covers as much), and 0.1 dB,
0.1 ms, 0.01 of restitution or 0.5 % of a peak or a calibration, and no warning concerns it. The
exit code is 1 if there is one, if the coverage is outside 93 to 97 % by more than chance, if a
refusal is not in the documentation or of what can be measured, or if something else is measured as
a drop.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import math
import re
import sys
import tempfile
import time
import warnings
import zlib
from collections import Counter, defaultdict
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field, fields, replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.special import ndtr, stdtrit

import thud
from thud.base.errors import InputError
from thud.recordings.config import Config
from thud.recordings.instruments import Plate

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping

    from recorder_model import Array, Pulse

from recorder_conditions import FLAT, STATIC, Condition, conditions, kind_of
from recorder_model import (
    GRAVITY,
    Ball,
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

DOCS = Path(__file__).parents[2] / "docs"
BANDS = ("31.5", "63", "125", "250", "500")
LEVELS = tuple(f"{band} Hz" for band in BANDS)
CONTACT, RESTITUTION, PEAK, CALIBRATION = "contact", "restitution", "peak", "calibration"
RESONANCE, QUALITY = "f0", "Q"
QUANTITIES = (*LEVELS, CONTACT, RESTITUTION, PEAK, CALIBRATION, RESONANCE, QUALITY)
# Errors that matter: dB, s, and relative ones of peak, calibration, resonance and quality.
MATERIAL = {**dict.fromkeys(LEVELS, 0.1), CONTACT: 1e-4, RESTITUTION: 0.01, PEAK: 5e-3,
            CALIBRATION: 5e-3, RESONANCE: 5e-3, QUALITY: 0.05}  # fmt: skip
# Stated standard uncertainties that an error must exceed.
DEVIATIONS = 3.0
COVERAGE = (0.93, 0.97)
# Warnings of records without a fault, which say nothing about an error.
GENERAL = re.compile(
    r"the mass is not stated|the number of peaks is unknown|"
    r"restitution is known of \d|it is no bounce|"
    r"force plate: (at [\d.]+ Hz the plate reads|up to [\d.]+ Hz the plate|the plate reads)"
)
# Uncertainties that are not included concern what they would widen.
INCLUDED = re.compile(r"uncertainty not stated, and not included: (.*)")
# Two restitutions that differ concern the restitution if they differ by more than 0.01, and the
# force from 0.02 on, 1 % of an impulse.
DIFFER = re.compile(r"impulse and by bounces differ by (-?[\d.]+)")
SUSPECT = 0.02
# Relative standard deviation of the clock of a recorder.
CLOCK = 1e-4
# Keys of the installed package; those it does not know are left out, where a condition is not about
# them.
KNOWN = {field.name for kind in (Config, Plate) for field in fields(kind)}
# What the words of a warning concern; a warning with none of them concerns everything.
CONCERNS = (
    (re.compile(r"\[?\bplate\b|resonance|\bfilter\b"), {*LEVELS, CONTACT, PEAK}),
    (re.compile(r"(?<![\d.])500 Hz|octave_500"), {"500 Hz"}),
    (re.compile(r"\blevels?\b|\boctaves?\b(?! of 500)|\bbands?\b"), set(LEVELS)),
    (re.compile(r"contact time"), {CONTACT}),
    (re.compile(r"restitution|impulse"), {RESTITUTION}),
    (re.compile(r"\bpeaks?\b"), {PEAK}),
    (re.compile(r"calibration"), {*LEVELS, PEAK, RESTITUTION, CALIBRATION}),
)
# Refusals: their words, and the words of the documentation that announce them.
REFUSALS = {
    r"is too close to the bands": "a stated resonance below 1001 Hz",
    r"is clipped": "the force is clipped",
    r"the signal (begins|ends) within the pulse": "within the pulse or less than 1 ms from it",
    r"they are lost": "samples that are lost",
    r"is held, clipped": "a force that is held, clipped",
    r"cannot be distinguished from the noise|: no impact": "cannot be distinguished from the noise",
    r"the sign is not clear": "the sign is not clear",
    r"none of them in a unit of force": "several channels, none of them in a unit of force",
    r"no resonance stands out": "If no resonance stands out",
    r"no clear step|the step is": "no clear step, or one that is uncertain",
    r"deviates by .* from any exponential decay": "fits no exponential decay",
    r"drops at the same instants": "drops at the same instants in several channels",
    r"is given twice|is the same drop as": "the same drop twice",
}


@dataclass(frozen=True)
class Value:
    """Measured quantity: error, its standard uncertainty and degrees of freedom."""

    error: float
    uncertainty: float
    concerned: bool
    freedom: float = math.inf

    def is_within(self, deviations: float) -> bool:
        """Whether the error is within so many deviations of a normal distribution."""
        factor = deviations
        if math.isfinite(self.freedom):
            factor = float(stdtrit(self.freedom, ndtr(deviations)))
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
    """What came of one record: values by quantity, or why there are none."""

    condition: int
    seed: int
    values: dict[str, Value] = field(default_factory=dict)
    drops: int = 0
    refusal: str = ""
    unknown_key: str = ""
    warnings: tuple[str, ...] = ()


# --- one record -------------------------------------------------------------------------------


def generator(condition: Condition, seed: int) -> np.random.Generator:
    """Return the random numbers of a record."""
    return np.random.default_rng([zlib.crc32(f"{condition.group}/{condition.name}".encode()), seed])


def toml(table: Mapping[str, Any], prefix: str = "") -> str:
    """Return a configuration as TOML; keys without a value are left out."""

    def text(value: object) -> str:
        if isinstance(value, str):
            return f'"{value}"'
        if isinstance(value, list | tuple):
            return f"[{', '.join(map(text, value))}]"
        return repr(value)

    plain = {key: value for key, value in table.items() if not isinstance(value, dict)}
    lines = [f"{key} = {text(value)}" for key, value in plain.items() if value is not None]
    tables = {key: value for key, value in table.items() if isinstance(value, dict)}
    lines += [f"[{prefix}{key}]\n{toml(value)}" for key, value in tables.items()]
    return "\n".join(lines) + "\n"


def record(condition: Condition, seed: int, folder: Path) -> tuple[list[Path], Path, Truth]:
    """Write the files and the configuration of a record, and return them with the truth."""
    rng = generator(condition, seed)
    drawn = {
        "mass": rng.uniform(2.4, 2.6), "height": rng.uniform(0.95, 1.05),
        "restitution": rng.uniform(0.72, 0.85), "deformation": rng.uniform(0, 0.003),
    }  # fmt: skip
    ball = Ball(**{**drawn, **condition.ball})
    pulse, truth = drop_pulse(kind_of(condition, seed), ball, rng)
    uncertainties = condition.uncertainties
    error = {key: size * rng.normal() for key, size in uncertainties.items()}
    chain = replace(condition.chain, gain=1 + error.get("calibration", 0.0))
    config: dict[str, Any] = {
        "polarity": "positive", "mass": ball.mass + error.get("mass", 0.0),
        "height": ball.height + error.get("height", 0.0),
        "mass_uncertainty": uncertainties.get("mass", 0.0),
        "height_uncertainty": uncertainties.get("height", 0.0),
        "calibration": f"{chain.full_scale!r} N/FS" if condition.files != "newtons" else None,
        "calibration_uncertainty": uncertainties.get("calibration", 0.0),
    }  # fmt: skip
    config |= condition.config
    if condition.plate_told:
        tau, plate = chain.time_constant, condition.config.get("plate", {})
        config["plate"] = {
            "time_constant": STATIC if math.isinf(tau) else tau, "full_scale": chain.full_scale,
            **({"share": chain.modes[0].share} if "f0" in plate and condition.told else {}),
            **({} if "f0" in plate or "flat_limit" not in KNOWN else {"flat_limit": FLAT}), **plate,
        }  # fmt: skip
    if condition.filter_told and "filter" in KNOWN:
        config["filter"] = condition.config.get("filter", {"kind": "none"})
    for table, key in (("plate", "f0"), ("filter", "cutoff")):
        if key in uncertainties:
            value = config[table][key] * (1 + error[key])
            config[table] = {**config[table], key: value, f"{key}_uncertainty": uncertainties[key]}

    def take(one: Pulse, name: str) -> Path:
        force = plate_force(one, ball, chain, condition.scene, rng)
        if condition.cells:
            return _write_cells(condition, force, folder / name, chain, rng)
        values = electric(force, chain, condition.scene, one.duration, rng)
        return _write(values, folder / name, chain, config, condition.files)

    if condition.cells or condition.files in {"one", "table"}:
        paths = [take(pulse, "drop")]
    elif condition.files.endswith("drops"):
        # Drops of one ball differ in the contact time, and with it in the levels.
        paths = [take(_varied(pulse, rng), f"drop_{k}") for k in range(condition.drops)]
    else:
        paths = _copies(take(_varied(pulse, rng), "drop"), condition.files, chain)
    path = folder / "lab.toml"
    path.write_text(toml(config), encoding="utf-8")
    return paths, path, truth


def _varied(pulse: Pulse, rng: np.random.Generator) -> Pulse:
    """Return a further drop of the same ball: the contact time varies by 1 %."""
    stretch = 1 + 0.01 * rng.normal()
    return pulse.scaled(1 / stretch, stretch)


def _write(values: Array, stem: Path, chain: Chain, config: dict[str, Any], files: str) -> Path:
    codes = convert(values, chain)
    if files == "table":
        volts = codes * (10.0 / 2 ** (chain.bits - 1))
        config["calibration"] = f"{chain.full_scale / 10!r} N/V"
        path = stem.with_suffix(".csv")
        write_table(path, {"Plate [V]": volts}, chain.rate)
        return path
    path = stem.with_suffix(".wav")
    write_sound(path, codes, chain)
    return path


def _write_cells(
    condition: Condition, force: Array, stem: Path, chain: Chain, rng: np.random.Generator
) -> Path:
    """Write the load cells as a table in V, a table in N, or a WAV file."""
    cells = condition.cells
    assert cells is not None
    volts = cells.volts(force, chain, rng)
    newtons = volts / np.array(cells.sensitivities)[:, None]
    path = stem.with_suffix(".wav" if condition.files == "sound" else ".csv")
    if condition.files == "sound":
        write_sound(path, convert(newtons, chain).T, chain)
        return path
    unit, values = ("N", newtons) if condition.files == "newtons" else ("V", volts)
    step = 10 / 2**23 if unit == "V" else 0.001
    titles = (f"F{k} [{unit}]" for k in range(1, 5))
    write_table(path, dict(zip(titles, np.rint(values / step) * step, strict=True)), chain.rate)
    return path


def _copies(path: Path, files: str, chain: Chain) -> list[Path]:
    """Return a file several times, as they are given by mistake."""
    import soundfile

    if files in {"twice", "five times"}:
        return [path] * (2 if files == "twice" else 5)
    values, rate = soundfile.read(path, dtype="int32")
    copy = path.with_name("copy.wav")
    if files == "overlapping":
        soundfile.write(copy, values[int(0.05 * chain.rate) :], rate, "PCM_24")
    elif files == "saved again":
        copy = path.with_name("copy.flac")
        soundfile.write(copy, values, rate, "PCM_24")
    else:
        soundfile.write(
            copy, np.concatenate([values[: int(0.1 * chain.rate)], values]), rate, "PCM_24"
        )
    return [path, copy]


def concern(warning: str) -> set[str]:
    """Return the quantities that a warning concerns."""
    if GENERAL.search(warning):
        return set()
    if missing := INCLUDED.search(warning):
        warning = missing[1].replace("mass", "restitution").replace("drop height", "restitution")
    if differ := DIFFER.search(warning):
        difference = abs(float(differ[1]))
        named = {RESTITUTION} if difference >= MATERIAL[RESTITUTION] else set()
        return named | {*LEVELS, PEAK} if difference >= SUSPECT else named
    named = [quantities for words, quantities in CONCERNS if words.search(warning)]
    return set().union(*named) if named else set(QUANTITIES)


def measure(task: tuple[int, int]) -> Outcome:
    """Record a condition with a seed, measure it, and compare with the truth."""
    index, seed = task
    condition = conditions()[index]
    with tempfile.TemporaryDirectory() as directory, warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            if condition.weight or condition.taps:
                calibrated = _tapped if condition.taps else _calibrated
                values, said = calibrated(condition, seed, Path(directory))
                return Outcome(index, seed, values, 1, warnings=said)
            paths, config, truth = record(condition, seed, Path(directory))
            recording = thud.read_recording(paths, config=config)
            said = (
                *(n.message for n in recording.notes if n.is_warning),
                *(str(warning.message) for warning in caught),
            )
            values = dict(compare(recording, truth, said))
        except InputError as error:
            text = str(error).replace(directory, "")
            if re.search(r"lab\.toml: .* is not known", text):
                return Outcome(index, seed, unknown_key=text)
            return Outcome(index, seed, refusal=text)
        return Outcome(index, seed, values, len(recording.drops), warnings=said)


def compare(recording: Any, truth: Truth, said: Iterable[str]) -> Iterator[tuple[str, Value]]:  # noqa: ANN401
    """Yield the quantities of a recording with their errors."""
    concerned = set().union(*map(concern, said)) if said else set()
    estimates = dict(zip(LEVELS, recording.level_estimates(), strict=True))
    estimates[CONTACT] = recording.estimates["contact_time"]
    estimates[RESTITUTION] = recording.estimates["restitution"]
    true = {**dict(zip(LEVELS, truth.levels, strict=True)), CONTACT: truth.contact_time,
            RESTITUTION: truth.restitution}  # fmt: skip
    for quantity, estimate in estimates.items():
        if not math.isfinite(estimate.value):
            continue
        error = float(estimate.value - true[quantity])
        if estimate.upper_bound:
            error = min(error, 0.0)
        is_concerned = quantity in concerned
        yield quantity, Value(error, estimate.uncertainty, is_concerned, estimate.freedom)
    peaks = [drop.peak_force for drop in recording.drops]
    count = len(peaks)
    mean = float(np.mean([peak.value for peak in peaks]))
    variance = float(np.mean([peak.uncertainty**2 for peak in peaks])) / count
    if count > 1:
        variance += float(np.var([peak.value for peak in peaks], ddof=1)) / count
    relative = math.hypot(math.sqrt(variance) / mean, recording.calibration_uncertainty or 0.0)
    freedom = count - 1 if count > 1 else math.inf
    yield PEAK, Value(mean / truth.peak - 1, relative, PEAK in concerned, freedom)


def _calibrated(
    condition: Condition, seed: int, folder: Path
) -> tuple[dict[str, Value], tuple[str, ...]]:
    from thud.recordings.calibration import calibrate

    weight, chain = condition.weight, condition.chain
    assert weight is not None
    path = folder / "weight.wav"
    write_sound(
        path, convert(weight_record(weight, chain, generator(condition, seed)), chain), chain
    )
    result = calibrate(path, force=weight.mass * GRAVITY, uncertainty=1e-4, unit="FS")
    factor = float(result.chain.split()[0])
    said = tuple(str(note) for note in result.notes if note.is_warning)
    concerned = CALIBRATION in set().union(*map(concern, said)) if said else False
    u = result.uncertainty
    return {CALIBRATION: Value(factor / chain.full_scale - 1, u, concerned)}, said


def _tapped(
    condition: Condition, seed: int, folder: Path
) -> tuple[dict[str, Value], tuple[str, ...]]:
    try:
        from thud.recordings.plate_tap import calibrate_tap
    except ImportError as error:
        message = "lab.toml: calibrate_tap is not known"
        raise InputError(message) from error
    chain, path = condition.chain, folder / "tap.wav"
    rng = generator(condition, seed)
    values = tap_record(condition.taps, chain, rng)
    write_sound(path, convert(values, chain), chain)
    result, mode = calibrate_tap(path), chain.modes[0]
    # As an error of the recorder's clock.
    clock = 1 + CLOCK * rng.normal()
    pairs = {
        RESONANCE: (clock * result.frequency / mode.frequency, result.frequency_uncertainty),
        QUALITY: (result.quality / mode.quality, result.quality_uncertainty),
    }
    return {key: Value(ratio - 1, u, concerned=False) for key, (ratio, u) in pairs.items()}, ()


# --- report -----------------------------------------------------------------------------------


@cache
def documentation() -> str:
    """Return the pages on recordings."""
    return " ".join(
        " ".join(path.read_text(encoding="utf-8").split())
        for path in sorted(DOCS.glob("recordings*.md"))
    )


def is_named(refusal: str) -> bool:
    """Whether the documentation announces a refusal."""
    return any(
        re.search(words, refusal) and phrase in documentation()
        for words, phrase in REFUSALS.items()
    )


def cell(values: list[tuple[str, Value]]) -> str:
    """Return how many values are inside their intervals, of how many, and how many are silent."""
    if not values:
        return "–"
    inside = sum(value.is_inside() for _, value in values)
    silent = sum(value.is_silent(quantity) for quantity, value in values)
    return f"{inside}/{len(values)}" + (f" **{silent}**" if silent else "")


def row(*cells: object) -> str:
    """Return a row of a table."""
    return f"| {' | '.join(map(str, cells))} |"


def grouped(
    outcomes: list[Outcome], key: Callable[[Outcome], str]
) -> Iterator[tuple[str, list[Outcome]]]:
    """Yield outcomes by a key, in the order of its first use."""
    groups = defaultdict(list)
    for outcome in outcomes:
        groups[key(outcome)].append(outcome)
    yield from groups.items()


def table(outcomes: list[Outcome], key: Callable[[Outcome], str]) -> Iterator[str]:
    """Yield a table of outcomes by a key: inside/values, and silent ones in bold."""
    shown = [q for q in QUANTITIES if any(q in outcome.values for outcome in outcomes)]
    yield row("", "measured", "refused", *shown)
    yield row(*["---"] * (3 + len(shown)))
    for name, members in grouped(outcomes, key):
        measured = [outcome for outcome in members if outcome.values]
        refused = sum(bool(outcome.refusal) for outcome in members)
        skipped = "" if measured or refused else " (key not known)"
        cells = [cell([(q, o.values[q]) for o in measured if q in o.values]) for q in shown]
        yield row(name + skipped, len(measured), refused, *cells)


def summary(outcomes: list[Outcome]) -> Iterator[str]:
    """Yield the table of docs/recordings_theory.md: what is inside is stated of told records."""
    columns: dict[str, tuple[str, ...]] = {
        "levels": LEVELS, "contact time": (CONTACT,), "restitution": (RESTITUTION,),
        "peak": (PEAK,), "calibration": (CALIBRATION,), "f0, Q": (RESONANCE, QUALITY),
    }  # fmt: skip
    yield row("conditions", "records", "refused", *columns, "silent", "warned", "miscounted")
    yield row(*["---"] * (6 + len(columns)))

    def name_of(outcome: Outcome) -> str:
        condition = conditions()[outcome.condition]
        return condition.group.removesuffix(" untold") + ", untold" * (not condition.told)

    for name, members in grouped(outcomes, name_of):
        cells = []
        for quantities in columns.values():
            values = [o.values[q] for o in members for q in quantities if q in o.values]
            inside = sum(value.is_inside() for value in values)
            hidden = not values or name.endswith("untold")
            cells.append("" if hidden else f"{100 * inside / len(values):.0f} %")
        refused = sum(bool(outcome.refusal) for outcome in members)
        errors = len(silent(members)), warned(members), len(miscounted(members))
        yield row(name, len(members), refused, *cells, *errors)


def silent(outcomes: list[Outcome]) -> list[tuple[Outcome, str, Value]]:
    """Return the silent and material errors."""
    return [
        (outcome, quantity, value)
        for outcome in outcomes
        for quantity, value in outcome.values.items()
        if value.is_silent(quantity)
    ]


def by_chance(outcomes: list[Outcome]) -> float:
    """Return how many errors are silent on average if all are normal with their uncertainties."""
    values = [pair for outcome in outcomes for pair in outcome.values.items()]
    tails = [
        2 * float(ndtr(-max(DEVIATIONS, MATERIAL[quantity] / value.uncertainty)))
        for quantity, value in values
        if value.uncertainty and not value.concerned
    ]
    return sum(tails)


def miscounted(outcomes: list[Outcome]) -> list[Outcome]:
    """Return the records in which something else counts as a drop, or a drop does not."""
    return [o for o in outcomes if o.values and o.drops != conditions()[o.condition].drops]


def warned(outcomes: list[Outcome]) -> int:
    """Return the number of material errors beyond the uncertainty that a warning concerns."""
    values = [pair for outcome in outcomes for pair in outcome.values.items()]
    return sum(v.concerned and replace(v, concerned=False).is_silent(q) for q, v in values)


def coverage(outcomes: list[Outcome]) -> Iterator[tuple[str, bool]]:
    """Yield a line for each quantity of the told records, and whether it is within the limits."""
    for quantity in QUANTITIES:
        values = [o.values[quantity] for o in outcomes if quantity in o.values]
        if not values:
            continue
        fraction = float(np.mean([value.is_inside() for value in values]))
        chance = 1.96 * math.sqrt(0.95 * 0.05 / len(values))
        met = COVERAGE[0] - chance <= fraction <= COVERAGE[1] + chance
        line = (
            f"{quantity:12s} {100 * fraction:5.1f} % of {len(values)} (93 to 97 %, "
            f"± {100 * chance:.1f} % by chance){'' if met else ': missed'}"
        )
        yield line, met


def main() -> int:
    """Measure all records and print the tables; return the exit code."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", maxsplit=1)[0])
    parser.add_argument("--part", help="groups whose name begins so")
    parser.add_argument("--seeds", type=int, default=5, help="records of each condition")
    parser.add_argument("--first", type=int, default=0, help="first seed")
    parser.add_argument(
        "--details", action="store_true", help="print each silent error and refusal"
    )
    options = parser.parse_args()
    chosen = [k for k, c in enumerate(conditions()) if c.group.startswith(options.part or "")]
    if not chosen:
        parser.error(
            f"no such part; parts: {', '.join(dict.fromkeys(c.group for c in conditions()))}"
        )
    seeds = range(options.first, options.first + options.seeds)
    start = time.perf_counter()
    with ProcessPoolExecutor(2) as pool:
        outcomes = list(
            pool.map(measure, [(k, seed) for k in chosen for seed in seeds], chunksize=2)
        )
    known = conditions()
    by_condition = list(
        table(outcomes, lambda o: f"{known[o.condition].group}: {known[o.condition].name}")
    )
    print("\n".join(by_condition), end="\n\n")
    print("\n".join(table(outcomes, lambda o: known[o.condition].group)), end="\n\n")
    loud = silent(outcomes)
    if options.details:
        details(outcomes, loud)
    told = [o for o in outcomes if known[o.condition].told]
    drops = [o for o in told if CONTACT in o.values]
    if drops:
        kinds = table(drops, lambda o: kind_of(known[o.condition], o.seed))
        print("told, by the kind of the pulse")
        print("\n".join(kinds), end="\n\n")
    covered = list(coverage(told))
    print("\n".join(summary(outcomes)), end="\n\n")
    print("told: inside the 95 % interval")
    print("\n".join(f"  {line}" for line, _ in covered))
    alarms = Counter(
        re.sub(r"[\d.]+", "#", w.rpartition("wav: ")[2])
        for o in told
        for w in o.warnings
        if concern(w)
    )
    for text, count in alarms.most_common(12):
        print(f"  {count} warnings in told records: {text[:150]}")
    refused = [o for o in outcomes if o.refusal]
    unnamed = [o for o in refused if not is_named(o.refusal)]
    wrong = [o for o in refused if not known[o.condition].may_be_refused]
    for is_told in (True, False):
        some = [o for o in outcomes if known[o.condition].told is is_told]
        count = sum(len(o.values) for o in some)
        chance = by_chance(some)
        hidden = sum(known[o.condition].told is is_told for o, _, _ in loud)
        said_no = sum(bool(o.refusal) for o in some)
        print(
            f"{'told' if is_told else 'untold'}: {hidden} of {count} values silent and material "
            f"({chance:.1f} if errors are normal), "
            f"{warned(some)} with a warning; {said_no} of {len(some)} records refused"
        )
    skipped = sum(bool(o.unknown_key) for o in outcomes)
    print(
        f"{len(unnamed)} refusals not in the documentation, {len(wrong)} of what can be measured, "
        f"{skipped} records with keys that are not known"
    )
    print(
        f"{len(chosen)} conditions, {len(outcomes)} records in {time.perf_counter() - start:.0f} s"
    )
    others = miscounted(outcomes)
    print(f"{len(others)} records with another number of drops")
    return int(bool(loud or unnamed or wrong or others or not all(met for _, met in covered)))


def details(outcomes: list[Outcome], loud: list[tuple[Outcome, str, Value]]) -> None:
    """Print silent errors, and refusals."""
    known = conditions()
    for outcome, quantity, value in loud:
        c = known[outcome.condition]
        scale = 1e3 if quantity == CONTACT else 1 if quantity in {*LEVELS, RESTITUTION} else 100
        print(
            f"silent: {c.group}: {c.name}, seed {outcome.seed}, {kind_of(c, outcome.seed)}: "
            f"{quantity}: error "
            f"{scale * value.error:+.3f}, u {scale * value.uncertainty:.4f}, {outcome.drops} drops"
        )
    for outcome in miscounted(outcomes):
        c = known[outcome.condition]
        print(f"{outcome.drops} drops: {c.group}: {c.name}, seed {outcome.seed}")
    for outcome in outcomes:
        if outcome.refusal:
            c = known[outcome.condition]
            where = "" if is_named(outcome.refusal) else " (not in docs)"
            where += "" if c.may_be_refused else " (can be measured)"
            print(f"refused{where}: {c.group}: {c.name}, seed {outcome.seed}: {outcome.refusal}")


if __name__ == "__main__":
    sys.exit(main())
