"""`thud.solve`; the stub beside this file has its calls by model."""

from thud.impact.solve_case import solve

__all__ = ["solve"]
