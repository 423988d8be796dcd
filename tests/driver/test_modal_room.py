"""A modal room under a modal plate: frequencies, balance, an independent time integration."""

from __future__ import annotations

import itertools
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from conftest import naming

import thud
from thud.floors import modal_room as module
from thud.floors.modal_room import SAMPLE_RATE, fast_levels, plate_frequencies
from thud.plot.floor_figures import plate_modes

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

FLOOR = thud.Plate(length=4.5, width=3.7, thickness=0.16, edges="laboratory")
ROOM = thud.Room(volume=40.0, reverberation_time=0.4)
SIZE = np.array([4.5, 3.7, 40 / (4.5 * 3.7)])
BALL = np.array([1.1, 2.3])
MICROPHONE = np.array([3.1, 0.9, 1.4])


@pytest.fixture(scope="module")
def found(shell: thud.Impact) -> thud.ModalRoom:
    """Return the levels of one pair of positions."""
    return thud.modal_room(shell, FLOOR, ROOM, balls=[BALL], microphones=[MICROPHONE])


def room_modes() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return numbers and frequencies of the room's modes up to 400 Hz, one by one."""
    numbers = [np.array(n) for n in itertools.product(range(15), repeat=3)]
    pairs = [(n, 343 / 2 * float(np.linalg.norm(n / SIZE))) for n in numbers]
    kept = [pair for pair in pairs if pair[1] <= 400]
    return np.array([n for n, _ in kept]), np.array([f for _, f in kept])


def test_frequencies_are_those_of_the_closed_forms(found: thud.ModalRoom) -> None:
    assert found.room_frequency == pytest.approx(np.sort(room_modes()[1]))
    # c_L h pi/(4 sqrt(3)) ((m/a)**2 + (n/b)**2).
    unit = 3500 * 0.16 * np.pi / (4 * np.sqrt(3))
    closed = sorted(
        unit * ((m / 4.5) ** 2 + (n / 3.7) ** 2) for m in range(1, 20) for n in range(1, 20)
    )
    assert found.floor_frequency == pytest.approx([f for f in closed if f <= 400])
    assert plate_frequencies(FLOOR, (1, 1)) == pytest.approx(closed[0])


def test_orthotropic_plate_has_the_modes_that_the_source_feels() -> None:
    floor = thud.Plate(
        thickness=0.2, density=470, wave_speed=3180, stiffness_ratio=0.293, torsion_ratio=0.25,
        loss_factor=0.002, edges="absorption", source_x=0.31, source_y=0.27,
    )  # fmt: skip
    for numbers in ((1, 1), (2, 1), (1, 2)):
        natural = float(plate_frequencies(floor, numbers))
        near = natural * np.linspace(0.97, 1.03, 601)
        peak = near[np.argmax(abs(thud.mobility(floor, near)))]
        assert peak == pytest.approx(natural, rel=3e-3)


def test_energies_given_are_those_that_are_lost(
    shell: thud.Impact, oracle: Callable[..., None]
) -> None:
    found = thud.modal_room(shell, FLOOR, ROOM, balls=3, microphones=1)
    assert found.plate_energy[:, 0] == pytest.approx(found.plate_energy[:, 1], rel=1e-9)
    oracle(
        "modal room: energy given less energy lost",
        "balance",
        found.room_energy[:, 0] / found.room_energy[:, 1] - 1,
        1e-9,
    )
    assert (found.room_energy < 0.1 * found.plate_energy).all()


def test_levels_are_those_of_an_integration_in_time(
    shell: thud.Impact, found: thud.ModalRoom, oracle: Callable[..., None]
) -> None:
    """Step the modes in time, with coupling by quadrature instead of the closed form."""
    step = 1 / (8 * SAMPLE_RATE)
    count = int(1.5 / step)
    # The contact force on this floor.
    source = found.prediction.source
    assert source.peak("floor") != shell.peak("floor")
    force = np.interp(np.arange(count) * step, shell.time, source.force("floor"), right=0.0)
    modes = np.array(list(itertools.product(range(1, 20), repeat=2)))
    modes = modes[plate_frequencies(FLOOR, modes) <= 400]
    numbers, frequency = room_modes()
    omega, wave = 2 * np.pi * plate_frequencies(FLOOR, modes), 2 * np.pi * frequency
    # Laboratory: 0.005 + m''/(485 sqrt(f)).
    losses = omega * (0.005 + 2300 * 0.16 / (485 * np.sqrt(omega / (2 * np.pi))))
    decay = 6 * np.log(10) / 0.4
    middle = [(np.arange(240) + 0.5) * side / 240 for side in SIZE[:2]]
    area = SIZE[0] * SIZE[1] / 240**2
    sines = [np.sin(np.pi * np.outer(modes[:, i], middle[i]) / SIZE[i]) for i in (0, 1)]
    cosines = [np.cos(np.pi * np.outer(numbers[:, i], middle[i]) / SIZE[i]) for i in (0, 1)]
    coupling = area * (cosines[0] @ sines[0].T) * (cosines[1] @ sines[1].T)
    coupling *= (-1.0) ** numbers[:, 2:]
    norm = np.prod(np.where(numbers > 0, 0.5, 1.0), axis=1)
    drive = np.prod(np.sin(np.pi * modes * BALL / SIZE[:2]), axis=1)
    drive /= 2300 * 0.16 * SIZE[0] * SIZE[1] / 4
    stiffness = 1.2 * 343**2 / (ROOM.volume * norm)
    heard = np.prod(np.cos(np.pi * numbers * MICROPHONE / SIZE), axis=1)
    place, speed = np.zeros(len(modes)), np.zeros(len(modes))
    travel, rate = np.zeros(len(numbers)), np.zeros(len(numbers))
    pressure = np.empty(count)
    for i in range(count):
        # Velocities of the plate lie half a step on, and so do the X of the room, whose rates are
        # the pressures of the modes: X'' + a X' + w**2 X = rho c**2/(V norm) Q.
        push = drive * force[i] - omega**2 * place
        speed = (speed * (1 - step * losses / 2) + step * push) / (1 + step * losses / 2)
        place = place + step * speed
        push = stiffness * (coupling @ speed) - wave**2 * travel
        rate = (rate * (1 - step * decay / 2) + step * push) / (1 + step * decay / 2)
        travel = travel + step * rate
        pressure[i] = heard @ rate
    # What the decimation folds back lies beyond the bands.
    expected = fast_levels(pressure[None, ::8])[:, 0].max(axis=1)
    # Second order: (w step)**2/24 at 178 Hz moves a resonance by 1e-3 of its frequency.
    oracle(
        "modal room by an integration in time",
        "independent code",
        found.level[0, 0] - expected,
        0.05,
        "dB",
    )


@pytest.mark.parametrize(("loss", "reverberation_time"), [(0.9, 0.05), (0.004, 0.2), (0.05, 3.0)])
def test_record_is_long_enough_for_floor_room_and_detector(
    shell: thud.Impact, loss: float, reverberation_time: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Twice the decay changes levels by no more than what wraps around: 60 dB below."""
    floor = replace(FLOOR, loss_factor=loss, edges="absorption")
    room = replace(ROOM, reverberation_time=reverberation_time)
    places = {"balls": [BALL], "microphones": [MICROPHONE]}
    level = thud.modal_room(shell, floor, room, **places).level  # type: ignore[arg-type]
    monkeypatch.setattr(module, "DECAY_RANGE", 2 * module.DECAY_RANGE)
    longer = thud.modal_room(shell, floor, room, **places).level  # type: ignore[arg-type]
    assert level == pytest.approx(longer, abs=2 * 20 * np.log10(1 + 10 ** (-60 / 20)))


def test_detector_shows_tones_and_their_bursts(oracle: Callable[..., None]) -> None:
    """IEC 61672-1: a burst of 200 ms reads 1.0 dB less than the tone, one of 500 ms 0.1 dB."""
    time = np.arange(int(3 * SAMPLE_RATE)) / SAMPLE_RATE
    tone = np.sqrt(2) * 0.02 * np.sin(2 * np.pi * 125.89 * time)
    bursts = [np.where(time < length, tone, 0.0) for length in (3.0, 0.5, 0.2)]
    shown = fast_levels(np.array(bursts))[7].max(axis=1)
    # The squared tone has 0.1 dB of ripple after the detector.
    oracle(
        "bursts of IEC 61672-1 by the Fast detector",
        "published example",
        shown - [60.0, 59.9, 59.0],
        0.15,
        "dB",
    )


def test_random_positions_keep_their_distance_and_are_the_same_again(shell: thud.Impact) -> None:
    one = thud.modal_room(shell, FLOOR, ROOM, balls=2, microphones=4, seed=3)
    two = thud.modal_room(shell, FLOOR, ROOM, balls=2, microphones=4, seed=3)
    assert (one.level == two.level).all()
    assert one.level.shape == (2, 4, 9)
    for places, sides in ((one.balls, SIZE[:2]), (one.microphones, SIZE)):
        assert (places >= 0.5).all()
        assert (places <= sides - 0.5).all()
    assert one.mean == pytest.approx(10 * np.log10((10 ** (one.level / 10)).mean((0, 1))))
    assert np.isnan(one.statistical[:, :3]).all()
    assert one.statistical[0, 3:] == pytest.approx(one.prediction.level[:6])


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"balls": 0}, naming("balls", 0, 1)),
        ({"balls": [[1.0, 9.0]]}, naming("balls", 9.0, 0, 4.5)),
        ({"microphones": [[1.0, 1.0]]}, naming("microphones", "(1, 2)")),
        ({"seed": -1}, naming("seed", -1)),
        ({"seed": 2**32}, naming("seed", 2**32)),
        ({"floor": thud.Oscillator()}, naming("&floor: name", "plate")),
        (
            {"floor": thud.Plate(thickness=2.0, length=0.5, width=0.5)},
            naming("floor", "25393 Hz", "400 Hz"),
        ),
        ({"room": thud.Room(volume=1e5)}, naming("volume", "400 Hz", 20000)),
        ({"room": thud.Room(volume=-1.0)}, naming("&room: volume", "-1.0")),
    ],
)
def test_what_has_no_modal_answer_is_refused(
    shell: thud.Impact, settings: dict[str, object], words: str
) -> None:
    with pytest.raises(thud.InputError, match=words):
        thud.modal_room(shell, **{"floor": FLOOR, "room": ROOM} | settings)  # type: ignore[arg-type]


@pytest.mark.parametrize("slowest", [0.5, 6.9, 200.0])
def test_record_lasts_until_the_slowest_mode_has_decayed(slowest: float) -> None:
    """By 60 dB, and half a second more."""
    left = 10 * np.log10(np.exp(-slowest * (module._duration(slowest) - 0.5)))  # noqa: SLF001
    assert left == pytest.approx(-60.0)


@pytest.mark.parametrize(
    ("room", "loss"), [(thud.Room(volume=40.0, reverberation_time=3.0), 0.05), (ROOM, 0.001)]
)
def test_record_is_that_of_the_slowest_mode_of_plate_or_room(
    shell: thud.Impact, monkeypatch: pytest.MonkeyPatch, room: thud.Room, loss: float
) -> None:
    asked: list[float] = []
    usual = module._spectrum  # noqa: SLF001

    def keep(source: thud.Impact, duration: float) -> object:
        asked.append(duration)
        return usual(source, duration)

    monkeypatch.setattr(module, "_spectrum", keep)
    floor = replace(FLOOR, loss_factor=loss, edges="absorption", edge_absorption=0.0)
    found = thud.modal_room(shell, floor, room, balls=1, microphones=1)
    # The room's energy falls by 60 dB in T, that of the plate at 2 pi f eta or faster.
    lowest = found.floor_frequency[0]
    of_plate = 6 * np.log(10) / (2 * np.pi * lowest * loss)
    if loss > 0.01:
        assert asked[0] == pytest.approx(0.5 + 3.0)
    else:
        assert 0.5 + 0.4 < asked[0] <= 0.5 + of_plate


def test_spectrum_is_the_fourier_integral_of_the_force(shell: thud.Impact) -> None:
    omega, spectrum = module._spectrum(shell, 1.7003)  # noqa: SLF001
    assert omega[0] == 0
    # Lines from 0 to half of the sampling rate, of a record that is no shorter than asked for.
    assert omega[-1] == pytest.approx(np.pi * SAMPLE_RATE)
    assert 2 * np.pi / omega[1] == pytest.approx(1.7003, abs=2 / SAMPLE_RATE)
    assert 2 * np.pi / omega[1] >= 1.7003
    force = shell.force("floor")
    for i in (0, 3, 40, 300):
        integral = np.exp(-1j * omega[i] * shell.time) @ force / shell.sample_rate
        # Lines move by less than 1e-5 of the angle in 20 ms.
        assert spectrum[i] == pytest.approx(integral, rel=1e-3)
    long = module._spectrum(shell, 1e-3)[0]  # noqa: SLF001
    assert 2 * np.pi / long[1] >= len(force) / shell.sample_rate


def test_positions_of_small_rooms_keep_a_quarter_of_the_side() -> None:
    draw = np.random.default_rng(0)
    sides = (1.2, 3.0, 2.0)
    places = module._positions("a", 1000, sides, draw)  # noqa: SLF001
    border = np.array([0.3, 0.5, 0.5])
    assert (places >= border).all()
    assert (places <= np.array(sides) - border).all()
    # A thousand positions come near to every border.
    assert places.min(axis=0) == pytest.approx(border, abs=0.03)
    assert places.max(axis=0) == pytest.approx(np.array(sides) - border, abs=0.03)
    corners = [[0.0, 0.0, 0.0], [1.2, 3.0, 2.0]]
    assert module._positions("a", corners, sides, draw).tolist() == corners  # noqa: SLF001
    for count in (0, 1001):
        with pytest.raises(thud.InputError, match=naming("a", count, 1, 1000)):
            module._positions("a", count, sides, draw)  # noqa: SLF001
    for places in (np.zeros((0, 3)), np.zeros((1001, 3)), np.zeros((1, 2))):
        with pytest.raises(thud.InputError, match=naming("a", places.shape)):
            module._positions("a", places, sides, draw)  # noqa: SLF001


def test_each_mode_of_the_room_decays_as_the_nearest_third(found: thud.ModalRoom) -> None:
    times = np.linspace(0.4, 1.5, 12)
    prediction = replace(found.prediction, reverberation_time=times)
    # Between 63 and 80 Hz the border is their geometric mean.
    asked = np.array([0.0, 20.0, 50.0, 70.9, 71.1, 400.0, 2000.0])
    expected = times[[0, 0, 0, 1, 2, 9, 11]]
    assert module._reverberation_times(prediction, asked).tolist() == expected.tolist()  # noqa: SLF001


def test_numbers_of_all_positions_are_shown(found: thud.ModalRoom) -> None:
    draw = np.random.default_rng(1)
    level = draw.normal(60, 5, (3, 4, 9))
    many = replace(found, level=level)
    assert many.mean == pytest.approx(10 * np.log10((10 ** (level / 10)).sum(axis=(0, 1)) / 12))
    assert many.spread == pytest.approx(
        np.sqrt(((level - level.mean(axis=(0, 1))) ** 2).sum(axis=(0, 1)) / 12)
    )
    assert many.statistical[1, 3:] == pytest.approx(found.prediction.spread[:6])
    assert many.frequency.tolist() == thud.get_bands("third").nominal[:9].tolist()
    for column, values in ((3, level.min(axis=(0, 1))), (4, level.max(axis=(0, 1)))):
        assert [row[column] for row in many.rows()[1:]] == [f"{value:.1f}" for value in values]


def test_figures_show_positions_and_shapes(found: thud.ModalRoom) -> None:
    labels = [text.get_text() for text in found.plot().legends[0].get_texts()]
    assert "energy mean of the positions" in labels
    titles = [axes.get_title() for axes in plate_modes(FLOOR, 4, columns=2).axes]
    assert titles[0] == f"{found.floor_frequency[0]:.1f} Hz (1, 1)"
    assert sum(map(bool, titles)) == 4


@pytest.mark.parametrize("ratio", [0.01, 100.0])
def test_no_mode_of_an_orthotropic_plate_is_missing(shell: thud.Impact, ratio: float) -> None:
    plate = replace(FLOOR, thickness=0.08, stiffness_ratio=ratio)
    found = thud.modal_room(shell, plate, ROOM, balls=1, microphones=1).floor_frequency
    numbers = list(itertools.product(range(1, 60), repeat=2))
    assert len(found) == (plate_frequencies(plate, numbers) <= 400).sum()


def test_walls_and_ceiling_are_left_out_of_both_levels(found: thud.ModalRoom) -> None:
    room = replace(found.prediction.room, wall_lengths=(3.0, 2.0), ceiling_mass=20.0)
    both = [
        thud.modal_room(found.prediction.source, found.prediction.floor, r, balls=1, microphones=1)  # type: ignore[arg-type]
        for r in (found.prediction.room, room)
    ]
    np.testing.assert_array_equal(both[0].level, both[1].level)
    np.testing.assert_array_equal(both[0].statistical, both[1].statistical)
