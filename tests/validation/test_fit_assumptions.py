"""Fits with a wrong assumption miss the truth in silence in few cases only."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))
from fit_assumptions import CASES, CLOCK, tally

FITS = 8


@pytest.mark.parametrize("name", [name for name in CASES if name not in CLOCK])
@pytest.mark.slow
def test_wrong_assumptions_do_not_miss_in_silence(name: str) -> None:
    found = tally(name, FITS)
    assert found.silent == 0, found


@pytest.mark.slow
def test_fits_that_trust_their_case_do() -> None:
    """With 5 % of noise, most of the fits with a wrong damping law do not warn."""
    found = tally("order 0.7", FITS, (0.05, 0.05), unknowns=())
    assert found.silent > FITS / 2, found
