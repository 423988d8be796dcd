"""Some attempts of each part of the campaign of faults; ./bootstrap faults makes more of them."""

from __future__ import annotations

from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import campaign
import numpy as np
import pytest
from campaign import FAULTS, find, parts
from edges import get_fault

import thud

FEW = {"namelists": 40, "recordings": 80, "lumped": 40, "studies": 30}


@pytest.mark.parametrize(
    ("name", "count"),
    [
        *FEW.items(),
        *(pytest.param(n, p.small, marks=pytest.mark.slow, id=n) for n, p in parts().items()),
    ],
)
def test_campaign_finds_no_fault(name: str, count: int) -> None:
    found = list(find(name, range(1_000_000, 1_000_000 + count)))
    assert [one for one in found if one[1] in FAULTS] == []
    words = Counter(word for _, word, _ in found)
    assert len(found) == count
    # Some of them get beyond a refusal.
    assert words["refused"] + words["stopped"] < count, words
    if name == "namelists":
        assert words["computed"] > 0.02 * count, words


BAD = """
import os, sys, tempfile, time
sys.path.insert(0, {folder!r})
import campaign

kept = []
actions = [
    lambda: None, lambda: print("words", flush=True), tempfile.mkstemp,
    lambda: kept.append(open(os.devnull)), lambda: b"x" * (450 * 2**20), lambda: 1 / 0,
    lambda: time.sleep(100), os.abort, lambda: None,
]

def attempt(chance):
    actions.pop(0)()
    return "fine", ""

campaign.PATIENCE = 1
actions = actions[9 - len(eval(sys.argv[-1])):]
campaign.work("bad", campaign.Part(attempt, 9, 9, limit=1), eval(sys.argv[-1]))
"""


@pytest.mark.slow
def test_campaign_finds_what_goes_wrong(tmp_path: Path) -> None:
    script = tmp_path / "bad.py"
    script.write_text(BAD.format(folder=str(Path(campaign.__file__).parent)))
    found = list(find("bad", range(9), str(script)))
    assert [seed for seed, *_ in found] == list(range(9))
    assert [word for _, word, _ in found] == [
        "fine", "raw", "left", "left", "grown", "crashed", "crashed", "crashed", "fine",
    ]  # fmt: skip
    assert "Timeout" in found[6][2]


@pytest.mark.parametrize(
    ("values", "law"),
    [
        ({"restitution": 1.01}, "restitution"),
        ({"impulse": 20.0}, "impulse is the change of momentum"),
        ({"energy_residual": 1e-5}, "balances close"),
        ({"peak_force": 1.0}, "no sample exceeds the peak"),
        ({"contact_time": 0.0}, "contact lasts"),
    ],
)
def test_broken_laws_are_found(values: dict[str, Any], law: str) -> None:
    shell = thud.solve(model="hollow_sphere")
    assert get_fault(shell) == ""
    assert law in get_fault(replace(shell, **values))


def test_calls_in_threads_return_what_they_do_alone() -> None:
    plate, room = thud.Plate(thickness=0.2), thud.Room(volume=40.0)
    impact = thud.solve(model="hollow_sphere")
    target = thud.CompressionTarget(*(getattr(thud.compress(), n) for n in ("deflection", "force")))
    mesh: Any = {"radial_elements": 2, "polar_elements": 8}
    calls = (
        lambda: thud.solve(model="finite_element", **mesh).floor_force,
        lambda: thud.solve(floor=thud.Oscillator()).on_floor.floor_velocity,  # type: ignore[union-attr]
        lambda: thud.solve_many({"height": [0.5, 1.0, 1.5]}, threads=2).floor_octave,
        lambda: thud.free_modes(count=2).frequency,
        lambda: thud.mobility(plate, [25.0, 100.0]).values,
        lambda: thud.predict_level(impact, plate, room).level,
        lambda: thud.fit(target, ["youngs_modulus"]).values["youngs_modulus"],
        lambda: thud.get_bands("third").nominal,
    )
    alone = [call() for call in calls]

    def differs(k: int) -> Any:  # noqa: ANN401
        return None if np.array_equal(calls[k](), alone[k]) else k

    with ThreadPoolExecutor(8) as threads:
        assert {*threads.map(differs, 4 * list(range(len(calls))))} == {None}
