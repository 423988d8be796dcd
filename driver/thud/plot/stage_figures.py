"""A recorded drop after each stage of its measurement."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from thud.plot.recording_figures import HEIGHT, draw_background
from thud.plot.style import (
    COLORS,
    ERROR_BARS,
    GRAY,
    LEVEL,
    WIDTH,
    band_axis,
    escape_label,
    own_style,
    panel_grid,
)
from thud.recordings.contact import Contact
from thud.recordings.drops import Section
from thud.recordings.measured_drop import Drop, Stages
from thud.recordings.recorded_levels import DropLevels, measure_levels

if TYPE_CHECKING:
    from collections.abc import Callable

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from thud.recordings.drops import Stage

# Time around the contact in which changes of the force are drawn, s.
AROUND = 0.01
# Range of forces around the background, in standard deviations of the noise.
RANGE = 8.0


@own_style()
def draw_stage(stage: Stage) -> Figure:
    """Draw what a stage of the measurement returns, or a drop after each of them."""
    panels = _panels(stage)
    columns = min(2, len(panels))
    figure, axes = panel_grid(len(panels), columns, HEIGHT - 0.3)
    figure.set_figwidth(columns * WIDTH)
    for panel, (draw, part) in zip(axes, panels, strict=True):
        draw(panel, part)
        if len(panel.get_legend_handles_labels()[0]) > 1:
            panel.legend(loc="best", framealpha=0.8)
    return figure


def _panels(stage: Stage) -> list[tuple[Callable[[Axes, Any], None], Stage]]:
    """Return what draws the panels of a stage, and of which part."""
    if isinstance(stage, Stages):
        return [(_draw_section, stage.section), (_draw_changes, stage), *_panels(stage.drop)]
    if isinstance(stage, Drop):
        return [(_draw_contact, stage.contact), (_draw_levels, measure_levels([stage]))]
    draw: dict[type, Callable[[Axes, Any], None]] = {
        Section: _draw_section, Contact: _draw_contact, DropLevels: _draw_levels,
    }  # fmt: skip
    return [(draw[type(stage)], stage)]


def _draw_section(axes: Axes, section: Section) -> None:
    """Draw the force of a drop and of its bounces, and their contacts."""
    for part in filter(None, (section.bounce, section)):
        time = (part.start + np.arange(len(part.force))) / part.sample_rate
        color = COLORS[0] if part is section else "0.55"
        axes.plot(time, 1e-3 * part.force, color=color, linewidth=0.8)
        axes.axvspan(*time[[part.contact[0], part.contact[1] - 1]], color=GRAY, linewidth=0)
    axes.set_title(escape_label(section.name))
    axes.set_xlabel("Time in the file, s")
    axes.set_ylabel("Force, kN")


def _draw_changes(axes: Axes, stages: Stages) -> None:
    """Draw what each stage has changed in the force next to the contact."""
    section, rate = stages.section, stages.section.sample_rate
    margin = round(AROUND * rate)
    shown = slice(max(section.contact[0] - margin, 0), section.contact[1] + margin)
    time = (np.arange(len(section.force)) - section.contact[0])[shown] / rate
    changes = {
        "repair": stages.repaired.force - section.force,
        "instruments": stages.corrected.force - stages.repaired.force,
    }
    for (name, change), color in zip(changes.items(), COLORS, strict=False):
        label = name if change.any() else f"{name} (no change)"
        axes.plot(1e3 * time, change[shown], color=color, linewidth=0.8, label=label)
    axes.set_xlabel("Time, ms")
    axes.set_ylabel("Change of the force, N")


def _draw_contact(axes: Axes, contact: Contact) -> None:
    """Draw force, removed background and the gate of the levels on the scale of the noise."""
    rate, touch = contact.sample_rate, contact.touch.value
    time = 1e3 * (np.arange(len(contact.force)) / rate - touch)
    recorded, removed = contact.force + contact.removed, contact.removed
    first, stop = contact.gate
    quiet = np.delete(contact.force, slice(first, stop))
    noise = float(quiet.std()) if quiet.size else 0.0
    spread = max(RANGE * noise, 0.01 * contact.background.peak)
    axes.axvspan(time[first], time[stop - 1], color=GRAY, linewidth=0, label="gate of the levels")
    axes.plot(time, recorded, color="0.55", linewidth=0.5, label="corrected force")
    axes.plot(time, removed, color=COLORS[1], linewidth=1.0, label="background")
    for edge in (contact.touch, contact.release):
        axes.axvline(1e3 * (edge.value - touch), color=COLORS[0], linewidth=0.6)
    axes.set_ylim(removed.min() - spread, removed.max() + spread)
    axes.set_xlabel("Time since first touch, ms")
    axes.set_ylabel("Force, N")


def _draw_levels(axes: Axes, levels: DropLevels) -> None:
    """Draw the levels of drops with their standard uncertainties, and the background."""
    x, count = np.arange(levels.level.shape[1]), len(levels.names)
    axes.errorbar(
        np.tile(x, count), levels.level.ravel(), yerr=np.nan_to_num(levels.uncertainty.ravel()),
        label="drop" if count == 1 else f"{count} drops", **ERROR_BARS,
    )  # fmt: skip
    draw_background(axes, levels.background.max(axis=0), levels.level)
    band_axis(axes, levels.bands)
    axes.set_ylabel(LEVEL.replace(", ", ",\n", 1))
