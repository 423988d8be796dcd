"""Some tries of each part of the campaign of faults; ./bootstrap faults makes all of them."""

from __future__ import annotations

from contextlib import suppress
from functools import partial
from typing import TYPE_CHECKING

import pytest
from attempts import find
from campaign import Finding, Report
from injection import can_inject
from run import parts

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

pytestmark = pytest.mark.skipif(not can_inject(), reason="there is no C compiler")


@pytest.mark.parametrize("name", [*parts()])
def test_small_campaign_finds_no_fault(name: str) -> None:
    report = Report(1)
    part = parts()[name]
    report.run(name, part.count(), part.small, partial(find, name, part))
    assert report.faults == 0, report
    assert report.counts[name].total() == part.small
    if name == "namelists":
        assert report.computed(name) > 0.2


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
