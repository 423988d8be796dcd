"""The impact that several figures of the documentation show."""

from functools import cache

from thud._schema import Ball
from thud.impact import Impact, solve


@cache
def solve_published(viscosity: str = "fractional") -> Impact:
    """Return the impact of the ball of the published modes by finite elements."""
    return solve(Ball.standard(), model="finite_element", viscosity=viscosity)
