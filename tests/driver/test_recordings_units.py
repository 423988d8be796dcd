"""Units, factors and scales that files state: applied or refused, never ignored."""

from __future__ import annotations

import logging
import math
import re
import struct
import sys
from itertools import product
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np
import pytest
import soundfile
from conftest import REPOSITORY, naming, noted
from hypothesis import given, settings, strategies as st
from recording_files import (
    FORCE,
    RATE,
    WITH_HEADER,
    noisy,
    opened,
    patch,
    recording_file,
    universal_record,
    write_hdf5,
    write_tdms,
    write_universal,
)

from thud.base.errors import InputError
from thud.recordings import formats
from thud.recordings.calibration import calibrate

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

pytestmark = pytest.mark.usefixtures("working_directory")
TIME = np.arange(FORCE.size) / RATE
POUND = 4.4482216152605
# Newtons per unit; None of units that are no force.
UNITS = {"": 1.0, "N": 1.0, "kN": 1e3, "lbf": POUND, "kgf": 9.80665, "V": None, "furlong": None}
FACTORS = ["scale_factor", "Scale Factor", "conversion", "scale", "scaling_factor", "gain",
           "Gain [dB]", "amplifier_gain", "multiplier", "slope", "channel_conversion"]  # fmt: skip
# They are no factors; a sensitivity is one unless the unit is that of a force.
OTHERS = ["", "date", "comment", "full_scale", "time_scale", "wf_start_offset"]
SENSITIVITY = "sensitivity"
OWNERS = st.sampled_from(["array", "group", "file"])


def read(path: Path | str, **stated: Any) -> NDArray[np.float64]:  # noqa: ANN401
    (signal,) = opened(path, **stated)
    assert signal.sample_rate == pytest.approx(RATE)
    return signal.read(0, signal.n_sample)


@pytest.mark.parametrize("name", WITH_HEADER)
@given(
    unit=st.sampled_from(list(UNITS)),
    factor=st.sampled_from([*FACTORS, *OTHERS, SENSITIVITY]),
    value=st.sampled_from([1.0, 0.25, 2.5, -0.5]),
    owners=st.tuples(OWNERS, OWNERS, OWNERS),
    order=st.permutations([0, 1, 2]),
    is_divided=st.booleans(),
)
@settings(max_examples=60, deadline=None)
def test_what_a_header_states_is_applied_or_refused(  # noqa: PLR0913 - each is one property
    *,
    name: str,
    unit: str,
    factor: str,
    value: float,
    owners: tuple[str, str, str],
    order: list[int],
    is_divided: bool,
) -> None:
    """Headers around a known force, which stored values are or are not divided by."""
    value = 20.0 if "dB" in factor else 2.5 if factor in OTHERS else value
    if name.endswith("mat") or factor == "Gain [dB]":
        factor = re.sub(r"\W+", "_", factor).strip("_")
    newtons, pairs = UNITS[unit], (("Fs", RATE), ("unit", unit), (factor, value))
    every = [(owner, *pair) for owner, pair in zip(owners, pairs, strict=True)]
    entries = [every[k] for k in order if every[k][1] and every[k][2] != ""]
    is_applied = name in {"a.h5", "a.nc"} and (owners[2], factor) == ("array", "scale_factor")
    is_known = factor in OTHERS or is_applied or value == 1.0
    is_known = is_known or (factor == SENSITIVITY and bool(newtons) and bool(unit))
    scale = value if is_applied or (is_divided and not is_known) else 1.0
    stored = FORCE / (newtons or 1.0) / scale
    WITH_HEADER[name](Path(name), stored, entries)
    if newtons is not None and is_known:
        np.testing.assert_allclose(read(name), FORCE, atol=1e-6)
        return
    with pytest.raises(InputError, match=naming(name)):
        opened(name)
    # A calibration is that of the stored values, and the factor is named in a note.
    peak = float(stored[abs(stored).argmax()]) * (value if is_applied else 1.0)
    (signal,) = opened(name, calibration=1500.0 / peak, unit="V")
    np.testing.assert_allclose(signal.read(0, signal.n_sample), FORCE, atol=1e-6)
    if not is_known and factor != SENSITIVITY:
        assert factor in str(noted(signal.notes, "factor_not_applied").others["factor"])


def test_factor_and_offset_of_netcdf_are_applied() -> None:
    path, rate = Path("a.h5"), ("array", "Fs", RATE)
    scaled = [rate, ("array", "scale_factor", 0.25), ("array", "add_offset", -25.0)]
    write_hdf5(path, np.rint((FORCE + 25) / 0.25).astype("i2"), scaled)
    np.testing.assert_allclose(read(path), FORCE, atol=0.125)
    write_hdf5(path, FORCE - 25, [rate, ("array", "add_offset", 25.0)])
    np.testing.assert_allclose(read(path), FORCE, atol=1e-9)


# Units of data set 164 per m and per N, and labels with newtons per unit.
SYSTEMS = {"none": None, "SI": (1.0, 1.0), "IN": (39.37007874, 0.2248089431)}
LABELS = {"NONE": 0.0, "N": 1.0, "kN": 1e3, "lbf": POUND, "V": None, "m/s2": None}


@pytest.mark.parametrize("quantity", [0, 9, 13, 12])
@pytest.mark.parametrize(("system", "label"), list(product(SYSTEMS, LABELS)))
def test_units_of_universal_files_are_applied_or_refused(
    system: str, label: str, quantity: int
) -> None:
    units, newtons = SYSTEMS[system], LABELS[label]
    by_system = 1 / units[1] if units else 1.0
    size = newtons or by_system
    record = universal_record(FORCE / size, RATE, label, binary=quantity % 2, quantity=quantity)
    head = {"type": 164, "units_code": 9, "temp": 1.0, "temp_offset": 0.0}
    sets = [{**head, "length": units[0], "force": units[1]}] if units else []
    write_universal(Path("a.uff"), *sets, record)
    is_force = quantity in {9, 13}
    if label == "NONE":
        is_right = is_force or (quantity == 0 and by_system == 1.0)
    else:
        agree = not units or not is_force or math.isclose(size, by_system, rel_tol=1e-3)
        is_right = newtons is not None and agree
    if is_right:
        np.testing.assert_allclose(read("a.uff"), FORCE, rtol=1e-6, atol=1e-6)
    else:
        with pytest.raises(InputError, match=r"unit|calibration"):
            opened("a.uff")


# Properties of a scale by which stored values are half the force.
SCALES = {
    "Linear": {"Slope": 2.0, "Y_Intercept": 0.0},
    "Polynomial": {"Coefficients_Size": 2, "Coefficients[0]": 0.0, "Coefficients[1]": 2.0},
    "PieceWisePolynomial": {},
    "Reciprocal": {},
}


@pytest.mark.parametrize("kind", SCALES)
def test_scales_of_tdms_are_applied_or_refused_by_name(
    kind: str, capfd: pytest.CaptureFixture[str]
) -> None:
    own = {"Input_Source": 0xFFFFFFFF, **SCALES[kind]}
    properties = {
        "Fs": RATE, "unit_string": "N", "NI_Number_Of_Scales": 1, "NI_Scaling_Status": "unscaled",
        "NI_Scale[0]_Scale_Type": kind,
        **{f"NI_Scale[0]_{kind}_{key}": value for key, value in own.items()},
    }  # fmt: skip
    write_tdms(Path("a.tdms"), FORCE / 2, [("array", *entry) for entry in properties.items()])
    if SCALES[kind]:
        np.testing.assert_allclose(read("a.tdms"), FORCE)
    else:
        with pytest.raises(InputError, match=naming("a.tdms", kind, "scale")):
            opened("a.tdms")
    assert capfd.readouterr() == ("", "")
    loggers = [logging.getLogger(name) for name in logging.root.manager.loggerDict]
    assert not any(logger.filters for logger in loggers if logger.name.startswith("nptdms"))


@pytest.mark.parametrize("order", ["little", "big"])
def test_tdms_that_is_cut_off_anywhere_is_refused(order: str) -> None:
    path = recording_file("plate.tdms")
    data = 2 * big_endian_tdms() if order == "big" else path.read_bytes()
    boundary = data.rindex(b"TDSm")
    for cut in {*range(5, len(data), 97), *range(boundary + 1, boundary + 40)}:
        path.write_bytes(data[:cut])
        with pytest.raises(InputError, match=r"plate\.tdms: "):
            opened(path)


def big_endian_tdms() -> bytes:
    """Return a TDMS file of one channel in newtons whose numbers are big-endian."""

    def text(value: str) -> bytes:
        return struct.pack(">I", len(value)) + value.encode()

    count, double, string = len(FORCE), 10, 0x20
    head = struct.pack(">I", 1) + text("/'plate'/'force'")
    head += struct.pack(">IIIQI", 20, double, 1, count, 2)
    head += text("wf_increment") + struct.pack(">Id", double, 1 / RATE)
    head += text("unit_string") + struct.pack(">I", string) + text("N")
    raw = FORCE.astype(">f8").tobytes()
    # Metadata, new list of objects, raw data, big-endian.
    lead = b"TDSm" + struct.pack("<I", 2 + 4 + 8 + 64)
    return lead + struct.pack(">IQQ", 4713, len(head) + len(raw), len(head)) + head + raw


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


def netcdf_times(path: Path, step: float, units: str, **attributes: float) -> None:
    """Write the force in N with times in a unit."""
    with h5py.File(path, "w") as file:
        file["F_N"], file["time"] = FORCE, (np.arange(FORCE.size) * step).astype("i8")
        file["F_N"].attrs["units"] = "lbf" if attributes else "N"
        file["time"].attrs.update(units=units, **attributes)


@pytest.mark.parametrize(
    ("name", "write", "stated"),
    [
        ("a.tdms", lambda path: path.write_bytes(big_endian_tdms()), {}),
        ("4.mat", lambda path: path.write_bytes(big_endian_mat(4)), {}),
        ("5.mat", lambda path: path.write_bytes(big_endian_mat(5)), {}),
        ("b.mat", lambda path: h5py.File(path, "w").update(M=np.stack([TIME, FORCE])), {}),
        ("a.nc", lambda path: netcdf_times(path, 125_000, "nanoseconds since 2024-05-06"), {}),
        ("a.uff", lambda path: write_universal(path, universal_record(
            FORCE, RATE / 1e3, "N", 1) | {"abscissa_axis_units_lab": "ms"}), {}),
        # The user decides between units of attribute and name.
        ("b.nc", lambda path: netcdf_times(path, 1, "s", scale_factor=1 / RATE), {"unit": "N"}),
        # The rate of times with an unknown factor is not known.
        ("c.nc", lambda path: netcdf_times(path, 1, "s", gain=2.0),
         {"unit": "N", "sample_rate": RATE}),
    ],
)  # fmt: skip
def test_other_layouts_are_read(
    name: str, write: Callable[[Path], None], stated: dict[str, Any]
) -> None:
    write(Path(name))
    np.testing.assert_allclose(read(name, **stated), FORCE, atol=1e-9)


@pytest.mark.parametrize("length", [0xFFFFFFFF, 0x7FFFF000, 0x7FFFFF00])
@pytest.mark.parametrize("kind", ["PCM_16", "PCM_24", "PCM_32", "FLOAT", "DOUBLE"])
def test_sound_of_a_stream_is_read_to_its_end(length: int, kind: str) -> None:
    path = Path("a.wav")
    soundfile.write(path, FORCE / 5000, 8000, kind)
    whole, at = read(path, calibration=5000.0), path.read_bytes().index(b"data") + 4
    for position in (4, at):
        patch(path, position, struct.pack("<I", length))
    np.testing.assert_array_equal(read(path, calibration=5000.0), whole)
    # A length that no stream begins with is a length.
    patch(path, at, struct.pack("<I", 0x7FFFEFFF))
    with pytest.raises(InputError, match=naming("a.wav", "cut off")):
        opened(path, calibration=5000.0)


def test_calibration_of_a_file_with_a_factor_names_it() -> None:
    entries = [("array", "Fs", RATE), ("array", "unit", "V"), ("array", "gain", 10.0)]
    write_hdf5(Path("a.h5"), noisy(np.repeat([0.0, 0.1], 10_000), 1e-4, 3), entries)
    note = calibrate("a.h5", force=500.0, uncertainty=0.01).notes[-1]
    assert (note.code, note.others) == ("stored_values_calibrated", {"factor": "gain = 10.0"})


def test_format_is_added_by_one_file_and_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    """The example of docs/how_to_add.md."""
    page = (REPOSITORY / "docs/how_to_add.md").read_text().partition("## A file format")[2]
    source, line = re.findall(r"```python\n(.*?)```", page, re.DOTALL)[:2]
    module = ModuleType("thud.recordings.formats.npy")
    exec(source, module.__dict__)  # noqa: S102 - our own
    monkeypatch.setitem(sys.modules, module.__name__, module)
    (entry,) = eval(f"[{line}]", vars(formats))  # noqa: S307
    monkeypatch.setattr(formats, "FORMATS", (*formats.FORMATS[:-1], entry, formats.FORMATS[-1]))
    np.save("force.npy", np.column_stack([TIME, FORCE]))
    with pytest.raises(InputError, match=naming("sample_rate")):
        opened("force.npy", channel=2)
    found = read("force.npy", channel=2, sample_rate=RATE, unit="N")
    np.testing.assert_array_equal(found, FORCE)
