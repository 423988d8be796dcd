"""Floors at the ends of their ranges: an answer within seconds, or a refusal by one sentence."""

from __future__ import annotations

import json
import sys
from typing import Any

from conftest import python

import thud

SINGLE: dict[str, Any] = {"layer_thickness": (0.1,)}
LARGE: dict[str, Any] = {"length": 100.0, "width": 100.0}
THIN: dict[str, Any] = {"thickness": 0.001, "wave_speed": 100.0}
# Time for all of them, s; each takes less than a second.
LIMIT = 60.0

# Name and keys of a floor; the key that the refusal names, or none for a mobility.
FLOORS: list[tuple[str, dict[str, Any], str]] = [
    ("LaminateFloor", SINGLE | {"cross_modulus": 0.0}, "cross_modulus"),
    ("LaminateFloor", SINGLE | {"cross_modulus": 1e-300}, "width"),
    ("LaminateFloor", {"cross_modulus": 0.0}, ""),
    ("LaminateFloor", {"length": 30.0, "width": 30.0, "support": "clamped"}, ""),
    ("LaminateFloor", LARGE | {"support": "clamped"}, ""),
    ("JoistFloor", {"width": 100.0, "spacing": 0.2}, ""),
    ("JoistFloor", {"width": 100.0, "spacing": 0.2, "support": "clamped"}, "width"),
    ("JoistFloor", {"width": 60.0, "spacing": 0.4, "support": "clamped"}, "width"),
    ("JoistFloor", {"width": 30.0, "spacing": 0.4, "support": "clamped"}, ""),
    ("JoistFloor", LARGE | {"joist_width": 0.005, "spacing": 0.0051}, "width"),
    ("JoistFloor", {"screed_thickness": 1e-300}, "screed_thickness"),
    ("LaminateFloor", {"screed_thickness": 1e-300}, "screed_thickness"),
    ("Plate", {"screed_thickness": 1e-300}, "screed_thickness"),
    ("Plate", {"screed_thickness": 0.0005}, ""),
    ("Plate", {"subceiling_thickness": 1e-300}, "subceiling_thickness"),
    ("Plate", LARGE | {"support": "clamped"}, ""),
    ("Plate", LARGE | {"subceiling_thickness": 0.0005}, "width"),
    ("Plate", LARGE | THIN, "width"),
    ("Plate", LARGE | THIN | {"support": "clamped"}, "width"),
    ("Plate", LARGE | {"stiffness_ratio": 1e-4, "torsion_ratio": 0.0}, ""),
]


def answer(name: str, keys: dict[str, Any]) -> str:
    """Return the sentence that refuses a floor, or nothing if it has a mobility."""
    try:
        mobility = thud.mobility(getattr(thud, name)(**keys), [31.5]).values[0]
    except thud.ThudError as error:
        return str(error)
    return "" if 0 < abs(mobility) < 1 else f"mobility {mobility}"


def test_extreme_floors_end_or_are_refused_by_one_sentence() -> None:
    # A process of its own can be ended if a loop has no bound.
    answers = json.loads(python(__file__, timeout=LIMIT).stdout)
    for (name, keys, key), said in zip(FLOORS, answers, strict=True):
        assert bool(said) == bool(key), (name, keys, said)
        assert not key or (f"{key} = " in said and "; allowed: " in said), (name, keys, said)
        assert "\n" not in said


if __name__ == "__main__":
    json.dump([answer(name, keys) for name, keys, _ in FLOORS], sys.stdout)
