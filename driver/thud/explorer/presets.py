"""Named cases with which the page begins, by door: a ball, a floor and the room below."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

from thud.base._schema import STANDARD_BALL, Ball, FiniteElement
from thud.case.case import Case
from thud.case.constructions import construction
from thud.explorer.models import changed_values, input_case

if TYPE_CHECKING:
    from collections.abc import Callable

# Modulus of an aged ball, Pa: aging raises it by a fifth, an assumption (docs, an aged ball).
AGED_MODULUS = 1.2 * STANDARD_BALL["finite_element", "youngs_modulus"]

# Title, what it is in one line, door of the page, and function of the case of each.
PRESETS: dict[str, tuple[str, str, str, Callable[[], Case]]] = {
    "standard_ball": (
        "Standard ball",
        "Use it by default: modes of a rubber sphere, calibrated on the levels of the standards",
        "ball",
        Case,
    ),
    "finite_elements": (
        "Standard ball, finite elements",
        "A check at large strain, calibrated on the nominal levels of the standards",
        "ball",
        lambda: Case(model=FiniteElement()),
    ),
    "aged_ball": (
        "Aged ball",
        "Finite elements with a modulus that aging has raised by 20 %, an assumption: change it",
        "ball",
        lambda: Case(ball=Ball(youngs_modulus=AGED_MODULUS), model=FiniteElement()),
    ),
    "shell": (
        "Ball of the paper",
        "The analytical shell, assessed by its ball force as in the paper",
        "ball",
        partial(input_case, "rubber_ball_100cm.nml"),
    ),
    "tyre": (
        "Tyre",
        "The tyre of the bang machine: belt and rim",
        "ball",
        partial(input_case, "tyre.nml"),
    ),
    "slab": (
        "Concrete slab, 180 mm",
        "A bare slab of 5 m by 4 m and the room below",
        "floor",
        lambda: construction("concrete 180").case(),
    ),
}


def presets() -> list[dict[str, Any]]:
    """Return the presets for the page; the first is the case with which it begins."""
    keys = "title", "text", "door"
    return [
        {"name": name, **dict(zip(keys, texts, strict=True)), "values": changed_values(case())}
        for name, (*texts, case) in PRESETS.items()
    ]
