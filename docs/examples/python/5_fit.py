"""Fit a model."""

import thud

# %% fit, Fit
measured = thud.solve(thud.Ball(youngs_modulus=1.8e6))
found = thud.fit(measured, ["youngs_modulus"])
print(found)

# %% ForceTarget
measured = thud.solve(thud.Ball(youngs_modulus=1.8e6))
target = thud.ForceTarget((measured.time, measured.floor_force), noise=5.0)
print(thud.fit(target, ["youngs_modulus"]))

# %% LevelTarget
target = thud.LevelTarget(levels=[39.0, 31.0, 23.0, 17.0, 12.5], uncertainty=0.5)
print(thud.fit(target, ["youngs_modulus", "loss_factor"]))

# %% CompressionTarget
curve = thud.compress(thud.Ball(youngs_modulus=1.8e6))
target = thud.CompressionTarget(curve.deflection, curve.force)
print(thud.fit(target, ["youngs_modulus"]))
