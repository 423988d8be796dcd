"""Faults of records that nobody states: no wrong level or contact time without a word."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from threadpoolctl import threadpool_limits

sys.path.insert(0, str(Path(__file__).parent))
from recorder_faults import CONDITIONS, measure

# Codes of the warnings, or words of the refusal, that name the true cause, by condition.
CAUSES = {
    "packets": "jump",
    "3 ms held": "is held|constant_background",
    "zero outside": "constant_background",
    "gate": "constant_background",
    "needles": "spikes",
    "missing codes": "is held|constant_background",
    "multiplexed": "aliasing",
    "2 kHz": "noise_ends",
    "mean": "noise_ends",
    "low-pass": "noise_ends",
    "line": "filled by a line",
    "amplifier": "drop_like_bounce|restitution_impossible|restitutions_differ",
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
