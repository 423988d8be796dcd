"""Draw the figures of the documentation into docs/figures.

    python docs/pictures/draw.py [NAME ...]

draws those named, or all. Only screenshots of pages are made otherwise.
"""

from __future__ import annotations

import io
import sys
import warnings
from pathlib import Path
from typing import TYPE_CHECKING

import matplotlib as mpl
from flagship import flagship
from floors import floors, room
from flow import flow
from PIL import Image
from results import RESULTS
from sources import finite_elements, hollow_sphere, lumped_models, modal_ball

from thud.plot.documentation import FIGURES
from thud.plot.save_figures import save

if TYPE_CHECKING:
    from collections.abc import Callable

    from matplotlib.figure import Figure

FOLDER = Path(__file__).parents[1] / "figures"
SKETCHES: dict[str, Callable[[], Figure]] = {
    "sketch_finite_elements": finite_elements,
    "sketch_floors": floors,
    "sketch_flow": flow,
    "sketch_hollow_sphere": hollow_sphere,
    "sketch_lumped_models": lumped_models,
    "sketch_modal_ball": modal_ball,
    "sketch_room": room,
}
PLOTS: dict[str, Callable[[], Figure]] = {**FIGURES, **RESULTS, "flagship": flagship}
# Letters as outlines: the same with any fonts. The same sketch gives the same bytes.
STYLE = {"svg.fonttype": "path", "svg.hashsalt": "thud"}
# Colors of a plot, smoothed edges included; few enough for small files.
COLORS = 128


def draw_sketch(name: str, folder: Path) -> None:
    """Draw a sketch as SVG."""
    with mpl.rc_context(STYLE):
        SKETCHES[name]().savefig(folder / f"{name}.svg", metadata={"Date": None})


def draw_plot(name: str, folder: Path) -> None:
    """Draw a plot as PNG with a palette."""
    path = folder / f"{name}.png"
    save(PLOTS[name](), path)
    with Image.open(path) as picture:
        content = io.BytesIO()
        small = picture.convert("RGB").quantize(COLORS, dither=Image.Dither.NONE)
        small.save(content, "png", optimize=True, dpi=picture.info["dpi"])
    path.write_bytes(content.getvalue())


def draw(names: list[str], folder: Path) -> None:
    """Draw figures by name into a folder."""
    for name in names:
        (draw_sketch if name in SKETCHES else draw_plot)(name, folder)


if __name__ == "__main__":
    warnings.simplefilter("ignore", UserWarning)
    draw(sys.argv[1:] or [*SKETCHES, *PLOTS], FOLDER)
