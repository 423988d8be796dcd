"""Rows of the benchmarks on finite elements; competitors that are not installed are skipped."""

from __future__ import annotations

import tempfile
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING

import calculix
import numpy as np
from ensemble import best
from requirements import assess

import thud

if TYPE_CHECKING:
    from collections.abc import Callable

# What CalculiX computes of the impact, ms: all of it takes more than a minute.
PART = 4.0
FLAGSHIP = thud.Ball(youngs_modulus=2.08e6)


def bench_modes() -> None:
    """Print the time of six free modes."""
    for ratio in (0.5, 0.4999):
        ball = thud.Ball(poisson_ratio=ratio)
        seconds = best(lambda ball=ball: thud.free_modes(ball))
        needed = assess("free modes", ms=1e3 * seconds)
        print(f"Six free modes, Poisson's ratio {ratio}: {1e3 * seconds:.2f} ms   {needed}")


def bench_impact(row: Callable[..., None]) -> None:
    """Print the rows on the transient impact."""

    def flagship() -> thud.Impact:
        return thud.solve(FLAGSHIP, model="finite_element", snapshot_interval=0)

    quantities = flagship().model_quantities
    motion = 1e3 * quantities["simulated_time"]
    steps = quantities["simulated_time"] / quantities["minimum_step"]
    seconds = best(flagship)
    print(
        f"Flagship, 512 elements, {motion:.1f} ms: {seconds:.3f} s, "
        f"{1e9 * seconds / 512 / steps:.0f} ns for an element and a step"
        f"   {assess('flagship', ms=1e3 * seconds)}"
    )
    try:
        with tempfile.TemporaryDirectory() as directory:
            begin = perf_counter()
            time, force = calculix.calculix_impact(Path(directory), duration=1e-3 * PART)
            theirs = perf_counter() - begin
    except calculix.CompetitorMissingError:
        print("CalculiX is not installed: skipped")
    else:
        impulse = np.trapezoid(force, time)
        elastic = calculix.elastic_impact()
        begun = elastic.time < elastic.touch_time + 1e-3 * PART
        ours = elastic.floor_force[begun].sum() / elastic.sample_rate
        print(
            f"Elastic ball, impulse of the first {PART:g} ms: {ours:.3f} N s, "
            f"CalculiX {impulse:.3f} N s"
        )
        # All for one element and one millisecond.
        implicit = theirs / 320 / PART
        motion_elastic = 1e3 * elastic.model_quantities["simulated_time"]
        each = best(calculix.elastic_impact) / 512
        name = "CalculiX, elastic, 0.1 ms implicit"
        row("impact, elastic, an element and a ms", name, [each / motion_elastic, implicit])
