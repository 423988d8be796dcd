"""Figures of studies, as wide as a column of a journal page."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.colors import TwoSlopeNorm
from matplotlib.ticker import MaxNLocator

from thud.levels import get_bands, octave_limits
from thud.plot import COLOURS, LINES, MARKERS, SIZE, empty_axes, octave_axis

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.legend import Legend
    from numpy.typing import NDArray

    from thud.studies.conformity import DesignMap
    from thud.studies.influence import Sensitivity
    from thud.studies.tolerances import Uncertainty

# More values of a parameter than this are put into as many classes.
_MOST_VALUES = 32
_CLASSES = 16
_TINY = 0.05


def draw_sweep(dataset: xr.Dataset) -> Figure:
    """Draw octave levels against the first parameter that has several values.

    Lines are medians over the other parameters, shades reach from the least to the largest.

    Parameters
    ----------
    dataset
        What `sweep` gives.

    Returns
    -------
    Figure
        Level of the judged force over nominal level, dB.
    """
    levels, columns = _flat(dataset)
    name = next((n for n, values in columns.items() if len(set(values)) > 1), next(iter(columns)))
    lower, upper = octave_limits(dataset.attrs["limits"])
    levels = levels - (lower + upper) / 2
    places, members, names = _classes(columns[name])
    attributes = dataset[name].attrs
    if names is None:
        places = places * 10.0 ** attributes["shown_power"]
    figure, axes = empty_axes(3.0)
    axes.axhline(0, color="0.45", linewidth=0.8)
    for i, band in enumerate(get_bands().nominal):
        parts = [levels[chosen, i] for chosen in members]
        middle, least, most = (
            np.array([_of(part, f) for part in parts]) for f in (np.median, np.min, np.max)
        )
        style: dict[str, Any] = {"color": COLOURS[i], "linestyle": LINES[i], "linewidth": 1.2}
        if len(places) <= _MOST_VALUES // 2:
            style |= {"marker": MARKERS[i], "markersize": 3}
        axes.plot(places, middle, label=f"{band:g} Hz", **style)
        if np.nanmax(most - least, initial=0) > _TINY:
            axes.fill_between(places, least, most, color=COLOURS[i], alpha=0.15, linewidth=0)
    if names is not None:
        axes.set_xticks(places, names)
        axes.tick_params(axis="x", labelrotation=20)
    axes.set_xlabel(_label(name, attributes), fontsize=SIZE)
    axes.set_ylabel("Level - nominal, dB", fontsize=SIZE)
    _legend_above(axes, 3)
    return figure


def _flat(dataset: xr.Dataset) -> tuple[NDArray[np.float64], dict[str, NDArray[Any]]]:
    """Return levels of shape (n_set, 5) and the parameters of each set."""
    levels = dataset[f"{dataset.attrs['judged_force']}_level"]
    names = [str(name) for name in dataset.coords if name != "octave"]
    whole = dataset["status"]
    columns = {name: dataset[name].broadcast_like(whole).values.ravel() for name in names}
    return levels.values.reshape(-1, len(dataset["octave"])), columns


def _classes(
    values: NDArray[Any],
) -> tuple[NDArray[np.float64], list[NDArray[np.bool_]], list[str] | None]:
    """Return places on an axis, which sets belong to each, and their names where they have some."""
    found = np.unique(values)
    if values.dtype.kind not in "iuf":
        members = [values == value for value in found]
        return np.arange(len(found), dtype=float), members, [str(value) for value in found]
    if len(found) <= _MOST_VALUES:
        return found.astype(float), [values == value for value in found], None
    edges = np.quantile(values, np.linspace(0, 1, _CLASSES + 1))
    place = np.clip(np.searchsorted(edges, values, side="right") - 1, 0, _CLASSES - 1)
    members = [place == i for i in range(_CLASSES) if (place == i).any()]
    return np.array([values[chosen].mean() for chosen in members]), members, None


def _of(part: NDArray[np.float64], function: Any) -> float:  # noqa: ANN401 - of NumPy
    """Return what a function makes of numbers; NaN where there are none."""
    known = part[np.isfinite(part)]
    return float(function(known)) if known.size else np.nan


def _label(name: str, attributes: dict[str, Any]) -> str:
    """Return the label of an axis."""
    unit = attributes["shown_unit"]
    words = _words(name).capitalize()
    return words if unit == "1" else f"{words}, {unit}"


def _words(name: str) -> str:
    """Return the name of a parameter in words."""
    return name.replace("youngs", "Young's").replace("_", " ")


def _legend_above(axes: Axes, columns: int) -> Legend:
    """Put the legend over the axes, where no curve is."""
    return axes.legend(
        fontsize=SIZE - 1, frameon=False, ncols=columns, loc="lower left", bbox_to_anchor=(0, 1)
    )


def draw_sensitivity(result: Sensitivity) -> Figure:
    """Draw total Sobol indices as bars with intervals, and first orders as marks on them.

    Parameters
    ----------
    result
        What `sensitivity` gives.

    Returns
    -------
    Figure
        One group of bars for each output.
    """
    indices = result.indices
    parameters = [str(name) for name in indices["parameter"].values]
    outputs = [str(name) for name in indices["output"].values]
    thickness = 0.8 / len(parameters)
    figure, axes = empty_axes(0.8 + 0.13 * len(outputs) * (len(parameters) + 1))
    place = np.arange(len(outputs), dtype=float)
    bars: dict[str, Any] = {"capsize": 1.5, "elinewidth": 0.7, "capthick": 0.7}
    for i, name in enumerate(parameters):
        row = indices.sel(parameter=name)
        at = place + (i - (len(parameters) - 1) / 2) * thickness
        axes.barh(
            at,
            row["total"],
            0.9 * thickness,
            xerr=row["total_interval"],
            color=COLOURS[i % len(COLOURS)],
            hatch="////" if i >= len(COLOURS) else None,
            label=_words(name),
            error_kw=bars,
        )
        axes.plot(
            row["first_order"], at, "D", markersize=2.5, markerfacecolor="white",
            markeredgecolor="black", markeredgewidth=0.6, linestyle="none",
            label="first order" if i == len(parameters) - 1 else None,
        )  # fmt: skip
    axes.set_yticks(place, outputs)
    axes.set_ylim(len(outputs) - 0.5, -0.5)
    axes.set_xlim(left=min(0.0, axes.get_xlim()[0]))
    axes.set_xlabel("Total Sobol index, interval of 95 %", fontsize=SIZE)
    _legend_above(axes, 2)
    return figure


def draw_design_map(result: DesignMap) -> Figure:
    """Draw the margin over two parameters, its zero as a line, and what meets all criteria.

    Parameters
    ----------
    result
        What `design_map` gives.

    Returns
    -------
    Figure
        Margin in dB, positive where all octave levels lie within their limits.
    """
    dataset = result.dataset
    scales = [10.0 ** dataset[name].attrs["shown_power"] for name in result.axes]
    x, y = (dataset[name].values * scale for name, scale in zip(result.axes, scales, strict=True))
    margin = np.ma.masked_invalid(dataset["margin"].transpose(*result.axes).values.T)
    conforms = dataset["conforms"].transpose(*result.axes).values.T
    figure, axes = empty_axes(2.9)
    if margin.count():
        most = max(float(np.abs(margin).max()), _TINY)
        # What conforms has little to spare: its colours go faster, up to four times.
        norm = TwoSlopeNorm(0, -most, max(float(margin.max()), most / 4))
        filled = axes.contourf(x, y, margin, levels=24, cmap="PuOr", norm=norm)
        if margin.min() < 0 < margin.max():
            axes.contour(x, y, margin, levels=[0.0], colors="black", linewidths=1.2)
            axes.plot([], [], color="black", linewidth=1.2, label="octave limits")
        bar = figure.colorbar(filled, ax=axes, ticks=MaxNLocator(7))
        bar.set_label("Margin, dB", fontsize=SIZE)
        bar.ax.tick_params(labelsize=SIZE)
    row, column = np.nonzero(conforms)
    if row.size:
        axes.plot(x[column], y[row], ".", markersize=2, color="black", label="all criteria met")
    if result.mark:
        place = [value * scale for value, scale in zip(result.mark, scales, strict=True)]
        axes.plot(
            *place, "*", markersize=9, markerfacecolor="white", markeredgecolor="black",
            linestyle="none", label=result.mark_name,
        )  # fmt: skip
    axes.grid(visible=False)
    first, second = (_label(name, dataset[name].attrs) for name in result.axes)
    axes.set_xlabel(first, fontsize=SIZE)
    axes.set_ylabel(second, fontsize=SIZE)
    if axes.get_legend_handles_labels()[0]:
        _legend_above(axes, 2)
    return figure


def draw_uncertainty(result: Uncertainty) -> Figure:
    """Draw the distribution of each octave level over the tolerances of the standards.

    Parameters
    ----------
    result
        What `uncertainty` gives.

    Returns
    -------
    Figure
        Level over nominal level, dB; bars reach over 95 % of the sets.
    """
    lower, upper = octave_limits(result.source)
    nominal = (lower + upper) / 2
    figure, axes = empty_axes(2.8)
    for i, (low, high) in enumerate(zip(lower - nominal, upper - nominal, strict=True)):
        name = f"tolerance, {result.source.replace('_', ' ')}" if i == 0 else None
        axes.fill_between([i - 0.4, i + 0.4], low, high, color="0.82", linewidth=0, label=name)
    levels = result.levels - nominal
    place = np.arange(len(nominal))
    shapes = axes.violinplot(levels, place, widths=0.6, showextrema=False)
    for shape in shapes["bodies"]:  # type: ignore[attr-defined]
        shape.set(facecolor=COLOURS[0], alpha=0.8, edgecolor="none")
    low, middle, high = np.quantile(levels, [0.025, 0.5, 0.975], axis=0)
    axes.errorbar(
        place, middle, (middle - low, high - middle), fmt="o", color="black", markersize=2.5,
        elinewidth=0.8, capsize=2, label="median, 95 % of sets",
    )  # fmt: skip
    octave_axis(axes)
    axes.set_ylabel("Level - nominal, dB", fontsize=SIZE)
    least, most = result.interval
    legend = _legend_above(axes, 2)
    share = f"{100 * result.probability:.1f} % ({100 * least:.1f} to {100 * most:.1f} %)"
    legend.set_title(f"Conforms: {share}")
    legend.get_title().set_fontsize(SIZE)
    return figure
