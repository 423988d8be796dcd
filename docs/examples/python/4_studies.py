"""Many drops and designs."""

import numpy as np

import thud

# %% solve_many, Ensemble
heights = np.linspace(0.5, 1.5, 100)
drops = thud.solve_many({"height": heights}, thud.Case(model=thud.HollowSphere()))
print(drops)

# %% sweep, Sweep
result = thud.sweep({"height": [0.5, 1.0]})
print(result.dataset["contact_time"].values)

# %% read_sweep
thud.sweep({"height": [0.5, 1.0]}, "heights")
print(thud.read_sweep("heights/python.nc"))

# %% read_study, Study, Parameter
study = thud.read_study({"mass": thud.Parameter(low=2.4, high=2.6, count=3)})
print(thud.sweep(study))

# %% design, Design
print(thud.design({"height": [0.9, 1.0, 1.1], "mass": [2.4, 2.5, 2.6]}))

# %% sensitivity, Sensitivity
study = {
    "parameters": {"height": {"low": 0.9, "high": 1.1}, "mass": {"low": 2.4, "high": 2.6}},
    "design": {"size": 8},
}
print(thud.sensitivity(study))

# %% uncertainty, Uncertainty
study = {"parameters": {"height": {"mean": 1.0, "std": 0.01}}, "design": {"size": 16}}
print(thud.uncertainty(study))

# %% surrogate, Surrogate, read_surrogate
study = {"parameters": {"height": {"low": 0.8, "high": 1.2}}, "design": {"size": 64}}
thud.surrogate(study, "fast")
print(thud.read_surrogate("fast/python.nc"))
