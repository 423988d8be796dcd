"""Changes of one key with which a source conforms, or a floor meets a requirement."""

from __future__ import annotations

import math
from contextlib import suppress
from typing import TYPE_CHECKING, Any

import numpy as np

from thud.base._schema import VERDICTS
from thud.base.errors import ThudError
from thud.case.constructions import constructions
from thud.case.keys import find_key, limits, value_in, with_values
from thud.explorer.answer import new_case
from thud.explorer.models import facts_of
from thud.floors.prediction import predict_level
from thud.impact.compute import compute
from thud.impact.ensemble import solve_many

if TYPE_CHECKING:
    from thud.case.case import Case

    Answer = dict[str, Any]

# Changes of a parameter of a source, the smallest first.
STEPS = np.exp(0.06 * np.array([sign * i for i in range(1, 12) for sign in (1, -1)]))
# Layers of floors, which become thicker by 10 mm or softer by 10 % in each step, up to twice as
# thick or a fifth as stiff.
THICKNESSES = "thickness", "screed_thickness", "subceiling_thickness"
STIFFNESS = "layer_stiffness"
LAYER_STEPS = np.arange(1, 16)
# Keys of the structural floor, on which layers lie, and maximum number of proposed constructions.
STRUCTURES = {
    "plate": ("thickness", "density"),
    "laminate_floor": ("layer_thickness",),
    "joist_floor": ("spacing", "joist_width", "joist_height"),
}
MAX_NAMED = 3
# Significant digits of changed values.
DIGITS = 3


def improve(values: dict[str, dict[str, Any]]) -> Answer:
    """Search for the smallest changes of one key each with which a source conforms.

    Of a case with a room, for those of one layer of the floor with which its requirement is met.
    What is not known of the source is not considered. The answer has the changes (key, value, and
    the level that is reached), or the code of the reason that there are none, and constructions of
    the library on the same structural floor that meet the requirement.
    """
    case = new_case(values)
    if case.room is None or case.floor is None:
        names = facts_of(case).tuned
        found = {name: _conforming(case, name) for name in names}
        changes = [_change(case, name, value) for name, value in found.items() if value]
        changes.sort(key=lambda change: abs(math.log(change["factor"])))
        return _answer(changes, "no_parameter" if names else "no_parameters")
    if predict_level(compute(case)).source_notes:
        return _answer([], "other_source")
    changes = [change for name in (*THICKNESSES, STIFFNESS) for change in _improved(case, name)]
    known = [] if changes else [{"name": name} | _reached(built) for name, built in _built(case)]
    known = sorted((entry for entry in known if "level" in entry), key=lambda one: one["level"])
    return _answer(changes, "no_layer", known[:MAX_NAMED])


def _answer(changes: list[Answer], reason: str, known: list[Answer] | None = None) -> Answer:
    return {"changes": changes, "reason": reason, "constructions": known or []}


def _change(case: Case, name: str, value: float, **reached: float) -> Answer:
    key, _ = find_key(name, case)
    factor = value / value_in(case, name)
    return {"key": f"{key.group}.{key.name}", "value": value, "factor": factor, **reached}


def _conforming(case: Case, name: str) -> float | None:
    """Return the value of a parameter, the least changed, with which the source conforms."""
    tried = _tried(case, name, STEPS)
    conforms = solve_many({name: tried}, case).conforms
    # Many drops have no numerical errors.
    return next(
        (
            value
            for value in np.array(tried)[conforms].tolist()
            if compute(with_values(case, {name: value})).assess().conforms == VERDICTS[0]
        ),
        None,
    )


def _improved(case: Case, name: str) -> list[Answer]:
    """Return the smallest change of a layer that meets the requirement, if there is one."""
    floor = case.floor
    if floor is None or not getattr(floor, name, 0.0) or not floor.keys[name].has_effect(floor):
        return []
    factors = 0.9**LAYER_STEPS
    if name != STIFFNESS:
        factors = 1 + 0.01 * LAYER_STEPS / value_in(case, name)
    for value in _tried(case, name, factors[factors <= 2]):  # noqa: PLR2004 - twice as thick
        if reached := _reached(with_values(case, {name: value})):
            return [_change(case, name, value, **reached)]
    return []


def _reached(case: Case) -> dict[str, float]:
    """Return level, standard uncertainty and probability where a requirement is met, else none."""
    with suppress(ThudError):
        prediction = predict_level(compute(case))
        if prediction.verdict == VERDICTS[0]:
            return {
                "level": prediction.rating.rounded,
                "uncertainty": prediction.rating.uncertainty,
                "probability": prediction.probability,
            }
    return {}


def _tried(case: Case, name: str, factors: np.ndarray[Any, Any]) -> list[float]:
    """Return the value of a key times factors, rounded, as far as they are allowed."""
    low, high = limits(find_key(name, case)[0], case)
    values = (float(f"{value:.{DIGITS}g}") for value in value_in(case, name) * factors)
    return [value for value in values if low < value < high]


def _built(case: Case) -> list[tuple[str, Case]]:
    """Return the constructions with the structural floor of a case: names and cases."""
    floor = case.floor
    keys = STRUCTURES.get(floor.name, ()) if floor else ()
    return [
        (entry.name, entry.case(case))
        for entry in constructions().values()
        if keys and floor and entry.floor.name == floor.name
        if all(getattr(entry.floor, key) == getattr(floor, key) for key in keys)
    ]
