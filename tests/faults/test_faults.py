"""Some tries of each part of the campaign of faults; ./bootstrap faults makes all of them."""

from __future__ import annotations

import time
from contextlib import suppress
from typing import TYPE_CHECKING

import pytest
from campaign import Finding, Part, Report
from injection import can_inject
from run import parts

if TYPE_CHECKING:
    import random
    from pathlib import Path

pytestmark = pytest.mark.skipif(not can_inject(), reason="there is no C compiler")


@pytest.mark.parametrize("name", [name for name, part in parts().items() if part.small])
def test_small_campaign_finds_no_fault(name: str, tmp_path: Path) -> None:
    seed = time.time_ns()
    report = Report(seed)
    part = parts()[name]
    report.run(name, part, part.small, tmp_path, spread=True)
    assert report.faults == 0, f"seed {seed}\n{report}"
    assert report.counts[name].total() == part.small


def test_campaign_goes_on_where_it_ended_and_counts_faults(tmp_path: Path) -> None:
    made: list[int] = []
    stopped: list[int] = []

    def check(tries: list[tuple[int, random.Random]], _: Path) -> list[Finding]:
        made.extend(number for number, _ in tries)
        if len(made) == 7 and not stopped:
            stopped.append(made.pop())
            raise KeyboardInterrupt
        return [Finding("lost" if number == 3 else "kept", "detail") for number, _ in tries]

    for _ in range(2):
        report = Report(1, tmp_path / "report.json")
        with suppress(KeyboardInterrupt):
            report.run("part", Part(10, 1, check), 10, tmp_path)
    assert stopped == [6]
    assert made == list(range(10))
    assert report.faults == 1
    assert "part 3: lost: detail" in str(report)
