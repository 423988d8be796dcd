"""Studies: many drops around one case, and what they tell."""

from __future__ import annotations

from thud.errors import InputError

try:
    from thud.studies.conformity import DesignMap, design_map
    from thud.studies.influence import Sensitivity, sensitivity
    from thud.studies.run import sweep
    from thud.studies.store import read_sweep
    from thud.studies.study import Study, read_study
    from thud.studies.tolerances import Uncertainty, uncertainty
except ModuleNotFoundError as error:
    message = f"{error.name} is not installed; allowed: studies with pip install 'thud[studies]'"
    raise InputError(message) from error

__all__ = [
    "DesignMap",
    "Sensitivity",
    "Study",
    "Uncertainty",
    "design_map",
    "read_study",
    "read_sweep",
    "sensitivity",
    "sweep",
    "uncertainty",
]
