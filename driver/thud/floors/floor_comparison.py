"""Floors and rooms side by side: what an impact does to each of them."""

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
from thud.level.rating import CLASSES

if TYPE_CHECKING:
    from collections.abc import Mapping

    from matplotlib.figure import Figure


@dataclass(frozen=True, eq=False, repr=False)
class FloorComparison(Displayed, Page):
    """Predictions for several floors and rooms, side by side.

    Attributes
    ----------
    predictions : dict of str to RoomPrediction
        The predictions, by the names of their cases.
    """

    predictions: dict[str, RoomPrediction]
    _command = "floor"

    @property
    def warnings(self) -> list[str]:
        """Caveats of the numbers, with the names of the floors."""
        result = self.predictions.items()
        return [f"{name}: {warning}" for name, one in result for warning in one.warnings]

    def rows(self) -> list[tuple[str, ...]]:
        """Return header and rows of text; columns are the floors."""
        result = self.predictions.values()
        octaves = [f"{f:g} Hz octave, dB" for f in get_bands("octave").nominal[1:]]
        return [
            ("", *self.predictions),
            ("floor", *(one.floor.name.replace("_", " ") for one in result)),
            ("force", *(one.force for one in result)),
            ("L_iA,Fmax, dB", *(str(one.rating.rounded) for one in result)),
            ("standardized, dB", *(str(one.standardized_rating.rounded) for one in result)),
            *(
                (title, *(f"{one.octave_level[i]:.1f}" for one in result))
                for i, title in enumerate(octaves)
            ),
            (
                "class (KS F 2863-2)",
                *(CLASSES[one.octave_rating.korean_class or 0] for one in result),
            ),
            ("energy, 50 to 630 Hz, mJ", *(f"{1e3 * one.energy.sum():.3g}" for one in result)),
            ("tapping machine, L_n,w (C_I), dB", *(_tapping(one) for one in result)),
        ]

    def figure(self) -> Figure:
        """Return the page as a matplotlib figure."""
        from thud.plot.pages import draw_floors

        return draw_floors(self)

    def html(self) -> str:
        """Return the page as self-contained HTML with interactive plots."""
        from thud.plot.pages import floors_html

        return floors_html(self)

    def files(self) -> dict[str, bytes]:
        """Return ``floors.svg`` and ``floors.html`` by name."""
        from thud.plot.save_figures import page_files

        return page_files("floors", self.figure, self.html())

    def __repr__(self) -> str:
        """Return the names of the floors and their levels."""
        result = (f"{name} {one.rating.rounded} dB" for name, one in self.predictions.items())
        return f"<FloorComparison: {', '.join(result)}>"


def compare_floors(
    cases: Mapping[str, Case | RoomPrediction], *, progress: bool = False
) -> FloorComparison:
    """Compare what an impact causes below several floors.

    Parameters
    ----------
    cases
        Cases with floor and room, which are solved, or predictions, by their names.
    progress
        Show a progress bar.

    Raises
    ------
    InputError
        Where there is nothing to compare, or a case has no room.
    """
    require_mapping("cases", cases, "cases or predictions")
    result: dict[str, RoomPrediction] = {}
    for name, given in tqdm(cases.items(), unit="floor", disable=not progress, leave=False):
        require_kind("name", name, str)
        require_kind(name, given, Case | RoomPrediction)
        if isinstance(given, RoomPrediction):
            result[name] = given
            continue
        if given.model is None or given.floor is None or given.room is None:
            refuse(
                f"{name}: the case has no level in a room", "a case with &model, &floor and &room"
            )
        try:
            result[name] = predict_level(compute(given))
        except ThudError as error:
            message = f"{name}: {error}"
            raise type(error)(message) from error
    return FloorComparison(result)


def _tapping(one: RoomPrediction) -> str:
    """Return the reference level of the tapping machine, of the floors that have one."""
    if not has_tapping_level(one.floor):
        return ""
    result = tapping_level(one.floor, one.room)
    return f"{result.weighted} ({result.adaptation})"
