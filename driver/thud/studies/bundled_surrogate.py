"""The surrogate of the standard ball in the package, and the cases that it covers."""

from __future__ import annotations

from dataclasses import fields, replace
from functools import cache
from importlib import resources
from typing import TYPE_CHECKING

from thud.base.bridge import version
from thud.base.checks import refuse
from thud.base.errors import InputError
from thud.case.keys import value_in
from thud.studies.trained_surrogate import Surrogate, read_surrogate
from thud.studies.unknowns import STANDARD_BALL, Unknown, blocked_case, stated_unknowns

if TYPE_CHECKING:
    from collections.abc import Iterator

    from thud.case.case import Case

    Range = tuple[float, float]

# File of the package, made by `./bootstrap surrogate` from inputs/studies/standard_ball.toml.
FILE = "standard_ball.npz"


@cache
def bundled_surrogate() -> Surrogate:
    """Return the surrogate of the standard ball by finite elements.

    The version of thud that trained it does not matter: tests compare it with drops of this
    version, and each verdict with the drop of its case.
    """
    with resources.as_file(resources.files("thud.studies") / FILE) as path:
        surrogate = read_surrogate(path)
    return replace(surrogate, identity={**surrogate.identity, "thud": version()})


def find_unknowns(case: Case) -> tuple[tuple[Unknown, ...], Case | None]:
    """Return the unknowns of a case, and its drop as the bundled surrogate predicts it.

    The unknowns are those that the case states; if none, those of the standard ball if it is one.
    The drop is None if the surrogate does not cover the case with all values of its unknowns.
    """
    unknowns = stated_unknowns(case) if case.unknowns else STANDARD_BALL
    try:
        return unknowns, _covered_case(case, unknowns)
    except InputError:
        return (unknowns if case.unknowns else ()), None


def reason_without_defaults(case: Case) -> str:
    """Return why the default unknowns do not hold for a case; empty if they do."""
    try:
        _covered_case(case, STANDARD_BALL)
    except InputError as error:
        return str(error).replace("; allowed: ", ", allowed: ")
    return ""


def range_without_defaults(case: Case) -> tuple[str, float, float] | None:
    """Return key and range of a value for which the default unknowns do not hold, if any."""
    try:
        return _outside(_as_trained(case, STANDARD_BALL), STANDARD_BALL)
    except InputError:
        return None


def _covered_case(case: Case, unknowns: tuple[Unknown, ...]) -> Case:
    """Return `_as_trained`; raise InputError with the key that the surrogate does not cover."""
    result = _as_trained(case, unknowns)
    for name, (low, high), region in _ranges(unknowns):
        if not region[0] <= low <= high <= region[1]:
            refuse(f"{name} = {low:g} to {high:g}", f"{region[0]:g} <= {name} <= {region[1]:g}")
    if outside := _outside(result, unknowns):
        name, low, high = outside
        refuse(f"{name} = {value_in(result, name):g}", f"{low:g} <= {name} <= {high:g}")
    return result


def _outside(case: Case, unknowns: tuple[Unknown, ...]) -> tuple[str, float, float] | None:
    """Return the first key whose value lies outside of its range, and the range."""
    for name, (low, high), _ in _ranges(unknowns):
        value = value_in(case, name)
        if not (isinstance(value, float | int) and low <= value <= high):
            return name, low, high
    return None


def _ranges(unknowns: tuple[Unknown, ...]) -> Iterator[tuple[str, Range, Range]]:
    """Yield each key of the surrogate, its range, and the range in which it was trained."""
    ranges = {u.key: (u.low, u.high) for u in unknowns}
    surrogate = bundled_surrogate()
    for name, (low, high) in zip(surrogate.keys, surrogate.region.tolist(), strict=True):
        yield name, ranges.get(name, (low, high)), (low, high)


def _as_trained(case: Case, unknowns: tuple[Unknown, ...]) -> Case:
    """Return the drop of a case on a rigid floor as the bundled surrogate predicts it.

    Mesh, sampling and bands of the surrogate replace those of the case: they affect the numerical
    error only. Raises InputError if the surrogate does not predict such a case.
    """
    surrogate = bundled_surrogate()
    result = blocked_case(case, unknowns)
    model, trained = result.model, surrogate.case.model
    assert trained is not None  # noqa: S101 - see `Surrogate.is_complete`
    if model is None or model.name != trained.name:
        refuse(f"model = {model.name if model else ''!r}", repr(trained.name))
    mesh = {
        option.name: getattr(trained, option.name)
        for option in fields(trained)
        if option.metadata.get("group") == "mesh"
    }
    result = replace(
        result,
        model=replace(model, **mesh),
        levels=replace(result.levels, bands=surrogate.case.levels.bands),
        sampling=surrogate.case.sampling,
    )
    surrogate.require(result, [entry.key for entry in unknowns])
    return result
