"""Some tries of each part of the campaign of faults; ./bootstrap faults makes all of them."""

from __future__ import annotations

from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import attempts
import pytest
from campaign import Finding, Part, Report
from injection import can_inject
from run import parts

if TYPE_CHECKING:
    from collections.abc import Iterator

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not can_inject(), reason="there is no C compiler"),
]


@pytest.mark.parametrize("name", [name for name, part in parts().items() if part.small])
def test_small_campaign_finds_no_fault(name: str) -> None:
    report = Report(1)
    part = parts()[name]
    report.run(name, part.count(), part.small, partial(attempts.find, name, part))
    assert report.faults == 0, report
    assert report.counts[name].total() == part.small
    if name == "namelists":
        assert report.computed(name) > 0.2


BAD = """
import os, sys, time
sys.path.insert(0, {folder!r})
import attempts, run
from campaign import Finding, Part

kept = []

def leave():
    open("left", "w").close()

def keep_open():
    os.remove("left")
    kept.append(open(os.devnull))

actions = [
    lambda: None, lambda: print("words", flush=True), leave, keep_open,
    lambda: b"x" * (450 * 2**20), lambda: 1 / 0, lambda: time.sleep(100), os.abort, lambda: None,
]

def check(tries, _):
    for number, _ in tries:
        actions[number]()
        yield Finding("fine")

run.parts = lambda: {{"bad": Part(len(actions), 1, check)}}
attempts.main()
"""


def test_driver_of_attempts_finds_what_goes_wrong(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    script = tmp_path / "bad.py"
    script.write_text(BAD.format(folder=str(Path(attempts.__file__).parent)))
    monkeypatch.setattr(attempts, "__file__", str(script))
    part = Part(9, 1, lambda *_: [], limit=1)
    words = [found.word for found in attempts.find("bad", part, list(range(9)))]
    assert words == [
        "fine", "raw", "left behind", "left behind", "grown", "crashed", "hung", "crashed", "fine",
    ]  # fmt: skip


def test_campaign_goes_on_where_it_ended_and_counts_faults(tmp_path: Path) -> None:
    made: list[int] = []
    stopped: list[int] = []

    def check(seeds: list[int]) -> Iterator[Finding]:
        for seed in seeds:
            if len(made) == 7 and not stopped:
                stopped.append(seed)
                raise KeyboardInterrupt
            made.append(seed)
            yield Finding("lost" if seed == 3 else "kept", "detail")

    for _ in range(2):
        report = Report(0, tmp_path / "report.json")
        with suppress(KeyboardInterrupt):
            report.run("part", 10, 10, check)
    assert stopped == [7]
    assert made == list(range(10))
    assert report.faults == 1
    assert "part 3: lost: detail" in str(report)
