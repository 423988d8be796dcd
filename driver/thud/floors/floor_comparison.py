"""Comparison of predictions for several floors and rooms."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from tqdm import tqdm

from thud.base._schema import RATINGS
from thud.base.checks import refuse, require_kind, require_mapping
from thud.base.display import Displayed
from thud.base.errors import ThudError
from thud.base.files import Page
from thud.base.tables import Result
from thud.case.case import Case
from thud.case.constructions import Construction, with_floor
from thud.floors.prediction import RoomPrediction, predict_level
from thud.floors.prediction_text import rating_text, rating_title, source_note
from thud.floors.tapping import has_tapping_level, tapping_level
from thud.impact.compute import compute
from thud.level.rating import rated_bands

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
        titles = (
            "", "floor", "force", "source",
            *(f"{rating_title(titled, name)}, dB (standard uncertainty)" for name in RATINGS),
            "class (KS F 2863-2)", "required, dB",
            *(f"{frequency:g} Hz octave, dB" for frequency in rated_bands("octave")),
            "energy into the bearing floor, 50 to 630 Hz, mJ", "tapping machine, L_n,w (C_I), dB",
        )  # fmt: skip
        rows = zip(titles, *(_column(*item) for item in self.predictions.items()), strict=True)
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


def _column(name: str, prediction: RoomPrediction) -> tuple[str, ...]:
    """Return the column of a floor in `FloorComparison.rows`."""
    return (
        name,
        prediction.floor.name.replace("_", " "),
        prediction.force,
        _source(prediction),
        *(f"{rating.rounded} ({rating.uncertainty:.1f})" for rating in prediction.ratings.values()),
        _class(prediction),
        _required(prediction),
        *(f"{level:.1f}" for level in prediction.octave_level),
        f"{1e3 * prediction.energy.sum():.3g}",
        _tapping(prediction),
    )


def _class(prediction: RoomPrediction) -> str:
    """Return the class in few words, as columns are as wide as their cells; empty without one."""
    korean = prediction.korean_class
    return "" if korean is None else f"class {korean}" if korean else "no class"


def _source(prediction: RoomPrediction) -> str:
    """Return the source, or what is wrong with it; empty for a ball that conforms."""
    name = "" if prediction.is_ball else str(prediction.source.limits_source)
    return ", ".join(filter(None, (name, source_note(prediction))))


def _required(prediction: RoomPrediction) -> str:
    """Return the requirement of a room and the verdict on it; empty without one."""
    required = prediction.requirement
    if required is None:
        return ""
    chance = f"{100 * required.probability:.0f} %"
    text = f"{required.limit:g} ({required.rating.name}): {required.verdict}, {chance}"
    return Result(text, required.verdict)


def _tapping(prediction: RoomPrediction) -> str:
    """Return the level of the tapping machine below a floor; a dash if it cannot be predicted."""
    if not has_tapping_level(prediction.floor, prediction.room):
        return "–"
    result = tapping_level(prediction.floor, prediction.room)
    return f"{result.weighted} ({result.adaptation})"
