"""Content of a calibration report: what its page and tables state, and ``report.json``."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

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
    from thud.level.assessment import Criterion, Verdict
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
# Keys of a configuration that state what ISO/IEC 17025:2017, 7.8.2 to 7.8.4, asks of a report.
REQUIRED = (
    "number", "laboratory", "address", "client", "ball", "serial", "item", "state", "received",
    "date", "issued", "place", "procedure", "traceability", "temperature", "humidity", "pressure",
    "authorized_by",
)  # fmt: skip


@dataclass(frozen=True)
class ReportCriterion:
    """A criterion with what a report states beside it; NaN where a number is not known."""

    criterion: Criterion
    # Standard deviation of single drops, level of the background, and what this does to a level.
    spread: float
    background: float
    flag: str
    # Contributions that the uncertainty should have, but lacks.
    excluded: tuple[str, ...]
    # Whether the limits are not those of the standards.
    has_own_limits: bool

    @property
    def expanded(self) -> float:
        """Expanded uncertainty; NaN if no contribution is stated."""
        estimate = self.criterion.estimate
        return estimate.expanded if estimate.contributions else math.nan

    @property
    def margin(self) -> float:
        """Distance to the nearer limit; NaN for an upper bound or a single allowed value."""
        criterion = self.criterion
        has_range = criterion.lower < criterion.upper and not criterion.estimate.upper_bound
        return criterion.margin if has_range else math.nan


@dataclass(frozen=True)
class ReportData:
    """What the page of a report, its tables and ``report.json`` state."""

    recording: Recording
    criteria: tuple[ReportCriterion, ...]
    # Day of the measurement, or its first and last day; empty if not stated.
    date: str
    # Sentences on drops that were left out, on what was done, and on possible faults.
    left_out: list[str]
    processing: list[str]
    warnings: list[str]

    @property
    def verdict(self) -> Verdict:
        """Verdict on the source."""
        return self.recording.assess()


def report_data(recording: Recording) -> ReportData:
    """Return the content of the report of a recording."""
    date = recording.config.date
    return ReportData(
        recording,
        report_criteria(recording),
        _dates([date] if date else [origin.date for origin in recording.origins]),
        sentences(recording, lambda note: note.code == LEFT_OUT),
        sentences(recording, lambda note: not note.is_warning and note.code != LEFT_OUT),
        sentences(recording, lambda note: note.is_warning),
    )


def report_criteria(recording: Recording) -> tuple[ReportCriterion, ...]:
    """Return the criteria of a recording with what a report states beside them."""
    verdict, average = recording.assess(), recording.average()
    count = len(verdict.criteria) - len(average.level)
    spread, background = (
        np.pad(values, (0, count), constant_values=np.nan).tolist()
        for values in (average.spread, average.background)
    )
    entries = zip(
        verdict.criteria, spread, background, [*average.flag.tolist(), *[""] * count],
        LIMITS[verdict.source], strict=True,
    )  # fmt: skip
    spreads = {name: _spread(recording, name) for name in ("contact_time", "restitution")}
    return tuple(
        ReportCriterion(
            criterion, spreads.get(criterion.name, own_spread), level, flag, _excluded(criterion),
            (criterion.lower, criterion.upper) != (lower, upper),
        )
        for criterion, own_spread, level, flag, (*_, lower, upper) in entries
    )  # fmt: skip


def json_bytes(data: ReportData) -> bytes:
    """Return the content of ``report.json``: values in SI units, None for unknown numbers.

    Uncertainties are standard uncertainties unless named expanded.
    """
    recording, config = data.recording, data.recording.config
    methods = compare_methods(recording.drops)
    members = {
        "format": FORMAT,
        "thud": version(),
        "name": recording.name,
        "source": data.verdict.source,
        **{key: getattr(config, key) for key in OF_THE_CONFIGURATION},
        "date": data.date,
        "instruments": [vars(item) for item in config.instruments],
        "report": {
            **vars(config.report),
            "accreditation_mark": Path(config.report.accreditation_mark).name,
        },
        "properties": vars(config.properties),
        "calibration_uncertainty": recording.calibration_uncertainty,
        "verdict": data.verdict.conforms,
        "confidence": CONFIDENCE,
        "criteria": [criterion_members(entry) for entry in data.criteria],
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
        "left_out": data.left_out,
        "processing": data.processing,
        "warnings": data.warnings,
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
    return (json.dumps(_finite(members), indent=1, allow_nan=False) + "\n").encode()


def criterion_members(entry: ReportCriterion) -> dict[str, object]:
    """Return a criterion as an object of ``report.json``.

    The uncertainty lacks the contributions that are ``"excluded"``; ``"allowance"`` is the largest
    standard uncertainty by them with which ``"verdict_if_stated"`` holds.
    """
    criterion, estimate = entry.criterion, entry.criterion.estimate
    band = criterion.name.removeprefix("octave_").replace("_", ".")
    members = {
        "name": criterion.name,
        "unit": criterion.unit,
        "band": float(band) if criterion.unit == "dB" else None,
        "value": criterion.value,
        "uncertainty": estimate.uncertainty if estimate.contributions else None,
        "freedom": estimate.freedom,
        "coverage_factor": estimate.coverage_factor,
        "expanded_uncertainty": entry.expanded,
        "excluded": [*entry.excluded],
        "verdict_if_stated": criterion.conforms_if_stated,
        "allowance": criterion.allowance,
        "upper_bound": estimate.upper_bound,
        "lower": criterion.lower,
        "upper": criterion.upper,
        "limits_of_standard": not entry.has_own_limits,
        "margin": entry.margin,
        "probability": criterion.probability,
        "verdict": criterion.conforms,
        "spread": entry.spread,
        "background": entry.background,
        "flag": entry.flag,
        "contributions": [
            {**vars(part), "kind": part.kind, "sensitivity": part.sensitivity}
            for part in estimate.contributions
        ],
    }
    return {name: _finite(value) for name, value in members.items()}


def _dates(texts: Iterable[str]) -> str:
    """Return the day of a measurement, or its first and last day; empty if not stated."""
    stated = [text for text in dict.fromkeys(texts) if text.strip()]
    dates = [read_date(text) for text in stated]
    days = sorted({date.date().isoformat() for date in dates if date})
    if not days or None in dates:
        days = stated
    return " to ".join(dict.fromkeys([days[0], days[-1]])) if days else ""


def _excluded(criterion: Criterion) -> tuple[str, ...]:
    """Return the contributions that the uncertainty of a criterion should have, but lacks."""
    lacking = list(criterion.estimate.not_stated)
    names = {part.name for part in criterion.estimate.contributions}
    if NOISE in names and REPEATABILITY not in names:
        lacking.append(SCATTER)
    return () if math.isnan(criterion.value) else tuple(lacking)


def missing_keys(config: Config, origins: Iterable[Origin]) -> list[str]:
    """Return the keys of what ISO/IEC 17025 asks and neither laboratory nor files have stated."""
    stated = {**vars(config.report), **vars(config)}
    stated["date"] = config.date or any(origin.date for origin in origins)
    missing = [key for key in REQUIRED if stated[key] in ("", (), None, False)]
    if not config.instruments:
        missing.append("instruments")
    elif not all(item.certificate for item in config.instruments):
        missing.append("instruments: certificate")
    return missing


def _levels(recording: Recording, bands: BandSet) -> dict[str, object]:
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


def _drop(drop: Drop) -> dict[str, object]:
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


def _note(note: Note) -> dict[str, object]:
    return {**vars(note), "is_warning": note.is_warning, "message": note.message}


def _estimate(estimate: Estimate) -> dict[str, float]:
    return {"value": estimate.value, "uncertainty": estimate.uncertainty}


def _spread(recording: Recording, name: str) -> float:
    known = [value for d in recording.drops if math.isfinite(value := getattr(d, name).value)]
    return float(np.std(known, ddof=1)) if len(known) > 1 else math.nan


def _finite(value: object) -> object:
    """Return a JSON value with None for numbers that are not finite."""
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_finite(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
