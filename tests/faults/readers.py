"""Damaged recordings, tables, configurations and studies: read, or refused in one sentence."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
import sysconfig
import tempfile
import tomllib
from datetime import UTC, datetime, timedelta
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from damage import INNER, WORDS, damaged, damaged_text, fault_of, toml

sys.path.insert(0, str(Path(__file__).parents[1] / "driver"))
from recording_files import WRITERS, half_sine

import thud
from thud.base.bridge import ask
from thud.base.tables import format_rows
from thud.floors.mobility_fit import fit_mobility
from thud.floors.mobility_table import read_mobility
from thud.floors.survey import rating_table, read_room_levels
from thud.recordings.config import Config, read_config
from thud.recordings.formats.text import read_table
from thud.recordings.signal import open_signals
from thud.studies.fit import FitStudy, read_fit_study, run_fit
from thud.studies.fitting.record import read_record, time_and_force

if TYPE_CHECKING:
    import random
    from collections.abc import Callable

    # Reads a file; returns what may hold no number that is none.
    Reader = Callable[[Path, random.Random], str]

INPUTS = Path(__file__).parents[2] / "inputs"
# Formats whose library may hang or crash on damaged files.
FRAGILE = {".h5", ".nc", ".mat"}
CASE = """&ball / &drop / &model name = 'hunt_crossley' /
&hunt_crossley contact_time = 0.02 restitution = 0.8 /"""
# Cases and models whose drops take little time; sets, and fraction of the studies, computed.
CASES = ("rubber_ball_100cm.nml", "tyre_one_mass.nml", "tyre.nml", "measured_modes.nml")
QUICK = ("hollow_sphere", "hunt_crossley", "measured_modes", "two_mass")
MAX_SETS, COMPUTED = 40, 0.1
# Entries of the tables of a study.
ODD: list[Any] = [
    0, -1, 1e300, 1e-300, float("nan"), float("inf"), "text", "", True, [], [1, 2], {}, [[1]],
    2**70, -0.0, "nan", [float("nan")], {"value": 1}, {"value": 2, "unit": "mm"}, "é", "../x",
    "\n", 1.5, 10**30, "1e5", ["a"], {"a": {}}, 3, 100, [1] * 50, "kPa", "sobol", "grid",
]  # fmt: skip


def attempt(path: Path, content: bytes, read: Reader, chance: random.Random) -> tuple[str, str]:
    """Return what becomes of a file, and how to see it."""
    path.write_bytes(content)
    try:
        said = read(path, chance)
        wrong = said if INNER.search(said) else ""
        word = "NaN" if wrong else "read"
    except thud.ThudError as error:
        wrong = fault_of(error, str(path), content.decode(errors="replace"))
        word = "raw" if wrong else "refused"
    finally:
        for one in Path().iterdir():
            shutil.rmtree(one) if one.is_dir() else one.unlink()
    return word, f"{wrong}: {content[:3000]!r}" if wrong else ""


def read_recordings(chance: random.Random) -> tuple[str, str]:
    """Damage a recording of a format whose library survives it."""
    name = chance.choice(list(_recordings()))
    return attempt(Path(name), damaged(_recordings()[name], chance), _read_recording, chance)


def _read_recording(path: Path, _: random.Random) -> str:
    calibration = 5000.0 if path.name.startswith("pcm") else None
    channels = "sum" if path.name.startswith("cells") else None
    for signal in open_signals(path, Config(calibration=calibration, channels=channels))[:4]:
        for start in range(0, signal.n_sample, 2**20):
            signal.read(start, min(signal.n_sample, start + 2**20))
        assert len(signal.checksum) == 64
    return ""


@cache
def _recordings() -> dict[str, bytes]:
    """Return recordings by name: of each format, load cells, columns of dates and days."""
    force = half_sine(8000.0, 0.02, 0.02)
    force += np.random.default_rng(1).normal(0, 3, force.size)
    begin = datetime(2026, 11, 23, 10, tzinfo=UTC)
    times = [begin + timedelta(seconds=i / 8000) for i in range(force.size)]
    clock = [f"{t:%d.%m.%Y %H:%M:%S.%f};{v:.2f}" for t, v in zip(times, force, strict=True)]
    days = np.column_stack([46349.5 + np.arange(force.size) / 8000 / 86400, force])
    cells = np.column_stack([0.3 * force, 0.7 * force])
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for file, write in WRITERS.items():
            sound = file.startswith("pcm")
            write(folder / file, force / 5000 if sound else force, 8000.0, "N")
        np.savetxt(folder / "cells.csv", cells, "%.3f", ";", header="fs = 8000\nF1 [N];F2 [N]")
        (folder / "clock.csv").write_text("Datum;Kraft [N]\n" + "\n".join(clock))
        np.savetxt(folder / "days.csv", days, "%.11f", ",")
        paths = sorted(path for path in folder.iterdir() if path.suffix not in FRAGILE)
        return {path.name: path.read_bytes() for path in paths}


def read_tables(chance: random.Random) -> tuple[str, str]:
    """Damage a table of sets, mobilities, levels or forces, or a configuration."""
    name, (original, read) = chance.choice(list(_tables().items()))
    content = damaged(original.encode(), chance)
    if chance.random() < 0.6:
        content = damaged_text(original, chance).encode(errors="surrogateescape")
    path = Path("lab.toml" if name == "config" else f"{name}.csv")
    return attempt(path, content, read, chance)


@cache
def _tables() -> dict[str, tuple[str, Reader]]:
    """Return a table of each kind, and how it is read."""

    def csv(titles: str, *columns: np.ndarray) -> str:
        rows = zip(*columns, strict=True)
        return "\n".join([titles, *(", ".join(f"{x:.9g}" for x in row) for row in rows)]) + "\n"

    f, t = np.geomspace(10, 1000, 40), np.arange(400) / 8000
    y = thud.mobility(thud.Oscillator(), f).values
    pulse = 1500 * np.sin(np.pi * np.minimum(t / 0.02, 1))
    lab = (INPUTS / "recordings/lab.toml").read_text()
    sets = "mass, height, exponent # drops\n2.5, 1.0, 1.5\n2.4, 0.9, 1.2\n2.6, 1.1, 2\n"
    return {
        "sets": (sets, _read_sets),
        "mobility": (csv("frequency (Hz), real, imaginary", f, y.real, y.imag), _read_mobility),
        "levels": ((INPUTS / "floors/field_levels.csv").read_text(), _read_levels),
        "force": (csv("time, force", t, pulse), _read_force),
        "config": (lab, lambda path, _: str(read_config(path))[:0]),
    }


def _read_sets(path: Path, _: random.Random) -> str:
    Path("case.nml").write_text(CASE)
    executable = Path(sysconfig.get_path("scripts")) / "thud"
    done = subprocess.run(
        [executable, "case.nml", "--samples", path, "-q", "-o", "o", "--threads", "1"],
        capture_output=True, timeout=60, check=False,
    )  # fmt: skip
    said = done.stderr.decode(errors="surrogateescape")
    if done.returncode == 0:
        return "".join(one.read_text() for one in Path("o").iterdir())
    assert done.returncode in {1, 2}, (done.returncode, said)
    assert said.count("\n") == 1, said
    assert not Path("o").exists()
    message = said.strip().removeprefix("thud: ")
    raise (thud.InputError, thud.NumericalError)[done.returncode - 1](message)


def _read_mobility(path: Path, chance: random.Random) -> str:
    order = chance.choice([2, 4, 8, 8, 8, None if chance.random() < 0.1 else 1])
    found = fit_mobility(read_mobility(path), order=order)
    ask("check", case=f"&ball / &drop / &model / {found.namelist()}")
    return format_rows(found.rows()) + "".join(map(str, found.notes)) + repr(found)


def _read_levels(path: Path, chance: random.Random) -> str:
    found = read_room_levels(path, volume=chance.choice([None, 41.4, 1e5]))
    tables = format_rows(found.rows()) + format_rows(rating_table(found))
    return found.to_csv() + tables + "".join(map(str, found.notes))


def _read_force(path: Path, _: random.Random) -> str:
    found = read_record(time_and_force(read_table(path)), str(path))
    levels = thud.force_exposure_levels(found.force, found.sample_rate, "third")
    return "" if all(np.isfinite(one).all() for one in (*found, levels)) else "nan"


def read_studies(chance: random.Random) -> tuple[str, str]:
    """Damage a study or fit of the examples: its text, or entries of its tables."""
    name = chance.choice(list(_studies()))
    text = _studies()[name]
    if chance.random() < 0.7:
        table = tomllib.loads(text)
        if chance.random() < 0.5:
            table["case"] = str(INPUTS / chance.choice(CASES))
            table["design"] = table.get("design", {}) | {"size": chance.choice([1, 4, 8])}
        for _ in range(chance.choice([0, 1, 1, 2, 4])):
            _damage(table, chance)
        text = toml(table)
    if chance.random() < 0.5:
        text = damaged_text(text, chance)
    content = text.encode(errors="surrogateescape")
    return attempt(Path(f"{name}.toml"), content, _read_study, chance)


@cache
def _studies() -> dict[str, str]:
    """Return the studies of the examples by name, with paths that hold anywhere."""

    def absolute(found: re.Match[str]) -> str:
        return f'"{(INPUTS if found[1] else INPUTS / "studies") / found[2]}"'

    paths = sorted((INPUTS / "studies").glob("*.toml"))
    files = r'"(\.\./)?([\w/]+\.(?:nml|csv|wav|toml))"'
    return {path.stem: re.sub(files, absolute, path.read_text()) for path in paths}


def _read_study(path: Path, chance: random.Random) -> str:
    """Read a study, and compute it where it is small."""
    kinds = ["sweep", "design", "sensitivity", "uncertainty"]
    named = [kind for kind in kinds if kind in path.stem]
    kind = chance.choice(named if named and chance.random() < 0.9 else kinds)
    is_fit = path.stem.startswith("fit")
    study = read_fit_study(path) if is_fit else thud.read_study(path, kind)  # type: ignore[arg-type]
    sizes = [parameter.size for parameter in study.parameters]
    is_small = len(sizes) <= 3 and np.prod(sizes) <= MAX_SETS
    if not is_small or study.case.model.name not in QUICK or chance.random() > COMPUTED:  # type: ignore[union-attr]
        return ""
    try:
        found = run_fit(study) if isinstance(study, FitStudy) else getattr(thud, kind)(study)
    except thud.ThudError as error:
        # It speaks of a drop, not of the file.
        return str(error).replace("\n", "Traceback")
    # What is not determined has no number.
    return re.sub(r"\bnan\b", "", str(found.table()))


def _damage(table: dict[str, Any], chance: random.Random) -> None:
    """Change, remove or add one entry of a table, or of one in it."""
    while True:
        inner = [value for value in table.values() if isinstance(value, dict) and value]
        if not inner or chance.random() < 0.3:
            break
        table = chance.choice(inner)
    name = chance.choice([*table, "name", "kind", "unit", "fixed", "low", "mean", "heigth"])
    if chance.random() < 0.3:
        table.pop(name, None)
    else:
        table[name] = json.loads(json.dumps(chance.choice([*ODD, chance.choice(WORDS)])))
