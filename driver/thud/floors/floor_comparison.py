"""Comparison of predictions for several floors and rooms."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from tqdm import tqdm

from thud.base._schema import RATED_BANDS, RATINGS
from thud.base.checks import require_kind, require_mapping
from thud.base.display import Tabulated, column_rows
from thud.base.errors import ThudError
from thud.base.files import Results
from thud.case.case import Case
from thud.case.constructions import Construction, with_floor
from thud.floors.description import rating_text, rating_title, source_note
from thud.floors.prediction import RoomPrediction, predict_level
from thud.floors.tapping import has_tapping_level, tapping_level
from thud.impact.compute import compute
from thud.level.rating import class_text

if TYPE_CHECKING:
    import os
    from collections.abc import Iterable, Mapping

    from thud.base.display import Columns
    from thud.base.note import Note


@dataclass(frozen=True, eq=False, repr=False)
class FloorComparison(Tabulated):
    """Predictions for several floors and rooms, in columns of a table.

    Attributes
    ----------
    predictions : dict of str to RoomPrediction
        The predictions by name.
    """

    drawn_by: ClassVar[str] = "pages.draw_floors"

    predictions: dict[str, RoomPrediction]

    @property
    def notes(self) -> tuple[Note, ...]:
        """Warnings of the predictions, each once; their subjects are the names of its floors."""
        floors: dict[Note, list[str]] = {}
        for name, prediction in self.predictions.items():
            for note in prediction.notes:
                floors.setdefault(note, []).append(name)
        return tuple(replace(note, subject=", ".join(names)) for note, names in floors.items())

    def columns(self) -> Columns:
        """Return the ratings and what they follow from; a row for each floor."""
        predictions = [*self.predictions.values()]
        # The standards of the ratings are for the ball.
        titled = min(predictions, key=lambda prediction: prediction.is_ball)
        ratings: dict[str, tuple[Iterable[Any], str]] = {}
        for key in RATINGS:
            rated = [prediction.ratings[key] for prediction in predictions]
            ratings |= {
                f"{rating_title(titled, key)}, dB": ([rating.rounded for rating in rated], "d"),
                f"standard uncertainty of {key}, dB": ([r.uncertainty for r in rated], ".1f"),
            }
        octaves = np.transpose([prediction.octave_level for prediction in predictions])
        tapping = [
            tapping_level(p.floor, p.room) if has_tapping_level(p.floor, p.room) else None
            for p in predictions
        ]
        required = [p.room.required for p in predictions]
        return {
            "name": ([*self.predictions], ""),
            "floor": ([p.floor.name.replace("_", " ") for p in predictions], ""),
            "force": ([p.force for p in predictions], ""),
            "source": ([_source(p) for p in predictions], ""),
            **ratings,
            "class (KS F 2863-2)": ([class_text(p.korean_class) for p in predictions], ""),
            "required, dB": ([limit or np.nan for limit in required], "g"),
            "required rating": ([p.room.rating if p.verdict else "" for p in predictions], ""),
            "verdict": ([p.verdict for p in predictions], ""),
            "probability, %": ([100 * p.probability for p in predictions], ".0f"),
            **{
                f"{frequency:g} Hz octave, dB": (levels, ".1f")
                for frequency, levels in zip(RATED_BANDS["octave"], octaves, strict=True)
            },
            "energy into the floor from 50 to 630 Hz, mJ": (
                [1e3 * p.energy.sum() for p in predictions],
                ".3g",
            ),
            "tapping machine L_n,w, dB": ([t.weighted if t else np.nan for t in tapping], ".0f"),
            "tapping machine C_I, dB": ([t.adaptation if t else np.nan for t in tapping], ".0f"),
        }

    def rows(self) -> list[tuple[str, ...]]:
        """Return header and rows of text, with a column for each floor, without empty rows."""
        return [row for row in zip(*column_rows(self.columns()), strict=True) if any(row[1:])]

    def save(self, path: str | os.PathLike[str], *, replace: bool = False) -> None:
        """Write `files` into a directory of their own, which is replaced as a whole.

        Results of something else are replaced only if `replace` is true. Raise InputError if the
        directory holds any other file, and OSError if a file cannot be written.
        """
        Results(Path(path), "floor", replace=replace).write(self.files())

    def files(self) -> dict[str, bytes]:
        """Return ``floors.svg`` and ``floors.html`` by name."""
        from thud.plot.pages import floors_html
        from thud.plot.save_figures import page_files

        return page_files("floors", self.plot, floors_html(self))

    def __repr__(self) -> str:
        """Return the names of the floors and their levels."""
        floors = (f"{name} {rating_text(entry)}" for name, entry in self.predictions.items())
        return f"<FloorComparison: {', '.join(floors)}>"


def compare_floors(
    cases: Mapping[str, Case | RoomPrediction | Construction | str], *, progress: bool = False
) -> FloorComparison:
    """Compare the levels of impacts below several floors.

    Parameters
    ----------
    cases
        By name: predictions, cases with a floor, constructions or names of constructions. A case
        without a room has that of `predict_level`.
    progress
        Show a progress bar.

    Raises
    ------
    InputError
        If there are no cases, or a case has no model or floor.
    """
    require_mapping("cases", cases, "cases or predictions")
    result: dict[str, RoomPrediction] = {}
    for name, entry in tqdm(cases.items(), unit="floor", disable=not progress, leave=False):
        require_kind(name, entry, Case | RoomPrediction | Construction | str)
        if isinstance(entry, RoomPrediction):
            result[name] = entry
            continue
        case = entry if isinstance(entry, Case) else with_floor(Case(), entry)
        try:
            result[name] = predict_level(compute(case))
        except ThudError as error:
            raise error.within(name) from error
    return FloorComparison(result)


def _source(prediction: RoomPrediction) -> str:
    """Return a source other than the ball, and that it does not conform."""
    name = "" if prediction.is_ball else str(prediction.source.limits_source)
    return ", ".join(filter(None, (name, source_note(prediction))))
