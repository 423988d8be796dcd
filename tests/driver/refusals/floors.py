"""What the calls of `floors.toml` use."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from refusals.core import write

import thud

LARGE = {"length": 100.0, "width": 100.0}
FREQUENCY = np.linspace(10, 1000, 300)
POINT = thud.mobility(thud.Oscillator(), FREQUENCY).values
OCTAVES = (63, 125, 250, 500)


def solved(text: str) -> thud.Impact:
    """Return the impact of a case in a file."""
    return thud.solve(thud.read_case(write("case.nml", text)))


def below(room: str = "", floor: str = "name = 'plate'", plate: str = "") -> thud.Impact:
    """Return the impact on a plate above a room, with keys of the groups in a file."""
    return solved(f"&floor {floor} /\n&plate\n {plate} /\n&room {room} /\n")


@cache
def predicted() -> thud.RoomPrediction:
    """Return the level of a ball below a plate."""
    return thud.predict_level(thud.solve(model="hollow_sphere"), thud.Plate(), thud.Room())


def floor_study(*size: int, **heights: Any) -> dict[str, Any]:  # noqa: ANN401
    """Return a study of drops on a floor."""
    case = write("case.nml", "&model /\n&floor name = 'plate' /\n")
    design = {"size": size[0]} if size else {}
    return {"case": str(case), "design": design, "parameters": {"height": heights}}


def construction_file(old: str, new: str) -> thud.Construction:
    """Return a construction of a file in which a text is replaced."""
    text = """name = "mine"
kind = "concrete"
floor = "plate"
layers = [
  { material = "concrete", thickness = 0.2, density = 2400 },
  { material = "gypsum board", thickness = 0.0125, density = 960 }]

[keys]
thickness = { value = 0.2, source = "drawing" }
density = { value = 2400, source = "estimate" }

[room]
ceiling_mass = { value = 12, source = "data sheet" }
"""
    assert old in text
    return thud.construction(write("mine.toml", text.replace(old, new)))


def room_levels(text: str | bytes) -> thud.RoomLevels:
    """Return levels in a room of a table."""
    return thud.read_room_levels(write("levels.csv", text))


def titled(titles: str, cells: str = "") -> thud.RoomLevels:
    """Return levels in a room of a table with equal cells in each octave, by default of 50."""
    cells = cells or ";".join(["50"] * titles.count(";"))
    return room_levels("\n".join([titles, *(f"{octave};{cells}" for octave in OCTAVES)]))


def octaves(*rows: str) -> thud.RoomLevels:
    """Return levels at one position of a table with some rows in place of others."""
    known = {row.partition(",")[0]: row for row in (*(f"{octave},60" for octave in OCTAVES), *rows)}
    return room_levels("\n".join(["frequency,P1", *filter(None, known.values())]))


def fit_points(frequency: Any = FREQUENCY, values: Any = POINT, **options: Any) -> thud.MobilityFit:  # noqa: ANN401
    """Return the fit of points of a mobility."""
    return thud.fit_mobility(thud.Mobility(frequency, values), **options)


def mobility_table(titles: str, *arguments: Any) -> thud.Mobility:  # noqa: ANN401
    """Return the mobility of a table with a row of numbers."""
    row = ",".join(["1"] * (titles.count(",") + 1))
    return thud.read_mobility(write("point.csv", f"{titles}\n{row}\n"), *arguments)


def modal_floor(line: int = 0, old: str = "", new: str = "", **changes: Any) -> thud.Mobility:  # noqa: ANN401
    """Return the mobility of a slab by two modes of a file, of which a line may be changed.

    Its plate has 414 kg/m2, and natural frequencies of 29.1 and 57.9 Hz.
    """
    x, y = np.linspace(0, 5, 11), np.linspace(0, 4, 9)
    across = np.sin(np.pi * y / 4)
    shape = np.array([np.outer(np.sin(m * np.pi * x / 5), across) for m in (1, 2)])
    modes = {
        "frequency": [29.1, 57.9], "loss_factor": 0.03, "x": x, "y": y,
        "shape": shape / np.sqrt(414 * 5), **changes,
    }  # fmt: skip
    thud.write_floor_modes("modes.csv", **modes)
    lines = Path("modes.csv").read_text("utf-8").splitlines()
    assert old in lines[line]
    lines[line] = lines[line].replace(old, new, 1)
    write("modes.csv", "\n".join(lines))
    floor = thud.ModalFloor(file="modes.csv", thickness=0.18, density=2300.0, wave_speed=3500.0)
    return thud.mobility(floor, [30.0])
