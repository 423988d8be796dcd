"""Targets and parameters of fits that cannot be used."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import naming

import thud

IMPACT = thud.solve(duration=0.03, model="hollow_sphere")
RECORD = IMPACT.time, IMPACT.floor_force + np.random.default_rng(1).normal(size=1323)


@pytest.mark.parametrize(
    ("target", "parameters", "options", "words"),
    [
        (RECORD, ["hardness"], {}, naming("[parameters]", "hardness", "outer_radius")),
        (RECORD, [], {}, naming("parameters", "outer_radius")),
        (RECORD, {"mass": -1.0}, {}, naming("mass", -1.0, 1e-12)),
        (RECORD, {"mass": thud.Parameter(2.0, 3.0, 1.0)}, {}, naming("mass", "low", 3, "high", 1)),
        (RECORD, {"mass": thud.Parameter(2.0, 3.0)}, {}, naming("mass", "start", 2)),
        (RECORD, {"mass": "heavy"}, {}, naming("mass", "start", "'heavy'")),
        (RECORD, {"mass": thud.Parameter(2.5, "a")}, {}, naming("mass", "low", "'a'")),  # type: ignore[arg-type]
        (RECORD, {"mass": thud.Parameter(10**400)}, {}, naming("mass", "start")),
        (RECORD, {"mass": np.complex128(2)}, {}, naming("mass", "start", "2+0j")),
        (RECORD, 3, {}, naming("parameters", "int")),
        (RECORD, ["mass"], {"starts": 10**13}, naming("starts", 10**13, 1, 100000)),
        (RECORD, ["mass"], {"starts": 2, "seed": -1}, naming("seed", -1, 0, 4294967295)),
        (RECORD, ["mass"], {"max_steps": 0}, naming("max_steps", 0, 1)),
        (RECORD, ["mass"], {"confidence": 95.0}, naming("confidence", 95.0, 0, 1)),
        (RECORD, ["mass"], {"starts": 0}, naming("starts", 0, 1)),
        (RECORD, ["mass"], {"case": thud.Case(model=None)}, naming("&model")),
        (RECORD, {"height": 1e5}, {}, naming("start", "&ball: youngs_modulus")),
        ((RECORD[0], RECORD[1][:-1]), ["mass"], {}, naming("target", "ForceTarget")),
        (1.0, ["mass"], {}, naming("target", "ForceTarget")),
        (tuple(c[:600] for c in RECORD), ["mass"], {}, naming("target", "record")),
        (thud.ForceTarget(RECORD, noise=0.0), ["mass"], {}, naming("noise", 0.0)),
        (thud.ForceTarget(RECORD, below=1e5), ["mass"], {}, naming("below", 100000.0)),
        (thud.ForceTarget(RECORD, window=(2, 3)), ["mass"], {}, naming("window", [2, 3], 0)),
        (thud.ForceTarget(RECORD, force="gas"), ["mass"], {}, naming("force", "'gas'", "'floor'")),
        (thud.LevelTarget([39.0] * 4), ["mass"], {}, naming("levels", 5)),
        (thud.LevelTarget([39.0] * 5, -1), ["mass"], {}, naming("uncertainty", -1.0, 0)),
        (thud.LevelTarget([39.0], 1, frequencies=[40]), ["mass"], {}, naming("frequencies", [40])),
        (thud.LevelTarget([39.0], frequencies=[63]), ["mass"], {}, naming(1, "data", "parameters")),
        (
            thud.LevelTarget([39.0], 1.0, frequencies=[63]),
            ["mass", "height"],
            {},
            naming("target", "data", 1, 2),
        ),
        (
            thud.LevelTarget([39.0] * 5, bands="half"),
            ["mass"],
            {},
            naming("target", "bands", "'half'", "'octave'", "'third'"),
        ),
        (
            thud.LevelTarget([39.0] * 5, force="gas"),
            ["mass"],
            {},
            naming("target", "force", "'gas'", "'elastic'", "'floor'"),
        ),
        (
            thud.LevelTarget([39.0] * 5, quantities={"restitution": (0.8, 0.1)}),
            ["mass"],
            {},
            naming("uncertainty"),
        ),
    ],
)
def test_bad_input_is_reported(
    target: object, parameters: object, options: dict[str, object], words: str
) -> None:
    with pytest.raises((thud.ThudError, TypeError), match=words):
        thud.fit(target, parameters, **options)  # type: ignore[arg-type]


@pytest.mark.parametrize(("cut", "whole"), [(0.0, True), (1e-4, True), (2e-4, False)])
def test_record_whose_last_millisecond_is_below_a_tenth_is_whole(
    cut: float, *, whole: bool
) -> None:
    """A half sine of 20 ms that is cut s before its end: sin(pi (s + 0.5 ms)/20 ms)."""
    time = np.arange(0, 0.04 - cut, 1e-5)
    force = np.where(time > 0.02, 1500 * np.sin(np.pi * (time - 0.02) / 0.02), 0)
    last = np.sin(np.pi * (cut + 0.5e-3) / 0.02)
    assert (last < 0.1) == whole
    target = thud.ForceTarget((time, force), noise=1.0)
    if whole:
        assert target.compare().record.time[-1] == pytest.approx(time[-1])
    else:
        with pytest.raises(thud.InputError, match=naming("target", "force", f"{last:.0%}")):
            target.compare()
