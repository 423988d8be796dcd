"""Draw the pictures of the documentation into docs/figures: `python docs/pictures/draw.py`."""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl
from flagship import flagship
from floors import floors, room
from flow import flow
from sources import finite_elements, hollow_sphere, lumped_models, modal_ball

from thud.plot import save

FIGURES = Path(__file__).parents[1] / "figures"
SKETCHES = {
    "finite_elements": finite_elements,
    "floors": floors,
    "flow": flow,
    "hollow_sphere": hollow_sphere,
    "lumped_models": lumped_models,
    "modal_ball": modal_ball,
    "room": room,
}
# Letters as outlines: the same with any fonts. The same sketch gives the same bytes.
STYLE = {"hatch.linewidth": 0.5, "svg.fonttype": "path", "svg.hashsalt": "thud"}


def draw(directory: Path) -> None:
    """Draw all pictures into a directory."""
    save(flagship(), directory / "flagship.png")
    with mpl.rc_context(STYLE):
        for name, sketch in SKETCHES.items():
            sketch().savefig(directory / f"sketch_{name}.svg", metadata={"Date": None})


if __name__ == "__main__":
    draw(FIGURES)
