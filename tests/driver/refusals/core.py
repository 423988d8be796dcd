"""What the calls of all tables of refusals may use."""

from __future__ import annotations

from math import inf, nan
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from conftest import MINIMAL

import thud
from thud.base.files import Results
from thud.level.levels import peak_count

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

# What is only imported for the table.
__all__ = ["MINIMAL", "Results", "inf", "nan", "np", "peak_count"]

PULSE = np.sin(np.pi * np.linspace(0, 1, 883))


def write(name: str | Path, text: str | bytes) -> Path:
    """Write a file in the directory of the test; return its path."""
    path = Path(name)
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def levels(force: ArrayLike, sample_rate: Any = 44100.0, **options: Any) -> NDArray[np.float64]:  # noqa: ANN401
    """Return force exposure levels."""
    return thud.force_exposure_levels(force, sample_rate, **options)


def assess(**change: Any) -> thud.Verdict:  # noqa: ANN401
    """Return the verdict on the levels of the standard ball."""
    return thud.assess_levels(**({"levels": [39, 31, 23, 17, 12.5]} | change))


def namelist(text: str) -> thud.Case:
    """Return the case of a namelist file."""
    return thud.read_case(write("case.nml", text))


def keys(**entries: str) -> thud.Impact:
    """Solve the case of the shell with entries in groups of its namelist."""
    groups = {"drop": "", "ball": ""} | entries | {"model": "name = 'hollow_sphere'"}
    return thud.solve(namelist("".join(f"&{name} {entry} /\n" for name, entry in groups.items())))


def elements(text: str = "", ball: str = "", drop: str = "") -> thud.Impact:
    """Solve the case of a coarse mesh with more groups."""
    mesh = "&mesh radial_elements = 2, polar_elements = 16 /"
    model = "&model name = 'finite_element' /"
    return thud.solve(namelist(f"&ball {ball} /\n&drop {drop} /\n{model}\n{mesh}\n{text}\n"))
