"""Loss factor of materials against frequency."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from thud.base._schema import FiniteElement
from thud.base.errors import InputError
from thud.impact.free_modes import loss_factors
from thud.impact.impact import Impact
from thud.plot.style import SIZE, add_curves, empty_axes, legend_above, own_style


@own_style()
def loss_factor(models: Mapping[str, FiniteElement]) -> Figure:
    """Draw the loss factor of materials against frequency.

    Parameters
    ----------
    models
        Models with a material by their names in the legend.

    Returns
    -------
    Figure
        Frequency in Hz and loss factor, both logarithmic.

    Raises
    ------
    InputError
        Where `models` is not a mapping of names to such models, or empty.
    """
    if not isinstance(models, Mapping) or not models:
        message = "models are not given; allowed: a mapping of names to models, at least one"
        raise InputError(message)
    figure, axes = empty_axes(2.5)
    frequency = np.geomspace(10, 1000, 200)
    add_curves(axes, {name: (frequency, loss_factors(m, frequency)) for name, m in models.items()})
    axes.set_xscale("log")
    axes.set_yscale("log")
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter("{x:g}")
    axes.set_xlabel("Frequency, Hz", fontsize=SIZE)
    axes.set_ylabel("Loss factor", fontsize=SIZE)
    legend_above(axes)
    return figure


def _draw_viscosity(impact: Impact) -> Figure | None:
    """Draw the material of a model that has a viscous one."""
    viscosity = str(impact.case.to_namelist().get("material", {}).get("viscosity", "none"))
    if viscosity == "none":
        return None
    model: Any = impact.case.model
    return loss_factor({viscosity.replace("_", " "): model})


def _draw_laws() -> Figure:
    """Draw the laws of viscosity."""
    laws = {
        **{
            f"Fractional, order {order:g}": FiniteElement(
                viscosity="fractional", fractional_order=order, loss_factor=loss
            )
            for order, loss in ((0.15, 0.1305), (0.3, 0.1434), (0.5, 0.1613))
        },
        "Kelvin–Voigt": FiniteElement(viscosity="kelvin_voigt", loss_factor=0.2),
        "Constant": FiniteElement(viscosity="constant_loss", loss_factor=0.13),
        "Prony series, one term": FiniteElement(
            viscosity="prony", prony_share=(0.5,), prony_time=(1.5e-3,)
        ),
    }
    return loss_factor(laws)


IMPACT_FIGURES = {"loss_factor": _draw_viscosity}
DOCUMENTATION_FIGURES = {"loss_factor": _draw_laws}
