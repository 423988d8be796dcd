"""Runs with little memory: they end with results, or with one sentence."""

from __future__ import annotations

import os
import resource
import shutil
import subprocess
from typing import TYPE_CHECKING

from campaign import Finding
from injection import PATIENCE, executable

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path

    from campaign import Tries

HEAD = "&ball / &drop / "
CASES = {
    "hollow_sphere": HEAD + "&model /",
    "two_mass": HEAD + "&model name = 'two_mass' /",
    "modal_ball": HEAD + "&model name = 'modal_ball' /",
    "finite_element": HEAD + "&model name = 'finite_element' / &mesh polar_elements = 16 /",
    "snapshots": HEAD + "&model name = 'finite_element' / &mesh polar_elements = 16 / "
    "&output snapshot_interval = 1e-4 /",
    "modes": "&ball / &mesh radial_elements = 8 polar_elements = 256 / &modes count = 20 /",
    "long": HEAD + "&model / &sampling sample_rate = 1e6, duration = 1 /",
    "sets": HEAD + "&model /",
}
# Below this, bytes, OpenBLAS ends the process before it begins, with a message of its own.
LOADED = 80e6


def check_memory(tries: Tries, folder: Path) -> Iterable[Finding]:
    """Run a case with an address space of 50 to 1000 MB."""
    for _, chance in tries:
        name = chance.choice(list(CASES))
        limit = int(50e6 * 20 ** chance.random())
        shutil.rmtree(folder / "memory", ignore_errors=True)
        (folder / "memory").mkdir()
        (folder / "memory/case.nml").write_text(CASES[name])
        (folder / "memory/table.csv").write_text("height\n" + "1\n" * 1000)
        command = [executable(), "case.nml", "-q", "-o", "o"]
        if name == "sets":
            command += ["--sets", "table.csv", "--threads", str(chance.randint(1, 4))]
        detail = f"{name} with {limit} bytes"
        done = subprocess.run(
            command,
            cwd=folder / "memory",
            env={key: value for key, value in os.environ.items() if "THREADS" not in key},
            preexec_fn=lambda limit=limit: resource.setrlimit(  # type: ignore[misc]
                resource.RLIMIT_AS, (limit, limit)
            ),
            capture_output=True,
            text=True,
            timeout=PATIENCE,
            check=False,
        )
        yield Finding(_word(done, limit), f"{detail}: {done.returncode}, {done.stderr[:300]}")


def _word(done: subprocess.CompletedProcess[str], limit: int) -> str:
    if done.returncode == 0:
        return "computed"
    if done.returncode == 2 and "bytes" in done.stderr and done.stderr.count("\n") == 1:
        return "refused"
    # The loader of libraries ends with 127.
    foreign = "OpenBLAS" in done.stderr or done.returncode == 127
    return "not loaded" if foreign and limit < LOADED else "crashed"
