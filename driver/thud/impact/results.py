"""Reader of the results of a run in a directory."""

from __future__ import annotations

import errno
import math
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import f90nml.scanner
import numpy as np

from thud.base._schema import IMPACT_QUANTITIES
from thud.base.checks import refuse
from thud.base.errors import ThudError
from thud.case.case import Case
from thud.impact.floor_impact import FloorImpact
from thud.impact.impact import Impact
from thud.impact.motion import Motion

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

# The scanner of f90nml prints its tables on the screen before it raises an error.
f90nml.scanner.print = lambda *_: None

# Endings of the files that are read.
_ENDINGS = (".nml", ".csv")
# Columns of ``force.csv`` for fields of `Impact`; columns of components follow the first three.
_COLUMNS = {
    "time": "time_s",
    "deflection": "deflection_m",
    "velocity": "velocity_m_per_s",
    "elastic_force": "elastic_force_N",
    "floor_force": "floor_force_N",
}
_N_MOTION_COLUMN = 3


def read_results(directory: str | os.PathLike[str]) -> Impact:
    """Read the impact that ``thud`` or ``thud-driver run`` has written, in full precision.

    Parameters
    ----------
    directory
        Directory of the results of one case.

    Returns
    -------
    Impact
        The same impact as the return value of `solve`, without `room_level`.

    Raises
    ------
    InputError
        If the directory does not hold the results of an impact.
    """
    try:
        return _new_impact(_Files(Path(directory)))
    except ThudError:
        raise
    except FileNotFoundError as error:
        refuse(f"{error.filename}: there is no such file", "the results of an impact", error)
    except Exception as error:  # noqa: BLE001 - parsers of damaged files raise various errors
        reason = f"{type(error).__name__}: {error}".partition("\n")[0]
        refuse(f"{directory}: cannot be read ({reason})", "the results of an impact", error)


class _Files(dict[str, str]):
    """Texts of the files of a result directory by name.

    The directory is opened once: a run that replaces it meanwhile adds no file of its own.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        directory = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
        try:

            def opener(name: str, flags: int) -> int:
                # Opening a pipe could block.
                return os.open(name, flags | os.O_NONBLOCK, dir_fd=directory)

            for name in os.listdir(directory):  # noqa: PTH208 - by its descriptor
                if name.endswith(_ENDINGS):
                    with open(name, encoding="utf-8", opener=opener) as file:
                        self[name] = file.read()
        finally:
            os.close(directory)

    def __missing__(self, name: str) -> str:
        raise FileNotFoundError(errno.ENOENT, "missing", str(self.folder / name))


def _new_impact(files: _Files) -> Impact:
    """Return the impact of a result directory."""
    case = Case.from_text(files["effective.nml"])
    numbers = f90nml.reads(files["summary.nml"])
    history, _ = _read_history(files, "", numbers["summary"], numbers.get("model_quantities", {}))
    messages = _texts(numbers.get("warnings", {}).get("warning", []))
    on_floor = None
    if "floor_summary" in numbers:
        scalars, others = numbers["floor_summary"], numbers.get("floor_model_quantities", {})
        floor_history, columns = _read_history(files, "floor_", scalars, others)
        on_floor = FloorImpact(
            case=case,
            warnings=(),
            blocked_force=columns.pop("blocked_force_N"),
            floor_displacement=columns.pop("floor_displacement_m"),
            floor_velocity=columns.pop("floor_velocity_m_per_s"),
            floor_work=scalars["floor_work"],
            point_velocity=np.array([*columns.values()]).reshape(-1, len(floor_history["time"])),
            **floor_history,
        )
    return Impact(case=case, warnings=messages, on_floor=on_floor, **history)


def _read_history(
    files: _Files, prefix: str, scalars: Mapping[str, float], model_quantities: Mapping[str, float]
) -> tuple[dict[str, Any], dict[str, NDArray[np.float64]]]:
    """Return fields of `Impact` from the files with a prefix, and the columns of a floor."""
    force = _table(files[f"{prefix}force.csv"])
    file_name = f"{prefix}model_histories.csv"
    histories = _table(files[file_name]) if file_name in files else {}
    # Columns: motion, components of the force, total forces, motion of the floor.
    columns = list(force)
    last = columns.index("floor_force_N")
    history = {
        **{name: force[column] for name, column in _COLUMNS.items()},
        "components": {
            name[: -len("_N")]: force[name] for name in columns[_N_MOTION_COLUMN : last - 1]
        },
        "model_histories": {name: values for name, values in histories.items() if name != "time_s"},
        "model_quantities": dict(model_quantities),
        "motion": _read_motion(files, prefix) if f"{prefix}snapshots.csv" in files else None,
        **{name: scalars[name] for name in IMPACT_QUANTITIES if not name.endswith("_error")},
        # The file has no unknown errors.
        **{
            name: scalars.get(name, math.nan)
            for name in IMPACT_QUANTITIES
            if name.endswith("_error")
        },
    }
    return history, {name: force[name] for name in columns[last + 1 :]}


def _texts(value: str | list[str]) -> tuple[str, ...]:
    """Return the texts of a key; f90nml returns a single text as a string, not as a list."""
    return (value,) if isinstance(value, str) else tuple(value)


def _table(text: str) -> dict[str, NDArray[np.float64]]:
    """Return the columns of a CSV file by name."""
    names, *lines = text.splitlines()
    columns = np.loadtxt(lines, delimiter=",", ndmin=2).T
    if not np.isfinite(columns).all():
        message = "a value is not finite"
        raise ValueError(message)
    return dict(zip(names.split(","), columns, strict=True))


def _read_motion(files: _Files, prefix: str) -> Motion:
    """Return the snapshots of ``snapshots.csv``."""
    columns = _table(files[f"{prefix}snapshots.csv"])
    size = (-1, int(columns["ring"][-1]), int(columns["line"][-1]))
    grids = {name: values.reshape(size).swapaxes(1, 2) for name, values in columns.items()}

    def vectors(radial: str, upward: str) -> NDArray[np.float64]:
        return np.stack((grids[radial], grids[upward]), axis=-1)

    return Motion(
        grids["time_s"][:, 0, 0],
        vectors("start_radius_m", "start_height_m")[0],
        vectors("radius_m", "height_m"),
        vectors("radial_velocity_m_per_s", "upward_velocity_m_per_s"),
        grids["contact_pressure_Pa"][..., -1],
        grids["contact_shear_Pa"][..., -1],
        grids["cavity_pressure_Pa"][:, 0, 0],
        grids["floor_displacement_m"][:, 0, 0],
    )
