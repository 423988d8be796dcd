"""Reads the results of a run back from its directory."""

from __future__ import annotations

import base64
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

import f90nml
import numpy as np

from thud._schema import SCALARS
from thud.case import Case
from thud.checks import refuse
from thud.errors import InputError
from thud.impact import FloorImpact, Impact
from thud.motion import Motion

if TYPE_CHECKING:
    import os

    from numpy.typing import NDArray


# Columns of every history, by the names of an impact; parts of the force follow the first three.
_OWN = {
    "time": "time_s",
    "deflection": "deflection_m",
    "velocity": "velocity_m_per_s",
    "elastic_force": "elastic_force_N",
    "floor_force": "floor_force_N",
}
_MOTION = ("time", "deflection", "velocity")


def read_results(directory: str | os.PathLike[str]) -> Impact:
    """Read the impact that ``thud`` or ``thud-driver run`` has written, without loss of digits.

    Parameters
    ----------
    directory
        Directory of the results of one case.

    Returns
    -------
    Impact
        The same as `solve_case` gives.

    Raises
    ------
    InputError
        Where the directory does not hold the results of an impact.
    """
    try:
        folder = Path(directory)
        case = Case.from_namelist(f90nml.read(folder / "effective.nml"))
        numbers = f90nml.read(folder / "summary.nml")
        history = _read_history(folder, "", numbers["summary"], numbers.get("facts", {}))
        moving = None
        if "floor_summary" in numbers:
            groups = numbers["floor_summary"], numbers.get("floor_facts", {})
            moving = _read_history(folder, "floor_", *groups)
    except FileNotFoundError as error:
        refuse(f"{error.filename}: there is no such file", "the results of an impact", error)
    except (OSError, ValueError, KeyError, TypeError) as error:
        message = f"{directory}: cannot be read ({error}); allowed: the results of an impact"
        raise InputError(message) from error
    remarks = _texts(numbers.get("remarks", {}).get("remark", []))
    on_floor = None
    if moving:
        columns = moving.pop("further")
        on_floor = FloorImpact(
            case=case, remarks=(), floor_work=numbers["floor_summary"]["floor_work"],
            blocked_force=columns.pop("blocked_force_N"),
            floor_displacement=columns.pop("floor_displacement_m"),
            floor_velocity=columns.pop("floor_velocity_m_per_s"),
            point_velocity=np.array([*columns.values()]).reshape(-1, len(moving["time"])),
            **moving,
        )  # fmt: skip
    del history["further"]
    return Impact(case=case, remarks=remarks, on_floor=on_floor, **history)


def _read_history(
    folder: Path, prefix: str, scalars: dict[str, Any], facts: dict[str, float]
) -> dict[str, Any]:
    """Return what the files of a history hold; ``further`` are the columns of a floor."""
    force = _table(folder / f"{prefix}force.csv")
    channels = folder / f"{prefix}channels.csv"
    found = _table(channels) if channels.exists() else {}
    has_motion = (folder / f"{prefix}motion.pvd").exists()
    # Parts of the force stand before it, columns of a floor behind.
    columns = list(force)
    last = columns.index("floor_force_N")
    return {
        **{name: force[column] for name, column in _OWN.items()},
        "parts": {name[: -len("_N")]: force[name] for name in columns[len(_MOTION) : last - 1]},
        "further": {name: force[name] for name in columns[last + 1 :]},
        "channels": {name: values for name, values in found.items() if name != "time_s"},
        "facts": dict(facts),
        "motion": _read_motion(folder, prefix) if has_motion else None,
        **{name: scalars[name] for name in SCALARS},
    }


def _texts(value: str | list[str]) -> tuple[str, ...]:
    """Return the texts of a key; f90nml gives one text without its list."""
    return (value,) if isinstance(value, str) else tuple(value)


def _table(path: Path) -> dict[str, NDArray[np.float64]]:
    """Return the columns of a CSV file by name."""
    with path.open(encoding="utf-8") as file:
        names = file.readline().strip().split(",")
        return dict(zip(names, np.loadtxt(file, delimiter=",", ndmin=2).T, strict=True))


def _read_motion(folder: Path, prefix: str) -> Motion:
    """Return the snapshots of the VTU files that ``motion.pvd`` lists."""
    listed = (folder / f"{prefix}motion.pvd").read_text()
    entries = re.findall(r'timestep="(.*?)" file="(.*?)"', listed)
    shots = [_read_vtu(folder / name) for _, name in entries]
    # The first element has its first two nodes on neighbouring rings.
    line = int(shots[0]["connectivity"][1])
    size = (len(shots[0]["cavity_pressure"]) // line, line)
    plane = {
        name: np.stack([shot[name].reshape(*size, 3)[..., :2].swapaxes(0, 1) for shot in shots])
        for name in ("Points", "displacement", "velocity")
    }
    outer = {
        name: np.stack([shot[name].reshape(size)[-1] for shot in shots])
        for name in ("contact_pressure", "contact_shear")
    }
    return Motion(
        np.array([float(time) for time, _ in entries]),
        plane["Points"][0] - plane["displacement"][0],
        plane["Points"],
        plane["velocity"],
        outer["contact_pressure"],
        outer["contact_shear"],
        np.array([float(shot["cavity_pressure"][0]) for shot in shots]),
    )


def _read_vtu(path: Path) -> dict[str, NDArray[Any]]:
    """Return the arrays of a VTU file as thud writes it."""
    arrays = re.findall(
        r'<DataArray type="(Float64|Int64)" Name="(.*?)".*?>(.*?)</DataArray>',
        path.read_text(encoding="ascii"),
    )
    # The first eight bytes are the length of the data.
    return {
        name: np.frombuffer(base64.b64decode(data), f"<{kind[0].lower()}8", offset=8)
        for kind, name, data in arrays
    }
