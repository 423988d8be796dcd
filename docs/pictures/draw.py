"""Draw the figures of the documentation, all but the screenshots of pages."""

from __future__ import annotations

import argparse
import io
import warnings
from pathlib import Path
from typing import TYPE_CHECKING

import matplotlib as mpl
from flagship import flagship
from floors import floors, room
from flow import flow
from models import FIGURES
from PIL import Image
from PIL.PngImagePlugin import PngInfo
from results import RESULTS
from sources import finite_elements, hollow_sphere, lumped_models, modal_ball

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
        # Colors of few pixels are kept too; means of similar colors keep those of large areas.
        small = picture.convert("RGB").quantize(
            256, Image.Quantize.MAXCOVERAGE, kmeans=1, dither=Image.Dither.NONE
        )
        text = PngInfo()
        text.add_text("Title", picture.info["Title"])
        small.save(content, "png", optimize=True, dpi=picture.info["dpi"], pnginfo=text)
    path.write_bytes(content.getvalue())


def main() -> None:
    """Draw the figures that the command line names."""
    parser = argparse.ArgumentParser(description=__doc__)
    known = [*SKETCHES, *PLOTS]
    parser.add_argument("names", nargs="*", metavar="NAME", help="figures; by default all")
    parser.add_argument("--folder", type=Path, default=FOLDER, help="folder of the files")
    options = parser.parse_args()
    if unknown := set(options.names) - set(known):
        parser.error(f"unknown: {', '.join(sorted(unknown))}; known: {', '.join(known)}")
    warnings.simplefilter("ignore", UserWarning)
    for name in options.names or known:
        (draw_sketch if name in SKETCHES else draw_plot)(name, options.folder)


if __name__ == "__main__":
    main()
