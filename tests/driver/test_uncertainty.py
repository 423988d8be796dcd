"""Monte Carlo against linear propagation, and exact probabilities."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from conftest import REPOSITORY

import thud

if TYPE_CHECKING:
    from thud.studies.uncertainty import Uncertainty

SIZE = 600
SMALL: dict[str, Any] = {
    "fixed": {"model": "hollow_sphere"},
    "design": {"size": SIZE, "seed": 11},
    "temperature": {"reference": 20, "coefficient": -0.01},
    "parameters": {
        "wall_thickness": {"std": 0.05, "unit": "mm"},
        "mass": {"low": 2.49, "high": 2.51},
        "temperature": {"mean": 20, "std": 0.2},
    },
}


@pytest.fixture(scope="module")
def small() -> Uncertainty:
    """Return the result of small tolerances."""
    return thud.uncertainty(SMALL)


def test_small_tolerances_propagate_linearly(small: Uncertainty, shell: thud.Impact) -> None:
    standard = shell.case.resolved().ball
    # By parameter: its standard deviation, and that of the temperature for the modulus.
    spread = {
        "wall_thickness": 5e-5,
        "mass": 0.02 / np.sqrt(12),
        "youngs_modulus": 0.2 * 0.01 * standard.youngs_modulus,
    }
    variance = np.zeros(5)
    for name, deviation in spread.items():
        above, below = (
            thud.solve(thud.Ball(**{name: getattr(standard, name) + change}), model="hollow_sphere")
            for change in (deviation, -deviation)
        )
        variance += ((above.levels() - below.levels()) / 2) ** 2
    # The deviation of n samples errs by 1 / sqrt(2 n); four of these.
    chance = 4 / np.sqrt(2 * SIZE)
    np.testing.assert_allclose(small.levels.std(axis=0, ddof=1), np.sqrt(variance), rtol=chance)
    error = np.sqrt(variance / SIZE)
    assert np.all(np.abs(small.levels.mean(axis=0) - shell.levels()) < 4 * error)


@pytest.mark.slow
def test_probability_of_a_criterion_that_is_known() -> None:
    # This ball has 0.2 dB to spare; the height conforms from 0.99 to 1.01 m.
    result = thud.uncertainty({
        "case": str(REPOSITORY / "inputs/rubber_ball_modal.nml"),
        "fixed": {"loss_factor": 0.2, "wall_thickness": 0.0306, "youngs_modulus": 1.8e6},
        "design": {"size": 100, "seed": 5},
        "parameters": {"height": {"low": 98, "high": 102, "unit": "cm"}},
    })  # fmt: skip
    height = result.dataset["height"].values
    assert result.conforming == np.sum((height >= 0.99) & (height <= 1.01))
    low, high = result.interval
    assert low < 0.5 < high


def test_figure_shows_distribution_over_tolerance(small: Uncertainty, shell: thud.Impact) -> None:
    figure = small.plot()
    (axes,) = figure.axes
    limits = shell.assess().criteria[:5]
    boxes = [body.get_datalim(axes.transData).intervaly for body in axes.collections[:5]]
    half = [(c.upper - c.lower) / 2 for c in limits]
    np.testing.assert_allclose(boxes, [(-h, h) for h in half])
    medians = axes.lines[0].get_ydata()
    nominal = [(c.upper + c.lower) / 2 for c in limits]
    np.testing.assert_allclose(medians, np.median(small.levels, axis=0) - nominal)
    title = figure.legends[0].get_title().get_text()
    for share in (small.probability, *small.interval):
        assert f"{100 * share:.1f} " in title


@pytest.mark.parametrize(("force", "label"), [("elastic", "elastic force"), ("floor", "floor")])
def test_figure_names_the_assessed_force(force: str, label: str) -> None:
    fixed = {"model": "hollow_sphere", "force": force}
    result = thud.uncertainty({**SMALL, "fixed": fixed, "design": {"size": 4}})
    assert result.dataset.attrs["assessed_force"] == force
    assert label in result.plot().axes[0].get_ylabel()


def test_fixed_values_are_the_middle_of_normal_distributions() -> None:
    study = {
        "design": {"size": 4},
        "fixed": {"density": 1148, "model": "hollow_sphere"},
        "parameters": {"density": {"std": 1}},
    }
    density = thud.uncertainty(study).dataset["density"].values
    assert abs(density - 1148).max() < 6
    fixed = {"model": "measured_modes", "frequency": [24, 89]}
    fixed |= {"damping_ratio": [0.05, 0.05], "effective_mass": [2.4, 0.1]}
    study |= {"fixed": fixed, "parameters": {"frequency(2)": {"std": 0.1}}}
    assert thud.read_study(study, "uncertainty").parameters[0].mean == 89
