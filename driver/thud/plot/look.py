"""The look of all figures: colours, sizes, axes, legends; and how they are saved."""

import io
import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Literal, TypeVar

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.legend import Legend
from matplotlib.ticker import NullLocator
from numpy.typing import NDArray

from thud.checks import require_kind
from thud.errors import InputError
from thud.files import replace_file
from thud.impact import FORCES, Impact
from thud.levels import get_bands
from thud.recording import Recording

Curve = TypeVar("Curve", bound=Impact | Recording)

# Okabe and Ito's colours, for any colour vision; line styles distinguish curves in print.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
LINES = ("-", "--", "-.", ":", (0, (5, 1, 1, 1, 1, 1)), (0, (1, 1)), (0, (8, 2)))
MARKERS = ("o", "s", "^", "D", "v", "P", "X")
# Areas behind curves.
GREY = "0.85"
# Width of a column, inch, and size of text, pt.
WIDTH = 3.5
SIZE = 8
# Legends of many entries.
COMPACT: dict[str, Any] = {"handlelength": 1.8, "handletextpad": 0.4, "columnspacing": 0.8}
FORMATS = ("pdf", "png", "svg")


def new_figure(height: float, width: float = WIDTH) -> Figure:
    """Return an empty figure; lengths in inches."""
    return Figure(figsize=(width, height), dpi=300, layout="constrained")


def empty_axes(height: float) -> tuple[Figure, Axes]:
    """Return an empty figure of column width and its axes."""
    figure = new_figure(height)
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
    """Put the legend above the axes; `place` is its corner that is fixed to them."""
    return axes.legend(
        fontsize=SIZE - 1, frameon=False, ncols=columns, loc=place,
        bbox_to_anchor=(float(place == "lower right"), 1), **COMPACT,
    )  # fmt: skip


def literal(label: str) -> str:
    """Return a label that matplotlib neither takes for a formula nor hides."""
    return label.lstrip("_").replace("$", r"\$")


def line_style(i: int) -> dict[str, Any]:
    """Return colour and line style of a curve by its number."""
    return {
        "color": COLOURS[i % len(COLOURS)],
        "linestyle": LINES[i % len(LINES)],
        "linewidth": 1.2,
    }


def marker_style(i: int, size: float = 4) -> dict[str, Any]:
    """Return the marker of a curve by its number."""
    return {"marker": MARKERS[i % len(MARKERS)], "markersize": size}


def add_curves(
    axes: Axes, curves: Mapping[str, tuple[NDArray[np.float64], NDArray[np.float64]]]
) -> None:
    """Draw curves of x and y by their names, each in its colour and line style."""
    for i, (name, (x, y)) in enumerate(curves.items()):
        axes.plot(x, y, label=literal(name), **line_style(i))


def named(impact: Impact) -> dict[str, Impact]:
    """Return an impact by the name of its case, in words."""
    return {impact.case.name.replace("_", " "): impact}


def iterate_curves(
    impacts: Mapping[str, Curve], force: str | None
) -> Iterator[tuple[str, Curve, str]]:
    """Yield label, impact and kind of force of each curve.

    Raises
    ------
    InputError
        Where `impacts` is not a mapping of names to impacts, or empty.
    """
    if not isinstance(impacts, Mapping) or not impacts:
        message = "impacts are not given; allowed: a mapping of names to one or more impacts"
        raise InputError(message)
    for name, impact in impacts.items():
        require_kind(name, impact, Impact | Recording)
        if force:
            yield literal(name), impact, force
        else:
            prefix = f"{name}, " if len(impacts) > 1 else ""
            same = np.array_equal(impact.force("elastic"), impact.force("floor"))
            for kind in FORCES[1:] if same else FORCES:
                yield literal(f"{prefix}{kind} force"), impact, kind


def add_legend(axes: Axes, impacts: Mapping[str, Impact]) -> None:
    """Add the legend, titled by the name of a single impact."""
    title = literal(next(iter(impacts))) if len(impacts) == 1 else None
    axes.legend(fontsize=SIZE, frameon=False, title=title, title_fontsize=SIZE)


def octave_axis(axes: Axes, bands: str = "octave") -> None:
    """Label the axis with the bands."""
    names = [f"{frequency:g}" for frequency in get_bands(bands).nominal]
    axes.set_xticks(np.arange(len(names)), names)
    axes.xaxis.set_minor_locator(NullLocator())
    axes.set_xlim(-0.6, len(names) - 0.4)
    axes.set_xlabel(f"{bands.capitalize()} band, Hz", fontsize=SIZE)
    if bands == "third":
        axes.tick_params(axis="x", labelrotation=90)


def octave_boxes(
    axes: Axes, lower: NDArray[np.float64], upper: NDArray[np.float64], label: str
) -> None:
    """Draw the range of each octave as a grey box; the label is that of all of them."""
    for place, limits in enumerate(zip(lower, upper, strict=True)):
        name = label if place == 0 else None
        line = [place - 0.4, place + 0.4]
        axes.fill_between(line, *limits, color="0.82", linewidth=0, label=name)


def save(figure: Figure, path: str | os.PathLike[str]) -> None:
    """Save a figure atomically, in the format of the ending of its path.

    Parameters
    ----------
    figure
        The figure.
    path
        Path of the file; an existing one is replaced.

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
    # Without a date and with constant names, the same figure gives the same bytes.
    metadata = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}.get(kind)
    with mpl.rc_context({"svg.hashsalt": "thud"}):
        figure.savefig(content, format=kind, metadata=metadata)
    replace_file(path, content.getvalue())


def save_all(figures: Mapping[str, Figure], directory: str | os.PathLike[str]) -> list[Path]:
    """Save figures as PNG and SVG under their names and return the paths of the files.

    Raises
    ------
    OSError
        Where a file cannot be written.
    """
    paths = []
    for name, figure in figures.items():
        for ending in ("png", "svg"):
            paths.append(Path(directory, f"{name}.{ending}"))
            save(figure, paths[-1])
    return paths
