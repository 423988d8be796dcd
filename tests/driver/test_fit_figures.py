"""Figures of fits: what can be seen is named, and what is named can be seen."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from conftest import quiet_fit
from scipy import stats

import thud
from thud.plot.fit_figures import MAX_CHARACTERS, _label, confidence, draw_fit, target_and_fit

if TYPE_CHECKING:
    from matplotlib.figure import Figure

IMPACT = thud.solve(duration=0.03)


def fit_with_noise(noise: float, *parameters: str) -> thud.Fit:
    force = IMPACT.floor_force + np.random.default_rng(1).normal(scale=noise, size=1323)
    return quiet_fit((IMPACT.time + 0.2, force), parameters)


def labels(figure: Figure) -> list[str]:
    return [text.get_text() for text in figure.legends[0].get_texts()]


@pytest.mark.parametrize(("noise", "shown"), [(1.0, False), (40.0, True)])
def test_record_is_drawn_where_it_can_be_seen(noise: float, shown: bool) -> None:  # noqa: FBT001
    figure = target_and_fit(fit_with_noise(noise, "youngs_modulus"))
    assert ("Record" in labels(figure)) is shown


def test_noise_is_that_of_the_band() -> None:
    fit = fit_with_noise(5.0, "youngs_modulus")
    figure = target_and_fit(fit)
    assert labels(figure) == ["Record below 1.25 kHz", "Fit", "Noise below 1.25 kHz, ±2σ"]
    below = figure.axes[1]
    # White noise of 22.05 kHz, of which 1.25 kHz are left.
    (band,) = below.patches
    assert band.get_height() == pytest.approx(4 * fit.noise * np.sqrt(1.25 / 22.05), rel=0.02)
    low, high = below.get_ylim()
    assert low == -high


def test_labels_break_where_they_do_not_fit() -> None:
    assert _label("youngs_modulus", "MPa", MAX_CHARACTERS / 2) == "Young's modulus, MPa"
    assert _label("youngs_modulus", "MPa", MAX_CHARACTERS / 3) == "Young's modulus,\nMPa"
    figure = confidence(fit_with_noise(5.0, "youngs_modulus", "height"))
    shown = {label for axes in figure.axes for label in (axes.get_xlabel(), axes.get_ylabel())}
    assert shown == {"", "Young's modulus, MPa", "Height, mm", "Time shift, ms"}


def test_level_target_has_no_ellipse_of_one_parameter() -> None:
    levels = IMPACT.levels(force="floor").tolist()
    fit = thud.fit(thud.LevelTarget(levels, uncertainty=0.5), ["youngs_modulus"])
    figures = fit.figures()
    assert list(figures) == ["fit"]
    assert labels(figures["fit"]) == ["Standard deviation of the target", "Target", "Fit"]
    assert figures["fit"].axes[1].get_xlabel() == "Octave band, Hz"
    drawn = (one.get_paths()[0].vertices[:, 1] for one in figures["fit"].axes[0].collections[:5])
    spans = [(heights.min(), heights.max()) for heights in drawn]
    assert np.allclose(spans, [(level - 0.5, level + 0.5) for level in levels])


@pytest.mark.parametrize("freedom", [None, 7, 40])
def test_ellipse_is_the_joint_confidence_region(freedom: int | None) -> None:
    fit = fit_with_noise(5.0, "youngs_modulus", "height")
    first = {name: getattr(fit, name)[:2] for name in ("names", "units", "estimate", "limits")}
    covariance = fit.covariance[:2, :2]
    pair = replace(fit, **first, covariance=covariance, interval_freedom=freedom)
    (axes,) = draw_fit(pair)["confidence"].axes
    units = [size for _, size in pair.display_units.values()]
    points = axes.patches[0].get_xy() * units - pair.estimate
    square = np.einsum("ij,jk,ik->i", points, np.linalg.inv(pair.covariance), points)
    # The region of one parameter with the same freedom is the interval: F with 1 is t squared.
    quantile = 2 * stats.f.ppf(0.95, 2, freedom) if freedom else stats.chi2.ppf(0.95, 2)
    np.testing.assert_allclose(square, quantile, rtol=1e-6)
