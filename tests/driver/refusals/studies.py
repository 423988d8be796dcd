"""What the calls of `studies.toml` use."""

from __future__ import annotations

import shlex
import subprocess
import sysconfig
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np
from refusals.core import write

import thud
from thud.studies.calibrated_set import assess as calibrated
from thud.studies.fit import read_fit_study, run_fit
from thud.studies.run import evaluate

if TYPE_CHECKING:
    from numpy.typing import NDArray

# What is only imported for the table.
__all__ = ["ThreadPoolExecutor", "calibrated", "evaluate", "read_fit_study"]

SHELL = "&ball / &drop / &model name = 'hollow_sphere' /"
CONTACT_TIME = "contact_time = {value = 20, uncertainty = 1, unit = 'm'}"
# Deflections of a press, m.
FIVE = [0, 1e-3, 2e-3, 3e-3, 4e-3]
LARGE = {"low": 1, "high": 2, "count": 257}
HEIGHTS = {"parameters": {"height": {"values": [0.5, 1.0]}}}


def study(tables: str | bytes, varied: str = "height.values = [1]") -> thud.Study:
    """Read the file of a study with varied parameters."""
    head = tables if isinstance(tables, bytes) else tables.encode()
    entry = f"parameters = {varied}" if varied.startswith("{") else f"parameters.{varied}"
    return thud.read_study(write("study.toml", head + b"\n" + entry.encode()))


def heated(law: str, model: str = "modal_ball", more: str = "") -> thud.Study:
    """Read the file of a study in which the temperature varies."""
    tables = f"fixed.model = {model!r}\ntemperature = {{{law}}}"
    return study(tables, f"temperature.values = [1]\n{more and f'parameters.{more}'}")


def many(parameters: Any = None, **options: Any) -> thud.Ensemble:  # noqa: ANN401
    """Solve samples."""
    return thud.solve_many({} if parameters is None else parameters, **options)


def samples(table: str = "height\n1\n", case: str = SHELL, arguments: str = "") -> NoReturn:
    """Run the executable with a table of samples that is refused; raise what it says."""
    write("table.csv", table)
    write("ball.nml", case)
    executable = Path(sysconfig.get_path("scripts")) / "thud"
    command = [executable, "ball.nml", *shlex.split(arguments or "--samples table.csv")]
    result = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert result.returncode == 1
    assert not Path("outputs/ball_samples").exists()
    raise thud.InputError(result.stderr.splitlines()[0] if arguments else result.stderr.strip())


def record() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return time and force of a drop, with noise and 0.1 s of quiet on both sides."""
    impact = thud.solve(model="hollow_sphere", duration=0.03)
    force = np.pad(impact.floor_force, 4410)
    force += np.random.default_rng(1).normal(size=len(force))
    return np.arange(len(force)) / impact.sample_rate, force


def fitted(parameters: Any = ("mass",), target: Any = None, **options: Any) -> thud.Fit:  # noqa: ANN401
    """Fit to a target, by default the record with options of a target."""
    own = {name: options.pop(name) for name in vars(thud.ForceTarget) if name in options}
    own |= {name: options.pop(name) for name in ("gain", "noise", "fixed") if name in options}
    case = options.pop("case", thud.Case(model=thud.HollowSphere()))
    target = thud.ForceTarget(record(), **own) if target is None else target
    return thud.fit(target, parameters, case, **options)


def fit_study(
    target: str = "file = 'record.csv'",
    more: str = "",
    *,
    head: str = "",
    parameters: str = "youngs_modulus = {}",
) -> thud.Fit:
    """Run the file of a fit to a record."""
    np.savetxt("record.csv", np.column_stack(record()), delimiter=",")
    write("record.wav", b"RIFF")
    case = "case.model.name = 'hollow_sphere'" if "case" not in head else ""
    tables = target if "[[" in target else f"[target]\n{target}\n{more}"
    text = f"{case}\n{head}\n{tables}\n[parameters]\n{parameters}"
    return run_fit(str(write("study.toml", text)))


def joint(second: str) -> thud.Fit:
    """Run the file of a fit to two records, of which the second has keys."""
    target = "[[target]]\nfile = 'record.csv'\n"
    return fit_study(f"{target}fixed.height = 1\n{target}{second}", parameters="mass = {}")


def wide_record() -> thud.Fit:
    """Fit to a record with too many values below the greatest frequency."""
    time = np.arange(100_000) / 1e4
    return fitted(
        window=(0.0, 10.0),
        target=thud.ForceTarget((time, np.exp(-((time - 5) ** 2) / 1e-5)), window=(0.0, 10.0)),
    )


def pressed(deflection: Any, force: Any, **options: Any) -> thud.Fit:  # noqa: ANN401
    """Fit to a curve of a press."""
    values = list(force) if isinstance(force, range) else force
    return thud.fit(thud.CompressionTarget(deflection, values, **options), ["youngs_modulus"])


def unknown(model: Any = None, **change: Any) -> object:  # noqa: ANN401
    """Assess the ball with unknowns."""
    unknowns = {"key": ("friction", "fractional_order"), "low": (0.0, 0.2), "high": (0.5, 1.0),
                "reason": ("it is dry", "not measured")} | change  # fmt: skip
    model = model or thud.FiniteElement(radial_elements=2, polar_elements=16)
    return calibrated(thud.Case(model=model, unknowns=thud.Unknowns(**unknowns)))


def unknown_text(key: str) -> thud.Case:
    """Read the keys of unknowns from a namelist."""
    text = f"&unknowns key = {key} / &model name = 'finite_element' /"
    return thud.read_case(write("case.nml", text))


def learned(**change: Any) -> thud.Surrogate:  # noqa: ANN401
    """Train a surrogate."""
    tables = {"design": {"size": 64}, "fixed": {"model": "modal_ball"}}
    tables |= {name: change.pop(name) for name in tables if name in change}
    return thud.surrogate({**tables, "parameters": change or {"height": {"low": 1, "high": 2}}})
