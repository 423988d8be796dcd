"""Criteria of the standards on the page: explanations, and what makes a level undecided."""

from __future__ import annotations

from typing import TYPE_CHECKING

from thud.base._schema import VERDICTS

if TYPE_CHECKING:
    from thud.base._schema import LimitsSource
    from thud.level.assessment import Verdict

# Code of a verdict; the page reads no words.
RESULTS = {verdict: verdict.replace(" ", "_") for verdict in VERDICTS}
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
    """Return source of the limits and explanation of a criterion."""
    return {
        "limit_source": INTERPRETATIONS.get((source, name), INTERPRETATIONS.get(name, TRANSCRIBED)),
        "explanation": EXPLANATIONS.get(name, OCTAVE),
    }


def largest_contribution(verdict: Verdict) -> tuple[str, str] | None:
    """Return the title of the first undecided level and its largest contribution, if any."""
    for entry in verdict.criteria:
        parts = [part for part in entry.estimate.contributions if part.counted]
        if entry.conforms_if_stated == VERDICTS[2] and entry.unit == "dB" and parts:
            return entry.quantity.title, max(parts, key=lambda part: part.uncertainty).name
    return None
