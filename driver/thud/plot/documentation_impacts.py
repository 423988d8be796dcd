"""Impacts that several figures of the documentation show."""

from functools import cache, lru_cache

from thud.base._schema import Ball, FiniteElementViscosity, InfinitePlate
from thud.impact.impact import Impact
from thud.impact.solve import solve


@lru_cache(maxsize=4)
def solve_published(viscosity: FiniteElementViscosity = "fractional") -> Impact:
    """Return the impact of the ball of the published modes by finite elements."""
    return solve(Ball.standard(), model="finite_element", viscosity=viscosity)


@cache
def solve_chipboard() -> Impact:
    """Return the same impact on chipboard of 22 mm, far from its joists: 1600 N s/m."""
    floor = InfinitePlate(resistance=1600.0)
    return solve(Ball.standard(), model="finite_element", floor=floor)
