"""The surrogate of the standard ball in the package, and the cases that it covers."""

from __future__ import annotations

from dataclasses import fields, replace
from functools import cache
from importlib import resources
from typing import TYPE_CHECKING

from thud.base.errors import InputError
from thud.case.keys import value_in
from thud.studies.trained_surrogate import Surrogate, read_surrogate
from thud.studies.unknowns import STANDARD_BALL, Unknown, blocked_case, stated_unknowns

if TYPE_CHECKING:
    from thud.case.case import Case

# File of the package, made by `./bootstrap surrogate` from inputs/studies/standard_ball.toml.
FILE = "standard_ball.npz"


@cache
def bundled_surrogate() -> Surrogate:
    """Return the surrogate of the standard ball by finite elements."""
    with resources.as_file(resources.files("thud.studies") / FILE) as path:
        return read_surrogate(path)


def get_unknowns(case: Case) -> tuple[Unknown, ...]:
    """Return the unknowns that a case states; if none, those of the standard ball if it is one."""
    if case.unknowns:
        return stated_unknowns(case)
    return STANDARD_BALL if is_covered(case, STANDARD_BALL) else ()


def covered_case(case: Case, unknowns: tuple[Unknown, ...]) -> Case:
    """Return the drop of a case on a rigid floor as the bundled surrogate predicts it.

    Mesh, verification and bands of the bundled surrogate replace those of the case: they affect the
    numerical error only. Raises InputError if a key differs from that of the surrogate, or is
    outside its region.
    """
    surrogate = bundled_surrogate()
    result = blocked_case(case, unknowns)
    if result.model is None or surrogate.case.model is None:
        message = "the case has no source model"
        raise InputError(message)
    if result.model.name == surrogate.case.model.name:
        mesh = {
            option.name: getattr(surrogate.case.model, option.name)
            for option in fields(surrogate.case.model)
            if option.metadata.get("group") == "mesh"
        }
        result = replace(result, model=replace(result.model, **mesh))
    result = replace(
        result,
        levels=replace(result.levels, bands=surrogate.case.levels.bands),
        sampling=replace(result.sampling, verify=surrogate.case.sampling.verify),
    )
    surrogate.require(result, [entry.key for entry in unknowns])
    ranges = {u.key: (u.low, u.high) for u in unknowns}
    for name, region in zip(surrogate.keys, surrogate.region.tolist(), strict=True):
        value = value_in(result, name)
        low, high = ranges.get(name, region)
        if not (isinstance(value, float | int) and region[0] <= low <= value <= high <= region[1]):
            message = f"{name} is outside the region of the surrogate; allowed: {low:g} to {high:g}"
            raise InputError(message)
    return result


def is_covered(case: Case, unknowns: tuple[Unknown, ...]) -> bool:
    """Return whether the bundled surrogate predicts a case with all values of its unknowns."""
    try:
        covered_case(case, unknowns)
    except InputError:
        return False
    return True
