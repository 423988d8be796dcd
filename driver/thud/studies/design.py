"""Balls that conform to the standards, or floors that meet a rating, over one or two parameters."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Unpack

from thud.base._schema import CLASS_LIMITS, RATINGS, Room
from thud.base.checks import refuse
from thud.case.case import Case
from thud.case.keys import value_in
from thud.level.rating import excess_level
from thud.studies.parameter import NUMERIC_KINDS
from thud.studies.run import compute
from thud.studies.study_result import SampleResult

if TYPE_CHECKING:
    import os

    import xarray as xr

    from thud.studies.run import RunOptions
    from thud.studies.study import Source, Study

MAX_AXES = 2


@dataclass(frozen=True, eq=False, repr=False)
class Design(SampleResult):
    """Margin and verdict, or the rating of a room, as functions of one or two parameters.

    Attributes
    ----------
    dataset : Dataset
        Every sample, on a grid of the parameters in ascending order. ``margin`` is the smallest
        signed distance of the octave levels from their limits, dB, negative outside; ``conforms``
        is the verdict by all criteria. If the case has a room, the figure shows `room_rating`
        instead.
    """

    drawn_by: ClassVar[str] = "study_figures.draw_design"

    kind: ClassVar[str] = "design"

    dataset: xr.Dataset

    def __post_init__(self) -> None:
        """Sort the samples by their parameters."""
        object.__setattr__(self, "dataset", self.dataset.sortby(list(self.axes)))

    @classmethod
    def check(cls, study: Study) -> None:
        """Raise InputError for a study of other than one or two numeric parameters."""
        are_axes = [
            parameter.key.kind in NUMERIC_KINDS
            and (parameter.values is None or len(set(parameter.values)) > 1)
            for parameter in study.parameters
        ]
        if len(are_axes) > MAX_AXES or not all(are_axes):
            allowed = "one or two numeric parameters of two or more values"
            refuse("[parameters] do not make a map", allowed)

    @property
    def axes(self) -> tuple[str, ...]:
        """The parameters, one or two."""
        return tuple(self.dataset.attrs["parameters"].split())

    @property
    def case(self) -> Case:
        """The case of the study."""
        return Case.from_text(self.dataset.attrs["case"])

    @property
    def mark(self) -> tuple[float, ...] | None:
        """Position of the case; None outside the map, and for density or temperature."""
        axes = [self.dataset[name] for name in self.axes]
        values = [value_in(self.case, axis.attrs["key"]) for axis in axes]
        position = tuple(float(value) for value in values if value is not None)
        if len(position) < len(axes):
            return None
        inside = (a.min() <= x <= a.max() for a, x in zip(axes, position, strict=True))
        return position if all(inside) else None

    @property
    def room(self) -> Room:
        """The room, whose `rating` must not exceed its `required`, dB, rounded; 0: not stated."""
        return self.case.room or Room()

    def __repr__(self) -> str:
        """Return the axes, and how many samples conform."""
        conforms = self.dataset["conforms"]
        count = f"{int(conforms.sum())} of {conforms.size} samples conform"
        return f"<Design, {' and '.join(self.axes)}: {count}>"

    @property
    def room_rating(self) -> xr.DataArray | None:
        """The rating that the room states, of the levels in it, dB; None without a room."""
        return self.dataset.get("room_rating")

    def rows(self) -> list[tuple[str, ...]]:
        """Return header and rows of text: how many samples conform, and the best sample."""
        margin = self.dataset["margin"]
        rows: list[tuple[str, ...]] = [("quantity", "value"), ("samples", f"{margin.size}")]
        room_rating = self.room_rating
        if room_rating is not None:
            return rows + self._room_rows(room_rating)
        rows.append(("octave levels conform", f"{int((margin >= 0).sum())}"))
        rows.append(("all criteria conform", f"{int(self.dataset['conforms'].sum())}"))
        if "undecided" in self.dataset:
            rows.append(
                ("undecided because of the surrogate", f"{int(self.dataset['undecided'].sum())}")
            )
        if margin.notnull().any():
            rows += self._place("largest margin, dB", margin, margin.argmax(...))
        return rows

    def _room_rows(self, room_rating: xr.DataArray) -> list[tuple[str, ...]]:
        """Return rows on the rating of the room: classes, requirement, and the best samples."""
        size = room_rating.size
        rows: list[tuple[str, ...]] = [
            ("samples whose source conforms", f"{int(self.dataset['conforms'].sum())}"),
            ("rating", RATINGS[self.room.rating]),
        ]
        if self.room.rating == "octaves":
            count = int((room_rating < excess_level(CLASS_LIMITS[-1])).sum())
            rows.append((f"class {len(CLASS_LIMITS)} or better (KS F 2863-2)", str(count)))
        met = room_rating < excess_level(self.room.required)
        if self.room.required:
            rows.append(
                (f"rating at most {self.room.required:g} dB", f"{int(met.sum())} of {size}")
            )
            if met.any():
                best = room_rating.where(met).stack(sample=self.axes).dropna("sample")
                smallest = best.isel(sample=best[self.axes[0]].argmin("sample"))
                rows.append((f"smallest {self.axes[0]} with it", ""))
                rows += self._coordinates(smallest)
        if room_rating.notnull().any():
            rows += self._place("lowest rating, dB", room_rating, room_rating.argmin(...))
        return rows

    def _place(self, title: str, quantity: xr.DataArray, index: Any) -> list[tuple[str, ...]]:  # noqa: ANN401
        """Return the rows of the value at an index, and of its parameters."""
        best = quantity.isel(index)
        return [(title, f"{float(best):z.2f}"), *self._coordinates(best)]

    def _coordinates(self, best: xr.DataArray) -> list[tuple[str, ...]]:
        """Return the rows of the parameters of a sample."""
        rows: list[tuple[str, ...]] = []
        for name in self.axes:
            attributes = self.dataset[name].attrs
            value = float(best[name]) * 10.0 ** attributes["shown_exponent"]
            rows.append((f"  at {name}, {attributes['shown_unit']}", f"{value:.4g}"))
        return rows


def design(
    study: Source, output: str | os.PathLike[str] | None = None, **options: Unpack[RunOptions]
) -> Design:
    """Compute which balls conform to the standards, or which floors meet a rating.

    The study has one or two numeric parameters with two values or more; arguments and errors are
    those of `sweep`.
    """
    return compute(Design, study, output, **options)
