"""Maps of conformity against a closed form and against single drops."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from conftest import REPOSITORY
from matplotlib.collections import LineCollection

import thud

MODAL: dict[str, Any] = {
    "case": str(REPOSITORY / "inputs/rubber_ball_modal.nml"),
    "fixed": {"loss_factor": 0.2},
    "parameters": {
        "wall_thickness": {"values": [32, 30.6, 29], "unit": "mm"},
        "youngs_modulus": {"values": [1.5, 1.8, 2.0], "unit": "MPa"},
    },
}


def test_margin_of_a_source_with_known_levels() -> None:
    # With a given contact time the level is 20 lg M + 10 lg h + c.
    options = {"contact_time": 0.02, "restitution": 0.8}
    mass, height = np.linspace(3, 9, 4), np.linspace(0.4, 1, 3)
    parameters = {"mass": {"values": mass}, "height": {"values": height}}
    fixed = {"model": "hunt_crossley", "source": "tyre", **options}
    found = thud.design({"fixed": fixed, "parameters": parameters}).dataset
    one = thud.solve(thud.Ball(mass=1), thud.Drop(1), "hunt_crossley", **options)
    gain = np.add.outer(20 * np.log10(mass), 10 * np.log10(height))
    expected = [
        np.minimum(level + gain - limit.lower, limit.upper - level - gain)
        for level, limit in zip(one.levels(), one.assess("tyre").criteria[:5], strict=True)
    ]
    np.testing.assert_allclose(found["margin"], np.min(expected, axis=0), atol=1e-6)


def test_case_is_marked() -> None:
    result = thud.design(MODAL)
    assert result.mark == (0.032, 1.56e6)
    assert result.room_rating is None
    assert not any("KS F" in row[0] for row in result.rows())
    figure = result.plot()
    axes, bar = figure.axes
    (star,) = [line for line in axes.lines if line.get_marker() == "*"]
    # Whole on an edge of the map.
    assert not star.get_clip_on()
    assert (star.get_xdata()[0], star.get_ydata()[0]) == pytest.approx((32, 1.56))
    assert axes.get_xlabel() == "Wall thickness, mm"
    assert axes.get_ylabel() == "Young's modulus, MPa"
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    assert labels == ["Octave limits", "All criteria met", "Case"]
    assert bar.get_ylabel() == "Margin (force on the floor), dB"


def test_scale_of_the_study_is_that_of_the_axes() -> None:
    modulus = thud.Parameter(low=1e5, high=1e8, count=7, scale="log")
    height = thud.Parameter(low=1, high=2, count=2, scale="log")
    figure = thud.design({"youngs_modulus": modulus, "height": height}).plot()
    axes, _ = figure.axes
    assert (axes.get_xscale(), axes.get_yscale()) == ("log", "log")
    # 1e8 Pa would need a power of ten beside the axis, over the legend.
    assert axes.get_xlabel() == "Young's modulus, MPa"
    assert axes.get_xlim() == pytest.approx((0.1, 100))
    figure.draw_without_rendering()
    for axis, expected in ((axes.xaxis, {"0.1", "1", "10", "100"}), (axes.yaxis, {"1", "1.4"})):
        assert expected <= {text.get_text() for text in axis.get_ticklabels()}
    assert thud.design(MODAL).plot().axes[0].get_xscale() == "linear"


def test_colours_of_a_map_without_conformity_end_at_zero() -> None:
    heights = thud.Parameter(low=0.1, high=0.5, count=4)
    result = thud.design({"height": heights, "mass": [2.0, 2.5]})
    axes, bar = result.plot().axes
    low, high = bar.get_ylim()
    margin = result.dataset["margin"].values
    assert low <= margin.min()
    assert margin.max() < 0 == high
    # The zero is white, and round margins have lines, also in the bar.
    assert axes.collections[0].norm(0) == 0.5
    lines = axes.collections[1].levels
    assert len(lines) > 0
    assert set(lines) <= set(bar.get_yticks())
    marks = [c for c in bar.collections if isinstance(c, LineCollection)]
    assert any(len(mark.get_segments()) == len(lines) for mark in marks)


@pytest.mark.filterwarnings("error")
def test_map_of_nearly_one_margin_is_drawn() -> None:
    axes, _ = thud.design({"height": [0.1, 0.1001], "mass": [2.0, 2.0001]}).plot().axes
    assert not axes.texts


def test_places_without_results_stay_empty() -> None:
    result = thud.design({"height": [0.5, 1, -1], "mass": [2, 3, 4]})
    assert int(np.isnan(result.dataset["margin"]).sum()) == 3
    result.plot()
    assert ("samples", "9") in result.rows()


def decks(room: thud.Room, thickness: list[float], **more: object) -> thud.Design:
    """Return a map of floors of some thicknesses, mm, by the shell model."""
    case = thud.construction("concrete 180, screed on 10 MN/m3").case(
        thud.Case(model=thud.HollowSphere(), room=room)
    )
    parameters = {"thickness": {"values": thickness, "unit": "mm"}, **more}
    return thud.design({"case": case.to_namelist(), "parameters": parameters})


@pytest.fixture(scope="module")
def room_design() -> thud.Design:
    """Return a map of floors in a room with two reverberation times."""
    times = (*6 * (0.5,), *6 * (0.6,))
    room = thud.Room(volume=60.0, reverberation_time=times, rating="octaves")
    stiffness = {"values": [4, 8, 30], "unit": "MN/m3"}
    return decks(room, [120, 240, 300], **{"plate.layer_stiffness": stiffness})


def test_rating_is_that_of_single_predictions(room_design: thud.Design) -> None:
    found = room_design.room_rating
    assert found is not None
    assert found.dims == room_design.axes
    case = thud.Case.from_text(room_design.dataset.attrs["case"])
    assert isinstance(case.floor, thud.Plate)
    for i, j in ((0, 0), (1, 2), (2, 1)):
        one = found[i, j]
        thickness, stiffness = (float(one[axis]) for axis in room_design.axes)
        floor = replace(case.floor, thickness=thickness, layer_stiffness=stiffness)
        prediction = thud.predict_level(thud.solve(replace(case, floor=floor)))
        assert float(one) == pytest.approx(prediction.rating.level, abs=1e-6)


def test_map_of_a_room_has_the_limits_of_the_korean_classes(room_design: thud.Design) -> None:
    found = room_design.dataset["room_rating"]
    rows = dict(room_design.rows())
    assert rows["class 4 or better (KS F 2863-2)"] == str(int((found < 49.5).sum()))
    assert 0 < int((found < 49.5).sum()) < found.size
    figure = room_design.plot()
    drawn = {f"class {i}, {x} dB": x for i, x in enumerate((37, 41, 45, 49), 1)}
    inside = [name for name, x in drawn.items() if found.min() < x + 0.5 < found.max()]
    assert [text.get_text() for text in figure.legends[0].get_texts()] == inside
    # Colors and lines are of the same rating.
    assert "octaves" in figure.axes[1].get_ylabel()


def test_map_of_a_room_answers_which_floors_meet_its_requirement() -> None:
    """The color was another rating than that of the lines, and the requirement was ignored."""
    room = thud.Room(volume=50.0, required=40.0)
    thickness = [140.0, 260.0, 300.0]
    result = decks(room, thickness)
    found = result.dataset["room_rating"]
    assert result.room_rating is not None
    assert result.room_rating.values == pytest.approx(found.values)
    met = found < 40.5
    assert 0 < int(met.sum()) < 3
    rows = dict(result.rows())
    assert rows["rating at most 40 dB"] == f"{int(met.sum())} of 3"
    assert rows["samples whose source conforms"] == "0"
    smallest = 1e3 * float(result.dataset["thickness"][met.values].min())
    shown = next(value for name, value in result.rows() if name == "  at thickness, mm")
    assert float(shown) == pytest.approx(smallest)
    for design in (result, decks(room, thickness, volume={"values": [40, 60]})):
        (legend,) = design.plot().legends
        assert [text.get_text() for text in legend.get_texts()] == ["required, 40 dB"]


@pytest.mark.parametrize(("lowest", "count"), [(49.4, 1), (49.5, 0)])
def test_map_rounds_the_rating_as_the_verdict_does(
    room_design: thud.Design, lowest: float, count: int
) -> None:
    """A floor of 49.4 dB met 49 dB by its verdict, and did not in the map."""
    found = room_design.dataset["room_rating"]
    rating = found + lowest - float(found.min()) + 1e-9
    attrs = room_design.dataset.attrs
    case = attrs["case"].replace("required = 0.0", "required = 49.0")
    shifted = room_design.dataset.assign(room_rating=rating).assign_attrs(case=case)
    assert dict(thud.Design(shifted).rows())["rating at most 49 dB"] == f"{count} of {found.size}"


def test_design_of_one_parameter_is_a_curve() -> None:
    result = thud.design({"height": [0.9, 1, 1.1]})
    (axes,) = result.plot().axes
    assert axes.get_lines()[0].get_ydata() == pytest.approx(result.dataset["margin"].values)
