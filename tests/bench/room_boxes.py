"""Standard uncertainty of the level in the room below, from boxes that vary in what is not known.

    OPENBLAS_NUM_THREADS=1 .venv/bin/python tests/bench/room_boxes.py

prints the scatter that `src/floor/room/room_uncertainty.f90` holds; options: --help. The
estimate is the answer of thud for a drawn dwelling (construction, sides, height, reverberation
time) without stated
edges. The truths are the same dwelling with what its user does not know drawn, too:

- edges between free rotation and clamping, alike along all sides: rotational stiffness 0.1 to 100
  times bending stiffness over length, log-uniform;
- speeds of longitudinal waves within 7 % (moduli 14 %), dynamic stiffnesses within 20 %, the
  reverberation time of each third within 15 %, the sides of the room within 3 % of those of the
  floor and its height within 3 %, all uniform;
- the ball: a set of the calibrated ones by finite elements, whose levels on a rigid floor replace
  those of the standard ball.

Truths are by modes to `--highest`, above the crossover of the estimate, statistical above that.

With estimate u and truth t without stated edges, and estimate s and truth r with edges that are
stated as simply supported, all else equal, and with levels b of the drawn ball over those of the
standard one, the rows are mean (bias) and standard deviation (scatter) of

- all causes: u - t - b;
- floor and room: s - r; edges: (u - t) - (s - r); source: -b.

Coverage counts the truths t within 1 and 1.96 standard uncertainties of the prediction, with and
without its error of the model. That error is the difference of buildings from rigid boxes, which
these draws do not contain and no data determine: truths lie within more than 68 and 95 % with it.
"""

from __future__ import annotations

import argparse
import warnings
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from tqdm import tqdm

import thud
from thud.level.levels import BANDWIDTHS
from thud.studies.calibrated_set import MESH, calibrated_set

if TYPE_CHECKING:
    from numpy.random import Generator
    from numpy.typing import NDArray

    Array = NDArray[np.float64]
    Floor = thud.Plate | thud.JoistFloor

BANDS = (50, 63, 80, 100, 125, 160, 200, 250, 315, 400, 500, 630)
# A-weighting of thirds and octaves in these bands, dB (IEC 61672-1).
WEIGHTS = {
    "thirds": [-30.3, -26.2, -22.4, -19.1, -16.2, -13.2, -10.8, -8.7, -6.6, -4.8, -3.2, -1.9],
    "octaves": np.repeat([-26.2, -16.2, -8.7, -3.2], 3),
}
# Half widths of what is not known over the nominal value; ends of the rotational stiffness.
MODULUS, STIFFNESS, TIME, SIDE, ROTATION = 0.14, 0.2, 0.15, 0.03, (0.1, 100.0)
WIDTHS = {
    "wave_speed": MODULUS / 2, "screed_wave_speed": MODULUS / 2, "sheathing_modulus": MODULUS,
    "joist_modulus": MODULUS, "subceiling_modulus": MODULUS, "layer_stiffness": STIFFNESS,
    "channel_stiffness": STIFFNESS,
}  # fmt: skip
JOISTS = (
    "1 board", "2 boards", "1 board, rigid subceiling", "3 boards, resilient subceiling",
    "1 board, screed on 10 MN/m3",
)  # fmt: skip


# Ranges of the sides by kind, m.
KINDS = {
    "bare": ((4.0, 7.0), (3.0, 5.0)),
    "floating": ((4.0, 7.0), (3.0, 5.0)),
    "joists": ((3.0, 5.0), (3.0, 6.0)),
}


def get_floor(kind: str, draw: Generator) -> Floor:
    """Return a floor of a kind: a concrete slab, one with a screed, or timber joists."""
    length, width = (draw.uniform(*ends) for ends in KINDS[kind])
    if kind == "joists":
        floor = thud.construction(f"joists, {draw.choice(JOISTS)}").floor
        return replace(floor, length=length, width=width)
    floor = thud.construction("concrete 180, screed on 15 MN/m3").floor
    screed = draw.uniform(0.04, 0.07) if kind == "floating" else 0.0
    return replace(
        floor, length=length, width=width, thickness=draw.uniform(0.14, 0.24),
        screed_thickness=screed, layer_stiffness=6e6 * 5 ** draw.uniform(),
    )  # fmt: skip


def get_balls(ball: thud.Impact) -> Array:
    """Return levels of the calibrated balls less those of a ball, dB."""
    sets = calibrated_set("finite_element")
    impacts = [ball]
    # The mesh is that of the calibration.
    warnings.simplefilter("ignore", thud.PlausibilityWarning)
    for values in tqdm(list(zip(*sets.values(), strict=True)), desc="balls"):
        keys = dict(zip(sets, map(float, values), strict=True))
        other = thud.Ball(**{key: keys.pop(key) for key in ("youngs_modulus", "poisson_ratio")})
        impacts.append(thud.solve(other, model="finite_element", **MESH, **keys))
    levels = np.array([one.levels(BANDWIDTHS[1], force="floor")[: len(BANDS)] for one in impacts])
    return np.asarray(levels[1:] - levels[0])


def vary(draw: Generator, floor: Floor, room: thud.Room) -> tuple[Floor, thud.Room]:
    """Return floor and room with what is not known drawn, but for the edges."""

    def varied(value: float, width: float) -> float:
        return value * float(1 + draw.uniform(-width, width))

    keys = {key: varied(getattr(floor, key, 0.0), width) for key, width in WIDTHS.items()}
    keys = {key: value for key, value in keys.items() if value}
    # A floor is at least as large as its room.
    for key in ("length", "width"):
        own, other = getattr(floor, key), varied(getattr(floor, key), SIDE)
        keys[key] = max(own, other)
        room = replace(room, **{key: min(own, other)})
    time = tuple(varied(room.reverberation_time[0], TIME) for _ in BANDS)
    room = replace(room, height=varied(room.height, SIDE), reverberation_time=time)
    return replace(floor, support="simple", **keys), room


def with_edges(floor: Floor, rotation: float) -> Floor:
    """Return a floor with edges that rest and have a rotational stiffness over B'/length."""
    if isinstance(floor, thud.Plate):
        along = across = floor.density * floor.wave_speed**2 * floor.thickness**3 / 12
    else:
        along = floor.joist_modulus * floor.joist_width * floor.joist_height**3 / 12 / floor.spacing
        across = floor.sheathing_modulus * floor.sheathing_thickness**3 / 12
    ends = (rotation * along / floor.length,) * 2 + (rotation * across / floor.width,) * 2
    return replace(floor, support="elastic", support_stiffness=(1e11,), support_rotation=ends)


def with_ratings(levels: Array) -> Array:
    """Return levels with their ratings in thirds and octaves appended, dB, along the last axis."""
    sums = [(10 ** ((levels + weight) / 10)).sum(axis=-1) for weight in WEIGHTS.values()]
    return np.append(levels, 10 * np.log10(np.stack(sums, axis=-1)), axis=-1)


def main() -> None:
    """Print a table for each kind of floor."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])  # type: ignore[union-attr]
    parser.add_argument("kinds", nargs="*", choices=[*KINDS, []], help="default: all")
    parser.add_argument("--dwellings", type=int, default=32)
    parser.add_argument("--truths", type=int, default=1, help="of each dwelling")
    parser.add_argument("--positions", default="even", choices=("even", "standard"))
    parser.add_argument("--highest", type=float, default=320.0, help="of the truths by modes, Hz")
    options = parser.parse_args()
    # The rating whose positions these are, and its column.
    rating, column = ("thirds", -2) if options.positions == "even" else ("octaves", -1)
    ball = thud.solve(model="modal_ball")
    balls = get_balls(ball)
    for kind in options.kinds or KINDS:
        draw = np.random.default_rng(1)
        found, uncertainties = [], []
        for _ in tqdm(range(options.dwellings), desc=kind):
            floor = get_floor(kind, draw)
            room = thud.Room(
                length=floor.length, width=floor.width, height=draw.uniform(2.3, 3.0),
                reverberation_time=(draw.uniform(0.3, 0.8),), positions=options.positions,
            )  # fmt: skip
            known = thud.predict_level(ball, floor, room)
            predicted = known.ratings[rating]
            for _ in range(options.truths):
                simple, other = vary(draw, floor, room)
                elastic = with_edges(simple, float(np.exp(draw.uniform(*np.log(ROTATION)))))
                truths = []
                for one in (elastic, simple):
                    modal = thud.modal_room(
                        thud.predict_level(ball, one, other), max_frequency=options.highest
                    )
                    truths.append(np.append(modal.mean, modal.prediction.level[len(modal.mean) :]))
                found.append([known.level, known.simple_level, *truths, draw.choice(balls)])
                uncertainties.append([predicted.uncertainty, predicted.contributions["model"]])
        show(kind, np.array(found), np.array(uncertainties), column)


def show(kind: str, found: Array, uncertainties: Array, column: int) -> None:
    """Print the rows of a kind, and the coverage of the rating in a column."""
    u, s, t, r, b = found.transpose(1, 0, 2)
    u, s = with_ratings(u), with_ratings(s)
    differences = {
        "all causes": u - with_ratings(t + b),
        "floor and room": s - with_ratings(r),
        "edges": u - with_ratings(t) - (s - with_ratings(r)),
        "source": with_ratings(t) - with_ratings(t + b),
    }
    print(f"{kind + f', {len(found)} truths':25}", *(f"{f:5}" for f in BANDS), "thirds octaves")
    for name, difference in differences.items():
        print(f"{name + ', bias':25}", *(f"{v:5.1f}" for v in difference.mean(axis=0)))
        print(f"{name + ', scatter':25}", *(f"{v:5.1f}" for v in difference.std(axis=0)))
    error = np.abs(differences["all causes"][:, column])
    whole, model = uncertainties.T
    for name, one in {"with": whole, "without": np.sqrt(whole**2 - model**2)}.items():
        shares = " and ".join(f"{100 * np.mean(error <= k * one):.0f} %" for k in (1, 1.96))
        print(f"within 1 and 1.96 uncertainties {name} the model's error: {shares}")


if __name__ == "__main__":
    main()
