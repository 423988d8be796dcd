"""Octave levels over the tolerance band of the standards (paper, figure 3), and third octaves."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from thud.base._schema import (
    Ball,
    BandSet,
    Drop,
    HollowSphereMomentumFlux,
    Levels,
    LevelsForce,
    LevelsMethod,
    Limits,
    LimitsSource,
)
from thud.base.checks import refuse
from thud.impact.impact import Impact
from thud.impact.solve import solve
from thud.level.assessment import octave_limits
from thud.plot.style import (
    SIZE,
    Curve,
    escape_label,
    iterate_curves,
    legend_above,
    level_label,
    line_style,
    marker_style,
    named,
    new_figure,
    octave_axis,
    octave_boxes,
    own_style,
    style_axes,
)


@own_style()
def levels(
    impacts: Mapping[str, Impact],
    force: LevelsForce | None = None,
    source: LimitsSource | None = None,
    method: LevelsMethod | None = None,
) -> Figure:
    """Draw octave levels over the tolerance band of the standards (paper, figure 3).

    Third octaves, which have no limits, are drawn below them where a case asks for them.

    Parameters
    ----------
    impacts
        Impacts by their names in the legend.
    force
        ``"floor"`` or ``"elastic"`` (the paper's ball force); by default that of each case.
    source
        ``"rubber_ball"`` or ``"tyre"``: of the tolerance band; by default that of the cases.
    method
        ``"exact"`` or ``"fft"``; by default that of each case.

    Returns
    -------
    Figure
        Bands in Hz, force exposure level in dB re 1 N.
    """
    curves = list(iterate_curves(impacts, force))
    asked = {impact.case.levels.bands for _, impact, _ in curves}
    bands: list[BandSet] = ["octave"] if asked == {"octave"} else ["octave", "third"]
    figure = new_figure(0.4 + 2.5 * len(bands))
    panels = dict(zip(bands, figure.subplots(len(bands), 1, squeeze=False)[:, 0], strict=True))
    draw_levels(panels, impacts, force, common_source(impacts, source), method)
    for axes in panels.values():
        axes.set_ylabel(level_label(impacts, force), fontsize=SIZE)
    legend_above(panels["octave"])
    return figure


def draw_levels(
    panels: Mapping[BandSet, Axes],
    impacts: Mapping[str, Curve],
    force: LevelsForce | None,
    source: LimitsSource,
    method: LevelsMethod | None = None,
) -> None:
    """Draw levels in the axes of their bands; those of the octaves have the tolerance band."""
    draw_tolerance(panels["octave"], *octave_limits(source), source.replace("_", " "))
    # Side by side, equal levels can be distinguished.
    step = min(0.1, 0.6 / len(impacts))
    for bands, axes in panels.items():
        style_axes(axes)
        for i, (name, impact, kind) in enumerate(iterate_curves(impacts, force)):
            values = impact.levels(bands, method, kind)
            place = np.arange(len(values)) + step * (i - (len(impacts) - 1) / 2)
            axes.plot(place, values, label=escape_label(name), **line_style(i), **marker_style(i))
        octave_axis(axes, bands)


def common_source(impacts: Mapping[str, Curve], source: LimitsSource | None = None) -> LimitsSource:
    """Return a source of limits, or without it that of the cases and recordings.

    The default source of a recording is none that was stated: it counts only where no other is.

    Raises
    ------
    InputError
        Where they differ in it.
    """
    if source is not None:
        return source
    stated = (impact.limits_source for impact in impacts.values())
    found = {one for one in stated if one}
    if len(found) > 1:
        what = f"&limits: source differs ({', '.join(sorted(found))})"
        refuse(what, "cases and recordings with one source, or the choice of one")
    return found.pop() if found else Limits.source


def draw_tolerance(
    axes: Axes, lower: NDArray[np.float64], upper: NDArray[np.float64], name: str
) -> None:
    """Draw the range of each octave as a grey box with its nominal value."""
    octave_boxes(axes, lower, upper, f"Tolerance, {name}")
    for place, nominal in enumerate((lower + upper) / 2):
        line = [place - 0.4, place + 0.4]
        label = "Nominal" if place == 0 else None
        axes.plot(line, [nominal, nominal], color="0.45", linewidth=0.8, label=label)


def _draw_shell() -> Figure:
    """Draw both forces of the model of the paper."""
    floor = solve()
    elastic = replace(floor, case=replace(floor.case, levels=Levels(force="elastic")))
    return levels({"paper": elastic, "force plate": floor})


def _draw_models() -> Figure:
    """Draw the model of the paper, its improvement, and the finite elements."""
    impacts = {
        "hollow sphere": solve(),
        "modal ball": solve(model="modal_ball"),
        # The ends of the band of inputs/studies/law_of_loss.toml.
        **{
            f"finite elements, order {order:g}": solve(
                Ball.standard(),
                model="finite_element",
                viscosity="fractional",
                fractional_order=order,
                loss_factor=loss_factor,
            )
            for order, loss_factor in ((0.15, 0.1305), (1.0, 0.2041))
        },
    }
    return levels(impacts)


def _draw_tyres() -> Figure:
    """Draw the tyre as one mass and as belt and rim."""
    tyre, drop = Ball(mass=7.3), Drop(0.85)
    impacts = {
        "one mass": solve(tyre, drop, "hunt_crossley", contact_time=0.02, restitution=0.8),
        "two masses": solve(tyre, drop, "two_mass"),
    }
    return levels(impacts, source="tyre")


def _draw_fluxes() -> Figure:
    """Draw the interpretations of the flux term of the paper."""
    choices: tuple[HollowSphereMomentumFlux, ...] = (
        "momentum_balance",
        "retarding",
        "conservative",
        "none",
    )
    impacts = {choice.replace("_", " "): solve(momentum_flux=choice) for choice in choices}
    return levels(impacts, "elastic")


IMPACT_FIGURES = {"levels": lambda impact: levels(named(impact))}
DOCUMENTATION_FIGURES = {
    "figure3_levels": _draw_shell,
    "finite_element_levels": _draw_models,
    "momentum_flux": _draw_fluxes,
    "tyre_levels": _draw_tyres,
}
