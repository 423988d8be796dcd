"""Ensembles against named competitors; each is skipped where it is not installed."""

from __future__ import annotations

import os
import re
import statistics
import subprocess
import sys
import tempfile
import time
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from requirements import assess
from scipy.signal import ZoomFFT

import thud

if TYPE_CHECKING:
    from collections.abc import Callable

solve_shells = partial(thud.solve_many, model="hollow_sphere")
RATE = 44100
SETS = 32_768
STREAMED = int(os.environ.get("THUD_BENCH_STREAMED", "500000"))

RADIUS, MASS, P_A, GAMMA = 0.089, 2.5, 101325.0, 1.4
STIFFNESS = 8 * 1.6e6 * 0.032**2 / (RADIUS * 3)


def heights(count: int) -> np.ndarray:
    """Return heights of drop, m."""
    return np.linspace(0.9, 1.1, count)


def medians(
    *functions: Callable[[], object], runs: int, clock: Callable[[], float] = time.perf_counter
) -> list[float]:
    """Return the median times of functions, s, run in turn after one run to warm up."""
    times: list[list[float]] = [[] for _ in functions]
    for i in range(runs + 1):
        for side, function in zip(times, functions, strict=True):
            start = clock()
            function()
            if i > 0:
                side.append(clock() - start)
    return [statistics.median(side) for side in times]


def best(
    function: Callable[[], object], runs: int = 5, clock: Callable[[], float] = time.process_time
) -> float:
    """Return the median time of the processor, which other users of the machine do not stretch."""
    return medians(function, runs=runs, clock=clock)[0]


def motion(compiled: Any, in_restitution: Any) -> tuple[Any, Any, Any]:  # noqa: ANN401 - of a library
    """Return elastic force, acceleration and a step of RK4 of the shell, compiled by a library.

    `in_restitution(v, value)` is its choice of the value where v < 0, of zero elsewhere.
    """

    def elastic(d: Any) -> Any:  # noqa: ANN401
        ratio = 1 - d**2 * (3 * RADIUS - d) / (4 * RADIUS**3)
        return STIFFNESS * d + P_A * (ratio**-GAMMA - 1) * np.pi * d * (2 * RADIUS - d)

    elastic = compiled(elastic)

    def rate(d: Any, v: Any) -> Any:  # noqa: ANN401
        flux = in_restitution(v, MASS / (2 * RADIUS)) * v * v
        return (flux - elastic(d)) / (MASS * (1 - d / (2 * RADIUS)))

    rate = compiled(rate)

    def step(d: Any, v: Any) -> Any:  # noqa: ANN401
        h = 1 / RATE
        k1 = rate(d, v)
        v2 = v + h / 2 * k1
        k2 = rate(d + h / 2 * v, v2)
        v3 = v + h / 2 * k2
        k3 = rate(d + h / 2 * v2, v3)
        v4 = v + h * k3
        k4 = rate(d + h * v3, v4)
        return d + h / 6 * (v + 2 * (v2 + v3) + v4), v + h / 6 * (k1 + 2 * (k2 + k3) + k4)

    return elastic, rate, compiled(step)


def heyoka_rate(count: int = 2048) -> float | None:
    """Return trajectories per second of heyoka's batch mode, all lanes run to their release."""
    try:
        import heyoka as hy
    except ImportError:
        return None
    lanes = hy.recommended_simd_size()
    d, v = hy.make_vars("d", "v")
    rate = motion(lambda function: function, lambda *_: hy.par[0] * MASS / (2 * RADIUS))[1]
    system = [(d, v), (v, rate(d, v))]

    def turn(ta: Any, _: int, lane: int) -> bool:  # noqa: ANN401
        ta.pars[0, lane] = 1.0
        return True

    falling = hy.event_direction.negative
    integrator = hy.taylor_adaptive_batch(
        system, np.zeros((2, lanes)), pars=np.zeros((1, lanes)),
        t_events=[hy.t_event_batch(v, callback=turn, direction=falling),
                  hy.t_event_batch(d, direction=falling)],
    )  # fmt: skip
    speeds = np.sqrt(2 * 9.81 * heights(count)).reshape(-1, lanes)

    def run() -> float:
        for speed in speeds:
            integrator.set_time(0.0)
            integrator.pars[:] = 0.0
            integrator.state[0] = 0.0
            integrator.state[1] = speed
            integrator.reset_cooldowns()
            until = np.full(lanes, 0.05)
            while True:
                # The call returns when any lane stops; those that are done stay where they are.
                integrator.propagate_until(until)
                done = [result[0] == hy.taylor_outcome(-2) for result in integrator.propagate_res]
                until[done] = integrator.time[done]
                if (until < 0.05).all():
                    break
        return float(integrator.time[-1])

    expected = solve_shells({"height": heights(count)}).contact_time[-1]
    print(f"  (heyoka's contact time differs by {abs(run() - expected):.1e} s)")
    return count / best(run)


def zoom_transforms(size: int) -> list[tuple[ZoomFFT, float]]:
    """Return SciPy's transforms of the octaves for records of a size, and their widths, Hz."""
    bands = thud.get_bands()
    return [
        (ZoomFFT(size, [lower, upper], 64, fs=RATE), upper - lower)
        for lower, upper in zip(bands.lower, bands.upper, strict=True)
    ]


def numba_rate(count: int = 200) -> float | None:
    """Return complete cases per second of a scalar RK4 by numba with SciPy's ZoomFFT levels."""
    try:
        import numba
    except ImportError:
        return None
    compiled = numba.njit(fastmath=True)
    elastic, _, step = motion(compiled, compiled(lambda v, value: value if v < 0 else 0.0))

    @compiled  # type: ignore[untyped-decorator]
    def drop(height: float, force: np.ndarray) -> int:
        d, v = 0.0, np.sqrt(19.62 * height)
        for i in range(len(force)):
            force[i] = elastic(d)
            d, v = step(d, v)
            if d <= 0:
                return i + 1
        return len(force)

    transforms, force = zoom_transforms(1102), np.zeros(1102)

    def run() -> None:
        for height in heights(count):
            force[:] = 0
            drop(height, force)
            for transform, width in transforms:
                np.mean(np.abs(transform(force)) ** 2) * width

    return count / best(run)


def zoom_rate(count: int = 200) -> float:
    """Return records per second whose five levels SciPy's ZoomFFT computes, 64 lines per band."""
    records = np.random.default_rng(1).normal(size=(count, 905))
    transforms = zoom_transforms(905)
    return count / best(lambda: [np.abs(transform(records)) ** 2 for transform, _ in transforms])


def jax_rate(count: int = 4096) -> float | None:
    """Return trajectories per second of a vectorised RK4 by JAX, a fixed number of steps."""
    try:
        import jax
        import jax.numpy as jnp
    except ImportError:
        return None
    jax.config.update("jax_enable_x64", True)  # noqa: FBT003 - JAX's own way
    step = motion(lambda function: function, lambda v, value: jnp.where(v < 0, value, 0.0))[2]

    @jax.jit
    def march(v: Any) -> Any:  # noqa: ANN401
        start = jnp.zeros_like(v), v
        return jax.lax.scan(lambda state, _: (step(*state),) * 2, start, None, length=905)[1][0]

    speed = jnp.sqrt(19.62 * heights(count))
    return count / best(lambda: march(speed).block_until_ready())


def stream(count: int, path: Path, chunk: int = 50_000) -> None:
    """Compute random sets, write outcomes and levels to disk, print duration, s, and peak, MiB."""
    random = np.random.default_rng(1)
    start = time.perf_counter()
    with path.open("wb") as file:
        for first in range(0, count, chunk):
            n = min(chunk, count - first)
            found = solve_shells({
                "height": random.uniform(0.9, 1.1, n),
                "youngs_modulus": random.uniform(1.4e6, 1.8e6, n),
                "wall_thickness": random.uniform(0.030, 0.034, n),
            }, threads=1)  # fmt: skip
            rows = found.contact_time, found.peak_elastic_force, found.restitution
            np.column_stack([*rows, found.elastic_octave]).tofile(file)
    print(time.perf_counter() - start, peak_memory())


def peak_memory() -> float:
    """Return the peak memory of this process, MiB.

    ru_maxrss is not used: Linux hands it down from the process that started this one.
    """
    status = Path("/proc/self/status").read_text(encoding="ascii")
    return int(re.search(r"VmHWM:\s*(\d+) kB", status)[1]) / 1024  # type: ignore[index]


def report(name: str, ours: float, competitor: str, theirs: float | None) -> None:
    """Print one comparison of rates."""
    ratio = {} if theirs is None else {"times": ours / theirs}
    other = "not installed" if theirs is None else f"{theirs:9,.0f}/s   ratio {ours / theirs:7.1f}"
    required = assess(name, competitor, rate=ours, **ratio)
    print(f"{name:36} {ours:9,.0f}/s   {competitor:38} {other}   {required}")


def bench_ensemble(scipy_drop: Callable[[], object]) -> None:
    """Print all comparisons."""
    drops = {"height": heights(SETS)}

    def run(
        threads: int = 1, clock: Callable[[], float] = time.process_time, *, levels: bool = True
    ) -> float:
        return best(lambda: solve_shells(drops, threads=threads, levels=levels), 7, clock)

    bare, whole = run(levels=False), run()
    name = "ensemble, trajectories"
    report(name, SETS / bare, "heyoka, batch mode", heyoka_rate())
    report(name, SETS / bare, "JAX, RK4, float64", jax_rate())
    report(name, SETS / bare, "SciPy DOP853", 1 / best(scipy_drop, 11))
    name = "ensemble, five levels and verdict"
    report(name, SETS / whole, "numba RK4, SciPy ZoomFFT levels", numba_rate())
    name, levels = "levels alone (by difference)", 2 * SETS / (whole - bare)
    report(name, levels, "SciPy ZoomFFT, 64 lines per band", zoom_rate())
    one, two = (SETS / run(threads, clock=time.perf_counter) for threads in (1, 2))
    report("ensemble, two threads", two, "one thread", one)
    with tempfile.TemporaryDirectory() as directory:
        command = [sys.executable, __file__, "stream", str(STREAMED), f"{directory}/sets"]
        done = subprocess.run(command, check=True, capture_output=True, text=True)
    seconds, peak = map(float, done.stdout.split())
    print(f"streamed to disk: {STREAMED:,} random sets, {STREAMED / seconds:,.0f}/s, "
          f"peak memory {peak:.0f} MiB   {assess('streamed to disk', MiB=peak)}")  # fmt: skip


if __name__ == "__main__" and sys.argv[1:2] == ["stream"]:
    stream(int(sys.argv[2]), Path(sys.argv[3]))
