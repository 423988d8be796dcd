"""Tables of sets, mobilities, levels, forces and compressions, and configurations, damaged."""

from __future__ import annotations

import io
import shutil
import subprocess
import warnings
from contextlib import redirect_stdout
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from injection import executable
from mutate_recordings import mutate, mutated_text
from sentences import INNER, fault_of

import thud
from thud.base.bridge import ask
from thud.base.tables import format_rows
from thud.floors.mobility_fit import fit_mobility
from thud.floors.mobility_table import read_mobility
from thud.floors.survey import rating_table, read_room_levels
from thud.recordings.config import read_config
from thud.recordings.formats.text import read_table
from thud.studies.fitting.record import read_record, time_and_force

if TYPE_CHECKING:
    import random

INPUTS = Path(__file__).parents[2] / "inputs"
CASE = """&ball / &drop / &model name = 'hunt_crossley' /
&hunt_crossley contact_time = 0.02 restitution = 0.8 /"""
SMALL = thud.FiniteElement(radial_elements=2, polar_elements=8)
# Seconds that a run of the executable may take.
PATIENCE = 60


def attempt(chance: random.Random) -> tuple[str, str]:
    """Return what becomes of a table, and how to see it."""
    name = chance.choice(list(READERS))
    original = _originals()[name]
    if chance.random() < 0.6:
        content = mutated_text(original, chance).encode(errors="surrogateescape")
    else:
        content = mutate(original.encode(), np.random.default_rng(chance.getrandbits(32)))
    path = Path(f"{name}.toml" if name == "config" else f"{name}.csv")
    path.write_bytes(content)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            wrong = READERS[name](path, chance)
        word = "NaN" if wrong else "read"
    except thud.ThudError as error:
        wrong = fault_of(error, str(path), content.decode(errors="replace"))
        word = "raw" if wrong else "refused"
    finally:
        path.unlink()
    return word, f"{name}: {wrong}: {content[:3000]!r}" if wrong else ""


def _read_numbers(path: Path) -> np.ndarray:
    return np.column_stack([column.values for column in read_table(path).columns])


def _read_sets(path: Path, _: random.Random) -> str:
    Path("case.nml").write_text(CASE)
    done = subprocess.run(
        [executable(), "case.nml", "--samples", str(path), "-q", "-o", "o", "--threads", "1"],
        capture_output=True, timeout=PATIENCE, check=False,
    )  # fmt: skip
    found = [one.read_bytes() for one in Path("o").iterdir()] if Path("o").exists() else []
    shutil.rmtree("o", ignore_errors=True)
    Path("case.nml").unlink()
    said = done.stderr.decode(errors="surrogateescape")
    if done.returncode in (1, 2):
        if said.count("\n") != 1 or found:
            return f"{said!r} and {len(found)} files"
        raise (thud.InputError, thud.NumericalError)[done.returncode - 1](
            said.strip().removeprefix("thud: ")
        )
    if done.returncode:
        message = f"exit code {done.returncode}: {said}"
        raise RuntimeError(message)
    return "in the results" if any(INNER.search(one.decode()) for one in found) else ""


def _read_mobility(path: Path, chance: random.Random) -> str:
    order = chance.choice([2, 4, 8, 8, 8, None if chance.random() < 0.1 else 1])
    found = fit_mobility(read_mobility(path), order=order)
    said = format_rows(found.rows()) + "".join(map(str, found.notes)) + repr(found)
    ask("check", case=f"&ball / &drop / &model / {found.namelist()}")
    return said if INNER.search(said) else ""


def _read_levels(path: Path, chance: random.Random) -> str:
    found = read_room_levels(path, volume=chance.choice([None, 41.4, 1e5]))
    said = found.to_csv() + format_rows(found.rows()) + format_rows(rating_table(found))
    return said if INNER.search(said + "".join(map(str, found.notes))) else ""


def _read_force(path: Path, _: random.Random) -> str:
    found = read_record(time_and_force(read_table(path)), str(path))
    levels = [
        thud.force_exposure_levels(found.force, found.sample_rate, bands)
        for bands in ("octave", "third")
    ]  # fmt: skip
    return "" if all(np.isfinite(one).all() for one in (*found, *levels)) else "of the record"


def _read_compression(path: Path, chance: random.Random) -> str:
    table = _read_numbers(path)
    if table.shape[1] != 2 or chance.random() < 0.9:
        return ""
    try:
        case = thud.Case(ball=thud.Ball(poisson_ratio=0.49), model=SMALL)
        found = thud.fit(thud.CompressionTarget(*table.T), ["youngs_modulus"], case)
    except thud.ThudError as error:
        message = f"{path}: {error}"
        raise type(error)(message) from error
    said = repr(found) + format_rows(found.rows())
    return said if INNER.search(said) else ""


def _read_config(path: Path, _: random.Random) -> str:
    with redirect_stdout(io.StringIO()):
        read_config(path)
    return ""


READERS = {
    "sets": _read_sets,
    "mobility": _read_mobility,
    "levels": _read_levels,
    "force": _read_force,
    "compression": _read_compression,
    "config": _read_config,
}


@cache
def _originals() -> dict[str, str]:
    """Return a table of each kind."""
    f = np.geomspace(10, 1000, 40)
    y = thud.mobility(thud.Oscillator(), f).values
    depth = np.linspace(0, 0.03, 12)
    force = thud.compress(
        thud.Ball(poisson_ratio=0.49), SMALL, max_deflection=0.03, points=12
    ).force
    t = np.arange(400) / 8000
    pulse = 1500 * np.sin(np.pi * np.minimum(t / 0.02, 1))
    return {
        "sets": "mass, height, exponent # drops\n2.5, 1.0, 1.5\n2.4, 0.9, 1.2\n2.6, 1.1, 2\n",
        "mobility": _csv("frequency (Hz), real, imaginary", f, y.real, y.imag),
        "levels": (INPUTS / "floors/field_levels.csv").read_text(),
        "force": _csv("time, force", t, pulse),
        "compression": _csv("deflection, force", depth, force),
        "config": (INPUTS / "recordings/lab.toml").read_text(),
    }


def _csv(titles: str, *columns: np.ndarray) -> str:
    rows = zip(*columns, strict=True)
    return "\n".join([titles, *(", ".join(f"{value:.9g}" for value in row) for row in rows)]) + "\n"
