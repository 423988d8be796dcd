"""Optional packages."""

from __future__ import annotations

import re
from contextlib import contextmanager
from typing import TYPE_CHECKING

from thud.base.checks import refuse

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    import numpy as np
    import pandas as pd
    from numpy.typing import NDArray


# Names of distributions that differ from the name of the import.
_DISTRIBUTIONS = {"sklearn": "scikit-learn"}


@contextmanager
def require_extra(extra: str) -> Iterator[None]:
    """Raise InputError, with the packages to install, if a package of an extra is missing."""
    try:
        yield
    except ModuleNotFoundError as error:
        needed = packages(extra)
        missing = _DISTRIBUTIONS.get(str(error.name), str(error.name))
        names = needed if missing in needed else [missing]
        refuse(f"{missing} is not installed", f"pip install {' '.join(names)}", error)


def data_frame(
    columns: Mapping[str, NDArray[np.generic]], time: NDArray[np.float64] | None = None
) -> pd.DataFrame:
    """Return columns as a table, indexed by time, s, if stated; raise InputError without pandas."""
    with require_extra("studies"):
        import pandas as pd

    return pd.DataFrame(columns, index=None if time is None else pd.Index(time, name="time_s"))


def packages(extra: str) -> list[str]:
    """Return the names of the packages of an extra; empty if thud is not installed."""
    from importlib.metadata import PackageNotFoundError, requires

    try:
        lines = requires("thud") or []
    except PackageNotFoundError:
        return []
    matches = (re.fullmatch(rf"([\w.-]+).*extra == ['\"]{extra}['\"]", line) for line in lines)
    return [match[1] for match in matches if match]
