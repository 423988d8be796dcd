"""Save figures."""

from __future__ import annotations

import io
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from thud.base.checks import shown
from thud.base.display import draw_all, warn_if_not_drawn
from thud.base.errors import InputError
from thud.base.files import replace_file
from thud.plot.style import own_style

if TYPE_CHECKING:
    import os
    from collections.abc import Callable, Mapping

    from matplotlib.figure import Figure

# The first is the default: the smallest, and the fastest to write.
FORMATS = ("svg", "png", "pdf")


def save(figure: Figure, path: str | os.PathLike[str]) -> None:
    """Save a figure atomically, in the format that the ending of the path names.

    Parameters
    ----------
    figure
        The figure.
    path
        Path of the file; an existing one is replaced.

    Raises
    ------
    InputError
        If the ending is not one of svg, png and pdf.
    OSError
        If the file cannot be written.
    """
    kind = Path(path).suffix[1:].lower()
    if kind not in FORMATS:
        message = f"{path}: ending {shown(kind)} is not known; allowed: {', '.join(FORMATS)}"
        raise InputError(message)
    replace_file(path, _content(figure, Path(path).stem, kind))


@own_style()
def _content(figure: Figure, name: str, kind: str) -> bytes:
    """Return the content of the file of a figure."""
    content = io.BytesIO()
    # Without a date, the same figure gives the same bytes.
    date = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}.get(kind, {})
    title = name.replace("_", " ").capitalize()
    engine = figure.get_layout_engine()
    _fix_layout(figure)
    figure.savefig(content, format=kind, metadata={"Title": title, **date})
    figure.set_layout_engine(engine)
    return content.getvalue()


def _fix_layout(figure: Figure) -> None:
    """Round the positions of axes, whose last digits the solver of the layout leaves to chance."""
    figure.draw_without_rendering()
    figure.set_layout_engine("none")
    for axes in figure.axes:
        if axes.get_axes_locator() is None:
            x, y, width, height = np.round(axes.get_position().bounds, 6)
            axes.set_position((x, y, width, height))
            axes.set_in_layout(True)


def figure_files(figures: Mapping[str, Figure], kind: str = FORMATS[0]) -> dict[str, bytes]:
    """Return the contents of figures by file name; warn of those that cannot be drawn."""
    contents = {}
    for name, figure in figures.items():
        with warn_if_not_drawn(f"{name}.{kind}"):
            contents[f"{name}.{kind}"] = _content(figure, name, kind)
    return contents


def page_files(name: str, draw: Callable[[], Figure], html: str) -> dict[str, bytes]:
    """Return the contents of a figure and of the page of the same name by file name."""
    return {**figure_files(draw_all({name: draw})), f"{name}.html": html.encode()}
