"""Recordings: files of columns, even times that are written rounded, and what is none."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from conftest import naming

import thud
from thud.recordings.formats import text as table
from thud.studies.fitting.record import read_record, time_and_force

if TYPE_CHECKING:
    from pathlib import Path

RATE = 44100.0


def read_table(path: Path) -> np.ndarray:
    """Return the numbers of a table."""
    return np.column_stack([column.values for column in table.read_table(path).columns])


FORCE = np.sin(np.linspace(0, np.pi, 500))
TIME = 0.2 + np.arange(500) / RATE


@pytest.mark.parametrize("form", [".5f", ".6f", ".7f", ".9f", ".6e", ".18e", ""])
@pytest.mark.parametrize("begin", [0.2, 123.0])
def test_rounded_times_are_even(form: str, begin: float) -> None:
    time = begin + np.arange(500) / RATE
    written = np.array([float(format(value, form)) for value in time])
    if form == ".6e" and begin > 1:
        with pytest.raises(
            thud.InputError, match=naming("record", "row", "s")
        ):  # 0.1 ms are four steps
            read_record(np.column_stack([written, FORCE]))
        return
    record = read_record(np.column_stack([written, FORCE]))
    # The slope of a line through n points of standard deviation s has that of s sqrt(12 / n^3).
    digit = float(np.abs(written - time).max())
    assert record.sample_rate == pytest.approx(
        RATE, rel=4 * digit / np.sqrt(3) * RATE * np.sqrt(12 / 500**3) + 1e-9
    )
    assert record.time[0] == pytest.approx(begin, abs=digit + 1e-12)


@pytest.mark.parametrize(
    ("fault", "words"),
    [
        (np.where(np.arange(500) < 300, 0, 1 / RATE), r"row 30[01]\b"),
        (np.where(np.arange(500) == 7, 7e-6, 0), naming("row 8", "0.20016573 s", 0.31)),
    ],
    ids=["gap", "outlier"],
)
def test_uneven_times_are_told(fault: np.ndarray, words: str) -> None:
    with pytest.raises(thud.InputError, match=words):
        read_record(np.column_stack([(TIME + fault).round(9), FORCE]))


def test_gap_is_told_however_the_times_are_rounded() -> None:
    time = np.delete(TIME, 100).round(5)
    with pytest.raises(thud.InputError, match=naming("row", 0.25)):
        read_record(np.column_stack([time, FORCE[:-1]]))


@pytest.mark.parametrize(
    "line",
    [
        "{}.5,-{}e-3",
        "{}.5 , -{}e-3",
        "{}.5;  -{}e-3",
        "{},5 ;-{}e-3",
        "{}.5\t -{}e-3",
        "{},5 \t-{}e-3",
        "  {}.5  -{}e-3",
        "  {},5  -{}e-3",
        '"{},5","-{}e-3"',
        '"{},5" ,  "-{}e-3"',
    ],
)
@pytest.mark.parametrize("head", ["", "# plate\n\ntime_s,force_N\n", "Zeit;Kraft\n[s];[µN]\n"])
@pytest.mark.parametrize("end", ["", "sep", " sep", " ", "#x", " # x"])
def test_columns_are_read_whatever_is_between(
    line: str, head: str, end: str, tmp_path: Path
) -> None:
    path = tmp_path / "plate.csv"
    separator = next((mark for mark in "\t;" if mark in line), "," if ",-" in line else "")
    end = end.replace("sep", separator)
    text = head + "".join(f"{line.format(i, i)}{end}\r\n" for i in range(9)) + "\r\n"
    path.write_bytes(text.encode("latin-1"))
    expected = [(i + 0.5, -i * 1e-3) for i in range(9)]
    np.testing.assert_array_equal(read_table(path), expected)


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("0.100020;1,575", (0.10002, 1575)),
        ("0.100020\t1,575", (0.10002, 1575)),
        ("0.100020 1,575", (0.10002, 1575)),
        ('"0.100020","1,575"', (0.10002, 1575)),
        ("0,100020;1,575", (0.10002, 1.575)),
        ("0,100020\t1.575", (0.10002, 1575)),
        ("0,100020 1.575", (0.10002, 1575)),
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
def test_decimal_mark_is_that_of_the_whole_table(
    line: str, expected: tuple[float, ...], tmp_path: Path
) -> None:
    path = tmp_path / "plate.csv"
    # Lines that decide nothing stand above the one that does.
    separator = next(mark for mark in "\t; ," if mark in line.replace("2 ", "").replace("4 ", ""))
    integers = [(3 * i % 5, 7 * i % 4) for i in range(8)]
    above = "".join(f"{i}{separator}{k}\n" for i, k in [("x", "y"), *integers])
    path.write_text(above + line + "\n")
    np.testing.assert_array_equal(read_table(path), [*integers, expected])


@pytest.mark.parametrize("empty", ["\n" * 8, " \n" * 8])
def test_empty_lines_behind_a_table_are_left_out(
    empty: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(table, "BLOCK", 8)
    (tmp_path / "plate.csv").write_text("7, 0.250\n" * 8 + empty)
    np.testing.assert_array_equal(read_table(tmp_path / "plate.csv"), [(7, 0.25)] * 8)


@pytest.mark.parametrize(
    ("first", "last"), [("0 1,5", "2, 1,5"), ("0;1,5", "2,;1,5"), ("0 1", "2, 1.500")]
)
def test_comma_that_ends_a_number_is_refused_as_decimal_comma(
    first: str, last: str, tmp_path: Path
) -> None:
    path = tmp_path / "plate.csv"
    path.write_text(f"{first}\n" * 8 + last + "\n")
    with pytest.raises(thud.InputError, match=naming("plate.csv", "line")):
        read_table(path)


@pytest.mark.parametrize(
    ("last", "parts"),
    [
        ("0,5;0.5", ["'0.5'", "comma"]),
        ("0.5;1,57", ["'1,57'", "point"]),
        ("0.5;0,575", ["'0,575'", "point"]),
        ("0.5;1575,000", ["'1575,000'"]),
        ("0.5;1,575,00", ["'1,575,00'"]),
        ("0,5;1.575.00", ["'1.575.00'"]),
        ("0,5;1.575'000", ['"1.575\'000"']),
        ("0.5;1 57", ["'1 57'"]),
        ("0.5;1_575", ["'1_575'"]),
        # A further digit shows the mark: that of the number itself.
        ("2;1,575", ["'1,575'", 1575, 1.575, "1,5750 for 1.575"]),
        ("2;1.575", ["'1.575'", 1575, 1.575, "1.5750 for 1.575"]),
        ("2.125;1,575", ["'2.125'", 2125, 2.125]),
    ],
)
def test_numbers_that_may_be_two_are_refused(
    last: str, parts: list[object], tmp_path: Path
) -> None:
    path = tmp_path / "plate.csv"
    path.write_text("".join(f"{i};{i % 3}\n" for i in range(8)) + last + "\n")
    with pytest.raises(thud.InputError, match=naming("plate.csv", "line 9", *parts)):
        read_table(path)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("0.0,1\n1,2\n", naming("2 rows", 8)),
        ("".join(f"{i},1.0,2\n" for i in range(9)), naming("9 rows", 3)),
        ("".join(f"{i}.0,nan\n" for i in range(9)), naming("finite")),
        ("".join(f"{i},0.0\n" for i in range(9)), naming("force", "positive")),
        ("".join(f"{i},1.0e200\n" for i in range(9)), naming("1e+200 N", "1e+12 N")),
    ],
)
def test_useless_records_are_told(tmp_path: Path, text: str, words: str) -> None:
    (tmp_path / "plate.csv").write_text(text)
    with pytest.raises(thud.InputError, match=words) as caught:
        read_record(time_and_force(table.read_table(tmp_path / "plate.csv")), "plate.csv")
    assert "plate.csv" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_force_of_the_wrong_sign_is_told() -> None:
    # As a plate gives it that counts pulling positive: the noise before the impact is positive.
    impact = thud.solve(duration=0.03)
    force = np.random.default_rng(1).normal(size=1323) - impact.floor_force
    with pytest.raises(thud.InputError, match=naming("target", "-1562", "sign")):
        thud.fit((impact.time, force), ["youngs_modulus"])


def test_rounded_times_do_not_move_the_fit() -> None:
    impact = thud.solve(duration=0.03)
    fit = thud.fit(((impact.time + 0.2).round(6), impact.floor_force), ["youngs_modulus"])
    # Of 1323 times rounded to 1 us the mean is off by 1 us / sqrt(12 * 1323); four of that.
    assert fit.values["time_shift"] == pytest.approx(0.2, abs=4e-6 / np.sqrt(12 * 1323))


@pytest.mark.parametrize("digits", [5, 6, 7, 9, 16])
def test_rounded_times_do_not_move_the_band(digits: int) -> None:
    # 1.25 kHz are the 75th harmonic of 60 ms, and belong to the band.
    force = np.append(thud.solve(duration=0.03).floor_force, np.zeros(1323))
    time = (np.arange(2646) / RATE).round(digits)
    assert thud.ForceTarget((time, force)).compare().size == 2 * 75 + 1
