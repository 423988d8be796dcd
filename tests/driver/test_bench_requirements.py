"""Requirements of the benchmarks: met or missed, and the exit code."""

from __future__ import annotations

import sys
from importlib import import_module
from typing import TYPE_CHECKING, Any

import pytest
from conftest import REPOSITORY

if TYPE_CHECKING:
    from collections.abc import Iterator


@pytest.fixture
def requirements(monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    """Yield the module, newly imported."""
    monkeypatch.syspath_prepend(REPOSITORY / "tests/bench")
    yield import_module("requirements")
    del sys.modules["requirements"]


@pytest.mark.parametrize(("load", "code"), [(1.0, 1), (2.0, 0)])
def test_missed_requirement_fails_on_an_idle_machine(
    requirements: Any,  # noqa: ANN401
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    load: float,
    code: int,
) -> None:
    monkeypatch.setattr("os.getloadavg", lambda: (load, 0.0, 0.0))
    assert requirements.assess("thud.solve, shell", ms=1.0) == "required: below 2 ms: met"
    assert requirements.conclude() == 0
    assert requirements.assess("thud.solve, shell", ms=3.0) == "required: below 2 ms: missed"
    assert requirements.conclude() == code
    assert "thud.solve, shell: below 2 ms, measured 3" in capsys.readouterr().out


def test_rows_of_one_name_have_the_requirement_of_their_competitor(
    requirements: Any,  # noqa: ANN401
) -> None:
    name = "levels, exact, five octaves"
    assert requirements.assess(name, "NumPy rfft, 1 s", times=1.0) == ""
    zoom = requirements.assess(name, "SciPy ZoomFFT, 64 lines per band", times=1.0)
    assert zoom == "required: at least 3 times: missed"
    # An ensemble has two limits; without a competitor only its rate counts.
    both = "ensemble, five levels and verdict"
    assert requirements.assess(both, rate=90_000.0) == "required: at least 80,000/s: met"
