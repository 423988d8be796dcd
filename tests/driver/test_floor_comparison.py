"""Floors side by side, and the tapping machine beside the ball."""

from __future__ import annotations

import html
import math
import re
from dataclasses import replace
from unittest.mock import Mock

import numpy as np
import pytest
from conftest import REPOSITORY, noted
from test_figure_look import assert_clean

import thud
from thud.base.bridge import ask
from thud.case.case import case_text
from thud.floors.description import rating_title
from thud.floors.tapping import FREQUENCY
from thud.level.rating import class_text

# ISO 12354, 220 mm floor of 5 m x 4 m: thirds 50 to 630 Hz.
PUBLISHED = [57.3, 58.2, 59.2, 60.2, 61.1, 62.1, 62.5, 62.7, 63.0, 63.3, 63.6, 64.0]
# ISO 717-2: reference values of the thirds 100 to 3150 Hz, dB.
REFERENCE = np.array([62.0, 62, 62, 62, 62, 62, 61, 60, 59, 58, 57, 54, 51, 48, 45, 42])
CASES = {
    name: thud.Case(name=name, floor=thud.Plate(thickness=thickness), room=thud.Room())
    for name, thickness in (("thin", 0.14), ("thick", 0.22))
}


@pytest.fixture(scope="module")
def found() -> thud.FloorComparison:
    """Return the comparison of two floors."""
    return thud.compare_floors(CASES)


def test_tapping_levels_are_those_of_the_published_example() -> None:
    # f_c = c0**2 sqrt(3)/(pi c_L h) = 76.8 Hz.
    speed = 340**2 * np.sqrt(3) / (np.pi * 76.8 * 0.22)
    floor = thud.Plate(thickness=0.22, density=2200.0, wave_speed=speed)
    found = thud.tapping_level(floor, thud.Room(sound_speed=340.0))
    assert found.level[:12] == pytest.approx(PUBLISHED, abs=0.1)


def test_note_names_the_floors_that_are_not_what_they_claim_to_be() -> None:
    room = thud.Room(ceiling_mass=100.0, ceiling_depth=0.5)
    found = thud.predict_level(thud.solve(), thud.Plate(thickness=0.4, screed_thickness=0.08), room)
    note = noted(thud.compare_floors({"quiet": found, "again": found}).notes, "level_below_paths")
    assert (note.subject, note.high) == ("quiet, again", 30.0)


def test_rating_of_the_tapping_machine_is_the_least_shift_that_is_allowed() -> None:
    draw = np.random.default_rng(8)
    for middle in np.linspace(-20, 90, 200):
        level = middle + draw.uniform(-15, 15, 19)
        found = thud.TappingLevel(FREQUENCY, level)
        # In tenths of a decibel, as ISO 717-2 rounds; thirds below 100 Hz do not count.
        tenths = np.round(10 * level[3:])
        shifts = [
            n for n in range(-150, 150)
            if np.maximum(tenths - 10 * (REFERENCE + n), 0).sum() <= 320
        ]  # fmt: skip
        assert found.weighted == 60 + min(shifts)
        energy = sum(10 ** (one / 100) for one in tenths[:-1])
        assert found.adaptation == math.floor(10 * math.log10(energy) + 0.5) - 15 - found.weighted


def test_halves_of_a_tenth_are_rounded_up() -> None:
    # Excesses of 29.8 dB and one of 2.25 dB: 32.1 dB, of which 32 dB are allowed.
    level = np.concatenate([np.zeros(3), REFERENCE + 2.0])
    level[[3, 4]] += (0.25, -0.2)
    assert thud.TappingLevel(FREQUENCY, level).weighted == 61
    level[3] -= 0.01
    assert thud.TappingLevel(FREQUENCY, level).weighted == 60


def test_tapping_level_is_the_formula_of_iso_12354_2() -> None:
    floor, room = thud.Plate(thickness=0.16, density=2400.0), thud.Room(volume=30.0)
    case = case_text(thud.Case(floor=floor, room=room))
    known = ask("floor_modes", case=case, frequency=FREQUENCY)["plate"]
    found = thud.tapping_level(floor, room)
    for i, frequency in enumerate((50, 63, 80, 100, 125, 160, 200, 250, 315, 400, 500, 630)):
        time = 2.2 / (frequency * known["loss_factor"][i])
        expected = 155 - 30 * math.log10(0.16 * 2400) + 10 * math.log10(time)
        expected += 10 * math.log10(known["radiation_factor"][i] * frequency / 1000)
        assert found.frequency[i] == frequency
        assert found.level[i] == pytest.approx(expected, abs=1e-9)
    higher = [800, 1000, 1250, 1600, 2000, 2500, 3150]
    assert found.frequency[12:].tolist() == higher
    default, stated = (thud.tapping_level(floor, *rooms).level for rooms in ((), (thud.Room(),)))
    assert np.array_equal(default, stated)
    # The constant of the formula moves by 10 lg of the ratio, 1 dB at 1.26: near concrete.
    for ratio in (1 / 1.25, 1.25):
        near = thud.Plate(wave_speed=3500.0 * ratio, density=2300.0)
        assert np.isfinite(thud.tapping_level(near).level).all()


def test_comparison_has_the_numbers_of_its_predictions(found: thud.FloorComparison) -> None:
    thin = found.predictions["thin"]
    expected = thud.predict_level(thud.solve(CASES["thin"]))
    assert thin.level == pytest.approx(expected.level)
    rows = {row[0]: row[1:] for row in found.rows()}
    assert rows["name"] == ("thin", "thick")
    for name, rating in thin.ratings.items():
        assert rows[f"{rating_title(thin, name)}, dB"][0] == f"{rating.rounded}"
        assert rows[f"standard uncertainty of {name}, dB"][0] == f"{rating.uncertainty:.1f}"
    assert all(text.startswith("no class") for text in rows["class (KS F 2863-2)"])
    table = found.to_dataframe()
    octaves = [prediction.octave_level[0] for prediction in found.predictions.values()]
    assert table["63_Hz_octave_dB"].tolist() == octaves


def test_constructions_are_compared_by_their_names() -> None:
    entry = thud.construction("concrete 180")
    page = thud.compare_floors({"name": "concrete 180", "entry": entry, "case": entry.case()})
    first, *others = page.predictions.values()
    assert all(other.level.tolist() == first.level.tolist() for other in others)


def test_floors_without_a_tapping_level_leave_its_cell_empty(
    shell: thud.Impact, found: thud.FloorComparison
) -> None:
    light = thud.Plate(thickness=0.1, density=500.0)
    predictions = {
        "thick": found.predictions["thick"],
        "light": thud.predict_level(shell, light, thud.Room()),
        "joists": thud.predict_level(shell, thud.JoistFloor(), thud.Room()),
        "ceiling": thud.predict_level(shell, thud.Plate(), thud.Room(ceiling_mass=9.0)),
    }
    page = thud.compare_floors(predictions)
    assert list(page.predictions.values()) == list(predictions.values())
    tapping = thud.tapping_level(thud.Plate(thickness=0.22))
    *_, energy, weighted, adaptation = page.rows()
    assert weighted[1:] == (f"{tapping.weighted}", "", "", "")
    assert adaptation[1:] == (f"{tapping.adaptation}", "", "", "")
    assert float(energy[1]) == pytest.approx(1e3 * predictions["thick"].energy.sum(), rel=5e-3)


def test_error_of_the_tapping_level_is_no_empty_cell(
    found: thud.FloorComparison, monkeypatch: pytest.MonkeyPatch
) -> None:
    refuse = Mock(side_effect=thud.InputError)
    monkeypatch.setattr("thud.floors.floor_comparison.tapping_level", refuse)
    with pytest.raises(thud.InputError):
        found.rows()


def test_page_draws_chain_and_ratings(found: thud.FloorComparison) -> None:
    figure = found.plot()
    ratings, level = figure.axes
    steps = thud.plot.floor_steps(found)
    force, energy, radiated = steps.axes
    thin = found.predictions["thin"]
    for axes, values in (
        (force, 10 * np.log10(thin.energy / thin.conductance)),
        (energy, 10 * np.log10(thin.energy)),
        (radiated, 100 * thin.radiated_share),
        (level, thin.level),
    ):
        assert axes.lines[0].get_ydata() == pytest.approx(values)
    assert ratings.get_xlabel().endswith(", dB")
    assert_clean(figure)
    assert_clean(steps)
    predictions = found.predictions.values()
    drawn = [np.asarray(line.get_xdata()) for line in ratings.lines]
    for wanted in (
        [one.rating.level for one in predictions],
        [one.rating.level - one.rating.uncertainty for one in predictions],
        [one.rating.level + one.rating.uncertainty for one in predictions],
    ):
        assert any(values == pytest.approx(wanted) for values in drawn)
    assert found.files()["floors.html"].count(b'"curves": ') == 4


def test_rating_of_a_source_that_does_not_conform_is_marked() -> None:
    """Class and verdict are not stated, whatever the level."""
    floor, room = thud.Plate(screed_thickness=0.05), thud.Room(required=49.0, rating="octaves")
    case = thud.Case(floor=floor, room=room)
    conforming = thud.predict_level(thud.solve(case))
    low = thud.predict_level(thud.solve(replace(case, drop=thud.Drop(height=0.1))))
    assert low.verdict == "undecided"
    assert low.korean_class is None
    assert "does not conform" in repr(low)
    assert "does not conform" not in repr(conforming)
    page = thud.compare_floors({"low": low, "standard": conforming})
    rows = {row[0]: row[1:] for row in page.rows()}
    assert rows["source"] == ("the source does not conform", "")
    assert rows["class (KS F 2863-2)"] == ("", class_text(conforming.korean_class))
    assert (rows["required, dB"][0], rows["verdict"][0]) == ("49", "undecided")
    text = html.unescape(page.files()["floors.html"].decode())
    text = text.replace("\N{NO-BREAK SPACE}", " ").replace("\N{MINUS SIGN}", "-")
    assert all(f"<li>{note.message}</li>" in text for note in page.notes)


def test_tyre_has_no_rating_of_the_ball() -> None:
    tyre = thud.read_case(REPOSITORY / "inputs/tyre.nml")
    floor, room = thud.Plate(screed_thickness=0.05), thud.Room(required=60.0)
    prediction = thud.predict_level(thud.solve(replace(tyre, floor=floor, room=room)))
    titles = [row[0] for row in thud.compare_floors({"tyre": prediction}).rows()]
    texts = [*titles, repr(prediction)]
    assert not [text for text in texts if re.search("ISO|KS F|L_iA|class", text)]
    assert "A-weighted level (thirds), dB" in titles
