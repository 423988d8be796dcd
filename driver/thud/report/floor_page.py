"""The page of a predicted floor: two sheets of A4, in one HTML file with its figures."""

from __future__ import annotations

from itertools import zip_longest
from typing import TYPE_CHECKING

import numpy as np

from thud.base.bridge import version
from thud.case.keys import humanize
from thud.floors.description import CAVEAT, rating_title, remedy, source_note, verdict_text
from thud.floors.resonances import floor_frequencies, resonances, room_frequencies
from thud.level.rating import class_text
from thud.plot.templates import render
from thud.report.predicted_floor import band_rows, difference_text, number_text, octave_titles

if TYPE_CHECKING:
    from thud.floors.prediction import RoomPrediction
    from thud.report.predicted_floor import PredictedFloor


def floor_page(floor: PredictedFloor, section: bytes, figure: bytes) -> str:
    """Return the page as self-contained HTML, with the section and the levels as SVG."""
    prediction = floor.prediction
    octave_levels = (number_text(level, ".1f") for level in prediction.octave_level)
    errors = getattr(prediction.source, "level_error", np.array(np.nan))
    return render(
        "report/floor.html",
        title=f"Predicted impact sound: {floor.name}",
        version=version(),
        floor=floor,
        prediction=prediction,
        warnings=[str(note) for note in prediction.notes],
        box=_box(floor),
        section=section,
        figure=figure,
        about=_about(floor),
        ratings=[("Rating", "Value"), *((name, text) for name, _, _, text in floor.ratings)],
        contributions=[
            ("Contribution", "dB"),
            *((name, f"{value:.1f}") for name, value in floor.contributions.items()),
        ],
        remedy=remedy(prediction),
        changes=[
            ("Change", "dB"),
            *((change.text, difference_text(change)) for change in floor.changes),
        ],
        bands=band_rows(floor),
        octaves=[("Maximum Fast levels, octaves", *octave_titles()), ("", *octave_levels)],
        modes=_mode_rows(prediction),
        resonances="; ".join(
            f"{name} {number_text(f)} Hz" for name, f in resonances(prediction).items()
        ),
        error=errors.max() if np.isfinite(errors).all() else None,
    )


def _box(floor: PredictedFloor) -> list[str]:
    """Return the lines below the rating."""
    prediction = floor.prediction
    name = prediction.room.rating
    lines = [
        verdict_text(prediction),
        f"{rating_title(prediction, name)} in the room below, 50 to 630 Hz",
        class_text(prediction.korean_class) * (name == "octaves"),
        source_note(prediction).capitalize(),
        CAVEAT.capitalize(),
    ]
    return [*filter(None, lines)]


def _mode_rows(prediction: RoomPrediction) -> list[tuple[str, ...]]:
    """Return the lowest natural frequencies of floor and room, Hz."""
    room = room_frequencies(prediction)
    rows = {
        "Floor": [f"{frequency:.1f}" for frequency in floor_frequencies(prediction)],
        "Room": [f"{frequency:.1f}" for frequency in room.values()],
        "Half wavelengths along length, width, height": [", ".join(map(str, o)) for o in room],
    }
    columns = [*zip_longest(*rows.values(), fillvalue="–")]
    cells = zip(rows, *columns, strict=True)
    return [("", *(str(i) for i in range(1, len(columns) + 1))), *cells]


def _about(floor: PredictedFloor) -> dict[str, str]:
    """Return room and source."""
    prediction = floor.prediction
    sides = " × ".join(f"{side:.3g}" for side in prediction.size)  # noqa: RUF001
    times = np.unique(np.round(prediction.reverberation_time, 2))
    time = " to ".join(f"{value:g}" for value in dict.fromkeys((times[0], times[-1])))
    source, room = prediction.source, prediction.room
    case = source.case
    kind = humanize(source.limits_source or "source that is not stated")
    # A recording has no case of its own, only the velocity.
    drop = f" dropped from {case.drop.height:.3g} m" if case.model else ""
    model = humanize(case.model.name) if case.model else "recording or measured modes"
    where = "the mobile floor" if prediction.force == "contact" else "a rigid floor"
    speed = f"{source.impact_velocity:.3g} m/s"
    levels = (
        "do not conform: see warnings" if prediction.source_notes else "conform to the standards"
    )
    walls = f"A-weighted energy: {floor.path_shares}" if room.wall_lengths else "none described"
    pairs = {
        "Room": f"{sides} m, {number_text(prediction.volume)} m³",
        "Reverberation": f"T = {time} s, of the {humanize(room.reverberation_of)} room",
        "Flanking walls": walls,
        "Ceiling": _ceiling(prediction),
        "Source": f"{source.mass:.3g} kg{drop}, {speed}; limits of the {kind}",
        "Source levels": levels,
        "Source model": f"{model}; force on {where}",
    }
    if floor.construction and floor.construction.note:
        pairs["Note"] = floor.construction.note
    return pairs


def _ceiling(prediction: RoomPrediction) -> str:
    """Return the mass of the ceiling of floor or room."""
    floor, room = prediction.floor, prediction.room
    hung = getattr(floor, "subceiling_thickness", 0.0) * getattr(floor, "subceiling_density", 0.0)
    mass = hung or room.ceiling_mass
    return f"{mass:g} kg/m²" if mass else "none described"
