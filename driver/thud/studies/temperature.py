"""Effect of the temperature of the ball on its rubber, with constants from the user."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from thud.base.checks import refuse, refuse_unknown, refuse_value
from thud.case.keys import TEMPERATURE
from thud.studies.parameter import read_value

if TYPE_CHECKING:
    from thud.case.case import Case
    from thud.studies.arrays import Array
    from thud.studies.parameter import Parameter

# Keys of the damping law, and the orders of laws other than the fractional one.
_LAW_KEYS = ("viscosity", "damping_law")
_ORDERS = {"kelvin_voigt": 1.0, "rising": 1.0}


@dataclass(frozen=True)
class Temperature:
    """Modulus of elasticity and shift of the loss factor as functions of the temperature T.

    The modulus E becomes E (1 + coefficient (T - reference)) at every frequency. With `c1` and `c2`
    the material at T and a frequency f behaves as at `reference` and a f, where log10 a =
    -c1 (T - reference)/(c2 + T - reference) (Williams, Landel and Ferry 1955).

    Attributes
    ----------
    reference : float
        Temperature at which the keys of the case hold, degC.
    coefficient : float
        Coefficient of the modulus, 1/K.
    c1, c2 : float
        Constants of the shift, 1 and K; by default there is none.
    """

    reference: float
    coefficient: float = 0.0
    c1: float = 0.0
    c2: float = math.inf

    @property
    def keys(self) -> tuple[str, ...]:
        """Keys that depend on the temperature."""
        return ("youngs_modulus", "loss_factor") if self.c1 else ("youngs_modulus",)

    def shift(self, temperature: Array) -> Array:
        """Return the factor a of the frequency; NaN where c2 + T - reference <= 0."""
        above = np.asarray(temperature, dtype=float) - self.reference
        with np.errstate(all="ignore"):
            power = np.where(self.c2 + above > 0, -self.c1 * above / (self.c2 + above), np.nan)
            return np.asarray(10.0**power)

    def apply(self, case: Case, samples: dict[str, Any]) -> dict[str, Any]:
        """Return samples with the values of keys at their ``temperature``, shape (n_sample,).

        Modulus and loss factor are those at the `loss_frequency` of the case: the complex modulus
        of the fractional law changes by the factor 1 + p (cos + i sin) (a**order - 1) with cos and
        sin of pi order/2, and p = loss factor/sin.
        """
        result = dict(samples)
        temperature = result.pop(TEMPERATURE.name)
        standard = case.resolved()
        values = {**vars(standard.ball), **vars(standard.model), **result}
        above = temperature - self.reference
        modulus = values["youngs_modulus"] * (1 + self.coefficient * above)
        if self.c1:
            order = _ORDERS.get(_loss_law(case), values["fractional_order"])
            angle = np.pi / 2 * order
            springpot = values["loss_factor"] / np.sin(angle) * self.shift(temperature) ** order
            storage = 1 - values["loss_factor"] / np.tan(angle) + springpot * np.cos(angle)
            modulus = modulus * storage
            result["loss_factor"] = springpot * np.sin(angle) / storage
        return {**result, "youngs_modulus": modulus}


def _loss_law(case: Case) -> str:
    options = vars(case.model)
    return next((options[key] for key in _LAW_KEYS if key in options), "none")


def read_temperature(table: object, case: Case, parameters: tuple[Parameter, ...]) -> Temperature:
    """Return the law of the table ``[temperature]``, which a parameter of this name needs."""
    names = {parameter.name for parameter in parameters}
    if TEMPERATURE.name not in names or not isinstance(table, Mapping):
        refuse(
            "temperature needs both a parameter and the table [temperature]",
            "reference, degC, and coefficient, 1/K, or c1 and c2, K, in [temperature]",
        )
    shifts = bool({"c1", "c2"} & table.keys())
    refuse_unknown("[temperature]", table, ("reference", "coefficient", "c1", "c2"))
    for word in ("reference", "c1", "c2") if shifts else ("reference", "coefficient"):
        if word not in table:
            refuse(f"[temperature] has no {word}", "reference with coefficient, or with c1 and c2")
    numbers = {
        word: float(read_value(f"[temperature] {word}", TEMPERATURE, value, 0))
        for word, value in table.items()
    }
    for word in ("c1", "c2"):
        if numbers.get(word, 1.0) <= 0:
            refuse_value(f"[temperature] {word}", table[word], f"0 < {word}")
    law = _loss_law(case)
    if shifts and (varied := names & {*_LAW_KEYS}):
        refuse(f"[temperature] c1 is not allowed if {min(varied)} varies", "it in [fixed]")
    if shifts and law not in {"fractional", *_ORDERS}:
        refuse(
            f"[temperature] c1 cannot shift the loss of {case.model.name} ({law})",  # type: ignore[union-attr]
            "viscosity = 'fractional' or 'kelvin_voigt' of finite_element, damping_law = "
            "'fractional' or 'rising' of modal_ball",
        )
    return Temperature(**numbers)
