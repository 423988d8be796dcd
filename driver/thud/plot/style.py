"""Look of all figures: colors, lines, axes, legends."""

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

from thud.base.checks import require_kind, require_mapping
from thud.base.errors import InputError
from thud.level.assessment import ImpactOrRecording
from thud.level.levels import get_bands

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from matplotlib.axes import Axes
    from matplotlib.legend import Legend
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
# Width of a column of a journal page, 8 cm, inch.
WIDTH = 8 / 2.54
FORCE_NAMES = {"elastic": "elastic force", "floor": "force on the floor"}
BAND_NAMES = {"octave": "Octave band", "third": "One-third-octave band"}
LEVEL = "Force exposure level, dB re 1 N"
RATING_SYMBOL = r"$L_\mathrm{iA,Fmax}$"
# Maximum number of characters in a line of a legend.
_LINE = 44
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


@own_style()
def legend_above(axes: Axes, *others: Axes, title: str = "") -> Legend:
    """Put one legend of all axes above their figure, which grows, in as few rows as possible.

    Text without formulas is small.
    """
    figure = axes.get_figure(root=True)
    if figure is None:
        message = "the axes are removed from their figure; allowed: axes of a figure"
        raise InputError(message)
    entries = [
        (handle, fill(name, _LINE))
        for panel in (axes, *others)
        for handle, name in zip(*panel.get_legend_handles_labels(), strict=True)
    ]
    handles, names = zip(*entries, strict=True)
    size = "medium" if any(map(_has_formula, (*names, title))) else "small"
    rows = 0
    while True:
        rows += 1
        legend = figure.legend(
            handles, names, loc="outside upper left", ncols=-(-len(names) // rows), title=title,
            alignment="left", fontsize=size, title_fontsize=size,
        )  # fmt: skip
        box = legend.get_window_extent()
        if rows >= len(names) or box.width < 0.97 * figure.bbox.width:
            width, height = figure.get_size_inches()
            figure.set_size_inches(width, height + box.height / figure.dpi)
            return legend
        legend.remove()


def _has_formula(label: str) -> bool:
    return "$" in label.replace(r"\$", "")


def escape_label(label: str) -> str:
    """Return a label that matplotlib neither takes for a formula nor hides."""
    return label.lstrip("_").replace("$", r"\$")


def styled(i: int, styles: Sequence[Any]) -> Any:  # noqa: ANN401 - of matplotlib
    """Return the style of a curve by its index; styles shift by one after each round of colors."""
    return styles[(i + i // len(COLORS)) % len(styles)]


def line_style(i: int) -> dict[str, Any]:
    """Return color and line style of a curve by its index."""
    return {"color": COLORS[i % len(COLORS)], "linestyle": styled(i, LINES), "linewidth": 1.2}


def marker_style(i: int, size: float = 4) -> dict[str, Any]:
    """Return the marker of a curve by its index."""
    return {"marker": styled(i, MARKERS), "markersize": size}


def add_curves(
    axes: Axes, curves: Mapping[str, tuple[NDArray[np.float64], NDArray[np.float64]]]
) -> None:
    """Draw curves of x and y by their names, each in its color and line style."""
    for i, (name, (x, y)) in enumerate(curves.items()):
        axes.plot(x, y, label=escape_label(name), **line_style(i))


def named(impact: Impact) -> dict[str, Impact]:
    """Return an impact by the name of its case, in words."""
    return {impact.case.name.replace("_", " "): impact}


def iterate_curves(
    impacts: Mapping[str, Curve], force: LevelsForce | None
) -> Iterator[tuple[str, Curve, LevelsForce]]:
    """Yield label, impact and kind of force of each curve.

    By default the force is that assessed in each case; labels name forces that differ. Raises
    InputError if `impacts` is not a mapping of names to impacts, or empty.
    """
    require_mapping("impacts", impacts, "impacts")
    for name, impact in impacts.items():
        require_kind(name, impact, ImpactOrRecording)
    kinds = [impact.assessed_force(force) for impact in impacts.values()]
    for (name, impact), kind in zip(impacts.items(), kinds, strict=True):
        suffix = f", {FORCE_NAMES[kind]}" if len(set(kinds)) > 1 else ""
        yield f"{name}{suffix}", impact, kind


def force_name(impacts: Mapping[str, Curve], force: LevelsForce | None) -> str:
    """Return the name of the force of all curves, or "force" if the curves differ in it."""
    kinds = {kind for _, _, kind in iterate_curves(impacts, force)}
    return FORCE_NAMES[kinds.pop()] if len(kinds) == 1 else "force"


def level_label(impacts: Mapping[str, Curve], force: LevelsForce | None, label: str = LEVEL) -> str:
    """Return the label of an axis of levels, with their force if the curves share it."""
    name = force_name(impacts, force)
    return label if name == "force" else f"{label}\n({name})"


def octave_axis(axes: Axes, bands: BandSet = "octave") -> None:
    """Label the x axis with all bands of a set."""
    nominal = get_bands(bands).nominal
    band_axis(axes, nominal, bands)
    axes.set_xlim(-0.6, len(nominal) - 0.4)


def band_axis(axes: Axes, nominal: NDArray[np.float64], bands: BandSet) -> None:
    """Label the x axis with bands of a set, by their nominal mid-band frequencies, Hz."""
    axes.set_xticks(np.arange(len(nominal)), [f"{frequency:g}" for frequency in nominal])
    axes.xaxis.set_minor_locator(NullLocator())
    axes.set_xlabel(f"{BAND_NAMES[bands]}, Hz")
    if bands == "third":
        axes.tick_params(axis="x", labelrotation=90)


def octave_boxes(
    axes: Axes, lower: NDArray[np.float64], upper: NDArray[np.float64], label: str
) -> None:
    """Draw the range of each octave as a gray box, with one label for all."""
    for i, limits in enumerate(zip(lower, upper, strict=True)):
        name = None if i else label
        axes.fill_between([i - 0.4, i + 0.4], *limits, color="0.82", linewidth=0, label=name)
