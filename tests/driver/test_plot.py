"""Figures: units on the axes, tolerance band, every curve in the legend, whole files."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

import thud

if TYPE_CHECKING:
    from pathlib import Path


def test_force_history_shows_every_curve_with_units() -> None:
    impacts = {f"{height} m": thud.solve(drop=thud.Drop(height)) for height in (0.1, 1.0, 1.6)}
    (axes,) = thud.plot.force_history(impacts).axes
    assert axes.get_xlabel().endswith(", ms")
    assert axes.get_ylabel().endswith(", kN")
    assert [text.get_text() for text in axes.get_legend().get_texts()] == list(impacts)
    for line, impact in zip(axes.lines, impacts.values(), strict=True):
        np.testing.assert_array_equal(line.get_ydata(), 1e-3 * impact.elastic_force)
    assert len({(line.get_color(), line.get_linestyle()) for line in axes.lines}) == 3


@pytest.mark.parametrize("source", ["rubber_ball", "tyre"])
def test_levels_show_the_tolerance_band(source: str) -> None:
    impact = thud.solve()
    (axes,) = thud.plot.levels({"ball": impact}, source=source).axes
    assert axes.get_xlabel().endswith(", Hz")
    assert axes.get_ylabel() == "Force exposure level, dB re 1 N"
    boxes = [box.get_datalim(axes.transData).intervaly for box in axes.collections]
    limits = [(c.lower, c.upper) for c in impact.conformity(source).criteria[:5]]
    np.testing.assert_allclose(boxes, limits)
    curves = {str(line.get_label()): line.get_ydata() for line in axes.lines}
    np.testing.assert_array_equal(curves["elastic force"], impact.levels(force="elastic"))
    np.testing.assert_array_equal(curves["floor force"], impact.levels(force="floor"))


def test_useless_impacts_are_told() -> None:
    for impacts in ({}, [], thud.solve()):
        with pytest.raises(thud.InputError, match="allowed: a mapping of names to impacts"):
            thud.plot.force_history(impacts)  # type: ignore[arg-type]
    with pytest.raises(thud.InputError, match="allowed: an object of Impact"):
        thud.plot.levels({"ball": 1})  # type: ignore[dict-item]


def test_names_are_no_formulas(tmp_path: Path) -> None:
    thud.plot.save(thud.plot.levels({"$x^{$": thud.solve()}), f"{tmp_path}/levels.png")
    assert (tmp_path / "levels.png").exists()


def test_figures_are_a_column_wide_and_whole(tmp_path: Path) -> None:
    figure = thud.plot.levels({"a": thud.solve(), "b": thud.solve(drop=thud.Drop(0.1))}, "floor")
    assert figure.get_figwidth() == pytest.approx(3.5)
    for ending in ("png", "svg", "pdf"):
        thud.plot.save(figure, tmp_path / f"levels.{ending}")
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "levels.pdf",
        "levels.png",
        "levels.svg",
    ]
    with pytest.raises(thud.InputError, match="allowed: "):
        thud.plot.save(figure, tmp_path / "levels.xyz")
