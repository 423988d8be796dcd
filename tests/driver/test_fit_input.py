"""Targets and parameters of fits that cannot be used."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

import thud

if TYPE_CHECKING:
    from collections.abc import Callable

IMPACT = thud.solve(duration=0.03)
RECORD = IMPACT.time, IMPACT.floor_force + np.random.default_rng(1).normal(size=1323)


@pytest.mark.parametrize(
    ("target", "parameters", "options", "words"),
    [
        (
            RECORD,
            ["hardness"],
            {},
            r"\[parameters\] hardness is not a parameter .* allowed: outer_radius, wall",
        ),
        (RECORD, [], {}, r"parameters: none is given; allowed: outer_radius"),
        (RECORD, {"mass": -1.0}, {}, r"mass: start = -1 is not allowed; allowed: 1e-12 <= start"),
        (RECORD, {"mass": thud.Parameter(2.0, 3.0, 1.0)}, {}, r"mass: low = 3 and high = 1"),
        (RECORD, {"mass": thud.Parameter(2.0, 3.0)}, {}, r"mass: start = 2 is not allowed"),
        (RECORD, {"mass": "heavy"}, {}, r"mass: start = 'heavy' is not .* finite"),
        (RECORD, {"mass": thud.Parameter(2.5, "a")}, {}, r"mass: low = 'a' is not allowed"),  # type: ignore[arg-type]
        (RECORD, {"mass": thud.Parameter(10**400)}, {}, r"start = a very large number is not"),
        (RECORD, {"mass": np.complex128(2)}, {}, r"mass: start = np.complex128.* finite"),
        (RECORD, 3, {}, r"parameters = 3 is not allowed; allowed: an object of Iterable"),
        (RECORD, ["mass"], {"starts": 10**13}, r"starts = 10000000000000 .* from 1 to 100000"),
        (RECORD, ["mass"], {"starts": 2, "seed": -1}, r"seed = -1 is not .* from 0 to 4294967295"),
        (RECORD, ["mass"], {"max_steps": 0}, r"max_steps = 0 is not allowed; allowed: whole"),
        (RECORD, ["mass"], {"confidence": 95.0}, r"confidence = 95.0 .* allowed: 0 < confid"),
        (RECORD, ["mass"], {"starts": 0}, r"starts = 0 is not allowed; allowed: whole numbers"),
        (RECORD, ["mass"], {"case": thud.Case(model=None)}, r"&model is missing"),
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
            r"window = .2, 3. is not allowed",
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
def test_bad_input_is_reported(
    target: object, parameters: object, options: dict[str, object], words: str
) -> None:
    with pytest.raises(thud.ThudError, match=words):
        thud.fit(target, parameters, **options)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: thud.fit(RECORD, ["mass"], base=thud.Case()), r"fit\(\): 'base' is now 'case'"),
        (lambda: thud.fit(RECORD, ["mass"], level=0.9), r"fit\(\): 'level' is now 'confidence'"),
        (lambda: thud.Parameter(2.5, lower=1), r"Parameter\(\): 'lower' is now 'low'; allowed: st"),
        (lambda: thud.Parameter(2.5, upper=3), r"Parameter\(\): 'upper' is now 'high'"),
    ],
)
def test_old_words_are_answered_by_the_new_ones(call: Callable[[], object], words: str) -> None:
    with pytest.raises(thud.InputError, match=words):
        call()
