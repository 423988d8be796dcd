"""Fits to measured drops of a recording."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from conftest import REPOSITORY, SHELL
from synthetic import make_recording, with_force

import thud
from thud.recordings.recording import Recording, read_recording
from thud.recordings.signal import Signal
from thud.studies.fit import read_fit_study, run_fit
from thud.studies.fitting.force_target import ForceTarget

if TYPE_CHECKING:
    from pathlib import Path

soundfile = pytest.importorskip("soundfile", reason="the extra recordings is not installed")

NOISE_DB = 50.0
# A miss by four standard errors has a probability of 6e-5.
FAR = 4.0
COARSE = thud.FiniteElement(
    radial_elements=4, polar_elements=32, viscosity="kelvin_voigt", loss_factor=0.2
)
CASE = thud.Case(ball=thud.Ball(youngs_modulus=2.08e6), model=COARSE)
STUDY = """
case.model.name = "hollow_sphere"
target = {{ file = "{file}"{more} }}
parameters.youngs_modulus = {{ start = 1.4, unit = "MPa" }}
"""


def pulse(impact: thud.Impact) -> np.ndarray:
    """Return the force of the contact, N."""
    return impact.floor_force[: round(1.02 * impact.contact_time * impact.sample_rate)]


def write(path: Path, *impacts: thud.Impact, **faults: object) -> float:
    """Write a recording of impacts, each 2 s after the one before; return its noise, N."""
    parts = [
        make_recording(
            pulse(impact), impact.sample_rate, before=0.2, after=1.8, seed=seed,
            **{"noise_db": NOISE_DB, "offset": 15.0, "drift": 3.0, **faults},
        )[0]
        for seed, impact in enumerate(impacts)
    ]  # fmt: skip
    rate = round(impacts[0].sample_rate)
    soundfile.write(path, np.concatenate(parts).astype(np.float32), rate, subtype="FLOAT")
    return float(impacts[0].floor_force.max() * 10 ** (-NOISE_DB / 20))


@pytest.fixture(scope="module")
def record(tmp_path_factory: pytest.TempPathFactory) -> tuple[Recording, float]:
    """Return a recording of the ball by finite elements, and its noise, N."""
    path = tmp_path_factory.mktemp("recordings") / "ball.wav"
    noise = write(path, thud.solve(CASE), hum=(50.0, 2.0))
    return read_recording(path), noise


@pytest.mark.slow
def test_finite_elements_find_modulus_and_loss_of_a_recording(
    record: tuple[Recording, float],
) -> None:
    case = replace(CASE, ball=thud.Ball(youngs_modulus=1.6e6))
    found = thud.fit(record[0], {"youngs_modulus": None, "loss_factor": 0.15}, case)
    for name, start, truth in (("youngs_modulus", 1.6e6, 2.08e6), ("loss_factor", 0.15, 0.2)):
        assert abs(found.values[name] - truth) < FAR * found.standard_errors[name]
        # The record excludes the start.
        assert abs(found.values[name] - start) > FAR * found.standard_errors[name]
    # First touch at 0.2 s of the file.
    touch = record[0].drops[0].onset + found.values["time_shift"]
    assert abs(touch - 0.2) < FAR * found.standard_errors["time_shift"] + 0.5 / 44100
    assert found.known_noise
    assert not found.warnings


def test_noise_is_that_of_the_quiet(record: tuple[Recording, float]) -> None:
    comparison = ForceTarget(record[0]).compare()
    # 0.2 s of quiet hold 500 values below 1.25 kHz; the background takes some of them.
    assert comparison.unit_deviation == pytest.approx(record[1], rel=FAR / np.sqrt(2 * 450))
    assert ForceTarget(record[0], noise=3.0).compare().unit_deviation == 3.0


def test_noise_above_the_band_does_not_count(record: tuple[Recording, float]) -> None:
    drop = record[0].drops[0]
    random = np.random.default_rng(5)
    # Differences of white noise have little of it at low frequencies.
    blue = np.diff(random.normal(scale=5.0, size=len(drop.force) + 1))
    target = ForceTarget(replace(record[0], drops=(with_force(drop, drop.force + blue),)))
    frequency = np.linspace(0, target.below, 1000)
    density = (2 * np.sin(np.pi * frequency / drop.sample_rate)) ** 2
    quiet = ForceTarget(record[0]).compare().unit_deviation
    expected = np.hypot(quiet, 5.0 * np.sqrt(density.mean()))
    assert target.compare().unit_deviation == pytest.approx(expected, rel=FAR / np.sqrt(2 * 450))
    assert np.hypot(quiet, 5.0 * np.sqrt(2)) > 1.5 * expected


def test_slow_noise_of_fast_records_has_weights(shell: thud.Impact) -> None:
    """The constant that stands for the offset is large also at 96 kHz and below = 355."""
    force, _ = make_recording(
        pulse(shell), shell.sample_rate, rate=96e3, noise_db=NOISE_DB, colour="brown", seed=1
    )
    record = thud.read_recording(Signal.from_array(force, 96e3))
    target = ForceTarget(record, below=355.0)
    found = thud.fit(target, ["youngs_modulus"], case=SHELL)
    modulus, error = found.values["youngs_modulus"], found.standard_errors["youngs_modulus"]
    assert abs(modulus - 1.6e6) < 5 * error


@pytest.fixture(scope="module")
def two(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Write two drops of balls of different moduli, as a recording and as a table."""
    folder = tmp_path_factory.mktemp("two")
    balls = (thud.Ball(youngs_modulus=modulus) for modulus in (1.6e6, 1.8e6))
    write(folder / "record.wav", *(thud.solve(ball, model="hollow_sphere") for ball in balls))
    samples, rate = soundfile.read(folder / "record.wav")
    table = np.column_stack([np.arange(len(samples)) / rate, samples])
    np.savetxt(folder / "record.csv", table, "%.9f")
    return folder


@pytest.mark.parametrize(
    ("file", "more", "truth"),
    [("record.wav", "", 1.6e6), ("record.wav", ", drop = 2", 1.8e6),
     ("record.csv", ", drop = 2", 1.8e6)],
)  # fmt: skip
def test_studies_read_recordings_and_choose_the_drop(
    two: Path, file: str, more: str, truth: float
) -> None:
    (two / "study.toml").write_text(STUDY.format(file=file, more=more))
    found = run_fit(read_fit_study(two / "study.toml"))
    error = found.standard_errors["youngs_modulus"]
    assert abs(found.values["youngs_modulus"] - truth) < FAR * error
    assert error < 1e-3 * truth


@pytest.mark.parametrize("name", ["fit_recording", "fit_recording_constant_loss"])
def test_studies_of_the_repository_can_be_read(name: str) -> None:
    study = read_fit_study(REPOSITORY / f"inputs/studies/{name}.toml")
    (term,) = study.terms
    # make_recording.py: 5 N of noise, 0.2 s of quiet.
    assert term.comparison.unit_deviation == pytest.approx(5.0, rel=FAR / np.sqrt(2 * 450))
    viscosity = "constant_loss" if "constant" in name else "kelvin_voigt"
    assert study.case.model.viscosity == viscosity
