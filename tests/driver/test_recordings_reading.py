"""Recordings: every format, unit and rate, and what is noted; refusals are in `refusals.toml`."""

from __future__ import annotations

import math
import os
import pickle
import re
import struct
import sys
import time
import tracemalloc
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np
import pytest
import scipy.io
import soundfile
from conftest import REPOSITORY, codes, naming, noted
from hypothesis import given, settings, strategies as st
from recording_files import (
    FORCE,
    PEAK,
    RATE,
    WITH_UNIT,
    WRITERS,
    half_sine,
    noisy,
    opened,
    recording_file,
    rows_of,
    steps,
)
from refusals.core import write

from thud.base.errors import InputError
from thud.recordings.calibration import calibrate
from thud.recordings.config import Config, Instrument, Properties, ReportConfig
from thud.recordings.force_units import Calibration
from thud.recordings.instruments import Plate, RecorderFilter
from thud.recordings.signal import Signal, find_peaks, orient

if TYPE_CHECKING:
    from numpy.typing import NDArray

pytestmark = pytest.mark.usefixtures("working_directory")
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
TIME = np.arange(FORCE.size) / RATE


def read_all(path: Path | str, **stated: Any) -> tuple[Signal, NDArray[np.float64]]:  # noqa: ANN401
    """Return the only signal of a file, and its samples; integers are of 5000 N/FS."""
    is_integer = Path(path).name.startswith("pcm")
    (signal,) = opened(path, **{"calibration": 5000.0} | stated if is_integer else stated)
    return signal, signal.read(0, signal.n_sample)


@pytest.mark.parametrize("name", WRITERS)
@given(rate=st.sampled_from(RATES), unit=st.sampled_from(list(UNITS)))
@settings(max_examples=12, deadline=None)
def test_half_sine_is_read_in_every_unit(name: str, rate: float, unit: str) -> None:
    exact, is_integer = half_sine(rate), name.startswith("pcm")
    per_newton, stated = UNITS[unit] if name in WITH_UNIT else (1.0, {"unit": "N"})
    if is_integer:
        per_newton = 1 / FULL_SCALE
        stated = {"calibration": f"10 V/FS, {10 * per_newton!r} V/N"}
    WRITERS[name](Path(name), exact * per_newton, rate, unit)
    signal, force = read_all(name, **stated)
    # Universal files hold the sampling interval to six digits.
    assert signal.sample_rate == pytest.approx(rate, rel=5e-6 if name.endswith("uff") else 1e-7)
    # Rounded or cut off to the last digit of the format.
    digit = LSB.get(name.partition(".")[0], 1e-9) * (FULL_SCALE if is_integer else PEAK)
    np.testing.assert_allclose(force, exact, rtol=0, atol=digit * 1.001)
    assert signal.n_sample == exact.size
    assert signal.full_scale == (pytest.approx(FULL_SCALE) if is_integer else None)
    assert ("N" if name not in WITH_UNIT else unit) in signal.calibration


@pytest.mark.parametrize("name", WRITERS)
def test_pieces_are_those_of_the_whole_in_other_processes_too(name: str) -> None:
    # The content determines the format.
    signal, force = read_all(recording_file(name).rename(f"{name}.bin"))
    copy = pickle.loads(pickle.dumps(signal))  # noqa: S301 - its own
    for start, stop in ((0, 1), (3, 3), (17, 130), (0, signal.n_sample)):
        np.testing.assert_array_equal(copy.read(start, stop), force[start:stop])
    np.testing.assert_allclose(force, FORCE, atol=0.2)
    assert len(signal.checksum) == 64


# --- sign, unit, rate, calibration


def test_negative_compression_is_turned_and_noted() -> None:
    path = recording_file("plate.h5", -FORCE)
    signal, force = read_all(path)
    np.testing.assert_array_equal(force, FORCE)
    note = noted(signal.notes, "sign_changed")
    assert (note.subject, note.value) == (signal.name, pytest.approx(-1500))
    np.testing.assert_array_equal(read_all(path, polarity="negative")[1], FORCE)
    # The sign of noise is not clear.
    assert orient(Signal.from_array(noisy(np.zeros(4000), 300), RATE), "positive").scale == 1


@pytest.mark.parametrize("cut", [0.0, 0.3])
@pytest.mark.parametrize("sign", [1, -1])
def test_polarity_of_a_record_without_quiet(cut: float, sign: int) -> None:
    pulse = half_sine(RATE, 0.0, 0.0)
    record = sign * pulse[: round(len(pulse) * (1 - cut))] + 3.0
    signal = orient(Signal.from_array(record, RATE))
    assert codes(signal.notes) == ["sign_changed"] * (sign < 0)
    assert signal.read(0, signal.n_sample).max() > 1490


def test_quiet_is_found_at_either_end() -> None:
    # A pulse on 500 N, the begin or the end of which is missing.
    force = 500 + 1500 * np.sin(np.linspace(0.4, np.pi, 985))
    quiet = np.full(15, 500.0)
    for record in (np.append(force, quiet), np.append(quiet, force[::-1])):
        above, below = find_peaks(Signal.from_array(record, RATE))
        assert (above, below) == (record.max() - 500, 500 - record.min())


@pytest.mark.parametrize(("opposite", "is_doubted"), [(0.98, False), (1.02, True)])
def test_polarity_is_doubted_from_half_as_much_again_on(opposite: float, is_doubted: bool) -> None:  # noqa: FBT001
    force = np.concatenate([FORCE / 1.5, -opposite * FORCE])
    signal = orient(Signal.from_array(force, RATE), "positive")
    assert codes(signal.notes) == ["polarity_doubtful"] * is_doubted
    for note in signal.notes:
        assert note.others["opposite"] == pytest.approx(-opposite * PEAK)


def test_unusual_peaks_and_what_replaces_a_header_are_noted() -> None:
    (note,) = read_all(recording_file("double.wav", 0.1 * FORCE), unit="N")[0].notes
    assert (note.code, note.low, note.high) == ("peak_unusual", 300, 15_000)
    assert note.value == pytest.approx(150)
    path = recording_file("plate.h5", FORCE / 1e3)
    signal, force = read_all(path, unit="kN", sample_rate=8001.0)
    np.testing.assert_allclose(force, FORCE)
    rate, unit = signal.notes
    assert (signal.sample_rate, signal.date) == (8001, "2024-05-06")
    assert (rate.code, rate.value, rate.others["of_file"]) == ("rate_replaced", 8001.0, 8000.0)
    assert (unit.code, unit.unit, unit.others["of_file"]) == ("unit_replaced", "kN", "N")


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
        (np.float32(5000), None, 5000.0),
        (Calibration("5 kN/FS", 0.01, "certificate 7"), None, 5000.0),
    ],
)
def test_calibrations_lead_to_newtons(
    calibration: float | str | Calibration, unit: str | None, newtons: float
) -> None:
    soundfile.write("plate.wav", FORCE / newtons, 8000, "PCM_24")
    signal, force = read_all("plate.wav", calibration=calibration, unit=unit)
    # Two digits: of the largest and of the smallest full scale.
    assert force.max() == pytest.approx(1500, rel=1e-6, abs=newtons * 2.0**-22)
    assert signal.full_scale == pytest.approx(newtons)
    known = calibration.uncertainty if isinstance(calibration, Calibration) else None
    assert signal.calibration_uncertainty == known


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
def test_calibration_states_the_unit_of_values(name: str, calibration: str, unit: str) -> None:
    WRITERS[name](Path(name), FORCE / FULL_SCALE, RATE, "V")
    signal, force = read_all(name, calibration=calibration)
    np.testing.assert_allclose(force, FORCE, atol=1e-3)
    units = [note.unit for note in signal.notes if note.code == "unit_of_calibration"]
    assert units == [unit] * bool(unit)


def test_channels_are_chosen_by_number_and_name() -> None:
    head = "t [s];Fx [N];Fz [N];Trigger [V]\n"
    path = write("t.csv", head + rows_of("{t:.6f};-{f:g};{f:g};{i}"))
    assert [signal.name for signal in opened(path)] == ["t.csv, Fx", "t.csv, Fz"]
    for channel in (3, "3", "Fz", "fz"):
        (signal,) = opened(path, channel=channel)
        assert (signal.name, signal.notes) == ("t.csv, Fz", ())


def test_rounded_times_are_noted() -> None:
    rows = "".join(f"{i / 44100:.6f},{v:g}\n" for i, v in enumerate(half_sine(44100.0)))
    (signal,) = opened(write("t.csv", "time_s,force_N\n" + rows))
    # Of 1764 times rounded to 1 us the slope is off by 1e-6 sqrt(1 / 1764**3) steps and more.
    assert signal.sample_rate == pytest.approx(44100, rel=4e-6)
    (note,) = signal.notes
    assert (note.code, note.value) == ("times_rounded", pytest.approx(0.5, rel=0.1))


# --- files of single formats


def test_broadcast_files_have_a_date_and_may_end_in_damage() -> None:
    path = recording_file("pcm24.wav")
    data, body = path.read_bytes(), bytes(320) + b"2024-05-0610:11:12".ljust(282, b"\0")
    extra = b"bext" + struct.pack("<I", len(body)) + body
    total = struct.pack("<I", len(data) - 8 + len(extra))
    path.write_bytes(data[:4] + total + data[8:12] + extra + data[12:])
    assert read_all(path)[0].date == "2024-05-06 10:11:12"
    path.write_bytes(data + b"LIST" + struct.pack("<I", 10**6) + b"abc")
    np.testing.assert_allclose(read_all(path)[1], FORCE, atol=1e-3)


def test_empty_attributes_and_circular_links_of_hdf5_are_no_matter() -> None:
    path = recording_file("plate.nc")
    with h5py.File(path, "r+") as file:
        file.attrs["comment"], file["force"].attrs["add_offset"] = h5py.Empty("S1"), 0.0
        file["self"], file["loop"] = file["/"], h5py.SoftLink("/loop")
    np.testing.assert_array_equal(read_all(path)[1], FORCE)


@pytest.mark.parametrize("kind", ["int64", "uint64", "float32", "int8"])
def test_matrices_of_other_numbers(kind: str) -> None:
    force = np.rint(FORCE / (20 if kind == "int8" else 1)).astype(kind)
    scipy.io.savemat("plate.mat", {"Force": force, "Fs": RATE})
    _, found = read_all("plate.mat", calibration=5.0, unit="V")
    np.testing.assert_array_equal(found, 5.0 * force)


def test_universal_file_of_single_precision() -> None:
    path = recording_file("text.uff")
    head = path.read_text().splitlines()[:13]
    head[8] = head[8].replace("         4", "         2", 1)
    rows = ["".join(f"{v:13.5e}" for v in FORCE[i : i + 6]) for i in range(0, len(FORCE), 6)]
    path.write_text("\n".join([*head, *rows, "    -1", ""]))
    np.testing.assert_allclose(read_all(path)[1], FORCE, rtol=1e-5, atol=1e-9)


@pytest.mark.parametrize("count", [1, 2])
@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("kind", ["h5", "mat"])
def test_columns_of_a_matrix(count: int, axis: int, kind: str) -> None:
    matrix = np.stack([(k + 1) * FORCE for k in range(count)], axis)
    path = f"plate.{kind}"
    if kind == "mat":
        scipy.io.savemat(path, {"F": matrix, "dt": 1 / RATE})
    else:
        with h5py.File(path, "w") as file:
            file["F"], file["dt"] = matrix, 1 / RATE
    signal, found = read_all(path, channel=count)
    np.testing.assert_array_equal(found, FORCE * count)
    assert signal.sample_rate == RATE
    assert signal.name == (f"{path}, F[2]" if count > 1 else path)


@pytest.mark.parametrize("packed", [False, True])
def test_matlab_structures_are_read(packed: bool) -> None:  # noqa: FBT001
    parts = {"one": {"Force": FORCE, "Fs": 48e3}, "two": {"Force": FORCE[::-1], "t": TIME}}
    lab = {"lab": {"unit": "N", **parts}, "Fs": 51200.0}
    scipy.io.savemat("ball.mat", lab, do_compression=packed)
    one, two = opened("ball.mat")
    assert [one.sample_rate, two.sample_rate] == pytest.approx([48000.0, RATE])
    np.testing.assert_array_equal(one.read(0, one.n_sample), FORCE)
    np.testing.assert_array_equal(two.read(0, two.n_sample), FORCE[::-1])
    assert opened("ball.mat", channel="lab/two/Force")[0].sample_rate == two.sample_rate


@pytest.mark.parametrize(
    "variables",
    [
        {"ball_1_time_F": np.column_stack([TIME, FORCE])},
        {"ball_1_time_F": FORCE, "ball_1_time": TIME},
        {"ball_1_time_F": FORCE, "ball_1_time_t": TIME},
        {"ball_1_time_F": {"time": TIME, "F": FORCE}},
        {"t": TIME, "ball_1_time_F": FORCE},
        # Siemens Testlab
        {"ball_1_time_F": {
            "x_values": {"start_value": 0.0, "increment": 1 / RATE, "quantity": {"label": "s"}},
            "y_values": {"values": 1e-3 * FORCE, "quantity": {"label": "kN"}}}},
        {"ball_1_time_F": FORCE, "Fs": RATE},
        # Times are nearer than the header of the file, and a rate may be off them by 1 %.
        {"ball": {"F": FORCE, "t": TIME}, "Fs": 4000.0},
        {"ball": {"F": FORCE, "t": TIME, "Fs": 8050.0}},
        {"ball": {"F": np.column_stack([TIME, FORCE]), "Fs": 8050.0}},
        # Of two forces each has its times.
        {"ball": {"time": TIME, "F": FORCE}, "other": {"time": TIME / 2, "F": 2 * FORCE}},
    ],
)  # fmt: skip
def test_times_of_matlab_variables_are_found(variables: dict[str, Any]) -> None:
    scipy.io.savemat("ball.mat", variables)
    stated = {"channel": "ball/F"} if "other" in variables else {}
    signal, found = read_all("ball.mat", **stated)
    is_stated = "8050.0" in str(variables)
    assert signal.sample_rate == pytest.approx(8050.0 if is_stated else RATE)
    np.testing.assert_allclose(found, FORCE, atol=1e-9)


# --- damage


@pytest.mark.parametrize("name", WRITERS)
@pytest.mark.parametrize("share", [0.02, 0.3, 0.7, 0.999])
def test_cut_off_files_are_refused(name: str, share: float) -> None:
    path = recording_file(name)
    data = path.read_bytes()
    path.write_bytes(data[: int(share * len(data))])
    try:
        read_all(path)
    except InputError as error:
        assert name in str(error)
    else:  # A table that ends early is one.
        assert path.suffix in {".csv", ".tsv", ".txt", ".lvm"}


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("name", [name for name in WRITERS if not name.startswith("pcm")])
def test_values_that_are_not_finite_are_refused(name: str, value: float) -> None:
    if name.endswith("uff"):  # Their writer refuses the value.
        path = recording_file(name)
        old, new = (
            struct.pack("<d", number) if name == "binary.uff" else f"{number:20.11e}".encode()
            for number in (FORCE[100], value)
        )
        assert old in path.read_bytes()
        path.write_bytes(path.read_bytes().replace(old, new))
    else:
        recording_file(name, np.where(np.arange(FORCE.size) == 100, value, FORCE))
    with pytest.raises(InputError, match=naming(name, "sample 101", "finite")):
        opened(name)


@pytest.mark.skipif(os.geteuid() == 0, reason="root reads every file")
def test_unreadable_files_are_refused() -> None:
    path = recording_file("float.wav")
    path.chmod(0)
    with pytest.raises(InputError, match="Permission denied"):
        opened(path)


@pytest.mark.parametrize(
    "name", ["plate.h5", "pcm24.wav", "plate.tdms", "plain.mat", "text.uff", "comma.csv"]
)
def test_names_that_are_no_text(name: str) -> None:
    odd = recording_file(name).rename(os.fsdecode(b"\xff") + name)
    signal, force = read_all(odd, **{"calibration": 5000.0} if "pcm" in name else {})
    assert signal.name == f"\N{REPLACEMENT CHARACTER}{name}"
    assert len(signal.checksum) == 64
    np.testing.assert_allclose(force, FORCE, atol=1e-3)


@pytest.mark.parametrize("name", WRITERS)
def test_a_tail_of_zeros_takes_no_time(name: str) -> None:
    path = recording_file(name)
    os.truncate(path, 2**32)
    begin = time.monotonic()
    try:
        np.testing.assert_allclose(read_all(path)[1], FORCE, atol=0.2)
    except InputError as error:
        assert name in str(error)
    assert time.monotonic() - begin < 5


def test_long_recordings_are_read_in_bounded_memory() -> None:
    """Five minutes at 51.2 kHz, 123 MB as numbers."""
    noise = noisy(np.zeros(51200), 1e-4)
    noise[1000:2024] += half_sine(51200.0, 0.0, 0.0) / 5000
    with soundfile.SoundFile("long.wav", "w", 51200, 1, "PCM_16") as file:
        for _ in range(300):
            file.write(noise)
    tracemalloc.start()
    (signal,) = opened("long.wav", calibration="5000 N/FS")
    for start in range(0, signal.n_sample, 2**18):
        signal.read(start, min(signal.n_sample, start + 2**18))
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert signal.n_sample == 300 * 51200
    # Three blocks of 2**18 samples: of the library, of the column, in newtons.
    assert most < 3 * 2**21 + 3e6


def test_files_that_change_are_refused() -> None:
    (signal,) = opened(recording_file("float.wav"))
    recording_file("float.wav", FORCE[:-50])
    with pytest.raises(InputError, match=naming("float.wav")):
        signal.read(200, 320)


def test_missing_packages_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    path = recording_file("plate.tdms")
    monkeypatch.setitem(sys.modules, "nptdms", None)
    with pytest.raises(InputError, match=naming("nptdms", "pip install")):
        opened(path)


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


def test_calibration_does_not_depend_on_blocks_read(monkeypatch: pytest.MonkeyPatch) -> None:
    record = Signal.from_array(noisy(np.repeat([0.0, 1.0, 0.0], 20_003), 0.01), 5000.0)
    found = calibrate(record, force=10.0, unit="V")
    monkeypatch.setattr("thud.recordings.calibration.BLOCK", 1000)
    assert calibrate(record, force=10.0, unit="V") == found


def test_calibration_record_of_a_file() -> None:
    level = noisy(np.repeat([0.0, 0.1], [8000, 12_000]), 1e-4, 3)
    soundfile.write("c.wav", level, 8000, "PCM_24")
    found = calibrate("c.wav", force=500.0)
    assert float(found.chain.split()[0]) == pytest.approx(5000, rel=1e-3)
    assert found.chain.endswith(" N/FS")
    signal, _ = read_all(recording_file("pcm24.wav"), calibration=found)
    assert signal.calibration_uncertainty == found.uncertainty
    assert "1 step of 500 N in " in signal.calibration


def test_knock_on_a_loaded_plate_is_no_step() -> None:
    # Two of a thousand means, three times as high as the step.
    found = calibrate(steps((0.0, 500), (1.0, 248), (4.0, 2), (1.0, 250)), force=500.0, unit="V")
    assert found.origin.startswith("1 step of 500 N")
    assert float(found.chain.split()[0]) == pytest.approx(500, rel=4 * found.uncertainty)


def test_steps_that_differ_by_less_than_a_fifth_are_a_calibration() -> None:
    """Steps of 1 and 1 + d: the standard error of their mean, 1 + d/2, is d/2; a tenth is known."""
    record = steps((0.0, 100), (1.0, 100), (-0.21, 100))
    found = calibrate(record, force=500.0, unit="V", uncertainty=0.02)
    assert found.uncertainty == pytest.approx(math.hypot(0.105 / 1.105, 0.02))


# Tables of a configuration, and what they need.
KINDS: dict[type, dict[str, Any]] = {
    Config: {},
    Plate: {"f0": 950.0, "Q": 30.0},
    RecorderFilter: {"kind": "bessel", "order": 4, "cutoff": 5e3},
    ReportConfig: {},
    Properties: {},
    Instrument: {},
}
SCALARS = st.booleans() | st.integers(-2, 10**6) | st.floats() | st.text() | st.dates()
LISTS = st.lists(SCALARS | st.lists(SCALARS, max_size=3), max_size=3)
STRANGE = st.sampled_from([object(), 1j, b"x", np.array([1.0, 2.0])])
ANY_VALUE = STRANGE | SCALARS | LISTS | st.dictionaries(st.text(), SCALARS | LISTS, max_size=2)


@pytest.mark.parametrize("kind", KINDS)
@given(data=st.data())
@settings(max_examples=50, deadline=None)
def test_any_value_is_accepted_or_refused_by_its_key(kind: type, data: st.DataObject) -> None:
    key = data.draw(st.sampled_from([entry.name for entry in fields(kind)]))
    try:
        kind(**KINDS[kind] | {key: data.draw(ANY_VALUE)})
    except InputError as error:
        assert re.search(naming(key), str(error))
        assert str(error).isprintable()


@pytest.mark.parametrize("kind", KINDS)
def test_every_key_of_a_configuration_is_documented(kind: type) -> None:
    names = "recordings_reading", "report"
    pages = "".join((REPOSITORY / f"docs/{name}.md").read_text() for name in names)
    keys = [entry.name for entry in fields(kind)]
    assert [key for key in keys if f"`{key}`" not in pages and f"[{key}]" not in pages] == []
