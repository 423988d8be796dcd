"""Figures: force against time and levels against the standards' limits (paper, figures 2 and 3).

Every function returns a matplotlib figure as wide as a column of a journal page.
"""

from __future__ import annotations

import io
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeVar

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import NullLocator

from thud.checks import replace_file, require_kind
from thud.errors import InputError
from thud.impact import FORCES, Impact
from thud.levels import get_bands, octave_limits, record_force
from thud.recording import Recording

if TYPE_CHECKING:
    import os
    from collections.abc import Iterator, Sequence

    from matplotlib.axes import Axes
    from matplotlib.legend import Legend
    from numpy.typing import NDArray

Curve = TypeVar("Curve", bound=Impact | Recording)

# Okabe and Ito's colours, told apart with any colour vision; line styles tell them apart in print.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
LINES = ("-", "--", "-.", ":", (0, (5, 1, 1, 1, 1, 1)), (0, (1, 1)), (0, (8, 2)))
MARKERS = ("o", "s", "^", "D", "v", "P", "X")
WIDTH = 3.5
SIZE = 8
# Part of the largest force above which what a force plate does not record is drawn too.
UNSEEN = 0.02
# Legends of many entries.
COMPACT: dict[str, Any] = {"handlelength": 1.8, "handletextpad": 0.4, "columnspacing": 0.8}
FORMATS = ("pdf", "png", "svg")


def empty_axes(height: float) -> tuple[Figure, Axes]:
    """Return an empty figure of column width and its axes."""
    figure = Figure(figsize=(WIDTH, height), dpi=300, layout="constrained")
    return figure, dress(figure.add_subplot())


def dress(axes: Axes) -> Axes:
    """Give axes the look of all figures."""
    axes.tick_params(labelsize=SIZE)
    axes.grid(visible=True, linewidth=0.4, alpha=0.5)
    axes.set_axisbelow(True)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    return axes


def legend_above(
    axes: Axes, columns: int, place: Literal["lower left", "lower right"] = "lower left"
) -> Legend:
    """Put the legend over the axes, where no curve is; `place` is its corner that stays there."""
    return axes.legend(
        fontsize=SIZE - 1, frameon=False, ncols=columns, loc=place,
        bbox_to_anchor=(float(place == "lower right"), 1), **COMPACT,
    )  # fmt: skip


def force_history(impacts: Mapping[str, Impact], force: str | None = "elastic") -> Figure:
    """Draw forces against time (paper, figure 2).

    Parameters
    ----------
    impacts
        Impacts by their names in the legend.
    force
        ``"elastic"`` (the paper's ball force), ``"floor"``, or None for both.

    Returns
    -------
    Figure
        Time in ms, force in kN.
    """
    figure, axes = empty_axes(2.5)
    _draw_forces(axes, impacts, force)
    _add_legend(axes, impacts)
    return figure


def levels(
    impacts: Mapping[str, Impact],
    force: str | None = None,
    source: str = "rubber_ball",
    method: str | None = None,
) -> Figure:
    """Draw octave levels over the tolerance band of the standards (paper, figure 3).

    Parameters
    ----------
    impacts
        Impacts by their names in the legend.
    force
        ``"elastic"`` (the paper's ball force), ``"floor"``, or None for both.
    source
        ``"rubber_ball"`` or ``"tyre"``: whose tolerance band is drawn.
    method
        ``"exact"`` or ``"fft"``; by default that of each case.

    Returns
    -------
    Figure
        Octave bands in Hz, force exposure level in dB re 1 N.
    """
    figure, axes = empty_axes(2.8)
    _draw_tolerance(axes, source)
    place = np.arange(5)
    for i, (name, impact, kind) in enumerate(_curves(impacts, force)):
        values = impact.levels(method=method, force=kind)
        axes.plot(place, values, label=name, **_style(i), **_marker(i))
    octave_axis(axes)
    axes.set_ylabel("Force exposure level, dB re 1 N", fontsize=SIZE)
    _add_legend(axes, impacts)
    return figure


def _curves(impacts: Mapping[str, Curve], force: str | None) -> Iterator[tuple[str, Curve, str]]:
    """Yield name, impact and kind of force of each curve."""
    if not isinstance(impacts, Mapping) or not impacts:
        message = "impacts are not given; allowed: a mapping of names to impacts, at least one"
        raise InputError(message)
    for name, impact in impacts.items():
        require_kind(name, impact, Impact | Recording)
        if force:
            yield _literal(name), impact, force
        else:
            prefix = f"{name}, " if len(impacts) > 1 else ""
            same = np.array_equal(impact.force("elastic"), impact.force("floor"))
            for kind in FORCES[1:] if same else FORCES:
                yield _literal(f"{prefix}{kind} force"), impact, kind


def _literal(label: str) -> str:
    """Return a label in which matplotlib finds no formula, and that it does not hide."""
    return label.lstrip("_").replace("$", r"\$")


def _draw_forces(axes: Axes, impacts: Mapping[str, Curve], force: str | None) -> None:
    """Draw forces against time as force plates record them; thin and grey, what is above that."""
    most = end = 0.0
    band = ""
    for i, (name, impact, kind) in enumerate(_curves(impacts, force)):
        whole = impact.force(kind)
        time = 1e3 * (impact.time - impact.touch_time)
        recorded = record_force(whole, impact.sample_rate)
        if np.abs(whole - recorded).max() > UNSEEN * whole.max():
            # One entry of the legend for all of them.
            unfiltered = None if band else "unfiltered"
            axes.plot(time, 1e-3 * whole, color="0.75", linewidth=0.4, zorder=1, label=unfiltered)
            shown, band = recorded, " below 1.25 kHz"
        else:
            shown = whole
        axes.plot(time, 1e-3 * shown, label=name, **_style(i))
        end = max(end, time[np.flatnonzero(whole > 0)[-1]])
        most = max(most, whole.max())
    axes.set_xlim(0, 1.15 * end)
    axes.set_ylim(0, 1.05e-3 * most)
    axes.set_xlabel("Time since first touch, ms", fontsize=SIZE)
    name = force.capitalize() if force else "Blocked"
    axes.set_ylabel(f"{name} force{band}, kN", fontsize=SIZE)


def add_curves(
    axes: Axes, curves: Mapping[str, tuple[NDArray[np.float64], NDArray[np.float64]]]
) -> None:
    """Draw curves of x and y by their names, told apart by colour and line."""
    for i, (name, (x, y)) in enumerate(curves.items()):
        axes.plot(x, y, label=_literal(name), **_style(i))


def _add_legend(axes: Axes, impacts: Mapping[str, Impact]) -> None:
    """Add the legend; a single impact gives it its name."""
    title = _literal(next(iter(impacts))) if len(impacts) == 1 else None
    axes.legend(fontsize=SIZE, frameon=False, title=title, title_fontsize=SIZE)


def _style(i: int) -> dict[str, Any]:
    """Return colour and line style of a curve."""
    return {
        "color": COLOURS[i % len(COLOURS)],
        "linestyle": LINES[i % len(LINES)],
        "linewidth": 1.2,
    }


def _marker(i: int, size: float = 4) -> dict[str, Any]:
    """Return the marker of a curve."""
    return {"marker": MARKERS[i % len(MARKERS)], "markersize": size}


def level_changes(reference: Impact, impacts: Mapping[str, Impact], force: str = "floor") -> Figure:
    """Draw how octave levels change against a reference.

    Parameters
    ----------
    reference
        The impact that the others are compared with.
    impacts
        Impacts by their names in the legend.
    force
        ``"elastic"`` or ``"floor"``.

    Returns
    -------
    Figure
        Octave bands in Hz, change of the force exposure level in dB.
    """
    figure, axes = empty_axes(2.8)
    axes.axhline(0, color="0.45", linewidth=0.8)
    base = reference.levels(force=force)
    for i, (name, impact, kind) in enumerate(_curves(impacts, force)):
        change = impact.levels(force=kind) - base
        axes.plot(np.arange(5), change, label=name, **_style(i), **_marker(i))
    octave_axis(axes)
    axes.set_ylabel("Change of the level, dB", fontsize=SIZE)
    legend_above(axes, 3)
    return figure


def comparison_page(
    impacts: Mapping[str, Impact | Recording],
    force: str,
    source: str,
    table: Sequence[Sequence[str]],
) -> Figure:
    """Draw forces, octave and third levels of several impacts, and a table, on one page.

    Parameters
    ----------
    impacts
        Impacts and recordings by name.
    force
        ``"elastic"`` or ``"floor"``.
    source
        ``"rubber_ball"`` or ``"tyre"``: whose tolerance band is drawn.
    table
        Header and rows of text.

    Returns
    -------
    Figure
        As wide as the text of a page.
    """
    figure = Figure(figsize=(2 * WIDTH, 7.5), dpi=200, layout="constrained")
    rows = figure.add_gridspec(3, 2, height_ratios=[3, 3, 0.35 + 0.25 * len(table)])
    history = dress(figure.add_subplot(rows[0, :]))
    panels = {
        "octave": dress(figure.add_subplot(rows[1, 0])),
        "third": dress(figure.add_subplot(rows[1, 1])),
    }
    _draw_tolerance(panels["octave"], source)
    _draw_forces(history, impacts, force)
    for i, (_, impact, kind) in enumerate(_curves(impacts, force)):
        for bands, axes in panels.items():
            values = impact.levels(bands, "exact", kind)
            axes.plot(np.arange(len(values)), values, **_style(i), **_marker(i, 3))
    history.legend(fontsize=SIZE, frameon=False)
    octave_axis(panels["octave"])
    octave_axis(panels["third"], "third")
    for axes in panels.values():
        axes.set_ylabel("Force exposure level, dB re 1 N", fontsize=SIZE)
    panels["octave"].legend(fontsize=SIZE, frameon=False)
    below = figure.add_subplot(rows[2, :])
    below.axis("off")
    cells = below.table(
        [[_literal(cell) for cell in row] for row in table], loc="center", edges="horizontal"
    )
    cells.auto_set_font_size(value=False)
    cells.set_fontsize(SIZE - 1)
    cells.auto_set_column_width(list(range(len(table[0]))))
    return figure


def octave_axis(axes: Axes, bands: str = "octave") -> None:
    """Name the bands."""
    names = [f"{frequency:g}" for frequency in get_bands(bands).nominal]
    axes.set_xticks(np.arange(len(names)), names)
    axes.xaxis.set_minor_locator(NullLocator())
    axes.set_xlim(-0.6, len(names) - 0.4)
    axes.set_xlabel(f"{bands.capitalize()} band, Hz", fontsize=SIZE)
    if bands == "third":
        axes.tick_params(axis="x", labelrotation=90)


def _draw_tolerance(axes: Axes, source: str) -> None:
    """Draw the range of each octave as a grey box with its nominal value."""
    for place, (lower, upper) in enumerate(zip(*octave_limits(source), strict=True)):
        line = [place - 0.4, place + 0.4]
        name = f"Tolerance, {source.replace('_', ' ')}" if place == 0 else None
        axes.fill_between(line, lower, upper, color="0.82", linewidth=0, label=name)
        label = "Nominal" if place == 0 else None
        nominal = (lower + upper) / 2
        axes.plot(line, [nominal, nominal], color="0.45", linewidth=0.8, label=label)


def save(figure: Figure, path: str | os.PathLike[str]) -> None:
    """Save a figure in the format of the path's ending, completely or not at all.

    Parameters
    ----------
    figure
        The figure.
    path
        Path of the file; an older one is replaced.

    Raises
    ------
    InputError
        Where the ending is not one of png, svg and pdf.
    OSError
        Where the file cannot be written.
    """
    kind = Path(path).suffix[1:].lower()
    if kind not in FORMATS:
        message = f"{path}: ending {kind!r} is not known; allowed: {', '.join(FORMATS)}"
        raise InputError(message)
    content = io.BytesIO()
    # Without a date and with names that do not change, the same figure gives the same bytes.
    metadata = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}.get(kind)
    with mpl.rc_context({"svg.hashsalt": "thud"}):
        figure.savefig(content, format=kind, metadata=metadata)
    replace_file(path, content.getvalue())
