"""Drops of random recordings keep to the bounds that noise sets."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from scipy.stats import binom

sys.path.insert(0, str(Path(__file__).parent))
from recording_bounds import Result, columns, realise

if TYPE_CHECKING:
    from collections.abc import Callable

# 30 realisations: two of each colour and level of noise.
COUNT = 30


def test_random_recordings_keep_to_the_bounds(oracle: Callable[..., None]) -> None:
    drawn = [realise(seed) for seed in range(COUNT)]
    results = [result for _, result in drawn]
    assert all(isinstance(result, Result) for result in results), results
    late = [r.error[6] for d, r in drawn if d.noise >= 50 and isinstance(r, Result)]
    assert np.mean(np.abs(late) < 1e-4) >= 0.95, late
    ratio, pull = columns([r for r in results if isinstance(r, Result)])
    # The mean square of n ratios has a deviation of sqrt(2/n).
    ratio = np.sqrt(np.mean(ratio**2, axis=0))
    oracle("random recordings: errors over the bounds that noise sets", "statistics", ratio, 1.5)
    covered = np.sum(np.abs(pull) <= 1.96, axis=0)
    assert (covered >= binom.ppf(1e-3, COUNT, 0.95)).all(), covered
    assert (np.abs(pull) < 5).all(), pull
