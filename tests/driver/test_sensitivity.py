"""Sobol indices against closed forms: Ishigami's function, and a source whose levels are a sum."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from conftest import REPOSITORY

import thud
from thud.studies.sampling import unit_samples
from thud.studies.sensitivity import sobol_indices

if TYPE_CHECKING:
    from thud.studies.sensitivity import Sensitivity

# With a given contact time the level is 20 lg M + 10 lg h + c, whatever the radius.
LUMPED: dict[str, Any] = {
    "name": "lumped",
    "fixed": {"model": "hunt_crossley", "contact_time": 0.02, "restitution": 0.8},
    "design": {"size": 128, "seed": 3},
    "parameters": {
        "mass": {"low": 2.0, "high": 3.0},
        "height": {"low": 0.5, "high": 2.0},
        "outer_radius": {"low": 8, "high": 9, "unit": "cm"},
    },
}


@pytest.fixture(scope="module")
def lumped() -> Sensitivity:
    """Return the indices of the lumped source."""
    return thud.sensitivity(LUMPED)


def test_indices_of_ishigami() -> None:
    # Ishigami and Homma (1990): sin x1 + 7 sin(x2)^2 + 0.1 x3^4 sin x1, x between -pi and pi.
    x = np.pi * (2 * unit_samples("saltelli", 3, 2048, 1) - 1)
    values = np.sin(x[:, 0]) + 7 * np.sin(x[:, 1]) ** 2 + 0.1 * x[:, 2] ** 4 * np.sin(x[:, 0])
    first, first_interval, total, total_interval = found = sobol_indices(values, 3)
    # The intervals of seed 0 are always the same.
    np.testing.assert_array_equal(sobol_indices(values, 3, 0), found)
    a, b = 7.0, 0.1
    alone = [0.5 * (1 + b * np.pi**4 / 5) ** 2, a**2 / 8, 0.0]
    both = b**2 * np.pi**8 * (1 / 18 - 1 / 50)
    whole = sum(alone) + both
    exact_total = np.add(alone, [both, 0, both]) / whole
    # Intervals of 95 % are two standard errors: four are left to chance.
    assert np.all(np.abs(first - np.array(alone) / whole) <= 2 * first_interval)
    assert np.all(np.abs(total - exact_total) <= 2 * total_interval)
    assert np.all(first_interval < 0.1)
    assert np.all(total_interval < 0.1)


def test_indices_of_a_source_whose_levels_are_a_sum(lumped: Sensitivity) -> None:
    m, h = np.linspace(2, 3, 10001), np.linspace(0.5, 2, 10001)
    share = np.array([np.var(20 * np.log10(m)), np.var(10 * np.log10(h)), 0])
    share /= share.sum()
    levels = lumped.indices.isel(output=slice(0, 5))
    for name in ("first_order", "total"):
        error = np.abs(levels[name] - share)
        assert (error <= 2 * levels[f"{name}_interval"] + 1e-9).all()
    assert (np.abs(levels["total"].sel(parameter="outer_radius")) < 1e-12).all()
    assert lumped.indices["output"].values.tolist()[-2:] == ["contact time", "peak force"]
    assert lumped.left_out == 0
    # The contact time is the one that was asked for: what does not vary has no indices.
    assert np.isnan(lumped.indices.sel(output="contact time")["total"]).all()


def test_samples_without_results_are_left_out() -> None:
    masses = {**LUMPED["parameters"], "mass": {"low": -0.5, "high": 3.0}}
    result = thud.sensitivity({**LUMPED, "parameters": masses})
    # A base sample is lost with its own mass or with that of its other matrix.
    assert 0 < result.left_out < 64
    assert np.isfinite(result.indices["total"].sel(output="peak force")).all()


def test_figure_shows_every_index(lumped: Sensitivity) -> None:
    figure = lumped.plot()
    assert [axes.get_title() for axes in figure.axes] == ["mass", "height", "outer radius"]
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    assert labels == ["total index", "95 % interval", "first order"]
    for axes, parameter in zip(figure.axes, LUMPED["parameters"], strict=True):
        row = lumped.indices.sel(parameter=parameter)
        bars, *intervals = axes.containers
        np.testing.assert_array_equal([bar.get_width() for bar in bars], row["total"])
        # No bar covers another.
        ends = [bar.get_y() + bar.get_height() for bar in bars]
        assert all(end < bar.get_y() for end, bar in zip(ends, [*bars][1:], strict=False))
        for container, name in zip(intervals, ("total", "first_order"), strict=True):
            (lines,) = container.lines[2]
            halves = [np.ptp(segment[:, 0]) / 2 for segment in lines.get_segments() if len(segment)]
            known = row[f"{name}_interval"].values
            np.testing.assert_allclose(halves, known[np.isfinite(known)], atol=1e-12)


def test_figure_of_five_parameters_fits_on_half_a_page() -> None:
    more = {name: {"low": 0.030, "high": 0.034} for name in ("wall_thickness", "gravity")}
    study = {**LUMPED, "design": {"size": 8}, "parameters": {**LUMPED["parameters"], **more}}
    assert thud.sensitivity(study).plot().get_figheight() < 4.4


@pytest.mark.parametrize("name", ["sweep", "sensitivity", "design", "uncertainty", "tyre"])
def test_inputs_of_the_repository_are_studies(name: str) -> None:
    kind = "sensitivity" if name == "tyre" else name
    study = thud.read_study(REPOSITORY / f"inputs/studies/{name}.toml", kind)
    assert 0 < study.count < 10_000
    if kind == "sensitivity":
        assert study.count == study.size * (len(study.parameters) + 2)
