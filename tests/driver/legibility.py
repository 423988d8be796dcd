"""Measure how legible a figure is at the width of a column: sizes, overlaps, hidden curves."""

from __future__ import annotations

from collections import defaultdict
from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.backends.backend_agg import RendererAgg
from matplotlib.collections import Collection
from matplotlib.colors import to_rgb
from matplotlib.container import Container
from matplotlib.lines import Line2D
from matplotlib.mathtext import MathTextParser
from scipy.ndimage import binary_dilation

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.figure import Figure
    from matplotlib.text import Text
    from numpy.typing import NDArray

    Ink = NDArray[np.bool_]
    Picture = NDArray[np.int16]

# Width of a column, inch, and size of the smallest letters, pt.
COLUMN = 8 / 2.54
SMALLEST = 6.0
# Pixels per inch of the pictures that are compared.
DPI = 150
# Difference of colors that is seen, of 255, and number of pixels of a curve that is seen.
CONTRAST, SEEN = 64, 20


class Recorder(RendererAgg):
    """Renderer that notes all texts, and draws them or not."""

    def __init__(self, figure: Figure, *, with_text: bool = True) -> None:
        """Take the size of a figure."""
        super().__init__(*figure.bbox.size, figure.dpi)
        self.with_text = with_text
        self.texts: list[Text] = []
        self.sizes: dict[Text, float] = {}

    def draw_text(  # type: ignore[override]  # noqa: PLR0913, PLR0917 - of matplotlib
        self, gc: Any, x: float, y: float, s: str, prop: Any, angle: float,  # noqa: ANN401
        ismath: bool | str = False, mtext: Text | None = None,  # noqa: FBT001, FBT002
    ) -> None:  # fmt: skip
        """Note a text, and draw it."""
        if mtext is not None:
            self.texts.append(mtext)
            size = prop.get_size_in_points()
            if ismath:
                glyphs = MathTextParser("path").parse(s, 72, prop).glyphs
                size = min((glyph[1] for glyph in glyphs), default=size)
            self.sizes[mtext] = min(size, self.sizes.get(mtext, np.inf))
        if self.with_text:
            super().draw_text(gc, x, y, s, prop, angle, ismath, mtext)

    def picture(self) -> Picture:
        """Return the colors, shape (height, width, 3)."""
        return np.asarray(self.buffer_rgba())[..., :3].astype(np.int16)


def _draw(figure: Figure, *, with_text: bool = True) -> Recorder:
    renderer = Recorder(figure, with_text=with_text)
    figure.draw(renderer)
    return renderer


def _ink(figure: Figure, text: Text) -> Ink:
    """Return the pixels of a text, and those beside them."""
    renderer = Recorder(figure)
    text.draw(renderer)
    return np.asarray(binary_dilation(np.asarray(renderer.buffer_rgba())[..., 3] > 0))


def find_faults(figure: Figure) -> list[str]:
    """Return what is not legible in a figure that is shown at the width of a column."""
    figure.set_dpi(DPI)
    figure.draw_without_rendering()
    # What is hidden in turn must not move the rest.
    figure.set_layout_engine("none")
    drawn = _draw(figure)
    names = {text: repr(text.get_text()) for text in drawn.texts}
    scale = COLUMN / figure.get_figwidth()
    sizes = {text: scale * size for text, size in drawn.sizes.items()}
    faults = [f"{names[text]}: {size:.2f} pt" for text, size in sizes.items() if size < SMALLEST]
    inks = {text: _ink(figure, text) for text in names}
    for (first, ink), (second, other) in combinations(inks.items(), 2):
        if (ink & other).any():
            faults.append(f"{names[first]} and {names[second]} overlap")
    behind = _draw(figure, with_text=False).picture()
    for text, ink in inks.items():
        if ink.any() and np.ptp(behind[ink], axis=0).max() > CONTRAST:
            faults.append(f"{names[text]} is on a mark")
        box = text.get_window_extent()
        if (box.min < -1).any() or (box.max > figure.bbox.max + 1).any():
            faults.append(f"{names[text]} is cut")
    return faults + [f"{name!r} is not seen" for name in _find_hidden(figure, behind)]


def _find_hidden(figure: Figure, complete: Picture) -> list[str]:
    """Return the entries of legends whose curves or areas are not seen."""
    artists: dict[str, list[Any]] = defaultdict(list)
    for axes in figure.axes:
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
            parts = handle.get_children() if isinstance(handle, Container) else [handle]
            artists["".join(label.split())].append([part for part in parts if part is not None])
    legends = [*figure.legends, *filter(None, (axes.get_legend() for axes in figure.axes))]
    names = [text.get_text() for legend in legends for text in legend.get_texts()]
    return [
        name
        for name in names
        if not any(_is_seen(figure, parts, complete) for parts in artists["".join(name.split())])
    ]


def _is_seen(figure: Figure, parts: list[Any], complete: Picture) -> bool:
    """Return whether a picture without the parts of an artist differs.

    Of an artist without data, which stands for others in a legend, the color must be in the axes.
    """
    if all(map(_is_empty, parts)):
        return any(_has_color(figure, part, complete) for part in parts)
    for part in parts:
        part.set_visible(False)
    change = abs(_draw(figure, with_text=False).picture() - complete).max(axis=-1)
    for part in parts:
        part.set_visible(True)
    return int((change > CONTRAST / 2).sum()) >= SEEN


def _is_empty(artist: Artist) -> bool:
    if isinstance(artist, Line2D):
        return len(artist.get_xdata()) == 0  # type: ignore[arg-type]
    paths = artist.get_paths() if isinstance(artist, Collection) else None
    return paths is not None and not any(len(path.vertices) for path in paths)


def _has_color(figure: Figure, artist: Any, complete: Picture) -> bool:  # noqa: ANN401 - of matplotlib
    """Return whether the color of an artist is found in axes."""
    color = artist.get_color() if isinstance(artist, Line2D) else artist.get_facecolor()[0]
    near = abs(complete - 255 * np.array(to_rgb(color))).max(axis=-1)[::-1] < CONTRAST / 4
    boxes = (axes.get_window_extent().extents.astype(int).clip(0) for axes in figure.axes)
    return any(near[bottom:top, left:right].sum() >= SEEN for left, bottom, right, top in boxes)
