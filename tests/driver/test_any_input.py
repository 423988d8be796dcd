"""Whatever the input: a finite result or one clear sentence, never anything else."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
import pytest
from conftest import REPOSITORY, naming
from hypothesis import HealthCheck, given, settings, strategies as st

import thud
from thud.recordings.table import read_table
from thud.studies.fitting.force_record import read_record, time_and_force

FLAGSHIP = (REPOSITORY / "inputs/rubber_ball_100cm.nml").read_text()

ANY_NUMBER = st.one_of(
    st.floats(),
    st.floats(1e-3, 10.0),
    st.sampled_from([0.0, -1.0, 0.089, 1e6, 1e13, np.nan, np.inf, -np.inf]),
)


def check_sentence(error: thud.ThudError) -> None:
    sentence = str(error)
    assert sentence
    assert "\n" not in sentence


@given(
    ball=st.builds(thud.Ball, *[ANY_NUMBER] * 8),
    drop=st.builds(thud.Drop, ANY_NUMBER, ANY_NUMBER),
    flux=st.sampled_from(["momentum_balance", "retarding", "conservative", "none"]),
)
@settings(max_examples=300, deadline=None)
def test_any_numbers(ball: thud.Ball, drop: thud.Drop, flux: str) -> None:
    check_drop(ball, drop, flux)


@given(
    ball=st.builds(
        thud.Ball,
        outer_radius=st.floats(0.03, 0.3),
        wall_thickness=st.floats(0.001, 0.3),
        mass=st.floats(0.01, 50.0),
        youngs_modulus=st.floats(1e4, 1e9),
        poisson_ratio=st.floats(-0.9, 0.5),
        gauge_pressure=st.floats(0, 3e5),
    ),
    drop=st.builds(thud.Drop, height=st.floats(0.001, 30.0)),
    flux=st.sampled_from(["momentum_balance", "retarding", "conservative", "none"]),
)
@settings(max_examples=300, deadline=None)
def test_numbers_of_balls(ball: thud.Ball, drop: thud.Drop, flux: str) -> None:
    check_drop(ball, drop, flux)


def check_drop(ball: thud.Ball, drop: thud.Drop, flux: str) -> None:
    try:
        impact = thud.solve(ball, drop, momentum_flux=flux)
    except thud.ThudError as error:
        check_sentence(error)
        return
    assert np.isfinite(impact.floor_force).all()
    assert 0 < impact.contact_time < 0.05
    assert impact.peak_force > 0
    assert impact.impulse_residual <= 1e-6
    assert 0 < impact.restitution <= 1 + 1e-6
    assert np.isfinite(impact.levels(force="floor")).all()


@given(
    start=st.integers(0, len(FLAGSHIP)),
    length=st.integers(0, 30),
    insertion=st.text(
        st.characters(codec="utf-8", categories=["L", "N", "P", "S", "Z", "Cc"]), max_size=12
    ),
)
@settings(
    max_examples=400, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
def test_any_damage_to_a_file(start: int, length: int, insertion: str) -> None:
    text = FLAGSHIP[:start] + insertion + FLAGSHIP[start + length :]
    with tempfile.TemporaryDirectory() as directory:
        path = Path(directory) / "case.nml"
        path.write_bytes(text.encode())
        try:
            case = thud.read_case(path)
        except thud.InputError as error:
            check_sentence(error)
            assert str(path) in str(error)
        else:
            assert isinstance(case, thud.Case)


@given(
    head=st.text(max_size=20),
    rows=st.lists(st.tuples(st.floats(), st.floats()), max_size=20),
    separator=st.sampled_from([",", ";", "\t", " ", "|"]),
    even=st.booleans(),
)
@settings(max_examples=300, deadline=None)
def test_any_table_of_a_record(
    head: str, rows: list[tuple[float, float]], separator: str, *, even: bool
) -> None:
    times = [i / 44100 if even else time for i, (time, _) in enumerate(rows)]
    lines = [f"{time}{separator}{force}" for time, (_, force) in zip(times, rows, strict=True)]
    with tempfile.TemporaryDirectory() as directory:
        path = Path(directory) / "plate.csv"
        path.write_text("\n".join([head, *lines]), encoding="utf-8")
        try:
            record = read_record(time_and_force(read_table(path)), str(path))
        except thud.InputError as error:
            check_sentence(error)
            assert str(path) in str(error)
        else:
            assert np.isfinite(record.time).all()
            assert 0 < record.sample_rate < np.inf
            assert record.force.max() > 0


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


def test_motion_beyond_all_numbers_has_no_infinity_in_its_sentence() -> None:
    with pytest.raises(thud.NumericalError, match=naming("&sampling: substeps")) as said:
        thud.solve(
            drop=thud.Drop(height=1e6, gravity=1000.0),
            model="hunt_crossley",
            stiffness=1e15,
            exponent=5.0,
            restitution=0.5,
        )
    assert "Infinity" not in str(said.value)
