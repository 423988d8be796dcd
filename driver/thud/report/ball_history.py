"""History of one ball: criteria of its calibration reports by date, and their trends."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from functools import cached_property
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from scipy.special import stdtrit

from thud.base._schema import VERDICTS
from thud.base.checks import refuse
from thud.base.files import require_regular
from thud.base.immutable import Immutable
from thud.level.assessment import criterion_quantity
from thud.recordings.words import read_date
from thud.report.contents import FORMAT
from thud.report.rows import capital, number, value_text

if TYPE_CHECKING:
    import os
    from collections.abc import Iterable, Iterator, Sequence

    from numpy.typing import NDArray

    from thud.base.key import Quantity

YEAR = timedelta(days=365.25)
# Probability that a trend is reported in any criterion of a ball that does not change.
SIGNIFICANCE = 0.05
# Minimum number of reports for a trend: a line fits any two.
MIN_REPORTS = 3
# Minimum number of values for control limits, and the mean moving range of two values of a normal
# distribution in standard deviations (ISO 7870-2, chart of individuals).
MIN_VALUES, MOVING_RANGE = 5, 2 / math.sqrt(math.pi)
# Warning and action limits: distance from the mean in standard deviations.
WARNING, ACTION = 2.0, 3.0
# Maximum number of reports in the table: the first and the most recent ones.
MAX_COLUMNS = 8
# Maximum size of a report, bytes.
MAX_SIZE = 2**28
# Texts of a report, and numbers of each of its criteria, that a history needs.
TEXTS = ("ball", "serial", "source", "date", "verdict")
LIMITS = ("lower", "upper")
VALUES = ("value", "uncertainty", "expanded_uncertainty")


class Trend(NamedTuple):
    """Straight line through the values of a criterion.

    `slope` is the change per year and `expanded` its expanded uncertainty (95 %); `significant`
    holds at 5 % for all criteria together. `time` has the first and the last value, years since
    the first report, shape (2,), and `value` the line there.
    """

    slope: float
    expanded: float
    significant: bool
    time: NDArray[np.float64]
    value: NDArray[np.float64]


class ControlLimits(NamedTuple):
    """Mean and standard deviation of a criterion, by the moving range of consecutive values."""

    mean: float
    deviation: float


@dataclass(frozen=True, eq=False)
class Series(Immutable):
    """A criterion in the reports of a ball.

    Attributes
    ----------
    quantity : Quantity
        Quantity of the criterion.
    entries : tuple of dict, shape (n_report,)
        The criterion in each report, in the order of the dates.
    years, values, uncertainties : ndarray, shape (n_known,)
        Times since the first report, years, values and standard uncertainties, SI units, of the
        values that are known and no upper bounds.
    trend : Trend or None
        None with fewer than three dates, or equal values.
    control : ControlLimits or None
        None with fewer than five values.
    """

    quantity: Quantity
    entries: tuple[dict[str, Any], ...]
    years: NDArray[np.float64]
    values: NDArray[np.float64]
    uncertainties: NDArray[np.float64]
    trend: Trend | None = None
    control: ControlLimits | None = None

    @property
    def title(self) -> str:
        """Name and unit of the quantity."""
        return capital(self.quantity.label)

    @property
    def is_drifting(self) -> bool:
        """Whether the trend is significant."""
        return self.trend is not None and self.trend.significant

    @property
    def slope_text(self) -> str:
        """Change per year with its expanded uncertainty as text; a dash if there is no trend."""
        if self.trend is None:
            return "–"
        scale, decimals = self.quantity.display_scale, self.quantity.decimals + 1
        slope, expanded = scale * self.trend.slope, scale * self.trend.expanded
        sign = "+" if round(slope, decimals) > 0 else ""
        return f"{sign}{number(slope, decimals)} ± {number(expanded, decimals)}"


@dataclass(frozen=True, eq=False)
class History:
    """Reports of one ball in the order of their dates.

    Attributes
    ----------
    title : str
        Ball and serial number.
    dates : tuple of datetime, shape (n_report,)
        Dates of the measurements.
    reports : tuple of dict, shape (n_report,)
        Content of each ``report.json``.
    """

    title: str
    dates: tuple[datetime, ...]
    reports: tuple[dict[str, Any], ...]

    @property
    def years(self) -> NDArray[np.float64]:
        """Time since the first report, years, shape (n_report,)."""
        return np.array([(date - self.dates[0]) / YEAR for date in self.dates])

    def date(self, years: float) -> datetime:
        """Return the date of a time since the first report, years."""
        return self.dates[0] + years * YEAR

    @cached_property
    def series(self) -> tuple[Series, ...]:
        """The criteria, with their trends and control limits."""
        criteria = zip(*(report["criteria"] for report in self.reports), strict=True)
        known = [_known(entries, self.years) for entries in criteria]
        fitted = [len(set(s.years)) >= MIN_REPORTS and np.ptp(s.values) > 0 for s in known]
        significance = SIGNIFICANCE / max(sum(fitted), 1)
        return tuple(
            replace(
                series,
                trend=_trend(series, significance) if is_fitted else None,
                control=_control_limits(series.values),
            )
            for series, is_fitted in zip(known, fitted, strict=True)
        )

    @property
    def temperatures(self) -> list[float | None]:
        """Recorded temperature of each report, degC; None if it is not stated."""
        values = (report.get("temperature") for report in self.reports)
        return [value if _is_number(value) else None for value in values]

    @property
    def calibrations(self) -> list[datetime]:
        """Dates of the certificates of instruments, between first and last report."""
        instruments = chain.from_iterable(report.get("instruments", []) for report in self.reports)
        texts = (item.get("calibrated", "") for item in instruments if isinstance(item, dict))
        dates = {read_date(str(text)) for text in texts}
        return sorted(date for date in dates if date and self.dates[0] <= date <= self.dates[-1])

    def table(self) -> list[tuple[str, ...]]:
        """Return rows of text: values by date, and change per year."""
        count = len(self.dates)
        shown = [i for i in range(count) if i == 0 or i > count - MAX_COLUMNS]

        def row(title: str, cells: Sequence[str], trend: str = "") -> tuple[str, ...]:
            return (title, *(cells[i] for i in shown), trend)

        days = [date.date().isoformat() for date in self.dates]
        rows = [row("", days, "per year")]
        for series in self.series:
            slope = series.slope_text + " significant" * series.is_drifting
            rows.append(row(series.title, [*map(_cell, series.entries)], slope))
        rows.append(row("Temperature, °C", [*map(_degrees, self.temperatures)]))
        verdicts = [report["verdict"] for report in self.reports]
        rows.append(row("verdict", verdicts))
        return rows

    def warnings(self) -> list[str]:
        """Return a warning for each significant trend, and for values beyond control limits."""
        return [warning for series in self.series for warning in self._warnings(series)]

    def _warnings(self, series: Series) -> Iterator[str]:
        trend, limits = series.trend, series.control
        if trend is not None and trend.significant:
            known = [value for value in self.temperatures if value is not None]
            ends = dict.fromkeys(map(_degrees, (min(known), max(known)))) if known else ()
            temperature = f" (temperature {' to '.join(ends)} °C)" if ends else ""
            yield f"{series.title}: changes by {series.slope_text} per year{temperature}"
        if limits is None:
            return
        distance = (series.values - limits.mean) / limits.deviation
        beyond = series.years[np.abs(distance) > ACTION]
        dates = [self.date(year).date().isoformat() for year in beyond]
        if dates:
            yield f"{series.title}: beyond the action limits ({ACTION:g} σ) on {', '.join(dates)}"
        last = distance[-3:]
        if max((last > WARNING).sum(), (last < -WARNING).sum()) > 1:
            yield (
                f"{series.title}: two of the last three values lie beyond one warning limit "
                f"({WARNING:g} σ)"
            )


def _ball(report: dict[str, Any]) -> str:
    """Return name and serial number of the ball of a report."""
    return " ".join(filter(None, (report["ball"], report["serial"])))


def _cell(entry: dict[str, Any]) -> str:
    """Return the value of a criterion, and whether it fails or is undecided."""
    verdict = entry["verdict"]
    value, expanded = (
        math.nan if entry[key] is None else entry[key] for key in ("value", "expanded_uncertainty")
    )
    quantity = criterion_quantity(entry["name"])
    text = value_text(quantity, value, expanded, is_bound=entry["upper_bound"])
    if verdict == VERDICTS[0] or math.isnan(value):
        return text
    state = "low" if value < entry["lower"] else "high"
    return f"{text} {state if verdict == VERDICTS[1] else verdict}"


def _degrees(value: float | None) -> str:
    return "–" if value is None else number(value, 1)


def _known(entries: tuple[dict[str, Any], ...], years: NDArray[np.float64]) -> Series:
    """Return a criterion without trend and control limits."""
    rows = [
        (year, entry["value"], entry["uncertainty"] or 0.0)
        for year, entry in zip(years, entries, strict=True)
        if entry["value"] is not None and not entry["upper_bound"]
    ]
    columns = np.array(rows, dtype=np.float64).reshape(-1, 3).T
    return Series(criterion_quantity(entries[0]["name"]), entries, *columns)


def _control_limits(values: NDArray[np.float64]) -> ControlLimits | None:
    if len(values) < MIN_VALUES:
        return None
    deviation = float(np.abs(np.diff(values)).mean()) / MOVING_RANGE
    return ControlLimits(float(values.mean()), deviation) if deviation else None


def read_history(paths: Iterable[str | os.PathLike[str]]) -> History:
    """Read the reports of one ball.

    Parameters
    ----------
    paths
        Files ``report.json``, or directories that hold them at any depth.

    Raises
    ------
    InputError
        If a report cannot be read or has no date, or the balls differ.
    """
    files = list(dict.fromkeys(file for path in paths for file in _files(Path(path))))
    if not files:
        refuse("there are no reports", "one report.json or more")
    dated = sorted(((*_read(file), file) for file in files), key=lambda entry: entry[0])
    dates, reports, origins = zip(*dated, strict=True)
    identity, first = _identity(reports[0]), origins[0]
    for report, file in zip(reports, origins, strict=True):
        for key, value in _identity(report).items():
            if value != identity[key]:
                problem = f"{file}: {key} {value!r} is not that of {first}, {identity[key]!r}"
                refuse(problem, "reports of one ball")
    return History(_ball(reports[0]) or "ball", dates, reports)


def _identity(report: dict[str, Any]) -> dict[str, str]:
    """Return what all reports of a ball have in common."""
    names = ", ".join(criterion["name"] for criterion in report["criteria"])
    return {**{key: report[key] for key in ("ball", "serial", "source")}, "criteria": names}


def _files(path: Path) -> list[Path]:
    if not path.is_dir():
        return [path]
    reports = sorted(path.rglob("report.json"))
    if not reports:
        refuse(f"{path}: holds no report.json", "a directory of reports")
    return reports


def _read(path: Path) -> tuple[datetime, dict[str, Any]]:
    allowed = "report.json of thud-driver measure"
    try:
        if path.stat().st_size > MAX_SIZE:
            refuse(f"{path}: is larger than {MAX_SIZE >> 20} MiB", allowed)
        report = json.loads(require_regular(path).read_bytes())
    except (OSError, ValueError, RecursionError) as error:
        reason = error.strerror if isinstance(error, OSError) else "no JSON"
        refuse(f"{path}: cannot be read ({reason})", allowed, error)
    if not isinstance(report, dict) or report.get("format") != FORMAT or not _is_complete(report):
        refuse(f"{path}: is no calibration report of this version", allowed)
    date = read_date(report["date"].split(" to ")[0])
    if date is None:
        refuse(
            f"{path}: its date {report['date']!r} cannot be read",
            'a date of the recording or of the configuration, such as "2024-05-03"',
        )
    return date, report


def _is_complete(report: dict[str, Any]) -> bool:
    """Whether a report has all entries that a history needs, each of its type."""
    try:
        return (
            all(isinstance(report[key], str) for key in TEXTS)
            and isinstance(report.get("instruments", []), list)
            and bool(report["criteria"])
            and all(map(_is_criterion, report["criteria"]))
        )
    except (KeyError, TypeError):
        return False


def _is_criterion(entry: dict[str, Any]) -> bool:
    return (
        isinstance(entry["name"], str)
        and isinstance(entry["upper_bound"], bool)
        and entry["verdict"] in VERDICTS
        and all(_is_number(entry[key]) for key in LIMITS)
        and all(entry[key] is None or _is_number(entry[key]) for key in VALUES)
    )


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _trend(series: Series, significance: float) -> Trend:
    """Return the least-squares line, weighted by 1/uncertainty**2, with its uncertainty.

    It is the larger of two, by the stated uncertainties and by the scatter with n - 2 degrees of
    freedom: a trend must be significant by both.
    """
    time, value, uncertainty = series.years, series.values, series.uncertainties
    count = len(time)
    stated = bool((uncertainty > 0).all())
    weight = 1 / uncertainty**2 if stated else np.ones(count)
    middle, mean = (float(weight @ column / weight.sum()) for column in (time, value))
    spread = float(weight @ (time - middle) ** 2)
    slope = float(weight @ ((time - middle) * (value - mean))) / spread
    residual = value - mean - slope * (time - middle)
    scatter = math.sqrt(float(weight @ residual**2) / (count - 2))

    def factor(probability: float) -> float:
        """Return the half width of an interval relative to 1/sqrt(sum of weights)."""
        quantile = stdtrit([count - 2, np.inf], 1 - probability / 2)
        return float(max(quantile[0] * scatter, quantile[1] if stated else 0.0))

    expanded = factor(0.05) / math.sqrt(spread)
    bound = factor(significance) / math.sqrt(spread)
    # Values that are equal except for rounding have no trend.
    rounding = 1e-9 * max(float(np.abs(value).max()), 1e-300)
    significant = abs(slope) > bound and abs(slope) * float(np.ptp(time)) > rounding
    ends = np.array([time[0], time[-1]])
    return Trend(slope, expanded, significant, ends, mean + slope * (ends - middle))
