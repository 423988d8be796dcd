"""Commands that the campaign disturbs, and their inputs."""

from __future__ import annotations

import subprocess
import sys
from contextlib import suppress
from functools import cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import psutil

import thud

if TYPE_CHECKING:
    from pathlib import Path

OUT = "out"
# The older and the newer input, in directories of these names.
OLD, NEW = "old", "new"
HEIGHTS = {OLD: 0.9, NEW: 1.1}
# Samples per second of the recordings, Hz.
RATE = 6000
CASE = "&case name = 'case' / &ball / &drop height = {} / &model /"
FLOORS = {
    "thin.nml": "&ball / &drop height = {} / &model / &floor name = 'plate' / "
    "&plate thickness = 0.14 / &room volume = 40 /",
    "thick.nml": "&ball / &drop height = {} / &model / &floor name = 'plate' / "
    "&plate thickness = 0.22 / &room volume = 40 /",
}
SWEEP = """
fixed.height = {}
parameters.mass = {{low = 2.4, high = 2.6}}
design = {{kind = "random", size = 40}}
"""
FIT = """
fixed.height = {}
[target]
file = "../force.csv"
[parameters]
youngs_modulus = {{start = 2.0, low = 0.5, high = 5.0, unit = "MPa"}}
"""
# A scheduler and its workers, until the end of the input.
CLUSTER = """
import sys
from distributed import LocalCluster
with LocalCluster(n_workers=2, threads_per_worker=1, processes=True, host="127.0.0.1",
                  dashboard_address=None) as cluster:
    print(cluster.scheduler_address, flush=True)
    sys.stdin.read()
"""


class Scenario(NamedTuple):
    """A command that writes into `OUT`; "IN" in it stands for the directory of its input.

    Attributes
    ----------
    command : list of str
        The command.
    weight : int
        Its part of the random kills; 0 of what takes more than half a second.
    study : bool
        It replaces results of another input only with ``--replace``.
    """

    command: list[str]
    weight: int = 0
    study: bool = False

    def given(self, which: str, scheduler: str = "") -> list[str]:
        """Return the command with the older or the newer input, and a scheduler."""
        found = [word.replace("IN", which) for word in self.command]
        if "SCHEDULER" in found:
            found[found.index("SCHEDULER")] = scheduler or cluster().address
        return [*found, "--replace"] if self.study else found


def _driver(command: str, *words: str) -> list[str]:
    return ["thud-driver", command, *words, "-q", "-o", OUT]


def _sweep(*words: str) -> list[str]:
    return [*_driver("sweep", "IN/sweep.toml", "--no-figures"), *words]


SCENARIOS = {
    "run": Scenario(["thud", "IN/case.nml", "-q", "-o", OUT], 60),
    "sets": Scenario(["thud", "IN/case.nml", "-q", "-o", OUT, "--samples", "table.csv"], 25),
    "sweep": Scenario(_sweep("--workers", "2"), 6, study=True),
    "zarr": Scenario(_driver("sweep", "IN/zarr.toml", "--no-figures"), 2, study=True),
    "surrogate": Scenario(_driver("uncertainty", "IN/learned.toml", "--no-figures"), 1, study=True),
    "fit": Scenario(_driver("fit", "IN/fit.toml", "--no-figures"), 4, study=True),
    "measure": Scenario(_driver("measure", "IN/record.csv", "--no-figures"), 4),
    "export": Scenario(_driver("export", "IN/case.nml", "--csv"), 4),
    "dask": Scenario(_sweep("--scheduler", "SCHEDULER"), study=True),
    "processes": Scenario(_sweep("--backend", "processes", "--workers", "2"), study=True),
    "figures": Scenario(_driver("run", "IN/case.nml")),
    "report": Scenario(_driver("measure", "IN/record.csv")),
    "floors": Scenario(_driver("floor", "IN/thin.nml", "IN/thick.nml")),
}


class Cluster(NamedTuple):
    """A scheduler, its process, which restarts two workers, and its address."""

    process: psutil.Popen
    address: str

    def workers(self) -> list[psutil.Process]:
        """Return the processes that compute."""
        found = []
        for one in self.process.children():
            with suppress(psutil.NoSuchProcess):
                if "spawn_main" in " ".join(one.cmdline()):
                    found.append(one)
        return found

    def end(self) -> None:
        """End all processes."""
        with suppress(psutil.NoSuchProcess):
            for one in (*self.process.children(recursive=True), self.process):
                with suppress(psutil.NoSuchProcess):
                    one.kill()
            self.process.wait()


@cache
def cluster() -> Cluster:
    """Return a cluster that ends with this process."""
    pipe = subprocess.PIPE
    command = [sys.executable, "-c", CLUSTER]
    process = psutil.Popen(command, stdin=pipe, stdout=pipe, stderr=subprocess.DEVNULL, text=True)
    return Cluster(process, process.stdout.readline().strip())


@cache
def inputs() -> dict[str, bytes]:
    """Return the files that the commands read, by their paths."""
    impact = thud.solve()
    found = {
        "table.csv": "height\n" + "1\n" * 500,
        "force.csv": _table(impact.time, impact.floor_force, "time,force\n"),
    }
    for which, height in HEIGHTS.items():
        texts = {"case.nml": CASE, "sweep.toml": SWEEP, "fit.toml": FIT, **FLOORS}
        texts["zarr.toml"] = "format = 'zarr'\n" + SWEEP
        texts["learned.toml"] = SWEEP + "surrogate = {{size = 64, error = 1.0}}\n"
        found |= {f"{which}/{name}": text.format(height) for name, text in texts.items()}
        found[f"{which}/record.csv"] = _record(height)
    return {name: text.encode() for name, text in found.items()}


def _record(height: float) -> str:
    """Return a recording of two drops."""
    impact = thud.solve(thud.Ball(), thud.Drop(height=height))
    once = np.pad(impact.floor_force[:: round(impact.sample_rate / RATE)], (RATE // 3, RATE // 2))
    force = np.tile(once, 2)
    force += np.random.default_rng(1).normal(scale=0.5, size=force.size)
    return _table(np.arange(force.size) / RATE, force, "")


def _table(times: np.ndarray, forces: np.ndarray, head: str) -> str:
    rows = zip(times.tolist(), forces.tolist(), strict=True)
    return head + "".join(f"{time!r},{force:.3f}\n" for time, force in rows)


def make(folder: Path) -> None:
    """Write the inputs into an empty directory."""
    for name, content in inputs().items():
        path = folder / name
        path.parent.mkdir(exist_ok=True)
        path.write_bytes(content)
