"""Tables: any layout of known numbers is read right or refused, with units; rounded times."""

from __future__ import annotations

import random
import re
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from itertools import product

import numpy as np
import pytest
from conftest import naming
from recording_files import opened
from refusals.core import write

import thud
from thud.base.units import UNITS, find_unit
from thud.recordings.formats.text import read_channels, read_table
from thud.studies.fitting.record import read_record, time_and_force

pytestmark = pytest.mark.usefixtures("working_directory")
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


def numbers(chance: random.Random, name: str, unit: str, values: np.ndarray) -> Written:
    """Return a column of numbers in a drawn notation."""
    base, size = UNITS[find_unit(unit)]
    kind = "time" if base == "s" else "force" if name[0] == "F" else "other"
    scale = SENSITIVITY if kind == "force" and base == "V" else 1.0
    forms = ["{:.4f}", "{:.6e}", "{:.6E}", "{:.5f}", "{:,.4f}"]
    form = "{:.9f}" if kind == "time" else chance.choice(forms)
    cells = [form.format(value / scale / size) for value in values]
    exact = np.array([float(cell.replace(",", "")) for cell in cells])
    if "E" in form and chance.random() < 0.5:
        cells = [cell.replace("E", "D") for cell in cells]
    return Written(kind, name, unit, cells, exact)


def draw_columns(chance: random.Random, separator: str, decimal: str, place: str) -> list[Written]:
    """Return the columns of a table in a drawn order."""
    groups = ["", "'", "\N{NO-BREAK SPACE}", ",.".replace(decimal, ""), " "]
    group = chance.choice([mark for mark in groups if not mark or mark not in separator])
    force_unit = chance.choice(FORCE_UNITS)
    columns = [
        numbers(chance, f"F{i + 1}", force_unit, PULSE / (i + 1))
        for i in range(chance.choice([1, 1, 2, 3]))
    ]
    if chance.random() < 0.4 and place != "header":
        other = chance.choice(OTHER_UNITS)
        columns.append(numbers(chance, "Acc", other, np.cos(np.arange(ROWS))))
    if chance.random() < 0.4:
        words = chance.choice([["ok"] * ROWS, ["start"] + [""] * (ROWS - 1), [""] * ROWS])
        columns.append(Written("words", chance.choice(["Comment", "State", "Remark"]), "", words))
    if chance.random() < 0.2:
        columns.append(Written("empty", chance.choice(["", "", "x"]), "", [""] * ROWS))
    if chance.random() < 0.3:
        chance.shuffle(columns)
    # The header states the units of the other columns only.
    unit = "s" if place in {"header", "lvm", "none"} else chance.choice(TIME_UNITS)
    time = numbers(chance, chance.choice(["Time", "t", "Zeit"]), unit, np.arange(ROWS) / RATE)
    columns.insert(0 if chance.random() < 0.8 else chance.randrange(len(columns) + 1), time)
    for column in columns:
        marks = str.maketrans({",": group, ".": decimal})
        column.cells = [cell.translate(marks) for cell in column.cells]
    return columns


def title(column: Written, style: str) -> str:
    """Return name and unit of a column in one of several styles."""
    return column.name + (style.format(column.unit) if column.unit else "")


def draw_table(chance: random.Random) -> tuple[str, list[Written], bool]:
    """Return a text, its columns, and whether it states their units."""
    separator = chance.choice(["\t", ";", ",", ", ", "; ", " ", "   "])
    decimal = "." if "," in separator else chance.choice([".", ","])
    place = chance.choice(["title"] * 5 + ["below", "above", "header", "lvm", "numbered", "none"])
    columns = draw_columns(chance, separator, decimal, place)
    if not separator.strip(" "):
        columns = [column for column in columns if column.kind not in {"words", "empty"}]
    over = separator if chance.random() < 0.7 else chance.choice(["\t", ";", ", ", "   "])
    style = chance.choice([" [{}]", " ({})", " / {}", "[{}]", " in {}", "_{}", ", {}"])
    comment = chance.choice(["", "", "", "# ", "% ", "#", "// "])
    titles = [title(c, style) if place == "title" else c.name for c in columns]
    if "," in style and over == separator == ",":
        titles = [f'"{text}"' for text in titles]
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
    return "\n".join([*lines, *draw_rows(chance, columns, separator), ""]), columns, place != "none"


def draw_rows(chance: random.Random, columns: list[Written], separator: str) -> list[str]:
    """Return the rows of a table with drawn quotes, ends of lines and comments."""
    end = chance.choice(["", "", "", separator])
    rows = []
    for row in zip(*(column.cells for column in columns), strict=True):
        cells = [f'"{cell}"' if chance.random() < 0.02 else cell for cell in row]
        text = separator.join(cells)
        rows.append((text.rstrip(separator) if chance.random() < 0.5 and not end else text) + end)
    if chance.random() < 0.1:
        rows[chance.randrange(ROWS)] += "  # touch"
    return rows


def is_read(seed: int) -> bool:
    """Whether a drawn table is read, not refused, and then with its numbers, units and rate."""
    chance = random.Random(seed)  # noqa: S311 - layouts are no secrets
    text, columns, has_units = draw_table(chance)
    coding = chance.choice(["utf-8", "utf-8", "utf-8-sig", "utf-16", "latin-1"])
    end = chance.choice(["\n", "\r\n"])
    path = write("plate.csv", text.replace("\n", end).encode(coding))
    try:
        table = read_table(path)
        is_force = any(UNITS.get(find_unit(c.unit), ("",))[0] == "N" for c in table.columns)
        stated = {} if is_force or not has_units else {"calibration": f"{SENSITIVITY} N/V"}
        signals = opened(path, channel="F1" if stated else None, **stated)
    except thud.InputError:
        return False
    where = f"seed {seed}: {text[:600]}"
    written = {i: c for i, c in enumerate(columns, 1) if c.values.size}
    assert {c.number for c in table.columns} == set(written), where
    for column in table.columns:
        exact = written[column.number]
        np.testing.assert_array_equal(column.values, exact.values, where)
        if column.unit or (has_units and exact.unit != "s"):
            assert find_unit(column.unit) == find_unit(exact.unit), where
    for signal in signals:
        name = signal.name.rpartition(", ")[2] if ", " in signal.name else "F1"
        (exact,) = [c for c in columns if c.name == name] or [columns[0]]
        base, size = UNITS[find_unit(exact.unit)]
        size *= SENSITIVITY if base == "V" else 1.0
        force = signal.read(0, signal.n_sample)
        expected = exact.values * (size if has_units else 1.0)
        np.testing.assert_allclose(force, expected, 1e-12, err_msg=where)
        assert not has_units or signal.sample_rate == pytest.approx(RATE, rel=1e-4), where
    return True


@pytest.mark.parametrize(
    ("count", "first"), [(300, 0), pytest.param(10_000, 1000, marks=pytest.mark.slow)]
)
def test_random_layouts_are_read_right_or_refused(count: int, first: int) -> None:
    assert sum(is_read(seed) for seed in range(first, first + count)) > 0.5 * count


# Ordinary layouts of loggers and spreadsheets: lines above the numbers, and a row of
# time, forces, N, and an acceleration; {t} in s, {m} in ms, {a} and {b} forces in the unit.
LAYOUTS = [
    ("lbf", "Time [s] Force [lbf]", "{t} {a}"),
    ("lbf", "# Time [s]   Force [lbf]", "{t} {a}"),
    ("lbf", "Time [s]\tForce [lbf]", "{t}   {a}"),
    ("lbf", "Time [s];Force [lbf];", "{t};{a}"),
    ("lbf", "Time [s],Force [lbf]", "{t},{a},"),
    ("lbf", "Time [s],Force [lbf],", "{t},{a},"),
    ("lbf", "Time [s];Force [lbf]\nlab 4\nhall B\ngate 7\nMiller", "{t};{a}"),
    ("kN", ";F1 [kN];F2 [kN];a [m/s2]", "{t};{a};{b};0.010"),
    ("kN", "s;kN;kN;m/s2\nTime;F1;F2;a", "{t};{a};{b};0.010"),
    ("kN", "Time;F1;F2;a\n[ms];[kN];[kN];[g]", "{m};{a};{b};0.010"),
    ("kN", "Time;F1;F2;a\n\ns;kN;kN;m/s^2\n", "{t};{a};{b};0.010"),
    ("kN", "Y_Unit_Label\tkN\tkN\tm/s^2\n***End_of_Header***\nX_Value\tF1\tF2\ta\tComment",
     "{t}\t{a}\t{b}\t0.010"),
    ("kN", ("LabVIEW Measurement\nSeparator\tTab\nTime_Pref\tAbsolute\nOperator\tlab\n"
     "Date\t2026/05/06\nTime\t14:20:11.123\n***End_of_Header***\t\n\t\nChannels\t1\t\t\n"
     "Samples\t40\t\nDate\t2026/05/06\t\nTime\t14:20:11.123\t\nY_Unit_Label\tkN\t\n"
     "X_Dimension\tTime\t\nX0\t0.0000E+0\t\nDelta_X\t0.000125\t\n***End_of_Header***\t\t\n"
     "X_Value\tPlate\tComment"), "{t}\t{a}"),
    ("V", "x-axis,1\nsecond,Volt", "{t},{a}"),
    ("V", "Zeitachse;Channel A\n(ms);(V)\n", "{m};{a}"),
    ("N", ("Start time: 5/6/2026 10:00:00\nSample rate: 8000\nRange: 20 kN, gain 4\nTime (s)\t"
     "Plate (Collected) (N)"), "{t}\t{a}"),
    ("kN", "Units: s, kN, kN, V\nTime,F1,F2,Trigger", "{t},{a},{b},0.5"),
    ("kN", "Unit;kN\nTime;F1;F2", "{t};{a};{b}"),
    ("kN", "Unit: s, kN\nTime,Force,Comment", "{t},{a},"),
    ("kN", "Unit: kN;kN\nx;F1;F2", "{t};{a};{b}"),
    ("kN", "Time (ms)\tState\tF1 (kN)\tF2 (kN)", "{m}\tok\t{a}\t{b}"),
    ("N", "t/s,F1/N,F2/N", "{t},{a},{b}"),
    ("N", "F2 in N,F1 in N,Time in ms", "{b},{a},{m}"),
    ("N", "\tTime [s]\tF1 (raw) [N]\tF2 [N] right", "\t{t}\t{a}\t{b}"),
    ("N", "Time [s];Force [Newton]", "{t};{d}"),
    ("daN", "\ufeffTime_ms;Force_daN;Remark", "{m};{a};"),
    ("kgf", "Time, s;Force, kgf", "{t} s;{a} kgf"),
    ("mV", "Time [s]\tForce [mV]", "{t}\t{a}"),
    # With a rate in the header.
    ("kN", "Sample rate;8 kHz\nUnit;kN\nForce", "{a};"),
    ("kN", "Sampling Frequency (Hz): 8000\nForce (kN)", "{a}"),
    ("kN", "// dt [us]: 125\n// unit: kN", "{a}"),
    ("kN", "; Abtastrate = 8,0 kHz\n; Einheit = kN", "{A};"),
    ("kN", "fs\t8000\nForce\n[kN]", "{A};"),
    ("kN", "t_ms F_kN", "{m} {a}"),
    ("kN", "Sample rate in Hz\t8000\nKraft in kN", "{a}"),
    ("kN", "Zeit / s;Kraft / kN", "{T};{A}"),
    ("kN", "Messung Nr. 3\nDatum;06.05.2024\n\nZeit;Kraft\ns;kN", "{T};{A}"),
    ("kN", "time (s)\tforce / kN\tstate", "{t}\t{a}\tok"),
    ("kN", '"time","Force, kN"', "{t},{a}"),
    # Numbers of samples are no times, and these lines no factors.
    ("N", "fs: 8000\nNo;Force [N]", "{i};{a}"),
    ("N", "fs: 8000\nGain;1,0\nNo;Force [N]", "{i};{a}"),
    ("N", "fs: 8000\nCalibration: 2026-05-06\nForce [N]", "{a}"),
    ("N", "fs: 8000\nScale;full\nForce [N]", "{a}"),
    # Commas between numbers.
    ("N", "fs: 8000\nF [N];", "{A};"),
    ("N", "fs: 8000\nF [N],G", "{a},0"),
    ("N", "fs: 8.000 Hz", "{A};"),
    # Quotes, and blanks around cells and comments.
    ("N", "Time [s],Force [N]", '  "{T}" , "{A}",'),
    ("kN", "# plate\n\ntime_s;force_kN", " {t} ;  {a} # x"),
    ("kN", "t_ms\tF_kN", "  {m} \t  {a}  #x"),
]  # fmt: skip


@pytest.mark.parametrize(
    "coding", [("utf-8", "\n"), ("utf-8-sig", "\r\n"), ("utf-16", "\r"), ("latin-1", "\r\n")]
)
@pytest.mark.parametrize(("unit", "head", "row"), LAYOUTS)
def test_ordinary_layouts_are_read_with_their_units(
    unit: str, head: str, row: str, coding: tuple[str, str]
) -> None:
    base, size = UNITS[unit]
    size *= SENSITIVITY if base == "V" else 1.0
    numbers = [
        {"i": str(i), "t": f"{i / RATE:.6f}", "m": f"{1e3 * i / RATE:.3f}",
         "a": f"{force / size:.9f}", "b": f"{force / size / 2:.9f}",
         "d": f"{force:.8E}".replace("E", "D")}
        for i, force in enumerate(PULSE)
    ]  # fmt: skip
    commas = [{key.upper(): cell.replace(".", ",") for key, cell in n.items()} for n in numbers]
    lines = [row.format(**n, **c) for n, c in zip(numbers, commas, strict=True)]
    text = "\n".join([head.removesuffix("\n"), *lines, ""]).lstrip("\n")
    encoding, end = coding
    path = write("plate.csv", text.replace("\n", end).encode(encoding, errors="ignore"))
    stated = {"calibration": f"{SENSITIVITY} N/V"} if base == "V" else {}
    choice = {"channels": "sum"} if "F2" in head else {"channel": 1} if "],G" in head else {}
    (signal,) = opened(path, **stated, **choice)
    force = signal.read(0, signal.n_sample)
    np.testing.assert_allclose(force, PULSE * (1.5 if "F2" in head else 1.0), atol=1e-4)
    assert signal.sample_rate == pytest.approx(RATE, rel=1e-5)
    # A record of time and force in s and N.
    if "F2" not in head and base != "V" and {"{t}", "{T}", "{m}"} & set(re.findall("{.}", row)):
        record = time_and_force(read_table(path))
        np.testing.assert_allclose(record[:, 1], PULSE, atol=1e-4)
        np.testing.assert_allclose(record[:, 0], np.arange(ROWS) / RATE, atol=1e-6)


EXCEL = datetime(2026, 11, 23, 9, 58, 59, 980000)  # noqa: DTZ001 - spreadsheets have no time zone


@pytest.mark.parametrize(
    ("title", "shown"),
    [
        ("Datum;Kraft [kN]", "%d.%m.%Y %H:%M:%S,%f"),
        ("Datum;Uhrzeit;Kraft [kN]", "%d.%m.%Y;%H:%M:%S,%f"),
        ("Time;Force [kN]", "%H:%M:%S.%f"),
        ("Date;Force [kN]", "%Y-%m-%d %H:%M:%S.%f"),
        ("Timestamp;Force [kN]", "%Y-%m-%dT%H:%M:%S.%fZ"),
        ("Date;Force [kN]", "%m/%d/%Y %I:%M:%S.%f %p"),
        ("Date;Force [kN]", "%M:%S.%f"),
    ],
)
def test_dates_and_times_of_day_show_no_rate(title: str, shown: str) -> None:
    mark = "," if ",%f" in shown else "."
    rows = (
        (EXCEL + timedelta(seconds=i / RATE)).strftime(shown)
        + f";{force / 1e3:.6f}".replace(".", mark)
        for i, force in enumerate(PULSE)
    )
    path = write("excel.csv", "\n".join([title, *rows]))
    with pytest.raises(thud.InputError, match=naming("excel.csv", "sample_rate")):
        opened(path)
    (signal,) = opened(path, sample_rate=8000)
    assert signal.sample_rate == RATE
    np.testing.assert_allclose(signal.read(0, ROWS), PULSE, atol=1e-3)


@pytest.mark.parametrize(
    ("rate", "name", "unit", "encoding"),
    [
        ("サンプリング周波数: 8000 Hz", "力", "（N）", "cp932"),  # noqa: RUF001 - as printed
        ("샘플링 주파수: 8000 Hz", "충격력", " (N)", "cp949"),
        ("온도: 20 ℃\n샘플링 주파수: 8000 Hz", "충격력", " (N)", "cp949"),
        ("Prüfer: Müller\nAbtastrate: 8000 Hz", "Stoßkraft", " (N)", "latin-1"),
        ("Prüfer: Müller – Lab\nAbtastrate: 8000 Hz", "Stoßkraft", " (N)", "cp1252"),
    ],
)
def test_headers_are_read_in_encodings_of_spreadsheets(
    rate: str, name: str, unit: str, encoding: str
) -> None:
    rows = "\n".join(f"{force:.6f}" for force in PULSE)
    path = write("drop.csv", f"{rate}\n{name}{unit}\n{rows}".encode(encoding))
    (channel,) = read_channels(path)
    assert (channel.sample_rate, channel.unit, channel.name) == (RATE, "N", name)


@pytest.mark.parametrize("head", ["Time;Plate\n[s];[stone]", "[s];[stone]\nTime;Plate"])
def test_units_in_brackets_are_no_titles(head: str) -> None:
    columns = read_table(write("t.csv", f"{head}\n0.5;1\n")).columns
    assert [(column.name, column.unit) for column in columns] == [("Time", "s"), ("Plate", "stone")]


@pytest.mark.parametrize(
    ("text", "unit"),
    [("nanoseconds", "ns"), ("Newtons", "N"), ("KN", "kN"), ("µs", "us"), ("m·s^-2", ""),
     ("m/s²", "m/s2"), ("m/(N s)", "m/(Ns)"), ("dB(A)", ""), ("dB re 20 µPa", "dB"), ("mn", "")],
)  # fmt: skip
def test_spellings_of_units(text: str, unit: str) -> None:
    assert find_unit(text) == unit


def rows_read(text: str) -> np.ndarray:
    return np.column_stack([c.values for c in read_table(write("plate.csv", text)).columns])


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("0.100020;1,575", (0.10002, 1575)),
        ('"0.100020","1,575"', (0.10002, 1575)),
        ("0,100020;1,575", (0.10002, 1.575)),
        ('"0,100020","1.575"', (0.10002, 1575)),
        ("0.100020,1.575", (0.10002, 1.575)),
        ("12,345.5;-1,234,567.25", (12345.5, -1234567.25)),
        ("12.345,5;-1.234.567,25", (12345.5, -1234567.25)),
        ("12 345,5;-1 234 567,25", (12345.5, -1234567.25)),
        ("12\u202f345,5;-1\u00a0234\u00a0567,25", (12345.5, -1234567.25)),
        ("12'345.5\t-1\u2019234\u2019567.25", (12345.5, -1234567.25)),
        ("1,575;2,5", (1.575, 2.5)),
        ("1,575;2.5", (1575, 2.5)),
        ("1,575;2,1234", (1.575, 2.1234)),
        ("1,575;1234,125", (1.575, 1234.125)),
        ("1,575;0,125", (1.575, 0.125)),
        ("1,575;1,234,567", (1575, 1234567)),
        ("1,575;2,125e3", (1.575, 2125)),
    ],
)
def test_decimal_mark_is_that_of_the_whole_table(line: str, expected: tuple[float, ...]) -> None:
    # Lines that decide nothing stand above the one that does.
    separator = next(mark for mark in "\t; ," if mark in line.replace("2 ", "").replace("4 ", ""))
    integers = [(3 * i % 5, 7 * i % 4) for i in range(8)]
    above = "".join(f"{i}{separator}{k}\n" for i, k in [("x", "y"), *integers])
    np.testing.assert_array_equal(rows_read(above + line + "\n"), [*integers, expected])


@pytest.mark.parametrize("empty", ["\n" * 8, " \n" * 8])
def test_empty_lines_behind_a_table_are_left_out(
    empty: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("thud.recordings.formats.text.BLOCK", 8)
    np.testing.assert_array_equal(rows_read("7, 0.250\n" * 8 + empty), [(7, 0.25)] * 8)


# Rate of recorders of sound, Hz.
CD = 44100.0


@pytest.mark.parametrize(
    ("begin", "form"),
    [*product((0.2, 123.0), (".5f", ".6f", ".7f", ".9f", ".18e", "")), (0.2, ".6e")],
)
def test_rounded_times_are_even(form: str, begin: float) -> None:
    time = begin + np.arange(500) / CD
    written = np.array([float(format(value, form)) for value in time])
    record = read_record(np.column_stack([written, np.sin(np.linspace(0, np.pi, 500))]))
    # The slope of a line through n points of standard deviation s has that of s sqrt(12 / n^3).
    digit = float(np.abs(written - time).max())
    slope = digit / np.sqrt(3) * CD * np.sqrt(12 / 500**3)
    assert record.sample_rate == pytest.approx(CD, rel=4 * slope + 1e-9)
    # The begin of the line has 2/sqrt(n) of that of a time.
    deviation = 2 * digit / np.sqrt(3 * 500)
    assert record.time[0] == pytest.approx(begin, abs=4 * deviation + 1e-12)


@pytest.mark.parametrize("digits", [5, 6, 7, 9, 16])
def test_rounded_times_do_not_move_the_band(digits: int) -> None:
    # 1.25 kHz are the 75th harmonic of 60 ms, and belong to the band.
    force = np.append(thud.solve(duration=0.03).floor_force, np.zeros(1323))
    time = (np.arange(2646) / CD).round(digits)
    assert thud.ForceTarget((time, force)).compare().size == 2 * 75 + 1
