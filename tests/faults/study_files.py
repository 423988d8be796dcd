"""Study and fit files by grammar and mutation: refused in a sentence, or small ones computed."""

from __future__ import annotations

import json
import re
import warnings
from copy import deepcopy
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mutate_recordings import mutated_text
from sentences import INNER, fault_of

import thud
from thud.studies.fit import FitStudy, read_fit_study, run_fit
from thud.studies.kinds import KINDS

if TYPE_CHECKING:
    import random

INPUTS = Path(__file__).parents[2] / "inputs"
CASES = [
    "rubber_ball_100cm.nml", "tyre_one_mass.nml", "tyre.nml", "rubber_ball_modal.nml",
    "rubber_ball_fe.nml", "measured_modes.nml", "floors/concrete_180.nml", "floors/joists.nml",
    "rubber_ball_modes.nml", "nowhere.nml", "studies/sweep.toml",
]  # fmt: skip
# Models whose drops take little time.
QUICK = ("hollow_sphere", "hunt_crossley", "measured_modes", "two_mass")
UNITS = [
    "mm", "m", "cm", "MPa", "kPa", "Pa", "kg", "g", "1", "", "degC", "K", "Hz", "ms", "s", "%",
    "N/m", "dB", "mmm",
]  # fmt: skip
EXAMPLES = {
    "design.toml": "design", "fit_force.toml": "fit", "fit_heights.toml": "fit",
    "fit_levels.toml": "fit", "fit_recording.toml": "fit",
    "flagship_design.toml": "design", "flagship_uncertainty.toml": "uncertainty",
    "law_of_loss.toml": "sweep", "sensitivity.toml": "sensitivity", "sweep.toml": "sweep",
    "tyre.toml": "sensitivity", "uncertainty.toml": "uncertainty",
}  # fmt: skip
KEYS = [
    "height", "wall_thickness", "mass", "youngs_modulus", "outer_radius", "poisson_ratio",
    "gravity", "loss_factor", "density", "temperature", "stiffness", "contact_time",
    "restitution", "belt_mass", "frequency(1)", "frequency", "damping_ratio(2)", "sample_rate",
    "substeps", "momentum_flux", "method", "thickness", "room.volume", "plate.thickness",
    "effective_mass(1)", "heigth", "frequency(0)", "frequency(99)", "rings",
]  # fmt: skip
ODD: list[Any] = [
    0, -1, 1e300, 1e-300, float("nan"), float("inf"), "text", "", True, [], [1, 2], {}, [[1]],
    2**70, -0.0, "nan", [float("nan")], {"value": 1}, {"value": 2, "unit": "mm"}, "é", "../x",
    "\n", 1.5, 10**30, "1e5", ["a"], {"a": {}}, 3, 100, [1] * 50,
]  # fmt: skip
# Sets of drops, and part of the small studies that are computed.
MOST, COMPUTED = 40, 0.1


def attempt(chance: random.Random) -> tuple[str, str]:
    """Return what becomes of a study, and how to see it."""
    kind, text = _study(chance)
    path = Path("study.toml")
    path.write_bytes(text.encode(errors="surrogateescape"))
    try:
        study = read_fit_study(path) if kind == "fit" else thud.read_study(path, kind)
    except thud.ThudError as error:
        path.unlink()
        wrong = fault_of(error, "study.toml", text + "nowhere")
        return ("raw", f"{wrong}: {kind}: {text!r}") if wrong else ("refused", "")
    path.unlink(missing_ok=True)
    if study.case.model.name not in QUICK or chance.random() > COMPUTED or not _is_small(study):
        return "accepted", ""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            if isinstance(study, FitStudy):
                table = run_fit(study).table()
            else:
                table = getattr(thud, kind)(study, workers=1).table()
    except thud.ThudError as error:
        inner = INNER.search(str(error))
        return ("raw", f"{error}: {text!r}") if inner or "\n" in str(error) else ("failed", "")
    if re.search(r"\bnan\b", table):
        return "not determined", ""
    return "computed", ""


def _is_small(study: thud.Study | FitStudy) -> bool:
    size = 1
    for parameter in study.parameters:
        size *= max(1, parameter.size)
    text = getattr(study, "text", "")
    given = json.loads(text) if text.startswith("{") else {}
    return size <= MOST and len(study.parameters) <= 3 and not given


@cache
def _original(name: str) -> str:
    text = (INPUTS / "studies" / name).read_text()
    return re.sub(r'"(\.\./)?([\w/]+\.(nml|csv|wav))"', _absolute, text)


def _absolute(found: re.Match[str]) -> str:
    place = INPUTS if found[1] else INPUTS / "studies"
    return f'"{place / found[2]}"'


def _study(chance: random.Random) -> tuple[str, str]:
    """Return kind and text of a study: one of the examples, damaged, or one by grammar."""
    kind = chance.choice([*KINDS, "fit"])
    if chance.random() < 0.3:
        name = chance.choice(sorted(EXAMPLES))
        return chance.choice([kind, *[EXAMPLES[name]] * 9]), mutated_text(_original(name), chance)
    study: dict[str, Any] = {
        "case": str(INPUTS / chance.choice(CASES[: chance.choice([1, 3, 3, 7, len(CASES)])]))
    }
    if chance.random() < 0.3:
        name = chance.choice(KEYS[: chance.choice([8, 8, len(KEYS)])])
        study["fixed"] = {name: SCALES.get(name, 1.0) if chance.random() < 0.7 else _value(chance)}
    if chance.random() < 0.1:
        study["fixed"] = study.get("fixed", {}) | {
            "model": chance.choice([*QUICK, "modal_ball", "finite_element", "x"])
        }
    known = KEYS[: chance.choice([4, 4, 4, 7, 7, 12, len(KEYS)])]
    chosen = chance.sample(known, chance.choice([1, 1, 2, 2, 3]))
    study["parameters"] = {name: _parameter(kind, name, chance) for name in chosen}
    if kind == "fit":
        study["target"] = _target(chance)
        if chance.random() < 0.15:
            study |= {
                chance.choice(["confidence", "starts", "seed", "max_steps"]): chance.choice(
                    [0.9, 1, 0, 3, *deepcopy(ODD)]
                )
            }
    elif chance.random() < 0.9:
        study["design"] = _design(kind, chance)
    if "temperature" in study["parameters"] and chance.random() < 0.8:
        study["temperature"] = {"reference": 20, "coefficient": -0.01}
    while chance.random() < 0.2:
        _damage(study, chance)
    text = _toml(study)
    return kind, mutated_text(text, chance) if chance.random() < 0.05 else text


def _odd(chance: random.Random) -> object:
    """Return an odd value; a copy, which may be damaged further."""
    return deepcopy(chance.choice(ODD))


def _value(chance: random.Random) -> object:
    value = chance.choice([0.03, 1.0, 2.5, 1.6e6, 0.089, 0.1, 10])
    return chance.choice(
        [value, value, {"value": value, "unit": chance.choice(UNITS)}, _odd(chance)]
    )


SCALES = {
    "height": 1.0, "wall_thickness": 0.03, "mass": 2.5, "youngs_modulus": 1.6e6,
    "outer_radius": 0.09, "poisson_ratio": 0.4, "gravity": 9.81, "density": 1200.0,
    "temperature": 20.0,
}  # fmt: skip


def _parameter(kind: str, name: str, chance: random.Random) -> dict[str, Any]:
    middle = SCALES.get(name, 1.0) * chance.choice([*[1] * 12, 1.1, 0.5, 1000, 1e-3])
    low, high = middle * 0.95, middle * 1.05
    forms: list[dict[str, Any]] = [
        {"low": low, "high": high},
        {"std": middle / 100},
        {"values": [low, middle, high]},
    ]
    usual = {"sweep": 2, "design": 0, "sensitivity": 0, "uncertainty": 1}
    found = forms[usual.get(kind, 0)] if chance.random() < 0.8 else chance.choice(forms)
    if kind == "fit":
        found = {"start": middle, "low": low, "high": high}
    elif "low" in found and (kind == "design" or chance.random() < 0.3):
        found["count"] = chance.choice([1, 2, 3, 4])
        if chance.random() < 0.1:
            found["scale"] = chance.choice(["log", "linear", "ln"])
    if chance.random() < 0.1:
        found["unit"] = chance.choice(UNITS)
    if chance.random() < 0.05:
        found[chance.choice([*found, "mean", "std", "values", "what"])] = _odd(chance)
    return found


def _design(kind: str, chance: random.Random) -> dict[str, Any]:
    if kind in ("sensitivity", "uncertainty"):
        return {"size": chance.choice([1, 2, 4, 8, 16]), "seed": chance.choice([0, 1, 2])}
    named = (
        "grid"
        if kind == "design"
        else chance.choice(["grid", "list", "random", "latin_hypercube", "sobol", "x"])
    )
    drawn = {} if named in ("grid", "list") else {"size": chance.choice([1, 2, 4, 8]), "seed": 1}
    return {"kind": named, **drawn}


def _target(chance: random.Random) -> object:
    levels: dict[str, Any] = {
        "levels": [39.2, 32.48, 22.09, 15.77, 11.14], "uncertainty": [0.2, 0.2, 0.3, 0.4, 0.5],
        "bands": "octave",
        "contact_time": {"value": 19.09, "uncertainty": 0.1, "unit": "ms"},
        "restitution": {"value": 0.81, "uncertainty": 0.01},
    }  # fmt: skip
    force = {"file": str(INPUTS / "studies/fit_force.csv"), "force": "floor"}
    found = chance.choice(
        [
            *[levels] * 6,
            force,
            force | {"noise": 5.0},
            force | {"window": [0.0, 0.06], "below": 1250.0},
        ]
    )
    if chance.random() < 0.2:
        found[chance.choice([*found, "drop", "gain", "hum", "config", "weight", "fixed"])] = _odd(
            chance
        )
    return [found, dict(found)] if chance.random() < 0.1 else found


def _damage(table: dict[str, Any], chance: random.Random) -> None:
    """Change, remove or add one entry of a table, or of one in it."""
    while True:
        inner = [value for value in table.values() if isinstance(value, dict) and value]
        if not inner or chance.random() < 0.3:
            break
        table = chance.choice(inner)
    name = chance.choice([*table, "name", "kind", "what", "unit", "fixed"])
    if chance.random() < 0.3:
        table.pop(name, None)
    else:
        table[name] = _odd(chance)


def _toml(table: dict[str, Any]) -> str:
    """Return tables as TOML; tables in tables stand in one line."""

    def text(value: object) -> str:
        if isinstance(value, dict):
            return (
                "{"
                + ", ".join(f"{json.dumps(key)} = {text(one)}" for key, one in value.items())
                + "}"
            )
        if isinstance(value, list):
            return "[" + ", ".join(map(text, value)) + "]"
        return (
            json.dumps(value, ensure_ascii=False).replace("NaN", "nan").replace("Infinity", "inf")
        )

    return "".join(f"{json.dumps(key)} = {text(value)}\n" for key, value in table.items())
