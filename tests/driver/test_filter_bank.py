"""The filters against the mask of class 1 of IEC 61260-1, and levels by them."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
import pytest
from scipy.signal import butter, freqz_sos
from synthetic import half_sine

import thud
from thud.level.levels import BANDWIDTHS
from thud.recordings.filters import band_filters, filter_levels

if TYPE_CHECKING:
    from collections.abc import Callable

OCTAVE = 10**0.3
# Bands per octave.
FRACTION = {"octave": 1, "third": 3}
RATES = [8000, 11025, 16000, 22050, 25600, 44100, 48000, 51200, 96000]
# Attenuation allowed, dB, against exponents of the octave ratio (IEC 61260-1:2014, table 1).
PASS = ([0, 1 / 8, 1 / 4, 3 / 8, 1 / 2], [0.4, 0.5, 0.7, 1.4, 5.3])
STOP = ([1 / 2, 1, 2, 3, 4], [1.2, 16.6, 40.5, 60, 70])
RIPPLE = 0.4
BANDWIDTH = 0.4


def breakpoints(exponents: list[float], fraction: int) -> np.ndarray:
    """Return lg of the frequency ratios of the mask for a fraction of an octave."""
    ratio = OCTAVE ** np.array(exponents)
    narrow = (OCTAVE ** (0.5 / fraction) - 1) / (OCTAVE**0.5 - 1)
    return np.log10(1 + narrow * (ratio - 1))


def attenuation(sections: np.ndarray, frequency: np.ndarray, rate: float) -> np.ndarray:
    response = np.abs(freqz_sos(sections, frequency, fs=rate)[1])
    return -20 * np.log10(np.maximum(response, 1e-30))


def mask_margin(sections: np.ndarray, center: float, fraction: int, rate: float) -> float:
    """Return the distance to the mask, dB; negative outside."""
    highest = np.log10(0.4999999 * rate / center)
    # The mask's own corners, just inside and just outside the band edge among them.
    corners = breakpoints(PASS[0] + STOP[0], fraction)
    edge = breakpoints([0.5], fraction)[0]
    grid = np.concatenate([np.linspace(0, 2, 4001), corners, [edge - 1e-9, edge + 1e-9]])
    margins = []
    for sign in (-1, 1):
        ratio = grid[sign * grid < highest]
        found = attenuation(sections, center * 10 ** (sign * ratio), rate)
        inside = ratio < edge
        allowed = np.interp(ratio, breakpoints(PASS[0], fraction), PASS[1])
        margins.append((allowed - found)[inside].min())
        margins.append((found + RIPPLE)[inside].min())
        needed = np.interp(ratio, breakpoints(STOP[0], fraction), STOP[1])
        margins.append((found - needed)[ratio > edge].min(initial=np.inf))
    return min(margins)


def effective_bandwidth(sections: np.ndarray, lower: float, upper: float, rate: float) -> float:
    """Return the width of the ideal filter that passes as much white noise, dB over the exact."""
    ends = [0.0, lower / 4, lower / 1.3, upper * 1.3, min(upper * 4, rate / 2), rate / 2]
    width = 0.0
    for start, stop in pairwise(ends):
        frequency = np.linspace(start, min(stop, rate / 2), 4001)
        power = np.abs(freqz_sos(sections, frequency, fs=rate)[1]) ** 2
        width += float(np.trapezoid(power, frequency))
    return float(10 * np.log10(width / (upper - lower)))


def pulse(rate: float) -> np.ndarray:
    return half_sine(rate, 0.0, int(0.02 * rate) + 1)


@pytest.mark.parametrize("bands", BANDWIDTHS)
@pytest.mark.parametrize("rate", RATES)
def test_each_filter_lies_inside_the_mask_of_class_1(
    bands: str, rate: float, oracle: Callable[..., None]
) -> None:
    edges = thud.get_bands(bands)
    columns = (band_filters(bands, rate), edges.center, edges.lower, edges.upper)
    for sections, center, lower, upper in zip(*columns, strict=True):
        # Half a decibel outside the mask's least attenuation, all of it inside the pass band.
        assert mask_margin(sections, center, FRACTION[bands], rate) > RIPPLE - 1e-3
        # That of the analogue filter is (pi/6)/sin(pi/6), 0.2003 dB; the bilinear transform
        # narrows the skirts.
        width = effective_bandwidth(sections, lower, upper, rate)
        assert 0.18 < width < 0.2004
        oracle(
            "effective bandwidth of the filters (IEC 61260-1 class 1)",
            "standard",
            width,
            BANDWIDTH,
            "dB",
        )


@pytest.mark.parametrize("bands", BANDWIDTHS)
@pytest.mark.parametrize("rate", [2500, 2700, 3000, 4000, 5000])
def test_low_rates_are_filtered_inside_the_mask_too(bands: str, rate: float) -> None:
    edges = thud.get_bands(bands)
    filters = band_filters(bands, rate)
    refused = np.isnan(filters).all(axis=(1, 2))
    assert (refused == (edges.upper > rate / 4)).all()
    # Levels take the record at the next multiple of the rate, where no filter is missing.
    factor = np.ceil(4 * edges.upper[-1] / rate)
    for own, rated in ((filters, rate), (band_filters(bands, factor * rate), factor * rate)):
        for sections, center in zip(own, edges.center, strict=True):
            if not np.isnan(sections).any():
                assert mask_margin(sections, center, FRACTION[bands], rated) > 0
    assert np.isfinite(filter_levels(pulse(rate), rate, bands)).all()


def test_filter_of_order_2_or_at_a_low_rate_misses_the_mask() -> None:
    # The test itself must be able to fail.
    lower, center, upper = 1000 * 10 ** np.array([-0.45, -0.3, -0.15])
    flat = butter(2, (lower, upper), "bandpass", fs=48000, output="sos")
    assert mask_margin(flat, center, 1, 48000) == pytest.approx(-18.2, abs=0.1)
    warped = butter(3, (lower, upper), "bandpass", fs=2500, output="sos")
    assert mask_margin(warped, center, 1, 2500) == pytest.approx(-0.75, abs=0.01)


@pytest.mark.parametrize("rate", [8000.0, 96000.0, 1e6])
def test_sections_keep_their_attenuation_without_decimation(rate: float) -> None:
    for bands in BANDWIDTHS:
        edges = thud.get_bands(bands)
        for sections, lower, upper in zip(
            band_filters(bands, rate), edges.lower, edges.upper, strict=True
        ):
            frequency = np.geomspace(lower / 10, min(10 * upper, 0.49 * rate), 500)
            tangent, low, high = (np.tan(np.pi * f / rate) for f in (frequency, lower, upper))
            exact = 10 * np.log10(1 + ((tangent**2 - low * high) / (tangent * (high - low))) ** 6)
            # Zeros at 0 Hz are rounded: 1e-6 dB where less than 60 dB are lost.
            near = exact < 60
            np.testing.assert_allclose(
                attenuation(sections, frequency, rate)[near], exact[near], rtol=0, atol=2e-6
            )


@pytest.mark.parametrize("bands", BANDWIDTHS)
@pytest.mark.parametrize("rate", [1500, 2000, 2500, 3000, 8000, 96000])
@pytest.mark.slow
def test_ringing_is_padded_and_low_rates_are_interpolated(bands: str, rate: int) -> None:
    """Time domain against frequency domain: integral of abs(H F)**2."""
    force, edges = pulse(rate), thud.get_bands(bands)
    inside = edges.upper < rate / 2
    filtered = rate * max(1, int(np.ceil(4 * edges.upper[inside].max() / rate)))
    length = 2**20
    frequency = np.arange(length // 2 + 1) * rate / length
    density = 2 * np.abs(np.fft.rfft(force, length)) ** 2 / rate**2
    found = filter_levels(force, rate, bands)
    assert (np.isnan(found) == ~inside).all()
    for band in np.flatnonzero(inside):
        response = freqz_sos(band_filters(bands, filtered)[band], frequency, fs=filtered)[1]
        energy = np.sum(np.abs(response) ** 2 * density) * rate / length
        assert found[band] == pytest.approx(10 * np.log10(energy), abs=1e-5)


def test_bands_at_rates_below_them_are_not_measured() -> None:
    force = np.ones(30)
    assert np.isnan(filter_levels(force, 40.0)).all()
    assert np.isnan(filter_levels(force, 1000.0)).tolist() == [False] * 4 + [True]
