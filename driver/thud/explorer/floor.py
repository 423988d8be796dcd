"""What the page shows of a floor and the room below: section, response, levels and ratings."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np

from thud.base._schema import RATED_BANDS, Room
from thud.case.keys import humanize
from thud.explorer.criteria import RESULTS
from thud.explorer.models import MODEL_FACTS
from thud.explorer.series import curve, to_json
from thud.floors.description import (
    CAVEAT,
    CONTRIBUTIONS,
    case_layers,
    chance,
    rating_title,
    source_note,
    verdict_text,
)  # fmt: skip
from thud.impact.contact_time import contact_force
from thud.level.rating import class_text

if TYPE_CHECKING:
    from thud.case.case import Case
    from thud.floors.prediction import RoomPrediction
    from thud.impact.floor_impact import FloorImpact
    from thud.impact.impact import Impact

    Answer = dict[str, Any]


def section(case: Case) -> Answer | None:
    """Return what a section shows: source, and layers from top to bottom; lengths in m.

    None for a floor without layers. The radius of a source that is no ball is 0.
    """
    room = case.room or Room()
    layers = case_layers(case.floor, room) if case.floor else ()
    if not layers:
        return None
    facts = MODEL_FACTS.get(case.model.name if case.model else "")
    is_ball = not facts or "outer_radius" not in facts.unused
    return {
        "radius": case.ball.outer_radius if is_ball else 0.0,
        "height": case.drop.height,
        "layers": [asdict(layer) | {"name": layer.description} for layer in layers],
    }


def floor_answer(impact: Impact, on_floor: FloorImpact) -> Answer:
    """Return force and velocity of a mobile floor, its quantities, and a row for each octave.

    A row has the mid frequency, Hz, levels of the force on a rigid floor and on this one, and their
    difference, dB, and the energy into the floor, mJ.
    """
    shown = np.flatnonzero(on_floor.time <= on_floor.touch_time + 2 * on_floor.contact_time)
    times = 1e3 * (on_floor.time - on_floor.touch_time)
    contact = contact_force(on_floor, "floor")
    injected = on_floor.injected_energy()
    octaves = (
        injected.frequency, on_floor.blocked_levels(), on_floor.levels(force="floor"),
        on_floor.difference(), 1e3 * injected.energy,
    )  # fmt: skip
    change = 20 * np.log10(on_floor.peak_force / impact.peak_force)
    return {
        "name": humanize(on_floor.floor.name),
        "force": curve(contact[0], 1e3 * contact[1]),
        "velocity": curve(times[shown], 1e3 * on_floor.floor_velocity[shown]),
        "numbers": [
            ["peak force relative to rigid floor", change, "dB"],
            ["restitution", on_floor.restitution, ""],
            ["maximum displacement", 1e6 * on_floor.floor_displacement.max(), "µm"],
            ["energy into the floor", 1e3 * on_floor.floor_work, "mJ"],
        ],
        "octaves": [to_json(row) for row in zip(*octaves, strict=True)],
    }


def room_answer(prediction: RoomPrediction) -> Answer:
    """Return levels in the room below, dB, the room, m, m3 and s, and ratings with uncertainty.

    Sides of a room that are not known are 0. The result is the code of the verdict on a
    requirement, or "level" without one.
    """
    room, floor = prediction.room, prediction.floor
    # Modes of a file have no sides.
    length, width = (
        getattr(room, side) or getattr(floor, side, 0.0) for side in ("length", "width")
    )
    height = prediction.volume / (length * width) if length and width else 0.0
    rating = prediction.rating
    details = (
        rating_title(prediction, rating.name), verdict_text(prediction),
        class_text(prediction.korean_class), source_note(prediction), CAVEAT,
    )  # fmt: skip
    return {
        "result": RESULTS[prediction.verdict] if prediction.verdict else "level",
        "rounded": rating.rounded,
        "uncertainty_of_rating": rating.uncertainty,
        "chance": chance(prediction),
        "detail": "; ".join(filter(None, details)),
        "frequency": to_json(prediction.frequency),
        "level": to_json(prediction.level),
        "uncertainty": to_json(prediction.uncertainty),
        "contributions": [
            [CONTRIBUTIONS[name].title, value] for name, value in rating.contributions.items()
        ],
        "size": {
            "length": length,
            "width": width,
            "height": room.height or height,
            "volume": prediction.volume,
            "reverberation_time": float(np.mean(prediction.reverberation_time)),
        },
        "ratings": [
            [rating_title(prediction, name), other.level, other.uncertainty]
            for name, other in prediction.ratings.items()
        ],
        "class": class_text(prediction.korean_class),
        "octaves": [
            [f"{frequency:g}", level]
            for frequency, level in zip(
                RATED_BANDS["octave"], prediction.octave_level.tolist(), strict=True
            )
        ],
    }
