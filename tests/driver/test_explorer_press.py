"""The curve of a press on the page: the fitted modulus."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import thud
from thud.explorer.fits import fit_press

if TYPE_CHECKING:
    from pathlib import Path

TRUE_RATIO = 1.1
BALL = thud.Case().resolved()


@pytest.fixture(scope="module")
def curve() -> tuple[np.ndarray, np.ndarray]:
    """Return deflection, mm, and force, N, of a press, with noise of 1 N."""
    exact = thud.compress(BALL.ball, BALL.model or "modal_ball", max_deflection=0.03, points=61)
    noise = np.random.default_rng(1).normal(size=exact.force.size)
    return 1e3 * exact.deflection, TRUE_RATIO * exact.force + noise


@pytest.fixture
def fitted(tmp_path: Path, working_directory: None) -> Any:  # noqa: ANN401, ARG001 - the fit changes to the folder of its file
    """Return a function that returns the answer of a fit to columns with titles."""

    def fit(titles: str, *columns: np.ndarray) -> dict[str, Any]:
        path = tmp_path / "press 1.csv"
        rows = np.column_stack(columns)
        np.savetxt(path, rows, "%.6g", ",", header=titles, comments="", encoding="utf-8")
        return fit_press([str(path)], {"model": {"name": "modal_ball"}})

    return fit


@pytest.mark.parametrize(
    ("titles", "scales"),
    [
        ('"Deflection, mm","Force, N"', (1.0, 1.0)),
        ("deflection_m,force_N", (1e-3, 1.0)),
        ("Weg [mm],Standardkraft [kN]", (1.0, 1e-3)),
    ],
)
def test_modulus_is_that_of_the_curve(
    fitted: Any,  # noqa: ANN401
    curve: tuple[np.ndarray, np.ndarray],
    titles: str,
    scales: tuple[float, float],
) -> None:
    answer = fitted(titles, *(scale * one for scale, one in zip(scales, curve, strict=True)))
    modulus = answer["values"]["ball"]["youngs_modulus"]
    assert modulus == pytest.approx(TRUE_RATIO * BALL.ball.youngs_modulus, rel=0.02)
    ((key, low, high),) = answer["intervals"]
    assert key == "ball.youngs_modulus"
    assert low < modulus < high
    assert answer["file"] == "press 1.csv"
    assert answer["is_explained"]


def test_only_the_loading_branch_is_fitted_and_what_it_does_not_explain_is_said(
    fitted: Any,  # noqa: ANN401
    curve: tuple[np.ndarray, np.ndarray],
) -> None:
    titles, (deflection, force) = "deflection (mm),force (N)", curve
    both = [np.concatenate([x, x[-2::-1]]) for x in curve]
    expected = fitted(titles, *curve)["values"]
    assert fitted(titles, *both)["values"] == expected
    answer = fitted(titles, deflection, force**2 / 400)
    assert not answer["is_explained"]
    assert answer["residual"][1] > 0.05
