"""The blocked force in files for other programs."""

from __future__ import annotations

import hashlib
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from conftest import REPOSITORY, codes, names_in
from recording_files import PEAK, opened
from scipy.io import loadmat
from synthetic import make_recording

import thud
from thud.base.note import Note
from thud.cli import COMMANDS, new_parser
from thud.cli.case_commands import KINDS
from thud.export.force_files import EXPORTS, BlockedForce, blocked_force
from thud.recordings.recording import read_recording

if TYPE_CHECKING:
    from pathlib import Path

soundfile = pytest.importorskip("soundfile", reason="the extra recordings is not installed")

IMPACT = thud.solve()
FORCE = blocked_force(IMPACT)
CASE = str(REPOSITORY / "inputs/rubber_ball_100cm.nml")

# Of the half sine, s.
DURATION = 0.02


def export(*words: str) -> int:
    """Run the command as the driver does."""
    return COMMANDS["export"].function(new_parser().parse_args(["export", *words]))


def half_sine(rate: float, start: float = 0.0) -> BlockedForce:
    """Return the pulse of the closed form."""
    time = np.arange(round(DURATION * rate) + 1) / rate
    force = PEAK * np.sin(np.pi * time / DURATION)
    return BlockedForce("half_sine", force, rate, start, "floor", "closed form", "0")


@pytest.mark.parametrize(("kind", "digits"), [("wav", 2.0**-24), ("csv", 0), ("mat", 0)])
def test_files_hold_the_force_to_their_last_digit(kind: str, digits: float, tmp_path: Path) -> None:
    ending, _ = EXPORTS[kind]
    path = tmp_path / f"force{ending}"
    # A path that its user names is replaced.
    half_sine(44100.0).save(path)
    FORCE.save(path)
    calibration = 2048.0 if kind == "wav" else None
    (signal,) = opened(path, calibration=calibration)
    assert signal.sample_rate == pytest.approx(44100.0, rel=1e-12)
    read = signal.read(0, signal.n_sample)
    assert read.shape == FORCE.force.shape
    assert (np.abs(read - FORCE.force) <= digits * np.abs(FORCE.force)).all()


def test_files_tell_units_rate_kind_and_checksum(tmp_path: Path) -> None:
    """Words of others stay in their lines."""
    thud.write_case(IMPACT.case, tmp_path / "case.nml")
    checksum = hashlib.sha256((tmp_path / "case.nml").read_bytes()).hexdigest()
    note = Note("sign_stated", others={"polarity": "a\r\nb"})
    force = replace(FORCE, name="b\udcffll", origin="first\nsecond,3", notes=(note,))
    for kind, (ending, _) in EXPORTS.items():
        force.save(tmp_path / f"force{ending}")
        text = (tmp_path / f"force{ending}").read_bytes()
        if kind == "mat":
            text = "\n".join(np.ravel(loadmat(tmp_path / "force.mat")["about"])).encode()
        for word in ("force on the floor", "N, positive", "Sample rate: 44100 Hz", checksum):
            assert word.encode() in text, f"{kind}: {word}"
        # The power of two above the peak.
        assert (b"Scale: 2048 N per full scale" in text) == (kind == "wav")
    (signal,) = opened(tmp_path / "force.csv")
    assert np.array_equal(signal.read(0, signal.n_sample), FORCE.force)


@pytest.mark.parametrize("start", [0.0, -3e-3])
def test_spectrum_is_the_transform_of_the_half_sine(start: float) -> None:
    rate = 44100.0
    frequency, spectrum = half_sine(rate, start).spectrum()
    # Integral of sin(pi t/T) exp(-i 2 pi f t), but for 1/(2 T).
    omega, k = 2 * np.pi * frequency, np.pi / DURATION
    known = np.abs(omega - k) > 1e-6 * k
    omega = omega[known]
    exact = PEAK * k * (1 + np.exp(-1j * omega * DURATION)) / (k**2 - omega**2)
    exact *= np.exp(-1j * omega * start)
    band = frequency[known] <= 1000
    # The sum misses by dt2/12 times the steps of the slope at both ends, to leading order.
    error = 2 * PEAK * k / (12 * rate**2)
    assert np.abs(spectrum[known] - exact)[band].max() < 1.1 * error


def test_spectrum_holds_the_energy_of_the_force(tmp_path: Path) -> None:
    path = tmp_path / "ball_spectrum.csv"
    FORCE.save(path)
    frequency, real, imaginary, magnitude, phase = np.genfromtxt(path, delimiter=",").T[:, 1:]
    spectrum = real + 1j * imaginary
    assert magnitude * np.exp(1j * phase) == pytest.approx(spectrum, abs=1e-12)
    weight = np.full(len(frequency), 2.0)
    weight[[0, -1]] = 1.0
    energy = (weight * magnitude**2).sum() * frequency[1]
    assert energy == pytest.approx((FORCE.force**2).sum() / FORCE.sample_rate, rel=1e-12)
    assert real[0] == pytest.approx(FORCE.force.sum() / FORCE.sample_rate, rel=1e-12)


def test_force_is_that_which_the_case_judges() -> None:
    case = thud.Case(levels=thud.Levels(force="elastic"))
    impact = thud.solve(case)
    assert np.array_equal(blocked_force(impact).force, impact.elastic_force)
    assert np.array_equal(FORCE.force, IMPACT.floor_force)
    assert "elastic" in blocked_force(impact).header_lines()[0]


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    """Return a file with two drops."""
    count = round(1.02 * IMPACT.contact_time * IMPACT.sample_rate)
    force, _ = make_recording(
        IMPACT.floor_force[:count], IMPACT.sample_rate,
        noise_db=50, offset=10.0, before=0.2, after=0.3, drops=((0.0, 1.0), (2.0, 1.0)),
    )  # fmt: skip
    path = tmp_path / "two.wav"
    soundfile.write(path, force.astype(np.float32), 44100, subtype="FLOAT")
    return path


def test_recording_gives_the_force_of_a_drop(recording: Path) -> None:
    found = read_recording(recording)
    force = blocked_force(found, drop=2)
    drop = found.drops[1]
    gate = slice(*drop.gate)
    assert np.array_equal(force.force, drop.force[gate])
    assert force.time == pytest.approx(drop.time[gate], abs=1e-12)
    assert force.checksum == hashlib.sha256(recording.read_bytes()).hexdigest()
    assert "drop 2" in force.origin
    assert "offset_removed" in codes(force.notes)


def test_command_writes_what_is_asked_for(
    recording: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert list(KINDS) == list(EXPORTS)
    assert export(CASE, "--csv", "--wav", "-o", str(tmp_path / "a")) == 0
    names = ["rubber_ball_100cm.csv", "rubber_ball_100cm.wav"]
    assert names_in(tmp_path / "a") == [*names, "thud.txt"]
    assert capsys.readouterr().out.count("rubber_ball_100cm") == 2
    assert export(str(recording), "--spectrum", "--drop", "2", "-q", "-o", str(tmp_path / "b")) == 0
    assert (tmp_path / "b/two_drop_2_spectrum.csv").exists()
    assert not capsys.readouterr().out
