"""The statistical level against modal rooms: where modes are many, both are the same."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

sys.path.insert(0, str(Path(__file__).parent))
from modal_rooms import HALLS, draw_differences, energy_mean

if TYPE_CHECKING:
    from collections.abc import Callable


def test_modal_and_statistical_levels_agree_in_halls(oracle: Callable[..., None]) -> None:
    """From 100 Hz on a third of a hall holds dozens of modes, above the critical frequency.

    Over the whole of floors and rooms the energy means agree to three standard errors; of thirty
    floors they are 0.4 to 0.5 dB in each third.
    """
    found, expected = draw_differences(HALLS, 12, (2, 4), 0.0)
    # The thirds as one: the error of their mean is the smaller.
    mean, error = energy_mean(found[..., 3:].reshape(len(found), -1, 1))
    assert error < 0.7
    oracle(
        "level in halls by modes, in standard errors of the mean", "other model", mean / error, 3
    )
    # Single positions scatter at least as the theory of the variance says.
    assert (found[..., 3:].std(axis=(0, 1)) > expected[3:]).all()
