"""Comparison of predictions for several floors and rooms."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from tqdm import tqdm

from thud.base._schema import RATED_BANDS
from thud.base.checks import refuse, require_kind, require_mapping
from thud.base.display import Displayed
from thud.base.errors import ThudError
from thud.base.files import Page
from thud.base.tables import Result
from thud.case.case import Case
from thud.case.constructions import Construction, with_floor
from thud.floors.prediction import (
    RoomPrediction,
    predict_level,
    rating_text,
    rating_title,
    source_note,
)
from thud.floors.tapping import has_tapping_level, tapping_level
from thud.impact.compute import compute

if TYPE_CHECKING:
    from collections.abc import Mapping

    from matplotlib.figure import Figure

# Rows of the table that may be empty.
_OPTIONAL = ("source", "class (KS F 2863-2)", "required, dB")


@dataclass(frozen=True, eq=False, repr=False)
class FloorComparison(Displayed, Page):
    """Predictions for several floors and rooms, in columns of a table.

    Attributes
    ----------
    predictions : dict of str to RoomPrediction
        The predictions by name.
    """

    predictions: dict[str, RoomPrediction]
    _command = "floor"

    @property
    def warnings(self) -> list[str]:
        """Warnings of the predictions, each once, with the names of its floors."""
        floors: dict[str, list[str]] = {}
        for name, prediction in self.predictions.items():
            for warning in prediction.warnings:
                floors.setdefault(warning, []).append(name)
        return [f"{', '.join(names)}: {warning}" for warning, names in floors.items()]

    def rows(self) -> list[tuple[str, ...]]:
        """Return header and rows of text, with a column for each floor."""
        # The standards of the ratings are for the ball.
        titled = min(self.predictions.values(), key=lambda prediction: prediction.is_ball)
        columns = [_column(*item, titled) for item in self.predictions.items()]
        rows = [(title, *(column[title] for column in columns)) for title in columns[0]]
        # Rows that say something of a floor.
        return [row for row in rows if row[0] not in _OPTIONAL or any(row[1:])]

    def figure(self) -> Figure:
        """Return ratings, levels and what they follow from as a matplotlib figure."""
        from thud.plot.pages import draw_floors

        return draw_floors(self)

    def html(self) -> str:
        """Return a page with interactive plots and the table as self-contained HTML."""
        from thud.plot.pages import floors_html

        return floors_html(self)

    def files(self) -> dict[str, bytes]:
        """Return ``floors.svg`` and ``floors.html`` by name."""
        from thud.plot.save_figures import page_files

        return page_files("floors", self.figure, self.html())

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
        By name: predictions, cases with floor and room, constructions or names of constructions.
    progress
        Show a progress bar.

    Raises
    ------
    InputError
        If there are no cases, or a case has no model, floor or room.
    """
    require_mapping("cases", cases, "cases or predictions")
    result: dict[str, RoomPrediction] = {}
    for name, entry in tqdm(cases.items(), unit="floor", disable=not progress, leave=False):
        require_kind(name, entry, Case | RoomPrediction | Construction | str)
        if isinstance(entry, RoomPrediction):
            result[name] = entry
            continue
        case = entry if isinstance(entry, Case) else with_floor(Case(), entry)
        missing = [group for group in ("model", "floor", "room") if getattr(case, group) is None]
        if missing:
            refuse(
                f"{name}: the case has no {' and no '.join(f'&{group}' for group in missing)}",
                "cases with &floor and &room"
                + ", and with &model beside &modes" * ("model" in missing),
            )
        try:
            result[name] = predict_level(compute(case))
        except ThudError as error:
            raise error.within(name) from error
    return FloorComparison(result)


def _column(name: str, prediction: RoomPrediction, titled: RoomPrediction) -> dict[str, str]:
    """Return the column of a floor by the titles of rows, those of ratings as of `titled`."""
    korean, required = prediction.korean_class, prediction.requirement
    source = "" if prediction.is_ball else str(prediction.source.limits_source)
    floor, tapping = prediction.floor, "–"
    if has_tapping_level(floor, prediction.room):
        level = tapping_level(floor, prediction.room)
        tapping = f"{level.weighted} ({level.adaptation})"
    return {
        "": name,
        "floor": floor.name.replace("_", " "),
        "force": prediction.force,
        "source": ", ".join(filter(None, (source, source_note(prediction)))),
        **{
            f"{rating_title(titled, key)}, dB (standard uncertainty)": (
                f"{rating.rounded} ({rating.uncertainty:.1f})"
            )
            for key, rating in prediction.ratings.items()
        },
        "class (KS F 2863-2)": (
            "" if korean is None else f"class {korean}" if korean else "no class"
        ),
        "required, dB": Result(
            f"{required.limit:g} ({required.rating.name}): {required.verdict}, "
            f"{100 * required.probability:.0f} %",
            required.verdict,
        )
        if required
        else "",
        **{
            f"{frequency:g} Hz octave, dB": f"{level:.1f}"
            for frequency, level in zip(RATED_BANDS["octave"], prediction.octave_level, strict=True)
        },
        "energy into the bearing floor, 50 to 630 Hz, mJ": f"{1e3 * prediction.energy.sum():.3g}",
        "tapping machine, L_n,w (C_I), dB": tapping,
    }
