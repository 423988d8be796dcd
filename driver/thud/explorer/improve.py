"""Changes that help, for the page: of a source, and of a floor; fits to recordings."""

from __future__ import annotations

import math
import warnings
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from thud.base._schema import LIMITS, MET_FROM, VERDICTS, FiniteElement
from thud.base.checks import refuse
from thud.base.errors import ThudError
from thud.base.units import scaled
from thud.case.constructions import constructions
from thud.case.keys import find_key, limits, value_in, with_values
from thud.explorer.answer import new_case
from thud.explorer.criteria import model_headline
from thud.explorer.form import fields_by_key
from thud.explorer.messages import lower
from thud.explorer.models import MODEL_FACTS, Facts
from thud.explorer.recording import read_copies
from thud.floors.prediction import predict_level
from thud.impact.compute import compute
from thud.impact.ensemble import solve_many
from thud.studies.fit import fit
from thud.studies.fitting.force_target import ForceTarget

if TYPE_CHECKING:
    from collections.abc import Generator, Mapping, Sequence

    from thud.base._schema import FloorOptions
    from thud.case.case import Case
    from thud.level.assessment import Criterion
    from thud.level.rating import Requirement
    from thud.studies.fitting.fit_result import Fit

    Values = dict[str, dict[str, Any]]
    # Yields begin and end of the fraction of the work of the next step, and returns the answer.
    Work = Generator[tuple[float, float], None, dict[str, Any]]
    Search = Generator[tuple[float, float], None, dict[str, Any] | None]

# Largest factor by which a parameter is changed, relative step of the search, and number of
# bisections of a step.
MAX_FACTOR = 2.0
STEP = 0.02
BISECTIONS = 6
# Elements through the wall and from pole to pole in the search; the mesh of the case decides.
MESH = 6, 64
# Minimum number of drops in a block of the search.
BLOCK = 10
# Maximum number of further steps if the source does not conform with the mesh of the case.
FURTHER_STEPS = 5
# Keys of the structural floor, on which layers lie, and maximum number of proposed constructions.
STRUCTURES = {
    "plate": ("thickness", "density"),
    "laminate_floor": ("layer_thickness",),
    "joist_floor": ("spacing", "joist_width", "joist_height"),
}
MAX_NAMED = 3
# Layers of floors, the step of a thickness, m, and of a stiffness, and the maximum number of steps.
LAYERS = "thickness", "screed_thickness", "layer_stiffness", "subceiling_thickness"
THICKNESS_STEP = 0.01
STIFFNESS_STEP = 0.1
FLOOR_STEPS = 15
FLOOR_NOTE = (
    "Each layer alone; the level need not fall with each step, as modes of the room move. A "
    f"requirement is met if its probability is at least {100 * MET_FROM:.0f} %."
)
# Margins that a change leaves besides the numerical error: of a level, dB, and of another criterion
# over the width of its range.
LEVEL_MARGIN = 0.1
OTHER_MARGIN = 0.02
NOTE = (
    f"Each change leaves {LEVEL_MARGIN:g} dB to the limits of levels and {100 * OTHER_MARGIN:g} % "
    "of the range to those of other criteria, besides the numerical error."
)
# Significant digits of changed values.
DIGITS = 3


def improve(values: Values) -> Work:
    """Search for each parameter of the source the smallest change with which it conforms.

    The change leaves a margin, see `_conforms`. Only one parameter is changed at a time; what is
    not known of the source is not considered.
    """
    case = new_case(values)
    if case.room is not None and case.floor is not None:
        return (yield from _improve_floor(case))
    impact = compute(case)
    verdict = impact.assess()
    if verdict.conforms == VERDICTS[0]:
        return {"changes": [], "none": "The source conforms already.", "note": NOTE}
    model = case.model.name if case.model else ""
    names = _facts(model).tuned
    changes = []
    for i, name in enumerate(names):
        change = yield from _smallest_change(case, name, i / len(names), 1 / len(names))
        if change:
            changes.append(change)
    changes.sort(key=lambda change: abs(math.log(change["factor"])))
    if changes:
        return {"changes": changes, "none": "", "note": NOTE}
    labels = ", ".join(lower(_field(case, name)["label"]) for name in names)
    headline = model_headline(verdict)
    reason = "".join(headline[part] for part in ("words", "why", "also"))
    none = (
        f"No change of a single parameter makes the source conform: tried {labels}, each from half "
        f"to twice its value in steps of {100 * STEP:g} %. It {reason}."
    )
    if not names:
        none = "This model has no parameters to change."
    return {"changes": [], "none": none, "note": NOTE}


def _improve_floor(case: Case) -> Work:
    """Search for each layer of a floor the smallest change that meets the requirement of the room.

    Thicknesses grow in steps of 10 mm, stiffnesses fall in steps of 10 %. The level need not fall
    with each step, so the first step is the smallest. Two answers are given where both exist: with
    a level at the limit, and with a requirement that is met. Without the latter, constructions of
    the library on the same structural floor are tried.
    """
    prediction = predict_level(compute(case))
    required = prediction.requirement
    if required is None:
        refuse("the room has no requirement", "the required level, dB", subject="room.required")
    if required.verdict == VERDICTS[0]:
        return {"changes": [], "none": "The requirement is met already.", "note": FLOOR_NOTE}
    if prediction.source_notes:
        reason = " ".join(map(str, prediction.source_notes))
        none = f"No floor meets the requirement with this source: {reason}. Choose another source."
        return {"changes": [], "none": none, "note": ""}
    names = [name for name in LAYERS if _has_layer(case.floor, name)]
    changes, reached = [], []
    # The last fraction of the work are the constructions of the library.
    length = 1 / (len(names) + 1)
    for i, name in enumerate(names):
        found, best = yield from _floor_changes(case, name, i * length, length)
        changes += found
        if best:
            reached.append(best)
    none = ""
    if not changes:
        none = "No change of a single layer meets the requirement."
        if not names:
            none = "This floor has no single layer that could be changed."
        elif reached:
            none += f" Tried, with the lowest level reached: {'; '.join(reached)}."
    note = FLOOR_NOTE
    if not changes:
        built = yield from _constructions_that_meet(case, len(names) * length, length)
        known = "Constructions of the library on the same structural floor that meet it: "
        missing = "No construction of the library on the same structural floor meets it."
        note = f"{known}{'; '.join(built)}." if built else missing
        note += f" {FLOOR_NOTE}"
    return {"changes": changes, "none": none, "note": note}


def _has_layer(floor: FloorOptions | None, name: str) -> bool:
    """Whether a floor has the layer of a key; a resilient layer only lies below a screed."""
    owner = "screed_thickness" if name == "layer_stiffness" else name
    return bool(getattr(floor, owner, 0.0)) and hasattr(floor, name)


def _floor_changes(
    case: Case, name: str, begin: float, length: float
) -> Generator[tuple[float, float], None, tuple[list[dict[str, Any]], str]]:
    """Return the smallest change of a layer that meets the requirement, if one does.

    Also return the tried values, and the lowest level, in words.
    """
    start = float(getattr(case.floor, name))
    _, high = limits(find_key(name, case)[0], case)
    steps = range(1, FLOOR_STEPS + 1)
    if name == "layer_stiffness":
        tried = [start * (1 - STIFFNESS_STEP) ** i for i in steps]
    else:
        tried = [start + THICKNESS_STEP * i for i in steps if THICKNESS_STEP * i <= start]
    tried = [float(f"{value:.{DIGITS}g}") for value in tried if value <= high]
    changes: list[dict[str, Any]] = []
    levels: dict[float, Requirement] = {}
    for i, value in enumerate(tried):
        yield begin + length * i / len(tried), begin + length * (i + 1) / len(tried)
        required = _requirement(with_values(case, {name: value}))
        if required is None:
            break
        levels[value] = required
        if required.verdict == VERDICTS[0]:
            change = _change(case, name, start, value)
            change["text"] += f": {required}"
            changes.append(change)
            break
    if not levels:
        return changes, ""
    field, best = _field(case, name), min(levels.values(), key=lambda entry: entry.rating.level)
    ends = (f"{scaled(value, -field['power']):.3g}" for value in (start, list(levels)[-1]))
    return changes, f"{lower(field['label'])} {' to '.join(ends)} {field['unit']}, {best}"


def _requirement(case: Case) -> Requirement | None:
    """Return the verdict on the requirement of the room of a case; None without a result."""
    try:
        return predict_level(compute(case)).requirement
    except ThudError:
        return None


def _constructions_that_meet(
    case: Case, begin: float, length: float
) -> Generator[tuple[float, float], None, list[str]]:
    """Return constructions on the same structural floor that meet the requirement, in words.

    They are at most `MAX_NAMED`, that with the lowest level first.
    """
    assert case.floor is not None  # noqa: S101 - that of a room
    keys = STRUCTURES.get(case.floor.name, ())
    entries = [
        entry
        for entry in constructions().values()
        if keys
        and entry.floor.name == case.floor.name
        and all(getattr(entry.floor, key) == getattr(case.floor, key) for key in keys)
    ]
    result = {}
    for i, entry in enumerate(entries):
        yield begin + length * i / len(entries), begin + length * (i + 1) / len(entries)
        required = _requirement(entry.case(case))
        if required and required.verdict == VERDICTS[0]:
            result[f"{entry.name}: {required}"] = required.rating.level
    return sorted(result, key=lambda text: result[text])[:MAX_NAMED]


def _facts(model: str) -> Facts:
    return MODEL_FACTS.get(model, Facts())


def _field(case: Case, name: str) -> Mapping[str, Any]:
    key, _ = find_key(name, case)
    return fields_by_key()[key.group, key.name]


def _smallest_change(case: Case, name: str, begin: float, length: float) -> Search:
    """Return the smallest change of a parameter with which the source conforms; None: none.

    The search goes outwards from the value of the case, in blocks; `begin` and `length` are its
    fraction of the work.
    """
    start = value_in(case, name)
    if not isinstance(start, int | float) or not start > 0:
        return None
    low, high = _range(case, name)
    count = math.ceil(math.log(MAX_FACTOR) / STEP)
    exponents = STEP * np.array([sign * i for i in range(1, count + 1) for sign in (1, -1)])
    columns = start * np.exp(exponents)
    exponents = exponents[(columns > low) & (columns < high)]
    coarse = _coarse(case)
    blocks = np.array_split(exponents, max(1, len(exponents) // BLOCK))
    for i, block in enumerate(blocks):
        yield begin + length * i / len(blocks), begin + length * (i + 1) / len(blocks)
        if not block.size:
            continue
        conforms = np.array(solve_many({name: start * np.exp(block)}, coarse).conforms, dtype=bool)
        for exponent in block[conforms]:
            if value := _refined(case, coarse, name, float(exponent)):
                return _change(case, name, start, value)
    return None


def _range(case: Case, name: str) -> tuple[float, float]:
    """Return the limits of a parameter; those of the standards if it is a criterion itself."""
    low, high = limits(find_key(name, case)[0], case)
    for criterion, _, *ends in LIMITS[case.limits.source]:
        if criterion == name:
            low, high = max(low, ends[0]), min(high, ends[1])
    return low, high


def _coarse(case: Case) -> Case:
    """Return a case of finite elements with the mesh of the search."""
    if not isinstance(case.model, FiniteElement) or case.model.radial_elements:
        return case
    radial, polar = MESH
    model = replace(case.model, radial_elements=radial, polar_elements=polar)
    return replace(case, model=model)


def _refined(case: Case, coarse: Case, name: str, exponent: float) -> float | None:
    """Return a rounded value near the least change that conforms; None if there is none near it."""
    start = float(value_in(case, name) or 0.0)
    inner, outer = exponent - math.copysign(STEP, exponent), exponent
    for _ in range(BISECTIONS):
        middle = (inner + outer) / 2
        if _conforms(coarse, name, start * math.exp(middle)):
            outer = middle
        else:
            inner = middle
    for i in range(FURTHER_STEPS):
        exact = start * math.exp(outer + i * math.copysign(STEP / 4, exponent))
        size = 10.0 ** (math.floor(math.log10(exact)) - DIGITS + 1)
        steps = math.ceil(exact / size) if exponent > 0 else math.floor(exact / size)
        value = float(f"{steps * size:.12g}")
        if _conforms(case, name, value):
            return value
    return None


def _conforms(case: Case, name: str, value: float) -> bool:
    """Whether the source conforms with a value of a parameter, with margins to the limits."""
    try:
        verdict = compute(with_values(case, {name: value})).assess()
    except ThudError:
        return False
    return verdict.conforms == VERDICTS[0] and all(map(_has_margin, verdict.criteria))


def _has_margin(criterion: Criterion) -> bool:
    """Whether a criterion that is met leaves a margin besides its numerical error."""
    width = criterion.upper - criterion.lower
    margin = LEVEL_MARGIN if criterion.unit == "dB" else OTHER_MARGIN * width
    return criterion.margin - criterion.estimate.expanded >= margin


def _change(case: Case, name: str, start: float, value: float) -> dict[str, Any]:
    """Return a change of a parameter for the page."""
    field = _field(case, name)
    before, after = (float(f"{scaled(x, -field['power']):.6g}") for x in (start, value))
    percent = f"{100 * (value / start - 1):+.1f}".replace("-", "−")
    unit = f" {field['unit']}" if field["unit"] else ""
    return {
        "key": f"{field['group']}.{field['name']}",
        "value": value,
        "factor": value / start,
        "text": f"{field['label']} {after:g}{unit} instead of {before:g}{unit} ({percent} %)",
    }


def fit_recording(
    paths: Sequence[str], table: Mapping[str, object], values: Values
) -> dict[str, Any]:
    """Fit parameters of a model to the first drop of a recording.

    Returns
    -------
    dict
        Values of the case with the fitted ones and what the recording states (``"values"``), a
        text with their intervals, and details of the fit.
    """
    recording = read_copies(paths, table)
    stated = {"height": recording.config.height, "mass": recording.config.mass}
    case = new_case(values)
    known = {key: value for key, value in stated.items() if value is not None}
    case = with_values(case, known)
    model = case.model.name if case.model else ""
    parameters = _facts(model).fitted
    if not parameters:
        refuse(
            f"the model {model} has no parameters that a recording determines",
            ", ".join(name for name, facts in MODEL_FACTS.items() if facts.fitted),
        )
    restitution = recording.restitution
    if not math.isnan(restitution) and not 0 < restitution <= 1:
        shown = f"{restitution:.2f}".replace("-", "−")
        refuse(
            f"the restitution of the recording is {shown}: no ball can be fitted to it",
            "0 to 1; check mass, drop height, calibration, drops and polarity",
        )
    with warnings.catch_warnings():
        # They are part of the text.
        warnings.simplefilter("ignore")
        result = fit(ForceTarget(recording), parameters, case)
    fitted = {name: result.values[name] for name in parameters}
    intervals = result.intervals()
    texts = []
    for name, value in fitted.items():
        field = _field(case, name)
        best, low, high = (f"{scaled(x, -field['power']):.4g}" for x in (value, *intervals[name]))
        ends = f"{low} to {high}" if np.isfinite(intervals[name]).all() else "not determined"
        texts.append(f"{lower(field['label'])} {best} ({ends}) {field['unit']}".strip())
    for name, value in (known | fitted).items():
        key, _ = find_key(name, case)
        values.setdefault(key.group, {})[key.name] = value
    details = " ".join(f"{text[:1].upper()}{text[1:]}." for text in map(str, result.warnings))
    text = f"Fitted to {Path(paths[0]).name}: {', '.join(texts)} (95 %){_misfit_text(result)}"
    text += " The verdict is that of the best values, not of their intervals."
    return {"values": values, "text": text, "details": details}


def _misfit_text(result: Fit) -> str:
    """Return the end of a sentence on a fit: the largest residual, if it is more than the noise."""
    unexplained = next((note for note in result.warnings if note.code == "unexplained"), None)
    if unexplained is None:
        return "."
    columns = {name: np.asarray(values) for name, values in result.targets[0].columns().items()}
    residual = np.abs(columns["residual_N"])
    percent = 100 * residual.max() / columns["target_N"].max()
    return (
        f", but {unexplained}; the largest residual is {residual.max():.0f} N, "
        f"{percent:.2g} % of the peak."
    )
