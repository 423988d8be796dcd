"""thud: the force that heavy/soft impact sources put into floors.

>>> import thud
>>> impact = thud.solve(thud.Ball(), thud.Drop(height=1.0))
>>> round(1000 * impact.contact_time, 2)
20.43
"""

from __future__ import annotations

import importlib
from typing import Any

from thud._api import version
from thud._schema import *  # noqa: F403 - the groups and models that the library declares
from thud._schema import __all__ as _groups
from thud.case import Case, read_case, write_case
from thud.ensemble import Ensemble, solve_many
from thud.errors import FitWarning, InputError, NumericalError, PlausibilityWarning, ThudError
from thud.free_modes import FreeModes, free_modes, loss_factors
from thud.impact import Impact, Motion, solve, solve_case
from thud.levels import Bands, Conformity, Criterion, force_exposure_levels, get_bands, judge
from thud.recording import Recording
from thud.results import read_results
from thud.studies import kinds

__version__ = version()

__all__ = [  # noqa: PLE0604 - the first are strings too
    *_groups,
    "Bands",
    "Case",
    "Conformity",
    "Criterion",
    "Ensemble",
    "FitWarning",
    "FreeModes",
    "Impact",
    "InputError",
    "Motion",
    "NumericalError",
    "PlausibilityWarning",
    "Recording",
    "ThudError",
    "force_exposure_levels",
    "free_modes",
    "get_bands",
    "judge",
    "loss_factors",
    "read_case",
    "read_results",
    "solve",
    "solve_case",
    "solve_many",
    "write_case",
]


# What needs matplotlib, plotly, SciPy or xarray is imported at first use: these are slow to import.
_LATE = {
    "plot": None,
    "comparison": None,
    "compare": "comparison",
    "read_all": "comparison",
}


def __getattr__(name: str) -> Any:  # noqa: ANN401 - a module or an object of it
    """Import slow modules at first use."""
    if name in kinds.PUBLIC:
        return getattr(kinds.load(kinds.PUBLIC[name]), name)
    if name in _LATE:
        module = importlib.import_module(f"thud.{_LATE[name] or name}")
        return getattr(module, name) if _LATE[name] else module
    message = f"module 'thud' has no attribute {name!r}"
    raise AttributeError(message)
