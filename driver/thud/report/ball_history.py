"""History of one ball: criteria of its calibration reports by date, and their trends."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from datetime import datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.special import stdtrit

from thud.base._schema import VERDICTS
from thud.base.checks import refuse
from thud.base.files import read_input
from thud.base.immutable import Immutable
from thud.recordings.words import read_date
from thud.report.contents import FORMAT
from thud.report.rows import NOT_KNOWN, capital, number, quantity_of, value_text

if TYPE_CHECKING:
    import os
    from collections.abc import Iterable

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
# Marks in the table: of values by verdict, and of significant drifts.
MARKS = {VERDICTS[0]: "", VERDICTS[1]: " no", VERDICTS[2]: " ?"}
SIGNIFICANT = " *"
# Maximum size of a report, bytes.
MAX_SIZE = 2**28
# Entries of a report, and of each of its criteria, that a history needs.
KEYS = ("ball", "serial", "source", "date", "verdict", "criteria")
CRITERION_KEYS = (
    "name", "unit", "band", "value", "uncertainty", "expanded_uncertainty", "upper_bound", "lower",
    "upper", "verdict",
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class Trend(Immutable):
    """Straight line through the values of a criterion.

    Attributes
    ----------
    slope, expanded : float
        Change per year and its expanded uncertainty (95 %).
    significant : bool
        Whether the slope is significant, at 5 % for all criteria together.
    time, value : ndarray, shape (2,)
        Times of the first and the last value, years since the first report, and the line there.
    reached, earliest, latest : float
        Time between first and last value at which the line reaches a limit, and its interval
        (95 %), years since the first report; NaN if there is none or the trend is not significant.
    """

    slope: float
    expanded: float
    significant: bool
    time: NDArray[np.float64]
    value: NDArray[np.float64]
    reached: float = math.nan
    earliest: float = math.nan
    latest: float = math.nan


@dataclass(frozen=True)
class ControlLimits:
    """Mean and standard deviation of a criterion, by the moving range of consecutive values."""

    mean: float
    deviation: float

    def beyond(self, values: NDArray[np.float64], factor: float) -> NDArray[np.float64]:
        """Return 1 or -1 for values above or below the mean by a factor of deviations, else 0."""
        distance = values - self.mean
        return np.where(np.abs(distance) > factor * self.deviation, np.sign(distance), 0.0)


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
    def balls(self) -> tuple[str, ...]:
        """Name and serial number of the ball of each report, shape (n_report,); empty if one."""
        names = [_ball(report) or NOT_KNOWN for report in self.reports]
        return tuple(names) if len(set(names)) > 1 else ()

    @property
    def years(self) -> NDArray[np.float64]:
        """Time since the first report, years, shape (n_report,)."""
        return np.array([(date - self.dates[0]) / YEAR for date in self.dates])

    def date(self, years: float) -> datetime:
        """Return the date of a time since the first report, years."""
        return self.dates[0] + years * YEAR

    def criteria(self) -> list[list[dict[str, Any]]]:
        """Return the entries of each criterion in the reports, in the order of the dates."""
        reports = (report["criteria"] for report in self.reports)
        return [list(entries) for entries in zip(*reports, strict=True)]

    def trends(self) -> list[Trend | None]:
        """Return the trend of each criterion; None with fewer than three dates, or equal values."""
        series = [(entries, self._known(entries)) for entries in self.criteria()]
        fitted = [len(set(years)) >= MIN_REPORTS and np.ptp(v) > 0 for _, (years, v, _) in series]
        share = SIGNIFICANCE / max(sum(fitted), 1)
        return [
            _trend(*columns, (entries[-1]["lower"], entries[-1]["upper"]), share)
            if is_fitted
            else None
            for (entries, columns), is_fitted in zip(series, fitted, strict=True)
        ]

    def control_limits(self) -> list[ControlLimits | None]:
        """Return the control limits of each criterion; None with fewer than five values."""
        return [_control_limits(self._known(entries)[1]) for entries in self.criteria()]

    def temperatures(self) -> list[float | None]:
        """Return the recorded temperature of each report, degC; None if it is not stated."""
        values = (report.get("temperature") for report in self.reports)
        return [value if _is_number(value) else None for value in values]

    def calibrations(self) -> list[datetime]:
        """Return the dates of the calibrations of instruments, between first and last report.

        They are the dates of the certificates; a report whose calibration factor differs from that
        of the report before it counts as a calibration, too.
        """
        dates = set()
        previous: list[str] | None = None
        for date, report in zip(self.dates, self.reports, strict=True):
            items = [item for item in report.get("instruments", []) if isinstance(item, dict)]
            dates |= {read_date(str(item.get("calibrated", ""))) for item in items}
            files = [file for file in report.get("files", []) if isinstance(file, dict)]
            factors = sorted({str(file.get("calibration", "")) for file in files})
            if previous is not None and factors != previous:
                dates.add(date)
            previous = factors
        return sorted(date for date in dates if date and self.dates[0] <= date <= self.dates[-1])

    def _known(
        self, entries: list[dict[str, Any]]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Return times, values and standard uncertainties, without upper bounds."""
        rows = [
            (year, entry["value"], entry["uncertainty"] or 0.0)
            for year, entry in zip(self.years, entries, strict=True)
            if entry["value"] is not None and not entry["upper_bound"]
        ]
        columns = np.array(rows, dtype=np.float64).reshape(-1, 3)
        return columns[:, 0], columns[:, 1], columns[:, 2]

    def table(self) -> list[tuple[str, ...]]:
        """Return rows of text: values by date, change per year and date of the limit."""
        criteria, last = self.criteria(), len(self.dates) - 1
        quantities = [quantity_of(entries[0]) for entries in criteria]
        temperatures = [_degrees(value) for value in self.temperatures()]
        balls = self.balls
        head = ("Ball",) if balls else ()
        titles = [capital(quantity.label) for quantity in quantities]
        columns = [("", *head, *titles, "Temperature, °C", "verdict")]
        for i in range(last + 1):
            if 0 < i <= last + 1 - MAX_COLUMNS:
                continue
            column = [entries[i] for entries in criteria]
            cells = (value_text(entry) + MARKS[entry["verdict"]] for entry in column)
            day = self.dates[i].date().isoformat()
            ball = balls[i : i + 1]
            columns.append((day, *ball, *cells, temperatures[i], self.reports[i]["verdict"]))
        trends = self.trends()
        slopes = map(_slope, quantities, trends)
        none = ("",) * len(head)
        columns.append(("per year", *none, *slopes, "", ""))
        columns.append(("limit on", *none, *(self._limit(trend) for trend in trends), "", ""))
        return list(zip(*columns, strict=True))

    def marks(self) -> str:
        """Return the meaning of the marks that the table has, as a line; empty if it has none."""
        verdicts = {entry["verdict"] for entries in self.criteria() for entry in entries}
        parts = [f"{mark.strip()}: {v}" for v, mark in MARKS.items() if mark and v in verdicts]
        if any(trend is not None and trend.significant for trend in self.trends()):
            parts.append(
                f"{SIGNIFICANT.strip()}: the drift is significant, at {100 * SIGNIFICANCE:g} % "
                "for all criteria together"
            )
        return "; ".join(parts)

    def warnings(self) -> list[str]:
        """Return a warning for each significant trend, and for values beyond control limits."""
        known = [value for value in self.temperatures() if value is not None]
        ends = dict.fromkeys(_degrees(value) for value in (min(known), max(known))) if known else {}
        temperature = f" (temperature {' to '.join(ends)} °C)" if known else ""
        warnings = []
        for entries, trend, limits in zip(
            self.criteria(), self.trends(), self.control_limits(), strict=True
        ):
            quantity = quantity_of(entries[0])
            title = capital(quantity.label)
            if trend is not None and trend.significant:
                slope = _slope(quantity, trend).removesuffix(SIGNIFICANT)
                text = f"{title}: changes by {slope} per year{temperature}"
                date = self._date_text(trend.reached)
                if date:
                    start = self._date_text(trend.earliest) or "before the first report"
                    end = self._date_text(trend.latest) or "after the last report"
                    text += f"; reached a limit on {date} (95 %: {start} to {end})"
                warnings.append(text)
            if limits is not None:
                warnings += self._control_warnings(title, entries, limits)
        return warnings

    def _control_warnings(
        self, title: str, entries: list[dict[str, Any]], limits: ControlLimits
    ) -> list[str]:
        years, values, _ = self._known(entries)
        beyond = zip(years, limits.beyond(values, ACTION), strict=True)
        dates = [self._date_text(year) for year, side in beyond if side]
        warnings = []
        if dates:
            warnings.append(
                f"{title}: beyond the action limits ({ACTION:g} σ) on {', '.join(dates)}"
            )
        sides = limits.beyond(values[-3:], WARNING).tolist()
        if max(sides.count(1.0), sides.count(-1.0)) > 1:
            warnings.append(
                f"{title}: two of the last three values lie beyond one warning limit "
                f"({WARNING:g} σ)"
            )
        return warnings

    def _limit(self, trend: Trend | None) -> str:
        return "–" if trend is None else self._date_text(trend.reached) or "–"

    def _date_text(self, years: float) -> str:
        """Return the date of a time, years, as text; empty if outside the dates of the reports."""
        known = 0.0 <= years <= self.years[-1]
        return self.date(years).date().isoformat() if known else ""


def _ball(report: dict[str, Any]) -> str:
    """Return name and serial number of the ball of a report."""
    return " ".join(filter(None, (report["ball"], report["serial"])))


def _degrees(value: float | None) -> str:
    return "–" if value is None else number(value, 1)


def _control_limits(values: NDArray[np.float64]) -> ControlLimits | None:
    if len(values) < MIN_VALUES:
        return None
    deviation = float(np.abs(np.diff(values)).mean()) / MOVING_RANGE
    return ControlLimits(float(values.mean()), deviation) if deviation else None


def read_history(
    paths: Iterable[str | os.PathLike[str]], *, different_balls: bool = False
) -> History:
    """Read the reports of one ball.

    Parameters
    ----------
    paths
        Files ``report.json``, or directories that hold them at any depth.
    different_balls
        Whether reports of different balls, serial numbers or sources are allowed.

    Raises
    ------
    InputError
        If a report cannot be read or has no date, or the balls differ.
    """
    files = list(dict.fromkeys(file for path in paths for file in _files(Path(path))))
    if not files:
        refuse("there are no reports", "one report.json or more")
    dated = sorted(((*_read(file), file) for file in files), key=lambda entry: entry[0])
    for _, report, file in dated[1:]:
        _require_same(report, file, dated[0][1], dated[0][2], different_balls=different_balls)
    names = dict.fromkeys(_ball(report) for _, report, _ in dated)
    title = next(iter(names)) if len(names) == 1 else f"{len(names)} balls"
    reports = tuple(report for _, report, _ in dated)
    return History(title or "ball", tuple(date for date, _, _ in dated), reports)


def _require_same(
    report: dict[str, Any],
    file: Path,
    first: dict[str, Any],
    origin: Path,
    *,
    different_balls: bool,
) -> None:
    names, first_names = ([c["name"] for c in r["criteria"]] for r in (report, first))
    if report["source"] != first["source"] or names != first_names:
        refuse(
            f"{file}: its source {report['source']!r} or its criteria are not those of {origin}",
            "reports of one source",
        )
    for key, title in (("serial", "serial number"), ("ball", "ball")):
        if report[key] != first[key] and not different_balls:
            refuse(
                f"{file}: its {title} {report[key]!r} is not that of {origin}, {first[key]!r}",
                "reports of one ball, or --different-balls",
            )


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
        report = json.loads(read_input(path))
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
    entries = report.get("criteria")
    if any(key not in report for key in KEYS) or not isinstance(entries, list) or not entries:
        return False
    if not all(isinstance(report[key], str) for key in KEYS if key != "criteria"):
        return False
    return all(
        isinstance(entry, dict)
        and all(key in entry for key in CRITERION_KEYS)
        and all(_is_number(entry[key]) for key in ("lower", "upper"))
        and all(
            entry[key] is None or _is_number(entry[key])
            for key in ("value", "uncertainty", "expanded_uncertainty", "band")
        )
        and all(isinstance(entry[key], str) for key in ("name", "unit"))
        and entry["verdict"] in VERDICTS
        for entry in entries
    )  # fmt: skip


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _trend(
    time: NDArray[np.float64],
    value: NDArray[np.float64],
    uncertainty: NDArray[np.float64],
    limits: tuple[float, float],
    significance: float,
) -> Trend:
    """Return the least-squares line, weighted by 1/uncertainty**2, with its uncertainty.

    It is the larger of two, by the stated uncertainties and by the scatter with n - 2 degrees of
    freedom: a trend must be significant by both.
    """
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
    line = mean + slope * (ends - middle)
    times = (math.nan, math.nan, math.nan)
    if significant:
        limit = limits[1] if slope > 0 else limits[0]
        crossing = _crossing(limit - mean, slope, factor(0.05), weight.sum(), spread)
        # A line says nothing beyond its values.
        if time[0] <= middle + crossing[0] <= time[-1]:
            times = crossing
    return Trend(slope, expanded, significant, ends, line, *(middle + instant for instant in times))


def _crossing(
    distance: float, slope: float, factor: float, weights: float, spread: float
) -> tuple[float, float, float]:
    """Return the time at which a line reaches a limit, and its interval, since the mean time.

    The ends of the interval (Fieller) are the times at which the confidence band of the line
    reaches the limit: (distance - slope t)**2 = factor**2 (1/weights + t**2/spread).
    """
    a = slope**2 - factor**2 / spread
    b = slope * distance
    c = distance**2 - factor**2 / weights
    root = b**2 - a * c
    if a <= 0 or root < 0:
        return distance / slope, math.nan, math.nan
    low, high = (b - math.sqrt(root)) / a, (b + math.sqrt(root)) / a
    return distance / slope, low, high


def _slope(quantity: Quantity, trend: Trend | None) -> str:
    """Return a slope with its expanded uncertainty as text, marked if it is significant."""
    if trend is None:
        return "–"
    slope, expanded = (width * quantity.display_scale for width in (trend.slope, trend.expanded))
    decimals = quantity.decimals + 1
    sign = "+" if round(slope, decimals) > 0 else ""
    mark = SIGNIFICANT if trend.significant else ""
    return f"{sign}{number(slope, decimals)} ± {number(expanded, decimals)}{mark}"
