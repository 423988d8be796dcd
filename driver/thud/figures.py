"""The figures of the paper, and those of the documentation."""

from __future__ import annotations

from typing import TYPE_CHECKING

import thud

if TYPE_CHECKING:
    from collections.abc import Callable

    from matplotlib.figure import Figure

# The modulus of the paper's published modes.
PUBLISHED = thud.Ball(youngs_modulus=2.08e6)


def get_figures() -> dict[str, Callable[[], Figure]]:
    """Return the figures by their names, each as a function that computes and draws it."""
    return {
        "figure2_force_history": _draw_heights,
        "figure3_levels": lambda: thud.plot.levels({"hollow sphere": thud.solve()}),
        "figure4_free_modes": lambda: thud.mesh_plot.mode_shapes(thud.free_modes(PUBLISHED)),
        "figure5_motion": lambda: thud.mesh_plot.motion(_solve_published()),
        "finite_element_force": lambda: thud.plot.force_history(
            {"viscous": _solve_published(), "elastic": _solve_published(viscosity="none")}, "floor"
        ),
        "finite_element_levels": _draw_models,
        "loss_factor": _draw_loss_factors,
        "modal_families": _draw_families,
        "momentum_flux": _draw_fluxes,
    }


def _solve_published(viscosity: str = "kelvin_voigt") -> thud.Impact:
    """Return the impact of the ball of the published modes by finite elements."""
    return thud.solve(PUBLISHED, model="finite_element", viscosity=viscosity)


def _draw_heights() -> Figure:
    """Draw the three heights of the paper."""
    heights = {f"{height:.2f} m": height for height in (0.1, 1.0, 1.6)}
    figure: Figure = thud.plot.force_history(
        {name: thud.solve(drop=thud.Drop(height)) for name, height in heights.items()}
    )
    return figure


def _draw_fluxes() -> Figure:
    """Draw the readings of the paper's flux term."""
    choices = ("momentum_balance", "retarding", "conservative", "none")
    figure: Figure = thud.plot.levels(
        {choice: thud.solve(momentum_flux=choice) for choice in choices}, "elastic"
    )
    return figure


def _draw_models() -> Figure:
    """Draw what the paper had, its improvement, and the finite elements."""
    impacts = {
        "hollow sphere": thud.solve(),
        "modal ball": thud.solve(model="modal_ball"),
        "finite elements": _solve_published(),
    }
    figure: Figure = thud.plot.levels(impacts, "floor")
    return figure


def _draw_loss_factors() -> Figure:
    """Draw the laws of viscosity."""
    laws = {
        "Kelvin-Voigt": thud.FiniteElement(),
        "Prony series, constant": thud.FiniteElement(viscosity="constant_loss"),
        "Prony series, one term": thud.FiniteElement(
            viscosity="prony", prony_share=(0.5,), prony_time=(1.5e-3,)
        ),
    }
    figure: Figure = thud.mesh_plot.loss_factor(laws)
    return figure


def _draw_families() -> Figure:
    """Draw which modes carry which octave: families that answer statically, one at a time."""
    shown = range(2, 7)
    still = {f"n = {n} static": thud.solve(model="modal_ball", static_families=[n]) for n in shown}
    every = list(range(thud.ModalBall.harmonics + 1))
    still["all static"] = thud.solve(model="modal_ball", static_families=every)
    figure: Figure = thud.plot.level_changes(thud.solve(model="modal_ball"), still)
    return figure
