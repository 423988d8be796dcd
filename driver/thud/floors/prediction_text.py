"""Words for predictions of the level in a room."""

from __future__ import annotations

from typing import TYPE_CHECKING

from thud.base._schema import RATINGS
from thud.level import rating

if TYPE_CHECKING:
    from thud.base._schema import RoomRating
    from thud.floors.prediction import RoomPrediction


def rating_title(prediction: RoomPrediction, name: RoomRating) -> str:
    """Return the title of a rating, with its standard if the source is the ball."""
    return RATINGS[name] if prediction.is_ball else f"A-weighted level ({name})"


def source_note(prediction: RoomPrediction) -> str:
    """Return the note that belongs beside each rating by a source that does not conform."""
    return "the source does not conform" if prediction.source_notes else ""


def class_text(prediction: RoomPrediction) -> str:
    """Return the class by KS F 2863-2; empty unless the source is a ball that conforms."""
    korean = prediction.korean_class
    return "" if korean is None else rating.class_text(korean)


def rating_text(prediction: RoomPrediction) -> str:
    """Return the rating, the probability to meet a requirement, and the note on the source."""
    words = str(prediction.requirement or prediction.rating)
    return ", ".join(filter(None, (words, source_note(prediction))))
