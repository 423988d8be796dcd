"""The vector fit against that of scikit-rf: poles of exact values, errors of noisy ones."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

import thud

if TYPE_CHECKING:
    from collections.abc import Callable

skrf = pytest.importorskip("skrf", reason="scikit-rf is the independent vector fit")

FREQUENCY = np.geomspace(10, 1600, 250)


def modal_mobility(seed: int) -> np.ndarray:
    """Return the mobility of a floor with six modes of random mass, frequency and damping."""
    random = np.random.default_rng(seed)
    s = 2j * np.pi * FREQUENCY
    omega = 2 * np.pi * 12 * 80 ** ((np.arange(6) + random.uniform(0.2, 0.8, 6)) / 6)
    zeta, mass = random.uniform(0.01, 0.05, 6), random.uniform(100, 500, 6)
    modes = s[:, None] / mass / (s[:, None] ** 2 + 2 * zeta * omega * s[:, None] + omega**2)
    return np.asarray(2e-6 + modes.sum(axis=1))


def fit_by_scikit_rf(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return poles, 1/s, and the fit at the lines."""
    # A network of one port, whose parameter is the mobility over its largest value.
    scale = abs(values).max()
    network = skrf.Network(
        frequency=skrf.Frequency.from_f(FREQUENCY, unit="Hz"), s=values[:, None, None] / scale
    )
    fit = skrf.VectorFitting(network)
    fit.vector_fit(n_poles_real=0, n_poles_cmplx=6, init_pole_spacing="log", fit_constant=True)
    return fit.poles, scale * fit.get_model_response(0, 0, FREQUENCY)


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("seed", [1, 2])
def test_poles_of_exact_values_are_those_of_scikit_rf(
    seed: int, oracle: Callable[..., None]
) -> None:
    values = modal_mobility(seed)
    floor = thud.fit_mobility(thud.Mobility(FREQUENCY, values), order=12).floor
    poles, _ = fit_by_scikit_rf(values)
    expected = np.sort(abs(poles)) / (2 * np.pi)
    oracle(
        "fit of a mobility: poles by scikit-rf",
        "independent code",
        np.sort(floor.pole_frequency) / expected - 1,
        1e-6,
    )


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("seed", [4, 5])
def test_noisy_values_are_fitted_as_well_as_by_scikit_rf(seed: int) -> None:
    exact = modal_mobility(seed)
    random = np.random.default_rng(seed)
    values = exact * (1 + 0.03 * random.normal(size=(250, 2)).dot([1, 1j]))
    found = thud.fit_mobility(thud.Mobility(FREQUENCY, values), order=12)
    _, other = fit_by_scikit_rf(values)
    # Each has the error that it makes least: relative here, absolute there.
    absolute = [np.linalg.norm(fit - values) for fit in (found.fitted.values, other)]
    relative = [np.linalg.norm(fit / values - 1) for fit in (found.fitted.values, other)]
    assert relative[0] < 1.01 * relative[1]
    # The weights of one leave the peaks less exact than the other, inside the noise.
    assert absolute[0] < 1.5 * absolute[1]
    everywhere = thud.mobility(found.floor, np.geomspace(0.1, 1e6, 5000))
    assert everywhere.values.real.min() >= 0
