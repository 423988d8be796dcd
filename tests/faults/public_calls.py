"""Short calls of every public function; each returns numbers or words that are always the same."""

from __future__ import annotations

import math
import warnings
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

import thud
from thud.comparison.comparison import read_all
from thud.recordings.recording import read_recording
from thud.recordings.signal import Signal

if TYPE_CHECKING:
    import random
    from collections.abc import Callable
    from pathlib import Path

    Calls = dict[str, Callable[[], Any]]

MASS = {"mass": thud.Parameter(low=2.4, high=2.6)}
HEIGHTS = {"height": thud.Parameter(values=[0.9, 1.0, 1.1])}
PLATE, ROOM = thud.Plate(thickness=0.2), thud.Room(volume=40.0)
MESH = {"radial_elements": 2, "polar_elements": 8}


def fast_calls(folder: Path) -> Calls:
    """Return calls that take some milliseconds, by name; they read and write in a directory."""
    case = thud.Case("mine", sampling=thud.Sampling(duration=0.04))
    impact = thud.solve()
    light = thud.solve(floor=thud.InfinitePlate(1600.0))
    pressed = thud.compress(model="modal_ball", points=5)
    (folder / "levels.csv").write_text("frequency,P1\n63,65\n125,64\n250,58\n500,56\n")
    thud.write_case(case, folder / "mine.nml")
    rate = impact.sample_rate

    def write() -> str:
        thud.write_case(case, folder / "written.nml")
        return (folder / "written.nml").read_text()

    def refused() -> str:
        try:
            thud.solve(thud.Ball(mass=-1.0))
        except thud.InputError as error:
            return str(error)
        return ""

    return {
        "solve": lambda: thud.solve().floor_force,
        "modal ball": lambda: thud.solve(model="modal_ball", rings=10).floor_force,
        "lumped": lambda: (
            thud.solve(model=thud.HuntCrossley(contact_time=0.02, restitution=0.8)).floor_force
        ),
        "solve of a case": lambda: thud.solve(case).elastic_force,
        "on a floor": lambda: thud.solve(floor=thud.Oscillator()).on_floor.floor_velocity,  # type: ignore[union-attr]
        "solve_many": lambda: thud.solve_many({"height": [0.5, 1.0, 1.5]}, threads=2).floor_octave,
        "levels": lambda: impact.levels("third"),
        "force_exposure_levels": lambda: thud.force_exposure_levels(impact.floor_force, rate),
        "verdict": lambda: [one.value for one in impact.assess().criteria],
        "assess_levels": lambda: str(
            thud.assess_levels([39, 31, 23, 17, 12], 0.02, 0.8, 1, 2.5, 1.0)
        ),
        "get_bands": lambda: thud.get_bands("third").nominal,
        "loss_factors": lambda: thud.loss_factors(thud.FiniteElement(), [50.0, 100.0]),
        "mobility": lambda: thud.mobility(PLATE, [25.0, 100.0]).values,
        "ball_impedance": lambda: str(thud.ball_impedance(light, [1e4, 1e5])),
        "injected_energy": lambda: str(light.on_floor.injected_energy()),  # type: ignore[union-attr]
        "predict_level": lambda: str(thud.predict_level(impact, PLATE, ROOM)),
        "tapping_level": lambda: str(thud.tapping_level(PLATE)),
        "rating": lambda: str(thud.rating([65.0, 64.0, 58.0, 56.0])),
        "standardized_level": lambda: thud.standardized_level([65.0, 64.0], 0.6, 40.0),
        "read_room_levels": lambda: str(thud.read_room_levels(folder / "levels.csv", volume=40.0)),
        "compress": lambda: thud.compress(points=5).force,
        "fit to a press": lambda: str(
            thud.fit(
                thud.CompressionTarget(pressed.deflection, pressed.force), ["youngs_modulus"]
            ).values
        ),
        "read_case": lambda: str(thud.read_case(folder / "mine.nml")),
        "read_all": lambda: str(read_all([folder / "mine.nml"])),
        "write_case": write,
        "read_study": lambda: thud.read_study({"parameters": HEIGHTS}).name,
        "refused": refused,
    }


def slow_calls(folder: Path) -> Calls:
    """Return calls that take longer."""
    impact = thud.solve()
    force = np.pad(impact.floor_force, 8000)
    force += np.random.default_rng(1).normal(scale=0.5, size=force.size)
    np.savetxt(folder / "record.csv", np.c_[np.arange(force.size) / impact.sample_rate, force])
    table = thud.Mobility([20.0, 30.0, 40.0, 50.0], [1e-5, 2e-5, 2e-5, 1e-5])
    set_study: Any = {"design": {"size": 8}, "parameters": MASS}
    learned = thud.surrogate({"design": {"size": 64}, "parameters": MASS})
    learned.save(folder / "mass.nc")
    thud.sweep({"name": "kept", "parameters": HEIGHTS}, folder)
    results = folder / "results"
    _run(folder, results)

    def saved() -> int:
        thud.plot.save(impact.plot(), folder / "figure.png")
        return (folder / "figure.png").stat().st_size

    def measured() -> str:
        return str(thud.read_recording(folder / "record.csv", height=1.0, mass=2.5).levels())

    return {
        "finite elements": lambda: thud.solve(model="finite_element", **MESH).floor_force,
        "free_modes": lambda: thud.free_modes(count=2).frequency,
        "sets of elements": lambda: (
            thud.solve_many({"height": [0.9, 1.0]}, model="finite_element", threads=2).peak_force
        ),
        "modal_room": lambda: str(thud.modal_room(thud.predict_level(impact, PLATE, ROOM))),
        "listen": lambda: thud.listen(thud.predict_level(impact, PLATE, ROOM)).wav(),
        "compare": lambda: thud.compare([impact, thud.solve(model="modal_ball")]).rows(),
        "compare_floors": lambda: str(
            thud.compare_floors({"thin": thud.predict_level(impact, PLATE, ROOM)})
        ),
        "fit": lambda: str(thud.fit(impact, ["youngs_modulus"]).values),
        "fit_mobility": lambda: str(thud.fit_mobility(table, order=1)),
        "read_results": lambda: thud.read_results(results).floor_force,
        "read_recording": measured,
        "from_array": lambda: str(
            read_recording(
                Signal.from_array(force, impact.sample_rate), height=1.0, mass=2.5
            ).levels()
        ),
        "sweep": lambda: thud.sweep({"parameters": HEIGHTS}).dataset.peak_elastic_force,
        "read_sweep": lambda: thud.read_sweep(folder / "kept.nc").dataset.peak_elastic_force,
        "uncertainty": lambda: str(thud.uncertainty(set_study).rows()),
        "sensitivity": lambda: str(thud.sensitivity(set_study).rows()),
        "design": lambda: str(thud.design({"parameters": _plane()}).rows()),
        "surrogate": lambda: str(thud.surrogate({"design": {"size": 64}, "parameters": MASS})),
        "read_surrogate": lambda: str(thud.read_surrogate(folder / "mass.nc")),
        "plot": saved,
        "to_xarray": lambda: impact.to_xarray().floor_force,
        "to_dataframe": lambda: impact.to_dataframe().to_numpy(),
    }


def changing_calls(folder: Path) -> dict[str, Callable[[random.Random], object]]:
    """Return calls with another value each: rates, floors, recordings, cases, rooms, bands."""

    def rates(chance: random.Random) -> thud.Sampling:
        return thud.Sampling(chance.uniform(16e3, 64e3), chance.uniform(0.06, 0.09))

    def case(chance: random.Random) -> thud.Case:
        ball = thud.Ball(wall_thickness=chance.uniform(0.02, 0.04))
        drop = thud.Drop(height=chance.uniform(0.5, 1.5))
        floor = chance.choice([
            None, thud.InfinitePlate(chance.uniform(1e5, 1e6)),
            thud.Oscillator(mass=chance.uniform(20, 60)),
            thud.Plate(thickness=chance.uniform(0.15, 0.25)),
        ])  # fmt: skip
        model = chance.choice([thud.HollowSphere(), thud.ModalBall(rings=10)])
        sampling = rates(chance)
        return thud.Case("changing", ball, drop, sampling=sampling, model=model, floor=floor)

    def read_case(chance: random.Random) -> thud.Case:
        thud.write_case(case(chance), folder / "changing.nml")
        return thud.read_case(folder / "changing.nml")

    def levels(chance: random.Random) -> object:
        force = np.sin(np.linspace(0, math.pi, chance.randint(300, 3000)))
        bands, method = chance.choice(["octave", "third"]), chance.choice(["exact", "fft"])
        return thud.force_exposure_levels(force, chance.uniform(8e3, 64e3), bands, method)

    def recording(chance: random.Random) -> object:
        impact = thud.solve(replace(case(chance), floor=None))
        force = np.pad(impact.floor_force, chance.randint(4000, 8000))
        force += np.random.default_rng(chance.getrandbits(32)).normal(scale=0.5, size=force.size)
        return read_recording(
            Signal.from_array(force, impact.sample_rate), height=1.0, mass=2.5
        ).levels()

    def room(chance: random.Random) -> object:
        plate = thud.Plate(thickness=chance.uniform(0.15, 0.25))
        return thud.predict_level(impact, plate, thud.Room(volume=chance.uniform(20, 60)))

    def modal_room(chance: random.Random) -> object:
        space = thud.Room(volume=chance.uniform(20, 60))
        return thud.modal_room(thud.predict_level(impact, PLATE, space), balls=1, microphones=2)

    impact = thud.solve()
    return {
        "case": lambda chance: thud.solve(case(chance)),
        "read_case": read_case,
        "levels": levels,
        "recording": recording,
        "room": room,
        "modal_room": modal_room,
        "sets": lambda chance: thud.solve_many(
            {"height": [chance.uniform(0.5, 1.5) for _ in range(chance.randint(1, 60))]}, threads=2
        ),
        "mobility": lambda chance: (
            thud.mobility(
                PLATE, [chance.uniform(20, 200) for _ in range(chance.randint(1, 40))]
            ).values
        ),
        "elements": lambda chance: thud.solve(
            thud.Ball(mass=chance.uniform(2.4, 2.6)), model="finite_element", **MESH
        ),
    }


def _plane() -> dict[str, Any]:
    return {
        "height": thud.Parameter(values=[0.5, 1.0]),
        "youngs_modulus": thud.Parameter(values=[1.6, 2.08], unit="MPa"),
    }


def _run(folder: Path, results: Path) -> None:
    from thud.cli import main

    (folder / "run.nml").write_text("&ball / &drop / &model /")
    main(["run", "-q", "--no-figures", str(folder / "run.nml"), "-o", str(results)])


def same(one: Any, other: Any) -> bool:  # noqa: ANN401 - whatever a call returns
    """Return whether two results are equal."""
    if isinstance(one, str):
        return bool(one == other)
    first, second = np.asarray(one), np.asarray(other)
    return np.array_equal(first, second, equal_nan=first.dtype.kind == "f")


def quiet() -> None:
    """Let no warning be shown: implausible values are meant."""
    warnings.simplefilter("ignore")
