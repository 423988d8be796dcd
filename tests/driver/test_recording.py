"""Recordings: files of columns, even times that are written rounded, and what is none."""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given, strategies as st

import thud
from thud.recordings.formats import text as table
from thud.studies.fitting.record import read_record

if TYPE_CHECKING:
    from pathlib import Path

RATE = 44100.0
FORCE = np.sin(np.linspace(0, np.pi, 500))


def read_table(path: Path) -> np.ndarray:
    """Return the numbers of a table."""
    return np.column_stack([column.values for column in table.read_table(path).columns])


@pytest.mark.parametrize(
    ("form", "begin"),
    [
        *((form, 0.2) for form in (".5f", ".6f", ".7f", ".9f", ".6e", ".18e", "")),
        *((form, 123.0) for form in (".5f", ".6f", ".9f", ".18e", "")),
    ],
)
def test_rounded_times_are_even(form: str, begin: float) -> None:
    time = begin + np.arange(500) / RATE
    written = np.array([float(format(value, form)) for value in time])
    record = read_record(np.column_stack([written, FORCE]))
    # The slope of a line through n points of standard deviation s has that of s sqrt(12 / n^3).
    digit = float(np.abs(written - time).max())
    assert record.sample_rate == pytest.approx(
        RATE, rel=4 * digit / np.sqrt(3) * RATE * np.sqrt(12 / 500**3) + 1e-9
    )
    # The begin of the line has 2/sqrt(n) of that of a time.
    deviation = 2 * digit / np.sqrt(3 * 500)
    assert record.time[0] == pytest.approx(begin, abs=4 * deviation + 1e-12)


@given(
    # A comma separates only what it does not mark.
    form=st.sampled_from([
        (separator, mark, quote)
        for separator, mark, quote in product(",;\t ", ".,", ["", '"'])
        if (separator, mark, quote) != (",", ",", "") and (separator != " " or not quote)
    ]),
    spaces=st.tuples(*[st.sampled_from(["", " ", "  "])] * 3),
    head=st.sampled_from(["", "# plate\n\ntime_s,force_N\n", "Zeit;Kraft\n[s];[µN]\n"]),
    ends=st.tuples(
        st.sampled_from(["", "sep", " sep", " ", "#x", " # x"]),
        st.sampled_from(["\n", "\r\n"]),
        st.sampled_from(["latin-1", "utf-8"]),
    ),
    values=st.lists(st.tuples(*[st.integers(-99_999, 99_999)] * 2), min_size=8, max_size=12),
)  # fmt: skip
def test_columns_are_read_whatever_is_between(  # noqa: PLR0913, PLR0917 - each is drawn
    tmp_path_factory: pytest.TempPathFactory,
    form: tuple[str, str, str],
    spaces: tuple[str, str, str],
    head: str,
    ends: tuple[str, str, str],
    values: list[tuple[int, int]],
) -> None:
    (separator, mark, quote), (end, line_end, encoding) = form, ends

    def number(value: int, exponent: str = "") -> str:
        return quote + f"{value / 10:.1f}{exponent}".replace(".", mark) + quote

    before, left, right = spaces
    end = end.replace("sep", separator)
    text = head + "".join(
        f"{before}{number(x)}{left}{separator}{right}{number(y, 'e-3')}{end}\n" for x, y in values
    )
    path = tmp_path_factory.mktemp("table") / "plate.csv"
    path.write_bytes(text.replace("\n", line_end).encode(encoding))
    np.testing.assert_allclose(read_table(path), np.array(values) * [0.1, 1e-4], rtol=1e-15)


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
def test_decimal_mark_is_that_of_the_whole_table(
    line: str, expected: tuple[float, ...], tmp_path: Path
) -> None:
    # Lines that decide nothing stand above the one that does.
    separator = next(mark for mark in "\t; ," if mark in line.replace("2 ", "").replace("4 ", ""))
    integers = [(3 * i % 5, 7 * i % 4) for i in range(8)]
    above = "".join(f"{i}{separator}{k}\n" for i, k in [("x", "y"), *integers])
    (tmp_path / "plate.csv").write_text(above + line + "\n")
    found = read_table(tmp_path / "plate.csv")
    np.testing.assert_array_equal(found, [*integers, expected])


@pytest.mark.parametrize("empty", ["\n" * 8, " \n" * 8])
def test_empty_lines_behind_a_table_are_left_out(
    empty: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(table, "BLOCK", 8)
    (tmp_path / "plate.csv").write_text("7, 0.250\n" * 8 + empty)
    np.testing.assert_array_equal(read_table(tmp_path / "plate.csv"), [(7, 0.25)] * 8)


@pytest.mark.parametrize("digits", [5, 6, 7, 9, 16])
def test_rounded_times_do_not_move_the_band(digits: int) -> None:
    # 1.25 kHz are the 75th harmonic of 60 ms, and belong to the band.
    force = np.append(thud.solve(duration=0.03).floor_force, np.zeros(1323))
    time = (np.arange(2646) / RATE).round(digits)
    assert thud.ForceTarget((time, force)).compare().size == 2 * 75 + 1
