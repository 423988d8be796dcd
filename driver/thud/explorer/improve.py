"""Changes of one key with which a source conforms, or a floor meets a requirement."""

from __future__ import annotations

import math
from contextlib import suppress
from typing import TYPE_CHECKING, Any

import numpy as np

from thud.base._schema import MET_FROM, VERDICTS
from thud.base.checks import refuse
from thud.base.errors import ThudError
from thud.case.constructions import constructions
from thud.case.keys import find_key, limits, value_in, with_values
from thud.explorer.answer import new_case
from thud.explorer.form import field_of, lower, shown
from thud.explorer.models import facts_of
from thud.floors.prediction import predict_level
from thud.impact.compute import compute
from thud.impact.ensemble import solve_many

if TYPE_CHECKING:
    from collections.abc import Generator, Mapping

    from thud.case.case import Case
    from thud.level.rating import Requirement

    # Yields begin and end of the fraction of the work of the next step, and returns the answer.
    Work = Generator[tuple[float, float], None, dict[str, Any]]

# Changes of a parameter of a source, the smallest first, and number of drops in one call. If one
# conforms, the change that is smaller by half a step is tried, too.
STEP = 0.06
STEPS = np.exp(STEP * np.array([sign * i for i in range(1, 12) for sign in (1, -1)]))
BLOCK = 12
NOTE = "Changes conform by this model, with its numerical error; some are close to a limit."
# Layers of floors, which become thicker by 10 mm or softer by 10 % in each step, up to twice as
# thick or a fifth as stiff.
THICKNESSES = "thickness", "screed_thickness", "subceiling_thickness"
STIFFNESS = "layer_stiffness"
LAYER_STEPS = np.arange(1, 16)
FLOOR_NOTE = (
    "Each layer alone; the level need not fall with each step, as modes of the room move. A "
    f"requirement is met if its probability is at least {100 * MET_FROM:.0f} %."
)
# Keys of the structural floor, on which layers lie, and maximum number of proposed constructions.
STRUCTURES = {
    "plate": ("thickness", "density"),
    "laminate_floor": ("layer_thickness",),
    "joist_floor": ("spacing", "joist_width", "joist_height"),
}
MAX_NAMED = 3
# Significant digits of changed values.
DIGITS = 3


def improve(values: dict[str, dict[str, Any]]) -> Work:
    """Search for the smallest changes of one key each with which a source conforms.

    Of a case with a room, for those of one layer of the floor with which its requirement is met.
    What is not known of the source is not considered. The answer has the changes, or why there are
    none, and a note.
    """
    case = new_case(values)
    is_floor = case.room is not None and case.floor is not None
    return (yield from (_improve_floor if is_floor else _improve_source)(case))


def _improve_source(case: Case) -> Work:
    """Return the smallest change of each parameter of a source."""
    verdict = compute(case).assess()
    if verdict.conforms == VERDICTS[0]:
        return _answer(none="The source conforms already.", note=NOTE)
    names = facts_of(case).tuned
    work = [
        (name, tried[i : i + BLOCK])
        for name in names
        for tried in [_tried(case, name, STEPS)]
        for i in range(0, len(tried), BLOCK)
    ]
    found: dict[str, float] = {}
    for i, (name, block) in enumerate(work):
        if name in found:
            continue
        yield i / len(work), (i + 1) / len(work)
        conforms = solve_many({name: block}, case).conforms
        for value in np.array(block)[conforms].tolist():
            # Half a step less, too; with numerical errors, which many drops do not have.
            factor = value / value_in(case, name)
            less = factor * math.exp(math.copysign(STEP / 2, 1 - factor))
            found |= next(
                (
                    {name: tried}
                    for tried in _tried(case, name, np.array([less, factor]))
                    if compute(with_values(case, {name: tried})).assess().conforms == VERDICTS[0]
                ),
                {},
            )
            if name in found:
                break
    if found:
        changes = [_change(case, name, value) for name, value in found.items()]
        changes.sort(key=lambda change: abs(math.log(change["factor"])))
        return _answer(changes, note=NOTE)
    if not names:
        return _answer(none="This model has no parameters to change.")
    tried = ", ".join(lower(field_of(case, name)["label"]) for name in names)
    none = (
        f"No change of a single parameter makes the source conform: tried {tried}, each from half "
        "to twice its value in steps of 6 %."
    )
    return _answer(none=none, note=NOTE)


def _improve_floor(case: Case) -> Work:
    """Return the smallest change of each layer of a floor that meets the requirement.

    Without one, constructions of the library on the same structural floor are tried.
    """
    prediction = predict_level(compute(case))
    required = prediction.requirement
    if required is None:
        refuse("the room has no requirement", "the required level, dB", subject="room.required")
    if required.verdict == VERDICTS[0]:
        return _answer(none="The requirement is met already.", note=FLOOR_NOTE)
    if prediction.source_notes:
        reason = " ".join(map(str, prediction.source_notes))
        none = f"No floor meets the requirement with this source: {reason}. Choose another source."
        return _answer(none=none)
    built = _constructions(case)
    reached = yield from _reach(case, built)
    changes, tried = [], []
    for name in (*THICKNESSES, STIFFNESS):
        if entries := reached.get(name):
            value, last = entries[-1]
            if last.verdict == VERDICTS[0]:
                changes.append(_change(case, name, value, f": {last}"))
            best = min((entry for _, entry in entries), key=lambda entry: entry.rating.level)
            field, start = field_of(case, name), value_in(case, name)
            ends = f"{shown(field, start, unit=False)} to {shown(field, value)}"
            tried.append(f"{lower(field['label'])} {ends}, {best}")
    if changes:
        return _answer(changes, note=FLOOR_NOTE)
    known = sorted(
        (entry.rating.level, f"{name}: {entry}")
        for name in built
        for _, entry in reached.get(name, ())
        if entry.verdict == VERDICTS[0]
    )
    none = "No change of a single layer meets the requirement."
    if tried:
        none += f" Tried, with the lowest level reached: {'; '.join(tried)}."
    note = "No construction of the library on the same structural floor meets it."
    if known:
        texts = "; ".join(text for _, text in known[:MAX_NAMED])
        note = f"Constructions of the library on the same structural floor that meet it: {texts}."
    return _answer(none=none, note=f"{note} {FLOOR_NOTE}")


def _reach(
    case: Case, built: Mapping[str, Case]
) -> Generator[tuple[float, float], None, dict[str, list[tuple[float, Requirement]]]]:
    """Return what is reached with the values of each layer, up to one that meets the requirement.

    If none does, also what is reached with constructions, by their names.
    """
    names = [*THICKNESSES, *([STIFFNESS] if getattr(case.floor, "screed_thickness", 0.0) else [])]
    work = [
        (name, value, with_values(case, {name: value}))
        for name in names
        if getattr(case.floor, name, 0.0)
        for value in _layer_values(case, name)
    ]
    work += [(name, math.nan, other) for name, other in built.items()]
    reached: dict[str, list[tuple[float, Requirement]]] = {}
    met: set[str] = set()
    for i, (name, value, other) in enumerate(work):
        if name in met or (name in built and met - built.keys()):
            continue
        yield i / len(work), (i + 1) / len(work)
        # Without a result, the next value is tried.
        with suppress(ThudError):
            required = predict_level(compute(other)).requirement
            if required:
                reached.setdefault(name, []).append((value, required))
                met |= {name} if required.verdict == VERDICTS[0] else set()
    return reached


def _answer(
    changes: list[dict[str, Any]] | None = None, none: str = "", note: str = ""
) -> dict[str, Any]:
    return {"changes": changes or [], "none": none, "note": note}


def _tried(case: Case, name: str, factors: np.ndarray[Any, Any]) -> list[float]:
    """Return the value of a key times factors, rounded, as far as they are allowed."""
    low, high = limits(find_key(name, case)[0], case)
    values = (float(f"{value:.{DIGITS}g}") for value in value_in(case, name) * factors)
    return [value for value in values if low < value < high]


def _layer_values(case: Case, name: str) -> list[float]:
    """Return the values of a layer that are tried."""
    if name == STIFFNESS:
        return _tried(case, name, 0.9**LAYER_STEPS)
    factors = 1 + 0.01 * LAYER_STEPS / value_in(case, name)
    return _tried(case, name, factors[factors <= 2])  # noqa: PLR2004 - twice as thick


def _constructions(case: Case) -> dict[str, Case]:
    """Return cases of the constructions with the structural floor of a case, by their names."""
    floor = case.floor
    keys = STRUCTURES.get(floor.name, ()) if floor else ()
    return {
        entry.name: entry.case(case)
        for entry in constructions().values()
        if keys and floor and entry.floor.name == floor.name
        if all(getattr(entry.floor, key) == getattr(floor, key) for key in keys)
    }


def _change(case: Case, name: str, value: float, reached: str = "") -> dict[str, Any]:
    """Return a change of a key for the page."""
    field, start = field_of(case, name), value_in(case, name)
    percent = f"{100 * (value / start - 1):+.1f}".replace("-", "−")
    instead = f"{shown(field, value)} instead of {shown(field, start)} ({percent} %)"
    return {
        "key": f"{field['group']}.{field['name']}",
        "value": value,
        "factor": value / start,
        "text": f"{field['label']} {instead}{reached}",
    }
