"""The page of a comparison with interactive plots, in one self-contained file."""

from collections.abc import Mapping, Sequence
from typing import Any

from thud.base._schema import BandSet, LevelsForce, LimitsSource
from thud.level.assessment import octave_limits
from thud.level.impact_result import ImpactResult
from thud.level.levels import get_bands
from thud.plot.force_history_figure import TIME_LABEL, contact_force, force_label
from thud.plot.html_page import curve_look, curve_points, html_page, plot_layout
from thud.plot.style import BAND_WORDS, iterate_curves, level_label


def comparison_html(
    impacts: Mapping[str, ImpactResult],
    force: LevelsForce | None,
    source: LimitsSource,
    table: Sequence[Sequence[str]],
) -> str:
    """Return the page of `comparison_page` with interactive plots, readable on any screen."""
    forces: list[dict[str, Any]] = []
    levels: dict[BandSet, list[dict[str, Any]]] = {"octave": [], "third": []}
    for i, (label, impact, kind) in enumerate(iterate_curves(impacts, force)):
        look = curve_look(i, label)
        time, newton = contact_force(impact, kind)
        forces.append({**look, "mode": "lines", **curve_points(time, newton), "showlegend": True})
        for bands, traces in levels.items():
            found = curve_points(_names(bands), impact.levels(bands, force=kind))
            traces.append({**look, "mode": "lines+markers", **found, "showlegend": False})
    levels["octave"].append(_tolerance(source))
    level = level_label(impacts, force)
    plots = [
        {"data": forces, "layout": plot_layout(TIME_LABEL, force_label(impacts, force))},
        *(
            {"data": traces, "layout": plot_layout(f"{BAND_WORDS[bands]}, Hz", level, "category")}
            for bands, traces in levels.items()
        ),
    ]
    return html_page(
        "Comparison of models and recordings",
        "Forces as force plates record them, below 1.25 kHz, and their levels; grey boxes are the "
        "tolerances of the standards, which third octaves do not have.",
        table,
        plots,
    )


def _names(bands: BandSet) -> list[str]:
    return [f"{frequency:g}" for frequency in get_bands(bands).nominal]


def _tolerance(source: LimitsSource) -> dict[str, Any]:
    """Return the range of each octave as a grey box."""
    lower, upper = octave_limits(source)
    return {
        "type": "bar",
        "name": f"Tolerance, {source.replace('_', ' ')}",
        "x": _names("octave"),
        "y": (upper - lower).tolist(),
        "base": lower.tolist(),
        "hovertext": [f"{low:g} to {high:g} dB" for low, high in zip(lower, upper, strict=True)],
        "hoverinfo": "name+text",
        "marker": {"color": "#bbbbbb"},
        "showlegend": True,
    }
