"""Criteria of the standards on the page: sources of the limits, explanations, and the headline."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from thud.level.assessment import VERDICTS
from thud.report.page import STANDARDS
from thud.studies.model_verdict import OUTCOMES

if TYPE_CHECKING:
    from collections.abc import Sequence

    from thud.base._schema import LimitsSource
    from thud.floors.prediction import RoomPrediction
    from thud.level.assessment import Criterion, Verdict
    from thud.studies.model_verdict import ModelCriterion, ModelVerdict

# Results of a headline by that of a verdict, of a model or of a requirement.
RESULTS = {
    VERDICTS[0]: "conforms",
    VERDICTS[1]: "fails",
    VERDICTS[2]: "undecided",
    OUTCOMES[2]: "undecided",
    "met": "conforms",
    "not met": "fails",
    "undecided": "undecided",
}
# Maximum number of criteria in a headline.
MAX_NAMED = 2
TRANSCRIBED = "Nominal value and tolerance of these tables, from a published transcription."
OCTAVE = (
    "Force exposure level L_FE: the energy of the force on a rigid floor in this octave, dB re 1 N "
    "and 1 s."
)
# Explanations of the criteria that are not octave levels.
EXPLANATIONS = {
    "contact_time": (
        "Time from first touch to last release; in recordings the time above 1 % of the peak force."
    ),
    "restitution": (
        "Ratio of the velocities of the center of mass after and before the impact, 0 to 1."
    ),
    "peak_count": "Number of peaks of the force: a second one would be a second impact.",
    "mass": "Mass of the source.",
    "drop_height": "Height of the lowest point of the source above the floor before the drop.",
}
# Sources of limits that are not in the tables.
INTERPRETATIONS = {
    "peak_count": (
        "The standards ask for one peak without defining it: here a maximum on both sides of which "
        "the force falls by more than 10 % of the peak force."
    ),
    ("tyre", "drop_height"): (
        "The tables state no tolerance for the tyre: that of the rubber ball is used."
    ),
}


def criterion_facts(name: str, source: LimitsSource) -> dict[str, str]:
    """Return standard, source of the limits and explanation of a criterion."""
    return {
        "standard": STANDARDS.get(source, ""),
        "limit_source": INTERPRETATIONS.get((source, name), INTERPRETATIONS.get(name, TRANSCRIBED)),
        "explanation": EXPLANATIONS.get(name, OCTAVE),
    }


def source_headline(verdict: Verdict, model: ModelVerdict | None) -> dict[str, str]:
    """Return text, result and detail of the verdict on a source.

    The verdict of a model over what is not known goes before that of its values.
    """
    outcome = model.result if model else verdict.result
    result = RESULTS[outcome]
    if model:
        causes = [_range_text(entry) for entry in model.criteria if entry.result == outcome]
        detail = f"Probability of conformity {model.shown_probability} over what is not known."
    else:
        causes = [_cause(entry) for entry in verdict.criteria if entry.result == outcome]
        detail = f"Limits of the {verdict.source.replace('_', ' ')}: {STANDARDS[verdict.source]}."
    words = {"fails": VERDICTS[1]}.get(result, result)
    if result == "conforms":
        return {"text": words, "result": result, "detail": f"{_closest(verdict)} {detail}"}
    return {"text": f"{words}: {_listed(causes)}", "result": result, "detail": detail}


def room_headline(prediction: RoomPrediction) -> dict[str, str]:
    """Return text, result and detail of the level in a room; with a requirement, of its rating."""
    required = prediction.requirement
    name = f"{prediction.rated_name}{prediction.standards[0]}"
    if required:
        # A source that does not conform is named after the verdict.
        result = RESULTS[required.verdict.partition(":")[0]]
        text, parts = required.shown, [str(required), f"{name} {prediction.rated_text}"]
    else:
        result, text, parts = "level", prediction.rated_text, [f"{name} with its range"]
    if prediction.class_text:
        parts.append(f"KS F 2863-2: {prediction.class_text}")
    return {"text": text, "result": result, "detail": "; ".join(parts)}


def _listed(causes: Sequence[str]) -> str:
    """Return the first causes and the number of the others."""
    rest = len(causes) - MAX_NAMED
    more = f" and {rest} more" if rest > 0 else ""
    return "; ".join(causes[:MAX_NAMED]) + more


def _closest(verdict: Verdict) -> str:
    """Return the octave level that is closest to a limit, as a sentence."""
    octaves = [entry for entry in verdict.criteria if entry.unit == "dB"]
    closest = min(octaves, key=lambda entry: entry.margin)
    return f"Closest to a limit: {closest.quantity.title}, {closest.margin:.1f} dB."


def _cause(criterion: Criterion) -> str:
    """Return name, value and limit of a criterion that is not met or not decided."""
    quantity = criterion.quantity
    if math.isnan(criterion.value):
        return f"{quantity.title} not known"
    value, expanded = criterion.value, criterion.estimate.expanded
    if criterion.result == VERDICTS[1]:
        is_low = value < criterion.lower
        limit = criterion.lower if is_low else criterion.upper
        word = "below" if is_low else "above"
        shown = _shown(criterion, value)
        # A value close to its limit has all decimals.
        if _number(criterion, value) == _number(criterion, limit):
            shown = f"{quantity.show(value)} {quantity.display_unit}".rstrip()
        return f"{quantity.title} {shown}, {word} {limit * quantity.display_scale:g}"
    if not math.isfinite(expanded):
        return f"{quantity.title} {_shown(criterion, value)}, uncertainty not known"
    low, high = _number(criterion, value - expanded), _shown(criterion, value + expanded)
    return f"{quantity.title} {low} to {high}, limits {criterion.shown_limits}"


def _range_text(entry: ModelCriterion) -> str:
    """Return name, range and limits of a criterion over what is not known."""
    quantity = entry.criterion.quantity
    value = entry.range or _number(entry.criterion, entry.criterion.value)
    unit = f" {quantity.display_unit}" if quantity.display_unit else ""
    return f"{quantity.title} {value}{unit}, limits {entry.criterion.shown_limits}"


def _number(criterion: Criterion, value: float) -> str:
    quantity = criterion.quantity
    digits = max(quantity.decimals - 1, 1) if quantity.decimals else 0
    return f"{value * quantity.display_scale:z.{digits}f}"


def _shown(criterion: Criterion, value: float) -> str:
    return f"{_number(criterion, value)} {criterion.quantity.display_unit}".rstrip()


def glossary() -> dict[str, Any]:
    """Return the explanations of the criteria by their names."""
    return {"octave": OCTAVE, **{key.replace("_", " "): text for key, text in EXPLANATIONS.items()}}
