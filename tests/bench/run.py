"""Benchmarks of thud against named competitors, in one run on one thread.

Every row is the median of several runs of both sides, taken in turn, with their ratio, and states
what it requires (`requirements.py`) and whether this was met. The exit code is 1 if a requirement
was missed on an idle machine. Run with ./bootstrap bench; --page also writes docs/speed.md.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import subprocess
import sys
import sysconfig
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import scipy
from ensemble import RATE, bench_ensemble, medians, motion, zoom_transforms
from finite_elements import bench_impact, bench_modes
from requirements import assess, conclude
from room_predictions import bench_rooms
from scipy.integrate import solve_ivp

import thud

if TYPE_CHECKING:
    from scipy.signal import ZoomFFT

INPUT = Path(__file__).parents[2] / "inputs/rubber_ball_100cm.nml"
EXECUTABLE = Path(sysconfig.get_path("scripts")) / "thud"

PAGE = Path(__file__).parents[2] / "docs/speed.md"
TEXT = """# Speed

What `./bootstrap bench --page` printed: thud and what else computes the same, in turn, on one
thread. Rates are per second of processor time, for two threads of elapsed time; heyoka computes
only the motion, thud also writes 901 samples of two forces for each drop.

```
{}```
"""


class Tee(io.StringIO):
    """What is printed, kept and shown."""

    def write(self, text: str) -> int:
        """Show a text and keep it."""
        sys.__stdout__.write(text)  # type: ignore[union-attr]
        return super().write(text)


def scipy_drop() -> tuple[np.ndarray, float]:
    """Return the elastic force of the standard drop, sampled, and the contact time, by SciPy."""
    elastic, acceleration, _ = motion(
        lambda function: function, lambda v, value: value if v < 0 else 0.0
    )

    def right_hand_side(_: float, y: np.ndarray) -> tuple[float, float]:
        return y[1], acceleration(*y)

    def release(_: float, y: np.ndarray) -> float:
        return float(y[0])

    release.terminal, release.direction = True, -1  # type: ignore[attr-defined]
    found = solve_ivp(
        right_hand_side, (0, 0.05), (0, np.sqrt(19.62)), "DOP853", events=release,
        rtol=1e-9, atol=1e-11, dense_output=True, max_step=1e-3,
    )  # fmt: skip
    at = np.arange(0, found.t[-1], 1 / RATE)
    return elastic(found.sol(at)[0]), float(found.t[-1])


def zoom_levels(force: np.ndarray, transforms: list[tuple[ZoomFFT, float]]) -> np.ndarray:
    """Return the octave levels of a record with SciPy's ZoomFFT, 64 lines per band."""
    means = [width * np.mean(np.abs(transform(force)) ** 2) for transform, width in transforms]
    return 10 * np.log10(2 * np.array(means) / RATE**2)


def row(name: str, competitor: str, seconds: list[float]) -> None:
    """Print one comparison."""
    ours, theirs = seconds
    ratio = theirs / ours
    print(
        f"{name:36} {1e3 * ours:9.3f} ms   {competitor:38} {1e3 * theirs:9.3f} ms"
        f"   ratio {ratio:7.1f}   {assess(name, competitor, ms=1e3 * ours, times=ratio)}"
    )


def processor() -> str:
    """Return the name of the processor."""
    lines = Path("/proc/cpuinfo").read_text(encoding="ascii").splitlines()
    return next((line.split(":")[1].strip() for line in lines if "model name" in line), "unknown")


def main() -> int:
    """Run all benchmarks; return 1 if a requirement was missed on an idle machine."""
    print(f"thud {thud.__version__}, NumPy {np.__version__}, SciPy {scipy.__version__}")
    print(f"Processor {processor()}, one thread, medians\n")

    impact = thud.solve(model="hollow_sphere")
    force = impact.elastic_force
    contact = force[: np.flatnonzero(force)[-1] + 1]
    reference, contact_time = scipy_drop()
    worst = np.max(np.abs(contact - reference[: len(contact)]))
    print(f"Equal results: force within {worst:.1e} N of DOP853, contact time within "
          f"{abs(contact_time - impact.contact_time):.1e} s\n")  # fmt: skip

    with tempfile.TemporaryDirectory() as directory:

        def executable() -> None:
            command = [EXECUTABLE, INPUT, "--quiet", "--output", f"{directory}/out"]
            subprocess.run(command, check=True)

        def interpreter() -> None:
            subprocess.run([sys.executable, "-c", "import numpy, scipy.integrate"], check=True)

        process = medians(executable, interpreter, runs=15)
        row("thud, whole process", "python, imports of NumPy and SciPy alone", process)

    shell = medians(lambda: thud.solve(model="hollow_sphere"), scipy_drop, runs=51)
    row("thud.solve, shell", "SciPy solve_ivp, DOP853", shell)
    transforms = zoom_transforms(len(contact))
    exact = medians(
        lambda: thud.force_exposure_levels(contact, RATE),
        lambda: zoom_levels(contact, transforms),
        runs=101,
    )
    row("levels, exact, five octaves", "SciPy ZoomFFT, 64 lines per band", exact)
    print()
    bench_ensemble(scipy_drop)
    print()
    bench_modes()
    print()
    bench_impact(row)
    print()
    bench_rooms(row)
    return conclude()


parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--page", action="store_true", help="write docs/speed.md, too")
options = parser.parse_args()
with contextlib.redirect_stdout(Tee()) as said:
    code = main()
if options.page:
    PAGE.write_text(TEXT.format(said.getvalue()), encoding="utf-8")
sys.exit(code)
