"""One peak under a soft spring and two under a stiff one (Hirakawa and Lee 2016).

Inter-Noise 2016, pp. 682-691, from the abstract: the rubber ball on a steel plate on resilient
material on a force plate gave a force with one peak on springs of low stiffness and with two on
those of high stiffness. Mass and stiffness are not in the abstract; 20 kg and the natural
frequencies below are chosen here, the loss factor 0.2 of a usual resilient layer.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import pytest
from scipy.signal import butter, find_peaks, sosfiltfilt

import thud

if TYPE_CHECKING:
    from collections.abc import Callable

    import numpy as np
    from numpy.typing import NDArray

MASS = 20.0
LOSS_FACTOR = 0.2
# Of the maximum, in content that a force plate records: others it does not tell from its noise.
PROMINENCE = 0.05
BAND = 1000.0


def count_peaks(force: NDArray[np.float64], rate: float) -> int:
    """Return the number of peaks that stand out below the resonances of a force plate."""
    recorded = sosfiltfilt(butter(4, BAND, fs=rate, output="sos"), force)
    return len(find_peaks(recorded, prominence=PROMINENCE * recorded.max())[0])


@pytest.mark.parametrize(
    ("frequency", "peaks"), [(30, 1), (60, 1), (80, 1), (120, 2), (150, 2), (200, 2)]
)
def test_force_under_a_spring_has_one_peak_if_soft_and_two_if_stiff(
    frequency: float, peaks: int, oracle: Callable[..., None]
) -> None:
    omega = 2 * math.pi * frequency
    spring = thud.Oscillator(
        mass=MASS, stiffness=MASS * omega**2, damping=LOSS_FACTOR * MASS * omega
    )
    impact = thud.solve(model="modal_ball", floor=spring).on_floor
    assert impact is not None
    touching = impact.time < impact.contact_time
    under = spring.stiffness * impact.floor_displacement + spring.damping * impact.floor_velocity
    oracle(
        "peaks of the force under springs, soft one and stiff two (Hirakawa and Lee)",
        "published measurement",
        count_peaks(under[touching], impact.sample_rate) - peaks,
        0,
    )
    # The force of the ball itself has one: a mass of eight balls gives way too little.
    assert count_peaks(impact.floor_force, impact.sample_rate) == 1
