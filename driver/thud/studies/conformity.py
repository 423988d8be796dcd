"""Which balls conform: the margin to the standards over two parameters."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Unpack

from thud.case import Case
from thud.errors import InputError
from thud.keys import DENSITY
from thud.studies.dataset import coordinate
from thud.studies.parameters import Parameter, Uniform
from thud.studies.run import sweep
from thud.studies.sets import wall_volume
from thud.studies.study import Study, read_study, value_in

if TYPE_CHECKING:
    import os

    import xarray as xr

    from thud.studies.run import How
    from thud.studies.study import Source

_AXES = 2


@dataclass(frozen=True, eq=False)
class DesignMap:
    """Margin and verdict over two parameters.

    Attributes
    ----------
    dataset : Dataset
        Every set, on a grid of the two parameters in ascending order; ``margin`` is the least
        distance of an octave level to its limits, dB, and ``conforms`` the whole verdict.
    axes : tuple of str
        The two parameters.
    mark : tuple of float or None
        Where the ball of the paper, or else the base case, lies; None where it has no such place.
    mark_name : str
        Which of both it is.
    """

    dataset: xr.Dataset
    axes: tuple[str, str]
    mark: tuple[float, float] | None
    mark_name: str

    def table(self) -> list[tuple[str, ...]]:
        """Return header and rows of text: the best place, and how much conforms."""
        margin = self.dataset["margin"]
        rows: list[tuple[str, ...]] = [("sets", f"{margin.size}")]
        rows.append(("octave levels conform", f"{int((margin >= 0).sum())}"))
        rows.append(("all criteria conform", f"{int(self.dataset['conforms'].sum())}"))
        if margin.notnull().any():
            best = margin.isel(margin.argmax(...))
            rows.append(("largest margin, dB", f"{float(best):.2f}"))
            for name in self.axes:
                power = self.dataset[name].attrs["shown_power"]
                unit = self.dataset[name].attrs["shown_unit"]
                rows.append((f"  at {name}, {unit}", f"{float(best[name]) * 10.0**power:.4g}"))
        return rows


def design_map(
    study: Source, output: str | os.PathLike[str] | None = None, **how: Unpack[How]
) -> DesignMap:
    """Compute which geometry and material conform to the standards.

    Parameters
    ----------
    study
        Path of a TOML file, or what would stand in it; it has two numeric parameters.
    output, **how
        See `sweep`.

    Returns
    -------
    DesignMap
        Margin and verdict of the force that the base case judges.

    Raises
    ------
    InputError
        As `sweep`; also where there are not two numeric parameters with two values or more.
    """
    plan = read_study(study, "design")
    if len(plan.parameters) != _AXES or not all(map(_is_axis, plan.parameters)):
        message = "[parameters] are no map; allowed: two numeric ones of two values or more"
        raise InputError(message)
    first, second = map(coordinate, plan.parameters)
    dataset = sweep(plan, output, **how).load().sortby([first, second])
    return DesignMap(dataset, (first, second), *_mark(plan))


def _is_axis(parameter: Parameter) -> bool:
    """Return whether a parameter has two numbers or more."""
    spread = parameter.spread
    # Very many values between two ends are not made for this.
    return parameter.numeric and (isinstance(spread, Uniform) or len(set(spread.grid())) > 1)


def _mark(plan: Study) -> tuple[tuple[float, float] | None, str]:
    """Return where the ball of the paper lies if the rest is as in the paper, or the base case."""
    names = [parameter.name for parameter in plan.parameters]
    paper, base = _ball_and_drop(Case(), None), _ball_and_drop(plan.base, plan.density)
    by_density = plan.density is not None or DENSITY.name in names
    rest = set(paper) - set(names) - {"mass" if by_density else DENSITY.name}
    of_paper = set(names) <= set(paper) and all(math.isclose(base[n], paper[n]) for n in rest)
    values = paper if of_paper else base
    places: list[Any] = [values.get(name, value_in(plan.base, name)) for name in names]
    ends = [(min(grid), max(grid)) for grid in (p.spread.grid() for p in plan.parameters)]
    inside = all(
        place is not None and low <= float(place) <= high
        for place, (low, high) in zip(places, ends, strict=True)
    )
    x, y = places
    return (float(x), float(y)) if inside else None, "paper's ball" if of_paper else "base case"


def _ball_and_drop(case: Case, density: float | None) -> dict[str, float]:
    """Return the numbers of ball and drop, the density of the wall among them."""
    ball = case.ball
    volume = wall_volume(ball.outer_radius, ball.wall_thickness)
    if density is None:
        density = ball.mass / volume if volume else math.nan
    return vars(ball) | vars(case.drop) | {DENSITY.name: density}
