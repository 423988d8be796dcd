"""Forces and levels of impacts."""

from __future__ import annotations

from typing import TYPE_CHECKING

from thud.base._schema import BandSet, LevelsForce, Limits, LimitsSource
from thud.base.checks import refuse
from thud.impact.contact_time import contact_force
from thud.level.assessment import octave_limits
from thud.plot.style import (
    COLORS,
    add_curves,
    add_levels,
    assessed_curves,
    empty_axes,
    finish,
    legend_above,
    level_label,
    new_figure,
    own_or,
    own_panels,
    own_style,
    tolerance_boxes,
)

if TYPE_CHECKING:
    from collections.abc import Mapping

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from thud.export.force_files import BlockedForce
    from thud.impact.impact import Impact
    from thud.plot.style import Curve

TIME_LABEL = "Time since first touch, ms"


@own_style()
def force_history(impacts: Mapping[str, Impact], force: LevelsForce | None = None) -> Figure:
    """Draw forces against time, low-passed at 1.25 kHz like a force plate (paper, figure 2).

    Parameters
    ----------
    impacts
        Impacts by their names in the legend.
    force
        ``"floor"`` or ``"elastic"`` (the paper's ball force); by default that of each case.

    Returns
    -------
    Figure
        Time from first touch to last release in ms, force in kN.
    """
    figure, axes = empty_axes(2.6)
    draw_forces(axes, impacts, force)
    legend_above(axes)
    return figure


def draw_forces(axes: Axes, impacts: Mapping[str, Curve], force: LevelsForce | None) -> None:
    """Draw forces against time."""
    curves, name = assessed_curves(impacts, force)
    add_curves(axes, {label: contact_force(*curve) for label, curve in curves.items()})
    axes.margins(x=0)
    # A number of ticks that depends on the layout would change the layout in turn.
    axes.locator_params(axis="y", nbins=8)
    axes.set_xlabel(TIME_LABEL)
    axes.set_ylabel(f"{name.capitalize()},\nlow-passed at 1.25 kHz, kN")


@own_style()
def levels(
    impacts: Mapping[str, Impact], force: LevelsForce | None = None,
    source: LimitsSource | None = None,
) -> Figure:  # fmt: skip
    """Draw octave levels with the tolerance band of the standards (paper, figure 3).

    One-third-octave bands, which have no limits, are drawn below if a case asks for them.

    Parameters
    ----------
    impacts
        Impacts by their names in the legend.
    force
        ``"floor"`` or ``"elastic"`` (the paper's ball force); by default that of each case.
    source
        ``"rubber_ball"`` or ``"tyre"``: source of the limits; by default that of the cases.

    Returns
    -------
    Figure
        Bands in Hz, force exposure level in dB re 1 N, 1 s.
    """
    curves, _ = assessed_curves(impacts, force)
    requested = {impact.case.levels.bands for impact, _ in curves.values()}
    bands: list[BandSet] = ["octave"] if requested == {"octave"} else ["octave", "third"]
    figure = new_figure(0.4 + 2.5 * len(bands))
    panels = dict(zip(bands, figure.subplots(len(bands), 1, squeeze=False)[:, 0], strict=True))
    draw_levels(panels, impacts, force, common_source(impacts, source))
    legend_above(panels["octave"])
    return figure


def draw_levels(
    panels: Mapping[BandSet, Axes], impacts: Mapping[str, Curve], force: LevelsForce | None,
    source: LimitsSource,
) -> None:  # fmt: skip
    """Draw levels in the axes of their bands; octaves also show the tolerances."""
    curves, name = assessed_curves(impacts, force)
    title = f"Tolerance, {source.replace('_', ' ')}"
    tolerance_boxes(panels["octave"], *octave_limits(source), title)
    for bands, axes in panels.items():
        values = {name: i.levels(bands, force=kind) for name, (i, kind) in curves.items()}
        add_levels(axes, values, bands)
        axes.set_ylabel(level_label(name))


def common_source(impacts: Mapping[str, Curve], source: LimitsSource | None = None) -> LimitsSource:
    """Return a source of limits, by default that of the cases and recordings.

    A recording without a stated source takes that of the others. Raises InputError if they differ.
    """
    if source is not None:
        return source
    stated = (impact.limits_source for impact in impacts.values())
    sources = {name for name in stated if name}
    if len(sources) > 1:
        refuse(
            f"&limits: source differs ({', '.join(sorted(sources))})",
            "cases and recordings with one source, or the choice of one",
        )
    return sources.pop() if sources else Limits.source


@own_style()
def draw_blocked_force(force: BlockedForce, ax: Axes | None = None) -> Figure:
    """Draw a force over time since first touch."""
    axes = own_or(ax, 2.0)
    axes.plot(1e3 * force.time, 1e-3 * force.force, color=COLORS[0], linewidth=1)
    axes.set_xlabel(TIME_LABEL)
    axes.set_ylabel("Force, kN")
    return finish(axes, ax)


@own_style()
def overview(impact: Impact, ax: Axes | None = None) -> Figure:
    """Draw the assessed force and its octave levels."""
    name = impact.case.model.name.replace("_", " ") if impact.case.model else ""
    history, *octaves = panels = own_panels(ax, 5, 2)
    draw_forces(history, {name: impact}, None)
    for axes in octaves:
        draw_levels({"octave": axes}, {name: impact}, None, impact.limits_source)
    return finish(panels[-1], ax)
