"""Fits: parameters of a model from a force history or from levels.

>>> import thud
>>> truth = thud.solve(thud.Ball(youngs_modulus=1.8e6))
>>> found = thud.fit(truth, ["youngs_modulus"])
>>> round(found.values["youngs_modulus"])
1800000
"""

from thud.fitting.answer import Fit
from thud.fitting.force_target import ForceTarget
from thud.fitting.level_target import LevelTarget, release
from thud.fitting.parameters import Parameter, known_parameters, with_values
from thud.fitting.search import fit
from thud.fitting.study import read_study, run

__all__ = [
    "Fit",
    "ForceTarget",
    "LevelTarget",
    "Parameter",
    "fit",
    "known_parameters",
    "read_study",
    "release",
    "run",
    "with_values",
]
