"""Named cases with which the page begins, by door: a ball, a floor and the room below."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

from thud.base._schema import STANDARD_BALL, Ball, FiniteElement
from thud.case.case import Case
from thud.case.constructions import construction
from thud.explorer.models import changed_values, input_case

if TYPE_CHECKING:
    from collections.abc import Callable

# Ratio of the modulus of an aged ball to that of a new one: an assumption (docs, an aged ball).
AGING = 1.2


class Preset(NamedTuple):
    """Named case: title, what it is in one line, door of the page, and function of its case."""

    title: str
    text: str
    door: str
    case: Callable[[], Case]


def _aged_ball() -> Case:
    modulus = STANDARD_BALL["finite_element", "youngs_modulus"]
    return Case(ball=Ball(youngs_modulus=AGING * modulus), model=FiniteElement())


PRESETS = {
    "standard_ball": Preset(
        "Standard ball",
        "Use it by default: modes of a rubber sphere, calibrated on the levels of the standards",
        "ball",
        Case,
    ),
    "finite_elements": Preset(
        "Standard ball, finite elements",
        "A check at large strain, calibrated on the nominal levels of the standards",
        "ball",
        lambda: Case(model=FiniteElement()),
    ),
    "aged_ball": Preset(
        "Aged ball",
        "Finite elements with a modulus that aging has raised by a fifth, an assumption: "
        "change the modulus below",
        "ball",
        _aged_ball,
    ),
    "shell": Preset(
        "Ball of the paper",
        "The analytical shell, assessed by its ball force as in the paper",
        "ball",
        partial(input_case, "rubber_ball_100cm.nml"),
    ),
    "tyre": Preset(
        "Tyre",
        "The tyre of the bang machine: belt and rim",
        "ball",
        partial(input_case, "tyre.nml"),
    ),
    "slab": Preset(
        "Concrete slab, 180 mm",
        "A bare slab of 5 m by 4 m and the room below",
        "floor",
        lambda: construction("concrete 180").case(),
    ),
}


def presets() -> list[dict[str, Any]]:
    """Return the presets for the page; the first is the case with which it begins."""
    return [
        {
            "name": name,
            "title": preset.title,
            "text": preset.text,
            "door": preset.door,
            "values": changed_values(preset.case()),
        }
        for name, preset in PRESETS.items()
    ]
