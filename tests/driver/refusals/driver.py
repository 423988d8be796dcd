"""What the calls of `driver.toml` use."""

from __future__ import annotations

from conftest import MINIMAL
from refusals.core import write

import thud
from thud.base.files import Results

# What is only imported for the table.
__all__ = ["MINIMAL", "Results"]


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
