"""Kinds of studies of samples; the module of a kind is imported when the kind is used."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, NamedTuple

from thud.base.extras import require_extra

if TYPE_CHECKING:
    from thud.studies.study_result import SampleResult


class Kind(NamedTuple):
    """A kind of study: help of its command, sampling designs, and end of the name of its table."""

    help: str
    # The default first.
    designs: tuple[str, ...]
    # Empty: only the samples are written.
    table: str = ""


# A key names the command, the function, and the module with the class of the result, such as
# `Sweep`, which is made from the dataset of all samples.
KINDS = {
    "sweep": Kind(
        "drops over a grid, a list or a random design of parameters",
        ("grid", "list", "random", "latin_hypercube", "sobol"),
    ),
    "sensitivity": Kind(
        "Sobol indices: how much each parameter affects each result", ("saltelli",), "_indices.csv"
    ),
    "design": Kind("which geometries and materials conform to the standards", ("grid",)),
    "uncertainty": Kind("effect of tolerances on levels and conformity", ("random",)),
    "surrogate": Kind("train a fast approximation of a slow model for other studies", ("sobol",)),
}


def result_type(kind: str) -> type[SampleResult]:
    """Return the class of the results of a kind; raise InputError if a package is missing."""
    with require_extra("studies"):
        module = importlib.import_module(f"thud.studies.{kind}")
    result: type[SampleResult] = getattr(module, kind.capitalize())
    return result
