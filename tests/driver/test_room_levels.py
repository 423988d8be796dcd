"""Levels measured in the room below: mean, background, standardisation, rating."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from conftest import REPOSITORY, naming

import thud
from thud.cli import main

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

PUBLISHED = REPOSITORY / "inputs" / "floors" / "field_levels.csv"
OCTAVES = (63.0, 125.0, 250.0, 500.0)


def write(path: Path, text: str) -> Path:
    """Write a table and return its path."""
    file = path / "levels.csv"
    file.write_text(text, encoding="utf-8")
    return file


def test_published_measurement_is_standardised_and_rated(oracle: Callable[..., None]) -> None:
    found = thud.read_room_levels(PUBLISHED, volume=41.4)
    printed = [76.3, 57.2, 47.2, 44.8, 38.1, 37.0, 35.3, 30.7, 24.5, 22.2, 16.8, 15.1]
    # Printed to 0.1 dB; its own rounding of the table of g(C) leaves 0.07 dB.
    oracle(
        "standardised levels of a room (Gurtner)",
        "published measurement",
        found.standardised - printed,
        0.1,
        "dB",
    )
    assert found.rating.a_weighted == pytest.approx(46.97, abs=0.01)
    assert found.standardised_rating.a_weighted == pytest.approx(46.24, abs=0.01)
    assert (found.rating.rounded, found.standardised_rating.rounded) == (47, 46)
    assert found.rating.korean_class is None


def test_example_of_iso_717_2_is_rated(oracle: Callable[..., None]) -> None:
    found = thud.rating([65.3, 64.5, 58.0, 55.8])
    assert found.rounded == 55
    oracle(
        "rating of the example of ISO 717-2",
        "published example",
        found.a_weighted - 55.3507,
        1e-4,
        "dB",
    )
    assert found.curve == 51
    assert found.korean_class == 0


@pytest.mark.parametrize("level", [1e308, -1e308, 1e5])
def test_levels_that_are_none_are_not_rated(level: float) -> None:
    """1e308 dB went on for ever, 1e5 dB had the best class."""
    with pytest.raises(thud.InputError, match=naming("levels", level, -1000, 1000)):
        thud.rating([70.0, 70.0, 70.0, level])


@pytest.mark.parametrize(
    ("title", "unit"), [("frequency (kHz)", "Hz"), ("T20 (ms)", "s"), ("mean_Pa", "dB")]
)
def test_columns_of_another_unit_are_refused(tmp_path: Path, title: str, unit: str) -> None:
    """50 ms were read as 50 s."""
    titles = {"f": "frequency", "T": "T20", "m": "mean"} | {title[0]: title}
    lines = [";".join(titles.values())] + [f"{f};0.5;70" for f in OCTAVES]
    with pytest.raises(thud.InputError, match=naming("levels.csv", f"'{title}'", unit)):
        thud.read_room_levels(write(tmp_path, "\n".join(lines)))


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
    assert found.is_maximum.tolist() == (near < 6).tolist()
    assert found.is_maximum.any()
    # The A-weighted energy of each position, and the standard error of their mean.
    energy = np.array([10 ** (thud.rating(one).a_weighted / 10) for one in levels])
    error = energy.std(ddof=1) / np.sqrt(6) / energy.mean() * 10 / np.log(10)
    assert found.position_uncertainty == pytest.approx(error)
    assert any("maxima" in remark for remark in found.remarks)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", naming("frequency", "Hz")),
        ("63,60\n125,60\n250,60\n500,60\n", naming("2 columns")),
        ("level,P1\n63,60\n", naming("frequency")),
        ("frequency,T\n63,1\n125,1\n250,1\n500,1\n", naming("levels")),
        ("frequency,P1\n63,60\n125,60\n250,60\n", naming("500 Hz")),
        ("frequency,P1\n63,60\n63,60\n250,60\n500,6\n", naming("63 Hz")),
        ("frequency,P1\n63,60\n125,60\n250,60\n470,60\n", naming("470 Hz")),
        ("frequency,P1\n63,60\n125,600\n250,60\n500,60\n", naming("level", "600 dB", -50, 200)),
        ("frequency,P1\n63,60\n125,nan\n250,60\n500,60\n", naming("level", "nan", -50, 200)),
        (
            "frequency,T,P1\n63,0,60\n125,1,60\n250,1,60\n500,1,60\n",
            naming("reverberation_time", "0 s", 0.01),
        ),
        ("frequency,T,T20,P1\n63,1,1,60\n125,1,1,60\n", naming("time")),
        ("frequency,P1\n63,60\n125\n", naming("line 3", 1, 2)),
    ],
)
def test_tables_that_cannot_be_rated_are_refused(tmp_path: Path, text: str, words: str) -> None:
    with pytest.raises(thud.InputError, match=words) as caught:
        thud.read_room_levels(write(tmp_path, text))
    assert "levels.csv" in str(caught.value)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (([60.0] * 3,), naming("levels", "(3,)", "(4,)")),
        (([60.0] * 4, "third"), naming("levels", "(4,)", "(12,)")),
        (([60.0] * 4, "fifth"), naming("bands", "'fifth'", "'third'")),
        (([60.0, np.inf, 60.0, 60.0],), naming("levels", "finite")),
    ],
)
def test_levels_that_cannot_be_rated_are_refused(arguments: tuple[object, ...], words: str) -> None:
    with pytest.raises(thud.InputError, match=words):
        thud.rating(*arguments)


@pytest.mark.parametrize(("time", "volume"), [(0.0, 50.0), (-1.0, 50.0), (0.5, 0.0), (0.5, -3.0)])
def test_rooms_that_cannot_be_are_refused(time: float, volume: float) -> None:
    name = "volume" if time > 0 else "reverberation_time"
    with pytest.raises(thud.InputError, match=naming(name, 0)):
        thud.standardised_level([60.0], time, volume)


def test_command_rates_a_table(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "out"
    assert main(["rate", str(PUBLISHED), "--volume", "41.4", "--output", str(folder)]) == 0
    shown = capsys.readouterr()
    assert "47 (46.97)" in shown.out
    assert "46 (46.24)" in shown.out
    assert "background" in shown.err
    assert {path.name for path in folder.iterdir()} == {
        "room_levels.csv", "room_levels.png", "room_levels.svg",
    }  # fmt: skip
    lines = (folder / "room_levels.csv").read_text(encoding="utf-8").splitlines()
    assert len(lines) == 13
    assert "standardised_dB" in lines[0]


@pytest.mark.parametrize("title", ["mean_dB", "std dev", "Standardised, dB", "EDT"])
def test_columns_of_no_position_are_refused(tmp_path: Path, title: str) -> None:
    rows = "".join(f"{f},60,55\n" for f in (63, 125, 250, 500))
    (tmp_path / "levels.csv").write_text(f"frequency,first,{title.replace(',', '')}\n{rows}")
    with pytest.raises(thud.InputError, match=naming("levels.csv", f"'{title.replace(',', '')}'")):
        thud.read_room_levels(tmp_path / "levels.csv")


def test_column_that_hardly_is_a_position_is_remarked(tmp_path: Path) -> None:
    rows = "".join(f"{f},60,1.2\n" for f in (63, 125, 250, 500))
    (tmp_path / "levels.csv").write_text(f"frequency,first,Nachhallzeit\n{rows}")
    assert any("59 dB" in one for one in thud.read_room_levels(tmp_path / "levels.csv").remarks)
    # A known title is no position.
    (tmp_path / "levels.csv").write_text(f"frequency,first,RT60\n{rows}")
    found = thud.read_room_levels(tmp_path / "levels.csv", volume=50.0)
    assert (len(found.positions), found.standardised is None) == (1, False)
