"""Reader of the results of a run in a directory."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import f90nml
import numpy as np

from thud.base.checks import refuse
from thud.base.errors import ThudError
from thud.base.files import require_regular
from thud.case.case import Case
from thud.impact.compute import new_impact

if TYPE_CHECKING:
    import os
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from thud.impact.impact import Impact


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
        answer: dict[str, Any] = dict(f90nml.reads(_text(folder / "summary.nml")))
        if "warnings" in answer:
            answer["warnings"] = _warnings(answer["warnings"])
        for prefix in ("", "floor_") if "floor_summary" in answer else ("",):
            answer[f"{prefix}force"] = _table(folder / f"{prefix}force.csv")
            for name in (f"{prefix}model_histories", f"{prefix}snapshots"):
                if (path := folder / f"{name}.csv").exists():
                    answer[name] = _table(path)
        return new_impact(Case.from_text(_text(folder / "effective.nml")), answer)
    except ThudError:
        raise
    except Exception as error:  # noqa: BLE001 - parsers of damaged files raise various errors
        reason = f"{type(error).__name__}: {error}".partition("\n")[0]
        refuse(f"{folder}: cannot be read ({reason})", "the results of an impact", error)


def _text(path: Path) -> str:
    return require_regular(path).read_bytes().decode()


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


def _table(path: Path) -> dict[str, NDArray[np.float64]]:
    """Return the columns of a CSV file by name."""
    names, *lines = _text(path).splitlines()
    columns = np.loadtxt(lines, delimiter=",", ndmin=2).T
    if not np.isfinite(columns).all():
        message = f"{path.name}: a value is not finite"
        raise ValueError(message)
    return dict(zip(names.split(","), columns, strict=True))
