"""Drops of random recordings keep to the bounds that noise sets."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from scipy.stats import binom

sys.path.insert(0, str(Path(__file__).parent))
from recording_bounds import Result, columns, realise

# 60 realisations: four of each colour and level of noise.
COUNT = 60


def test_random_recordings_keep_to_the_bounds() -> None:
    results = [result for _, result in map(realise, range(COUNT))]
    assert all(isinstance(result, Result) for result in results), results
    error, stated, bound = columns([r for r in results if isinstance(r, Result)])
    # Levels and restitution; the mean square of n ratios has a deviation of sqrt(2/n).
    ratio = np.mean((error / bound)[:, :6] ** 2, axis=0)
    assert (np.sqrt(ratio) < 1.5).all(), np.sqrt(ratio)
    covered = np.sum(np.abs(error) <= 1.96 * stated, axis=0)[:7]
    assert (covered >= binom.ppf(1e-3, COUNT, 0.9)).all(), covered
    assert (np.abs(error / stated)[:, :7] < 6).all()
