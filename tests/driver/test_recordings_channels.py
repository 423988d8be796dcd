"""Load cells in channels, and records of the same drops."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import soundfile
from conftest import codes, naming, noted
from recording_files import noisy, opened
from refusals.core import write
from scipy import stats
from synthetic import half_sine, make_drop

import thud
from thud import cli
from thud.base.errors import InputError
from thud.level.estimate import Estimate
from thud.recordings.config import Config, read_config
from thud.recordings.force_units import Calibration
from thud.recordings.recorded_levels import average_levels, measure_levels
from thud.recordings.signal import Signal

pytestmark = pytest.mark.usefixtures("working_directory")
RATE = 16_000
SHARES = (0.2, 0.32, 0.14, 0.34)
NAMES = ["F1", "F2", "F3", "F4"]


def record(
    seed: int, *, count: int = 1, noise: float = 1.0, share: float = 1.0, before: float = 0.1
) -> np.ndarray:
    """Return drops that differ by some thousandths, with a bounce each, N."""
    length = round((before + 1.5 * count) * RATE)
    force = np.zeros(length)
    for k in range(count):
        begin, factor = before + 1.5 * k + 0.013 * k**2, 1 + 0.002 * k
        force += half_sine(RATE, begin, length, 1500 * factor, 0.02 / factor)
        force += half_sine(RATE, begin + 0.68 + 0.003 * k, length, 1150 * factor, 0.02)
    return share * force + np.random.default_rng(seed).normal(scale=noise, size=length)


CELLS = [record(i, share=share) for i, share in enumerate(SHARES)]


def write_cells(
    path: str, columns: list[np.ndarray] = CELLS, names: list[str] = NAMES, unit: str = "N"
) -> Path:
    with h5py.File(path, "w") as file:
        file.attrs["Fs"] = RATE
        for name, column in zip(names, columns, strict=True):
            file[name] = column
            file[name].attrs["unit"] = unit
    return Path(path)


def write_wav(path: str, *columns: np.ndarray, kind: str = "PCM_24") -> Path:
    with Path(path).open("w+b") as file:
        soundfile.write(file, np.column_stack(columns), RATE, kind, format=path[-4:].strip("."))
    return Path(path)


@pytest.mark.parametrize(
    "channels", ["sum", " Sum ", "F1+F2+F3+F4", "F4 + 2+3+1", ["F1", "F2", 4, "f3"]]
)
def test_load_cells_are_added(channels: Any) -> None:  # noqa: ANN401
    (signal,) = opened(write_cells("cells.h5"), channels=channels)
    np.testing.assert_allclose(signal.read(0, signal.n_sample), sum(CELLS), atol=1e-9)
    assert noted(signal.notes, "cells_added").value == 4


def test_sum_is_measured_as_one_force() -> None:
    expected = thud.read_recording(Signal.from_array(sum(CELLS), RATE))
    np.testing.assert_allclose(summed().levels(), expected.levels(), atol=1e-9)


def test_each_load_cell_has_its_calibration() -> None:
    chains = ["10 V/FS, 2 mV/N", "10 V/FS, 4 mV/N", "10 V/FS, 5 mV/N", 2500.0]
    scales = (5000.0, 2500.0, 2000.0, 2500.0)
    path = write_wav("cells.wav", *np.divide(CELLS, np.array(scales)[:, None]))
    (signal,) = opened(path, channels="sum", calibration=chains)
    force = signal.read(0, signal.n_sample)
    np.testing.assert_allclose(force, sum(CELLS), atol=1e-2)
    # A charge amplifier inverts, and the sum decides on the sign.
    inverted = [f"-{chain}" if isinstance(chain, str) else -chain for chain in chains]
    (signal,) = opened(path, channels=[1, 2, 3, 4], calibration=inverted)
    np.testing.assert_array_equal(signal.read(0, signal.n_sample), force)
    assert "sign_changed" in codes(signal.notes)
    (signal,) = opened(path, channels="sum", calibration=inverted, polarity="positive")
    np.testing.assert_array_equal(signal.read(0, signal.n_sample), force)


def test_a_configuration_selects_and_calibrates_channels() -> None:
    path = write_cells("cells.h5", unit="V")
    text = 'channels = "F1+F2+F3+F4"\ncalibration = ["1 N/V", 1, "1", "0.001 N/mV"]\n'
    config = read_config(lab := write("lab.toml", text))
    assert config.channels == tuple(NAMES)
    assert config.calibration == (Calibration("1 N/V"), 1.0, 1.0, Calibration("0.001 N/mV"))
    assert thud.read_recording(path, config=lab).peak_force == pytest.approx(1500, rel=0.01)
    one = thud.read_recording(path, calibration="1 N/V", config=config.updated(channel="F4"))
    assert one.peak_force == pytest.approx(SHARES[3] * 1500, rel=0.01)


def test_command_line_selects_and_calibrates_channels(capsys: pytest.CaptureFixture[str]) -> None:
    write_wav("cells.wav", *np.divide(CELLS, 2500))
    command = ["measure", "cells.wav", "--output", "out", "--no-figures", "--channels", "1+2+3+4"]
    # A bare number is N per full scale, as in the configuration.
    assert cli.main([*command, *4 * ["--calibration", "2500"]]) == 0
    assert re.search(r" (1499|150\d)\b", capsys.readouterr().out)


def test_one_force_among_other_channels_needs_no_choice() -> None:
    path = write_cells("mixed.h5", [record(0), record(1, share=0.0)], ["F", "trigger"])
    with h5py.File(path, "r+") as file:
        file["trigger"].attrs["unit"] = "V"
    assert thud.read_recording(path).peak_force == pytest.approx(1500, rel=0.01)


def test_forces_that_are_left_out_are_named() -> None:
    path = write_cells("cells.h5")
    for stated, missing in (({"channel": "F1"}, "F2, F3, F4"), ({"channels": "F1+F2+F3"}, "F4")):
        (signal,) = opened(path, **stated)
        assert noted(signal.notes, "forces_left_out").others["channels"] == missing
    assert not any(note.is_warning for note in opened(path, channels="sum")[0].notes)
    # The sum of load cells, small lateral forces, and a channel without any signal.
    force = sum(CELLS)
    columns = [*CELLS, force, 0.01 * force, np.ones(len(force))]
    path = write_cells("plate.h5", columns, [*NAMES, "Fz", "Fx", "F0"])
    for stated in ({"channel": "Fz"}, {"channels": "F1+F2+F3+F4"}):
        assert not any(note.is_warning for note in opened(path, **stated)[0].notes)


def summed(**changed: np.ndarray) -> thud.Recording:
    """Return the recording of the sum of four load cells, some of them changed."""
    columns = dict(zip(NAMES, CELLS, strict=True)) | changed
    path = write_cells("cells.h5", [*columns.values()])
    return thud.read_recording(path, config=Config(channels="sum"))


# Samples after 10 ms of the contact.
LATER = np.arange(CELLS[0].size) - round(0.11 * RATE)


def test_load_cell_that_clips_is_refused() -> None:
    with pytest.raises(InputError, match=naming("F1", "clipped")):
        summed(F1=np.minimum(CELLS[0], 200))


def test_faults_of_single_load_cells_are_found() -> None:
    found = summed(F1=np.where(LATER == 0, 0.0, CELLS[0]))
    spikes = noted(found.notes, "spikes")
    assert (spikes.others["part"], spikes.value) == ("cells.h5, F1", pytest.approx(0.0625))
    np.testing.assert_allclose(found.levels(), summed().levels(), atol=0.02)
    for code, changed in (("cell_sign", -CELLS[0]), ("cell_without_force", record(9, share=0.0))):
        parts = {n.others["part"] for n in summed(F1=changed).notes if n.code == code}
        assert parts == {"cells.h5, F1"}


def test_inverted_load_cell_does_not_make_another_one_the_sum() -> None:
    cells = {name: record(i, share=0.25) for i, name in enumerate(NAMES)}
    note = noted(summed(**cells | {"F4": -cells["F4"]}).notes, "cell_sign")
    assert (note.others["part"], note.value) == ("cells.h5, F4", pytest.approx(-375, rel=0.01))


def test_one_drop_on_each_of_two_plates() -> None:
    empty = record(2, share=0.0)
    plates = [np.append(record(0), empty), np.append(empty, record(1))]
    assert len(thud.read_recording(write_cells("plates.h5", plates, NAMES[:2])).drops) == 2


@pytest.mark.parametrize(
    ("name", "kind", "start", "noise"),
    [
        ("copy.wav", "PCM_24", 0.0, 1.0),
        ("cut.wav", "PCM_24", 0.043, 0.05),
        ("half.wav", "PCM_24", 1.2, 1.0),
        ("coarse.wav", "PCM_16", 0.0, 0.05),
        ("packed.flac", "PCM_16", 0.05, 15.0),
        # Another offset, in steps of 0.1 N.
        ("table.h5", "", 0.01, 0.05),
    ],
)
def test_records_of_the_same_drops_are_refused(
    name: str, kind: str, start: float, noise: float
) -> None:
    def written(file: str, force: np.ndarray, kind: str, start: float = start) -> Path:
        force = force[round(start * RATE) :]
        if not kind:
            return write_cells(file, [np.round(force + 20, 1)], ["F"])
        return write_wav(file, force / 2000, kind=kind)

    stated = {"calibration": 2000} if kind else {}
    force, suffix = record(7, count=2, noise=noise), Path(name).suffix
    first = written(f"first{suffix}", force, kind and ("PCM_24", "PCM_16")[suffix == ".flac"], 0.0)
    with pytest.raises(InputError, match=naming(name, first.name)):
        thud.read_recording([first, written(name, force, kind)], **stated)
    other = written(f"other{suffix}", record(8, count=2, noise=noise), kind)
    assert len(thud.read_recording([first, other], **stated).drops) >= 3


def test_hum_and_tones_do_not_make_drops_equal() -> None:
    paths = []
    for seed in range(4):
        force = record(seed, noise=0.3)
        time = np.arange(len(force)) / RATE
        force += 40 * np.sin(2 * np.pi * 50 * time) + 15 * np.sin(2 * np.pi * 250 * time)
        # Interference that a shift brings into phase; drops are not alike to 1 N.
        force += 2 * np.sin(2 * np.pi * 4300 * time + seed)
        paths.append(write_wav(f"drop_{seed}.wav", (1 + 0.003 * seed) * force / 2000))
    assert len(thud.read_recording(paths, calibration=2000).drops) == 4


@pytest.mark.parametrize(
    ("rate", "before"), [(2500.0, 0.005), (2500.0, 0.012), (5000.0, 0.002), (5000.0, 0.004)]
)
def test_drops_differ_also_with_little_background(rate: float, before: float) -> None:
    force = half_sine(rate, before, round((before + 0.12) * rate))
    signals = [Signal.from_array(noisy(force, 9, k), rate, f"drop {k}") for k in range(2)]
    assert len(thud.read_recording(signals).drops) == 2


def test_noise_counts_in_bands_where_it_exceeds_the_scatter() -> None:
    # Expanded uncertainties are compared: of five drops by Student's t.
    equal = 1.96 * 0.2 / stats.t.ppf(0.975, 4)
    for scatter, expected in ((0.99 * equal, True), (1.01 * equal, False)):
        samples = 39 + math.sqrt(5) * scatter * np.array([-1, -1, 0, 1, 1])
        repeated, noise = Estimate.of_drops(39.0, samples, [0.2 * math.sqrt(5)] * 5).contributions
        assert (repeated.counted, noise.counted) == (not expected, expected)
    entry = measure_levels([make_drop(3.0, seed=1)] * 3)
    average = average_levels(entry, {}, ())
    noise = entry.contributions["noise"][0] / math.sqrt(3)
    for estimate, expected in zip(average.estimates, noise, strict=True):
        counted = {part.name: part.counted for part in estimate.contributions}
        assert counted["noise"]
        assert not counted["repeatability"]
        assert estimate.uncertainty == pytest.approx(expected)
        assert estimate.expanded == pytest.approx(1.96 * expected, rel=1e-3)
