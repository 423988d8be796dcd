"""Tables: random layouts around known numbers are read right or refused, with their units."""

from __future__ import annotations

import random
from collections import Counter
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
import pytest
from conftest import naming

import thud
from thud.base.units import UNITS, find_unit
from thud.recordings.signal_files import open_signals
from thud.recordings.table import read_table, time_and_force

if TYPE_CHECKING:
    from pathlib import Path

RATE = 8000.0
ROWS = 40
PULSE = 1500 * np.sin(np.pi * np.arange(ROWS) / ROWS) ** 2
# Sensitivity of a sensor whose values are voltages, N/V.
SENSITIVITY = 250.0
FORCE_UNITS = ["N", "N", "N", "kN", "lbf", "kgf", "daN", "mV", "V", "Newton", "KN", "lbs"]
TIME_UNITS = ["s", "s", "s", "ms", "us", "µs", "sec", "milliseconds", "min"]
OTHER_UNITS = ["m/s^2", "m/s2", "m/s²", "g", "degC", "mm", "V"]


@dataclass
class Written:
    """A column as it is written: name, unit, cells, and numbers in the unit."""

    kind: str
    name: str
    unit: str
    cells: list[str]
    values: np.ndarray = field(default_factory=lambda: np.empty(0))


def numbers(
    chance: random.Random, kind: str, name: str, unit: str, values: np.ndarray, decimal: str
) -> Written:
    """Return a column of numbers in a drawn notation."""
    base, size = UNITS[find_unit(unit)]
    scale = SENSITIVITY if kind == "force" and base == "V" else 1.0
    form = "{:.9f}" if kind == "time" else chance.choice(["{:.4f}", "{:.6e}", "{:.6E}", "{:.5f}"])
    cells = [form.format(value / scale / size) for value in values]
    exact = np.array(list(map(float, cells)))
    if "E" in form and chance.random() < 0.5:
        cells = [cell.replace("E", "D") for cell in cells]
    return Written(kind, name, unit, [cell.replace(".", decimal) for cell in cells], exact)


def draw_columns(chance: random.Random, decimal: str, place: str) -> list[Written]:
    """Return the columns of a table in a drawn order."""
    force_unit = chance.choice(FORCE_UNITS)
    columns = [
        numbers(chance, "force", f"F{i + 1}", force_unit, PULSE / (i + 1), decimal)
        for i in range(chance.choice([1, 1, 2, 3]))
    ]
    if chance.random() < 0.4 and place != "header":
        other = chance.choice(OTHER_UNITS)
        columns.append(numbers(chance, "other", "Acc", other, np.cos(np.arange(ROWS)), decimal))
    if chance.random() < 0.4:
        words = chance.choice([["ok"] * ROWS, ["start"] + [""] * (ROWS - 1), [""] * ROWS])
        columns.append(Written("words", chance.choice(["Comment", "State", "Remark"]), "", words))
    if chance.random() < 0.2:
        columns.append(Written("empty", chance.choice(["", "", "x"]), "", [""] * ROWS))
    if chance.random() < 0.3:
        chance.shuffle(columns)
    times = np.arange(ROWS) / RATE
    # The header states the units of the other columns only.
    unit = "s" if place in {"header", "lvm", "none"} else chance.choice(TIME_UNITS)
    time = numbers(chance, "time", chance.choice(["Time", "t", "Zeit"]), unit, times, decimal)
    columns.insert(0 if chance.random() < 0.8 else chance.randrange(len(columns) + 1), time)
    return columns


def title(column: Written, style: str) -> str:
    """Return name and unit of a column in one of several styles."""
    return column.name + (style.format(column.unit) if column.unit else "")


def draw_table(chance: random.Random) -> tuple[str, list[Written], bool]:
    """Return a text, its columns, and whether it states their units."""
    separator = chance.choice(["\t", ";", ",", ", ", "; ", " ", "   "])
    decimal = "." if "," in separator else chance.choice([".", ","])
    place = chance.choice(["title"] * 5 + ["below", "above", "header", "lvm", "numbered", "none"])
    columns = draw_columns(chance, decimal, place)
    if not separator.strip(" "):
        columns = [column for column in columns if column.kind not in {"words", "empty"}]
    over = separator if chance.random() < 0.7 else chance.choice(["\t", ";", ", ", "   "])
    style = chance.choice([" [{}]", " ({})", " / {}", "[{}]", " in {}", "_{}", ", {}"])
    comment = chance.choice(["", "", "", "# ", "% ", "#", "// "])
    titles = [title(c, style) if place == "title" else c.name for c in columns]
    if "," in style and over.strip() in {",", ""}:
        titles = [f'"{text}"' for text in titles] if over == separator == "," else titles
    units = [chance.choice(["{}", "{}", "[{}]"]).format(c.unit) if c.unit else "" for c in columns]
    lines = [comment + over.join(titles)]
    channels = [c.unit for c in columns if c.kind in {"force", "other"}]
    if place == "below":
        lines.append(comment + over.join(units))
    elif place == "above":
        lines.insert(0, comment + over.join(units))
    elif place == "header":
        lines.insert(0, f"{comment}Unit: {channels[0]}")
    elif place == "lvm":
        lines.insert(0, over.join(["Y_Unit_Label", *channels]))
    elif place == "numbered":
        named = [(i, title(c, style)) for i, c in enumerate(columns, 1) if c.name]
        lines = [f"{comment}Column {i}: {text}" for i, text in named]
    if chance.random() < 0.15:  # one too few, or too many
        cut = [*titles[:-1]] if chance.random() < 0.5 else [*titles, "F9 [lbf]"]
        lines, place = [comment + over.join(cut)], place if place == "title" else "none"
    prose = ["Impact test 3", "Operator: Miller", "# lab 4, hall B", "Date;2026-05-06", "",
             "Serial number;4711", "Range (kN): 20", "Messung vom 3. Mai", "---"]  # fmt: skip
    for _ in range(chance.choice([0, 0, 1, 2, 5])):
        lines.insert(chance.choice([0, 0, 0, len(lines)]), chance.choice(prose))
    end = chance.choice(["", "", "", separator])
    rows = []
    for row in zip(*(column.cells for column in columns), strict=True):
        cells = [f'"{cell}"' if chance.random() < 0.02 else cell for cell in row]
        text = separator.join(cells)
        rows.append((text.rstrip(separator) if chance.random() < 0.5 and not end else text) + end)
    if chance.random() < 0.1:
        rows[chance.randrange(ROWS)] += "  # touch"
    return "\n".join([*lines, *rows, ""]), columns, place != "none"


def outcome(path: Path, chance: random.Random) -> str:
    """Return what becomes of a drawn table: "read", "refused", or what is wrong with it."""
    text, columns, has_units = draw_table(chance)
    coding = chance.choice(["utf-8", "utf-8", "utf-8-sig", "utf-16", "latin-1"])
    end = chance.choice(["\n", "\r\n"])
    path.write_bytes(text.replace("\n", end).encode(coding))
    try:
        table = read_table(path)
        is_force = any(UNITS.get(find_unit(c.unit), ("",))[0] == "N" for c in table.columns)
        stated = {} if is_force or not has_units else {"calibration": f"{SENSITIVITY} N/V"}
        signals = open_signals(path, channel="F1" if stated else None, **stated)
    except thud.InputError:
        return "refused"
    written = {i: c for i, c in enumerate(columns, 1) if c.values.size}
    if {c.number for c in table.columns} != set(written):
        return f"columns {[str(c) for c in table.columns]}"
    for column in table.columns:
        exact = written[column.number]
        if not np.array_equal(column.values, exact.values):
            return f"values of {column}"
        if column.unit and find_unit(column.unit) != find_unit(exact.unit):
            return f"unit of {column}: {column.unit}"
        if has_units and not column.unit and not (exact.kind == "time" and exact.unit == "s"):
            return f"no unit of {column}"
    for signal in signals:
        name = signal.name.rpartition(", ")[2] if ", " in signal.name else "F1"
        (exact,) = [c for c in columns if c.name == name] or [columns[0]]
        base, size = UNITS[find_unit(exact.unit)]
        size *= SENSITIVITY if base == "V" else 1.0
        force = signal.read(0, signal.n_sample)
        if not np.allclose(force, exact.values * (size if has_units else 1.0), rtol=1e-12):
            return f"force of {signal.name}"
        if abs(signal.sample_rate / RATE - 1) > 1e-4 and has_units:
            return f"rate {signal.sample_rate:g}"
    return "read"


def check_layouts(path: Path, count: int, first: int) -> None:
    words: Counter[str] = Counter()
    for seed in range(first, first + count):
        chance = random.Random(seed)
        word = outcome(path, chance)
        assert word in {"read", "refused"}, (seed, word, path.read_bytes()[:600])
        words[word] += 1
    assert words["read"] > 0.5 * count, words


def test_random_layouts_are_read_right_or_refused(tmp_path: Path) -> None:
    check_layouts(tmp_path / "plate.csv", 300, 0)


@pytest.mark.slow
def test_ten_thousand_layouts_are_read_right_or_refused(tmp_path: Path) -> None:
    check_layouts(tmp_path / "plate.csv", 10_000, 1000)
