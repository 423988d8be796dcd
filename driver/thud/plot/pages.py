"""Pages of comparisons: a figure with a table, and the same as an interactive HTML file."""

from __future__ import annotations

from importlib import resources
from textwrap import fill
from typing import TYPE_CHECKING, Any

import numpy as np

from thud.floors.description import rating_title
from thud.impact.contact_time import contact_force
from thud.level.assessment import octave_limits
from thud.level.levels import BANDWIDTHS, get_bands
from thud.plot.impact_figures import draw_forces, draw_levels
from thud.plot.style import (
    BAND_NAMES,
    ERROR_BARS,
    LEVEL,
    RATING_SYMBOL,
    add_levels,
    assessed_curves,
    escape_label,
    figure_of,
    finish,
    legend_above,
    level_label,
    own_panels,
    own_style,
)
from thud.plot.templates import render

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from thud.base._schema import BandSet
    from thud.comparison.comparison import Comparison
    from thud.floors.floor_comparison import FloorComparison
    from thud.floors.prediction import RoomPrediction

    Array = NDArray[np.float64]

# Modules and style of plots, which the explorer shares.
_SHARED = resources.files("thud") / "explorer/page"
_MODULES = "page.js", "plot.js"


def html_page(
    title: str,
    text: str,
    table: Sequence[Sequence[str]],
    plots: Sequence[Mapping[str, Any]],
    warnings: Sequence[str] = (),
) -> str:
    """Return a page of title, text, table (header row first), warnings and plots.

    Plots are as `plot` of ``explorer/page/plot.js`` takes them; the first has the full width.
    """
    return render(
        "plot/page.html",
        title=title,
        text=text,
        table=table,
        warnings=warnings,
        plots=plots,
        style=(_SHARED / "plot.css").read_text(encoding="utf-8"),
        modules={name: (_SHARED / name).read_bytes() for name in _MODULES},
    )


def _plot(
    x: Mapping[str, Any], y: Mapping[str, str], curves: Mapping[str, tuple[Array, Array]]
) -> dict[str, Any]:
    """Return a plot of curves by name, with values of six digits; NaN is a gap."""
    return {
        "x": x,
        "y": y,
        "curves": [
            {
                "name": name,
                "style": i,
                "x": horizontal.tolist(),
                "y": [float(f"{v:.6g}") + 0.0 if np.isfinite(v) else None for v in values],
                "marks": "bands" in x,
            }
            for i, (name, (horizontal, values)) in enumerate(curves.items())
        ],
    }


def _bands_plot(
    frequency: Array, bands: BandSet, y: Mapping[str, str], curves: Mapping[str, Array]
) -> dict[str, Any]:
    """Return a plot of levels against bands."""
    names = [f"{value:g}" for value in frequency]
    x = {"title": BAND_NAMES[bands], "unit": "Hz", "bands": names}
    indices = np.arange(len(names), dtype=np.float64)
    return _plot(x, y, {name: (indices, values) for name, values in curves.items()})


@own_style()
def draw_comparison(comparison: Comparison, ax: Axes | None = None) -> Figure:
    """Draw forces, octave and one-third-octave levels of impacts; in axes of a user the forces."""
    impacts, force = comparison.impacts, comparison.force
    history, *others = own_panels(ax, 6.3, 3, height_ratios=[1.4, 1, 1])
    draw_forces(history, impacts, force)
    if not others:
        return finish(history, ax)
    draw_levels(dict(zip(BANDWIDTHS, others, strict=True)), impacts, force, comparison.source)
    _, name = assessed_curves(impacts, force)
    for axes in others:
        axes.set_ylabel(level_label(name, LEVEL.replace(", ", ",\n", 1)))
    figure_of(history).align_ylabels()
    return finish(others[0], ax)


def comparison_html(comparison: Comparison) -> str:
    """Return a page of interactive plots and the table, readable on any screen."""
    source = comparison.source
    curves, name = assessed_curves(comparison.impacts, comparison.force)
    level_title = "Force exposure level" + f" ({name})" * (name != "force")
    forces = _plot(
        {"title": "Time since first touch", "unit": "ms"},
        {"title": f"{name.capitalize()}, low-passed at 1.25 kHz", "unit": "kN"},
        {label: contact_force(*curve) for label, curve in curves.items()},
    )
    y = {"title": level_title, "unit": "dB", "reference": " re 1 N, 1 s"}
    levels = []
    for kind in BANDWIDTHS:
        curve = {name: impact.levels(kind, force=force) for name, (impact, force) in curves.items()}
        levels.append(_bands_plot(get_bands(kind).nominal, kind, y, curve))
    levels[0]["limits"] = np.transpose(octave_limits(source)).tolist()
    return html_page(
        "Comparison of models and recordings",
        "Forces as force plates record them, low-passed at 1.25 kHz, and their levels; gray boxes "
        f"are the tolerances of the standards for the {source.replace('_', ' ')}, which "
        "one-third-octave bands do not have.",
        comparison.rows(),
        [forces, *levels],
    )


# Titles, units and references of the steps from force to room.
_STEPS = (
    ("Force exposure\nlevel", "dB", " re 1 N, 1 s"),
    ("Energy input", "dB", " re 1 J"),
    ("Radiated share\nof the losses", "%", ""),
    ("Maximum Fast level", "dB", " re 20 µPa"),
)
# Maximum number of characters of the name of a floor in one line.
_NAME = 18
# Difference below which forces are drawn as one, dB.
_SAME = 0.05


@own_style()
def draw_floors(comparison: FloorComparison, ax: Axes | None = None) -> Figure:
    """Draw ratings with their uncertainties, and levels in the room; axes of a user show these."""
    panels = own_panels(ax, 2.6 + 0.35 * len(comparison.predictions), 2, height_ratios=[1, 2])
    _draw_step(panels[-1], comparison, len(_STEPS) - 1)
    if ax is not None:
        return finish(ax, ax)
    _draw_ratings(panels[0], comparison)
    legend_above(panels[1], panels[0])
    return figure_of(panels[0])


@own_style()
def floor_steps(comparison: FloorComparison) -> Figure:
    """Draw what leads to the levels: forces, energies into the floors, radiated shares."""
    panels = own_panels(None, 4.2, len(_STEPS) - 1, sharex=True)
    for i, axes in enumerate(panels):
        _draw_step(axes, comparison, i)
        axes.label_outer()
    figure = figure_of(panels[0])
    figure.align_ylabels()
    legend_above(panels[1])
    return figure


def _draw_step(axes: Axes, comparison: FloorComparison, step: int) -> None:
    """Draw one step from force to room of all floors; forces that are equal as one curve."""
    title, unit, reference = _STEPS[step]
    predictions = comparison.predictions
    nominal = next(iter(predictions.values())).frequency
    curves = {name: _step_values(found)[step] for name, found in predictions.items()}
    if step == 0 and len(curves) > 1 and np.ptp([*curves.values()], axis=0).max() < _SAME:
        axes.text(0.97, 0.9, "equal for all floors", transform=axes.transAxes, ha="right", va="top")
        axes.plot(next(iter(curves.values())), color="black", marker=".", linewidth=1)
        curves = {}
    add_levels(axes, curves, "third", nominal, 3.5)
    blank = " " if "\n" in title else "\n"
    axes.set_ylabel(f"{title},{blank}{unit}{reference}")


def floors_html(comparison: FloorComparison) -> str:
    """Return a page of interactive plots and the table."""
    predictions = comparison.predictions
    steps = zip(*map(_step_values, predictions.values()), strict=True)
    plots = [
        _bands_plot(
            next(iter(predictions.values())).frequency,
            "third",
            {"title": title.replace("\n", " "), "unit": unit, "reference": reference},
            dict(zip(predictions, values, strict=True)),
        )
        for (title, unit, reference), values in zip(_STEPS, steps, strict=True)
    ]
    text = "Levels in the room below, and the chain that leads to them: force, energy, floor, room."
    # The first plot has the full width: the level in the room.
    plots = [plots[-1], *plots[:-1]]
    warnings = [note.message for note in comparison.notes]
    return html_page("Comparison of floors", text, comparison.rows(), plots, warnings)


def _step_values(prediction: RoomPrediction) -> tuple[Array, ...]:
    """Return the values of each step of a prediction."""
    energy = 10 * np.log10(prediction.energy)
    force = energy - 10 * np.log10(prediction.conductance)
    return force, energy, 100 * prediction.radiated_share, prediction.level


def _draw_ratings(axes: Axes, comparison: FloorComparison) -> None:
    """Draw the asked rating of each floor with its standard uncertainty."""
    predictions = list(comparison.predictions.values())
    y = np.arange(len(predictions))
    ratings = [prediction.rating for prediction in predictions]
    axes.errorbar(
        [rating.level for rating in ratings], y, xerr=[rating.uncertainty for rating in ratings],
        label="with standard uncertainty", **ERROR_BARS | {"color": "black"},
    )  # fmt: skip
    axes.set_yticks(y, [escape_label(fill(name, _NAME)) for name in comparison.predictions])
    axes.set_ylim(len(y) - 0.4, -0.6)
    titles = {
        rating_title(p, p.room.rating).replace("L_iA,Fmax", RATING_SYMBOL) for p in predictions
    }
    title = titles.pop() if len(titles) == 1 else "Ratings that the rooms ask for"
    axes.set_xlabel("\n(".join(title.split(" (")) + ", dB")
