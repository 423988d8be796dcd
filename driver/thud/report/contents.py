"""What a calibration report says, for machines: the content of ``report.json``."""

from __future__ import annotations

import math
from datetime import datetime
from typing import TYPE_CHECKING, Any

import numpy as np

from thud.base.bridge import version
from thud.level.assessment import get_criteria
from thud.level.estimate import CONFIDENCE
from thud.level.levels import BANDWIDTHS, get_bands

if TYPE_CHECKING:
    from collections.abc import Iterable

    from thud.base._schema import BandSet, LimitsSource
    from thud.level.assessment import Criterion
    from thud.level.estimate import Estimate
    from thud.recordings.measured_drop import Drop
    from thud.recordings.recording import Recording

FORMAT = "thud calibration report 1"
DATE_FORMATS = ("%d.%m.%Y", "%Y/%m/%d", "%Y:%m:%d", "%d-%b-%y", "%d-%b-%Y", "%d %b %Y")
TIME_FORMATS = ("", " %H:%M:%S", " %H:%M")


def report_data(recording: Recording, source: LimitsSource | None = None) -> dict[str, Any]:
    """Return what the report of a recording says, as JSON has it; what is not known is None.

    Numbers are in SI units, uncertainties are standard ones unless named expanded.
    """
    config, verdict = recording.config, recording.assess(source)
    found: dict[str, Any] = {
        "format": FORMAT,
        "thud": version(),
        "name": recording.name,
        "source": verdict.source,
        "laboratory": config.laboratory,
        "ball": config.ball,
        "serial": config.serial,
        "date": _dates([config.date] if config.date else [one.date for one in recording.origins]),
        "temperature": config.temperature,
        "instruments": list(config.instruments),
        "mass": config.mass,
        "height": config.height,
        "mass_uncertainty": config.mass_uncertainty,
        "height_uncertainty": config.height_uncertainty,
        "calibration_uncertainty": recording.calibration_uncertainty,
        "verdict": verdict.result,
        "confidence": CONFIDENCE,
        "criteria": criteria_data(recording, source),
        "levels": {bands: _levels(recording, bands) for bands in BANDWIDTHS},
        "method_differences": {
            method: found.tolist() for method, found in recording.agreement().items()
        },
        "drops": [_drop(drop) for drop in recording.drops],
        "plate": [vars(one) for one in config.plate_checks],
        "steps": list(recording.level_steps),
        "warnings": list(recording.own_warnings),
        "outliers": [vars(one) for one in recording.outliers],
        "files": [
            {
                "name": one.name,
                "sha256": one.checksum,
                "date": one.date,
                "calibration": one.calibration,
                "sample_rate": one.sample_rate,
                "drops": one.drops,
                "steps": list(one.steps),
                "warnings": list(one.warnings),
            }
            for one in recording.origins
        ],
    }
    known: dict[str, Any] = _known(found)
    return known


def criteria_data(recording: Recording, source: LimitsSource | None = None) -> list[dict[str, Any]]:
    """Return the criteria of a recording with their budgets, as JSON has them.

    An uncertainty that nobody states is None; so is the margin of an upper bound or a count.
    """
    verdict = recording.assess(source)
    found: list[dict[str, Any]] = _known(_criteria(recording, verdict.source, verdict.criteria))
    return found


def read_date(text: str) -> datetime | None:
    """Return a date as files of many kinds write it; None where it is not understood.

    >>> read_date("03.05.2024").date().isoformat()
    '2024-05-03'
    """
    line = " ".join(text.split())
    try:
        return datetime.fromisoformat(line).replace(tzinfo=None)
    except ValueError:
        pass
    for form in (date + time for date in DATE_FORMATS for time in TIME_FORMATS):
        try:
            return datetime.strptime(line, form)  # noqa: DTZ007 - files name no zone
        except ValueError:
            continue
    return None


def _dates(texts: Iterable[str]) -> str:
    """Return the date of a measurement, or the first and the last, where files say it."""
    given = [text for text in dict.fromkeys(texts) if text.strip()]
    read = [read_date(text) for text in given]
    days = sorted({one.date().isoformat() for one in read if one})
    if not days or None in read:
        days = given
    return " to ".join(dict.fromkeys([days[0], days[-1]])) if days else ""


def _criteria(
    recording: Recording, source: LimitsSource, criteria: tuple[Criterion, ...]
) -> list[dict[str, Any]]:
    """Return the criteria with their budgets."""
    average = recording.average()
    count = len(average.level)
    standard = get_criteria(source)
    spreads = {f"{i}": float(average.spread[i]) for i in range(count)}
    for name in ("contact_time", "restitution"):
        spreads[name] = _spread(getattr(drop, name).value for drop in recording.drops)
    rows = []
    for i, (one, usual) in enumerate(zip(criteria, standard, strict=True)):
        is_level, estimate = i < count, one.estimate
        stated = bool(estimate.contributions)
        rows.append(
            {
                "name": one.name,
                "unit": one.unit,
                "band": float(get_bands().nominal[i]) if is_level else None,
                "value": one.value,
                "uncertainty": estimate.uncertainty if stated else None,
                "freedom": estimate.freedom,
                "coverage_factor": estimate.coverage_factor,
                "expanded_uncertainty": estimate.expanded if stated else None,
                "upper_bound": estimate.upper_bound,
                "lower": one.lower,
                "upper": one.upper,
                "limits_of_standard": (one.lower, one.upper) == (usual.lower, usual.upper),
                "margin": None if estimate.upper_bound or one.lower == one.upper else one.margin,
                "probability": one.probability,
                "verdict": one.result,
                "spread": spreads.get(f"{i}" if is_level else one.name),
                "background": float(average.background[i]) if is_level else None,
                "flag": str(average.flag[i]) if is_level else "",
                "contributions": [vars(part) for part in estimate.contributions],
            }
        )
    return rows


def _levels(recording: Recording, bands: BandSet) -> dict[str, Any]:
    """Return the levels of the average and of the drops."""
    average, budgets = recording.average(bands), recording.level_estimates(bands)
    columns = ("background", "spread", "flag", "drops")
    return {
        "band": get_bands(bands).nominal.tolist(),
        "method": average.method,
        "level": [one.value for one in budgets],
        "uncertainty": [one.uncertainty for one in budgets],
        "expanded_uncertainty": [one.expanded for one in budgets],
        **{name: getattr(average, name).tolist() for name in columns},
    }


def _drop(drop: Drop) -> dict[str, Any]:
    """Return what one drop tells."""
    estimates = ("contact_time", "restitution", "peak_force", "impulse", "effective_mass")
    return {
        "name": drop.name,
        "onset": drop.onset,
        **{name: _estimate(getattr(drop, name)) for name in estimates},
        "restitution_method": drop.restitution_method,
        "restitutions": {way: _estimate(one) for way, one in drop.restitutions.items()},
        "bounces": list(drop.bounces),
        "noise": drop.noise.deviation,
        "steps": list(drop.steps),
        "warnings": list(drop.warnings),
    }


def _estimate(one: Estimate) -> dict[str, float]:
    return {"value": one.value, "uncertainty": one.uncertainty}


def _spread(values: Iterable[float]) -> float:
    """Return the standard deviation of the values that are known; NaN of less than two."""
    known = [value for value in values if math.isfinite(value)]
    return float(np.std(known, ddof=1)) if len(known) > 1 else math.nan


def _known(value: Any) -> Any:  # noqa: ANN401 - of JSON
    """Return a value of JSON, in which numbers that are not finite are None."""
    if isinstance(value, dict):
        return {key: _known(one) for key, one in value.items()}
    if isinstance(value, list):
        return [_known(one) for one in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
