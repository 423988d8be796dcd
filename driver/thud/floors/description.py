"""A predicted floor in words: its layers, contributions to the uncertainty, and the verdict."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

from thud.base._schema import (
    RATINGS,
    VERDICTS,
    JoistFloor,
    LaminateFloor,
    MeasuredMobility,
    ModalFloor,
    Plate,
    RectangularFloor,
)
from thud.case.constructions import Layer

if TYPE_CHECKING:
    from collections.abc import Iterator

    from thud.base._schema import FloorOptions, Room, RoomRating
    from thud.floors.prediction import RoomPrediction


class Contribution(NamedTuple):
    """A contribution to the uncertainty of a rating in words, and what would make it smaller."""

    title: str
    remedy: str


# What no data of the floor can tell, beside each rating.
CAVEAT = "rigid boxes, no measurement behind it"
# Contributions to the uncertainty of a rating.
CONTRIBUTIONS = {
    "edges": Contribution("support of the edges", "a stated support, or the modes of the floor"),
    "floor_and_room": Contribution(
        "data of floor and room", "measured data of the materials and the reverberation time"
    ),
    "source": Contribution("another source that conforms", "a measured force of the source"),
    "model": Contribution("the model: rigid boxes", "a measurement in the building"),
}
# Thicknesses that a case does not state, for its drawing, m.
_LAYER, _BOARD = 0.02, 0.0125
# Density that gives the drawn thickness of an added mass, kg/m3: that of loose gravel.
_GRAVEL_DENSITY = 1500.0
# Thicknesses of the layers of a laminate by default, m.
_LAMELLAS = (0.04, 0.02, 0.04, 0.02, 0.04)
_ASSUMED = "(thickness assumed)"


def rating_title(prediction: RoomPrediction, name: RoomRating) -> str:
    """Return the title of a rating, with its standard if the source is the ball."""
    return RATINGS[name] if prediction.is_ball else f"A-weighted level ({name})"


def source_note(prediction: RoomPrediction) -> str:
    """Return the note that belongs beside each rating by a source that does not conform."""
    return "the source does not conform" if prediction.source_notes else ""


def chance(prediction: RoomPrediction) -> str:
    """Return limit and probability of a requirement: "meets 49 dB with 31 %"; else nothing."""
    limit = prediction.room.required
    return f"meets {limit:g} dB with {100 * prediction.probability:.0f} %" if limit else ""


def rating_text(prediction: RoomPrediction) -> str:
    """Return the rating, the probability to meet a requirement, and the note on the source."""
    words = "; ".join(filter(None, (str(prediction.rating), chance(prediction))))
    return ", ".join(filter(None, (words, source_note(prediction))))


def remedy(prediction: RoomPrediction) -> str:
    """Return what would reduce the largest contribution to the uncertainty of the rating."""
    return CONTRIBUTIONS[next(iter(prediction.rating.contributions))].remedy


def verdict_text(prediction: RoomPrediction) -> str:
    """Return probability and verdict on a requirement, and what would decide it; else nothing."""
    if not prediction.verdict:
        return ""
    text = f"{chance(prediction)}: {prediction.verdict}"
    if prediction.verdict != VERDICTS[2]:
        return text
    return f"{text}; {source_note(prediction) or f'to decide it: {remedy(prediction)}'}"


def case_layers(floor: FloorOptions, room: Room) -> tuple[Layer, ...]:
    """Return the layers that the keys of a floor and a room describe, from top to bottom.

    A floor without a plate has no layers.
    """
    is_plate = isinstance(floor, RectangularFloor | ModalFloor | MeasuredMobility)
    return tuple(_layers(floor, room)) if is_plate else ()


def _layers(floor: Any, room: Room) -> Iterator[Layer]:  # noqa: ANN401 - the keys of floors differ
    built = floor if isinstance(floor, RectangularFloor) else None
    if built and built.screed_thickness:
        yield Layer(f"floating plate, {built.screed_density:g} kg/m³", built.screed_thickness)
        yield Layer(f"resilient layer {_ASSUMED}", _LAYER)
    below = built if built and built.subceiling_thickness else None
    cavity = below.cavity_depth if below else room.ceiling_depth if room.ceiling_mass else 0.0
    if isinstance(floor, JoistFloor):
        yield Layer(f"sheathing, {floor.sheathing_density:g} kg/m³", floor.sheathing_thickness)
        width, spacing = floor.joist_width, floor.spacing
        mean_density = floor.joist_density * width / spacing
        yield Layer("joists", floor.joist_height, mean_density, width, spacing)
        cavity -= floor.joist_height
    elif isinstance(floor, LaminateFloor):
        if floor.added_mass:
            added = f"added mass, {floor.added_mass:g} kg/m² {_ASSUMED}"
            yield Layer(added, floor.added_mass / _GRAVEL_DENSITY)
        # By default the key is empty.
        for i, thickness in enumerate(floor.layer_thickness or _LAMELLAS):
            yield Layer(f"lamella, {'across' if i % 2 else 'along'}", thickness)
    else:
        kind = "plate" if isinstance(floor, Plate) else "plate like the floor"
        yield Layer(f"{kind}, {floor.density:g} kg/m³", floor.thickness)
    if round(cavity, 6) > 0:
        yield Layer("cavity", round(cavity, 6), room.air_density)
    if below:
        density = f"{below.subceiling_density:g} kg/m³"
        yield Layer(f"subceiling, {density}", below.subceiling_thickness)
    if room.ceiling_mass:
        yield Layer(f"ceiling, {room.ceiling_mass:g} kg/m² {_ASSUMED}", _BOARD)
