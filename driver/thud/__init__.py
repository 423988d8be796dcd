"""thud: the force that heavy/soft impact sources put into floors.

>>> import thud
>>> impact = thud.solve(thud.Ball(), thud.Drop(height=1.0))
>>> round(1000 * impact.contact_time, 2)
20.43
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

from thud._library import version
from thud.case import (
    Ball,
    Case,
    Drop,
    HollowSphere,
    HuntCrossley,
    Levels,
    Limits,
    MeasuredModes,
    ModalBall,
    Sampling,
    read_case,
    write_case,
)
from thud.errors import InputError, NumericalError, ThudError
from thud.impact import Impact, solve, solve_case
from thud.levels import Bands, Conformity, Criterion, force_exposure_levels, get_bands, judge

if TYPE_CHECKING:
    from types import ModuleType

__version__ = version()

__all__ = [
    "Ball",
    "Bands",
    "Case",
    "Conformity",
    "Criterion",
    "Drop",
    "HollowSphere",
    "HuntCrossley",
    "Impact",
    "InputError",
    "Levels",
    "Limits",
    "MeasuredModes",
    "ModalBall",
    "NumericalError",
    "Sampling",
    "ThudError",
    "force_exposure_levels",
    "get_bands",
    "judge",
    "read_case",
    "solve",
    "solve_case",
    "write_case",
]


def __getattr__(name: str) -> ModuleType:
    """Import `thud.plot` when it is first asked for: matplotlib takes its time."""
    if name == "plot":
        return importlib.import_module("thud.plot")
    message = f"module 'thud' has no attribute {name!r}"
    raise AttributeError(message)
