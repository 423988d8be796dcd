"""Faults of records that nobody states: no wrong level or contact time without a word."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from threadpoolctl import threadpool_limits

sys.path.insert(0, str(Path(__file__).parent))
from recorder_faults import CONDITIONS, measure

# Words of the true cause in the warning or refusal, by condition.
CAUSES = {
    "packets": "jumps",
    "3 ms held": "held|constant",
    "zero outside": "constant",
    "gate": "constant",
    "needles": "spikes",
    "missing codes": "never occur",
    "multiplexed": "half the rate",
    "2 kHz": "noise of the background ends",
    "mean": "noise of the background ends",
    "low-pass": "noise of the background ends",
    "line": "filled by a line",
    "amplifier": "rounds the force off|impossible|differ by",
}
SEEDS = range(3)


@pytest.mark.parametrize("name", CONDITIONS)
def test_no_fault_is_silent_and_material(name: str) -> None:
    with threadpool_limits(1, "blas"):
        outcomes = [measure(name, seed) for seed in SEEDS]
    assert not any(outcome.silent for outcome in outcomes)
    causes = [words for start, words in CAUSES.items() if name.startswith(start)]
    for outcome in outcomes:
        said = " ".join((*outcome.warnings, outcome.refusal))
        assert any(word in said for words in causes for word in words.split("|")) == bool(causes)
        if name.startswith("none"):
            assert not said
