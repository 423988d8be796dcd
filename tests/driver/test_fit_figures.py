"""Figures of fits: what can be seen is named, and what is named can be seen."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING

import numpy as np
import pytest

import thud
from thud.studies.fitting import drawing

if TYPE_CHECKING:
    from matplotlib.figure import Figure

IMPACT = thud.solve(duration=0.03)


def fit_with_noise(noise: float, *parameters: str) -> thud.Fit:
    force = IMPACT.floor_force + np.random.default_rng(1).normal(scale=noise, size=1323)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", thud.FitWarning)
        return thud.fit((IMPACT.time + 0.2, force), parameters)


def labels(figure: Figure) -> list[str]:
    above, below = figure.axes
    assert below.get_legend() is None
    return [text.get_text() for text in above.get_legend().get_texts()]


@pytest.mark.parametrize(("noise", "shown"), [(1.0, False), (40.0, True)])
def test_record_is_drawn_where_it_can_be_seen(noise: float, shown: bool) -> None:  # noqa: FBT001
    figure = drawing.target_and_fit(fit_with_noise(noise, "youngs_modulus"))
    assert ("Record" in labels(figure)) is shown


def test_noise_is_that_of_the_band() -> None:
    fit = fit_with_noise(5.0, "youngs_modulus")
    figure = drawing.target_and_fit(fit)
    assert labels(figure) == ["Record below 1.25 kHz", "Fit", r"Noise below 1.25 kHz, $\pm2\sigma$"]
    below = figure.axes[1]
    # White noise of 22.05 kHz, of which 1.25 kHz are left.
    (band,) = below.patches
    assert band.get_height() == pytest.approx(4 * fit.noise * np.sqrt(1.25 / 22.05), rel=0.02)
    low, high = below.get_ylim()
    assert low == -high


def test_labels_break_where_there_is_no_room() -> None:
    units = {"youngs_modulus": ("MPa", 1e6)}
    assert drawing._label("youngs_modulus", units, drawing.LINE / 2) == "Young's modulus, MPa"  # noqa: SLF001
    assert drawing._label("youngs_modulus", units, drawing.LINE / 3) == "Young's modulus,\nMPa"  # noqa: SLF001
    figure = drawing.confidence(
        fit_with_noise(5.0, "youngs_modulus", "height"),
        {"youngs_modulus": ("MPa", 1e6), "height": ("m", 1.0), "time_shift": ("ms", 1e-3)},
    )
    shown = {axes.get_xlabel() for axes in figure.axes} | {
        axes.get_ylabel() for axes in figure.axes
    }
    assert shown == {"", "Young's modulus, MPa", "Height, m", "Time shift, ms"}
