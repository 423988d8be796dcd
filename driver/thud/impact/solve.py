"""`thud.solve`; the stub ``solve.pyi`` declares its keywords for each model."""

from thud.impact.compute import solve

__all__ = ["solve"]
