"""Load cells in channels, and records of the same drops."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import soundfile
from conftest import naming, noted
from recording_files import half_sine as unit_pulse, opened
from scipy import stats
from synthetic import half_sine, make_drop

import thud
from thud import cli
from thud.base.errors import InputError
from thud.level.estimate import Estimate
from thud.recordings.config import Config, read_config, to_channels
from thud.recordings.force_units import Calibration
from thud.recordings.recorded_levels import average_levels, measure_levels
from thud.recordings.signal import Signal, add_signals

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

RATE = 16_000
SHARES = (0.2, 0.32, 0.14, 0.34)
NAMES = ["F1", "F2", "F3", "F4"]


def record(
    seed: int, *, count: int = 2, noise: float = 1.0, share: float = 1.0, before: float = 0.1
) -> NDArray[np.float64]:
    """Return drops that differ by some thousandths, with a bounce each, N."""
    length = round((before + 1.5 * count) * RATE)
    force = np.zeros(length)
    for k in range(count):
        begin, factor = before + 1.5 * k + 0.013 * k**2, 1 + 0.002 * k
        force += half_sine(RATE, begin, length, 1500 * factor, 0.02 / factor)
        force += half_sine(RATE, begin + 0.68 + 0.003 * k, length, 1150 * factor, 0.02)
    return share * force + np.random.default_rng(seed).normal(scale=noise, size=length)


def cells() -> list[NDArray[np.float64]]:
    """Return the forces of four load cells, N."""
    return [record(i, share=share) for i, share in enumerate(SHARES)]


def write_table(
    path: Path, columns: Sequence[NDArray[np.float64]], names: Sequence[str], unit: str = "N"
) -> Path:
    head = ",".join(["Time [s]", *(f"{name} [{unit}]" for name in names)])
    time = np.arange(len(columns[0])) / RATE
    np.savetxt(path, np.column_stack([time, *columns]), "%.7g", ",", header=head, comments="")
    return path


def write_wav(path: Path, columns: Sequence[NDArray[np.float64]]) -> Path:
    with path.open("w+b") as file:
        soundfile.write(file, np.column_stack(columns), RATE, "PCM_24", format="WAV")
    return path


@pytest.mark.parametrize(
    "channels", ["sum", " Sum ", "F1+F2+F3+F4", "F4 + 2+3+4", ["F1", "F2", 4, "f4"]]
)
def test_load_cells_are_added(channels: Any, tmp_path: Path) -> None:  # noqa: ANN401
    path = write_table(tmp_path / "cells.csv", cells(), NAMES)
    (signal,) = opened(path, channels=channels)
    np.testing.assert_allclose(signal.read(0, signal.n_sample), sum(cells()), atol=1e-3)
    assert (signal.notes[-1].code, signal.notes[-1].value) == ("cells_added", 4)
    found = thud.read_recording(path, config=Config(channels=channels))
    (whole,) = opened(write_table(tmp_path / "sum.csv", [sum(cells())], ["F"]))
    expected = thud.read_recording([whole], config=Config())
    np.testing.assert_allclose(found.levels(), expected.levels(), atol=1e-3)


def test_each_load_cell_has_its_calibration(tmp_path: Path) -> None:
    chains = ["10 V/FS, 2 mV/N", "10 V/FS, 4 mV/N", "10 V/FS, 5 mV/N", 2500.0]
    scales = (5000.0, 2500.0, 2000.0, 2500.0)
    path = write_wav(
        tmp_path / "cells.wav", [f / scale for f, scale in zip(cells(), scales, strict=True)]
    )
    (signal,) = opened(path, channels="sum", calibration=chains)
    force = signal.read(0, signal.n_sample)
    np.testing.assert_allclose(force, sum(cells()), atol=1e-2)
    # A charge amplifier inverts, and the sum decides on the sign.
    inverted = [f"-{chain}" if isinstance(chain, str) else -chain for chain in chains]
    (signal,) = opened(path, channels=[1, 2, 3, 4], calibration=inverted)
    np.testing.assert_array_equal(signal.read(0, signal.n_sample), force)
    assert "sign_changed" in [note.code for note in signal.notes]
    (signal,) = opened(path, channels="sum", calibration=inverted, polarity="positive")
    np.testing.assert_array_equal(signal.read(0, signal.n_sample), force)
    with pytest.raises(InputError, match=naming("2 calibrations for 4 channels")):
        opened(path, channels="sum", calibration=chains[:2])
    with pytest.raises(InputError, match=naming("2 calibrations for 1 channel")):
        opened(path, channel=1, calibration=chains[:2])


def test_a_configuration_selects_and_calibrates_channels(tmp_path: Path) -> None:
    path = write_table(tmp_path / "cells.csv", cells(), NAMES, "V")
    lab = tmp_path / "lab.toml"
    lab.write_text('channels = "F1+F2+F3+F4"\ncalibration = ["1 N/V", 1, "1", "0.001 N/mV"]\n')
    config = read_config(lab)
    assert config.channels == tuple(NAMES)
    assert config.calibration == (Calibration("1 N/V"), 1.0, 1.0, Calibration("0.001 N/mV"))
    assert thud.read_recording(path, config=lab).peak_force == pytest.approx(1500, rel=0.01)
    one = thud.read_recording(path, calibration="1 N/V", config=config.updated(channel="F4"))
    assert one.peak_force == pytest.approx(SHARES[3] * 1500, rel=0.01)
    with pytest.raises(InputError, match=naming("both channel and channels")):
        opened(path, channel=1, channels="sum")


def test_command_line_selects_and_calibrates_channels(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    forces = [record(i, count=1, share=share) for i, share in enumerate(SHARES)]
    path = write_wav(tmp_path / "cells.wav", [force / 2500 for force in forces])
    command = ["measure", str(path), "--output", str(tmp_path / "out"), "--no-figures"]
    # A bare number is N per full scale, as in the configuration.
    assert cli.main([*command, "--channels", "1+2+3+4", *4 * ["--calibration", "2500"]]) == 0
    out = capsys.readouterr().out
    assert "forces of 4 load cells were added" in out
    assert re.search(r" (1499|150\d)\b", out)
    assert cli.main([*command, "--channels", "sum", *3 * ["--calibration", "2500"]]) == 1
    assert "3 calibrations for 4 channels" in capsys.readouterr().err


@pytest.mark.parametrize("channels", ["", "F1", "F1+F1", [], ["F1"], 3, [1, True], ["F1", ""]])
def test_senseless_channels_are_refused(channels: object) -> None:
    with pytest.raises(InputError, match=naming("channels", "is not allowed")):
        to_channels("channels", channels)


def test_channels_to_be_added_must_be_forces(tmp_path: Path) -> None:
    force, noise = record(0), record(1, share=0.0)
    path = write_table(tmp_path / "one.csv", [force], ["F"])
    with pytest.raises(InputError, match=naming('"sum" needs two or more channels of force')):
        opened(path, channels="sum")
    # One force among other channels needs no choice.
    path = tmp_path / "mixed.csv"
    table = np.column_stack([np.arange(len(force)) / RATE, force, noise, noise])
    np.savetxt(path, table, "%.7g", ",", header="t [s],F [N],trigger [V],a [g]", comments="")
    assert thud.read_recording(path).peak_force == pytest.approx(1500, rel=0.01)
    with pytest.raises(InputError, match=naming("matches 0 channels")):
        opened(path, channels="F+G")
    with pytest.raises(InputError, match=naming("names one channel twice")):
        opened(path, channels="F+2")
    path = write_table(tmp_path / "axes.csv", cells()[:3], ["Fx", "Fy", "Fz"])
    with pytest.raises(InputError, match=naming("different directions")):
        opened(path, channels="sum")
    path = write_table(tmp_path / "total.csv", [*cells(), sum(cells())], [*NAMES, "Fz"])
    with pytest.raises(InputError, match=naming("Fz", "is the sum of the other channels")):
        thud.read_recording(path, config=Config(channels="sum"))


def test_forces_that_are_left_out_are_named(tmp_path: Path) -> None:
    path = write_table(tmp_path / "cells.csv", cells(), NAMES)
    for given, missing in (({"channel": "F1"}, "F2, F3, F4"), ({"channels": "F1+F2+F3"}, "F4")):
        (signal,) = opened(path, **given)
        note = signal.notes[-1]
        assert (note.code, note.others["channels"]) == ("forces_left_out", missing)
    assert not warned(opened(path, channels="sum"))
    # The sum of load cells, small lateral forces, and a channel without any signal.
    force = sum(cells())
    columns = [*cells(), force, 0.01 * force, np.ones(len(force))]
    path = write_table(tmp_path / "plate.csv", columns, [*NAMES, "Fz", "Fx", "F0"])
    assert not warned(opened(path, channel="Fz"))
    assert not warned(opened(path, channels="F1+F2+F3+F4"))


def summed(path: Path, **changed: NDArray[np.float64]) -> thud.Recording:
    """Return the recording of the sum of four load cells, some of them changed."""
    columns = dict(zip(NAMES, cells(), strict=True)) | changed
    return thud.read_recording(
        write_table(path, list(columns.values()), NAMES), config=Config(channels="sum")
    )


@pytest.mark.parametrize(
    ("change", "words"),
    [(lambda f: np.minimum(f, 200), "held, clipped"), (np.zeros_like, "all samples are 0")],
)
def test_load_cells_that_fail_are_refused(
    change: Callable[..., Any], words: str, tmp_path: Path
) -> None:
    with pytest.raises(InputError, match=naming("F1", words)):
        summed(tmp_path / "cells.csv", F1=change(cells()[0]))


def test_faults_of_single_load_cells_are_found(tmp_path: Path) -> None:
    path, first = tmp_path / "cells.csv", cells()[0]
    lost = first.copy()
    lost[round(0.11 * RATE) : round(0.11 * RATE) + 8] = 0.0
    with pytest.raises(InputError, match=naming("F1", "8 samples", "lost")):
        summed(path, F1=lost)
    spike = first.copy()
    spike[round(0.11 * RATE)] = 0.0
    found = summed(path, F1=spike)
    spikes = noted(found.notes, "spikes")
    assert (spikes.others["part"], spikes.value) == ("cells.csv, F1", pytest.approx(0.0625))
    np.testing.assert_allclose(found.levels(), summed(path).levels(), atol=0.02)
    for code, changed in (
        ("cell_sign", {"F1": -first}),
        ("cell_without_force", {"F1": record(9, share=0.0)}),
    ):
        parts = {n.others["part"] for n in summed(path, **changed).notes if n.code == code}
        assert parts == {"cells.csv, F1"}


def warned(signals: list[Signal]) -> list[tuple[str, str]]:
    """Return codes and subjects of the warnings on signals."""
    return [(n.code, n.subject) for signal in signals for n in signal.notes if n.is_warning]


def test_channels_of_unequal_length_are_refused() -> None:
    signals = [Signal.from_array(unit_pulse(RATE)[i:], RATE, f"F{i}") for i in range(2)]
    with pytest.raises(InputError, match=naming("F1", "samples", "recorded together")):
        add_signals(signals, "sum")


def test_simultaneous_channels_are_refused(tmp_path: Path) -> None:
    path = write_table(tmp_path / "cells.csv", cells(), NAMES)
    with pytest.raises(InputError, match=naming("at the same instants", 'channels = "sum"')):
        thud.read_recording(path)
    # One drop on each of two plates.
    first, second = record(0, count=1), record(1, count=1)
    empty = record(2, count=1, share=0.0)
    plates = [np.append(first, empty), np.append(empty, second)]
    assert len(thud.read_recording(write_table(path, plates, NAMES[:2])).drops) == 2
    # A fault of one channel is named with the choice.
    path = write_table(tmp_path / "lifted.csv", [record(0), record(1, share=0.0)], NAMES[:2])
    with pytest.raises(
        InputError, match=naming("F2", 'if several channels are forces: channels = "sum"')
    ):
        thud.read_recording(path)


def write_part(path: Path, force: NDArray[np.float64], kind: str, start: float) -> Path:
    piece = force[round(start * RATE) :]
    if path.suffix == ".csv":
        return write_table(path, [np.round(piece + 20, 1)], ["F"])
    with path.open("w+b") as file:
        soundfile.write(file, piece / 2000, RATE, kind, format=path.suffix[1:].upper())
    return path


@pytest.mark.parametrize(
    ("name", "kind", "start", "noise"),
    [
        ("copy.wav", "PCM_24", 0.0, 1.0),
        ("cut.wav", "PCM_24", 0.043, 0.05),
        ("half.wav", "PCM_24", 1.2, 1.0),
        ("coarse.wav", "PCM_16", 0.0, 0.05),
        ("packed.flac", "PCM_16", 0.05, 15.0),
        ("table.csv", "", 0.01, 0.05),
    ],
)
def test_records_of_the_same_drops_are_refused(
    name: str, kind: str, start: float, noise: float, tmp_path: Path
) -> None:
    force = record(7, noise=noise)
    given = {"calibration": 2000} if not name.endswith("csv") else {}
    first = write_part(tmp_path / f"first{Path(name).suffix}", force, kind or "PCM_24", 0.0)
    copy = write_part(tmp_path / name, force, kind, start)
    if not start and kind == "PCM_16":
        first = write_part(tmp_path / "first.wav", force, "PCM_24", 0.0)
    with pytest.raises(
        InputError, match=r"is given twice, also as first|is the same drop as first"
    ):
        thud.read_recording([first, copy], **given)
    other = write_part(tmp_path / f"other{Path(name).suffix}", record(8, noise=noise), kind, start)
    assert len(thud.read_recording([first, other], **given).drops) >= 3


def test_hum_and_tones_do_not_make_drops_equal(tmp_path: Path) -> None:
    paths = []
    for seed in range(4):
        force = record(seed, noise=0.3)
        time = np.arange(len(force)) / RATE
        force += 40 * np.sin(2 * np.pi * 50 * time) + 15 * np.sin(2 * np.pi * 250 * time)
        # Interference that a shift brings into phase; drops are not alike to 1 N.
        force += 2 * np.sin(2 * np.pi * 4300 * time + seed)
        force *= 1 + 0.003 * seed
        paths.append(write_wav(tmp_path / f"drop_{seed}.wav", [force / 2000]))
    assert len(thud.read_recording(paths, calibration=2000).drops) == 8


@pytest.mark.parametrize(
    ("rate", "before"), [(2500.0, 0.005), (2500.0, 0.012), (5000.0, 0.002), (5000.0, 0.004)]
)
def test_drops_differ_also_with_little_background(rate: float, before: float) -> None:
    length = round((before + 0.12) * rate)
    signals = [
        Signal.from_array(
            half_sine(rate, before, length) + np.random.default_rng(k).normal(scale=9, size=length),
            rate, f"drop {k}",
        ) for k in range(2)
    ]  # fmt: skip
    assert len(thud.read_recording(signals).drops) == 2


def test_a_file_is_given_once(tmp_path: Path) -> None:
    path = write_wav(tmp_path / "drop.wav", [record(0) / 2000])
    with pytest.raises(InputError, match=naming("drop.wav: is given twice", "each record once")):
        thud.read_recording([path, path], calibration=2000)
    signal = Signal.from_array(record(0), RATE, "array")
    with pytest.raises(InputError, match=naming("array: is given twice")):
        thud.read_recording([signal, signal], config=Config())


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
