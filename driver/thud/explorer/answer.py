"""Results of a case for the page, as data for JSON."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from thud.base._schema import QUANTITIES, SAMPLE_QUANTITIES, FiniteElement
from thud.base.checks import refuse
from thud.case.case import Case
from thud.case.keys import humanize
from thud.explorer.criteria import RESULTS, criterion_facts
from thud.explorer.floor import floor_answer, room_answer, section
from thud.explorer.messages import in_words
from thud.explorer.motion import motion_of
from thud.explorer.series import curve, to_json
from thud.floors.prediction import predict_level
from thud.impact.compute import compute
from thud.impact.contact_time import contact_force
from thud.level.levels import BANDWIDTHS, STANDARDS, get_bands

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from thud.base._schema import LimitsSource
    from thud.level.assessment import Criterion, Verdict
    from thud.recordings.recording import ImpactResult

    Answer = dict[str, Any]

# Time between instants of finite elements, s.
SNAPSHOT_INTERVAL = 1e-3
# Maximum number of samples of a record.
MAX_SAMPLES = 200_000
# Peaks of the force on the floor and of the elastic force.
PEAKS = "peak_force", "peak_elastic_force"


def new_case(values: Mapping[str, Mapping[str, object]]) -> Case:
    """Return the case of values by group and key from the page.

    Raise InputError if a value is not allowed, or TypeError or ValueError if its type is wrong.
    """
    case = Case.from_namelist(values)
    used = case.to_namelist()
    for group in values:
        if group not in used:
            problem = f"{humanize(group)}: does nothing with this model and floor"
            refuse(problem, ", ".join(map(humanize, used)), subject=group)
    samples = case.sampling.sample_rate * case.sampling.duration
    if samples > MAX_SAMPLES:
        problem = f"{samples:g} samples are too many for the page"
        refuse(problem, f"up to {MAX_SAMPLES}", subject="sampling.duration")
    return case


def answer_case(case: Case) -> Answer:
    """Return force, levels, verdict and warnings, and motion, floor and room if they exist."""
    if isinstance(case.model, FiniteElement):
        case = replace(case, model=replace(case.model, snapshot_interval=SNAPSHOT_INTERVAL))
    impact = compute(case)
    force = case.levels.force
    assessed = impact.assess()
    answer = common_answer(impact, assessed, *contact_force(impact, force))
    answer["force"]["kind"] = force
    notes = list(impact.notes)
    error = float(impact.level_error.max())
    # A warning states that the error is unknown.
    if not math.isnan(error):
        answer["numbers"].append(["numerical error of an octave up to", error, "dB"])
    on_floor = impact.on_floor
    answer["motion"] = None if case.floor else motion_of(impact)
    answer["section"] = section(case)
    answer["floor"] = None if on_floor is None else floor_answer(impact, on_floor)
    if case.room is not None and case.floor is not None:
        prediction = predict_level(impact)
        answer["room"] = room_answer(prediction)
        # Both name a source that does not conform.
        known = {note.code for note in notes}
        notes += [note for note in prediction.notes if note.code not in known]
    answer["warnings"] = list(dict.fromkeys(map(in_words, notes)))
    return answer


def common_answer(
    source: ImpactResult, verdict: Verdict, times: NDArray[np.float64], force: NDArray[np.float64]
) -> Answer:
    """Return the entries that all answers have; times are in ms, and `force` is in kN."""
    return {
        "force": curve(times, 1e3 * force),
        "levels": {
            "frequency": to_json(get_bands().nominal),
            "level": to_json(source.levels()),
            "thirds": {
                "frequency": to_json(get_bands(BANDWIDTHS[1]).nominal),
                "level": to_json(source.levels(BANDWIDTHS[1])),
            },
        },
        "criteria": [_criterion(criterion, verdict.source) for criterion in verdict.criteria],
        "result": RESULTS[verdict.conforms],
        "limits": {
            "source": humanize(verdict.source),
            "standard": STANDARDS.get(verdict.source, ""),
        },
        "numbers": _numbers(source),
        "warnings": [],
    }


def _numbers(source: ImpactResult) -> list[list[Any]]:
    """Return title, value, unit and name of known quantities, with the peak of the force."""
    other = PEAKS[source.assessed_force() == "floor"]
    rows: list[list[Any]] = []
    for name in SAMPLE_QUANTITIES:
        value, quantity = source.quantity(name), QUANTITIES[name]
        if name != other and not math.isnan(value):
            value = round(value * quantity.display_scale, quantity.decimals + 1)
            # One name for the peak of the force that is assessed.
            code = "peak" if name in PEAKS else name
            rows.append([quantity.title, value, quantity.display_unit, code])
    return rows


def _criterion(criterion: Criterion, source: LimitsSource) -> Answer:
    """Return a criterion for the page, in its display unit."""
    quantity, estimate = criterion.quantity, criterion.estimate
    scale = quantity.display_scale
    is_octave, band = criterion.name.rpartition("octave_")[1:]
    expanded = round(scale * estimate.expanded, 6)
    is_open = criterion.conforms_if_stated != criterion.conforms
    # Numerical errors are often too small to be shown.
    smallest = 0.5 * 10.0**-quantity.decimals if criterion.is_computed else 0.0
    return {
        "name": quantity.title,
        "band": band.replace("_", ".") if is_octave else "",
        "unit": quantity.display_unit,
        "value": None if np.isnan(criterion.value) else round(scale * criterion.value, 6),
        "value_text": quantity.show(criterion.value),
        "uncertainty": expanded if expanded > smallest and expanded < np.inf else None,
        "uncertainty_text": f"{scale * estimate.expanded:.{quantity.decimals}f}",
        "mark": "",
        "not_stated": list(estimate.not_stated) if is_open else [],
        "uncertainty_kind": "numerical" if criterion.is_computed else "measured",
        "lower": round(scale * criterion.lower, 6),
        "upper": round(scale * criterion.upper, 6),
        "result": RESULTS[criterion.conforms],
        **criterion_facts(criterion.name, source),
    }
