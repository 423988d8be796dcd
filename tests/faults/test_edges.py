"""Some tries of the numbers at the edges; ./bootstrap faults makes all of them."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import TYPE_CHECKING

import pytest
from campaign import Report
from edge_laws import get_fault
from run import parts

import thud

if TYPE_CHECKING:
    from pathlib import Path


@pytest.mark.parametrize("name", ["many", "lumped", "modal", "elements"])
def test_no_wrong_number_without_a_word(name: str, tmp_path: Path) -> None:
    seed = time.time_ns()
    report = Report(seed)
    part = parts()[name]
    report.run(name, part, part.small, tmp_path, spread=True)
    assert report.faults == 0, f"seed {seed}\n{report}"
    assert report.counts[name].total() == part.small


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
def test_missing_remark_is_found() -> None:
    impact = thud.solve(thud.Ball(poisson_ratio=0.3))
    assert get_fault(impact) == ""
    assert get_fault(replace(impact, remarks=())) == "no remark on poisson_ratio"
