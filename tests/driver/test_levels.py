"""Levels of any record, and verdicts."""

from __future__ import annotations

import math
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
import xarray as xr

import thud
from thud.base._schema import LIMITS
from thud.level.assessment import Criterion, Verdict, octave_limits
from thud.level.estimate import Estimate
from thud.level.levels import RECORDED_BAND, SOURCES, low_pass, peak_count

if TYPE_CHECKING:
    from thud.base._schema import LimitsSource

PULSE = np.sin(np.pi * np.linspace(0, 1, 883))


def test_bands_are_complete_and_adjacent() -> None:
    octaves, thirds = thud.get_bands(), thud.get_bands("third")
    assert octaves.nominal.tolist() == [31.5, 63, 125, 250, 500]
    assert len(thirds.nominal) == 15
    np.testing.assert_allclose(thirds.upper[:-1], thirds.lower[1:], rtol=1e-14)
    np.testing.assert_allclose(octaves.center, np.sqrt(octaves.lower * octaves.upper), rtol=1e-14)
    # They are those of all callers.
    with pytest.raises(ValueError, match="read-only"):
        octaves.lower[0] = 0.0


def test_threads_share_plans() -> None:
    # More lengths than plans are kept, so that plans come and go while others are in use.
    records = [PULSE[:length] for length in range(40, 883, 17)] * 4

    def answer(record: np.ndarray) -> tuple[bytes, int]:
        levels = thud.force_exposure_levels(record, 44100)
        return levels.tobytes(), peak_count(record, 44100)

    alone = [answer(record) for record in records]
    with ThreadPoolExecutor(8) as pool:
        assert list(pool.map(answer, records)) == alone


def test_anything_like_an_array_is_a_record() -> None:
    expected = thud.force_exposure_levels(PULSE, 44100)
    assert expected.shape == (5,)
    assert (thud.force_exposure_levels(PULSE.tolist(), 44100.0) == expected).all()
    assert (thud.force_exposure_levels(np.repeat(PULSE, 2)[::2], 44100) == expected).all()
    integers = np.round(1000 * PULSE).astype(np.int16)
    np.testing.assert_allclose(
        thud.force_exposure_levels(integers, 44100) - 60, expected, atol=0.05
    )


def test_silence_between_bands_has_the_level_of_rounding() -> None:
    # A slow, smooth pulse: nothing but rounding is left at 500 Hz, yet the level is a number.
    slow = np.hanning(44101) ** 4
    levels = thud.force_exposure_levels(slow, 44100)
    total = 10 * np.log10(np.sum(slow**2) / 44100)
    assert np.isfinite(levels).all()
    assert levels[-1] < total - 140


def test_nominal_tyre_conforms() -> None:
    assert thud.assess_levels([47, 40, 22, 11.5, 5.5], 0.02, 0.8, 1, 7.3, 0.85, source="tyre")
    assert not thud.assess_levels([47, 40, 22, 11.5, 5.5], 0.02, 0.8, 2, 7.3, 0.85, source="tyre")
    levels = xr.DataArray([47, 40, 22, 11.5, 5.5])
    assert thud.assess_levels(levels, 0.02, 0.8, 1, 7.3, 0.85, source="tyre")


def criteria_of(source: LimitsSource, **changes: float) -> thud.Verdict:
    """Return the verdict on a source in the middle of all its limits but for some changes."""
    value = {name: (lower + upper) / 2 for name, _, lower, upper in LIMITS[source]} | changes
    values = [*value.values()]
    values[7] = int(values[7])
    return thud.assess_levels(values[:5], *values[5:], source)


@pytest.mark.parametrize("source", SOURCES)
def test_each_criterion_has_its_own_value_and_limits(source: LimitsSource) -> None:
    verdict = criteria_of(source)
    assert verdict
    assert verdict.source == source
    for place, one in enumerate(verdict.criteria):
        step = 1.0 if one.name == "peak_count" else 1e-9
        for end, beyond in ((one.lower, one.lower - step), (one.upper, one.upper + step)):
            for value in (end, beyond):
                if value < 0:
                    continue
                found = criteria_of(source, **{one.name: value})
                assert found.criteria[place].value == pytest.approx(value, abs=1e-12)
                # Limits are allowed values.
                expected = [other is not one or value == end for other in verdict.criteria]
                assert list(map(bool, found.criteria)) == expected


def test_limits_of_octaves_are_those_of_the_verdict() -> None:
    # JIS A 1418-2, table of the rubber ball.
    lower, upper = octave_limits("rubber_ball")
    assert lower.tolist() == [38, 29.5, 21.5, 15, 10.5]
    assert upper.tolist() == [40, 32.5, 24.5, 19, 14.5]


def test_verdict_is_undecided_if_all_known_criteria_conform() -> None:
    good = Criterion("octave_31_5", Estimate(39.0, unit="dB"), 38.0, 40.0)
    low, high, unknown = (
        replace(good, name=f"octave_{value}", estimate=Estimate(value, unit="dB"))
        for value in (37.5, 40.5, math.nan)
    )
    for criteria, result in (
        ((good, good), "conforms"), ((good, low), "does not conform"),
        ((good, unknown), "undecided"), ((low, unknown), "does not conform"),
    ):  # fmt: skip
        found = Verdict("rubber_ball", criteria)
        assert found.conforms == result
        if result == "undecided":
            with pytest.raises(thud.InputError):
                bool(found)
        else:
            assert bool(found) == (result == "conforms")
        assert found.rows()[-1][-1] == result
        assert len(found.rows()) == 2 + len(criteria)
        assert [one.name in repr(found) for one in criteria] == [
            one is not good and one.conforms == result for one in criteria
        ]
    uncertain, lacking = (
        replace(good, estimate=Estimate(39.0, 0.1, "dB", not_stated=names))
        for names in ((), ("calibration",))
    )
    for one, value, width, result in (
        (good, "39.00", "", "conforms"), (uncertain, "39.00", "0.2", "conforms"),
        (lacking, "39.00", "0.2 †", "undecided"), (low, "37.50", "", "too low"),
        (high, "40.50", "", "too high"), (unknown, "", "", "undecided"),
    ):  # fmt: skip
        assert one.cells()[1:] == (value, width, "38 to 40", result)
    assert Verdict("rubber_ball", (good, lacking)).rows()[-1][2] == "† lacks calibration"


def test_recorded_force_has_what_lies_below_1250_hz() -> None:
    rate, count = 44100.0, 4410
    time = np.arange(count) / rate
    window = np.hanning(count)
    slow, fast = (window * np.sin(2 * np.pi * f * time) for f in (1100.0, 1400.0))
    found = low_pass(slow + fast, rate)
    assert found == pytest.approx(slow, abs=1e-3)
    assert RECORDED_BAND == 1250
