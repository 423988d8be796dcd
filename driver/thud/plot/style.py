"""Look of all figures: colors, curves, axes, panels, legends."""

from __future__ import annotations

from contextlib import contextmanager
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING, Any, TypeVar

import matplotlib as mpl
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import NullLocator

from thud.base.checks import refuse, require_kind, require_mapping
from thud.level.assessment import ImpactOrRecording
from thud.level.levels import get_bands

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from matplotlib.axes import Axes
    from matplotlib.cm import ScalarMappable
    from numpy.typing import NDArray

    from thud.base._schema import BandSet, LevelsForce
    from thud.impact.impact import Impact
    from thud.recordings.recording import ImpactResult

    Curve = TypeVar("Curve", bound=ImpactResult)

# Okabe and Ito's colors, for any color vision; line styles distinguish curves in print.
COLORS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
LINES = ("-", "--", "-.", ":", (0, (5, 1, 1, 1, 1, 1)), (0, (1, 1)), (0, (8, 2)))
MARKERS = ("o", "s", "^", "D", "v", "P", "X")
# Color of areas behind curves.
GRAY = "0.85"
# Sizes of the markers of the first and of the last of several curves.
LARGEST, SMALLEST = 6.0, 2.5
# Values with their uncertainty.
ERROR_BARS: dict[str, Any] = {
    "color": COLORS[0], "linestyle": "none", "marker": "o", "markersize": 3, "capsize": 2.5,
    "elinewidth": 0.9, "capthick": 0.9,
}  # fmt: skip
# Width of a column of a journal page, 8 cm, inch.
WIDTH = 8 / 2.54
FORCE_NAMES = {"elastic": "elastic force", "floor": "force on the floor"}
BAND_NAMES = {"octave": "Octave band", "third": "One-third-octave band"}
LEVEL = "Force exposure level, dB re 1 N, 1 s"
FAST_LEVEL = "Maximum Fast level,\ndB re 20 µPa"
RATING_SYMBOL = r"$L_\mathrm{iA,Fmax}$"
# Maximum number of characters in a line of a legend.
_LINE = 44
_OCTAVES = np.array([8, 16, 31.5, 63, 125, 250, 500, 1000, 2000, 4000, 8000])
# Without the backend: figures have no window.
_STYLE = dict(mpl.rc_params_from_file(Path(__file__).with_name("thud.mplstyle")))
del _STYLE["backend"]


@contextmanager
def own_style() -> Iterator[None]:
    """Draw in the style of thud, independent of the settings of the user."""
    with mpl.rc_context(_STYLE):
        yield


class StyledFigure(Figure):
    """Figure that keeps the style of thud when a user draws or saves it."""

    def draw(self, *arguments: Any, **options: Any) -> None:  # noqa: ANN401 - of matplotlib
        """Draw the figure."""
        with own_style():
            super().draw(*arguments, **options)

    def savefig(self, *arguments: Any, **options: Any) -> None:  # noqa: ANN401 - of matplotlib
        """Save the figure."""
        with own_style():
            super().savefig(*arguments, **options)


def new_figure(height: float, width: float = WIDTH) -> Figure:
    """Return an empty figure; lengths in inches."""
    with own_style():
        figure = StyledFigure(figsize=(width, height))
    # Keep one renderer: each measurement of a text would make a new one.
    FigureCanvasAgg(figure)
    return figure


@own_style()
def empty_axes(height: float) -> tuple[Figure, Axes]:
    """Return an empty figure of column width, inches high, and its axes."""
    figure = new_figure(height)
    return figure, figure.add_subplot()


def own_or(ax: Axes | None, height: float) -> Axes:
    """Return the axes of a user, or those of a new figure of column width, inches high."""
    return empty_axes(height)[1] if ax is None else ax


def own_panels(
    ax: Axes | None,
    height: float,
    count: int,
    **options: Any,  # noqa: ANN401 - of matplotlib
) -> list[Axes]:
    """Return the axes of a user alone, or the panels of a new figure, one below the other."""
    if ax is not None:
        return [ax]
    return [*new_figure(height).subplots(count, squeeze=False, **options).flat]


def figure_of(axes: Axes) -> Figure:
    """Return the figure of axes; raise InputError if they are removed from it."""
    figure = axes.get_figure(root=True)
    if figure is None:
        refuse("the axes are removed from their figure", "axes of a figure")
    return figure


def finish(axes: Axes, ax: Axes | None, title: str = "") -> Figure:
    """Add the legend, above an own figure or inside the axes of a user; return the figure."""
    if ax is None:
        legend_above(axes, title=title)
    elif len(axes.get_legend_handles_labels()[1]) > (not title):
        axes.legend(title=title or None, fontsize="small", title_fontsize="small")
    return figure_of(axes)


def panel_grid(
    count: int, columns: int, height: float, *, shared: bool = False, ax: Axes | None = None
) -> tuple[Figure, list[Axes]]:
    """Return a figure of column width and its panels, row by row; height of a row in inches.

    Panels with shared axes have labels of the x axis in the lowest row only. The axes of a user are
    the only panel.
    """
    if ax is not None:
        return figure_of(ax), [ax]
    # Half an inch for labels and colors below the panels.
    figure = new_figure(0.5 + height * -(-count // columns))
    grid = figure.subplots(
        -(-count // columns), columns, sharex=shared, sharey=shared, squeeze=False
    ).ravel()
    for axes in grid[count:]:
        axes.remove()
    panels = list(grid[:count])
    for i, axes in enumerate(panels if shared else []):
        axes.tick_params(axis="x", labelbottom=i + columns >= count)
        axes.xaxis.label.set_visible(i + columns >= count)
    return figure, panels


def add_colorbar(figure: Figure, panels: list[Axes], colors: ScalarMappable, label: str) -> None:
    """Add the scale of the colors of panels below them."""
    figure.colorbar(
        colors, ax=panels, location="bottom", shrink=0.7, aspect=30, pad=0.02,
        label=label,
    )  # fmt: skip


@own_style()
def legend_above(axes: Axes, *others: Axes, title: str = "") -> None:
    """Put one legend of all axes above their figure, which grows, in as few rows as possible.

    Text without formulas is small. A single curve needs no legend without a title.
    """
    figure = figure_of(axes)
    entries = [
        (handle, fill(name, _LINE))
        for panel in (axes, *others)
        for handle, name in zip(*panel.get_legend_handles_labels(), strict=True)
    ]
    if len(entries) <= 1 and not title:
        return
    handles, names = [handle for handle, _ in entries], [name for _, name in entries]
    has_formula = any("$" in text.replace(r"\$", "") for text in (*names, title))
    size = "medium" if has_formula else "small"
    rows = 0
    while True:
        rows += 1
        legend = figure.legend(
            handles, names, loc="outside upper left", ncols=max(1, -(-len(names) // rows)),
            title=title, alignment="left", fontsize=size, title_fontsize=size,
        )  # fmt: skip
        box = legend.get_window_extent()
        if rows >= len(names) or box.width < 0.97 * figure.bbox.width:
            width, height = figure.get_size_inches()
            figure.set_size_inches(width, height + box.height / figure.dpi)
            return
        legend.remove()


def escape_label(label: str) -> str:
    """Return a label that matplotlib neither takes for a formula nor hides."""
    return label.lstrip("_").replace("$", r"\$")


def curve_style(i: int, marker_size: float = 0.0) -> dict[str, Any]:
    """Return color, line style and marker of a curve by its index.

    Line styles and markers shift by one after each round of colors.
    """
    shifted = (i + i // len(COLORS)) % len(COLORS)
    line = {"color": COLORS[i % len(COLORS)], "linestyle": LINES[shifted], "linewidth": 1.2}
    return line | ({"marker": MARKERS[shifted], "markersize": marker_size} if marker_size else {})


def add_curves(
    axes: Axes,
    curves: Mapping[str, tuple[NDArray[Any], NDArray[Any]]],
    marker_size: float = 0.0,
    **style: Any,  # noqa: ANN401 - of matplotlib
) -> None:
    """Draw curves of x and y by their names, each in its own style but for what `style` states.

    A marker is smaller than that of the curve before: equal values stay distinguishable.
    """
    step = max(marker_size - SMALLEST, 0.0) / max(3, len(curves) - 1)
    for i, (name, (x, y)) in enumerate(curves.items()):
        size = marker_size - i * step
        axes.plot(x, y, label=escape_label(name), **{**curve_style(i, size), **style})


def add_levels(
    axes: Axes,
    levels: Mapping[str, NDArray[np.float64]],
    bands: BandSet = "octave",
    frequency: NDArray[np.float64] | None = None,
    marker_size: float = LARGEST,
) -> None:
    """Draw values in bands by the names of their curves, on an axis as `band_axis` makes it."""
    add_curves(axes, {name: (np.arange(len(y)), y) for name, y in levels.items()}, marker_size)
    band_axis(axes, bands, frequency)


def named(impact: Impact) -> dict[str, Impact]:
    """Return an impact by the name of its case, in words."""
    return {impact.case.name.replace("_", " "): impact}


def assessed_curves(
    impacts: Mapping[str, Curve], force: LevelsForce | None
) -> tuple[dict[str, tuple[Curve, LevelsForce]], str]:
    """Return impacts and their kinds of force by the names of curves, and the name of the force.

    By default the force is that assessed in each case. Forces that differ are named with the
    curves; their common name is "force". Raises InputError if `impacts` is not a mapping of names
    to impacts, or empty.
    """
    require_mapping("impacts", impacts, "impacts")
    for name, impact in impacts.items():
        require_kind(name, impact, ImpactOrRecording)
    curves = {name: (impact, impact.assessed_force(force)) for name, impact in impacts.items()}
    kinds = {kind for _, kind in curves.values()}
    if len(kinds) == 1:
        return curves, FORCE_NAMES[kinds.pop()]
    return {f"{name}, {FORCE_NAMES[curve[1]]}": curve for name, curve in curves.items()}, "force"


def level_label(name: str, label: str = LEVEL) -> str:
    """Return the label of an axis of levels with the name of their force, unless forces differ."""
    return label if name == "force" else f"{label}\n({name})"


def band_axis(
    axes: Axes, bands: BandSet = "octave", frequency: NDArray[np.float64] | None = None
) -> None:
    """Label the x axis with bands by their mid-band frequencies, Hz; by default all of a set."""
    nominal = get_bands(bands).nominal if frequency is None else frequency
    axes.set_xticks(np.arange(len(nominal)), [f"{value:g}" for value in nominal])
    axes.set_xlim(-0.6, len(nominal) - 0.4)
    axes.xaxis.set_minor_locator(NullLocator())
    axes.set_xlabel(f"{BAND_NAMES[bands]}, Hz")
    if bands == "third":
        axes.tick_params(axis="x", labelrotation=90)


def frequency_axis(axes: Axes, marks: NDArray[np.float64] | None = None) -> None:
    """Label a logarithmic x axis with frequencies, Hz; by default octaves that it shows."""
    axes.set_xscale("log")
    low, high = axes.get_xlim()
    marks = _OCTAVES[(low <= _OCTAVES) & (high >= _OCTAVES)] if marks is None else marks
    axes.set_xticks(marks, [f"{mark:g}" for mark in marks])
    axes.xaxis.set_minor_locator(NullLocator())
    axes.set_xlabel("Frequency, Hz")


def tolerance_boxes(
    axes: Axes,
    lower: NDArray[np.float64],
    upper: NDArray[np.float64],
    name: str,
    middle: str = "Nominal",
) -> None:
    """Draw the range of each band as a gray box with a line in its middle."""  # fmt: skip
    x = np.arange(len(lower))
    for i, limits in enumerate(zip(lower, upper, strict=True)):
        label = None if i else name
        axes.fill_between([i - 0.4, i + 0.4], *limits, color="0.82", linewidth=0, label=label)
    axes.hlines((lower + upper) / 2, x - 0.4, x + 0.4, color="0.45", linewidth=0.8, label=middle)
