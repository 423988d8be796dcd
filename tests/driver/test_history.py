"""The control chart of a ball: trends that are more than chance, reports of one ball."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from datetime import datetime
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from conftest import names_in
from scipy import stats
from test_figure_look import assert_clean

from thud import cli
from thud.base._schema import VERDICTS
from thud.level.assessment import assess_levels, criterion_quantity
from thud.level.estimate import Contribution, Estimate
from thud.level.levels import get_bands
from thud.report.ball_history import (
    ACTION,
    YEAR,
    ControlLimits,
    History,
    Series,
    Trend,
    _control_limits,
    _trend,
    read_history,
)
from thud.report.ball_history_figure import draw_history
from thud.report.contents import FORMAT, ReportCriterion, criterion_members

if TYPE_CHECKING:
    from pathlib import Path

LEVELS = (39.0, 31.0, 23.0, 17.0, 12.5)
LIMITS = (29.5, 32.5)


def report(day: str, levels: Any = LEVELS, deviation: float = 0.1, **keys: Any) -> dict[str, Any]:  # noqa: ANN401
    """Return what a report says that a chart needs, the verdicts by the library."""
    part = Contribution("repeatability", deviation)
    decisions = assess_levels(
        [Estimate.from_budget(float(level), part) for level in levels],
        contact_time=Estimate.from_budget(0.02, Contribution("repeatability", 1e-4)),
        restitution=0.8,
        peaks=1.0,
        mass=2.5,
    ).criteria
    known = {"spread": np.nan, "background": np.nan, "flag": "", "excluded": ()}
    rows = [
        criterion_members(ReportCriterion(entry, **known, has_own_limits=False))
        for entry in decisions
    ]
    return {
        "format": FORMAT, "ball": "ball", "serial": "7", "source": "rubber_ball", "date": day,
        "verdict": VERDICTS[0], "criteria": rows, **keys,
    }  # fmt: skip


def history(slope: float = 0.0, count: int = 6, seed: int | None = None) -> History:
    """Return the history of a ball whose level at 63 Hz drifts by a slope per year."""
    rng = np.random.default_rng(seed)
    dates = [datetime(2015, 1, 1) + k * YEAR for k in range(count)]  # noqa: DTZ001
    reports = []
    for k, day in enumerate(dates):
        noise = 0.1 * rng.standard_normal(5) if seed is not None else np.zeros(5)
        levels = np.array(LEVELS) + noise
        levels[1] += slope * k
        reports.append(report(day.date().isoformat(), levels))
    return History("ball 7", tuple(dates), tuple(reports))


def line(time: Any, value: Any, deviation: Any) -> Trend:  # noqa: ANN401
    """Return the trend of values with standard uncertainties, at a significance of 5 %."""
    entry = dict(zip(("lower", "upper"), LIMITS, strict=True))
    deviations = np.broadcast_to(deviation, len(time))
    series = Series(criterion_quantity("octave_63"), (entry,), time, value, deviations)
    return _trend(series, 0.05)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Write five reports of a drifting ball, the last first."""
    rng = np.random.default_rng(4)
    for k in reversed(range(5)):
        levels = np.array(LEVELS) + 0.02 * rng.standard_normal(5) + 0.35 * k * np.eye(5)[1]
        year = tmp_path / f"year_{9 - k}"
        year.mkdir()
        (year / "report.json").write_text(json.dumps(report(f"{2018 + k}-06-01", levels)))
    return tmp_path


def test_line_is_that_of_least_squares() -> None:
    rng = np.random.default_rng(1)
    time = np.sort(rng.uniform(0, 9, 12))
    value, deviation = rng.normal(31, 1, 12), rng.uniform(0.1, 1, 12)
    found = line(time, value, deviation)
    slope, start = np.polyfit(time, value, 1, w=1 / deviation)
    assert found.slope == pytest.approx(slope)
    np.testing.assert_allclose(found.value, start + slope * time[[0, -1]])
    # The interval is the wider of those by the scatter and by the stated uncertainties.
    scatter = stats.t.ppf(0.975, 10) * stats.linregress(time, value).stderr
    stated = stats.norm.ppf(0.975) * 0.1 / np.sqrt(((time - time.mean()) ** 2).sum())
    assert line(time, value, 0.0).expanded == pytest.approx(scatter)
    assert line(time, 31 + 0.3 * time, 0.1).expanded == pytest.approx(stated)


def test_trend_without_noise_is_the_drift() -> None:
    found = history(slope=0.2, count=11)
    trend = found.series[1].trend
    assert trend is not None
    assert trend.significant
    assert trend.slope == pytest.approx(0.2)
    assert found.series[1].uncertainties == pytest.approx(np.full(11, 0.1))
    assert "+0.200" in found.warnings()[0]
    # Few reports and equal values have none.
    known = history(slope=0.5, count=5).series
    assert [i for i, series in enumerate(known) if series.trend] == [1]
    assert not any(series.trend for series in history(slope=0.5, count=2).series)


def test_control_limits_are_those_of_the_moving_range() -> None:
    rng = np.random.default_rng(7)
    values = rng.normal(31.0, 0.4, 2000)
    limits = _control_limits(values)
    assert limits is not None
    assert limits.mean == pytest.approx(values.mean())
    # The moving range estimates the deviation with a relative error of 0.83/sqrt(n).
    assert limits.deviation == pytest.approx(0.4, rel=4 * 0.83 / np.sqrt(2000))
    # A drift does not widen them.
    drifting = _control_limits(values + np.linspace(0, 20, 2000))
    assert drifting is not None
    assert drifting.deviation == pytest.approx(limits.deviation, rel=1e-3)
    assert _control_limits(values[:4]) is None


@pytest.mark.parametrize(
    ("values", "count", "day"),
    [({4: 42.0}, 1, "2019-01-01"), ({7: 39.25, 8: 39.25}, 1, ""), ({8: 39.25}, 0, "")],
)
def test_values_beyond_the_control_limits_are_named(
    values: dict[int, float], count: int, day: str
) -> None:
    found = history(count=9)
    for k, report_ in enumerate(found.reports):
        report_["criteria"][0]["value"] = values.get(k, 39.0 + 0.05 * (-1) ** k * (k not in (7, 8)))
    warnings = found.warnings()
    assert len(warnings) == count
    assert all("31.5 Hz" in text and day in text for text in warnings)


@pytest.mark.parametrize(
    ("distances", "named"),
    [((2.5, 2.6, -2.5), True), ((-2.5, 2.5, -2.5), True), ((2.5, -2.5, 0.0), False),
     ((2.5, 0.0, 2.5), True), ((-2.1, -2.1, -2.1), True), ((2.5, 1.9, -2.5), False)],
)  # fmt: skip
def test_values_beyond_a_warning_limit_count_on_each_side(
    distances: tuple[float, float, float],
    named: bool,  # noqa: FBT001
) -> None:
    found = history(count=3)
    values = 39.0 + np.array(distances)
    series = replace(found.series[0], values=values, control=ControlLimits(39.0, 1.0))
    found.__dict__["series"] = (series,)
    assert len(found.warnings()) == named


def test_action_limits_are_rarely_passed_by_chance() -> None:
    rng = np.random.default_rng(8)
    runs, told = 2000, 0
    for _ in range(runs):
        values = rng.standard_normal(8)
        limits = _control_limits(values)
        assert limits is not None
        told += (np.abs(values - limits.mean) > ACTION * limits.deviation).any()
    # 1.6 % of histories of eight values (simulation in docs/report.md).
    assert stats.binom.ppf(0.0005, runs, 0.016) <= told <= stats.binom.ppf(0.9995, runs, 0.016)


def test_temperatures_and_calibrations_are_shown() -> None:
    plain = history(slope=0.3, count=6)
    reports = plain.reports
    for k, report_ in enumerate(reports):
        report_["temperature"] = 18.0 + k if k else None
        report_["instruments"] = [{"name": "plate", "calibrated": "2016-07-01"}, "amplifier"]
    found = History("ball_7", plain.dates, reports)
    assert [day.date().isoformat() for day in found.calibrations] == ["2016-07-01"]
    (row,) = [row for row in found.table() if row[0] == "Temperature, °C"]
    assert row[1:4] == ("–", "19.0", "20.0")
    assert "(temperature 19.0 to 23.0 °C)" in found.warnings()[0]
    figure = draw_history(found)
    assert figure.legends[0].get_title().get_text() == "ball_7"
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    assert {"calibration", "warning limits (2 σ)", "action limits (3 σ)"} <= set(labels)
    panel = next(axes for axes in figure.axes if axes.get_ylabel().startswith("Temperature"))
    np.testing.assert_array_equal(panel.lines[0].get_ydata(), [19, 20, 21, 22, 23])
    assert panel.xaxis.get_tick_params()["labelbottom"]
    level = next(axes for axes in figure.axes if axes.get_ylabel().startswith("63 Hz"))
    limits = found.series[1].control
    assert limits is not None
    drawn = {line.get_ydata()[0] for line in level.lines if line.get_linestyle() in (":", "-.")}
    expected = [limits.mean + k * limits.deviation for k in (-3, -2, 2, 3)]
    np.testing.assert_allclose(sorted(drawn), expected)


def test_ball_that_does_not_change_has_no_trend() -> None:
    told = sum(any(series.is_drifting for series in history(seed=k).series) for k in range(300))
    # Five levels differ, the test is for all of them together: at most 5 % (99.9 % of the draws).
    assert told <= stats.binom.ppf(0.999, 300, 0.05)


@pytest.mark.parametrize("stated", [0.0, 0.001])
def test_few_points_on_a_line_by_chance_are_no_trend(stated: float) -> None:
    rng = np.random.default_rng(6)
    time, runs = np.arange(4.0), 600
    values = 31 + 0.1 * rng.standard_normal((runs, 4))
    told = sum(line(time, v, stated).significant for v in values)
    assert stats.binom.ppf(0.001, runs, 0.05) <= told <= stats.binom.ppf(0.999, runs, 0.05)


def test_chart_shows_each_criterion_its_limits_and_verdicts(folder: Path) -> None:
    found = read_history([folder])
    figure = draw_history(found)
    panels = {axes.get_ylabel().replace("\n", " "): axes for axes in figure.axes}
    assert panels.keys() == {
        *(f"{band:g} Hz, dB" for band in get_bands().nominal),
        *("Contact time, ms", "Restitution", "Force peaks", "Mass, kg", "Drop height, m"),
    }
    second = panels["63 Hz, dB"]
    assert len(second.containers) == 5
    markers = [bar.lines[0].get_marker() for bar in second.containers]
    assert markers == ["o", "o", "o", "o", "s"]
    (area,) = second.collections[:1]
    box = area.get_datalim(second.transData)
    assert (box.y0, box.y1) == LIMITS
    (drawn,) = [one for one in second.lines if one.get_linestyle() == "--"]
    assert np.diff(drawn.get_ydata())[0] == pytest.approx(4 * 0.35, abs=0.1)
    assert "not known" in [text.get_text() for text in panels["Drop height, m"].texts]
    assert_clean(figure)


def test_table_of_many_reports_is_not_wide_and_of_one_has_no_trend() -> None:
    many = history(count=30)
    head = many.table()[0]
    assert (len(head), head[1]) == (10, "2015-01-01")
    assert head[-2] == many.dates[-1].date().isoformat()
    head, *rows = history(slope=0.1, count=1).table()
    assert head == ("", "2015-01-01", "per year")
    assert (len(rows), rows[1]) == (12, ("63 Hz, dB", "31.00", "–"))


def test_command_writes_the_chart(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Reports are in the order of their dates, each once."""
    chart = folder / "chart"
    paths = [str(folder / "year_5"), str(folder)]
    assert cli.main(["history", *paths, "-o", str(chart)]) == 0
    assert "history.svg" in names_in(chart)
    printed = capsys.readouterr().out
    assert printed.startswith("ball 7\n")
    assert re.findall(r"\d{4}-06-01", printed)[:5] == [f"{2018 + k}-06-01" for k in range(5)]
    assert re.search(r"63 Hz, dB .* 32\.4.* undecided .*\+0\.3.* significant", printed)
