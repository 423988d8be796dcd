"""Criteria of the standards on the page: sources of the limits, explanations, and the headline."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from thud.base._schema import VERDICTS
from thud.report.page import STANDARDS

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from thud.base._schema import LimitsSource
    from thud.level.assessment import Criterion, Verdict

# Code of a verdict; the page reads no words.
RESULTS = {verdict: verdict.replace(" ", "_") for verdict in VERDICTS}
# Maximum number of criteria with values in a headline.
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


def recording_headline(
    verdict: Verdict, shown: Mapping[str, str], excluded: str, *, is_stated: bool
) -> dict[str, str]:
    """Return the headline of the verdict on a recording, see `_headline`.

    `shown` are values with uncertainties by the name of a criterion. The detail of an undecided
    level names the largest contribution to its uncertainty; `excluded` is a sentence on what the
    uncertainty lacks, and `is_stated` whether the source is stated.
    """
    result = RESULTS[verdict.conforms]
    parts = [excluded, _standard(verdict)]
    largest = largest_contribution(verdict)
    if result == "undecided" and largest:
        parts.insert(0, "Largest contribution to the uncertainty of {}: {}.".format(*largest))
    if not is_stated:
        parts.append("The source is not stated: these limits are assumed.")
    detail = " ".join(filter(None, parts))
    return _headline(verdict, verdict.conforms, detail, shown)


def largest_contribution(verdict: Verdict) -> tuple[str, str] | None:
    """Return the title of the first undecided level and its largest contribution, if any."""
    for entry in verdict.criteria:
        parts = [part for part in entry.estimate.contributions if part.counted]
        if entry.conforms_if_stated == VERDICTS[2] and entry.unit == "dB" and parts:
            return entry.quantity.title, max(parts, key=lambda part: part.uncertainty).name
    return None


def model_headline(verdict: Verdict) -> dict[str, str]:
    """Return the headline of the verdict on a source by the values of its model."""
    detail = f"Values of this model only, from which others may differ. {_standard(verdict)}"
    return _headline(verdict, f"{verdict.conforms} by this model", detail)


def _headline(
    verdict: Verdict, words: str, detail: str, shown: Mapping[str, str] | None = None
) -> dict[str, str]:
    """Return the headline of a verdict by its values, with their causes or the closest limit."""
    result = RESULTS[verdict.conforms]
    if result == "conforms":
        return _texts(result, words, f"{_closest(verdict)} {detail}")
    entries = [entry for entry in verdict.criteria if entry.conforms == verdict.conforms]
    known = [entry for entry in entries if not math.isnan(entry.value)]
    parts = [_cause(entry, shown or {}) for entry in known[:MAX_NAMED]]
    rest = [f"also {', '.join(titles)}"] if (titles := _titles(known[MAX_NAMED:])) else []
    if unknown := _titles(entry for entry in entries if math.isnan(entry.value)):
        # Beside other criteria that are not named with their values, on wide screens only.
        (rest or parts).append(f"not known: {', '.join(unknown)}")
    return _texts(result, words, detail, f": {'; '.join(parts)}", "".join(f"; {x}" for x in rest))


def _titles(criteria: Iterable[Criterion]) -> list[str]:
    return [criterion.quantity.title for criterion in criteria]


def _texts(result: str, words: str, detail: str, why: str = "", also: str = "") -> dict[str, str]:
    """Return a headline: code of the result, words, causes, what narrow screens omit, detail."""
    return {"result": result, "words": words, "why": why, "also": also, "detail": detail}


def _standard(verdict: Verdict) -> str:
    return f"Limits of the {verdict.source.replace('_', ' ')}: {STANDARDS[verdict.source]}."


def _closest(verdict: Verdict) -> str:
    """Return the level that is closest to one of its limits, and its distance."""
    levels = (entry for entry in verdict.criteria if entry.unit == "dB")
    closest = min(levels, key=lambda entry: entry.margin)
    return f"Closest to a limit: {closest.quantity.title}, {closest.margin:.2f} dB."


def _cause(criterion: Criterion, shown: Mapping[str, str]) -> str:
    """Return name, value and limit of a criterion that is not met or not decided."""
    quantity, value, expanded = criterion.quantity, criterion.value, criterion.estimate.expanded
    text = f"{quantity.title} {quantity.show(value)} {quantity.display_unit}".rstrip()
    if criterion.conforms == VERDICTS[1]:
        is_low = value < criterion.lower
        limit = (criterion.lower if is_low else criterion.upper) * quantity.display_scale
        if criterion.name in shown:
            text = f"{quantity.title} {shown[criterion.name]}"
        return f"{text}, {'below' if is_low else 'above'} {limit:g}"
    if criterion.conforms_if_stated != criterion.conforms:
        return f"{text}, uncertainty of {' and '.join(criterion.estimate.not_stated)} not stated"
    if not math.isfinite(expanded):
        return f"{text}, uncertainty not known"
    low, high = (quantity.show(end) for end in (value - expanded, value + expanded))
    text = f"{quantity.title} {low} to {high} {quantity.display_unit}".rstrip()
    return f"{text}, limits {criterion.shown_limits}"
