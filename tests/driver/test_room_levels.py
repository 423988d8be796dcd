"""Levels measured in the room below: mean, background, standardization, rating."""

from __future__ import annotations

import sys
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from conftest import REPOSITORY, names_in, naming

import thud
from thud.cli import main
from thud.floors.survey import rating_table
from thud.level.rating import CLASS_LIMITS

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

PUBLISHED = REPOSITORY / "inputs" / "floors" / "field_levels.csv"
OCTAVES = (63.0, 125.0, 250.0, 500.0)
# A survey that raises no warning.
GOOD = thud.RoomLevels(
    "good", "octave", np.array(OCTAVES),
    np.array([[70.0, 60, 50, 40], [73, 64, 51, 42], [71, 60, 52, 44], [69, 61, 49, 40]]),
    np.full(4, 20.0), np.array([1.2, 0.9, 0.6, 0.4]), 30.0,
)  # fmt: skip


def write(path: Path, text: str | bytes) -> Path:
    """Write a table and return its path."""
    file = path / "levels.csv"
    file.write_bytes(text if isinstance(text, bytes) else text.encode())
    return file


def survey(titles: str, cells: str = "") -> str:
    """Return a table with the same cells in each octave; by default 50 in each column."""
    cells = cells or ";".join(["50"] * titles.count(";"))
    return "\n".join([titles, *(f"{f:g};{cells}" for f in OCTAVES)])


def test_published_measurement_is_standardized_and_rated(oracle: Callable[..., None]) -> None:
    found = thud.read_room_levels(PUBLISHED, volume=41.4)
    printed = [76.3, 57.2, 47.2, 44.8, 38.1, 37.0, 35.3, 30.7, 24.5, 22.2, 16.8, 15.1]
    # Printed to 0.1 dB; its own rounding of the table of g(C) leaves 0.07 dB.
    oracle(
        "standardized levels of a room (Gurtner)", "published measurement",
        found.standardized - printed, 0.1, "dB",
    )  # fmt: skip
    assert found.rating.a_weighted == pytest.approx(46.97, abs=0.01)
    assert found.standardized_rating.a_weighted == pytest.approx(46.24, abs=0.01)
    assert (found.rating.rounded, found.standardized_rating.rounded) == (47, 46)
    assert found.rating.korean_class is None


def test_example_of_iso_717_2_is_rated(oracle: Callable[..., None]) -> None:
    found = thud.rating([65.3, 64.5, 58.0, 55.8])
    oracle(
        "rating of the example of ISO 717-2", "published example",
        found.a_weighted - 55.3507, 1e-4, "dB",
    )  # fmt: skip
    assert (found.rounded, found.curve, found.korean_class) == (55, 51, 0)


LEVELS = ("70.5", "60", "50", "40.5")


@pytest.mark.parametrize(
    ("titles", "cells"),
    [
        ("frequency (kHz);T20 (ms);mean (dB)", ("{k};500;{v}",)),
        ("Frequency;P1", ("{f}Hz;{v} dB",)),
        ("Frequency;P1", ("{f} Hz;{v}", "0.125 kHz;60", "250 Hz;50", "0.5 kHz;40.5")),
        ("f;L_i,Fmax;Remark", ("{f};{v};ok",)),
        ("Frequency [Hz];LZFmax [dB]", ("{f};{v}",)),
        ("frequency;L'i,Fmax", ("{f};{v}",)),
        ("f;;Pos. 1 (dB);Comment", ("{f};;{v}",)),
        ("Octave band\tLevel 1\nHz\tdB", ("{f}\t{v}",)),
    ],
)
def test_levels_are_read_in_their_units(
    tmp_path: Path, titles: str, cells: tuple[str, ...]
) -> None:
    rows = [
        cells[min(i, len(cells) - 1)].format(f=f"{f:g}", k=f / 1000, v=v)
        for i, (f, v) in enumerate(zip(OCTAVES, LEVELS, strict=True))
    ]
    found = thud.read_room_levels(write(tmp_path, "\n".join([titles, *rows])), volume=50.0)
    assert found.positions.tolist() == [list(map(float, LEVELS))]
    if "T20" in titles:
        assert found.reverberation_time == pytest.approx([0.5] * 4)


def test_mean_background_and_scatter_of_positions(tmp_path: Path) -> None:
    rng = np.random.default_rng(5)
    levels = 60 + 3 * rng.standard_normal((6, 4))
    background = np.array([45.0, 52.0, 57.0, 20.0])
    lines = ["frequency,background," + ",".join(f"P{i}" for i in range(1, 7))]
    lines += [
        ",".join(map(str, (f, b, *row)))
        for f, b, row in zip(OCTAVES, background, levels.T.tolist(), strict=True)
    ]
    found = thud.read_room_levels(write(tmp_path, "\n".join(lines)))
    mean = (10 ** (levels / 10)).mean(axis=0)
    assert found.measured == pytest.approx(10 * np.log10(mean))
    near = found.measured - background
    expected = np.where(
        near >= 15, 10 * np.log10(mean),
        found.measured + 10 * np.log10(1 - 10 ** (-np.maximum(near, 6) / 10)),
    )  # fmt: skip
    assert found.level == pytest.approx(expected)
    assert found.is_upper_bound.tolist() == (near < 6).tolist()
    assert found.is_upper_bound.any()
    # The A-weighted energy of each position, and the standard error of their mean.
    energy = np.array([10 ** (thud.rating(one).a_weighted / 10) for one in levels])
    error = energy.std(ddof=1) / np.sqrt(6) / energy.mean() * 10 / np.log(10)
    assert found.position_uncertainty == pytest.approx(error)
    assert "near_background" in [note.code for note in found.notes]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        # Columns of another unit.
        *((survey(titles, "0.5;70"), naming(unit)) for titles, unit in (
            ("frequency (ms);T20;mean", "ms"), ("frequency;T20 (Hz);mean", "Hz"),
            ("frequency;T20;mean_Pa", "Pa"), ("frequency;T20;mean [dB(A)]", "dB(A)"),
            ("frequency;T20;mean, dBA", "dBA"), ("frequency;T20;mean (phon)", "phon"),
        )),
        # Titles of other levels.
        *((survey(titles), naming(repr(name), "P1", "mean", "background")) for titles, name in (
            ("f;LAFmax", "LAFmax"), ("f;LZFmax;LZeq", "LZeq"), ("f;Value;A;C", "Value"),
            ("f;Leq", "Leq"), ("f;L'i,Fmax;L'i,Fmax,V,T", "L'i,Fmax,V,T"), ("f;P1;B2", "B2"),
            ("f;background;B2", "B2"), ("f;L1;No", "No"), ("f;L;Requirement", "Requirement"),
            ("f;LCpeak", "LCpeak"), ("f;L'nT,w", "L'nT,w"), ("f;Umgebung", "Umgebung"),
            ("f;LnT", "LnT"), ("f;P1;A1", "A1"), ("f;P1;mean_dB", "mean"),
            ("f;P1;std dev", "std dev"), ("f;P1;Standardized_dB", "Standardized"),
            ("f;P1;EDT", "EDT"), ("f;backgruond;P1", "backgruond"),
            ("f;위치 1;평균레벨", "평균레벨"),
        )),
        # Titles in other languages and encodings.
        ("频率;声压级 1;背景噪声\n63;50;4".encode("gb18030"), naming("column 1")),
        (survey("周波数(Hz);L1;残響時間(ms)", "50;4"), naming("reverberation_time", "0.004 s")),
        # Missing and duplicate columns and bands.
        ("", naming("frequency", "Hz")),
        ("63,60.0\n125,60\n250,60\n500,60\n", naming("2 columns")),
        ("level,P1\n63,60\n", naming("frequency")),
        ("frequency,T\n63,1\n125,1\n250,1\n500,1\n", naming("levels")),
        ("frequency,T,T20,P1\n63,1,1,60\n125,1,1,60\n", naming("time")),
        ("frequency,T,P1\n63,0,60\n125,1,60\n250,1,60\n500,1,60\n",
         naming("reverberation_time", "0 s", 0.01)),
        ("f,P1,T\n63,60,0.009\n125,60,1\n250,60,100\n500,60,20\n",
         naming("reverberation_time", "0.009 s")),
        *((f"frequency,P1\n{rows}\n", naming(*words)) for rows, *words in (
            ("63,60\n125,60\n250,60", "500 Hz"), ("63,60\n63,60\n250,60\n500,6", "63 Hz"),
            ("63,60\n125,60\n250,60\n470,60", "470 Hz"), ("63,60\n125", "line 3", 1, 2),
            ("61,60\n125,60\n250,60\n500,60", "frequency", "61 Hz"),
            ("0.9,60\n63,60\n125,60\n250,60\n500,60", "frequency", "0.9 Hz"),
            ("63,60\n125,60\n250,60\n500,60\n100000,60", "frequency", "100000 Hz"),
            ("63,60\n125,600\n250,60\n500,60", "level", "600 dB", -50, 200),
            ("63,60\n125,nan\n250,60\n500,60", "level", "nan", -50, 200),
            ("63,200.1\n125,60\n250,60\n500,60", "level", "200.1 dB"),
            ("63,60\n125,-50.1\n250,60\n500,60", "level", "-50.1 dB"),
        )),
    ],
)  # fmt: skip
def test_tables_that_cannot_be_rated_are_refused(
    tmp_path: Path, text: str | bytes, words: str
) -> None:
    with pytest.raises(thud.InputError, match=words) as caught:
        thud.read_room_levels(write(tmp_path, text))
    assert "levels.csv" in str(caught.value)


@pytest.mark.parametrize(
    ("function", "arguments", "words"),
    [
        (thud.rating, ([60.0] * 3,), naming("levels", "(3,)", "(4,)")),
        (thud.rating, ([60.0] * 4, "third"), naming("levels", "(4,)", "(12,)")),
        (thud.rating, ([60.0] * 4, "fifth"), naming("bands", "'fifth'", "'third'")),
        (thud.rating, ([60.0, np.inf, 60.0, 60.0],), naming("levels", "inf")),
        *((thud.rating, ([70.0] * 3 + [level],), naming("levels", level, -1000, 1000))
          for level in (1e308, -1e308, 1e5)),
        *((thud.standardized_level, ([60.0, 61.0], time, volume), naming(name, "1e-09"))
          for name, time, volume in (
              ("reverberation_time", 0.0, 50.0), ("reverberation_time", -1.0, 50.0),
              ("reverberation_time", [0.4, 0.0], 50.0), ("volume", 0.5, 0.0), ("volume", 0.5, -3.0),
              ("volume", [0.4, 0.5], -3.0),
          )),
    ],
)  # fmt: skip
def test_levels_and_rooms_that_cannot_be_rated_are_refused(
    function: Callable[..., object], arguments: tuple[object, ...], words: str
) -> None:
    with pytest.raises(thud.InputError, match=words):
        function(*arguments)


def test_command_rates_a_table(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "out"
    assert main(["rate", str(PUBLISHED), "--volume", "41.4", "--output", str(folder)]) == 0
    shown = capsys.readouterr()
    assert "47 (46.97)" in shown.out
    assert "46 (46.24)" in shown.out
    assert "background" in shown.err
    assert set(names_in(folder)) == {
        "room_levels.csv", "room_levels.svg", "thud.txt",
    }  # fmt: skip
    lines = (folder / "room_levels.csv").read_text(encoding="utf-8").splitlines()
    assert len(lines) == 13
    assert "standardized_dB" in lines[0]


def test_column_that_hardly_is_a_position_raises_a_warning(tmp_path: Path) -> None:
    rows = "".join(f"{f},60,30\n" for f in (63, 125, 250, 500))
    (tmp_path / "levels.csv").write_text(f"frequency,P1,P2\n{rows}")
    warnings = thud.read_room_levels(tmp_path / "levels.csv").notes
    assert ("positions_differ", 30.0) in [(note.code, note.value) for note in warnings]
    # A known title is no position.
    rows = "".join(f"{f},60,1.2\n" for f in (63, 125, 250, 500))
    (tmp_path / "levels.csv").write_text(f"frequency,P1,RT60\n{rows}")
    found = thud.read_room_levels(tmp_path / "levels.csv", volume=50.0)
    assert (len(found.positions), found.standardized is None) == (1, False)


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


def test_class_is_the_best_one_whose_limit_is_kept() -> None:
    above = thud.rating([0.0] * 4).a_weighted
    for number, limit in enumerate(CLASS_LIMITS, start=1):
        assert thud.rating([limit - above - 0.01] * 4).korean_class == number
        assert thud.rating([limit - above + 0.51] * 4).korean_class == (number + 1) % 5
    assert thud.rating([1000.0] * 4).korean_class == 0
    thirds = thud.rating([60.0] * 12, "third")
    assert (thirds.korean_class, thirds.curve) == (None, None)


@pytest.mark.parametrize(
    ("change", "count"),
    [
        ({}, 0),
        ({"positions": GOOD.positions[:3]}, 1),
        # The mean levels of two positions differ by 15 dB, and by more.
        ({"positions": GOOD.positions[:1] + np.array([[0.0], [5], [15], [1]])}, 0),
        ({"positions": GOOD.positions[:1] + np.array([[0.0], [5], [15.1], [1]])}, 1),
        ({"background": None}, 1),
        ({"background": np.array([20.0, 20, 20, 38])}, 1),
        ({"background": np.array([20.0, 20, 20, 33])}, 0),
        ({"reverberation_time": None}, 1),
        ({"volume": None}, 1),
        ({"volume": None, "reverberation_time": None}, 1),
    ],
)
def test_each_weakness_of_a_survey_raises_a_warning(change: dict[str, object], count: int) -> None:
    assert len(replace(GOOD, **change).notes) == count  # type: ignore[arg-type]


def test_numbers_of_a_survey_are_those_of_its_definitions() -> None:
    deviation = np.sqrt(((GOOD.positions - GOOD.positions.mean(axis=0)) ** 2).sum(axis=0) / 3)
    assert GOOD.spread == pytest.approx(deviation)
    assert GOOD.standardized == pytest.approx(
        thud.standardized_level(GOOD.level, GOOD.reverberation_time, 30.0)
    )
    assert GOOD.standardized_rating.rows() == thud.rating(GOOD.standardized).rows()
    two = replace(GOOD, positions=GOOD.positions[:2])
    assert two.spread == pytest.approx(abs(np.diff(two.positions, axis=0)[0]) / np.sqrt(2))
    one = replace(GOOD, positions=GOOD.positions[:1], background=None)
    assert (one.spread, one.position_uncertainty) == (None, None)
    assert one.level.tolist() == one.measured.tolist()
    assert not one.is_upper_bound.any()
    assert replace(one, volume=None).standardized_rating is None
    assert replace(one, reverberation_time=None).standardized is None


def test_rows_of_a_table_may_have_any_order_and_further_bands(tmp_path: Path) -> None:
    frequency = np.array([500.0, 31.5, 63, 1000, 250, 125])
    level, background, time = 80 - frequency / 20, 10 + frequency / 50, 2 - frequency / 1000
    lines = ["frequency,background,P1,T"]
    lines += [
        f"{f},{b},{v},{t}" for f, b, v, t in zip(frequency, background, level, time, strict=True)
    ]
    found = thud.read_room_levels(write(tmp_path, "\n".join(lines)), volume=40.0)
    order = np.sort(frequency)
    assert found.bands == "octave"
    assert found.frequency.tolist() == order.tolist()
    assert found.positions[0] == pytest.approx(80 - order / 20)
    assert found.background == pytest.approx(10 + order / 50)
    assert found.reverberation_time == pytest.approx(2 - order / 1000)
    assert found.rating.rows() == thud.rating(found.level[1:5]).rows()
    rows = thud.rating(found.standardized[1:5]).rows()
    assert found.standardized_rating.rows() == rows


@pytest.mark.parametrize(
    "text",
    [
        # Titles within 3 % of a mid frequency mean it.
        "f,P1\n61.2,60\n128,60\n250,60\n500,60",
        "f,P1\n64.8,60\n122,60\n250,60\n500,60",
        "f,P1\n1,60\n63,60\n125,60\n250,60\n500,60",
        "f,P1\n63,200\n125,-50\n250,60\n500,60",
        "f,P1,T\n63,60,0.01\n125,60,0.01\n250,60,100\n500,60,20",
        "f,P1,background\n63,60,0.009\n125,60,0.01\n250,60,100\n500,60,20",
    ],
)
def test_values_at_the_bounds_of_a_table_are_read(tmp_path: Path, text: str) -> None:
    assert set(OCTAVES) <= set(thud.read_room_levels(write(tmp_path, text)).frequency)


def test_tables_hold_the_numbers_of_the_survey() -> None:
    found = replace(GOOD, background=np.array([20.0, 20, 20, 38]))
    lines = [line.split(",") for line in found.to_csv().splitlines()]
    columns = dict(zip(lines[0], np.array(lines[1:], dtype=float).T, strict=True))
    assert columns["nominal_Hz"].tolist() == list(OCTAVES)
    for title, values in (
        ("mean_dB", found.measured), ("spread_dB", found.spread), ("level_dB", found.level),
        ("background_dB", found.background), ("standardized_dB", found.standardized),
        ("reverberation_time_s", found.reverberation_time),
    ):  # fmt: skip
        assert columns[title] == pytest.approx(values, abs=1e-7)
    assert columns["is_upper_bound"].tolist() == [0, 0, 0, 1]
    both, alone = rating_table(found), found.rating.rows()
    assert [row[:2] for row in both[1:]] == alone[1:]
    assert found.standardized_rating is not None
    after = found.standardized_rating.rows()
    # The class is that of the levels in the room only.
    assert [row[2] for row in both[1:]] == [after[1][1], "", after[3][1]]
    assert rating_table(replace(found, volume=None)) == alone


@pytest.mark.parametrize(
    ("titles", "encoding"),
    [
        ("Terzmittenfrequenz in Hz;Position 1;Position 2;Störpegel [dB];Nachhallzeit (s)", "utf-8"),
        ("Centre frequency, Hz;Position 1;Position 2;Background noise, dB;RT, s", "utf-8"),
        ("주파수(Hz);측정점 1;측정점 2;배경소음 (dB);잔향시간(s)", "utf-8"),
        ("中心周波数（Hz）;測定点1;測定点2;暗騒音レベル（dB）;残響時間（s）", "utf-8"),  # noqa: RUF001 - as printed
        # Encodings of spreadsheets.
        ("Frequenz;Messpunkt 1;Messpunkt 2;Störpegel;Nachhallzeit", "latin-1"),
        ("중심주파수(Hz);측정점 1;측정점 2;배경소음 (dB);잔향시간(s)", "cp949"),
        ("周波数（Hz）;位置1;位置2;暗騒音レベル（dB）;残響時間（s）", "cp932"),  # noqa: RUF001 - as printed
        ("周波数;位置1;位置2;暗騒音;残響時間", "utf-16"),
        ("Frequenz;Messpunkt 1;Messpunkt 2;Hintergrund;Nachhallzeit", "latin-1"),
    ],
)
def test_titles_are_read_in_languages_and_encodings(
    titles: str, encoding: str, tmp_path: Path
) -> None:
    bands = zip(OCTAVES, (70, 60, 55, 50), strict=True)
    rows = [f"{f:g};{level};{level + 2};{level - 30};0,6" for f, level in bands]
    path = tmp_path / "levels.csv"
    path.write_bytes("\r\n".join([titles, *rows]).encode(encoding))
    found = thud.read_room_levels(path, volume=50.0)
    assert found.positions.tolist() == [[70, 60, 55, 50], [72, 62, 57, 52]]
    assert found.background is not None
    assert found.background.tolist() == [40, 30, 25, 20]
    assert found.reverberation_time is not None
    assert found.reverberation_time.tolist() == [0.6] * 4


def test_workbook_is_read_like_a_table(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    book.active.append(["Messung vom 3. Mai"])
    sheet = book.create_sheet("Pegel")
    sheet.append(["Bericht"])
    sheet.append([])
    sheet.append([None, "Frequenz (Hz)", "P1", "P2", None, "Nachhallzeit"])
    for f, level in zip((63, 125, 250, 500), (70.5, 60, 55, 50), strict=True):
        sheet.append([None, f, level, level + 2, None, 0.6])
    path = tmp_path / "levels.xlsx"
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
    path.write_bytes(b"PK no workbook")
    with pytest.raises(thud.InputError, match=naming("levels.xlsx", "cannot be read")):
        thud.read_room_levels(path)


def test_missing_package_of_workbooks_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "openpyxl", None)
    (tmp_path / "levels.xlsx").touch()
    with pytest.raises(thud.InputError, match=naming("openpyxl", "pip install")):
        thud.read_room_levels(tmp_path / "levels.xlsx")
