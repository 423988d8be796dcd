"""The laws that numbers at the edges obey: what breaks them is found."""

from __future__ import annotations

from dataclasses import replace

import pytest
from edge_laws import get_fault

import thud


@pytest.mark.filterwarnings("ignore::thud.PlausibilityWarning")
@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"restitution": 1.01}, "restitution"),
        ({"impulse": 20.0}, "impulse is the change of momentum"),
        ({"energy_residual": 1e-5}, "balances close"),
        ({"peak_force": 1.0}, "no sample exceeds the peak"),
        ({"contact_time": 0.0}, "contact lasts"),
    ],
)
def test_broken_laws_are_found(values: dict[str, float], words: str) -> None:
    impact = thud.solve()
    assert get_fault(impact) == ""
    assert words in get_fault(replace(impact, **values))


@pytest.mark.filterwarnings("ignore::thud.PlausibilityWarning")
def test_missing_warning_is_found() -> None:
    impact = thud.solve(thud.Ball(poisson_ratio=0.3))
    assert get_fault(impact) == ""
    assert get_fault(replace(impact, notes=())) == "no warning on poisson_ratio"
