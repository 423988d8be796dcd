"""Comparison of predictions for several floors and rooms."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from tqdm import tqdm

from thud.base.checks import refuse, require_kind, require_mapping
from thud.base.display import Displayed
from thud.base.errors import ThudError
from thud.base.files import Page
from thud.case.case import Case
from thud.floors.prediction import RoomPrediction, predict_level
from thud.floors.tapping import has_tapping_level, tapping_level
from thud.impact.compute import compute
from thud.level.levels import get_bands
from thud.level.rating import CLASSES, Rating

if TYPE_CHECKING:
    from collections.abc import Mapping

    from matplotlib.figure import Figure


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
        """Warnings of the predictions, with the names of the floors."""
        return [
            f"{name}: {warning}"
            for name, prediction in self.predictions.items()
            for warning in prediction.warnings
        ]

    def rows(self) -> list[tuple[str, ...]]:
        """Return header and rows of text, with a column for each floor."""
        octaves = [f"{f:g} Hz octave, dB" for f in get_bands("octave").nominal[1:]]
        titles = (
            "", "floor", "force", "L_iA,Fmax (ISO 717-2)", "by modes, dB", "statistical, dB",
            "of octaves (KS F 2863-2), dB", "standardized (ISO 16283-2), dB",
            "required, dB", *octaves, "energy, 50 to 630 Hz, mJ",
            "tapping machine, L_n,w (C_I), dB",
        )  # fmt: skip
        columns = (_column(*item) for item in self.predictions.items())
        rows = list(zip(titles, *columns, strict=True))
        return [row for row in rows if row[0] != "required, dB" or any(row[1:])]

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
        items = self.predictions.items()
        result = (f"{name} {prediction.rated_text}" for name, prediction in items)
        return f"<FloorComparison: {', '.join(result)}>"


def compare_floors(
    cases: Mapping[str, Case | RoomPrediction], *, progress: bool = False
) -> FloorComparison:
    """Compare the levels of impacts below several floors.

    Parameters
    ----------
    cases
        Predictions, or cases with floor and room to compute, by name.
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
        require_kind("name", name, str)
        require_kind(name, entry, Case | RoomPrediction)
        if isinstance(entry, RoomPrediction):
            result[name] = entry
            continue
        if entry.model is None or entry.floor is None or entry.room is None:
            refuse(
                f"{name}: the case has no level in a room", "cases with &model, &floor and &room"
            )
        try:
            result[name] = predict_level(compute(entry))
        except ThudError as error:
            message = f"{name}: {error}"
            raise type(error)(message) from error
    return FloorComparison(result)


def _column(name: str, prediction: RoomPrediction) -> tuple[str, ...]:
    """Return the column of a floor in `FloorComparison.rows`."""
    return (
        name,
        prediction.floor.name.replace("_", " "),
        prediction.force,
        prediction.rated_text,
        str(prediction.modal_rating.rounded) if prediction.n_modal else "",
        *(_rated(prediction.ratings[name]) for name in ("thirds", "octaves", "standardized")),
        _required(prediction),
        *(f"{level:.1f}" for level in prediction.octave_level),
        f"{1e3 * prediction.energy.sum():.3g}",
        _tapping(prediction),
    )


def _rated(rating: Rating) -> str:
    """Return a rating, with its class if the standard has classes."""
    if rating.korean_class is None:
        return str(rating.rounded)
    return f"{rating.rounded}, class {CLASSES[rating.korean_class]}"


def _required(prediction: RoomPrediction) -> str:
    """Return the requirement of a room and the verdict; empty without one."""
    required = prediction.requirement
    if required is None:
        return ""
    return f"{required.required:g} ({required.rating}): {required.verdict}"


def _tapping(prediction: RoomPrediction) -> str:
    """Return the level of the tapping machine below a floor; empty if it cannot be predicted."""
    if not has_tapping_level(prediction.floor):
        return ""
    result = tapping_level(prediction.floor, prediction.room)
    return f"{result.weighted} ({result.adaptation})"
