"""The figure of a sweep: axes in their scale, texts in panels, words for what is drawn."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import thud
from thud.plot.style import RATING_SYMBOL

if TYPE_CHECKING:
    from matplotlib.figure import Figure

HEIGHTS = {"values": [50, 100], "unit": "cm"}
NOMINAL = np.array([39, 31, 23, 17, 12.5])


def draw(**study: Any) -> Figure:  # noqa: ANN401 - of a study
    return thud.sweep({"fixed": {"model": "hollow_sphere"}, **study}).plot()


def curves(figure: Figure, line: int = 0) -> np.ndarray:
    """Return the medians of a line in all panels, above that of 0 dB; shape (n_place, 5)."""
    return np.column_stack([axes.lines[1 + line].get_ydata() for axes in figure.axes])


def words(figure: Figure) -> str:
    return figure.legends[0].get_title().get_text()


def test_logarithmic_parameter_has_a_logarithmic_axis() -> None:
    modulus = {"low": 1e5, "high": 1e8, "count": 7, "scale": "log"}
    figure = draw(parameters={"youngs_modulus": modulus})
    axes = figure.axes[-1]
    assert axes.get_xscale() == "log"
    assert axes.get_xlabel() == "Young's modulus, MPa"
    figure.draw_without_rendering()
    assert axes.xaxis.get_offset_text().get_text() == ""
    assert draw(parameters={"height": HEIGHTS}).axes[0].get_xscale() == "linear"


def test_first_numeric_parameter_is_the_axis_and_texts_have_lines() -> None:
    fluxes = ["none", "retarding"]
    figure = draw(parameters={"momentum_flux": {"values": fluxes}, "height": HEIGHTS})
    assert [axes.texts[0].get_text() for axes in figure.axes][:2] == ["31.5 Hz", "63 Hz"]
    assert [axes.get_xlabel() for axes in figure.axes] == [*[""] * 4, "Height, cm"]
    assert [text.get_text() for text in figure.legends[0].get_texts()] == fluxes
    for i, flux in enumerate(fluxes):
        drops = [
            thud.solve(drop=thud.Drop(height), momentum_flux=flux, model="hollow_sphere")
            for height in (0.5, 1.0)
        ]
        levels = [impact.levels() - NOMINAL for impact in drops]
        np.testing.assert_allclose(curves(figure, i), levels, atol=1e-6)
    assert words(figure) == "Gray: tolerance of the octave"


def test_texts_alone_are_the_axis() -> None:
    fluxes = ["none", "retarding"]
    figure = draw(parameters={"momentum_flux": {"values": fluxes}})
    axes = figure.axes[-1]
    assert [text.get_text() for text in axes.get_xticklabels()] == fluxes
    levels = [
        thud.solve(momentum_flux=flux, model="hollow_sphere").levels() - NOMINAL for flux in fluxes
    ]
    np.testing.assert_allclose(curves(figure), levels, atol=1e-6)
    assert axes.get_xlabel() == "Momentum flux"


def test_every_set_has_the_nominal_levels_of_its_source_and_its_assessed_force() -> None:
    sources, forces = ["rubber_ball", "tyre"], ["elastic", "floor"]
    for force in forces:
        figure = draw(
            fixed={"model": "hollow_sphere", "force": force},
            parameters={"source": {"values": sources}, "height": HEIGHTS},
        )
        for i, source in enumerate(sources):
            impact = thud.solve(model="hollow_sphere")
            limits = impact.assess(source).criteria[:5]
            nominal = [(limit.lower + limit.upper) / 2 for limit in limits]
            drawn = curves(figure, i)[1]
            np.testing.assert_allclose(drawn, impact.levels(force=force) - nominal)
        # The tolerance of the tyre, and that of the ball within it.
        assert [axes.patches[0].get_height() for axes in figure.axes] == [2, 3, 3, 4, 4]
    figure = draw(parameters={"force": {"values": forces}, "height": HEIGHTS})
    for i, force in enumerate(forces):
        np.testing.assert_allclose(
            curves(figure, i)[1], thud.solve(model="hollow_sphere").levels(force=force) - NOMINAL
        )


def test_figure_says_what_lines_and_shades_are() -> None:
    thickness, mass = {"values": [0.03, 0.032]}, {"values": [2.4, 2.5]}
    for others, expected in (
        ({"wall_thickness": thickness}, "median over wall thickness; shades: range"),
        ({"wall_thickness": thickness, "mass": mass}, "median over 2 other parameters; shades"),
    ):
        assert expected in words(draw(parameters={"height": HEIGHTS, **others}))
    # Shades that are not drawn are not announced.
    explained = words(draw(design={"kind": "list"}, parameters={"height": HEIGHTS, "mass": mass}))
    assert explained.startswith("Also varied: mass\n")
    assert "shades" not in explained


def test_case_with_a_room_is_drawn() -> None:
    case = thud.Case(model=thud.HollowSphere(), floor=thud.Plate(), room=thud.Room())
    result = thud.sweep({"plate.thickness": [0.14, 0.18, 0.22]}, case=case)
    figure = result.plot()
    (axes,) = figure.axes
    assert axes.get_xlabel() == "Plate thickness, m"
    (line,) = axes.lines
    assert line.get_ydata() == pytest.approx(result.dataset["room_rating"].values)
    assert figure.get_supylabel().startswith(RATING_SYMBOL)
