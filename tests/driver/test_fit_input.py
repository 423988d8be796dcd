"""Targets and parameters of fits that cannot be used."""

from __future__ import annotations

import numpy as np
import pytest

import thud

IMPACT = thud.solve(duration=0.03)
RECORD = IMPACT.time, IMPACT.floor_force + np.random.default_rng(1).normal(size=1323)


@pytest.mark.parametrize(
    ("target", "parameters", "options", "words"),
    [
        (RECORD, ["hardness"], {}, r"hardness is not a parameter .* allowed: outer_radius, wall"),
        (RECORD, [], {}, r"parameters: none is given; allowed: outer_radius"),
        (RECORD, {"mass": -1.0}, {}, r"mass: start = -1 is not allowed; allowed: 0 <= start"),
        (RECORD, {"mass": thud.Parameter(2.0, 3.0, 1.0)}, {}, r"mass: lower = 3 and upper = 1"),
        (RECORD, {"mass": thud.Parameter(2.0, 3.0)}, {}, r"mass: start = 2 is not allowed"),
        (RECORD, {"mass": "heavy"}, {}, r"mass: start = 'heavy' is not .* finite"),
        (RECORD, {"mass": thud.Parameter(2.5, "a")}, {}, r"mass: lower = 'a' is not allowed"),  # type: ignore[arg-type]
        (RECORD, {"mass": thud.Parameter(10**400)}, {}, r"start = a very large number is not"),
        (RECORD, {"mass": np.complex128(2)}, {}, r"mass: start = np.complex128.* finite"),
        (RECORD, 3, {}, r"parameters = 3 is not allowed; allowed: an object of Iterable"),
        (RECORD, ["mass"], {"starts": 10**13}, r"starts = 10000000000000 .* from 1 to 100000"),
        (RECORD, ["mass"], {"starts": 2, "seed": -1}, r"seed = -1 is not .* from 0 to 4294967295"),
        (RECORD, ["mass"], {"max_steps": 0}, r"max_steps = 0 is not allowed; allowed: whole"),
        (RECORD, ["mass"], {"level": 95.0}, r"level = 95.0 is not allowed; allowed: 0 < level < 1"),
        (RECORD, ["mass"], {"starts": 0}, r"starts = 0 is not allowed; allowed: whole numbers"),
        (RECORD, ["mass"], {"base": thud.Case(model=None)}, r"&model is missing"),
        (RECORD, {"height": 1e5}, {}, r"the start cannot be computed: &drop: height = 100000"),
        ((RECORD[0], RECORD[1][:-1]), ["mass"], {}, r"target cannot be used; allowed: a ForceTarg"),
        (1.0, ["mass"], {}, r"target cannot be used"),
        (
            tuple(c[:600] for c in RECORD),
            ["mass"],
            {},
            r"ends with .* allowed: a record of a whole",
        ),
        (thud.ForceTarget(RECORD, noise=0.0), ["mass"], {}, r"noise = 0.0 is not allowed"),
        (thud.ForceTarget(RECORD, below=1e5), ["mass"], {}, r"below = 100000.0 is not allowed"),
        (
            thud.ForceTarget(RECORD, window=(2, 3)),
            ["mass"],
            {},
            r"window = \(2, 3\) is not allowed",
        ),
        (thud.ForceTarget(RECORD, force="gas"), ["mass"], {}, r"force = 'gas' is not known"),
        (thud.LevelTarget([39.0] * 4), ["mass"], {}, r"levels = .* allowed: 5 real numbers"),
        (thud.LevelTarget([39.0] * 5, -1), ["mass"], {}, r"uncertainty = -1\.0 is .* above 0"),
        (thud.LevelTarget([39.0], 1, frequencies=[40]), ["mass"], {}, r"frequencies = \[40\]"),
        (thud.LevelTarget([39.0], frequencies=[63]), ["mass"], {}, r"1 data for 1 parameters are"),
        (
            thud.LevelTarget([39.0], 1.0, frequencies=[63]),
            ["mass", "height"],
            {},
            r"target: 1 data for 2 parameters are too few; allowed: 2 or more",
        ),
        (
            thud.LevelTarget([39.0] * 5, bands="half"),
            ["mass"],
            {},
            r"target: bands = 'half' is not known; allowed: 'octave', 'third'$",
        ),
        (
            thud.LevelTarget([39.0] * 5, force="gas"),
            ["mass"],
            {},
            r"target: force = 'gas' is not known; allowed: 'elastic', 'floor'$",
        ),
        (
            thud.LevelTarget([39.0] * 5, restitution=(0.8, 0.1)),
            ["mass"],
            {},
            r"uncertainty .* miss",
        ),
    ],
)
def test_bad_input_is_told(
    target: object, parameters: object, options: dict[str, object], words: str
) -> None:
    with pytest.raises(thud.ThudError, match=words):
        thud.fit(target, parameters, **options)  # type: ignore[arg-type]
