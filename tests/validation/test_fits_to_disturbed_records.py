"""Fits to disturbed records, press curves and wrong assumptions hold the truth, or warn."""

from __future__ import annotations

import compression_disturbances as press
import fit_assumptions as assumptions
import fit_disturbances as disturbances
import numpy as np
import pytest
from fit_tally import Tally, tally

FITS = 12


@pytest.mark.parametrize("name", ["pink noise", "hum of 60 Hz, 3 N"])
@pytest.mark.slow
def test_intervals_of_disturbed_records_hold_the_truth(name: str) -> None:
    found = tally(disturbances.fits(name, FITS), disturbances.TRUTH)
    # Of twelve 90 % intervals fewer than seven hold the truth with a probability of 5e-4; where
    # white noise is assumed, two to five do in these disturbances.
    assert found.is_honest, found
    # It is the intervals that hold, not the warnings that save them.
    assert found.warned.sum() <= 2


@pytest.mark.parametrize("name", press.DISTURBANCES)
@pytest.mark.slow
def test_intervals_of_press_curves_hold_the_truth(name: str) -> None:
    found = tally(press.fits(name, FITS), press.TRUTH)
    # Of twelve 90 % intervals fewer than eight hold the truth with a probability of 4e-3.
    assert found.covered.sum() >= 8, found
    assert found.silent == 0, found
    assert found.warned.sum() <= 2


@pytest.mark.parametrize("name", [n for n in assumptions.CASES if n not in assumptions.CLOCK])
@pytest.mark.slow
def test_wrong_assumptions_do_not_miss_in_silence(name: str) -> None:
    assert tally(assumptions.fits(name, 8), assumptions.TRUTH).silent == 0


@pytest.mark.slow
def test_fits_that_trust_their_case_miss_in_silence() -> None:
    found = tally(press.fits("softening of 5 %", FITS, unknowns=()), press.TRUTH)
    assert found.silent >= FITS // 2
    # With 5 % of noise, most of the fits with a wrong damping law do not warn.
    trusting = assumptions.fits("order 0.7", 8, (0.05, 0.05), unknowns=())
    assert tally(trusting, assumptions.TRUTH).silent > 8 / 2


def test_intervals_that_miss_in_silence_are_not_honest() -> None:
    def is_honest(warned: int, hits: int, hits_in_silence: int) -> bool:
        is_warned, covered = np.arange(200) < warned, np.zeros((200, 1), bool)
        covered[np.flatnonzero(~is_warned)[:hits_in_silence]] = True
        covered[np.flatnonzero(is_warned)[: hits - hits_in_silence]] = True
        return Tally(is_warned, covered, np.zeros((200, 1)), np.ones((200, 1))).is_honest

    assert not is_honest(warned=0, hits=100, hits_in_silence=100)
    assert is_honest(warned=190, hits=100, hits_in_silence=9)
    assert is_honest(warned=200, hits=0, hits_in_silence=0)
