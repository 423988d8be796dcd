"""The look of all figures: colours, sizes, axes, legends; and how they are saved."""

import io
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from textwrap import fill
from typing import Any, TypeVar

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.legend import Legend
from matplotlib.ticker import NullLocator
from numpy.typing import NDArray

from thud.base._schema import BandSet, LevelsForce
from thud.base.checks import require_kind, shown
from thud.base.display import draw_all, left_out
from thud.base.errors import InputError
from thud.base.files import Results, replace_file
from thud.impact.impact import Impact
from thud.level.impact_result import ImpactResult
from thud.level.levels import get_bands

Curve = TypeVar("Curve", bound=ImpactResult)

# Okabe and Ito's colours, for any colour vision; line styles distinguish curves in print.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
LINES = ("-", "--", "-.", ":", (0, (5, 1, 1, 1, 1, 1)), (0, (1, 1)), (0, (8, 2)))
MARKERS = ("o", "s", "^", "D", "v", "P", "X")
# Of bars; in print they tell colours apart.
HATCHES = (None, "//////", "......", "\\\\\\\\\\\\", "xxxxxx", "------", "||||||", "++++++")
# Areas behind curves.
GREY = "0.85"
# Width of a column, inch, and size of text, pt.
WIDTH = 3.5
SIZE = 8
FORMATS = ("pdf", "png", "svg")
FORCE_WORDS = {"elastic": "elastic force", "floor": "force on the floor"}
BAND_WORDS = {"octave": "Octave band", "third": "One-third-octave band"}
LEVEL = "Force exposure level, dB re 1 N"
# Maximum number of letters of a line of a legend.
_LINE = 44
# Beside matplotlib's defaults: text in vector graphics stays text, and the same figure gives the
# same bytes everywhere.
_STYLE: dict[Any, Any] = {"svg.fonttype": "none", "svg.hashsalt": "thud", "timezone": "UTC"}


@contextmanager
def own_style() -> Iterator[None]:
    """Draw and save in the style of all figures, whatever a user's matplotlibrc says.

    It decorates the functions that draw.
    """
    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(_STYLE)
        yield


def new_figure(height: float, width: float = WIDTH) -> Figure:
    """Return an empty figure; lengths in inches."""
    return Figure(figsize=(width, height), dpi=300, layout="constrained")


def empty_axes(height: float) -> tuple[Figure, Axes]:
    """Return an empty figure of column width and its axes."""
    figure = new_figure(height)
    return figure, style_axes(figure.add_subplot())


def style_axes(axes: Axes) -> Axes:
    """Give axes the look of all figures."""
    axes.tick_params(labelsize=SIZE)
    axes.grid(visible=True, linewidth=0.4, alpha=0.5)
    axes.set_axisbelow(True)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    return axes


def legend_above(axes: Axes, title: str = "") -> Legend:
    """Put the legend of axes above all axes of their figure, in as few rows as its width allows.

    The figure becomes higher by the legend.
    """
    figure = axes.get_figure(root=True)
    if figure is None:
        message = "the axes are removed from their figure; allowed: axes of a figure"
        raise InputError(message)
    handles, names = axes.get_legend_handles_labels()
    rows = 0
    while True:
        rows += 1
        legend = figure.legend(
            handles, [fill(name, _LINE) for name in names], loc="outside upper left",
            ncols=-(-len(names) // rows), title=title, title_fontsize=SIZE - 1, alignment="left",
            fontsize=SIZE - 1, frameon=False, borderpad=0, handlelength=2.4, handletextpad=0.4,
            columnspacing=0.8,
        )  # fmt: skip
        size = legend.get_window_extent()
        if rows >= len(names) or size.width < 0.97 * figure.bbox.width:
            width, height = figure.get_size_inches()
            figure.set_size_inches(width, height + size.height / figure.dpi)
            return legend
        legend.remove()


def escape_label(label: str) -> str:
    """Return a label that matplotlib neither takes for a formula nor hides."""
    return label.lstrip("_").replace("$", r"\$")


def styled(i: int, styles: Sequence[Any]) -> Any:  # noqa: ANN401 - of matplotlib
    """Return the style of a curve by its number; each round of colours has it shifted by one."""
    return styles[(i + i // len(COLOURS)) % len(styles)]


def line_style(i: int) -> dict[str, Any]:
    """Return colour and line style of a curve by its number."""
    return {
        "color": COLOURS[i % len(COLOURS)],
        "linestyle": styled(i, LINES),
        "linewidth": 1.2,
    }


def marker_style(i: int, size: float = 4) -> dict[str, Any]:
    """Return the marker of a curve by its number."""
    return {"marker": styled(i, MARKERS), "markersize": size}


def add_curves(
    axes: Axes, curves: Mapping[str, tuple[NDArray[np.float64], NDArray[np.float64]]]
) -> None:
    """Draw curves of x and y by their names, each in its colour and line style."""
    for i, (name, (x, y)) in enumerate(curves.items()):
        axes.plot(x, y, label=escape_label(name), **line_style(i))


def named(impact: Impact) -> dict[str, Impact]:
    """Return an impact by the name of its case, in words."""
    return {impact.case.name.replace("_", " "): impact}


def iterate_curves(
    impacts: Mapping[str, Curve], force: LevelsForce | None
) -> Iterator[tuple[str, Curve, LevelsForce]]:
    """Yield label, impact and kind of force of each curve.

    Without `force` each case has the force that it assesses. Labels say which where they differ.

    Raises
    ------
    InputError
        Where `impacts` is not a mapping of names to impacts, or empty.
    """
    if not isinstance(impacts, Mapping) or not impacts:
        message = "impacts are not given; allowed: a mapping of names to one or more impacts"
        raise InputError(message)
    for name, impact in impacts.items():
        require_kind(name, impact, ImpactResult)
    kinds = [impact.assessed_force(force) for impact in impacts.values()]
    for (name, impact), kind in zip(impacts.items(), kinds, strict=True):
        which = f", {FORCE_WORDS[kind]}" if len(set(kinds)) > 1 else ""
        yield f"{name}{which}", impact, kind


def force_words(impacts: Mapping[str, Curve], force: LevelsForce | None) -> str:
    """Return the words for the force of all curves, those for any where labels say which."""
    kinds = {kind for _, _, kind in iterate_curves(impacts, force)}
    return FORCE_WORDS[kinds.pop()] if len(kinds) == 1 else "force"


def level_label(impacts: Mapping[str, Curve], force: LevelsForce | None, what: str = LEVEL) -> str:
    """Return the label of an axis of levels, with their force where labels do not say which."""
    words = force_words(impacts, force)
    return what if words == "force" else f"{what}\n({words})"


def octave_axis(axes: Axes, bands: BandSet = "octave") -> None:
    """Label the axis with the bands."""
    nominal = get_bands(bands).nominal
    band_axis(axes, nominal, bands)
    axes.set_xlim(-0.6, len(nominal) - 0.4)


def band_axis(axes: Axes, nominal: NDArray[np.float64], bands: BandSet) -> None:
    """Label the axis with some of the bands of a set, by their rounded mid frequencies, Hz."""
    axes.set_xticks(np.arange(len(nominal)), [f"{frequency:g}" for frequency in nominal])
    axes.xaxis.set_minor_locator(NullLocator())
    axes.set_xlabel(f"{BAND_WORDS[bands]}, Hz", fontsize=SIZE)
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
        message = f"{path}: ending {shown(kind)} is not known; allowed: {', '.join(FORMATS)}"
        raise InputError(message)
    replace_file(path, _picture(figure, Path(path).stem, kind))


@own_style()
def _picture(figure: Figure, name: str, kind: str) -> bytes:
    """Return the content of the file of a figure."""
    content = io.BytesIO()
    # Without a date, the same figure gives the same bytes.
    date = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}.get(kind, {})
    title = name.replace("_", " ").capitalize()
    figure.savefig(content, format=kind, metadata={"Title": title, **date})
    return content.getvalue()


def picture_files(figures: Mapping[str, Figure]) -> dict[str, bytes]:
    """Return the contents of figures as PNG and SVG by the names of their files.

    Those that cannot be drawn are left out, with a `ReportWarning`.
    """
    contents = {}
    for name, figure in figures.items():
        for kind in ("png", "svg"):
            with left_out(f"{name}.{kind}"):
                contents[f"{name}.{kind}"] = _picture(figure, name, kind)
    return contents


def save_all(
    figures: Mapping[str, Figure], directory: str | os.PathLike[str], *, replace: bool = False
) -> list[Path]:
    """Save figures as PNG and SVG under their names and return the paths of the files.

    Parameters
    ----------
    figures
        Figures by name.
    directory
        Directory of the files; it is made where there is none.
    replace
        Replace also files that thud has not written.

    Raises
    ------
    InputError
        Where a file is in the way.
    OSError
        Where a file cannot be written.

    Warns
    -----
    ReportWarning
        Where a figure cannot be drawn.
    """
    return Results(Path(directory), "plot", replace=replace).write(picture_files(figures))


def page_files(name: str, draw: Callable[[], Figure], html: str) -> dict[str, bytes]:
    """Return the contents of a figure and of the page of the same name by the names of files."""
    return {**picture_files(draw_all({name: draw})), f"{name}.html": html.encode()}
