"""Whatever the numbers: a finite result or one clear sentence, never anything else.

Files are damaged by the campaign of faults (`tests/faults/test_faults.py`).
"""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings, strategies as st

import thud

ANY_NUMBER = st.one_of(
    st.floats(), st.floats(1e-3, 10.0),
    st.sampled_from([0.0, -1.0, 0.089, 1e6, 1e13, np.nan, np.inf, -np.inf]),
)  # fmt: skip
# Radius, wall, mass, modulus and Poisson's ratio, gauge pressure, height.
OF_BALLS = st.tuples(
    st.floats(0.03, 0.3), st.floats(0.001, 0.3), st.floats(0.01, 50.0), st.floats(1e4, 1e9),
    st.floats(-0.9, 0.5), st.floats(0, 3e5), st.floats(0.001, 30.0),
)  # fmt: skip


@given(
    numbers=st.one_of(OF_BALLS, st.tuples(*[ANY_NUMBER] * 7)),
    flux=st.sampled_from(["momentum_balance", "retarding", "conservative", "none"]),
)
@settings(max_examples=400, deadline=None)
def test_any_numbers(numbers: tuple[float, ...], flux: str) -> None:
    *ball, height = numbers
    try:
        impact = thud.solve(
            thud.Ball(*ball), thud.Drop(height), "hollow_sphere", momentum_flux=flux
        )
    except thud.ThudError as error:
        assert str(error)
        assert "\n" not in str(error)
        return
    assert np.isfinite(impact.floor_force).all()
    assert 0 < impact.contact_time < 0.05
    assert impact.peak_force > 0
    assert impact.impulse_residual <= 1e-6
    assert 0 < impact.restitution <= 1 + 1e-6
    assert np.isfinite(impact.levels(force="floor")).all()


@given(
    force=st.lists(st.floats(), max_size=50),
    sample_rate=st.floats(),
    bands=st.sampled_from(["octave", "third"]),
    method=st.sampled_from(["exact", "fft"]),
)
@settings(max_examples=200, deadline=None)
def test_any_record(force: list[float], sample_rate: float, bands: str, method: str) -> None:
    try:
        levels = thud.force_exposure_levels(force, sample_rate, bands, method)
    except thud.InputError as error:
        assert str(error)
    else:
        assert np.isfinite(levels).all()
