"""The room stepped in time against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from modal_room_reference import (
    AIR_DENSITY,
    REFERENCE_PRESSURE,
    SOUND_SPEED,
    detect_fast,
    filter_band,
    get_band_response,
    get_maximum_levels,
    get_plate_velocity,
    get_pressure,
    get_room_modes,
    modal_rate,
)
from scipy.integrate import quad

RATE = 4096.0
SIZE = (4.0, 3.0, 2.5)


def test_modes_of_a_box_have_their_closed_form() -> None:
    orders, frequency = get_room_modes(SIZE, 100.0)
    assert orders[:4].tolist() == [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
    assert frequency[1:4] == pytest.approx(SOUND_SPEED / 2 / np.array(SIZE))
    # Weyl's number with the terms of surfaces and edges (Maa 1939).
    count = len(get_room_modes(SIZE, 700.0)[1])
    volume, surface, edges = 30.0, 59.0, 38.0
    ratio = 700 / SOUND_SPEED
    weyl = 4 * np.pi / 3 * volume * ratio**3 + np.pi / 4 * surface * ratio**2 + edges / 8 * ratio
    assert count == pytest.approx(weyl, rel=0.01)


@pytest.mark.parametrize("omega", [0.0, 300.0])
def test_step_of_a_mode_is_exact_for_linear_pieces(omega: float) -> None:
    """From rest, of a ramp that begins at 1."""
    decay, time = 12.0, np.arange(400) / RATE
    found = modal_rate(1 + 5 * time, omega, decay, RATE)
    if omega:
        damped = math.sqrt(omega**2 - decay**2)
        wave = np.exp(-decay * time) * np.sin(damped * time)
        other = np.exp(-decay * time) * np.cos(damped * time)
        expected = wave / damped + 5 / omega**2 * (1 - other - decay / damped * wave)
    else:
        rate = 2 * decay
        grown = 1 - np.exp(-rate * time)
        expected = grown / rate + 5 * (time - grown / rate) / rate
    assert found == pytest.approx(expected, rel=1e-9, abs=1e-12)


def test_mode_steps_of_a_force_are_those_of_its_transform() -> None:
    """The spectrum of the velocity is force times i w drive/(w0**2 - w**2 + i w w0 eta)."""
    count = 8192
    time = np.arange(count) / RATE
    force = np.where(time < 0.01, np.sin(np.pi * time / 0.01) ** 2, 0.0)
    velocity = get_plate_velocity(force, RATE, [40.0, 90.0], [0.1, 0.2], [0.01, -0.02])
    frequency = np.fft.rfftfreq(count, 1 / RATE)
    near = (frequency > 20) & (frequency < 120)
    omega, own = 2 * np.pi * frequency[near], 2 * np.pi * np.array([[40.0], [90.0]])
    dynamic = own**2 - omega**2 + 1j * omega * own * np.array([[0.1], [0.2]])
    expected = 1j * omega * np.fft.rfft(force)[near] * np.array([[0.01], [-0.02]]) / dynamic
    found = np.fft.rfft(velocity, axis=0)[near].T
    # Linear pieces of the force: sinc(f/rate)**2 is 1 - 0.3 % at 120 Hz.
    assert abs(found - expected).max() < 3e-3 * abs(expected).max()


def test_piston_in_a_tube_has_the_closed_form() -> None:
    """Waves of p_tt + 2 d p_t = c**2 p_zz above a floor, driven by a ceiling that moves as one."""
    frequency, height, rate, reverberation = 120.0, 2.5, 16384.0, 0.25
    time = np.arange(int(0.6 * rate)) / rate
    omega, decay = 2 * np.pi * frequency, 3 * np.log(10) / reverberation
    z = np.array([0.0, 0.8, 1.9])
    microphones = np.stack([0 * z + 0.01, 0 * z + 0.02, z], 1)
    pressure = get_pressure(
        np.sin(omega * time)[:, None], np.ones((1, 4, 4)), rate, (0.05, 0.05, height),
        microphones, reverberation, maximum=3400.0,
    )  # fmt: skip
    # The velocity into the room is downwards: rho v_t = p_z at the ceiling.
    wave = np.sqrt(omega**2 - 2j * decay * omega) / SOUND_SPEED
    amplitude = -1j * omega * AIR_DENSITY / (wave * np.sin(wave * height)) * np.cos(wave * z)
    expected = (amplitude * np.exp(1j * omega * time[:, None])).imag
    late = time > 0.5
    # Modes above 3400 Hz.
    assert abs(pressure - expected)[late].max() < 2e-3 * abs(amplitude).max()


def test_slow_plate_compresses_the_air_adiabatically() -> None:
    """Half a sine of velocity in 1 s, with hardly any loss: p = rho c**2 S u/V everywhere."""
    time = np.arange(4097) / RATE
    velocity = 1e-3 * np.pi / 2 * np.sin(np.pi * time)[:, None]
    pressure = get_pressure(
        velocity, np.ones((1, 8, 6)), RATE, SIZE, [[1, 1, 1], [3, 2, 0]], 1e6, maximum=200.0
    )
    expected = AIR_DENSITY * SOUND_SPEED**2 * 1e-3 / SIZE[2]
    assert pressure[-1] == pytest.approx(expected, rel=2e-3)


def test_bands_have_the_response_of_three_poles() -> None:
    for nominal, center in ((50, 10**1.7), (160, 10**2.2), (630, 10**2.8)):
        edges = center * 10 ** np.array([-0.05, 0.05])
        assert abs(get_band_response(center, nominal)) == pytest.approx(1)
        assert abs(get_band_response(edges, nominal)) == pytest.approx(math.sqrt(0.5))
        # Of white noise, Butterworth filters of three poles take pi/6/sin(pi/6) of their width.
        width = quad(lambda f, n=nominal: abs(get_band_response(f, n)) ** 2, 0, np.inf)[0]
        assert width == pytest.approx(np.diff(edges)[0] * math.pi / 3, rel=1e-6)
    far = np.array([0.3, 0.8, 1.3, 5.0])
    x = (far - 1 / far) / (10**0.05 - 10**-0.05)
    assert abs(get_band_response(100 * far, 100)) == pytest.approx((1 + x**6) ** -0.5, rel=1e-12)


def test_filter_and_detector_show_the_level_of_a_tone_and_of_bursts() -> None:
    time = np.arange(int(2 * RATE)) / RATE
    tone = math.sqrt(2) * REFERENCE_PRESSURE * 1000 * np.sin(2 * np.pi * 10**2.2 * time)
    assert get_maximum_levels(tone, RATE, [160])[0] == pytest.approx(60, abs=0.05)
    # IEC 61672-1 table 4: bursts of 500, 200, 50 and 20 ms read 0.1, 1.0, 4.8 and 8.3 dB less.
    fast = math.sqrt(2) * np.sin(2 * np.pi * 512 * time)
    for length, below in ((0.5, 0.1), (0.2, 1.0), (0.05, 4.8), (0.02, 8.3)):
        level = 10 * math.log10(detect_fast(np.where(time < length, fast, 0), RATE).max())
        assert level == pytest.approx(-below, abs=0.06)


def test_filter_keeps_the_energy_of_an_impulse() -> None:
    impulse = np.zeros(8192)
    impulse[10] = RATE
    energy = (filter_band(impulse, RATE, 100) ** 2).sum() / RATE
    # Twice the integral over positive frequencies.
    assert energy == pytest.approx(2 * 100 * (10**0.05 - 10**-0.05) * math.pi / 3, rel=1e-3)


def test_levels_decay_by_the_reverberation_time() -> None:
    """The 63 Hz band of a tube holds one mode, which decays slower than the detector."""
    reverberation = 6.0
    time = np.arange(int(1.6 * RATE)) / RATE
    velocity = np.where(time < 0.02, np.sin(np.pi * time / 0.02) ** 2, 0)[:, None]
    pressure = get_pressure(
        velocity, np.ones((1, 4, 4)), RATE, (0.05, 0.05, 2.5), [[0.01, 0.01, 0.2]],
        lambda frequency: np.where(frequency < 100, reverberation, 0.5), maximum=1000.0,
    )[:, 0]  # fmt: skip
    level = 10 * np.log10(detect_fast(filter_band(pressure, RATE, 63), RATE))
    early, late = (int(t * RATE) for t in (0.8, 1.4))
    assert level[early] - level[late] == pytest.approx(60 * 0.6 / reverberation, rel=0.02)


def test_overdamped_modes_are_refused() -> None:
    with pytest.raises(ValueError, match="overdamped"):
        modal_rate(np.ones(3), 10.0, 11.0, RATE)
