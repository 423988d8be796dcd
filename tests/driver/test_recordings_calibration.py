"""Calibration from a known force behind an amplifier that droops, and from a tap on the plate."""

from __future__ import annotations

import math
import re
import tomllib
from typing import TYPE_CHECKING

import numpy as np
import pytest
from conftest import naming
from scipy.signal import lfilter

from thud import InputError, cli
from thud.recordings.calibration import calibrate
from thud.recordings.signal import Signal

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from thud.recordings.force_units import Calibration

RATE = 1000.0
FORCE = 250.0


def high_pass(level: NDArray[np.float64], time_constant: float) -> NDArray[np.float64]:
    """Return the exact response of a first-order high-pass to lines between the samples."""
    if math.isinf(time_constant):
        return level
    decay = math.exp(-1 / RATE / time_constant)
    gain = (1 - decay) * time_constant * RATE
    return np.asarray(lfilter([gain, -gain], [1, -decay], level))


def load(ends: list[float], ramp: float, duration: float) -> NDArray[np.float64]:
    """Return a weight, 1, that is put on and taken off from these times on within a ramp, s."""
    time = np.arange(0, duration, 1 / RATE)
    turns = [(-1) ** k * np.clip((time - end) / ramp, 0, 1) for k, end in enumerate(ends)]
    return np.asarray(sum(turns), dtype=np.float64)


def recorded(  # noqa: PLR0913 - what differs between records
    time_constant: float,
    seed: int,
    *,
    single: bool = False,
    rest: float = 5.0,
    ramp: float = 0.5,
    noise: float = 0.01,
) -> NDArray[np.float64]:
    """Return the record of a step of 1 V with offset, drift and noise."""
    ends = [5.0] if single else [5.0, 5.0 + rest]
    level = high_pass(load(ends, ramp, 5 + rest + 5 * (not single)), time_constant)
    rng = np.random.default_rng(seed)
    return level + rng.normal(0, noise, level.size) + 0.3 + 3e-6 * np.arange(level.size)


def calibrated(level: NDArray[np.float64], **stated: float) -> tuple[Calibration, float]:
    """Return the calibration, and its relative error for a step of 1 V."""
    found = calibrate(Signal.from_array(level, RATE), force=FORCE, unit="V", **stated)
    return found, float(found.chain.split()[0]) / FORCE - 1


@pytest.mark.parametrize("single", [False, True])
@pytest.mark.parametrize("ramp", [0.1, 1.0])
@pytest.mark.parametrize("time_constant", [30.0, 10.0, 5.0, 2.0])
def test_droop_of_the_amplifier_is_taken_off(
    time_constant: float, ramp: float, *, single: bool
) -> None:
    found, error = calibrated(recorded(time_constant, 3, single=single, ramp=ramp))
    assert found.uncertainty is not None
    assert found.uncertainty < 0.004
    assert abs(error) < 3.5 * found.uncertainty
    droop = found.time_constant
    assert droop is not None
    assert droop.uncertainty < 0.1
    assert abs(droop.value / time_constant - 1) < 3.5 * droop.uncertainty
    assert droop.minimum < droop.value
    assert "droop with a time constant of" in str(droop)


def test_record_without_droop_remains_exact() -> None:
    found, error = calibrated(recorded(math.inf, 1))
    assert found.uncertainty is not None
    assert abs(error) < 3.5 * found.uncertainty
    # Two levels of 7 s and one of 3.5 s, 0.01 V of noise: 0.0002 V without drift and droop.
    assert found.uncertainty < 0.0015
    assert found.time_constant is not None
    assert math.isinf(found.time_constant.value)
    assert 100 < found.time_constant.minimum < 1e5
    assert str(found.time_constant).startswith("no droop: a time constant above ")


@pytest.mark.parametrize("time_constant", [math.inf, 10.0, 2.0])
@pytest.mark.parametrize("single", [False, True])
def test_error_is_as_large_as_the_stated_uncertainty(time_constant: float, *, single: bool) -> None:
    """Of 40 normal errors 0 to 6 lie outside 95 %, with a probability of 99.6 %."""
    outside = 0
    for seed in range(40):
        found, error = calibrated(recorded(time_constant, seed, single=single, ramp=0.7))
        assert found.uncertainty is not None
        outside += abs(error) > 1.96 * found.uncertainty
    assert outside <= 6


def test_weight_that_was_on_before_the_record_is_taken_off() -> None:
    level = high_pass(load([1.0, 12.0], 0.3, 20.0), 8.0)[4000:]
    level += np.random.default_rng(1).normal(0, 0.003, level.size)
    found, error = calibrated(level)
    assert found.uncertainty is not None
    assert found.origin.startswith("1 step")
    assert abs(error) < 3.5 * found.uncertainty < 0.02


def test_hand_that_presses_the_weight_does_not_count() -> None:
    time = np.arange(0, 15, 1 / RATE)
    steps = [
        (time > end) * (1 - np.exp(-np.maximum(time - end, 0) / 0.15))
        + 0.4 * np.exp(-(((time - end - 0.3) / 0.15) ** 2))
        for end in (5.0, 10.0)
    ]
    level = high_pass(steps[0] - steps[1], 5.0)
    found, error = calibrated(level + np.random.default_rng(1).normal(0, 0.005, time.size))
    assert found.uncertainty is not None
    assert abs(error) < 3.5 * found.uncertainty < 0.01


def test_time_constant_may_be_stated() -> None:
    level = recorded(10.0, 2, single=True)
    fitted, _ = calibrated(level)
    exact, error = calibrated(level, time_constant=10.0)
    vague, other = calibrated(level, time_constant=10.3, time_constant_uncertainty=0.03)
    assert exact.uncertainty is not None
    assert vague.uncertainty is not None
    assert fitted.uncertainty is not None
    assert exact.uncertainty <= vague.uncertainty <= 1.01 * fitted.uncertainty
    assert abs(error) < 3.5 * exact.uncertainty
    assert abs(other) < 3.5 * vague.uncertainty
    assert exact.time_constant is not None
    assert exact.time_constant.value == pytest.approx(10.0)
    assert "uncertainty" not in str(exact.time_constant)
    with pytest.raises(InputError, match=naming("exponential")):
        calibrated(recorded(10.0, 2), time_constant=15.0)
    with pytest.raises(InputError, match=naming("exponential")):
        calibrated(recorded(5.0, 2), time_constant=math.inf)


@pytest.mark.parametrize(
    ("stated", "words"),
    [
        ({"time_constant": 0.0}, naming("time_constant", "0 s")),
        ({"time_constant": math.nan}, naming("time_constant", "nan")),
        (
            {"time_constant": 5.0, "time_constant_uncertainty": 0.6},
            naming("time_constant", "0.6"),
        ),
        (
            {"time_constant": 5.0, "time_constant_uncertainty": math.inf},
            naming("time_constant_uncertainty", "inf"),
        ),
    ],
)
def test_impossible_time_constants(stated: dict[str, float], words: str) -> None:
    with pytest.raises(InputError, match=words):
        calibrated(recorded(10.0, 2), **stated)


@pytest.mark.parametrize("second", [20.0, 5.0, 1.0])
def test_two_time_constants_are_refused(second: float) -> None:
    level = high_pass(recorded(10.0, 1, noise=0.0) - 0.3, second)
    level += np.random.default_rng(1).normal(0, 0.01, level.size)
    with pytest.raises(InputError, match=naming("exponential")):
        calibrated(level)


def test_slow_second_time_constant_counts_as_uncertainty() -> None:
    """Seconds of 10 and 30 s are hardly distinguished from one of 7.5 s, 1 % off."""
    level = high_pass(recorded(10.0, 4, noise=0.0) - 0.3, 30.0)
    found, error = calibrated(level + np.random.default_rng(6).normal(0, 0.01, level.size))
    assert found.uncertainty is not None
    assert abs(error) < 2 * found.uncertainty
    assert found.uncertainty > 0.003


def test_creep_is_refused() -> None:
    time = np.arange(0, 15, 1 / RATE)
    creep = [np.log1p(np.maximum(time - end, 0) / 0.5) for end in (5.0, 10.0)]
    with pytest.raises(InputError, match=naming("exponential")):
        calibrated(recorded(math.inf, 1)[: time.size] + 0.01 * (creep[0] - creep[1]))


def test_change_of_the_drift_is_fitted_and_counts_as_uncertainty() -> None:
    level = recorded(math.inf, 1)
    still, _ = calibrated(level)
    moving, error = calibrated(level + 0.05 * np.linspace(0, 1, level.size) ** 2)
    assert still.uncertainty is not None
    assert moving.uncertainty is not None
    assert abs(error) < 3.5 * still.uncertainty
    assert moving.uncertainty > 2 * still.uncertainty


def test_fast_droop_is_refused() -> None:
    with pytest.raises(InputError, match=naming("recording", "decays")):
        calibrated(recorded(1.0, 1))


def test_command_states_the_time_constant(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    level = recorded(5.0, 1)
    rows = "\n".join(f"{k / RATE:.3f},{one:.6f}" for k, one in enumerate(level))
    (tmp_path / "weight.csv").write_text(f"Time [s],Force [V]\n{rows}\n")
    arguments = ["calibrate", str(tmp_path / "weight.csv"), "--force", "250"]
    assert cli.main([*arguments, "--uncertainty", "0.001"]) == 0
    shown = capsys.readouterr()
    lines = tomllib.loads(shown.out)
    assert float(lines["calibration"].split()[0]) == pytest.approx(FORCE, rel=0.004)
    assert re.search(r"# droop with a time constant of [45]\.\d+ s, standard", shown.out)
    assert not shown.err
    assert cli.main([*arguments, "--time-constant", "5"]) == 0
    shown = capsys.readouterr()
    assert "time constant of 5 s, taken off" in shown.out
    assert "--time-constant-uncertainty" in shown.err
    assert "(--uncertainty)" in shown.err


def test_time_constant_needs_a_time_scale(tmp_path: Path) -> None:
    np.savetxt(tmp_path / "weight.csv", recorded(10.0, 1), header="Force [V]", comments="")
    found = calibrate(tmp_path / "weight.csv", force=FORCE)
    assert float(found.chain.split()[0]) == pytest.approx(FORCE, rel=0.004)
    assert found.time_constant is None
    with pytest.raises(InputError, match=naming("weight.csv", "sample rate")):
        calibrate(tmp_path / "weight.csv", force=FORCE, time_constant=10.0)
