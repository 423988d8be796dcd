"""Recordings: every format, unit and rate, what is found and told, and files that are refused."""

from __future__ import annotations

import math
import os
import pickle
import re
import struct
import time
import tracemalloc
import zlib
from dataclasses import fields
from datetime import datetime, timedelta
from itertools import product
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np
import pytest
import scipy.io
import soundfile
from conftest import REPOSITORY, naming
from recording_files import PEAK, SOUND, WITH_UNIT, WRITERS, broadcast_chunk, half_sine, opened

from thud.base.errors import InputError
from thud.recordings import calibration
from thud.recordings.calibration import calibrate
from thud.recordings.config import Config, Instrument, Properties, ReportConfig, read_config
from thud.recordings.force_units import Calibration, newtons_per_unit
from thud.recordings.formats.text import read_channels
from thud.recordings.instruments import Plate, RecorderFilter
from thud.recordings.signal import Signal, find_peaks, orient

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from numpy.typing import NDArray

RATES = (2500.0, 8000.0, 44100.0, 48000.0, 51200.0, 96000.0)
# Recorded values per newton, and what the user says about them.
UNITS: dict[str, tuple[float, dict[str, Any]]] = {
    "N": (1.0, {}),
    "kN": (1e-3, {}),
    "V": (4e-3, {"calibration": "250 N/V"}),
    "mV": (4.0, {"calibration": "4.1 pC/N, 0.97560975609756097 mV/pC"}),
    "counts": (8.0, {"calibration": 0.125}),
}
FULL_SCALE = 1600.0
LSB = {"pcm16": 2.0**-15, "pcm24": 2.0**-23, "pcm32": 2.0**-31, "float": 2.0**-24}


def codes(signal: Signal) -> list[str]:
    """Return the codes of the notes on a signal."""
    return [note.code for note in signal.notes]


def read_all(path: Path, **given: Any) -> tuple[Signal, NDArray[np.float64]]:  # noqa: ANN401
    (signal,) = opened(path, **given)
    return signal, signal.read(0, signal.n_sample)


@pytest.mark.parametrize("rate", RATES)
@pytest.mark.parametrize("name", WITH_UNIT)
@pytest.mark.slow
def test_half_sine_is_read_in_every_unit(name: str, rate: float, tmp_path: Path) -> None:
    exact = half_sine(rate)
    for unit, (per_newton, given) in UNITS.items():
        WITH_UNIT[name](tmp_path / name, exact * per_newton, rate, unit)
        signal, force = read_all(tmp_path / name, **given)
        # Universal files hold the sampling interval to six digits.
        assert signal.sample_rate == pytest.approx(rate, rel=5e-6 if name.endswith("uff") else 1e-7)
        np.testing.assert_allclose(force, exact, atol=1e-9 * PEAK)
        assert signal.n_sample == exact.size
        assert signal.full_scale is None
        assert unit in signal.calibration


@pytest.mark.parametrize("rate", RATES)
@pytest.mark.parametrize("name", SOUND)
def test_half_sine_is_read_from_sound_files(name: str, rate: float, tmp_path: Path) -> None:
    exact = half_sine(rate)
    is_integer = name.startswith("pcm")
    SOUND[name](tmp_path / name, exact / FULL_SCALE if is_integer else exact, rate, "")
    given = {"calibration": f"10 V/FS, {10 / FULL_SCALE!r} V/N"} if is_integer else {"unit": "N"}
    signal, force = read_all(tmp_path / name, **given)
    assert signal.sample_rate == rate
    assert signal.full_scale == (pytest.approx(FULL_SCALE) if is_integer else None)
    digit = LSB.get(name.partition(".")[0], 0.0) * (FULL_SCALE if is_integer else PEAK)
    # Rounded or cut off to the last digit.
    assert abs(force - exact).max() <= digit * 1.001


def write_pulse(path: Path, name: str, values: NDArray[np.float64] | None = None) -> Path:
    values = half_sine(8000.0) if values is None else values
    target = path / name
    WRITERS[name](target, values / 5000 if name.startswith("pcm") else values, 8000.0, "N")
    return target


def read_pulse(path: Path) -> tuple[Signal, NDArray[np.float64]]:
    """Return what is read of the pulse in a file of `write_pulse`."""
    return read_all(path, calibration=5000.0 if "pcm" in path.name else None)


@pytest.mark.parametrize("name", WRITERS)
def test_pieces_are_those_of_the_whole_in_other_processes_too(name: str, tmp_path: Path) -> None:
    # The content determines the format.
    path = write_pulse(tmp_path, name).rename(tmp_path / f"{name}.bin")
    signal, force = read_pulse(path)
    copy = pickle.loads(pickle.dumps(signal))  # noqa: S301 - its own
    for start, stop in ((0, 1), (3, 3), (17, 130), (0, signal.n_sample)):
        np.testing.assert_array_equal(copy.read(start, stop), force[start:stop])
    with pytest.raises(InputError, match=naming("samples", 321, 320)):
        signal.read(0, 321)
    assert force.max() > 1490
    assert len(signal.checksum) == 64


def test_negative_compression_is_found_and_told(tmp_path: Path) -> None:
    exact, path = half_sine(8000.0), tmp_path / "plate.h5"
    WRITERS["plate.h5"](path, -exact, 8000.0, "N")
    signal, force = read_all(path)
    np.testing.assert_array_equal(force, exact)
    (note,) = signal.notes
    assert (note.code, note.subject) == ("sign_changed", signal.name)
    assert note.value == pytest.approx(-1500)
    np.testing.assert_array_equal(read_all(path, polarity="negative")[1], exact)
    with pytest.raises(InputError, match=naming("plate.h5", "peak", "0 N")):
        opened(path, polarity="positive")


def write_sound(path: Path, values: NDArray[np.float64], rate: float = 8000.0) -> Path:
    soundfile.write(path, values, round(rate), "DOUBLE")
    return path


@pytest.mark.parametrize("cut", [0.0, 0.3])
@pytest.mark.parametrize("sign", [1, -1])
def test_polarity_of_a_record_without_quiet(cut: float, sign: int) -> None:
    pulse = half_sine(8000.0, 0.0, 0.0)
    record = sign * pulse[: round(len(pulse) * (1 - cut))] + 3.0
    signal = orient(Signal.from_array(record, 8000.0))
    assert codes(signal) == ["sign_changed"] * (sign < 0)
    assert signal.read(0, signal.n_sample).max() > 1490


def test_unclear_polarity_is_refused() -> None:
    noise = Signal.from_array(np.random.default_rng(1).normal(0, 300, 4000), 8000.0, "noise")
    with pytest.raises(InputError, match=naming("noise", "sign", "polarity")):
        orient(noise)
    assert orient(noise, "positive").scale == 1


def test_quiet_is_found_at_either_end() -> None:
    # A pulse on 500 N, the begin or the end of which is missing.
    force = 500 + 1500 * np.sin(np.linspace(0.4, np.pi, 985))
    for record in (
        np.append(force, np.full(15, 500.0)),
        np.append(np.full(15, 500.0), force[::-1]),
    ):
        above, below = find_peaks(Signal.from_array(record, 8000.0))
        assert (above, below) == (record.max() - 500, 500 - record.min())


@pytest.mark.parametrize(("opposite", "is_doubted"), [(0.98, False), (1.02, True)])
def test_polarity_is_doubted_from_half_as_much_again_on(opposite: float, is_doubted: bool) -> None:  # noqa: FBT001
    force = np.concatenate([half_sine(8000.0) / 1.5, -opposite * half_sine(8000.0)])
    signal = orient(Signal.from_array(force, 8000.0), "positive")
    assert codes(signal) == ["polarity_doubtful"] * is_doubted


@pytest.mark.parametrize(
    ("factor", "unit", "words"),
    [
        (1e-3, "N", naming("peak", "1.5 N", "kN")),
        (1e3, "N", naming("peak", "1.5e+06 N", "mN")),
        (1.0, "kN", naming("peak", "1.5e+06 N", "mN")),
        (1e-6, "N", naming("peak", "0.0015 N", "unit", "calibration")),
        (1e-3, None, naming("unit", 1.5)),
        (0.1, None, naming("unit", 150)),
    ],
)
def test_wrong_units_are_told(factor: float, unit: str | None, words: str, tmp_path: Path) -> None:
    path = write_sound(tmp_path / "plate.wav", factor * half_sine(8000.0))
    with pytest.raises(InputError, match=words) as caught:
        opened(path, unit=unit)
    assert re.search(naming("plate.wav", 300, "15000 N"), str(caught.value))


def test_small_peaks_raise_a_warning(tmp_path: Path) -> None:
    path = write_sound(tmp_path / "plate.wav", 0.1 * half_sine(8000.0))
    (signal,) = opened(path, unit="N")
    (note,) = signal.notes
    assert note.code == "peak_unusual"
    assert (note.value, note.low, note.high) == (pytest.approx(150), 300, 15_000)


def test_units_and_rates_that_are_replaced_are_told(tmp_path: Path) -> None:
    WRITERS["plate.h5"](tmp_path / "plate.h5", half_sine(8000.0) / 1e3, 8000.0, "N")
    signal, force = read_all(tmp_path / "plate.h5", unit="kN", sample_rate=8001.0)
    assert force.max() == pytest.approx(1500)
    assert signal.sample_rate == 8001
    rate, unit = signal.notes
    assert (rate.code, rate.value, rate.others["of_file"]) == ("rate_replaced", 8001.0, 8000.0)
    assert (unit.code, unit.unit, unit.others["of_file"]) == ("unit_replaced", "kN", "N")
    assert signal.date == "2024-05-06"


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"unit": "V"}, naming("V", "calibration")),
        ({}, naming("FS", "calibration")),
        ({"calibration": "250 N/V"}, naming("'250 N/V'", "FS", "N")),
        ({"calibration": "10 V/FS"}, naming("'10 V/FS'", "FS", "N")),
        ({"calibration": "10 X/FS"}, naming("unit", "'X'")),
        ({"calibration": "V/FS"}, naming("'V/FS'")),
        ({"calibration": 0.0}, naming("calibration", 0.0)),
        ({"calibration": math.nan}, naming("calibration", "nan")),
        ({"calibration": True}, naming("calibration", "True")),
        ({"calibration": 5e3, "channel": 3}, naming("channel", 3, 1, 2)),
        ({"calibration": 5e3}, naming("2 channels")),
        ({"polarity": "up"}, naming("polarity", "'up'", "'positive'")),
        ({"unit": "dB"}, naming("unit", "'dB'")),
        ({"calibration": 5e3, "channel": 1, "sample_rate": 2000.0}, naming("rate", "2000 Hz")),
        ({"sample_rate": math.nan}, naming("sample_rate", "nan")),
        ({"sample_rate": "8 kHz"}, naming("sample_rate", "'8 kHz'")),
    ],
)
def test_what_does_not_fit_is_told(given: dict[str, Any], words: str, tmp_path: Path) -> None:
    force = half_sine(8000.0) / 5000
    channels = 2 if given.get("calibration") == 5e3 else 1
    soundfile.write(tmp_path / "plate.wav", np.column_stack([force] * channels), 8000, "PCM_24")
    with pytest.raises(InputError, match=words) as caught:
        opened(tmp_path / "plate.wav", **given)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("calibration", "unit", "newtons"),
    [
        ("5000 N/FS", None, 5000.0),
        ("10 V/FS, 2 mV/N", None, 5000.0),
        ("2 mV/N; 10 V/FS", "FS", 5000.0),
        ("10 V/FS, 1 mV/pC, 4 pC/N", None, 2500.0),
        ("10 V/FS, 5 V/V, 1 mV/N", None, 2000.0),
        ("0.5 N/counts", None, 0.5 * 2**23),
        ("0.5 N/counts", "counts", 0.5 * 2**23),
        ("1e3 counts/kN", None, 2.0**23),
        ("-5 kN/FS", None, 5000.0),
        (5000, None, 5000.0),
        (np.float32(5000), None, 5000.0),
        (Calibration("5 kN/FS", 0.01, "certificate 7"), None, 5000.0),
    ],
)
def test_calibrations_lead_to_newtons(
    calibration: float | str | Calibration, unit: str | None, newtons: float, tmp_path: Path
) -> None:
    soundfile.write(tmp_path / "plate.wav", half_sine(8000.0) / newtons, 8000, "PCM_24")
    signal, force = read_all(tmp_path / "plate.wav", calibration=calibration, unit=unit)
    # Two digits: of the largest and of the smallest full scale.
    assert force.max() == pytest.approx(1500, rel=1e-6, abs=newtons * 2.0**-22)
    assert signal.full_scale == pytest.approx(newtons)
    known = calibration.uncertainty if isinstance(calibration, Calibration) else None
    assert signal.calibration_uncertainty == known


@pytest.mark.parametrize(
    ("calibration", "newtons"),
    [
        (1.1e-30, 1.1e-30), (-0.9e30, -0.9e30), (Calibration("0.9e30 N/V"), 0.9e30),
        (0.9e-30, None), (1.1e30, None), (Calibration("1e20 pC/V, 1e20 N/pC"), None),
    ],
)  # fmt: skip
def test_calibrations_have_a_possible_size(calibration: float | str, newtons: float | None) -> None:
    if newtons:
        assert newtons_per_unit("V", calibration, None, "plate.wav")[0] == newtons
        return
    with pytest.raises(InputError, match=naming("calibration")):
        newtons_per_unit("V", calibration, None, "plate.wav")


def test_channels_are_found_by_number_and_name(tmp_path: Path) -> None:
    force = half_sine(8000.0)
    rows = "".join(f"{i / 8000:.6f};{-v:g};{v:g};{i}\n" for i, v in enumerate(force))
    (tmp_path / "t.csv").write_text("Time [s];Fx [N];Fz [N];Trigger [V]\n" + rows)
    both = opened(tmp_path / "t.csv")
    assert [one.name for one in both] == ["t.csv, Fx", "t.csv, Fz"]
    for channel in (3, "3", "Fz", "fz"):
        (signal,) = opened(tmp_path / "t.csv", channel=channel)
        assert signal.name == "t.csv, Fz"
        assert signal.notes == ()
    with pytest.raises(InputError, match=naming("'Fy'", "2 'Fx'", "3 'Fz'", 4)):
        opened(tmp_path / "t.csv", channel="Fy")
    with pytest.raises(InputError, match=naming("V", "calibration")):
        opened(tmp_path / "t.csv", channel=4)


@pytest.mark.parametrize(
    ("head", "row"),
    [
        ("Sample rate;8 kHz\nUnit;kN\nForce\n", "{v};"),
        ("Sampling Frequency (Hz): 8000\nForce (kN)\n", "{v}"),
        ("// dt [us]: 125\n// unit: kN\n", "{v}"),
        ("; Abtastrate = 8,0 kHz\n; Einheit = kN\n", "{k};"),
        ("fs\t8000\nForce\n[kN]\n", "{k};"),
        ("t_ms F_kN\n", "{ms} {v}"),
        ("Sample rate in Hz\t8000\nKraft in kN\n", "{v}"),
        ("Zeit / s;Kraft / kN\n", "{t};{k}"),
        ("Messung Nr. 3\nDatum;06.05.2024\n\nZeit;Kraft\ns;kN\n", "{t};{k}"),
        ("time (s)\tforce / kN\tstate\n", "{t}\t{v}\tok"),
        ('"time","Force, kN"\n', "{t},{v}"),
    ],
)
@pytest.mark.parametrize(
    ("coding", "end"),
    [("utf-8", "\n"), ("utf-8-sig", "\r\n"), ("utf-16", "\r"), ("latin-1", "\r\n")],
)
def test_headers_of_loggers(head: str, row: str, coding: str, end: str, tmp_path: Path) -> None:
    lines = [
        row.format(v=v, k=str(v).replace(".", ","), t=i / 8000, ms=i / 8).strip()
        if "k}" not in row or "{t}" not in row
        else row.format(k=f"{v:.6f}".replace(".", ","), t=f"{i / 8000:.6f}".replace(".", ","))
        for i, v in enumerate((half_sine(8000.0) / 1e3).round(6).tolist())
    ]
    path = tmp_path / "plate.txt"
    path.write_bytes((head + "\n".join(lines) + "\n").replace("\n", end).encode(coding))
    signal, force = read_all(path)
    assert signal.sample_rate == pytest.approx(8000, rel=1e-9)
    np.testing.assert_allclose(force, half_sine(8000.0), atol=1e-3)
    assert signal.calibration == "values in kN"


@pytest.mark.parametrize(
    ("head", "row", "rate"),
    [
        ("fs: 8000\nNo;Force [N]\n", "{i};{v:g}", 8000.0),  # numbers of samples are no times
        ("fs: 8000\nGain;1,0\nNo;Force [N]\n", "{i};{v:g}", 8000.0),
        ("fs: 8000\nOffset;0;0.5\nNo;Force [N]\n", "{i};{v:g}", None),
        ("fs: 8000\nSensitivity = 4.1 mV/N\nForce\n", "{v:g}", None),
        ("fs: 8000\nCalibration: 2026-05-06\nForce [N]\n", "{v:g}", 8000.0),
    ],
)
def test_sample_numbers_and_factors_of_a_header(
    head: str, row: str, rate: float | None, tmp_path: Path
) -> None:
    rows = "".join(row.format(i=i, v=v) + "\n" for i, v in enumerate(half_sine(8000.0)))
    (tmp_path / "t.csv").write_text(head + rows)
    if rate is None:
        with pytest.raises(InputError, match=naming("calibration")):
            opened(tmp_path / "t.csv")
        return
    signal, force = read_all(tmp_path / "t.csv")
    assert (signal.sample_rate, signal.notes) == (rate, ())
    np.testing.assert_allclose(force, half_sine(8000.0), rtol=1e-5, atol=1e-2)


def test_rate_of_header_and_times_must_agree(tmp_path: Path) -> None:
    rows = "".join(f"{i / 8000:.6f},{v:g}\n" for i, v in enumerate(half_sine(8000.0)))
    (tmp_path / "t.csv").write_text("fs: 4000\ntime_s,force_N\n" + rows)
    with pytest.raises(InputError, match=naming("t.csv", "4000 Hz", "8000 Hz")):
        opened(tmp_path / "t.csv")


@pytest.mark.parametrize("is_matrix", [False, True])
def test_rate_of_group_and_times_must_agree(is_matrix: bool, tmp_path: Path) -> None:  # noqa: FBT001
    force = half_sine(8000.0)
    time = np.arange(force.size) / 8000
    arrays = {"F": np.column_stack([time, force])} if is_matrix else {"F": force, "t": time}
    for stated in (8050.0, 8100.0):
        scipy.io.savemat(tmp_path / "a.mat", {"ball": {**arrays, "Fs": stated}})
        if stated < 8080:
            assert read_all(tmp_path / "a.mat")[0].sample_rate == stated
            continue
        with pytest.raises(InputError, match=naming("ball", "8100 Hz", "8000 Hz")):
            opened(tmp_path / "a.mat")
    # Times are nearer than the header of the file.
    scipy.io.savemat(tmp_path / "a.mat", {"ball": arrays, "Fs": 4000.0})
    assert read_all(tmp_path / "a.mat")[0].sample_rate == pytest.approx(8000)


def test_rounded_times_are_told(tmp_path: Path) -> None:
    rows = "".join(f"{i / 44100:.6f},{v:g}\n" for i, v in enumerate(half_sine(44100.0)))
    (tmp_path / "t.csv").write_text("time_s,force_N\n" + rows)
    (signal,) = opened(tmp_path / "t.csv")
    # Of 1764 times rounded to 1 us the slope is off by 1e-6 sqrt(1 / 1764**3) steps and more.
    assert signal.sample_rate == pytest.approx(44100, rel=4e-6)
    (note,) = signal.notes
    assert (note.code, note.value) == ("times_rounded", pytest.approx(0.5, rel=0.1))


def table_of(row: Callable[[int, float, float], str]) -> str:
    """Return the lines of a table from row, time and force."""
    pulse = half_sine(8000.0)
    return "".join(row(i, i / 8000, v) + "\n" for i, v in enumerate(pulse))


@pytest.mark.parametrize(
    ("head", "row", "words"),
    [
        # A cell that cannot be read makes no column one of words.
        ("t;F [N];G [N]\n", lambda i, t, v: f"{t:.6f};{'' if i else '---'}{v:.1f};{v:.1f}",
         naming("line 3", "column 2", "line 2")),
        ("t;F [N];state\n", lambda i, t, v: f"{t:.6f};{v:.1f};{'5' if i == 6 else 'ok'}",
         naming("line 8", "column 3", 5, "line 2")),
        # No row above the first number is left out.
        ("t;F [N]\n", lambda i, t, v: f"{t:.6f};{v:.1f}" if i > 4 else f"{t:.6f};---",
         naming("line 2", "'---'")),
        ("t;F [N]\n", lambda i, t, v: f"{t:.6f};{v:.1f}" if i > 4 else f"---;{v:.1f}",
         naming("line 2", "'---'")),
        # Commas that separate and are decimal marks.
        ("t,F\n", lambda _, t, v: f"{t:.6f},{v:.1f}".replace(".", ","),
         naming("line 1", "2 titles", "4 columns")),
        ("", lambda _, t, v: f"{t:.6f},{v:.1f}".replace(".", ","),
         naming("line 1", "decimal marks")),
        ("fs: 8000\n", lambda _, _t, v: f"{v:.0f},{v / 2:.0f}", naming("line 2", "decimal marks")),
        ("fs: 8000\nunit: N\n", lambda _, _t, v: f"{v:.3f}".replace(".", ","),
         naming("line 3", "decimal marks", "semicolons")),
        ("fs: 8000\n", lambda _, _t, v: f"{v:.0f},-1,-2", naming("line 2", "decimal marks")),
        ("fs: 8000\n", lambda _, _t, v: f'"{1 + v // 10:.0f}.000"',
         naming("line 2", "'1.000'", 1000)),
        ("a,b\n", lambda i, _, v: f'"{i}","{1 + v // 10:.0f}.000"',
         naming("line 2", "'1.000'", 1000)),
        # The rate of the header has either mark.
        ("fs: 51,200 kHz\nF\n", lambda _, _t, v: f"{v:.0f}", naming("sample rate")),
    ],
)  # fmt: skip
def test_tables_that_may_be_read_in_two_ways_are_refused(
    head: str, row: Callable[[int, float, float], str], words: str, tmp_path: Path
) -> None:
    (tmp_path / "t.csv").write_text(head + table_of(row))
    assert re.search(words, refusal(tmp_path / "t.csv"))


@pytest.mark.parametrize(
    "text",
    [
        "fs: 8000\nF [N];\n" + table_of(lambda _, _t, v: f"{v:.3f};".replace(".", ",")),
        "fs: 8000\nF [N],G\n" + table_of(lambda _, _t, v: f"{v:.0f},0"),
        "fs: 8.000 Hz\n" + table_of(lambda _, _t, v: f"{v:.3f};".replace(".", ",")),
    ],
)
def test_commas_between_numbers(text: str, tmp_path: Path) -> None:
    (tmp_path / "t.csv").write_text(text)
    signal, force = read_all(tmp_path / "t.csv", channel=1)
    assert signal.sample_rate == 8000
    np.testing.assert_allclose(force, half_sine(8000.0), atol=0.5)


def test_date_of_a_broadcast_file(tmp_path: Path) -> None:
    path = write_pulse(tmp_path, "pcm24.wav")
    data = path.read_bytes()
    extra = broadcast_chunk("2024-05-06", "10:11:12")
    total = struct.pack("<I", len(data) - 8 + len(extra))
    path.write_bytes(data[:4] + total + data[8:12] + extra + data[12:])
    (signal,) = opened(path, calibration="5000 N/FS")
    assert signal.date == "2024-05-06 10:11:12"


def test_damage_behind_the_samples_is_no_matter(tmp_path: Path) -> None:
    path = write_pulse(tmp_path, "pcm24.wav")
    path.write_bytes(path.read_bytes() + b"LIST" + struct.pack("<I", 10**6) + b"abc")
    assert read_pulse(path)[1].max() == pytest.approx(1500, rel=1e-6)


@pytest.mark.parametrize("key", ["scale_factor", "add_offset"])
@pytest.mark.parametrize(
    "value", [math.nan, math.inf, "two", "0.5 N", [1.0, 2.0], h5py.Empty("f8"), 0.0]
)
def test_scaling_that_is_no_number_is_refused(key: str, value: object, tmp_path: Path) -> None:
    path = write_pulse(tmp_path, "plate.nc")
    with h5py.File(path, "r+") as file:
        file["force"].attrs[key] = value
    if (key, value) == ("add_offset", 0.0):
        assert read_all(path)[1].max() == pytest.approx(PEAK)
        return
    assert re.search(naming("plate.nc", key), refusal(path))


def test_empty_attributes_are_no_matter(tmp_path: Path) -> None:
    path = write_pulse(tmp_path, "plate.nc")
    with h5py.File(path, "r+") as file:
        file.attrs["comment"] = h5py.Empty("S1")
    assert read_all(path)[1].max() == pytest.approx(PEAK)


def test_flac_without_a_length_is_refused(tmp_path: Path) -> None:
    path = write_pulse(tmp_path, "pcm16.flac")
    data = bytearray(path.read_bytes())
    # The last 36 bits before the checksum of the first block, behind a mark and a head of 4 bytes.
    data[21] &= 0xF0
    data[22:26] = bytes(4)
    path.write_bytes(data)
    assert "samples" in refusal(path)


@pytest.mark.parametrize("kind", ["int64", "uint64", "float32", "int8"])
def test_matrices_of_other_numbers(kind: str, tmp_path: Path) -> None:
    force = np.rint(half_sine(8000.0) / (20 if kind == "int8" else 1)).astype(kind)
    path = tmp_path / "plate.mat"
    scipy.io.savemat(path, {"Force": force, "Fs": 8000.0})
    (signal,) = opened(path, calibration=5.0, unit="V")
    np.testing.assert_array_equal(signal.read(0, signal.n_sample), 5.0 * force)


def test_universal_file_of_single_precision(tmp_path: Path) -> None:
    path = write_pulse(tmp_path, "text.uff")
    head = path.read_text().splitlines()[:13]
    head[8] = head[8].replace("         4", "         2", 1)
    force = half_sine(8000.0)
    rows = ["".join(f"{v:13.5e}" for v in force[i : i + 6]) for i in range(0, len(force), 6)]
    path.write_text("\n".join([*head, *rows, "    -1", ""]))
    np.testing.assert_allclose(read_all(path)[1], force, rtol=1e-5, atol=1e-9)


@pytest.mark.parametrize("shape", [(-1, 1), (1, -1), (-1, 2), (2, -1)])
@pytest.mark.parametrize("kind", ["h5", "mat"])
def test_columns_of_a_matrix(shape: tuple[int, int], kind: str, tmp_path: Path) -> None:
    force = half_sine(8000.0)
    count = max(shape)
    matrix = np.stack([force] * count, axis=1 if shape[0] < 0 else 0) * np.arange(
        1, count + 1
    ).reshape((1, -1) if shape[0] < 0 else (-1, 1))
    path = tmp_path / f"plate.{kind}"
    if kind == "mat":
        scipy.io.savemat(path, {"F": matrix, "dt": 1 / 8000})
    else:
        with h5py.File(path, "w") as file:
            file["F"], file["dt"] = matrix, 1 / 8000
    signal, found = read_all(path, channel=count)
    np.testing.assert_array_equal(found, force * count)
    assert signal.sample_rate == 8000
    assert signal.name == (f"plate.{kind}, F[2]" if count > 1 else f"plate.{kind}")


# --- files that are refused


def refusal(path: Path, **given: Any) -> str:  # noqa: ANN401
    """Return the sentence by which a file is refused."""
    if path.name.startswith("pcm"):
        given = {"calibration": 5000.0, **given}
    begin = time.monotonic()
    with pytest.raises(InputError) as caught:
        opened(path, **given)
    assert time.monotonic() - begin < 5
    text = str(caught.value)
    assert path.name[:40] in text or not path.name.isprintable()
    assert text.isprintable()
    return text


@pytest.mark.parametrize("name", WRITERS)
@pytest.mark.parametrize("share", [0.02, 0.3, 0.7, 0.999])
def test_cut_off_files_are_refused(name: str, share: float, tmp_path: Path) -> None:
    path = write_pulse(tmp_path, name)
    data = path.read_bytes()
    path.write_bytes(data[: int(share * len(data))])
    if WITH_UNIT.get(name) and path.suffix in {".csv", ".tsv", ".txt", ".lvm"}:
        # A table that ends early is one: it may be refused for what is left, or read.
        try:
            opened(path)
        except InputError as error:
            assert name in str(error)
        return
    refusal(path)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("name", [name for name in WRITERS if not name.startswith("pcm")])
def test_values_that_are_not_finite_are_refused(name: str, value: float, tmp_path: Path) -> None:
    force = half_sine(8000.0)
    force[100] = value
    if name in {"text.uff", "binary.uff"}:
        path = write_pulse(tmp_path, name)
        data = path.read_bytes()
        exact = half_sine(8000.0)[100]
        old, new = (
            (struct.pack("<d", exact), struct.pack("<d", value))
            if name == "binary.uff"
            else (f"{exact:20.11e}".encode(), f"{value:20.11e}".encode())
        )
        assert old in data
        path.write_bytes(data.replace(old, new))
    else:
        path = write_pulse(tmp_path, name, force)
    assert re.search(naming("sample 101", "finite"), refusal(path))


@pytest.mark.parametrize("cell", ["-1.#IND", "1.#QNAN", "1.#INF", "1,#INF00"])
def test_values_that_are_not_finite_as_programs_of_microsoft_write_them(
    cell: str, tmp_path: Path
) -> None:
    lines = [f"{i / 8000:.6f};{force:.3f}" for i, force in enumerate(half_sine(8000.0))]
    lines[100] = f"0.012500;{cell}"
    path = tmp_path / "plate.csv"
    path.write_text("\n".join(["Time [s];Force [N]  # INFO", *lines]), encoding="utf-8")
    assert re.search(naming("line 102", cell, "not a number"), refusal(path))


def test_what_is_no_file_is_refused(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.wav")
    (tmp_path / "loop.wav").symlink_to(tmp_path / "loop.wav")
    (tmp_path / "empty.wav").touch()
    assert "no regular file" in refusal(tmp_path)
    assert "pipe.wav" in refusal(tmp_path / "pipe.wav")
    assert "/dev/zero" in refusal(tmp_path.joinpath("/dev/zero"))
    assert "loop.wav" in refusal(tmp_path / "loop.wav")
    assert "none.wav" in refusal(tmp_path / "none.wav")
    assert "empty" in refusal(tmp_path / "empty.wav")
    refusal(tmp_path / "a\0b.wav")
    refusal(tmp_path / ("a" * 5000))


@pytest.mark.skipif(os.geteuid() == 0, reason="root reads every file")
def test_unreadable_files_are_refused(tmp_path: Path) -> None:
    path = write_pulse(tmp_path, "float.wav")
    path.chmod(0)
    assert "Permission denied" in refusal(path)


def test_names_that_are_no_text(tmp_path: Path) -> None:
    path = write_pulse(tmp_path, "plate.h5")
    odd = path.with_name(os.fsdecode(b"pl\xe4tte.h5"))
    path.rename(odd)
    (signal,) = opened(odd)
    assert signal.name == "pl\N{REPLACEMENT CHARACTER}tte.h5"
    assert len(signal.checksum) == 64
    for name in ("pcm24.wav", "plate.tdms", "plain.mat", "text.uff", "comma.csv"):
        path = write_pulse(tmp_path, name)
        odd = path.with_name(os.fsdecode(b"\xff") + name)
        path.rename(odd)
        assert read_pulse(odd)[1].max() > 1490


@pytest.mark.parametrize("name", WRITERS)
def test_a_tail_of_zeros_takes_no_time(name: str, tmp_path: Path) -> None:
    path = write_pulse(tmp_path, name)
    _, force = read_pulse(path)
    os.truncate(path, 2**32)
    begin = time.monotonic()
    try:
        np.testing.assert_array_equal(read_pulse(path)[1], force)
    except InputError as error:
        assert name in str(error)
    assert time.monotonic() - begin < 5


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"\0" * 10000, "WAV"),
        (b"time,force\n1,2\n", "WAV"),
        (b"CDF\x01" + bytes(100), "NetCDF 4"),
        (b"PK\x03\x04" + bytes(100), "CSV"),
        (b"RIFF\xff\xff\xff\xffWAVE", "data"),
        (b"fLaC" + bytes(100), "FLAC"),
        (b"TDSm" + bytes(100), "TDMS"),
        (b"\x89HDF\r\n\x1a\n" + bytes(100), "HDF5"),
        (b"MATLAB 5.0".ljust(124) + b"\0\1IM", "MATLAB|vector"),
        (b"    -1\n    58\n    -1\n", "universal|time history"),
    ],
)
def test_contents_are_told(content: bytes, words: str, tmp_path: Path) -> None:
    (tmp_path / "x.wav").write_bytes(content)
    assert re.search(words, refusal(tmp_path / "x.wav"))


@pytest.mark.parametrize("kind", ["ULAW", "ALAW", "IMA_ADPCM", "MS_ADPCM"])
def test_lossy_sound_is_refused(kind: str, tmp_path: Path) -> None:
    soundfile.write(tmp_path / "pcm.wav", half_sine(8000.0) / 5000, 8000, kind)
    assert kind in refusal(tmp_path / "pcm.wav")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", naming("empty")),
        ("a,b\nc,d\n", naming("numbers")),
        ("time;force\n0;0\n1;2 N\n", naming("line 3", "'2 N'")),
        ("0.5,1,5,2\n0.5,2,5\n", naming("line 2", 3, 4)),
        ("1.5,0\n2,\n", naming("line 2", "''")),
        ("0;1\n1;2\n", naming("2 rows")),
        ("".join(f"{i**2};1\n" for i in range(9)), naming("row", "1.2")),
        ("".join(f"{-i};1\n" for i in range(9)), naming("-1 s", "1000 s")),
        ("".join("0;1\n" for _ in range(9)), naming("0 s", "1000 s")),
        ("".join(f"{i};1\n" for i in range(9)), naming("rate", "sample_rate")),
        ("".join(f"{i / 8000},7\n" for i in range(9)), naming("samples", 7)),
        ("F_N\n" + "".join(f"{i}\n" for i in range(9)), naming("sample_rate")),
        ("x" * 100_000, naming("line 1", "65536 characters")),
        ("head\n" * 3000 + "1,2\n", naming("numbers")),
        ("1,2\n\0\n", naming("text")),
        ("1e999;2\n" * 9, naming("finite")),
    ],
)
def test_useless_tables_are_told(text: str, words: str, tmp_path: Path) -> None:
    (tmp_path / "plate.csv").write_text(text)
    assert re.search(words, refusal(tmp_path / "plate.csv"))


def test_long_tables_are_refused(tmp_path: Path) -> None:
    path = write_pulse(tmp_path, "comma.csv")
    path.write_bytes(b"1,2\n" * 2**20 * 65)
    assert "260 MiB" in refusal(path)


@pytest.mark.parametrize("packed", [False, True])
def test_matlab_structures_are_read(packed: bool, tmp_path: Path) -> None:  # noqa: FBT001
    force, path = half_sine(48000.0), tmp_path / "ball.mat"
    times = np.arange(len(force)) / 8000
    lab = {
        "unit": "N",
        "one": {"Force": force, "Fs": 48000.0},
        "two": {"Force": force[::-1], "t": times},
    }
    scipy.io.savemat(path, {"lab": lab, "Fs": 51200.0}, do_compression=packed)
    one, two = opened(path)
    assert [one.sample_rate, two.sample_rate] == pytest.approx([48000.0, 8000.0])
    np.testing.assert_array_equal(one.read(0, one.n_sample), force)
    np.testing.assert_array_equal(two.read(0, two.n_sample), force[::-1])
    (chosen,) = opened(path, channel="lab/two/Force")
    assert chosen.sample_rate == two.sample_rate
    many = np.zeros(2, dtype=[("Force", "O")])
    many["Force"][:] = [force, force]
    scipy.io.savemat(path, {"lab": many}, do_compression=packed)
    assert re.search(naming("lab", "array", "structures"), refusal(path))


def test_packed_matlab_bombs_are_refused(tmp_path: Path) -> None:
    """A quarter of a gibibyte of zeros in a quarter of a mebibyte."""
    path = write_pulse(tmp_path, "packed.mat")
    packer = zlib.compressobj(9)
    begin = struct.pack("<IIIIIIIIIIII", 14, 2**28 + 56, 6, 8, 6, 0, 5, 8, 1, 2**25, 1, 2**16 + 70)
    packed = packer.compress(begin) + b"".join(packer.compress(bytes(2**20)) for _ in range(256))
    packed += packer.flush()
    path.write_bytes(path.read_bytes()[:128] + struct.pack("<II", 15, len(packed)) + packed)
    assert "128 MiB" in refusal(path)


def test_hdf5_links_are_not_followed_far(tmp_path: Path) -> None:
    path = write_pulse(tmp_path, "plate.h5")
    with h5py.File(path, "a") as file:
        file["plate/self"] = file["plate"]
        file["loop"] = h5py.SoftLink("/loop")
    assert read_all(path)[1].max() > 1490
    with h5py.File(tmp_path / "link.h5", "w") as file:
        file["force"] = h5py.ExternalLink("/etc/passwd", "/")
    assert "no vector" in refusal(tmp_path / "link.h5")
    with h5py.File(tmp_path / "outside.h5", "w") as file:
        file.create_dataset("force", (10,), "u1", external=[("/etc/passwd", 0, 10)])
    assert "another file" in refusal(tmp_path / "outside.h5")
    layout = h5py.VirtualLayout((10,), "f8")
    layout[:] = h5py.VirtualSource("other.h5", "x", (10,))
    with h5py.File(tmp_path / "virtual.h5", "w") as file:
        file.create_virtual_dataset("force", layout)
    assert "another file" in refusal(tmp_path / "virtual.h5")


@pytest.mark.parametrize(
    ("name", "at", "claimed"),
    [
        ("plain.mat", 132, struct.pack("<I", 2**31)),
        *product(
            ["plate.tdms"], [12, 20], [struct.pack("<Q", n) for n in (2**40, 2**63, 2**64 - 1)]
        ),
    ],
)
def test_absurd_lengths_are_refused(name: str, at: int, claimed: bytes, tmp_path: Path) -> None:
    path = write_pulse(tmp_path, name)
    data = bytearray(path.read_bytes())
    data[at : at + len(claimed)] = claimed
    path.write_bytes(data)
    refusal(path)


def test_absurd_counts_of_tdms_are_refused(tmp_path: Path) -> None:
    path = write_pulse(tmp_path, "plate.tdms")
    data = path.read_bytes()
    count = struct.pack("<Q", 107)
    assert count in data
    path.write_bytes(data.replace(count, struct.pack("<Q", 2**60)))
    refusal(path)


def test_long_recordings_are_read_in_bounded_memory(tmp_path: Path) -> None:
    """Five minutes at 51.2 kHz, 123 MB as numbers."""
    path = tmp_path / "long.wav"
    noise = np.random.default_rng(1).normal(0, 1e-4, 51200)
    noise[1000:2024] += half_sine(51200.0, 0.0, 0.0) / 5000
    with soundfile.SoundFile(path, "w", 51200, 1, "PCM_16") as file:
        for _ in range(300):
            file.write(noise)
    tracemalloc.start()
    (signal,) = opened(path, calibration="5000 N/FS")
    for start in range(0, signal.n_sample, 2**18):
        signal.read(start, min(signal.n_sample, start + 2**18))
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert signal.n_sample == 300 * 51200
    # Three blocks of 2**18 samples: of the library, of the column, in newtons.
    assert most < 3 * 2**21 + 3e6


def test_files_that_change_are_told(tmp_path: Path) -> None:
    path = write_pulse(tmp_path, "float.wav")
    (signal,) = opened(path)
    write_pulse(tmp_path, "float.wav", half_sine(8000.0)[:-50])
    with pytest.raises(InputError, match=naming("float.wav")):
        signal.read(200, 320)


def test_missing_packages_are_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write_pulse(tmp_path, "plate.tdms")
    monkeypatch.setitem(__import__("sys").modules, "nptdms", None)
    with pytest.raises(InputError, match=naming("nptdms", "pip install")):
        opened(path)


# --- the examples


def test_tables_of_the_examples_are_those_of_the_sounds() -> None:
    folder = REPOSITORY / "inputs/recordings"
    for number in range(1, 6):
        _, table = read_all(folder / f"drop_{number}.csv")
        sound, force = read_all(folder / f"drop_{number}.wav", calibration=5000.0)
        begin = round(0.11 * sound.sample_rate)
        np.testing.assert_allclose(table, force[begin : begin + table.size], atol=0.006)


# --- arrays, calibration records, configuration


def test_arrays_are_signals() -> None:
    signal = Signal.from_array([0.0, 1.0, 2.0], 8000, name="model")
    np.testing.assert_array_equal(signal.read(1, 3), [1.0, 2.0])
    assert (signal.name, signal.n_sample, signal.full_scale) == ("model", 3, None)
    assert signal.checksum == Signal.from_array([0, 1, 2], 8000).checksum
    for force, rate in (([[1.0]], 8000), ([np.nan], 8000), ([1.0], 0), ([1.0], np.inf), (["a"], 1)):
        with pytest.raises(InputError, match=r"recording|sample_rate"):
            Signal.from_array(force, rate)


def test_calibration_does_not_depend_on_the_blocks_that_are_read(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    values = np.repeat([0.0, 1.0, 0.0], 20_003) + np.random.default_rng(1).normal(0, 0.01, 60_009)
    record = Signal.from_array(values, 5000.0)
    found = calibrate(record, force=10.0, unit="V")
    monkeypatch.setattr(calibration, "BLOCK", 1000)
    assert calibrate(record, force=10.0, unit="V") == found


def test_calibration_record_of_a_file(tmp_path: Path) -> None:
    level = np.zeros(20_000)
    level[8000:] = 0.1
    level += np.random.default_rng(3).normal(0, 1e-4, level.size)
    soundfile.write(tmp_path / "c.wav", level, 8000, "PCM_24")
    found = calibrate(tmp_path / "c.wav", force=500.0)
    assert float(found.chain.split()[0]) == pytest.approx(5000, rel=1e-3)
    assert found.chain.endswith(" N/FS")
    (signal,) = opened(write_pulse(tmp_path, "pcm24.wav"), calibration=found)
    assert signal.calibration_uncertainty == found.uncertainty
    assert "1 step of 500 N in " in signal.calibration


NOISE = np.random.default_rng(1).normal(size=9000)


@pytest.mark.parametrize(
    ("values", "given", "words"),
    [
        (np.zeros(1000), {"force": 10.0, "unit": "V"}, naming("recording", "step")),
        (np.arange(1000.0), {"force": 10.0, "mass": 1.0, "unit": "V"}, naming("force", "mass")),
        (np.arange(1000.0), {"unit": "V"}, naming("force", "mass")),
        (np.arange(1000.0), {"force": -1.0, "unit": "V"}, naming("force", "-1.0")),
        (np.arange(1000.0), {"force": math.nan, "unit": "V"}, naming("force", "nan")),
        (np.arange(1000.0), {"force": 1.0}, naming("unit")),
        (np.arange(3.0), {"force": 1.0, "unit": "V"}, naming("recording", "step")),
        (NOISE, {"force": 1.0, "unit": "V"}, naming("recording", "step")),
    ],
)
def test_useless_calibration_records(
    values: NDArray[np.float64], given: dict[str, Any], words: str
) -> None:
    with pytest.raises(InputError, match=words):
        calibrate(Signal.from_array(values, 5000.0), **given)


def stepped(*plateaus: tuple[float, int]) -> Signal:
    """Return a record of levels, V, and their numbers of samples."""
    levels, counts = zip(*plateaus, strict=True)
    return Signal.from_array(np.repeat(levels, counts), 5000.0)


def test_knock_on_a_loaded_plate_is_no_step() -> None:
    # Two of a thousand means, three times as high as the step.
    found = calibrate(stepped((0.0, 500), (1.0, 248), (4.0, 2), (1.0, 250)), force=500.0, unit="V")
    assert found.origin.startswith("1 step of 500 N")
    assert float(found.chain.split()[0]) == pytest.approx(500, rel=4 * found.uncertainty)


@pytest.mark.parametrize("left", [0.21, 0.235])
def test_steps_that_differ_by_a_fifth_are_no_calibration(left: float) -> None:
    """Steps of 1 and 1 + d: the standard error of their mean, 1 + d/2, is d/2; a tenth is known."""
    record = stepped((0.0, 100), (1.0, 100), (-left, 100))
    error = left / 2 / (1 + left / 2)
    if error < 0.1:
        found = calibrate(record, force=500.0, unit="V", uncertainty=0.02)
        assert found.uncertainty == pytest.approx(math.hypot(error, 0.02))
    else:
        with pytest.raises(InputError, match=naming("step", "10%")):
            calibrate(record, force=500.0, unit="V")


LAB = """
laboratory = "Acoustics laboratory"
ball = "rubber ball"
serial = "RB-07"
temperature = 21.5
instruments = ["force plate 9281", "charge amplifier 5015"]
channel = 1
unit = "V"
calibration = "4.1 pC/N, 10 mV/pC"
calibration_uncertainty = 0.005
polarity = "negative"
mass = 2.5
height = 1.0
[plate]
f0 = 950.0
Q = 30.0
linearity = [[100.0, 101.0], [1000.0, 990.0]]
f0_uncertainty = 0.01
[limits]
octave_500 = [10.0, 15.0]
"""
PLATE = LAB[LAB.index("[plate]") : LAB.index("[limits]")]


def test_configuration_is_read(tmp_path: Path) -> None:
    (tmp_path / "lab.toml").write_text(LAB)
    found = read_config(tmp_path / "lab.toml")
    assert found.calibration == Calibration("4.1 pC/N, 10 mV/pC")
    assert found.calibration_uncertainty == 0.005
    names = [entry.name for entry in found.instruments]
    assert names == ["force plate 9281", "charge amplifier 5015"]
    assert found.plate == Plate(950.0, 30.0, 0.01, linearity=((100.0, 101.0), (1000.0, 990.0)))
    assert found.limits == {"octave_500": (10.0, 15.0)}
    assert (found.channel, found.unit, found.polarity) == (1, "V", "negative")


@pytest.mark.parametrize(
    "kind", [Config, Plate, RecorderFilter, ReportConfig, Properties, Instrument]
)
def test_every_key_of_a_configuration_is_documented(kind: type) -> None:
    pages = "".join(
        (REPOSITORY / f"docs/{name}.md").read_text() for name in ("recordings_reading", "report")
    )
    keys = [entry.name for entry in fields(kind)]
    assert [key for key in keys if f"`{key}`" not in pages and f"[{key}]" not in pages] == []


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("laboratory", "labratory", naming("'labratory'", "laboratory")),
        ("f0 = 950.0", "fo = 950.0", naming("plate", "'fo'", "f0")),
        ("Q = 30.0", "", naming("plate", "Q")),
        ("octave_500", "octave_50", naming("octave_50", "octave_500")),
        ("[10.0, 15.0]", "[15.0, 10.0]", naming("octave_500", "minimum", "maximum")),
        ("[10.0, 15.0]", "12.0", naming("octave_500", "minimum", "maximum")),
        ("21.5", '"warm"', naming("temperature", "'warm'")),
        ("21.5", "nan", naming("temperature", "nan")),
        ("0.005", "-0.1", naming("calibration_uncertainty", -0.1)),
        ('"V"', '"W"', naming("unit", "'W'")),
        ('"4.1 pC/N, 10 mV/pC"', '"4.1 pC"', naming("calibration", "'4.1 pC'")),
        ('"4.1 pC/N, 10 mV/pC"', "true", naming("calibration", "True")),
        ('"4.1 pC/N, 10 mV/pC"', "[[1, 2], 3]", naming("calibration", "[1, 2]")),
        ('"4.1 pC/N, 10 mV/pC"', "{}", naming("calibration", "{}")),
        (PLATE, "[filter]\n", naming("filter", "kind")),
        ('"negative"', '"down"', naming("polarity", "'down'", "'negative'")),
        ("channel = 1", "channel = 0", naming("channel", 0)),
        ("channel = 1", "channel = 1.5", naming("channel", 1.5)),
        ('"RB-07"', "7", naming("serial", 7)),
        ("= 2.5", "= ", naming("TOML")),
        (PLATE, "plate = 3\n", naming("plate", 3)),
    ],
)
def test_configurations_that_are_wrong_are_told(
    old: str, new: str, words: str, tmp_path: Path
) -> None:
    assert old in LAB
    (tmp_path / "lab.toml").write_text(LAB.replace(old, new, 1))
    with pytest.raises(InputError, match=words) as caught:
        read_config(tmp_path / "lab.toml")
    assert "\n" not in str(caught.value)


EXCEL = datetime(2026, 11, 23, 9, 58, 59, 980000)  # noqa: DTZ001 - spreadsheets have no time zone


@pytest.mark.parametrize(
    ("title", "shown"),
    [
        ("Datum;Kraft [kN]", "%d.%m.%Y %H:%M:%S,%f"),
        ("Datum;Uhrzeit;Kraft [kN]", "%d.%m.%Y;%H:%M:%S,%f"),
        ("Time;Force [kN]", "%H:%M:%S.%f"),
        ("Date;Force [kN]", "%Y-%m-%d %H:%M:%S.%f"),
        ("Timestamp;Force [kN]", "%Y-%m-%dT%H:%M:%S.%fZ"),
        ("Date;Force [kN]", "%m/%d/%Y %I:%M:%S.%f %p"),
        ("Date;Force [kN]", "%M:%S.%f"),
    ],
)
def test_dates_and_times_of_day_show_no_rate(title: str, shown: str, tmp_path: Path) -> None:
    force = 1e-3 * half_sine(8000.0)
    mark = "," if ",%f" in shown else "."
    path = tmp_path / "excel.csv"
    rows = (
        (EXCEL + timedelta(seconds=i / 8000)).strftime(shown) + f";{value:.6f}".replace(".", mark)
        for i, value in enumerate(force)
    )
    path.write_text(title + "\n" + "\n".join(rows), encoding="utf-8")
    with pytest.raises(InputError, match=naming("sample rate is not known", "sample_rate")):
        read_all(path)
    signal, found = read_all(path, sample_rate=8000)
    assert signal.sample_rate == 8000
    np.testing.assert_allclose(found, 1e3 * force, atol=1e-3)


@pytest.mark.parametrize(
    ("rate", "titles", "encoding"),
    [
        ("サンプリング周波数: 8000 Hz", "力（N）", "cp932"),  # noqa: RUF001 - as printed
        ("샘플링 주파수: 8000 Hz", "충격력 (N)", "cp949"),
        ("온도: 20 ℃\n샘플링 주파수: 8000 Hz", "충격력 (N)", "cp949"),
        ("Prüfer: Müller\nAbtastrate: 8000 Hz", "Stoßkraft (N)", "latin-1"),
        ("Prüfer: Müller – Lab\nAbtastrate: 8000 Hz", "Stoßkraft (N)", "cp1252"),
    ],
)
def test_headers_are_read_in_encodings_of_spreadsheets(
    rate: str, titles: str, encoding: str, tmp_path: Path
) -> None:
    force = half_sine(8000.0)
    path = tmp_path / "drop.csv"
    rows = "\n".join(f"{value:.6f}" for value in force)
    path.write_bytes(f"{rate}\n{titles}\n{rows}".encode(encoding))
    (channel,) = read_channels(path)
    assert (channel.sample_rate, channel.unit) == (8000.0, "N")
    assert channel.name == re.split("[ （]", titles)[0]  # noqa: RUF001 - as printed


def siemens_structure(force: NDArray[np.float64], rate: float) -> dict[str, Any]:
    return {
        "x_values": {"start_value": 0.0, "increment": 1 / rate, "quantity": {"label": "s"}},
        "y_values": {"values": 1e-3 * force, "quantity": {"label": "kN"}},
    }


@pytest.mark.parametrize(
    "variables",
    [
        lambda f, t: {"ball_1_time_F": np.column_stack([t, f])},
        lambda f, t: {"ball_1_time_F": f, "ball_1_time": t},
        lambda f, t: {"ball_1_time_F": f, "ball_1_time_t": t},
        lambda f, t: {"ball_1_time_F": {"time": t, "F": f}},
        lambda f, t: {"t": t, "ball_1_time_F": f},
        lambda f, t: {"ball_1_time_F": siemens_structure(f, 1 / t[1])},
        lambda f, t: {"ball_1_time_F": f, "Fs": 1 / t[1]},
    ],
)
def test_times_of_matlab_variables_are_found(variables: Callable[..., Any], tmp_path: Path) -> None:
    force = half_sine(8000.0)
    time = np.arange(force.size) / 8000
    scipy.io.savemat(tmp_path / "ball.mat", variables(force, time))
    signal, found = read_all(tmp_path / "ball.mat")
    assert signal.sample_rate == pytest.approx(8000)
    np.testing.assert_allclose(found, force, atol=1e-9)


@pytest.mark.parametrize("is_matrix", [False, True])
def test_times_with_a_gap_are_no_channel(is_matrix: bool, tmp_path: Path) -> None:  # noqa: FBT001
    force = half_sine(8000.0)
    time = np.arange(force.size) / 8000 + 0.1 * (np.arange(force.size) > 200)
    arrays = {"F": np.column_stack([time, force])} if is_matrix else {"F": force, "t": time}
    scipy.io.savemat(tmp_path / "a.mat", arrays)
    with pytest.raises(InputError, match=naming("uniformly spaced")):
        opened(tmp_path / "a.mat", unit="N")


def test_several_times_of_one_length_show_no_rate(tmp_path: Path) -> None:
    force = half_sine(8000.0)
    index = np.arange(force.size)
    variables = {
        f"ball{k}": {"time": index / (8000 * k), "F": k * force} for k in (1, 2)
    }  # fmt: skip
    scipy.io.savemat(tmp_path / "balls.mat", variables)
    for k in (1, 2):
        signal, found = read_all(tmp_path / "balls.mat", channel=f"ball{k}/F")
        assert signal.sample_rate == pytest.approx(8000 * k)
        np.testing.assert_allclose(found, k * force, atol=1e-9)
    flat = {f"ball{k}_{key}": v for k in (1, 2) for key, v in variables[f"ball{k}"].items()}
    scipy.io.savemat(tmp_path / "balls.mat", flat)
    with pytest.raises(InputError, match=naming("ball1_F", "sample rate is not known")):
        opened(tmp_path / "balls.mat", channel="ball1_F")


@pytest.mark.parametrize(
    ("name", "calibration", "unit"),
    [
        ("float.wav", "1600", ""),
        ("float.wav", "1600 N/FS", "FS"),
        ("float.wav", "10 V/FS, 6.25 mV/N", "FS"),
        ("float.wav", "1600 N/V", "V"),
        ("float.wav", "4 pC/N, 0.15625 mV/pC", "V"),
        ("pcm24.wav", "1600", ""),
        ("german.csv", "1600", ""),
    ],
)
def test_calibration_states_the_unit_of_values_without_one(
    name: str, calibration: str, unit: str, tmp_path: Path
) -> None:
    exact = half_sine(8000.0)
    WRITERS[name](tmp_path / name, exact / FULL_SCALE, 8000.0, "V")
    signal, force = read_all(tmp_path / name, calibration=calibration)
    np.testing.assert_allclose(force, exact, atol=1e-3)
    units = [note.unit for note in signal.notes if note.code == "unit_of_calibration"]
    assert units == [unit] * bool(unit)
