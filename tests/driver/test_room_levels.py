"""Levels measured in the room below: mean, background, standardization, rating."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from conftest import REPOSITORY, codes, names_in, naming, noted
from hypothesis import given, settings, strategies as st
from refusals.core import write
from refusals.floors import OCTAVES, room_levels

import thud
from thud.cli import main
from thud.floors.survey import rating_table
from thud.level.rating import CLASS_LIMITS

if TYPE_CHECKING:
    from collections.abc import Callable

PUBLISHED = REPOSITORY / "inputs" / "floors" / "field_levels.csv"
# A survey that raises no warning.
GOOD = thud.RoomLevels(
    "good", "octave", np.array(OCTAVES, dtype=float),
    np.array([[70.0, 60, 50, 40], [73, 64, 51, 42], [71, 60, 52, 44], [69, 61, 49, 40]]),
    np.full(4, 20.0), np.array([1.2, 0.9, 0.6, 0.4]), 30.0,
)  # fmt: skip
NEAR = replace(GOOD, background=np.array([20.0, 20, 20, 38]))

pytestmark = pytest.mark.usefixtures("working_directory")


def test_published_measurement_is_standardized_and_rated(
    oracle: Callable[..., None], capsys: pytest.CaptureFixture[str]
) -> None:
    found = thud.read_room_levels(PUBLISHED, volume=41.4)
    printed = [76.3, 57.2, 47.2, 44.8, 38.1, 37.0, 35.3, 30.7, 24.5, 22.2, 16.8, 15.1]
    # Printed to 0.1 dB; its own rounding of the table of g(C) leaves 0.07 dB.
    oracle(
        "standardized levels of a room (Gurtner)",
        "published measurement",
        found.standardized - printed,
        0.1,
        "dB",
    )
    assert found.rating.a_weighted == pytest.approx(46.97, abs=0.01)
    assert found.standardized_rating.a_weighted == pytest.approx(46.24, abs=0.01)
    assert (found.rating.rounded, found.standardized_rating.rounded) == (47, 46)
    assert found.rating.korean_class is None
    assert main(["rate", str(PUBLISHED), "--volume", "41.4", "--output", "out"]) == 0
    shown = capsys.readouterr()
    assert "47 (46.97)" in shown.out
    assert "46 (46.24)" in shown.out
    assert "background" in shown.err
    assert names_in(Path("out")) == ["room_levels.csv", "room_levels.svg", "thud.txt"]


def test_example_of_iso_717_2_is_rated(oracle: Callable[..., None]) -> None:
    found = thud.rating([65.3, 64.5, 58.0, 55.8])
    oracle(
        "rating of the example of ISO 717-2",
        "published example",
        found.a_weighted - 55.3507,
        1e-4,
        "dB",
    )
    assert (found.rounded, found.curve, found.korean_class) == (55, 51, 0)


@pytest.mark.parametrize(
    ("titles", "cells"),
    [
        ("frequency (kHz);T20 (ms);mean (dB)", ("{k};500;{v}",)),
        ("Frequency;P1", ("{f}Hz;{v} dB",)),
        ("Frequency;P1", ("{f} Hz;{v}", "0.125 kHz;60", "250 Hz;50", "0.5 kHz;40.5")),
        ("f;L_i,Fmax;Remark", ("{f};{v};ok",)),
        ("f;;Pos. 1 (dB);Comment", ("{f};;{v}",)),
        ("Octave band\tLevel 1\nHz\tdB", ("{f}\t{v}",)),
        # A known title is no position.
        ("frequency;P1;RT60", ("{f};{v};0.5",)),
    ],
)
def test_levels_are_read_in_their_units(titles: str, cells: tuple[str, ...]) -> None:
    levels = [70.5, 60.0, 50.0, 40.5]
    forms = cells if len(cells) > 1 else cells * 4
    bands = zip(forms, OCTAVES, levels, strict=True)
    rows = [form.format(f=f, k=f / 1000, v=v) for form, f, v in bands]
    found = room_levels("\n".join([titles, *rows]))
    assert found.positions.tolist() == [levels]
    time = found.reverberation_time
    assert time is None if "T" not in titles else time == pytest.approx([0.5] * 4)


# Titles of frequency, two positions, background and reverberation time, and encodings.
TITLES = [
    ("Terzmittenfrequenz in Hz;Position 1;Position 2;Störpegel [dB];Nachhallzeit (s)", "utf-8"),
    ("Centre frequency, Hz;LZFmax;L'i,Fmax 2;Background noise, dB;RT, s", "utf-8"),
    ("中心周波数（Hz）;測定点1;測定点2;暗騒音レベル（dB）;残響時間（s）", "utf-8"),  # noqa: RUF001 - as printed
    # Encodings of spreadsheets.
    ("Frequenz;Messpunkt 1;Messpunkt 2;Störpegel;Nachhallzeit", "latin-1"),
    ("중심주파수(Hz);측정점 1;측정점 2;배경소음 (dB);잔향시간(s)", "cp949"),
    ("周波数（Hz）;位置1;位置2;暗騒音レベル（dB）;残響時間（s）", "cp932"),  # noqa: RUF001 - as printed
    ("周波数;位置1;位置2;暗騒音;残響時間", "utf-16"),
]


@settings(max_examples=30)
@given(
    titles=st.sampled_from(TITLES),
    columns=st.permutations(range(5)),
    bands=st.permutations([*OCTAVES, 1, 31.5, 1000]),
    # Titles within 3 % of a mid frequency mean it.
    shift=st.floats(0.972, 1.02),
    seed=st.integers(0, 99),
)
def test_tables_of_any_language_and_order_are_read(
    titles: tuple[str, str], columns: list[int], bands: list[float], shift: float, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    table = np.column_stack([bands, *rng.uniform(-50, 200, (3, 7)), rng.uniform(0.01, 100, 7)])
    # Values at their bounds.
    table[:2, 1], table[:2, 4] = (-50, 200), (0.01, 100)
    table[:, 0] *= shift
    rows = [[f"{cell:.8g}".replace(".", ",") for cell in row] for row in table]
    lines = [";".join(row[i] for i in columns) for row in (titles[0].split(";"), *rows)]
    file = write("levels.csv", "\r\n".join(lines).encode(titles[1]))
    found = thud.read_room_levels(file, volume=40.0)
    assert (found.bands, found.frequency.tolist()) == ("octave", sorted(bands))
    expected = table[np.argsort(bands)].T
    assert np.sort(found.positions, axis=0) == pytest.approx(np.sort(expected[1:3], axis=0))
    assert found.background == pytest.approx(expected[3])
    assert found.reverberation_time == pytest.approx(expected[4])
    assert found.rating.rows() == thud.rating(found.level[2:6]).rows()
    assert found.standardized_rating.rows() == thud.rating(found.standardized[2:6]).rows()


def test_mean_background_and_scatter_of_positions() -> None:
    levels = 60 + 3 * np.random.default_rng(5).standard_normal((6, 4))
    background = np.array([45.0, 52.0, 57.0, 20.0])
    found = replace(GOOD, positions=levels, background=background)
    mean = (10 ** (levels / 10)).mean(axis=0)
    assert found.measured == pytest.approx(10 * np.log10(mean))
    near = found.measured - background
    corrected = found.measured + 10 * np.log10(1 - 10 ** (-np.maximum(near, 6) / 10))
    assert found.level == pytest.approx(np.where(near >= 15, found.measured, corrected))
    assert found.is_upper_bound.tolist() == (near < 6).tolist()
    assert found.is_upper_bound.any()
    assert found.spread == pytest.approx(levels.std(axis=0, ddof=1))
    # The A-weighted energy of each position, and the standard error of their mean.
    energy = np.array([10 ** (thud.rating(one).a_weighted / 10) for one in levels])
    error = energy.std(ddof=1) / np.sqrt(6) / energy.mean() * 10 / np.log(10)
    assert found.position_uncertainty == pytest.approx(error)
    one = replace(GOOD, positions=levels[:1], background=None)
    assert (one.spread, one.position_uncertainty) == (None, None)
    assert one.level.tolist() == one.measured.tolist()
    assert not one.is_upper_bound.any()


@pytest.mark.parametrize("volume", [20.0, 50.0, 180.0])
def test_standardization_is_the_formula_of_iso_16283_2(volume: float) -> None:
    level, time = np.array([70.0, 61.0, 52.0, 43.0]), np.array([0.3, 0.5, 1.1, 2.4])

    def shown(time: np.ndarray) -> np.ndarray:
        ratio = time / 1.7275
        return ratio ** (-1 / (ratio - 1))

    for times in (time, time[2:3]):
        expected = level + 10 * np.log10(volume / 50 * shown(np.array([0.5])) / shown(times))
        found = thud.standardized_level(level, times, volume)
        assert found == pytest.approx(expected, abs=1e-9)
    assert thud.standardized_level(level, 1.1, volume) == pytest.approx(expected, abs=1e-9)
    survey = replace(GOOD, reverberation_time=times, volume=volume)
    assert survey.standardized == pytest.approx(GOOD.level + expected - level)
    assert replace(survey, volume=None).standardized_rating is None
    assert replace(survey, reverberation_time=None).standardized is None


def test_class_is_the_best_one_whose_limit_is_kept() -> None:
    above = thud.rating([0.0] * 4).a_weighted
    for number, limit in enumerate(CLASS_LIMITS, start=1):
        assert thud.rating([limit - above - 0.01] * 4).korean_class == number
        assert thud.rating([limit - above + 0.51] * 4).korean_class == (number + 1) % 5
    assert thud.rating([1000.0] * 4).korean_class == 0
    thirds = thud.rating([60.0] * 12, "third")
    assert (thirds.korean_class, thirds.curve) == (None, None)


@pytest.mark.parametrize(
    ("change", "code"),
    [
        ({}, ""),
        ({"positions": GOOD.positions[:3]}, "few_positions"),
        # The mean levels of two positions differ by 15 dB, and by more.
        ({"positions": GOOD.positions[:1] + np.array([[0.0], [5], [15], [1]])}, ""),
        ({"positions": GOOD.positions[:1] + np.array([[0.0], [5], [15.1], [1]])},
         "positions_differ"),
        ({"background": None}, "background_unknown"),
        ({"background": NEAR.background}, "near_background"),
        ({"background": np.array([20.0, 20, 20, 33])}, ""),
        ({"reverberation_time": None}, "not_standardized"),
        ({"volume": None}, "not_standardized"),
        ({"volume": None, "reverberation_time": None}, "not_standardized"),
    ],
)  # fmt: skip
def test_each_weakness_of_a_survey_raises_a_warning(change: dict[str, Any], code: str) -> None:
    notes = replace(GOOD, **change).notes
    assert codes(notes) == [code] * bool(code)
    if code == "positions_differ":
        assert noted(notes, code).value == pytest.approx(15.1)


def test_tables_hold_the_numbers_of_the_survey() -> None:
    lines = [line.split(",") for line in NEAR.to_csv().splitlines()]
    columns = dict(zip(lines[0], np.array(lines[1:], dtype=float).T, strict=True))
    assert columns["nominal_Hz"].tolist() == list(OCTAVES)
    for title, values in (
        ("mean_dB", NEAR.measured), ("spread_dB", NEAR.spread), ("level_dB", NEAR.level),
        ("background_dB", NEAR.background), ("standardized_dB", NEAR.standardized),
        ("reverberation_time_s", NEAR.reverberation_time),
    ):  # fmt: skip
        assert columns[title] == pytest.approx(values, abs=1e-7)
    assert columns["is_upper_bound"].tolist() == [0, 0, 0, 1]
    both, alone = rating_table(NEAR), NEAR.rating.rows()
    assert [row[:2] for row in both[1:]] == alone[1:]
    assert NEAR.standardized_rating is not None
    after = NEAR.standardized_rating.rows()
    # The class is that of the levels in the room only.
    assert [row[2] for row in both[1:]] == [after[1][1], "", after[3][1]]
    assert rating_table(replace(NEAR, volume=None)) == alone


def test_workbook_is_read_like_a_table(monkeypatch: pytest.MonkeyPatch) -> None:
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    book.active.append(["Messung vom 3. Mai"])
    sheet = book.create_sheet("Pegel")
    titles = [None, "Frequenz (Hz)", "P1", "P2", None, "Nachhallzeit"]
    bands = zip(OCTAVES, (70.5, 60, 55, 50), strict=True)
    for row in (["Bericht"], [], titles, *([None, f, v, v + 2, None, 0.6] for f, v in bands)):
        sheet.append(row)
    path = "levels.xlsx"
    book.save(path)
    found = thud.read_room_levels(path)
    assert found.positions.tolist() == [[70.5, 60, 55, 50], [72.5, 62, 57, 52]]
    assert found.reverberation_time is not None
    sheet["C6"] = "60 dB"
    book.save(path)
    with pytest.raises(thud.InputError, match=naming("Pegel", "line 6", "60 dB")):
        thud.read_room_levels(path)
    monkeypatch.setattr("thud.recordings.formats.text.MAX_ROWS", 6)
    with pytest.raises(thud.InputError, match=naming("levels.xlsx", "Pegel", "6 rows")):
        thud.read_room_levels(path)
    monkeypatch.setitem(sys.modules, "openpyxl", None)
    with pytest.raises(thud.InputError, match=naming("openpyxl", "pip install")):
        thud.read_room_levels(path)
