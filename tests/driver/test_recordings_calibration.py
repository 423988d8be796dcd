"""Calibration from a known force behind an amplifier that droops, and from a tap on the plate."""

from __future__ import annotations

import math
import re
import tomllib
from typing import TYPE_CHECKING

import numpy as np
import pytest
from conftest import codes, naming, noted
from recording_files import noisy
from refusals.core import write
from scipy.signal import cont2discrete, lfilter

from thud import InputError, cli
from thud.recordings.calibration import calibrate
from thud.recordings.config import read_config
from thud.recordings.plate_tap import TappedPlate, calibrate_tap
from thud.recordings.signal import Signal

if TYPE_CHECKING:
    from thud.recordings.force_units import Calibration

pytestmark = pytest.mark.usefixtures("working_directory")
RATE = 1000.0
FORCE = 250.0


def high_pass(level: np.ndarray, time_constant: float) -> np.ndarray:
    """Return the exact response of a first-order high-pass to lines between the samples."""
    if math.isinf(time_constant):
        return level
    decay = math.exp(-1 / RATE / time_constant)
    gain = (1 - decay) * time_constant * RATE
    return np.asarray(lfilter([gain, -gain], [1, -decay], level))


def load(ends: list[float], ramp: float, duration: float) -> np.ndarray:
    """Return a weight, 1, that is put on and taken off from these times on within a ramp, s."""
    time = np.arange(0, duration, 1 / RATE)
    turns = [(-1) ** k * np.clip((time - end) / ramp, 0, 1) for k, end in enumerate(ends)]
    return np.asarray(sum(turns), dtype=np.float64)


def weighed(  # noqa: PLR0913 - what differs between records
    time_constant: float,
    seed: int,
    *,
    single: bool = False,
    rest: float = 5.0,
    ramp: float = 0.5,
    noise: float = 0.01,
) -> np.ndarray:
    """Return the record of a step of 1 V with offset, drift and noise."""
    ends = [5.0] if single else [5.0, 5.0 + rest]
    level = high_pass(load(ends, ramp, 5 + rest + 5 * (not single)), time_constant)
    rng = np.random.default_rng(seed)
    return level + rng.normal(0, noise, level.size) + 0.3 + 3e-6 * np.arange(level.size)


def calibrated(level: np.ndarray) -> tuple[Calibration, float, float]:
    """Return the calibration, its relative error for a step of 1 V, and its uncertainty."""
    found = calibrate(Signal.from_array(level, RATE), force=FORCE, unit="V")
    assert found.uncertainty is not None
    return found, float(found.chain.split()[0]) / FORCE - 1, found.uncertainty


@pytest.mark.parametrize(
    ("constant", "single", "ramp"),
    [(30.0, False, 0.1), (10.0, True, 1.0), (5.0, False, 0.1), (2.0, True, 1.0)],
)
def test_droop_of_the_amplifier_is_taken_off(constant: float, ramp: float, *, single: bool) -> None:
    found, error, uncertainty = calibrated(weighed(constant, 3, single=single, ramp=ramp))
    assert abs(error) < 3.5 * uncertainty < 0.014
    droop = noted(found.notes, "droop_removed")
    assert abs(droop.value / constant - 1) < 3.5 * float(droop.others["uncertainty"]) < 0.35
    assert droop.low < droop.value


@pytest.mark.parametrize("time_constant", [math.inf, 10.0, 2.0])
@pytest.mark.parametrize("single", [False, True])
def test_error_is_as_large_as_the_stated_uncertainty(time_constant: float, *, single: bool) -> None:
    """Of 40 normal errors 0 to 6 lie outside 95 %, with a probability of 99.6 %."""
    levels = [weighed(time_constant, seed, single=single, ramp=0.7) for seed in range(40)]
    found = [calibrated(level) for level in levels]
    assert sum(abs(error) > 1.96 * uncertainty for _, error, uncertainty in found) <= 6


TIME = np.arange(0, 15, 1 / RATE)


def pressed(end: float) -> np.ndarray:
    """Return a weight on which a hand presses while it is put on."""
    after = np.maximum(TIME - end, 0)
    return 1 - np.exp(-after / 0.15) + 0.4 * np.exp(-(((TIME - end - 0.3) / 0.15) ** 2))


STEADY, DROOPED = weighed(math.inf, 1), weighed(10.0, 1, noise=0.0) - 0.3
BEFORE = high_pass(load([1.0, 12.0], 0.3, 20.0), 8.0)[4000:]


@pytest.mark.parametrize(
    ("level", "limit"),
    [
        # Two levels of 7 s and one of 3.5 s: 0.0002 V without drift and droop.
        pytest.param(STEADY, 0.0015, id="no droop"),
        pytest.param(noisy(BEFORE, 0.003), 0.006, id="on before"),
        pytest.param(noisy(high_pass(pressed(5.0) - pressed(10.0), 5.0), 0.005), 0.003, id="hand"),
        pytest.param(STEADY + 0.05 * np.linspace(0, 1, TIME.size) ** 2, 0.001, id="drift"),
        # 10 and 30 s are hardly distinguished from 7.5 s, 1 % off.
        pytest.param(noisy(high_pass(DROOPED, 30.0), 0.01, 6), 0.02, id="two"),
    ],
)
def test_record_is_within_its_uncertainty(level: np.ndarray, limit: float) -> None:
    _, error, uncertainty = calibrated(level)
    assert abs(error) < 3.5 * uncertainty < 3.5 * limit


def shown_of(
    options: str, columns: str, level: np.ndarray, rate: float, capsys: pytest.CaptureFixture[str]
) -> tuple[str, str]:
    """Return what `calibrate` prints of a table, and its warnings."""
    rows = np.column_stack([np.arange(level.size) / rate, level])
    np.savetxt("record.csv", rows, "%.6f", ",", header=columns, comments="")
    assert cli.main(["calibrate", "record.csv", *options.split()]) == 0
    return capsys.readouterr()


@pytest.mark.parametrize(
    ("options", "origin", "lacking"),
    [
        ("--force 250 --uncertainty 1e-3", "250 N", None),
        ("--force 250", "250 N", "--uncertainty"),
        ("--mass 25.5 --uncertainty 1e-3", "g = 9.80665 m/s2", "--gravity"),
        ("--mass 25.5 --uncertainty 1e-3 --gravity 9.8", "g = 9.8 m/s2", None),
    ],
)
def test_command_prints_the_calibration_and_names_what_is_lacking(
    options: str, origin: str, lacking: str | None, capsys: pytest.CaptureFixture[str]
) -> None:
    out, err = shown_of(options, "Time [s],Force [V]", weighed(5.0, 1), RATE, capsys)
    lines = tomllib.loads(out)
    assert float(lines["calibration"].split()[0]) == pytest.approx(FORCE, rel=0.004)
    assert 1e-4 < lines["calibration_uncertainty"] < 0.004
    assert origin in out
    # The time constant, s.
    assert re.search(r"\b[45]\.\d+ s\b", out)
    assert (lacking in err) if lacking else not err


def test_gravity_of_a_mass_is_stated_or_counts_as_uncertainty() -> None:
    signal = Signal.from_array(weighed(math.inf, 1, noise=1e-4), RATE)
    stated = calibrate(signal, mass=10.0, gravity=9.798, unit="V")
    assert float(stated.chain.split()[0]) == pytest.approx(97.98, rel=1e-4)
    assert stated.origin.startswith("2 steps of 10 kg (g = 9.798 m/s2)")
    assert codes(stated.notes)[1:] == ["known_force_uncertain"]
    silent = calibrate(signal, mass=10.0, unit="V")
    assert float(silent.chain.split()[0]) == pytest.approx(98.0665, rel=1e-4)
    # From 9.780 m/s2 at the equator to 9.833 m/s2 at the poles: a rectangular distribution.
    spread = (9.833 - 9.780) / 2 / math.sqrt(3) / 9.80665
    assert stated.uncertainty is not None
    assert silent.uncertainty == pytest.approx(math.hypot(stated.uncertainty, spread))
    assert calibrate(signal, mass=10.0, gravity=9.8, unit="V", uncertainty=1e-3).notes[1:] == ()
    note = silent.notes[-1]
    assert (note.code, note.low, note.high) == ("gravity_assumed", 9.780, 9.833)


def test_coarse_record_that_rests_at_one_value_is_not_clipped() -> None:
    """The rest is the minimum of the record, exactly constant; the loaded level droops."""
    level = np.rint(1000 * high_pass(load([5.0], 0.3, 20.0), 30.0)) / 1000
    _, error, _ = calibrated(level)
    assert abs(error) < 0.005


def test_steps_in_one_direction_are_each_the_whole_force() -> None:
    level = sum(np.clip((TIME - begin) / 0.3, 0, 1) for begin in (4.0, 9.0))
    found, error, _ = calibrated(noisy(level, 0.01))
    assert abs(error) < 0.01
    assert codes(found.notes)[1:] == ["steps_in_one_direction", "known_force_uncertain"]
    assert found.notes[1].value == FORCE
    found, *_ = calibrated(STEADY)
    assert codes(found.notes) == ["no_droop", "known_force_uncertain"]
    assert 100 < found.notes[0].low < 1e5


def test_record_without_times_has_no_time_constant() -> None:
    np.savetxt("weight.csv", weighed(10.0, 1), header="Force [V]", comments="")
    found = calibrate("weight.csv", force=FORCE)
    assert float(found.chain.split()[0]) == pytest.approx(FORCE, rel=0.004)
    assert codes(found.notes) == ["known_force_uncertain"]


# --- taps


def tapped(  # noqa: PLR0913 - what differs between records
    modes: list[tuple[float, float, float]],
    seed: int,
    *,
    count: int = 1,
    duration: float = 1e-3,
    noise: float = 0.002,
    rate: float = 20_000.0,
    hum: float = 0.0,
    rebound: float = 0.0,
) -> Signal:
    """Return taps on a plate with modes: frequency, Hz, quality, share in the static response.

    After a rebound, s, the hammer hits the plate again, half as hard. The response to a force
    that is linear between the samples is exact.
    """
    rng = np.random.default_rng(seed)
    time = np.arange(0, 0.1 + 0.4 * count, 1 / rate)
    force = np.zeros(time.size)
    for k in range(count):
        begin = 0.1 + 0.4 * k + rng.uniform(0, 0.01)
        length, height = duration * rng.uniform(0.8, 1.2), rng.uniform(0.7, 1)
        for delay, factor in ((0.0, 1.0), (rebound, 0.5))[: 1 + (rebound > 0)]:
            phase = np.clip((time - begin - delay) / length, 0, 1)
            force += factor * height * np.sin(np.pi * phase) ** 1.5
    level = (1 - sum(share for *_, share in modes)) * force
    for frequency, quality, share in modes:
        omega = 2 * np.pi * frequency
        system = ([omega**2], [1, omega / quality, omega**2])
        numerator, denominator, _ = cont2discrete(system, 1 / rate, "foh")
        level += share * lfilter(numerator.ravel(), denominator, force)
    level += noise * rng.normal(size=time.size) + 0.1 + hum * np.sin(2 * np.pi * 50 * time)
    return Signal.from_array(level, rate)


def joined(*records: Signal) -> Signal:
    level = np.concatenate([record.read(0, record.n_sample) for record in records])
    return Signal.from_array(level, records[0].sample_rate)


def deviations(found: TappedPlate, frequency: float, quality: float) -> tuple[float, float]:
    """Return the errors of frequency and quality in standard uncertainties."""
    return (
        math.log(found.frequency / frequency) / found.frequency_uncertainty,
        math.log(found.quality / quality) / found.quality_uncertainty,
    )


@pytest.mark.parametrize(
    ("frequency", "quality", "count", "rate", "hum"),
    [
        (900.0, 10.0, 1, 10_000.0, 0.0),
        (900.0, 10.0, 1, 51_200.0, 0.02),
        (900.0, 10.0, 3, 10_000.0, 0.02),
        (1600.0, 60.0, 1, 10_000.0, 0.02),
        (1600.0, 60.0, 1, 51_200.0, 0.0),
        (1600.0, 60.0, 3, 10_000.0, 0.0),
    ],
)
def test_taps_show_the_resonance_of_the_plate(
    frequency: float, quality: float, count: int, rate: float, hum: float
) -> None:
    record = tapped([(frequency, quality, 1.0)], 1, count=count, rate=rate, hum=hum)
    found = calibrate_tap(record)
    assert found.count == count
    assert not found.others
    assert found.frequency_uncertainty < 2e-4
    assert found.quality_uncertainty < 0.01
    assert np.abs(deviations(found, frequency, quality)).max() < 4


@pytest.mark.parametrize("before", [0.003, 0.007])
def test_tap_at_the_begin_of_a_record_has_no_known_noise(before: float) -> None:
    """What rings after the tap is no noise before it, and some samples do not show the noise."""
    record = tapped([(1100.0, 30.0, 1.0)], 1)
    level = record.read(0, record.n_sample)
    begin = int(np.argmax(np.abs(level))) - round(before * record.sample_rate)
    found = calibrate_tap(Signal.from_array(level[begin:], record.sample_rate))
    # The fit begins 6 ms after the peak.
    assert 1.5 < found.quality_uncertainty / calibrate_tap(record).quality_uncertainty < 2
    assert np.abs(deviations(found, 1100, 30)).max() < 3


def test_errors_of_taps_are_as_large_as_stated() -> None:
    """Of 60 normal errors 0 to 8 lie outside 95 %, with a probability of 99.7 %."""
    errors = [
        deviations(calibrate_tap(tapped([(1100.0, 30.0, 1.0)], k, noise=0.01)), 1100, 30)
        for k in range(30)
    ]
    assert np.count_nonzero(np.abs(errors) > 1.96) <= 8


def test_taps_that_differ_count_by_their_scatter() -> None:
    found = calibrate_tap(joined(*(tapped([(f, 30.0, 1.0)], 1, count=2) for f in (1100.0, 1122.0))))
    assert found.count == 4
    assert found.frequency == pytest.approx(1111, rel=1e-3)
    # The standard deviation of the mean, 6.4 Hz, times 3.18/1.96 for four taps.
    assert found.frequency_uncertainty == pytest.approx(6.35 / 1111 * 3.18 / 1.96, rel=0.02)


@pytest.mark.parametrize("rebound", [0.008, 0.012, 0.025])
def test_tap_of_a_hammer_that_hits_twice_does_not_count(rebound: float) -> None:
    once = tapped([(1100.0, 25.0, 1.0)], 1, count=2)
    twice = tapped([(1100.0, 25.0, 1.0)], 2, rebound=rebound)
    found = calibrate_tap(joined(once, twice))
    assert (found.count, found.notes) == (2, ())
    assert np.abs(deviations(found, 1100, 25)).max() < 4
    assert found.frequency_uncertainty < 2e-4
    try:
        alone = calibrate_tap(twice)
    except InputError as error:
        assert re.search(naming("resonance", "known to"), str(error))
    else:
        assert codes(alone.notes) == ["tap_misfit"]
        assert np.abs(deviations(alone, 1100, 25)).max() < 3


@pytest.mark.parametrize(("second", "quality"), [(1120.0, 15.0), (1140.0, 20.0)])
def test_misfit_of_close_modes_counts_as_uncertainty(second: float, quality: float) -> None:
    """One resonance is fitted to two, of which it is the weighted mean."""
    modes = [(1100.0, quality, 0.6), (second, quality, 0.4)]
    found = calibrate_tap(tapped(modes, 1, noise=1e-4))
    assert np.abs(deviations(found, 660 + 0.4 * second, quality)).max() < 3
    assert found.quality_uncertainty > 0.01
    assert codes(found.notes) == ["tap_misfit"]


def test_clock_of_the_recorder_limits_the_frequency() -> None:
    found = calibrate_tap(tapped([(1100.0, 30.0, 1.0)], 1, count=3, noise=1e-6))
    assert found.frequency_uncertainty == pytest.approx(1e-4, rel=0.01)


def test_second_resonance_is_stated() -> None:
    found = calibrate_tap(tapped([(1100.0, 30.0, 0.7), (2300.0, 40.0, 0.3)], 1, duration=5e-4))
    assert np.abs(deviations(found, 1100, 30)).max() < 4
    assert found.others == pytest.approx([2300], rel=1e-3)


def test_command_prints_the_lines_of_the_plate(capsys: pytest.CaptureFixture[str]) -> None:
    record = tapped([(1100.0, 30.0, 1.0)], 1, count=2)
    level = record.read(0, record.n_sample)
    out, err = shown_of("--tap", "Time [s],Level", level, record.sample_rate, capsys)
    plate = read_config(write("lab.toml", out)).plate
    assert plate is not None
    assert plate.f0 == pytest.approx(1100, rel=1e-3)
    assert abs(plate.Q - 30) < 0.6
    assert plate.f0_uncertainty is not None
    assert 1e-6 < plate.f0_uncertainty < 1e-3
    assert "# 2 taps in" in out
    assert not err
