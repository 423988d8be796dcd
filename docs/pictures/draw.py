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
PICTURES = {
    "flagship": flagship,
    "sketch_finite_elements": finite_elements,
    "sketch_floors": floors,
    "sketch_flow": flow,
    "sketch_hollow_sphere": hollow_sphere,
    "sketch_lumped_models": lumped_models,
    "sketch_modal_ball": modal_ball,
    "sketch_room": room,
}


def draw(directory: Path) -> None:
    """Draw all pictures into a directory."""
    with mpl.rc_context({"mathtext.fontset": "dejavusans", "hatch.linewidth": 0.5}):
        for name, picture in PICTURES.items():
            save(picture(), directory / f"{name}.png")


if __name__ == "__main__":
    draw(FIGURES)
