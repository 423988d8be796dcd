"""Rows of the benchmarks on finite elements; competitors that are not installed are skipped."""

from __future__ import annotations

import re
import shutil
import subprocess
import tempfile
import time
from pathlib import Path
from typing import TYPE_CHECKING

import competitor_impact
import competitor_modes
import numpy as np
from requirements import assess

import thud

if TYPE_CHECKING:
    from collections.abc import Callable

# What CalculiX computes of the impact, ms: all of it takes more than a minute.
PART = 4.0
# With its symbols, which the installed executable lacks.
EXECUTABLE = Path(__file__).parents[2] / "build/src/thud"
FLAGSHIP = thud.Ball(youngs_modulus=2.08e6)


def bench_modes(row: Callable[..., None], medians: Callable[..., list[float]]) -> None:
    """Print the rows on six free modes with 8 x 64 quadratic elements."""
    ball = thud.Ball(poisson_ratio=0.4999)
    print("Free modes:", *thud.free_modes(ball).frequency.round(3), "Hz")

    def free_modes() -> None:
        thud.free_modes(ball)

    incompressible = medians(lambda: thud.free_modes(thud.Ball()), free_modes, 11)
    row("free modes, Poisson's ratio 1/2", "thud, 0.4999", incompressible)
    with tempfile.TemporaryDirectory() as directory:
        mesh = None
        try:
            mesh = competitor_modes.scikit_fem_mesh()
            competitor_modes.scikit_fem_modes(mesh)
        except (competitor_modes.CompetitorMissingError, AttributeError):
            print("scikit-fem is not installed: skipped")
        else:
            found = medians(free_modes, lambda: competitor_modes.scikit_fem_modes(mesh), 5)
            row("free modes, 0.4999", "scikit-fem, without meshing", found)
        try:
            found = medians(free_modes, lambda: competitor_modes.calculix_modes(Path(directory)), 3)
        except competitor_modes.CompetitorMissingError:
            print("CalculiX is not installed: skipped")
        else:
            row("free modes, 0.4999", "CalculiX, whole process", found)


def bench_impact(row: Callable[..., None]) -> None:
    """Print the rows on the transient impact, and what limits it."""

    def flagship() -> thud.Impact:
        return thud.solve(FLAGSHIP, model="finite_element", snapshot_interval=0)

    impact = flagship()
    motion = 1e3 * impact.model_quantities["simulated_time"]
    seconds = sorted(_time(flagship) for _ in range(5))[2]
    print(
        f"Flagship, 512 elements, {motion:.1f} ms: {seconds:.3f} s, "
        f"{1e6 * seconds / 512 / motion:.2f} us for an element and a ms"
        f"   {assess('flagship', ms=1e3 * seconds)}"
    )
    try:
        with tempfile.TemporaryDirectory() as directory:
            begin = time.perf_counter()
            reference = competitor_impact.calculix_impact(Path(directory), duration=1e-3 * PART)
            theirs = time.perf_counter() - begin
    except competitor_impact.CompetitorMissingError:
        print("CalculiX is not installed: skipped")
    else:
        impulse = np.trapezoid(reference.force, reference.time)
        elastic = competitor_impact.elastic_impact()
        begun = elastic.time < elastic.touch_time + 1e-3 * PART
        ours = elastic.floor_force[begun].sum() / elastic.sample_rate
        print(
            f"Elastic ball, impulse of the first {PART:g} ms: {ours:.3f} N s, "
            f"CalculiX {impulse:.3f} N s"
        )
        # All for one element and one millisecond.
        calculix = theirs / 320 / PART
        motion_elastic = 1e3 * elastic.model_quantities["simulated_time"]
        each = sorted(_time(competitor_impact.elastic_impact) for _ in range(5))[2] / 512
        name = "CalculiX, elastic, 0.1 ms implicit"
        row("impact, elastic, an element and a ms", name, [each / motion_elastic, calculix])
        # CalculiX has no viscoelasticity at large strain.
        row("impact, an element and a ms", name, [seconds / 512 / motion, calculix])
    _profile()


def _time(function: Callable[[], object]) -> float:
    """Return the time of one call, s."""
    begin = time.perf_counter()
    function()
    return time.perf_counter() - begin


def _profile() -> None:
    """Print which procedures the time of the flagship goes to."""
    perf = shutil.which("perf")
    if not perf or not EXECUTABLE.exists():
        print("perf or the build directory is missing: no profile")
        return
    with tempfile.TemporaryDirectory() as directory:
        case = Path(directory) / "case.nml"
        thud.write_case(
            thud.Case(ball=FLAGSHIP, model=thud.FiniteElement(snapshot_interval=0)), case
        )
        record = [perf, "record", "-q", "-o", f"{directory}/data", EXECUTABLE, case, "-q"]
        found = subprocess.run(
            [*record, "-o", f"{directory}/out"], check=False, capture_output=True
        )
        if found.returncode:
            print("perf may not count here: no profile")
            return
        report = subprocess.run(
            [perf, "report", "-i", f"{directory}/data", "--stdio", "--sort=symbol"],
            check=True, capture_output=True, text=True,
        )  # fmt: skip
    shares = re.findall(r"([\d.]+)% .*__thud_(\w+)_MOD_(\w+)", report.stdout)
    print("Its time goes to", ", ".join(f"{name} {share} %" for share, _, name in shares[:6]))
    limit = sum(float(share) for share, module, _ in shares if module == "element_row")
    print(f"Gradients and nodal forces, which stream 200 kB of shape functions: {limit:.0f} %")
