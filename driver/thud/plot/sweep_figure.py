"""The figure of a sweep: levels against one parameter, in panels for the values of another."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from thud.case.keys import humanize
from thud.level.assessment import octave_limits
from thud.level.levels import BANDWIDTHS, FORCES, get_bands
from thud.plot.parameter_axis import show_parameter, words
from thud.plot.style import (
    COLOURS,
    FORCE_WORDS,
    SIZE,
    legend_above,
    line_style,
    marker_style,
    new_figure,
    own_style,
    style_axes,
)

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from thud.studies.sweep import Sweep

    Columns = dict[str, NDArray[Any]]

# More values of a parameter are grouped in classes.
_MAX_VALUES = 32
_CLASSES = 16
# Maximum number of markers of a line; half of it in half the width.
_MAX_MARKS = 16
# Maximum number of values of a text parameter that have a panel each.
_MAX_PANELS = 6
_TINY = 0.05


class _Judged(NamedTuple):
    """Levels minus nominal levels of each sample, minimum and maximum tolerance, dB."""

    excess: NDArray[np.float64]
    tolerance: tuple[float, float]


@own_style()
def draw_sweep(result: Sweep) -> Figure:
    """Draw octave levels against the first numeric parameter that has several values.

    Levels are those of the judged force relative to the nominal ones, dB. Each value of the first
    text parameter, up to six of them, has its panel. Lines are medians over the other parameters,
    shades extend from the minimum to the maximum.
    """
    dataset = result.dataset
    columns = _columns(dataset)
    varied = [name for name, values in columns.items() if len(np.unique(values)) > 1]
    numeric = [name for name in varied if columns[name].dtype.kind in "iuf"]
    name = (numeric or varied or list(columns))[0]
    texts = [n for n in varied if n not in numeric and n != name]
    split = next((n for n in texts if len(np.unique(columns[n])) <= _MAX_PANELS), None)
    judged = _judge(dataset, columns)
    parts = {"": np.ones(len(columns[name]), dtype=bool)}
    if split:
        parts = {str(value): columns[split] == value for value in np.unique(columns[split])}
    across = 1 if len(parts) == 1 else 2
    down = -(-len(parts) // across)
    figure = new_figure(1.1 + (1.9 if across == 1 else 1.6) * down)
    panels = figure.subplots(down, across, sharex=True, sharey=True, squeeze=False).ravel()
    for i, (axes, (title, panel)) in enumerate(zip(panels, parts.items(), strict=False)):
        _draw_tolerance(style_axes(axes), judged.tolerance)
        levels = np.where(panel[:, np.newaxis], judged.excess, np.nan)
        _draw_octaves(axes, dataset[name], columns[name], levels, _MAX_MARKS // across)
        axes.set_title(title.replace("_", " "), fontsize=SIZE - 1)
        lowest = i + across >= len(parts)
        axes.tick_params(axis="x", labelbottom=lowest)
        axes.xaxis.label.set_visible(lowest)
    for axes in panels[len(parts) :]:
        axes.remove()
    words = "judged force" if "force" in columns else FORCE_WORDS[dataset.attrs["assessed_force"]]
    figure.supylabel(f"Level − nominal, dB\n({words})", fontsize=SIZE)
    others = [n for n in varied if n not in {name, split}]
    legend_above(panels[0], _meaning(judged, split, others))
    return figure


def _columns(dataset: xr.Dataset) -> Columns:
    """Return the parameters of each sample."""
    names = [str(name) for name in dataset.coords if name not in BANDWIDTHS]
    whole = dataset["status"]
    return {name: dataset[name].broadcast_like(whole).values.ravel() for name in names}


def _judge(dataset: xr.Dataset, columns: Columns) -> _Judged:
    """Return the levels of the judged force relative to the nominal levels of the source."""
    levels = {
        force: dataset[f"{force}_level"].values.reshape(-1, len(dataset["octave"]))
        for force in FORCES
    }
    count = len(dataset["status"].values.ravel())
    forces = columns.get("force", np.full(count, dataset.attrs["assessed_force"]))
    sources = columns.get("source", np.full(count, dataset.attrs["limits"]))
    found = np.where((forces == "floor")[:, np.newaxis], levels["floor"], levels["elastic"])
    tolerances: list[float] = []
    for source in np.unique(sources):
        lower, upper = octave_limits(source)
        found[sources == source] -= (lower + upper) / 2
        tolerances.extend((upper - lower) / 2)
    return _Judged(found, (min(tolerances), max(tolerances)))


def _draw_tolerance(axes: Axes, tolerance: tuple[float, float]) -> None:
    """Draw the maximum tolerance of an octave, and the minimum on it, around the nominal level."""
    for width, colour in zip(reversed(tolerance), ("0.92", "0.84"), strict=True):
        axes.axhspan(-width, width, color=colour, linewidth=0, zorder=0)
    axes.axhline(0, color="0.45", linewidth=0.8)


def _draw_octaves(
    axes: Axes,
    parameter: xr.DataArray,
    values: NDArray[Any],
    levels: NDArray[np.float64],
    max_marks: int,
) -> None:
    """Draw the octave levels of samples, those that are not NaN, against a parameter."""
    places, members, names = _classes(values)
    if names is None:
        places = places * show_parameter(axes, "x", parameter)
    else:
        axes.set_xticks(places, names)
        axes.tick_params(axis="x", labelrotation=20)
        axes.set_xlabel(words(parameter), fontsize=SIZE)
    for i, band in enumerate(get_bands().nominal):
        found = [levels[chosen, i] for chosen in members]
        middle, lower, upper = (
            np.array([_of(part, f) for part in found]) for f in (np.median, np.min, np.max)
        )
        marks = marker_style(i, 3) if len(places) <= max_marks else {}
        axes.plot(places, middle, label=f"{band:g} Hz", **line_style(i), **marks)
        if np.nanmax(upper - lower, initial=0) > _TINY:
            axes.fill_between(places, lower, upper, color=COLOURS[i], alpha=0.15, linewidth=0)


def _classes(
    values: NDArray[Any],
) -> tuple[NDArray[np.float64], list[NDArray[np.bool_]], list[str] | None]:
    """Return places on an axis, the samples of each, and the names of texts."""
    found = np.unique(values)
    if values.dtype.kind not in "iuf":
        members = [values == value for value in found]
        return np.arange(len(found), dtype=float), members, [str(value) for value in found]
    if len(found) <= _MAX_VALUES:
        return found.astype(float), [values == value for value in found], None
    edges = np.quantile(values, np.linspace(0, 1, _CLASSES + 1))
    place = np.clip(np.searchsorted(edges, values, side="right") - 1, 0, _CLASSES - 1)
    members = [place == i for i in range(_CLASSES) if (place == i).any()]
    return np.array([np.median(values[chosen]) for chosen in members]), members, None


def _of(part: NDArray[np.float64], function: Any) -> float:  # noqa: ANN401 - of NumPy
    """Return a function of the finite numbers; NaN where there are none."""
    known = part[np.isfinite(part)]
    return float(function(known)) if known.size else np.nan


def _meaning(judged: _Judged, split: str | None, others: list[str]) -> str:
    """Return what panels, lines, shades and grey mean."""
    minimum, maximum = judged.tolerance
    lines = [f"Grey: tolerances of the octaves, ±{minimum:g} to ±{maximum:g} dB"]
    if others:
        over = humanize(others[0]) if len(others) == 1 else f"{len(others)} other parameters"
        lines.insert(0, f"Lines: median over {over}; shades: range")
    if split:
        lines.insert(0, f"Panels: {humanize(split)}")
    return "\n".join(lines)
