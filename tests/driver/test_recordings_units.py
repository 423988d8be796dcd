"""Units, factors and scales that files state: applied or refused, never ignored."""

from __future__ import annotations

import gc
import logging
import math
import random
import re
import struct
import sys
import warnings
from itertools import product
from types import ModuleType
from typing import TYPE_CHECKING, Any

import h5py
import nptdms
import numpy as np
import pytest
import pyuff
import scipy.io
import soundfile
from conftest import REPOSITORY, naming
from recording_files import half_sine, opened

from thud.base.errors import InputError
from thud.recordings import formats
from thud.recordings.calibration import calibrate

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from numpy.typing import NDArray

RATE = 8000.0
FORCE = half_sine(RATE)
TIME = np.arange(FORCE.size) / RATE
POUND = 4.4482216152605
# Newtons per unit; None of units that are no force.
UNITS = {"": 1.0, "N": 1.0, "kN": 1e3, "lbf": POUND, "kgf": 9.80665, "V": None, "furlong": None}
FACTORS = ["", "scale_factor", "Scale Factor", "conversion", "scale", "scaling_factor", "gain",
           "Gain [dB]", "amplifier_gain", "multiplier", "slope", "channel_conversion"]  # fmt: skip
# Owners of an entry of a header: the array, its group, the file.
Entry = tuple[str, str, Any]


def write_hdf5(path: Path, values: NDArray[np.float64], entries: list[Entry]) -> None:
    with h5py.File(path, "w") as file:
        file["plate/force"] = values
        for owner, key, value in entries:
            target = {"array": file["plate/force"], "group": file["plate"], "file": file}[owner]
            if owner != "array" and len(key) % 2:
                target[key] = value
            else:
                target.attrs[key] = value


def write_matlab(path: Path, values: NDArray[np.float64], entries: list[Entry]) -> None:
    inner = {key: value for owner, key, value in entries if owner != "file"}
    outer = {key: value for owner, key, value in entries if owner == "file"}
    scipy.io.savemat(path, {"plate": {"Force": values, **inner}, **outer}, long_field_names=True)


def write_matlab_4(path: Path, values: NDArray[np.float64], entries: list[Entry]) -> None:
    header = {key: value for _, key, value in entries}
    scipy.io.savemat(path, {"Force": values, **header}, format="4")


def write_matlab_73(path: Path, values: NDArray[np.float64], entries: list[Entry]) -> None:
    with h5py.File(path, "w", userblock_size=512) as file:
        variables = {"Force": values, **{key: value for _, key, value in entries}}
        for key, value in variables.items():
            is_text = isinstance(value, str)
            codes = [ord(c) for c in value] if is_text else value
            file[key] = np.atleast_2d(np.asarray(codes, dtype="u2" if is_text else "f8")).T
            file[key].attrs["MATLAB_class"] = np.bytes_("char" if is_text else "double")
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file".ljust(124) + b"\0\2IM")


def write_tdms(path: Path, values: NDArray[np.float64], entries: list[Entry]) -> None:
    entries = [
        (owner, *(("wf_increment", 1 / value) if key == "Fs" else (key, value)))
        for owner, key, value in entries
    ]
    own, group, root = (
        {key: value for owner, key, value in entries if owner == name}
        for name in ("array", "group", "file")
    )
    with nptdms.TdmsWriter(path) as file:
        objects = [nptdms.RootObject(root), nptdms.GroupObject("plate", group)]
        file.write_segment([*objects, nptdms.ChannelObject("plate", "force", values, own)])


def write_text(path: Path, values: NDArray[np.float64], entries: list[Entry]) -> None:
    header = "".join(f"{key}: {value}\n" for _, key, value in entries)
    np.savetxt(path, values, "%.12g", header=f"{header}Force", comments="")


FORMATS: dict[str, Callable[..., None]] = {
    "t.csv": write_text,
    "a.h5": write_hdf5,
    "a.nc": write_hdf5,
    "5.mat": write_matlab,
    "4.mat": write_matlab_4,
    "73.mat": write_matlab_73,
    "a.tdms": write_tdms,
}


def read(path: Path, **stated: Any) -> NDArray[np.float64]:  # noqa: ANN401
    (signal,) = opened(path, **stated)
    assert signal.sample_rate == pytest.approx(RATE)
    return signal.read(0, signal.n_sample)


@pytest.mark.parametrize("name", FORMATS)
def test_what_a_header_states_is_applied_or_refused(name: str, tmp_path: Path) -> None:
    """Random headers around a known force, which stored values are or are not divided by."""
    chance = random.Random(name)  # noqa: S311 - draws of a test
    outcomes = {"read": 0, "refused": 0}
    for number in range(150):
        unit, factor = chance.choice(list(UNITS)), chance.choice(FACTORS)
        value = chance.choice([1.0, 0.25, 2.5, -0.5]) if "dB" not in factor else 20.0
        owner = chance.choice(["array", "group", "file"])
        if name.endswith("mat") or factor == "Gain [dB]":
            factor = factor.replace(" [", "_").replace("]", "").replace(" ", "_")
        newtons = UNITS[unit]
        entries: list[Entry] = [(chance.choice(["array", "group", "file"]), "Fs", RATE)]
        entries += [(chance.choice(["array", "group", "file"]), "unit", unit)] * bool(unit)
        entries += [(owner, factor, value)] * bool(factor)
        chance.shuffle(entries)
        is_applied = name[0] == "a" and not name.endswith("tdms") and owner == "array"
        is_known = not factor or value == 1.0 or (is_applied and factor == "scale_factor")
        is_divided = bool(factor) and (is_known or chance.random() < 0.5)
        stored = FORCE / (newtons or 1.0) / (value if is_divided else 1.0)
        path = tmp_path / f"{number}_{name}"
        FORMATS[name](path, stored, entries)
        is_right = newtons is not None and is_known
        try:
            np.testing.assert_allclose(read(path), FORCE, atol=1e-6, err_msg=str(entries))
            assert is_right, entries
            outcomes["read"] += 1
        except InputError as error:
            assert not is_right, (entries, str(error))
            outcomes["refused"] += 1
        if newtons is None or is_known:
            continue
        # A calibration is that of the stored values, and the factor is named in a note.
        (signal,) = opened(path, calibration=1500.0 / float(stored[abs(stored).argmax()]))
        np.testing.assert_allclose(signal.read(0, signal.n_sample), FORCE, atol=1e-6)
        stated = [note for note in signal.notes if note.code == "factor_not_applied"]
        assert any(factor in note.others["factor"] for note in stated)
    assert min(outcomes.values()) > 25, outcomes


@pytest.mark.parametrize(
    "key", ["date", "comment", "full_scale", "time_scale", "wf_start_offset", "sensitivity"]
)
@pytest.mark.parametrize("name", FORMATS)
def test_other_numbers_of_a_header_are_no_factors(name: str, key: str, tmp_path: Path) -> None:
    entries = [("array", "unit", "N"), ("array", "Fs", RATE), ("array", key, 2.5)]
    FORMATS[name](tmp_path / name, FORCE, entries)
    np.testing.assert_allclose(read(tmp_path / name), FORCE, atol=1e-6)


@pytest.mark.parametrize("name", FORMATS)
def test_sensitivity_without_a_unit_is_not_ignored(name: str, tmp_path: Path) -> None:
    FORMATS[name](tmp_path / name, FORCE, [("array", "Fs", RATE), ("array", "sensitivity", 4.0)])
    with pytest.raises(InputError, match=naming("sensitivity", "calibration")):
        opened(tmp_path / name)


def test_factor_and_offset_of_netcdf_are_applied(tmp_path: Path) -> None:
    path, rate = tmp_path / "a.h5", ("array", "Fs", RATE)
    scaled = [rate, ("array", "scale_factor", 0.25), ("array", "add_offset", -25.0)]
    write_hdf5(path, np.rint((FORCE + 25) / 0.25).astype("i2"), scaled)
    np.testing.assert_allclose(read(path), FORCE, atol=0.125)
    write_hdf5(path, FORCE - 25, [rate, ("array", "add_offset", 25.0)])
    np.testing.assert_allclose(read(path), FORCE, atol=1e-9)
    write_hdf5(path, FORCE - 25, [rate, ("array", "offset", 25.0)])
    with pytest.raises(InputError, match=naming("offset = 25.0")):
        opened(path)


def test_units_that_disagree_are_refused(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["Force_kN"], file.attrs["Fs"] = FORCE, RATE
        file["Force_kN"].attrs["units"] = "N"
    with pytest.raises(InputError, match=naming("N by the attribute, kN by the name", "unit =")):
        opened(tmp_path / "a.h5")
    np.testing.assert_allclose(read(tmp_path / "a.h5", unit="N"), FORCE)
    units = np.array(["s", "kN"], dtype=object)
    scipy.io.savemat(tmp_path / "a.mat", {"M": np.column_stack([TIME, FORCE]), "units": units})
    with pytest.raises(InputError, match=naming("s, kN", "unit =")):
        opened(tmp_path / "a.mat")


# Units of data set 164 per m and per N, and labels with newtons per unit.
SYSTEMS = {"none": None, "SI": (1.0, 1.0), "IN": (39.37007874, 0.2248089431)}
LABELS = {"NONE": 0.0, "N": 1.0, "kN": 1e3, "lbf": POUND, "V": None, "m/s2": None}


@pytest.mark.parametrize("binary", [0, 1])
@pytest.mark.parametrize("kind", [0, 9, 13, 12])
@pytest.mark.parametrize(("system", "label"), list(product(SYSTEMS, LABELS)))
def test_units_of_universal_files_are_applied_or_refused(
    system: str, label: str, kind: int, binary: int, tmp_path: Path
) -> None:
    units, newtons = SYSTEMS[system], LABELS[label]
    by_system = 1 / units[1] if units else 1.0
    size = newtons or by_system
    record = {
        "type": 58, "binary": binary, "func_type": 1, "data": FORCE / size, "x": TIME,
        "rsp_node": 1, "rsp_dir": 3, "ref_node": 1, "ref_dir": 3, "abscissa_spacing": 1,
        "abscissa_spec_data_type": 17, "ordinate_spec_data_type": kind, "id1": "plate",
        "orddenom_spec_data_type": 0, "z_axis_spec_data_type": 0, "abscissa_axis_units_lab": "s",
        "ordinate_axis_units_lab": label,
    }  # fmt: skip
    head = {"type": 164, "units_code": 9, "temp": 1.0, "temp_offset": 0.0}
    sets = [{**head, "length": units[0], "force": units[1]}] if units else []
    path = tmp_path / "a.uff"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ResourceWarning)  # the writer leaves a file open
        for entry in [*sets, record]:
            pyuff.UFF(str(path)).write_sets([entry], "add")
        gc.collect()
    is_force = kind in {9, 13}
    if label == "NONE":
        is_right = is_force or (kind == 0 and by_system == 1.0)
    else:
        agree = not units or not is_force or math.isclose(size, by_system, rel_tol=1e-3)
        is_right = newtons is not None and agree
    if is_right:
        (signal,) = opened(path)
        np.testing.assert_allclose(signal.read(0, signal.n_sample), FORCE, rtol=1e-6, atol=1e-6)
    else:
        with pytest.raises(InputError, match=r"unit|calibration"):
            opened(path)


def tdms_scale(kind: str) -> dict[str, Any]:
    """Return the properties of a scale by which stored values are half the force."""
    common = {"NI_Number_Of_Scales": 1, "NI_Scaling_Status": "unscaled"}
    start = "NI_Scale[0]_"
    parameters = {
        "Linear": {"Linear_Slope": 2.0, "Linear_Y_Intercept": 0.0},
        "Polynomial": {
            "Polynomial_Coefficients_Size": 2,
            "Polynomial_Coefficients[0]": 0.0,
            "Polynomial_Coefficients[1]": 2.0,
        },
    }.get(kind, {})
    own = {"Scale_Type": kind, f"{kind}_Input_Source": 0xFFFFFFFF, **parameters}
    return {**common, **{start + key: value for key, value in own.items()}}


@pytest.mark.parametrize("kind", ["Linear", "Polynomial", "PieceWisePolynomial", "Reciprocal"])
def test_scales_of_tdms_are_applied_or_refused_by_name(
    kind: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    properties = {"wf_increment": 1 / RATE, "unit_string": "N", **tdms_scale(kind)}
    entries = [("array", key, value) for key, value in properties.items()]
    write_tdms(tmp_path / "a.tdms", FORCE / 2, entries)
    if kind in {"Linear", "Polynomial"}:
        np.testing.assert_allclose(read(tmp_path / "a.tdms"), FORCE)
    else:
        with pytest.raises(InputError, match=naming("a.tdms", kind, "scale")):
            opened(tmp_path / "a.tdms")
    assert capfd.readouterr() == ("", "")
    loggers = [logging.getLogger(name) for name in logging.root.manager.loggerDict]
    assert not any(logger.filters for logger in loggers if logger.name.startswith("nptdms"))


@pytest.mark.parametrize("order", ["little", "big"])
def test_tdms_that_is_cut_off_anywhere_is_refused(order: str, tmp_path: Path) -> None:
    path = tmp_path / "a.tdms"
    properties = {"wf_increment": 1 / RATE, "unit_string": "N"}
    if order == "big":
        path.write_bytes(2 * big_endian_tdms())
    else:
        with nptdms.TdmsWriter(path) as file:
            for part in np.array_split(FORCE, 2):
                file.write_segment([nptdms.ChannelObject("plate", "force", part, properties)])
    data = path.read_bytes()
    boundary = data.rindex(b"TDSm")
    for cut in {*range(5, len(data), 97), *range(boundary + 1, boundary + 40)}:
        path.write_bytes(data[:cut])
        with pytest.raises(InputError, match=r"a\.tdms: "):
            opened(path)


def big_endian_tdms() -> bytes:
    """Return a TDMS file of one channel in newtons whose numbers are big-endian."""

    def text(value: str) -> bytes:
        return struct.pack(">I", len(value)) + value.encode()

    count, double, string = len(FORCE), 10, 0x20
    properties = text("wf_increment") + struct.pack(">Id", double, 1 / RATE)
    properties += text("unit_string") + struct.pack(">I", string) + text("N")
    index = struct.pack(">IIIQ", 20, double, 1, count)
    head = struct.pack(">I", 1) + text("/'plate'/'force'") + index + struct.pack(">I", 2)
    head += properties
    raw = FORCE.astype(">f8").tobytes()
    # Metadata, new list of objects, raw data, big-endian.
    contents = 2 + 4 + 8 + 64
    lead = b"TDSm" + struct.pack("<I", contents)
    return lead + struct.pack(">IQQ", 4713, len(head) + len(raw), len(head)) + head + raw


def matrix_73(path: Path) -> None:
    with h5py.File(path, "w") as file:
        file["M"] = np.stack([TIME, FORCE])


def big_endian_mat(version: int) -> bytes:
    content = b"MATLAB 5.0 MAT-file".ljust(124) + b"\x01\x00MI" if version == 5 else b""
    for name, values in ((b"t\0", TIME), (b"F_N\0", FORCE)):
        raw = values.astype(">f8").tobytes()
        if version == 4:
            content += struct.pack(">5i", 1000, values.size, 1, 0, len(name)) + name + raw
            continue
        # Flags (class double), shape, name and numbers, each behind its type and size.
        flags = struct.pack(">6I", 6, 8, 6, 0, 5, 8) + struct.pack(">2i", values.size, 1)
        title = struct.pack(">2I", 1, len(name) - 1) + name.rstrip(b"\0").ljust(8, b"\0")
        element = flags + title + struct.pack(">2I", 9, len(raw)) + raw
        content += struct.pack(">2I", 14, len(element)) + element
    return content


def packed_times(path: Path) -> None:
    with h5py.File(path, "w") as file:
        file["force"], file["time"] = FORCE, np.arange(FORCE.size)
        file["force"].attrs["units"] = "N"
        file["time"].attrs["units"], file["time"].attrs["scale_factor"] = "seconds", 1 / RATE


def test_times_with_a_factor_give_no_rate(tmp_path: Path) -> None:
    packed_times(tmp_path / "a.nc")
    with h5py.File(tmp_path / "a.nc", "r+") as file:
        file["time"].attrs["gain"] = 2.0
    with pytest.raises(InputError, match=naming("sample rate", "sample_rate")):
        opened(tmp_path / "a.nc")
    np.testing.assert_allclose(read(tmp_path / "a.nc", sample_rate=RATE), FORCE)


def nanoseconds(path: Path) -> None:
    with h5py.File(path, "w") as file:
        file["force"], file["time"] = FORCE, np.arange(FORCE.size) * 125_000
        file["time"].attrs["units"] = "nanoseconds since 2024-05-06"


@pytest.mark.parametrize(
    ("name", "write"),
    [
        ("a.tdms", lambda path: path.write_bytes(big_endian_tdms())),
        ("4.mat", lambda path: path.write_bytes(big_endian_mat(4))),
        ("5.mat", lambda path: path.write_bytes(big_endian_mat(5))),
        ("b.mat", matrix_73),
        ("a.nc", packed_times),
        ("b.nc", nanoseconds),
    ],
)
def test_other_layouts_are_read(name: str, write: Callable[[Path], None], tmp_path: Path) -> None:
    write(tmp_path / name)
    np.testing.assert_allclose(read(tmp_path / name), FORCE, atol=1e-9)


@pytest.mark.parametrize("length", [0xFFFFFFFF, 0x7FFFF000, 0x7FFFFF00])
@pytest.mark.parametrize("kind", ["PCM_16", "PCM_24", "PCM_32", "FLOAT", "DOUBLE"])
def test_sound_of_a_stream_is_read_to_its_end(length: int, kind: str, tmp_path: Path) -> None:
    path = tmp_path / "a.wav"
    soundfile.write(path, FORCE / 5000, 8000, kind)
    whole = read(path, calibration=5000.0)
    data = bytearray(path.read_bytes())
    at = data.index(b"data") + 4
    data[4:8] = data[at : at + 4] = struct.pack("<I", length)
    path.write_bytes(data)
    np.testing.assert_array_equal(read(path, calibration=5000.0), whole)
    # A length that no stream begins with is a length.
    data[at : at + 4] = struct.pack("<I", 0x7FFFEFFF)
    path.write_bytes(data)
    with pytest.raises(InputError, match="cut off"):
        opened(path, calibration=5000.0)


def test_bw64_is_refused_with_what_helps(tmp_path: Path) -> None:
    soundfile.write(tmp_path / "a.wav", FORCE / 5000, 8000, "PCM_24", format="RF64")
    data = (tmp_path / "a.wav").read_bytes()
    (tmp_path / "a.wav").write_bytes(b"BW64" + data[4:])
    with pytest.raises(InputError, match=naming("a.wav", "BW64", "ffmpeg")):
        opened(tmp_path / "a.wav")


def test_calibration_of_a_file_with_a_factor_names_it(tmp_path: Path) -> None:
    level = np.repeat([0.0, 0.1], 10_000) + np.random.default_rng(3).normal(0, 1e-4, 20_000)
    entries = [("array", "Fs", RATE), ("array", "unit", "V"), ("array", "gain", 10.0)]
    write_hdf5(tmp_path / "a.h5", level, entries)
    found = calibrate(tmp_path / "a.h5", force=500.0, uncertainty=0.01)
    note = found.notes[-1]
    assert (note.code, note.others) == ("stored_values_calibrated", {"factor": "gain = 10.0"})


def test_format_is_added_by_one_file_and_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The example of docs/how_to_add.md."""
    page = (REPOSITORY / "docs/how_to_add.md").read_text().partition("## A file format")[2]
    source, line = re.findall(r"```python\n(.*?)```", page, re.DOTALL)[:2]
    module = ModuleType("thud.recordings.formats.npy")
    exec(source, module.__dict__)  # noqa: S102 - our own
    monkeypatch.setitem(sys.modules, module.__name__, module)
    (entry,) = eval(f"[{line}]", vars(formats))  # noqa: S307
    monkeypatch.setattr(formats, "FORMATS", (*formats.FORMATS[:-1], entry, formats.FORMATS[-1]))
    np.save(tmp_path / "force.npy", np.column_stack([TIME, FORCE]))
    with pytest.raises(InputError, match=naming("sample_rate")):
        opened(tmp_path / "force.npy", channel=2)
    (signal,) = opened(tmp_path / "force.npy", channel=2, sample_rate=RATE, unit="N")
    np.testing.assert_array_equal(signal.read(0, signal.n_sample), FORCE)
