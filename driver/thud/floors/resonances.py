"""Natural frequencies of floor and room, and resonances of plates on their layers and cavities."""

from __future__ import annotations

import math
from itertools import product
from typing import TYPE_CHECKING

from thud.base._schema import JoistFloor, RectangularFloor
from thud.base.bridge import ask
from thud.base.errors import InputError
from thud.case.case import Case, case_text

if TYPE_CHECKING:
    from thud.floors.prediction import RoomPrediction

# Number of natural frequencies, the lowest of the floor and of the room.
COUNT = 8


def floor_frequencies(prediction: RoomPrediction) -> list[float]:
    """Return the lowest natural frequencies of the floor, Hz; see `get_modal_room`.

    A floor without modes, such as a measured mobility, has none.
    """
    case = case_text(Case(floor=prediction.floor))
    try:
        modes = ask("floor_modes", case=case, highest=prediction.frequency[-1])
    except InputError:
        return []
    return [float(value) for value in modes["frequency"][:COUNT]]


def room_frequencies(prediction: RoomPrediction) -> dict[tuple[int, int, int], float]:
    """Return the lowest natural frequencies of a room with rigid walls, Hz, by half wavelengths.

    c/2 |(l/L, m/W, n/H)|, with l, m and n half wavelengths along length, width and height.
    """
    half = prediction.room.sound_speed / 2
    entries = [
        (
            half * math.hypot(*(n / side for n, side in zip(order, prediction.size, strict=True))),
            order,
        )
        for order in product(range(COUNT + 1), repeat=3)
    ]
    return {(i, j, k): frequency for frequency, (i, j, k) in sorted(entries)[1 : COUNT + 1]}


def resonances(prediction: RoomPrediction) -> dict[str, float]:
    """Return the resonance of each light plate on the bearing floor, Hz, by its name.

    Each is that of two masses per unit area on the stiffness of what is between them: the resilient
    layer, or the air of the cavity with the lines that hold a subceiling. Bending, edges
    and further plates are neglected.
    """
    floor, room = prediction.floor, prediction.room
    # Stiffness per unit area of a cavity of 1 m, N/m2.
    air = room.air_density * room.sound_speed**2
    # Mass, kg/m2, and stiffness, N/m3.
    plates: dict[str, tuple[float, float]] = {}
    if isinstance(floor, RectangularFloor):
        if floor.screed_thickness:
            mass = floor.screed_thickness * floor.screed_density
            plates["floating plate on its layer"] = mass, floor.layer_stiffness
        if floor.subceiling_thickness:
            spacing = floor.spacing if isinstance(floor, JoistFloor) else floor.channel_spacing
            mass = floor.subceiling_thickness * floor.subceiling_density
            stiffness = air / floor.cavity_depth + floor.channel_stiffness / spacing
            plates["subceiling on cavity and channels"] = mass, stiffness
    if room.ceiling_mass:
        plates["ceiling on its cavity"] = room.ceiling_mass, air / room.ceiling_depth
    return {
        name: math.sqrt(stiffness * (1 / mass + 1 / prediction.mass_per_area)) / (2 * math.pi)
        for name, (mass, stiffness) in plates.items()
    }
