"""Content of ``report.json``: a machine-readable calibration report."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from thud.base._schema import LIMITS
from thud.base.bridge import version
from thud.level.estimate import CONFIDENCE, NOISE, REPEATABILITY
from thud.level.levels import BANDWIDTHS, get_bands
from thud.recordings.checks.plate import check_plate
from thud.recordings.measured_drop import ESTIMATES
from thud.recordings.recorded_levels import compare_methods
from thud.recordings.words import read_date
from thud.report.notes import sentences
from thud.report.rows import SCATTER

if TYPE_CHECKING:
    from collections.abc import Iterable

    from thud.base._schema import BandSet
    from thud.base.note import Note
    from thud.level.assessment import Criterion
    from thud.level.estimate import Estimate
    from thud.recordings.config import Config
    from thud.recordings.measured_drop import Drop
    from thud.recordings.recording import Origin, Recording

FORMAT = "thud calibration report 1"
# Code of the note on drops that the laboratory left out.
LEFT_OUT = "drop_left_out"
# Keys of the configuration, and values of a file, that a report repeats.
OF_THE_CONFIGURATION = (
    "laboratory", "ball", "serial", "temperature", "mass", "height", "mass_uncertainty",
    "height_uncertainty",
)  # fmt: skip
OF_A_FILE = ("name", "date", "calibration", "sample_rate", "drops")
# What ISO/IEC 17025:2017, 7.8.2 to 7.8.4, asks of a report, by the key that states it.
FIELDS = {
    "number": "number of the report",
    "laboratory": "laboratory",
    "address": "address of the laboratory",
    "client": "client",
    "ball": "ball",
    "serial": "serial number",
    "item": "description of the item",
    "state": "state of the item",
    "received": "date of receipt",
    "date": "date of the measurement",
    "issued": "date of issue",
    "place": "place",
    "procedure": "procedure",
    "traceability": "metrological traceability",
    "temperature": "temperature",
    "humidity": "humidity",
    "pressure": "air pressure",
    "authorized_by": "person who authorizes it",
}


def report_data(recording: Recording) -> dict[str, Any]:
    """Return the report of a recording as a JSON object; unknown values are None.

    Values are in SI units; uncertainties are standard uncertainties unless named expanded.
    """
    config, verdict = recording.config, recording.assess()
    methods = compare_methods(recording.drops)
    data: dict[str, Any] = {
        "format": FORMAT,
        "thud": version(),
        "name": recording.name,
        "source": verdict.source,
        **{key: getattr(config, key) for key in OF_THE_CONFIGURATION},
        "date": _dates([config.date] if config.date else [o.date for o in recording.origins]),
        "instruments": [vars(item) for item in config.instruments],
        "report": {
            **vars(config.report),
            "accreditation_mark": Path(config.report.accreditation_mark).name,
        },
        "properties": vars(config.properties),
        "calibration_uncertainty": recording.calibration_uncertainty,
        "verdict": verdict.conforms,
        "confidence": CONFIDENCE,
        "criteria": criteria_data(recording),
        "levels": {bands: _levels(recording, bands) for bands in BANDWIDTHS},
        "method_differences": {
            method: np.abs(values - methods["exact"]).max(axis=0).tolist()
            for method, values in methods.items()
        },
        "drops": [_drop(drop) for drop in recording.drops],
        "plate": [
            {"requirement": name, "met": met, "reason": str(note)}
            for name, (met, note) in check_plate(config.plate).items()
        ],
        "left_out": sentences(recording, lambda note: note.code == LEFT_OUT),
        "processing": sentences(
            recording, lambda note: not note.is_warning and note.code != LEFT_OUT
        ),
        "warnings": sentences(recording, lambda note: note.is_warning),
        "notes": [_note(note) for note in recording.own_notes],
        "files": [
            {
                **{key: getattr(origin, key) for key in OF_A_FILE},
                "sha256": origin.checksum,
                "notes": [_note(note) for note in origin.notes],
            }
            for origin in recording.origins
        ],
    }
    finite: dict[str, Any] = _finite(data)
    return finite


def json_bytes(data: dict[str, Any]) -> bytes:
    """Return the content of ``report.json``."""
    return (json.dumps(data, indent=1, allow_nan=False) + "\n").encode()


def criteria_data(recording: Recording) -> list[dict[str, Any]]:
    """Return the criteria of a recording with their budgets, as in ``report.json``.

    None: an uncertainty that is not stated, and the margin of an upper bound or a count. The
    uncertainty of a criterion lacks the contributions that are ``"excluded"``; ``"allowance"`` is
    the largest standard uncertainty by them with which ``"verdict_if_stated"`` holds.
    """
    verdict = recording.assess()
    average = recording.average()
    count = len(average.level)
    standard = [(lower, upper) for *_, lower, upper in LIMITS[verdict.source]]
    spreads = {
        name: _spread(getattr(drop, name).value for drop in recording.drops)
        for name in ("contact_time", "restitution")
    }
    rows = []
    for i, (criterion, default) in enumerate(zip(verdict.criteria, standard, strict=True)):
        is_level, estimate = i < count, criterion.estimate
        has_budget = bool(estimate.contributions)
        limits = criterion.lower, criterion.upper
        is_count = criterion.lower == criterion.upper
        rows.append(
            {
                "name": criterion.name,
                "unit": criterion.unit,
                "band": float(get_bands().nominal[i]) if is_level else None,
                "value": criterion.value,
                "uncertainty": estimate.uncertainty if has_budget else None,
                "freedom": estimate.freedom,
                "coverage_factor": estimate.coverage_factor,
                "expanded_uncertainty": estimate.expanded if has_budget else None,
                "excluded": _excluded(criterion),
                "verdict_if_stated": criterion.conforms_if_stated,
                "allowance": criterion.allowance,
                "upper_bound": estimate.upper_bound,
                "lower": criterion.lower,
                "upper": criterion.upper,
                "limits_of_standard": limits == default,
                "margin": None if estimate.upper_bound or is_count else criterion.margin,
                "probability": criterion.probability,
                "verdict": criterion.conforms,
                "spread": float(average.spread[i]) if is_level else spreads.get(criterion.name),
                "background": float(average.background[i]) if is_level else None,
                "flag": str(average.flag[i]) if is_level else "",
                "contributions": [
                    {**vars(part), "kind": part.kind, "sensitivity": part.sensitivity}
                    for part in estimate.contributions
                ],
            }
        )
    return [_finite(row) for row in rows]


def _dates(texts: Iterable[str]) -> str:
    """Return the day of a measurement, or its first and last day; empty if not stated."""
    stated = [text for text in dict.fromkeys(texts) if text.strip()]
    dates = [read_date(text) for text in stated]
    days = sorted({date.date().isoformat() for date in dates if date})
    if not days or None in dates:
        days = stated
    return " to ".join(dict.fromkeys([days[0], days[-1]])) if days else ""


def _excluded(criterion: Criterion) -> list[str]:
    """Return the contributions that the uncertainty of a criterion should have, but lacks."""
    lacking = list(criterion.estimate.not_stated)
    names = {part.name for part in criterion.estimate.contributions}
    if NOISE in names and REPEATABILITY not in names:
        lacking.append(SCATTER)
    return [] if math.isnan(criterion.value) else lacking


def missing_fields(config: Config, origins: Iterable[Origin]) -> list[str]:
    """Return what ISO/IEC 17025 asks of a report and neither laboratory nor files have stated."""
    stated = {**vars(config.report), **vars(config)}
    stated["date"] = config.date or any(origin.date for origin in origins)
    missing = [title for key, title in FIELDS.items() if stated[key] in ("", (), None, False)]
    certified = [item.certificate for item in config.instruments]
    if not certified:
        missing.append("instruments")
    elif not all(certified):
        missing.append("certificates of instruments")
    return missing


def _levels(recording: Recording, bands: BandSet) -> dict[str, Any]:
    average = recording.average(bands)
    columns = ("background", "spread", "flag")
    return {
        "band": get_bands(bands).nominal.tolist(),
        "method": recording.case.levels.method,
        "level": average.level.tolist(),
        "uncertainty": [estimate.uncertainty for estimate in average.estimates],
        "expanded_uncertainty": [estimate.expanded for estimate in average.estimates],
        **{name: getattr(average, name).tolist() for name in columns},
        "drops": average.drops.level.tolist(),
    }


def _drop(drop: Drop) -> dict[str, Any]:
    return {
        "name": drop.name,
        "onset": drop.onset,
        **{name: _estimate(getattr(drop, name)) for name in ESTIMATES},
        "restitution_method": " and ".join(drop.restitutions),
        "restitutions": {method: _estimate(value) for method, value in drop.restitutions.items()},
        "bounce": drop.bounce,
        "noise": drop.noise,
        "notes": [_note(note) for note in drop.notes],
    }


def _note(note: Note) -> dict[str, Any]:
    return {**vars(note), "is_warning": note.is_warning, "message": note.message}


def _estimate(estimate: Estimate) -> dict[str, float]:
    return {"value": estimate.value, "uncertainty": estimate.uncertainty}


def _spread(values: Iterable[float]) -> float:
    known = [value for value in values if math.isfinite(value)]
    return float(np.std(known, ddof=1)) if len(known) > 1 else math.nan


def _finite(value: Any) -> Any:  # noqa: ANN401 - of JSON
    """Return a JSON value with None for numbers that are not finite."""
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_finite(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
