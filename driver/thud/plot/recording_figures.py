"""Forces and levels of a recording: every drop, their average, limits (paper, figures 2 and 3)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from thud.impact.contact_time import MARGIN
from thud.level.levels import BANDWIDTHS, low_pass
from thud.plot.impact_figures import TIME_LABEL
from thud.plot.style import (
    COLORS,
    ERROR_BARS,
    GRAY,
    band_axis,
    finish,
    own_or,
    own_style,
    tolerance_boxes,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from thud.base._schema import BandSet
    from thud.recordings.measured_drop import Drop
    from thud.recordings.recording import Recording


# Height without the legend, inch: a report has two figures side by side.
HEIGHT = 2.05
# Maximum number of drops drawn as lines; the range of more drops is filled.
MAX_LINES = 40
# Margin of the filtered force around the drawn times, s: longer than the filter's response.
FILTER_MARGIN = 2e-2
# Points of a force.
POINTS = 400
# Backgrounds further below the lowest level than this, dB, are not drawn.
MAX_DISTANCE = 20.0
THIN: dict[str, Any] = {"color": "0.55", "linewidth": 0.5}
OTHERS: dict[str, Any] = {"color": COLORS[2], "linewidth": 1.0, "linestyle": (0, (1, 1))}
DEVIANT: dict[str, Any] = {"color": COLORS[1], "linewidth": 0.7, "linestyle": (0, (3, 1))}


@own_style()
def recording_forces(recording: Recording, ax: Axes | None = None) -> Figure:
    """Draw the force of every drop, low-passed at 1.25 kHz, and their average, against time.

    The contact time is drawn with its limits and its expanded uncertainty (95 %).
    """
    axes = own_or(ax, HEIGHT)
    limits = next(d for d in recording.assess().criteria if d.name == "contact_time")
    longest = max(drop.contact_time.value for drop in recording.drops)
    longest = max(longest, recording.contact_time, limits.upper if limits.upper < 1 else 0)
    time = longest * np.linspace(-MARGIN, 1 + MARGIN, POINTS)
    forces = 1e-3 * np.array([_recorded(drop, time) for drop in recording.drops])
    allowed = f"permitted, {1e3 * limits.lower:g} to {1e3 * limits.upper:g} ms"
    axes.axvspan(1e3 * limits.lower, 1e3 * limits.upper, color=GRAY, linewidth=0, label=allowed)
    marked = _draw_drops(axes, 1e3 * time, forces, recording)
    if len(forces) > 1:
        mean = forces.mean(axis=0)
        axes.plot(1e3 * time, mean, label="average", color=COLORS[0], linewidth=1.4)
    if marked.any() and not marked.all():
        mean = forces[~marked].mean(axis=0)
        axes.plot(1e3 * time, mean, label="without outliers", **OTHERS)
    half = np.nan_to_num(1e3 * limits.estimate.expanded)
    axes.errorbar(1e3 * limits.value, 0, xerr=half, label="contact time", **ERROR_BARS)
    axes.set_xlim(1e3 * time[0], 1e3 * time[-1])
    axes.set_xlabel(TIME_LABEL)
    axes.set_ylabel("Force on the floor,\nbelow 1.25 kHz, kN")
    return finish(axes, ax)


def _recorded(drop: Drop, time: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the force of a drop, low-passed at 1.25 kHz, N, at times since first touch, s."""
    edges = time[[0, -1]] + [-FILTER_MARGIN, FILTER_MARGIN]
    indices = ((edges - drop.begin) * drop.sample_rate).astype(int)
    part = slice(*np.clip(indices, 0, len(drop.force)))
    return np.interp(time, drop.time[part], low_pass(drop.force[part], drop.sample_rate))


@own_style()
def recording_levels(
    recording: Recording, ax: Axes | None = None, bands: BandSet = "octave"
) -> Figure:
    """Draw the levels of every drop, their average with its expanded uncertainty, the background.

    Levels of octaves are drawn with the tolerances of the verdict.

    Parameters
    ----------
    recording
        The recording.
    ax
        Axes in which it is drawn; by default those of a new figure.
    bands
        ``"octave"`` or ``"third"``.
    """
    average = recording.average(bands)
    axes = own_or(ax, HEIGHT)
    if bands == BANDWIDTHS[0]:
        verdict = recording.assess()
        octaves = verdict.criteria[: len(average.level)]
        own = any(criterion.name in recording.config.limits for criterion in octaves)
        lower, upper = np.array([[criterion.lower, criterion.upper] for criterion in octaves]).T
        title = f"Tolerance, {verdict.source.replace('_', ' ')}" + ", own limits" * own
        tolerance_boxes(axes, lower, upper, title)
    x = np.arange(len(average.level), dtype=float)
    _draw_drops(axes, x, average.drops.level, recording)
    expanded = np.nan_to_num([estimate.expanded for estimate in average.estimates])
    label = "average, 95 %" if len(recording.drops) > 1 else "drop, 95 %"
    axes.errorbar(x, average.level, yerr=expanded, label=label, **ERROR_BARS)
    bounds = average.flag == "background"
    if bounds.any():
        axes.plot(
            x[bounds], average.level[bounds], label="upper bound", linestyle="none", marker="v",
            markersize=6, markerfacecolor="white", color=COLORS[0], zorder=3,
        )  # fmt: skip
    draw_background(axes, average.background, average.level)
    band_axis(axes, bands)
    axes.set_ylabel("Force exposure level\n(force on the floor), dB")
    return finish(axes, ax)


def draw_background(
    axes: Axes, background: NDArray[np.float64], level: NDArray[np.float64]
) -> None:
    """Draw levels of the background, or name their maximum if all are far below the levels."""
    lowest = np.nanmin(level) if np.isfinite(level).any() else 0.0
    visible = np.where(background > lowest - MAX_DISTANCE, background, np.nan)
    label = "background"
    if not np.isfinite(visible).any() and np.isfinite(background).any():
        label = f"background, up to {np.nanmax(background):.0f} dB".replace("-", "−")
    axes.plot(visible, "k:_", label=label, linewidth=0.8, markersize=7)


def _draw_drops(
    axes: Axes, x: NDArray[np.float64], curves: NDArray[np.float64], recording: Recording
) -> NDArray[np.bool_]:
    """Draw the curves of the drops, shape (n_drop, n), or their range; return which are outliers.

    Outliers are marked.
    """
    names = {outlier.subject for outlier in recording.outliers}
    marked = np.array([drop.name in names for drop in recording.drops])
    count, number = len(curves), int(marked.sum())
    if count > MAX_LINES:
        # A band without a level is NaN in all drops.
        axes.fill_between(
            x, curves.min(axis=0), curves.max(axis=0), color="0.6", linewidth=0,
            label=f"range of {count} drops",
        )  # fmt: skip
    others = count - number
    title = f"{others} drops" if others > 1 else "drop"
    outliers = f"{number} outliers" if number > 1 else "outlier"
    for chosen, name, style in ((~marked, title, THIN), (marked, outliers, DEVIANT)):
        for i, curve in enumerate(curves[chosen] if count <= MAX_LINES or style is DEVIANT else []):
            axes.plot(x, curve, label=None if i else name, **style)
    return marked
