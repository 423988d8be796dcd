"""Keys at the ends of their ranges: a finite result or one sentence, unless it takes long."""

from __future__ import annotations

import json
import random
import signal
import subprocess
import sys
import warnings
from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import thud
from thud.base._schema import FLOORS, KEYS, MODELS
from thud.case.case import Case
from thud.case.keys import limits

if TYPE_CHECKING:
    from collections.abc import Iterator

    from thud.base.key import Key

    Tables = dict[str, dict[str, Any]]
    Corner = tuple[str, str, Any]

# Time of the process in which a case ends, s, and its steps from which on it may take longer, as
# elements may at any number of them.
DEADLINE, MANY_STEPS = 20.0, 1e6
# Ends of an open range.
SMALLEST, LARGEST = 1e-300, 1e300
# What has keys, with the model and the floor of its cases.
OWNERS: dict[str, Tables] = {
    **{name: {"model": {"name": name}} for name in MODELS},
    **{name: {"model": {"name": "hollow_sphere"}, "floor": {"name": name}} for name in FLOORS},
    "room": {"model": {"name": "hollow_sphere"}, "floor": {"name": "plate"}, "room": {}},
}


def ends_of(key: Key, case: Case) -> tuple[Any, ...]:
    """Return the values of a key at the ends of its range, or its choices."""
    if key.kind == "flag":
        return False, True
    if key.kind not in {"real", "whole", "list"}:
        return key.choices
    low, high = limits(key, case)
    ends = {max(low, -LARGEST), min(high, LARGEST)}
    if key.whole:
        return tuple(map(int, ends))
    # Also within an open range.
    ends |= {SMALLEST} if low == 0 else set()
    ends |= {0.999 * high} if isinstance(key.upper, str) else set()
    if key.kind != "list":
        return tuple(sorted(ends))
    options = case.room if key.group == "room" else case.floor or case.model
    count = max(1, len(getattr(options, key.name)))
    return tuple([end] * count for end in sorted(ends))


def corners_of(owner: str) -> list[Corner]:
    """Return group, key and value of each end of the keys of an owner, and of every impact."""
    case = Case.from_namelist(OWNERS[owner])
    common = {""} if owner in MODELS else set()
    return [
        (key.group, key.name, end)
        for key in KEYS
        if key.owner in {owner} | common and key.name != "name"
        for end in ends_of(key, case)
    ]


def case_of(owner: str, *corners: Corner) -> Tables:
    """Return the tables of a case with keys at their ends."""
    tables = {group: dict(keys) for group, keys in OWNERS[owner].items()}
    for group, key, end in corners:
        tables.setdefault(group, {})[key] = end
    return tables


def pairs_of(owner: str, count: int, draw: random.Random) -> list[Tables]:
    """Return cases with two keys at their ends, half of the floors' with a room."""
    pairs = [p for p in combinations(corners_of(owner), 2) if p[0][:2] != p[1][:2]]
    cases = [case_of(owner, *pair) for pair in draw.sample(pairs, min(count, len(pairs)))]
    for case in cases[::2] if owner in FLOORS else ():
        case["room"] = {}
    return cases


def answer(tables: Tables) -> str:
    """Return what is wrong with the answer to a case, or nothing."""
    try:
        case = Case.from_namelist(tables)
        sampling = case.sampling
        if sampling.duration * sampling.sample_rate * sampling.substeps > MANY_STEPS:
            return ""
        impact = thud.solve(case)
        drops = [impact, impact.on_floor] if impact.on_floor else [impact]
        numbers = [array for drop in drops for array in (drop.floor_force, drop.levels())]
        if case.room:
            numbers.append(np.array(thud.predict_level(impact).rating.level))
    except thud.ThudError as error:
        return f"sentence {error}" if "\n" in str(error) or not str(error) else ""
    return "" if all(np.isfinite(array).all() for array in numbers) else "not finite"


def faults_of(cases: list[Tables]) -> Iterator[str]:
    """Yield what is wrong with each case, in processes that the deadline of a case ends."""
    rest = iter(cases)
    case = next(rest, None)
    while case is not None:
        worker = subprocess.Popen(
            [sys.executable, __file__], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        with worker:
            assert worker.stdin
            assert worker.stdout
            said = "\n"
            while case is not None and said:
                worker.stdin.write(json.dumps(case) + "\n")
                worker.stdin.flush()
                said = worker.stdout.readline()
                may_take_long = case["model"]["name"] == "finite_element"
                fault = said.strip() or ("" if said or may_take_long else "no answer")
                if fault:
                    yield f"{case}: {fault}"
                case = next(rest, None)


@pytest.mark.slow
def test_corners_end_or_are_refused() -> None:
    draw = random.Random(1)  # noqa: S311 - draws cases
    cases = [case for owner in OWNERS for case in pairs_of(owner, 4, draw)]
    for owner in OWNERS:
        corners = corners_of(owner)
        cases += [case_of(owner, corner) for corner in draw.sample(corners, len(corners) // 12)]
    assert not list(faults_of(cases))


def main() -> None:
    """Answer cases of standard input."""
    warnings.simplefilter("ignore")
    for line in sys.stdin:
        signal.setitimer(signal.ITIMER_PROF, DEADLINE)
        sys.stdout.write(answer(json.loads(line)) + "\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main()
