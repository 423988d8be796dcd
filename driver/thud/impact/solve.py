"""`thud.solve`; the stub ``solve.pyi`` declares its keywords for each model."""

from thud.impact.solve_case import solve

__all__ = ["solve"]
