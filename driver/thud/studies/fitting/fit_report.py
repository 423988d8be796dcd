"""Fits in words and in files."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np

from thud.base.bridge import version
from thud.base.note import Note
from thud.base.tables import csv_text, format_rows
from thud.case.case import case_text
from thud.studies.fitting.force_target import ForceComparison

if TYPE_CHECKING:
    from thud.studies.fitting.fit_result import Fit, FittedTarget


def parameter_rows(fit: Fit) -> list[tuple[str, ...]]:
    """Return header and rows of text of the parameters, in the units of tables."""
    interval = f"{fit.confidence:.0%} interval"
    rows: list[tuple[str, ...]] = [("parameter", "value", "standard error", interval, "unit")]
    intervals = fit.intervals()
    for name, (unit, factor) in fit.display_units.items():
        value, error = fit.values[name] / factor, fit.standard_errors[name] / factor
        low, high = (end / factor for end in intervals[name])
        digits = _digits(value, error)
        interval = f"{low:.{digits}g} to {high:.{digits}g}" if np.isfinite(error) else "unknown"
        rows.append((name, f"{value:.{digits}g}", f"{error:.2g}", interval, unit))
    return rows


def _digits(value: float, error: float) -> int:
    """Return the number of digits of a value that resolves its error to two digits."""
    if not (np.isfinite(error) and error > 0 and value):
        return 6
    return int(np.clip(np.ceil(np.log10(abs(value) / error)) + 2, 3, 12))


def fit_table(fit: Fit) -> str:
    """Return parameters and quality of a fit as text."""
    freedom = fit.degrees_of_freedom
    quality = f", reduced chi-square {fit.reduced_chi_square:.3g}" if freedom else ""
    failures = f", {fit.failures} of them impossible" if fit.failures else ""
    data = f"{len(fit.residuals)} data, {freedom} degrees of freedom{quality}"
    # Of a single target on the line of its data.
    deviations = [_deviation(fit, target) for target in fit.targets]
    lines = [f"{data}; {deviations[0]}"] if len(deviations) == 1 else [data]
    if len(deviations) > 1:
        lines += [f"target {number}: {text}" for number, text in enumerate(deviations, start=1)]
    widened = [Note("widened", value=fit.widened)] if fit.widened != 1 else []
    lines += [*_largest_correlation(fit), *map(str, (*fit.assumptions, *widened))]
    lines += [f"{fit.evaluations} solutions computed{failures}"]
    return "\n".join([format_rows(fit.rows()), "", *lines])


def _deviation(fit: Fit, target: FittedTarget) -> str:
    """Return the standard deviation of a target in words."""
    comparison, unit = target.comparison, target.comparison.unit
    if fit.known_noise and unit == "dB":  # they may differ
        return "standard deviations given"
    size = fit.deviation_of(target)
    if isinstance(comparison, ForceComparison) and comparison.noise_freedom is not None:
        in_band = f"{size * comparison.band_fraction:.3g} {unit}"
        return f"noise of {in_band} in the compared band, from the background"
    given = fit.known_noise and not comparison.has_own_noise
    source = "given" if given else "estimated from the residuals"
    return f"standard deviation {size:.3g} {unit}, {source}"


def _largest_correlation(fit: Fit) -> list[str]:
    """Return the pair of parameters that can be separated least, if there are several."""
    strong = np.triu(np.nan_to_num(np.abs(fit.correlation)), 1)
    i, j = np.unravel_index(int(np.argmax(strong)), strong.shape)
    if not strong[i, j]:
        return []
    value = f"{fit.correlation[i, j]:.4f}".replace("-", "−")
    return [f"largest correlation: {value} of {fit.names[i]} and {fit.names[j]}"]


def fit_files(fit: Fit, **extra: object) -> dict[str, bytes]:
    """Return the files of a fit by name; numbers that are not finite are null in `fit.json`.

    It has further entries.
    """
    intervals = fit.intervals()
    content = {
        "version": version(),
        "parameters": {
            name: {
                "value": fit.values[name],
                "standard_error": _finite(fit.standard_errors[name]),
                "interval": list(map(_finite, intervals[name])),
                "unit": unit,
            }
            for name, unit in zip(fit.names, fit.units, strict=True)
        },
        "confidence": fit.confidence,
        "covariance": [list(map(_finite, row)) for row in fit.covariance],
        "correlation": [list(map(_finite, row)) for row in fit.correlation],
        "residuals": len(fit.residuals),
        "degrees_of_freedom": fit.degrees_of_freedom,
        "noise": fit.noise,
        "assumptions": list(map(str, fit.assumptions)),
        "widened": fit.widened,
        "warnings": list(map(str, fit.warnings)),
        "model": fit.case.model.name if fit.case.model else None,
        "singular_values": fit.singular_values.tolist(),
        "reduced_chi_square": _finite(fit.reduced_chi_square),
        "noise_given": fit.known_noise,
        "evaluations": fit.evaluations,
        "failures": fit.failures,
        "converged": fit.converged,
        **extra,
    }
    files = {
        "fit.json": f"{json.dumps(content, indent=2, allow_nan=False, default=str)}\n".encode()
    }
    for target, end in zip(fit.targets, file_ends(len(fit.targets)), strict=True):
        columns = target.columns()
        rows = zip(*columns.values(), strict=True)
        files[f"fit{end}.csv"] = csv_text([columns, *rows]).encode()
        files[f"fitted{end}.nml"] = case_text(target.case)
    return files


def file_ends(count: int) -> list[str]:
    """Return the endings of the file names of targets."""
    return [""] if count == 1 else [f"_{number}" for number in range(1, count + 1)]


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
