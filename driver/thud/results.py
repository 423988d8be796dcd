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
from thud.impact import Impact
from thud.motion import Motion

if TYPE_CHECKING:
    import os

    from numpy.typing import NDArray


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
        force = _table(folder / "force.csv")
        channels = folder / "channels.csv"
        found = _table(channels) if channels.exists() else {}
        motion = _read_motion(folder) if (folder / "motion.pvd").exists() else None
    except FileNotFoundError as error:
        refuse(f"{error.filename}: there is no such file", "the results of an impact", error)
    except (OSError, ValueError, KeyError, TypeError) as error:
        message = f"{directory}: cannot be read ({error}); allowed: the results of an impact"
        raise InputError(message) from error
    time = force.pop("time_s")
    named = {name.rsplit("_", 1)[0]: values for name, values in force.items()}
    return Impact(
        case,
        time,
        named.pop("deflection"),
        force["velocity_m_per_s"],
        named.pop("elastic_force"),
        named.pop("floor_force"),
        {name: values for name, values in named.items() if name != "velocity_m_per"},
        {name: values for name, values in found.items() if name != "time_s"},
        dict(numbers.get("facts", {})),
        _texts(numbers.get("remarks", {}).get("remark", [])),
        motion,
        **{name: numbers["summary"][name] for name in SCALARS},
    )


def _texts(value: str | list[str]) -> tuple[str, ...]:
    """Return the texts of a key; f90nml gives one text without its list."""
    return (value,) if isinstance(value, str) else tuple(value)


def _table(path: Path) -> dict[str, NDArray[np.float64]]:
    """Return the columns of a CSV file by name."""
    with path.open(encoding="utf-8") as file:
        names = file.readline().strip().split(",")
        return dict(zip(names, np.loadtxt(file, delimiter=",", ndmin=2).T, strict=True))


def _read_motion(folder: Path) -> Motion:
    """Return the snapshots of the VTU files that ``motion.pvd`` lists."""
    entries = re.findall(r'timestep="(.*?)" file="(.*?)"', (folder / "motion.pvd").read_text())
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
