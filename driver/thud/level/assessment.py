"""Assessment of a computed or measured source by the criteria of the standards."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from thud.base._schema import LIMITS, QUANTITIES, VERDICTS
from thud.base.checks import (
    refuse,
    refuse_unknown,
    refuse_value,
    require_choice,
    require_kind,
    require_number,
    require_pair,
)
from thud.base.display import Displayed, Tabulated
from thud.base.immutable import Immutable, plain
from thud.base.key import Quantity
from thud.level.estimate import NORMAL_FACTOR, NUMERICAL_ERROR, Estimate
from thud.level.levels import BANDWIDTHS, SOURCES, get_bands

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from thud.base._schema import LimitsSource
    from thud.base.display import Columns
    from thud.base.note import Note

_BISECTIONS = 40


def wilson_interval(inside: int, count: int) -> tuple[float, float]:
    """Return Wilson's score interval (95 %) of a probability, valid also if none or all conform."""
    square = NORMAL_FACTOR**2
    middle = (inside + square / 2) / (count + square)
    half = math.sqrt(inside * (count - inside) / count + square / 4) * NORMAL_FACTOR
    half /= count + square
    return max(middle - half, 0.0), min(middle + half, 1.0)


class Outcome(Immutable):
    """Base of criteria and verdicts: true if it conforms, false if it does not.

    Attributes
    ----------
    counts : tuple of int or None
        Number of drops within the limits, and of all drops, over what is not known of the source;
        None: one source.
    """

    counts: tuple[int, int] | None

    @property
    def conforms(self) -> str:
        """``"conforms"``, ``"does not conform"`` or ``"undecided"``.

        Over what is not known of a source: whether all drops conform, none does, or some do.
        """
        if self.counts is None:
            return self._of_one_source()
        inside, count = self.counts
        return VERDICTS[0] if inside == count else VERDICTS[2] if inside else VERDICTS[1]

    @abstractmethod
    def _of_one_source(self) -> str:
        """Return `conforms` of a source of which all is known."""

    def __bool__(self) -> bool:
        """Return whether it conforms; raise InputError if that is undecided."""
        if self.conforms == VERDICTS[2]:
            refuse("an undecided verdict is neither true nor false", f"conforms == {VERDICTS[0]!r}")
        return self.conforms == VERDICTS[0]

    @property
    def interval(self) -> tuple[float, float] | None:
        """Wilson's interval (95 %) of the probability that a drop conforms, if many were made."""
        return self.counts and wilson_interval(*self.counts)

    def _last_cells(self) -> tuple[str, ...]:
        """Return the cells of probability and main unknown, if many drops were made."""
        ends = dict.fromkeys(f"{100 * end:.0f}" for end in self.interval or ())
        return (f"{' to '.join(ends)} %", "") if ends else ()


@dataclass(frozen=True, eq=False, repr=False)
class Criterion(Outcome):
    """Quantity of a source and the range that the standards require.

    Attributes
    ----------
    name : str
        Name of the quantity.
    estimate : Estimate
        Value of the source with its uncertainty; levels in dB re 1 N and 1 s.
    lower, upper : float
        Limits of the range, which includes them.
    range : tuple of float or None
        Minimum and maximum over what is not known of the source; None: one source.
    counts : tuple of int or None
        Number of drops within the limits, and of all drops.
    main_unknown : str
        Unknown with the largest rank correlation to the value; empty if the value does not vary.
    """

    name: str
    estimate: Estimate
    lower: float
    upper: float
    range: tuple[float, float] | None = None
    counts: tuple[int, int] | None = None
    main_unknown: str = ""

    @property
    def value(self) -> float:
        """Value of the source."""
        return self.estimate.value

    @property
    def unit(self) -> str:
        """Unit of value and limits."""
        return self.estimate.unit

    @property
    def is_computed(self) -> bool:
        """Whether the uncertainty is a numerical error, not that of a measurement."""
        return {part.name for part in self.estimate.contributions} == {NUMERICAL_ERROR}

    @property
    def quantity(self) -> Quantity:
        """Declaration of the quantity, with title, display unit and decimals."""
        return criterion_quantity(self.name)

    @property
    def shown_limits(self) -> str:
        """Limits in the display unit."""
        scale = self.quantity.display_scale
        ends = (f"{end * scale:g}" for end in (self.lower, self.upper))
        return " to ".join(dict.fromkeys(ends))

    def _of_one_source(self) -> str:
        """Return the verdict at 95 % confidence, with a guard band of `expanded` (JCGM 106).

        An upper bound cannot conform, and an uncertainty that lacks a contribution which is not
        stated decides nothing.
        """
        return VERDICTS[2] if self.estimate.not_stated else self.conforms_if_stated

    @property
    def conforms_if_stated(self) -> str:
        """`conforms` if what is not stated contributed up to `allowance`."""
        conforms, fails, undecided = VERDICTS
        low, high = (self.value + sign * self.estimate.expanded for sign in (-1, 1))
        if high < self.lower or (low > self.upper and not self.estimate.upper_bound):
            return fails
        inside = low >= self.lower and high <= self.upper
        return conforms if inside and not self.estimate.upper_bound else undecided

    @property
    def allowance(self) -> float:
        """Largest standard uncertainty by what is not stated with which `conforms_if_stated` holds.

        Zero if that is undecided.
        """
        if self.conforms_if_stated == VERDICTS[2]:
            return 0.0
        # Half an interval is narrower than two standard uncertainties of any freedom.
        low, high, distance = 0.0, abs(self.margin), abs(self.margin)
        for _ in range(_BISECTIONS):
            middle = (low + high) / 2
            fits = self.estimate.widened(middle).expanded <= distance
            low, high = (middle, high) if fits else (low, middle)
        return low

    @property
    def margin(self) -> float:
        """Distance of the value from the nearer limit; negative outside the range."""
        return min(self.value - self.lower, self.upper - self.value)

    @property
    def probability(self) -> float:
        """Probability that the true value lies within the limits (JCGM 106, 7.2).

        Over what is not known of a source: the fraction of its drops.
        """
        if self.counts:
            return self.counts[0] / self.counts[1]
        estimate = self.estimate
        if estimate.upper_bound or estimate.not_stated:
            return math.nan
        if estimate.uncertainty == 0:
            return float(self.lower <= self.value <= self.upper)
        from scipy.special import stdtr

        limits = np.array([self.lower, self.upper])
        low, high = stdtr(estimate.freedom, (limits - self.value) / estimate.uncertainty)
        return float(high - low)

    def __repr__(self) -> str:
        """Return value, limits and result."""
        label, value, width, *_, result = self.cells()
        shown = (width if self.range else "") or value
        return f"<Criterion, {label}: {f'{shown} {result}'.strip()}, allowed {self.shown_limits}>"

    def cells(self) -> tuple[str, ...]:
        """Return the row of the criterion in `Verdict.rows`.

        The uncertainty is marked by † if it lacks a contribution that is not stated.
        """
        quantity, scale = self.quantity, self.quantity.display_scale
        first, result = (quantity.label, quantity.show(self.value)), self.conforms
        if self.range:
            digits = max(quantity.decimals - 1, 1)
            low, high = (f"{end * scale:z.{digits}f}" for end in self.range)
            width, *last = (f"{low} to {high}", self._last_cells()[0], self.main_unknown)
            if low == high:
                width, *last = ("", "", "")
            return (*first, width, self.shown_limits, *last, result)
        expanded = f"{scale * self.estimate.expanded:.2g}" if self.estimate.uncertainty else ""
        expanded = expanded.replace("nan", "unknown") + " †" * bool(self.estimate.not_stated)
        if result == VERDICTS[1]:
            result = "too low" if self.value < self.lower else "too high"
        return (*first, expanded.strip(), self.shown_limits, result)


@dataclass(frozen=True, eq=False, repr=False)
class Verdict(Outcome, Tabulated):
    """Result of an assessment.

    Attributes
    ----------
    source : str
        Source whose limits apply.
    criteria : tuple of Criterion
        Octave levels, contact time, restitution, number of peaks, mass, drop height.
    counts : tuple of int or None
        Number of drops that meet all criteria, and of all drops, over what is not known of the
        source; None: one source.
    unknowns, fixed : tuple of str
        Keys that differ among the drops, and keys of the calibrated set that the case fixes.
    notes : tuple of Note
        How the drops were made.
    """

    drawn_by: ClassVar[str] = "verdict_figure.draw_verdict"

    source: LimitsSource
    criteria: tuple[Criterion, ...]
    counts: tuple[int, int] | None = None
    unknowns: tuple[str, ...] = ()
    fixed: tuple[str, ...] = ()
    notes: tuple[Note, ...] = ()

    def _of_one_source(self) -> str:
        """Return that any criterion fails, else that any is undecided, else that all conform."""
        results = {criterion.conforms for criterion in self.criteria}
        return next(result for result in (*VERDICTS[1:], VERDICTS[0]) if result in results)

    def __repr__(self) -> str:
        """Return the result and the criteria that cause it."""
        entries = [entry for entry in self.criteria if entry.conforms != VERDICTS[0]]
        if not self.counts:
            entries = [entry for entry in entries if entry.conforms == self.conforms]
        causes = f" in {', '.join(entry.name for entry in entries)}" if entries else ""
        share = "; {} of {} drops conform".format(*self.counts) if self.counts else ""
        return f"<Verdict, {self.source}: {self.conforms}{causes}{share}>"

    def rows(self) -> list[tuple[str, ...]]:
        """Return header and rows of text."""
        width = NUMERICAL_ERROR if self.criteria[0].is_computed else "uncertainty (95 %)"
        many = ("probability (95 %)", "main unknown") if self.counts else ()
        header = ("criterion", "value", "range" if many else width, "limits", *many, "result")
        lacking = dict.fromkeys(name for c in self.criteria for name in c.estimate.not_stated)
        legend = f"† lacks {', '.join(lacking)}" if lacking else ""
        last = ("all criteria", "", legend, "", *self._last_cells())
        rows = [criterion.cells() for criterion in self.criteria]
        return [header, *rows, (*last, self.conforms)]

    def columns(self) -> Columns:
        """Return the criteria in SI units, levels in dB; the last row is that of all."""
        none = math.nan, math.nan
        rows: list[tuple[float | str, ...]] = [
            (
                c.name, c.unit, c.value, *(c.range or none), c.lower, c.upper,
                *(c.interval or none), c.main_unknown, c.conforms,
            )
            for c in self.criteria
        ]  # fmt: skip
        total = ("all", "", math.nan, *none, *none, *(self.interval or none), "", self.conforms)
        titles = {
            "criterion": "", "unit": "", "value": "g", "low": "g", "high": "g", "lower limit": "g",
            "upper limit": "g", "probability low": "g", "probability high": "g",
            "main unknown": "", "result": "",
        }  # fmt: skip
        columns = zip(titles.items(), *rows, total, strict=True)
        return {title: (values, form) for (title, form), *values in columns}


class ImpactOrRecording(Displayed):
    """Base of `Impact` and `Recording`, which have force, levels and verdict by the same names.

    Arguments are checked for it, as the packages that recordings import take 0.3 s to load.
    """

    def quantity(self, name: str) -> float:
        """Return a quantity, SI units, by its name, such as ``"contact_time"``; NaN if none."""
        return float(getattr(self, name, math.nan))


def assess_levels(  # noqa: PLR0913, PLR0917 - each is one criterion of the standards
    levels: Iterable[Estimate | float],
    contact_time: Estimate | float = math.nan,
    restitution: Estimate | float = math.nan,
    peaks: Estimate | float = math.nan,
    mass: Estimate | float = math.nan,
    drop_height: Estimate | float = math.nan,
    source: LimitsSource = SOURCES[0],
    *,
    limits: Mapping[str, tuple[float, float]] | None = None,
) -> Verdict:
    """Assess a source by the criteria of the standards, with the stated uncertainties at 95 %.

    A criterion conforms if the value and its expanded uncertainty lie within the limits, does not
    conform if they lie outside, and is undecided otherwise (guard band, JCGM 106), if value or
    uncertainty are NaN (unknown), or if a contribution is not stated. Plain numbers have no
    uncertainty.

    Parameters
    ----------
    levels : iterable of 5
        Force exposure levels of the octaves 31.5 to 500 Hz, dB.
    contact_time
        Contact time, s.
    restitution
        Coefficient of restitution.
    peaks
        Number of peaks of the force.
    mass
        Mass of the source, kg.
    drop_height
        Drop height, m.
    source
        ``"rubber_ball"`` or ``"tyre"``.
    limits
        Minimum and maximum by the name of a criterion, in place of the limits of the standards.

    Raises
    ------
    InputError
        If the source or a name in `limits` is not known, `levels` has not five entries, or a value
        is not a number, or not a whole one for `peaks`.
    """
    # Arrays of other libraries yield scalars of their own.
    is_array = hasattr(levels, "__array__")
    require_kind("levels", levels, Iterable)
    octaves = [*(plain(np.atleast_1d(np.asarray(levels))) if is_array else levels)]
    nominal = get_bands(BANDWIDTHS[0]).nominal
    if len(octaves) != len(nominal):
        allowed = f"{len(nominal)}, the octaves {nominal[0]:g} to {nominal[-1]:g} Hz"
        refuse(f"levels: {len(octaves)} values", allowed)
    values = (*octaves, contact_time, restitution, peaks, mass, drop_height)
    require_choice("source", source, SOURCES)
    limits, criteria = limits or {}, []
    require_kind("limits", limits, Mapping)
    refuse_unknown("limits", limits, [name for name, *_ in LIMITS[source]])
    for (name, unit, *standard), value in zip(LIMITS[source], values, strict=True):
        if not isinstance(value, Estimate):
            is_unknown = isinstance(value, float | np.floating) and math.isnan(value)
            value = Estimate(math.nan if is_unknown else require_number(name, value))  # noqa: PLW2901
            if name == "peak_count" and not (is_unknown or 0 <= value.value == round(value.value)):
                refuse_value("peaks", value.value, "whole numbers, 0 or more, or NaN")
        lower, upper = require_pair(f"limits: {name}", limits.get(name, standard))
        criteria.append(Criterion(name, replace(value, unit=unit), lower, upper))
    return Verdict(source, tuple(criteria))


def criterion_quantity(name: str) -> Quantity:
    """Return the declaration of the quantity of a criterion: an octave level, or of the table."""
    band = name.removeprefix("octave_").replace("_", ".")
    return QUANTITIES.get(name, Quantity(name, f"{band} Hz", "", "dB", "dB", 1.0, 2, ""))


def octave_limits(source: LimitsSource) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the minimum and maximum conforming octave levels of a source, dB, shape (5,)."""
    lower, upper = np.array([limits for _, unit, *limits in LIMITS[source] if unit == "dB"]).T
    return lower, upper
