"""Alternatives to a case: assumptions about its source that a force history cannot confirm.

Each unknown is a list of alternatives. The differences of force that they make are
directions in which the model may be wrong, by about as much as the alternatives are.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from thud.base._schema import FiniteElement, InfinitePlate, ModalBall
from thud.base.checks import refuse_unknown, refuse_value, shown
from thud.case.keys import with_values
from thud.studies.unknowns import ORDER_RANGE

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Mapping

    from thud.case.case import Case

# Orders of the damping laws of rubber, and one between them.
ORDERS = (ORDER_RANGE[0], sum(ORDER_RANGE) / 2, ORDER_RANGE[1])
_FRACTIONAL = [{"fractional_order": order} for order in ORDERS]
# Driving-point resistance of a slab, N s/m: concrete of 75 mm. A force plate stands on more.
RESISTANCE = 1e5


_OTHER_FRICTION = {"none": "stick", "stick": "none"}
# Laws of viscosity that may be another one: prony states its relaxation times.
_LAWS = ("kelvin_voigt", "fractional", "constant_loss")
# Values of keys that a case may have instead of its own, by model and unknown. Shell and lumped
# models have none: they are farther from a force than these alternatives are from each other.
_ALTERNATIVES: dict[type, dict[str, Callable[[Any], list[dict[str, object]]]]] = {
    ModalBall: {
        "damping law": lambda _: [{"damping_law": "fractional", **e} for e in _FRACTIONAL],
        "friction": lambda m: [{"floor_friction": _OTHER_FRICTION[m.floor_friction]}],
        "gravity": lambda m: [{"contact_gravity": not m.contact_gravity}],
        "floor": lambda _: [{"resistance": RESISTANCE}],
    },
    FiniteElement: {
        "damping law": lambda m: [
            {"viscosity": "fractional", **e} for e in _FRACTIONAL if m.viscosity in _LAWS
        ],
        "friction": lambda m: [{"friction": 0.0 if m.friction else 1.0}],
        "floor": lambda _: [{"resistance": RESISTANCE}],
    },
}
UNKNOWNS = tuple(_ALTERNATIVES[ModalBall])
# Keys that, if they are fitted, take the place of an unknown.
_FITTED = {"fractional_order": "damping law", "friction": "friction"}


# Standard deviations of the unknowns of a press and of rubber in it: of offset, drift over the
# curve and friction over the maximum force, of the relative softening at the last point.
PRESS_UNKNOWNS: Mapping[str, float] = {
    "offset": 0.01,
    "drift": 0.01,
    "friction": 0.005,
    "softening": 0.05,
}


def require_unknowns(unknowns: object, known: Collection[str]) -> None:
    """Raise InputError where unknowns are not a list of known names."""
    if not isinstance(unknowns, list | tuple):
        refuse_value("unknowns", unknowns, f"a list of {', '.join(known)}")
    refuse_unknown("unknowns", unknowns, known)


def alternatives(
    case: Case, unknowns: Collection[str], fitted: Collection[str]
) -> list[tuple[str, str, Case]]:
    """Return unknown, label and case of each alternative to a case, if some keys are fitted."""
    known = {_FITTED[name] for name in fitted if name in _FITTED}
    rigid = replace(case, floor=None, room=None)
    on_plate = replace(rigid, floor=InfinitePlate())
    return [
        (
            name,
            " and ".join(f"{key} {shown(value)}" for key, value in values.items()),
            with_values(on_plate if name == "floor" else rigid, values),
        )
        for name, values_of in _ALTERNATIVES.get(type(case.model), {}).items()
        if name in unknowns and name not in known
        for values in values_of(case.model)
    ]
