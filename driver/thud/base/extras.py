"""Optional packages."""

from __future__ import annotations

import importlib
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from thud.base.checks import refuse

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    import numpy as np
    import pandas as pd
    from numpy.typing import NDArray


@contextmanager
def require_extra(extra: str) -> Iterator[None]:
    """Raise InputError, with the extra to install, if a package of an extra is missing."""
    try:
        yield
    except ModuleNotFoundError as error:
        refuse(f"{error.name} is not installed", f'pip install "thud-acoustics[{extra}]"', error)


def library(name: str, extra: str) -> Any:  # noqa: ANN401 - a module
    """Import a package of an extra; raise InputError, with the extra to install, without it."""
    with require_extra(extra):
        return importlib.import_module(name)


def data_frame(
    columns: Mapping[str, NDArray[np.generic]], time: NDArray[np.float64] | None = None
) -> pd.DataFrame:
    """Return columns as a table, indexed by time, s, if stated; raise InputError without pandas."""
    with require_extra("studies"):
        import pandas as pd

    return pd.DataFrame(columns, index=None if time is None else pd.Index(time, name="time_s"))
