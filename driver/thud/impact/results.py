"""Reader of the results of a run in a directory."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import f90nml
import numpy as np

from thud.base.checks import refuse
from thud.base.errors import ThudError
from thud.case.case import Case
from thud.impact.compute import new_impact

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from thud.impact.impact import Impact

# Endings of the files that are read.
_ENDINGS = (".nml", ".csv")


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
    folder = Path(directory)
    try:
        files = _read_texts(folder)
        for name in ("summary.nml", "effective.nml"):
            _require(folder, name, files)
        return _new_impact(folder, files)
    except ThudError:
        raise
    except FileNotFoundError as error:
        refuse(f"{folder}: there is no such directory", "the results of an impact", error)
    except Exception as error:  # noqa: BLE001 - parsers of damaged files raise various errors
        reason = f"{type(error).__name__}: {error}".partition("\n")[0]
        refuse(f"{folder}: cannot be read ({reason})", "the results of an impact", error)


def _read_texts(folder: Path) -> dict[str, str]:
    """Return the texts of the files of a result directory by name.

    The directory is opened once: a run that replaces it meanwhile adds no file of its own.
    """
    directory = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)

    def opener(name: str, flags: int) -> int:
        # Opening a pipe could block.
        return os.open(name, flags | os.O_NONBLOCK, dir_fd=directory)

    texts = {}
    try:
        for name in os.listdir(directory):  # noqa: PTH208 - by its descriptor
            if name.endswith(_ENDINGS):
                with open(name, encoding="utf-8", opener=opener) as file:
                    texts[name] = file.read()
    finally:
        os.close(directory)
    return texts


def _require(folder: Path, name: str, files: dict[str, str]) -> None:
    """Raise InputError if a file is missing."""
    if name not in files:
        refuse(f"{folder / name}: there is no such file", "the results of an impact")


def _new_impact(folder: Path, files: dict[str, str]) -> Impact:
    """Return the impact of a result directory, whose files are the groups of the library."""
    answer: dict[str, Any] = dict(f90nml.reads(files["summary.nml"]))
    if "warnings" in answer:
        answer["warnings"] = _warnings(answer["warnings"])
    for prefix in ("", "floor_") if "floor_summary" in answer else ("",):
        _require(folder, f"{prefix}force.csv", files)
        for name in (f"{prefix}force", f"{prefix}model_histories", f"{prefix}snapshots"):
            if f"{name}.csv" in files:
                answer[name] = _table(files[f"{name}.csv"])
    return new_impact(Case.from_text(files["effective.nml"]), answer)


def _warnings(group: Mapping[str, Any]) -> dict[str, str | NDArray[np.float64]]:
    """Return the warnings of a summary as the library sends them."""
    # f90nml returns a single entry without a list, and drops unknown numbers at the end of one.
    lists = {name: entry if isinstance(entry, list) else [entry] for name, entry in group.items()}
    count = len(lists["code"])
    result: dict[str, str | NDArray[np.float64]] = {
        name: "\n".join(lists[name]) for name in ("code", "subject", "text")
    }
    for name in ("value", "low", "high"):
        entries = [*lists.get(name, ()), *[None] * count]
        result[name] = np.array(entries[:count], dtype=np.float64)
    return result


def _table(text: str) -> dict[str, NDArray[np.float64]]:
    """Return the columns of a CSV file by name."""
    names, *lines = text.splitlines()
    columns = np.loadtxt(lines, delimiter=",", ndmin=2).T
    if not np.isfinite(columns).all():
        message = "a value is not finite"
        raise ValueError(message)
    return dict(zip(names.split(","), columns, strict=True))
