"""Figures of the paper and of the models: forces, levels, motion, floors, sets of the ball."""

from __future__ import annotations

from dataclasses import replace
from functools import cache, lru_cache
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.ticker import MaxNLocator

from thud.base._schema import (
    STANDARD_BALL,
    Ball,
    Drop,
    FiniteElement,
    InfinitePlate,
    JoistFloor,
    LaminateFloor,
    Levels,
    Plate,
)
from thud.case.case import Case
from thud.floors.impedance import ball_impedance
from thud.impact.compression import compress
from thud.impact.ensemble import solve_many
from thud.impact.free_modes import free_modes, loss_factors
from thud.impact.solve import solve
from thud.plot.ball_figures import compression, mode_shapes, motion
from thud.plot.floor_figures import ball_impedances, band_mobility, draw_floor
from thud.plot.impact_figures import force_history, levels
from thud.plot.style import (
    COLORS,
    FORCE_NAMES,
    WIDTH,
    add_curves,
    add_levels,
    curve_style,
    empty_axes,
    frequency_axis,
    legend_above,
    level_label,
    new_figure,
    own_style,
)
from thud.studies.calibrated_set import MESH, calibrated_set

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from thud.base._schema import (
        FiniteElementViscosity,
        FloorOptions,
        HollowSphereMomentumFlux,
        LevelsForce,
        ModelName,
    )
    from thud.impact.floor_impact import FloorImpact
    from thud.impact.impact import Impact


@lru_cache(maxsize=4)
def _solve_elements(viscosity: FiniteElementViscosity = "fractional") -> Impact:
    """Return the impact of the standard ball by finite elements."""
    return solve(model="finite_element", viscosity=viscosity, snapshot_interval=1e-3)


@cache
def _solve_chipboard() -> FloorImpact:
    """Return the impact of this ball on 22 mm of chipboard far from joists, 1600 N s/m."""
    model = FiniteElement(snapshot_interval=1e-3)
    impact = solve(model=model, floor=InfinitePlate(resistance=1600.0)).on_floor
    assert impact is not None  # noqa: S101 - the floor is mobile
    return impact


def _draw_heights() -> Figure:
    impacts = {
        f"{height:.2f} m": solve(drop=Drop(height), model="hollow_sphere")
        for height in (0.1, 1, 1.6)
    }
    return force_history(impacts, "elastic")


def _draw_viscosity() -> Figure:
    return force_history({"viscous": _solve_elements(), "elastic": _solve_elements("none")})


def _draw_shell() -> Figure:
    """Draw both forces of the model of the paper."""
    floor = solve(model="hollow_sphere")
    elastic = replace(floor, case=replace(floor.case, levels=Levels(force="elastic")))
    return levels({"paper": elastic, "force plate": floor})


def _draw_models() -> Figure:
    """Draw the levels of the model of the paper, the modal ball, and finite elements."""
    # The two extreme damping laws of inputs/studies/law_of_loss.toml.
    extremes = {
        f"finite elements, order {order:g}": FiniteElement(
            viscosity="fractional", fractional_order=order, loss_factor=loss_factor
        )
        for order, loss_factor in ((0.15, 0.1305), (1.0, 0.2041))
    }
    elements = {name: solve(model=model) for name, model in extremes.items()}
    return levels(
        {"hollow sphere": solve(model="hollow_sphere"), "modal ball": solve(), **elements}
    )


def _draw_tires() -> Figure:
    tire, drop = Ball(mass=7.3), Drop(0.85)
    impacts = {
        "one mass": solve(tire, drop, "hunt_crossley", contact_time=0.02, restitution=0.8),
        "two masses": solve(tire, drop, "two_mass"),
    }
    return levels(impacts, source="tyre")


def _draw_changes(impacts: dict[str, Impact], reference: Impact, force: LevelsForce) -> Figure:
    """Draw differences of the levels of a force from those of another impact."""
    figure, axes = empty_axes(2.6)
    axes.axhline(0, color="0.45", linewidth=0.8)
    nominal = reference.levels(force=force)
    add_levels(axes, {name: i.levels(force=force) - nominal for name, i in impacts.items()})
    axes.set_ylabel(level_label(FORCE_NAMES[force], "Change of the level, dB"))
    legend_above(axes)
    return figure


@own_style()
def _draw_fluxes() -> Figure:
    """Draw what the interpretations of the flux term of the paper change."""
    choices: tuple[HollowSphereMomentumFlux, ...] = (
        "momentum_balance",
        "retarding",
        "conservative",
    )
    impacts = {
        choice.replace("_", " "): solve(model="hollow_sphere", momentum_flux=choice)
        for choice in choices
    }
    return _draw_changes(impacts, solve(model="hollow_sphere", momentum_flux="none"), "elastic")


@own_style()
def _draw_families() -> Figure:
    """Draw how levels change if one family of modes at a time is quasi-static."""
    static = {f"n = {n} static": [n] for n in range(2, 7)}
    static["all static"] = list(range(50))
    impacts = {
        name: solve(model="modal_ball", static_families=families)
        for name, families in static.items()
    }
    return _draw_changes(impacts, solve(), "floor")


@own_style()
def _draw_laws() -> Figure:
    laws = {
        f"Fractional, order {order:g}": FiniteElement(
            viscosity="fractional", fractional_order=order, loss_factor=loss
        )
        for order, loss in ((0.15, 0.1305), (0.3, 0.1434), (0.5, 0.1613))
    }
    laws |= {
        "Kelvin–Voigt": FiniteElement(viscosity="kelvin_voigt", loss_factor=0.2),
        "Constant": FiniteElement(viscosity="constant_loss", loss_factor=0.13),
        "Prony series, one term": FiniteElement(
            viscosity="prony", prony_share=(0.5,), prony_time=(1.5e-3,)
        ),
    }
    figure, axes = empty_axes(2.5)
    frequency = np.geomspace(10, 1000, 200)
    add_curves(axes, {name: (frequency, loss_factors(m, frequency)) for name, m in laws.items()})
    frequency_axis(axes)
    axes.set_yscale("log")
    axes.yaxis.set_major_formatter("{x:g}")
    axes.set_ylabel("Loss factor")
    legend_above(axes)
    return figure


def _draw_compressions() -> Figure:
    """Draw the paper's ball by each model, with one modulus, undamped."""
    ball = Ball(youngs_modulus=1.6e6, poisson_ratio=0.49)
    models: dict[str, ModelName] = {"shell": "hollow_sphere", "modal ball": "modal_ball"}
    curves = {name: compress(ball, model) for name, model in models.items()}
    for gas in ("vented", "adiabatic"):
        elements = FiniteElement(viscosity="none")
        curves[f"finite elements, {gas}"] = compress(ball, elements, gas=gas)
    return compression(curves)


@own_style()
def _draw_floors() -> Figure:
    concrete = Plate(source_x=0.4, source_y=0.35)
    timber = replace(concrete, edges="absorption")
    floors: dict[str, FloorOptions] = {
        "concrete, 180 mm": concrete,
        "screed on it": replace(
            concrete, screed_thickness=0.05, screed_loss_factor=0.02,
            layer_stiffness=8e6, layer_loss_factor=0.15,
        ),
        "CLT, 160 mm": LaminateFloor(source_x=0.4, source_y=0.35),
        "timber joists": JoistFloor(
            sheathing_modulus=3.1e9, source_x=0.4, source_y=0.35
        ),
        "chipboard, 22 mm": replace(
            timber, length=2.4, width=1.8, thickness=0.022, density=650, wave_speed=2200,
            loss_factor=0.02,
        ),
    }  # fmt: skip
    figure, axes = empty_axes(2.8)
    bands = np.geomspace(12.5, 1250, 21)
    # Where the lines leave room, Hz and m/(N s).
    places = ((90, 6e-7), (160, 1.5e-5), (60, 1.0e-4), (200, 2.6e-3), (12.5, 4.5e-3))
    for i, (name, floor) in enumerate(floors.items()):
        y = band_mobility(floor, bands)
        style = curve_style(i)
        axes.loglog(bands, y, **style)
        axes.text(*places[i], name, color=style["color"])
    axes.set_ylim(3e-7, 1e-2)
    frequency_axis(axes)
    axes.set_xlabel("One-third-octave band, Hz")
    axes.set_ylabel("Mobility, m/(N s)")
    return figure


def _draw_impedances() -> Figure:
    resistance = [560.0, 1e3, 2e3, 5e3, 1e5]
    sources = {
        "ball, shell": ball_impedance(solve(model="hollow_sphere"), resistance),
        "ball, modes": ball_impedance(solve(), resistance),
        "ball, elements": ball_impedance(_solve_elements(), resistance[1:]),
    }
    floors: dict[str, FloorOptions] = {
        "chipboard on joists": JoistFloor(),
        "floating screed": Plate(screed_thickness=0.05),
        "180 mm concrete": Plate(),
    }
    return ball_impedances(sources, floors)


@own_style()
def _draw_standard_ball() -> Figure:
    """Draw the sets of the standard ball by finite elements, and the default ball as a cross."""
    sets = {
        key: np.append(values, STANDARD_BALL["finite_element", key])
        for key, values in calibrated_set("finite_element").items()
    }
    model = FiniteElement(
        radial_elements=MESH["radial_elements"], polar_elements=MESH["polar_elements"]
    )
    drops = solve_many(sets, Case(model=model))
    level = drops.floor_octave[:, -1]
    figure = new_figure(1.8 * WIDTH)
    panels = (
        ("Order of the damping law", sets["fractional_order"], "Loss factor at 74 Hz",
         sets["loss_factor"], "500 Hz level, force on the floor, dB", level),
        ("Modulus of elasticity, MPa", 1e-6 * sets["youngs_modulus"], "Contact time, ms",
         1e3 * drops.contact_time, "Coefficient of friction", sets["friction"]),
    )  # fmt: skip
    for axes, (x_label, x, y_label, y, label, color) in zip(
        figure.subplots(2), panels, strict=True
    ):
        limits = {"vmin": color.min(), "vmax": color.max()}
        points = axes.scatter(x[:-1], y[:-1], c=color[:-1], s=16, linewidths=0, **limits)
        axes.scatter(x[-1:], y[-1:], c=color[-1:], marker="X", s=60, edgecolors=COLORS[1], **limits)
        axes.set(xlabel=x_label, ylabel=y_label)
        figure.colorbar(points, ax=axes, location="top", label=label, ticks=MaxNLocator(4))
    return figure


FIGURES = {
    "figure2_force_history": _draw_heights,
    "figure3_levels": _draw_shell,
    "figure4_free_modes": lambda: mode_shapes(free_modes()),
    "figure5_motion": lambda: motion(_solve_elements()),
    "ball_impedance": _draw_impedances,
    "compression": _draw_compressions,
    "finite_element_force": _draw_viscosity,
    "finite_element_levels": _draw_models,
    "floor_chipboard": lambda: draw_floor(_solve_chipboard()),
    "floor_mobilities": _draw_floors,
    "floor_motion": lambda: motion(_solve_chipboard()),
    "loss_factor": _draw_laws,
    "modal_families": _draw_families,
    "momentum_flux": _draw_fluxes,
    "standard_ball": _draw_standard_ball,
    "tyre_levels": _draw_tires,
}
