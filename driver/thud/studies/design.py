"""Balls that conform to the standards, or floors that meet a rating, over one or two parameters."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Unpack

from thud.base._schema import CLASS_LIMITS, RATINGS, Room
from thud.base.checks import refuse
from thud.case.case import Case
from thud.case.keys import DENSITY, value_in
from thud.level.rating import excess_level
from thud.studies.sample_kind import SampleKind
from thud.studies.study import wall_volume
from thud.studies.study_result import SampleResult

if TYPE_CHECKING:
    import os
    from collections.abc import Mapping
    from pathlib import Path

    import xarray as xr
    from matplotlib.figure import Figure

    from thud.base._schema import RoomRating
    from thud.studies.kind import RunOptions
    from thud.studies.parameter import Parameter
    from thud.studies.samples import SampleStudy
    from thud.studies.study import Source, Study

MAX_AXES = 2


@dataclass(frozen=True, eq=False)
class Design(SampleResult):
    """Margin and verdict, or the rating of a room, as functions of one or two parameters.

    Attributes
    ----------
    dataset : Dataset
        Every sample, on a grid of the parameters in ascending order. ``margin`` is the smallest
        signed distance of the octave levels from their limits, dB, negative outside; ``conforms``
        is the verdict by all criteria. If the case has a room, the figure shows `room_rating`
        instead.
    axes : tuple of str
        The parameters, one or two.
    mark : tuple of float or None
        Position of the ball of `mark_name`; None if it is outside the map.
    mark_name : str
        ``"standard ball"`` or ``"case"``.
    rating_name : str
        Rating of the room that `required` refers to: ``"octaves"``, ``"thirds"`` or
        ``"standardized"``.
    required : float
        Highest rating, rounded, that is allowed, dB; 0 if none is stated.
    """

    dataset: xr.Dataset
    axes: tuple[str, ...]
    mark: tuple[float, ...] | None
    mark_name: str
    rating_name: RoomRating = "thirds"
    required: float = 0.0

    def __repr__(self) -> str:
        """Return the axes, and how many samples conform."""
        conforms = self.dataset["conforms"]
        count = f"{int(conforms.sum())} of {conforms.size} samples conform"
        return f"<Design, {' and '.join(self.axes)}: {count}>"

    @property
    def room_rating(self) -> xr.DataArray | None:
        """The rating `rating_name` of the levels in the room, dB; None without a room."""
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
            ("rating", RATINGS[self.rating_name]),
        ]
        if self.rating_name == "octaves":
            count = int((room_rating < excess_level(CLASS_LIMITS[-1])).sum())
            rows.append((f"class {len(CLASS_LIMITS)} or better (KS F 2863-2)", str(count)))
        met = room_rating < excess_level(self.required)
        if self.required:
            rows.append((f"rating at most {self.required:g} dB", f"{int(met.sum())} of {size}"))
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

    def plot(self) -> Figure:
        """Return the map as a figure."""
        from thud.plot import draw_design

        return draw_design(self)


class DesignKind(SampleKind[Design]):
    """Design maps as a kind of study."""

    name = "design"
    designs = ("grid",)

    def complete(self, study: Study, content: Mapping[str, Any], folder: Path) -> SampleStudy:
        """Return a study of one or two numeric parameters."""
        result = super().complete(study, content, folder)
        if len(result.parameters) > MAX_AXES or not all(map(_is_axis, result.parameters)):
            refuse(
                "[parameters] do not make a map",
                "one or two numeric parameters of two or more values",
            )
        return result

    def new_result(self, study: SampleStudy, dataset: xr.Dataset) -> Design:
        """Return the map of all samples."""
        axes = tuple(parameter.coordinate_name for parameter in study.parameters)
        room = study.case.room or Room()
        return Design(
            dataset.load().sortby(list(axes)), axes, *_mark(study),
            rating_name=room.rating, required=room.required,
        )  # fmt: skip


KIND = DesignKind()


def design(
    study: Source, output: str | os.PathLike[str] | None = None, **options: Unpack[RunOptions]
) -> Design:
    """Compute which balls conform to the standards, or which floors meet a rating.

    The study has one or two numeric parameters with two values or more; arguments and errors are
    those of `sweep`.
    """
    return KIND.run(study, output, **options)


def _is_axis(parameter: Parameter) -> bool:
    return parameter.numeric and (parameter.values is None or len(set(parameter.values)) > 1)


def _mark(study: SampleStudy) -> tuple[tuple[float, ...] | None, str]:
    """Return the mark: the standard ball if all other keys have its values, else the case."""
    names = [parameter.name for parameter in study.parameters]
    standard = _ball_and_drop(Case(model=study.case.model), None)
    ours = _ball_and_drop(study.case, study.density)
    mass_follows_density = study.density is not None or DENSITY.name in names
    ignored = "mass" if mass_follows_density else DENSITY.name
    compared = set(standard) - set(names) - {ignored}
    is_standard = set(names) <= set(standard) and all(
        math.isclose(ours[n], standard[n]) for n in compared
    )
    values = standard if is_standard else ours
    positions: list[Any] = [values.get(name, value_in(study.case, name)) for name in names]
    ends = [(min(grid), max(grid)) for grid in (p.grid() for p in study.parameters)]
    inside = all(
        position is not None and low <= float(position) <= high
        for position, (low, high) in zip(positions, ends, strict=True)
    )
    mark = tuple(map(float, positions)) if inside else None
    return mark, "standard ball" if is_standard else "case"


def _ball_and_drop(case: Case, density: float | None) -> dict[str, float]:
    """Return the parameters of ball and drop, and the density of the wall, by name."""
    ball = case.resolved().ball
    volume = wall_volume(ball.outer_radius, ball.wall_thickness)
    if density is None:
        density = ball.mass / volume if volume else math.nan
    return vars(ball) | vars(case.drop) | {DENSITY.name: density}
