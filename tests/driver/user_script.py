"""A script of a user that touches every public name; test_public_names.py runs and checks it."""

import subprocess
import sys
import warnings
from dataclasses import replace
from pathlib import Path
from tempfile import mkdtemp

import numpy as np

import thud

folder = Path(mkdtemp())
names: tuple[thud.ModelName, ...] = ("hollow_sphere", "modal_ball")
ball = thud.Ball(outer_radius=0.089)
impacts: dict[str, thud.Impact] = {name: thud.solve(ball, model=name) for name in names}
lumped: thud.ModelOptions = thud.HuntCrossley(contact_time=0.02, restitution=0.8)
tyre: thud.ModelOptions = thud.TwoMass(belt_mass=1.0)
impacts["lumped"] = thud.solve(ball, thud.Drop(height=1.0), lumped)
elements = thud.FiniteElement(viscosity="kelvin_voigt", loss_factor=0.2, snapshot_interval=1e-3)
flagship = thud.solve(thud.Ball(), model=elements)
motion: thud.Motion | None = flagship.motion
others = thud.HollowSphere("none"), thud.ModalBall(rings=40), thud.MeasuredModes(frequency=[30.0])
laws = thud.loss_factors(thud.FiniteElement(viscosity="constant_loss"), [50.0, 100.0])
levels = thud.Levels(bands="third")
case = thud.Case("mine", ball, sampling=thud.Sampling(duration=0.04), levels=levels)
thud.write_case(case, folder / "mine.nml")
run = [sys.executable, "-m", "thud", "run", "--no-figures", "mine.nml"]
subprocess.run(run, cwd=folder, check=True)
again = (
    thud.solve(thud.read_case(folder / "mine.nml")),
    thud.read_results(folder / "outputs/mine"),
)
verdict: thud.Verdict = thud.assess_levels([39, 31, 23, 17, 12], 0.02, 0.8, 1, 2.5, 1.0, "tyre")
missed: list[thud.Criterion] = [one for one in verdict.criteria if not one]
unknown = thud.Unknowns(key=["mass"], low=[2.4], high=[2.6], reason=["not weighed"])
likely: thud.Verdict = thud.assess(thud.Case(model=lumped, unknowns=unknown))
ranges: list[thud.Criterion] = [one for one in likely.criteria if one.range]
modes: thud.FreeModes = thud.free_modes(ball, thud.Modes(count=2).count)
press = thud.Compression(gas="isothermal")
pressed: thud.CompressionCurve = thud.compress(ball, "hollow_sphere", points=5, gas=press.gas)
pressed_target = thud.CompressionTarget(pressed.deflection, pressed.force, gas=press.gas)
pressed_case = thud.Case(ball=ball, model=others[0])
modulus_fit: thud.Fit = thud.fit(pressed_target, ["youngs_modulus"], pressed_case)
bands: thud.Bands = thud.get_bands("third")
thirds = thud.force_exposure_levels(flagship.floor_force, flagship.sample_rate, "third", "fft")
limited = replace(case, limits=thud.Limits())
many: thud.Ensemble = thud.solve_many({"height": [0.5, 1.0]}, limited)
noise = np.random.default_rng(1).normal(scale=0.5, size=8000 + len(flagship.time))
plate = np.pad(flagship.floor_force, 4000) + noise
np.savetxt(folder / "record.csv", np.c_[np.arange(len(plate)) / flagship.sample_rate, plate])
known = thud.recordings.Config(height=1.0, mass=2.5)
record: thud.Recording = thud.read_recording(folder / "record.csv", config=known)
contact: thud.Estimate = record.estimates["contact_time"]
page: thud.Comparison = thud.compare({**impacts, "record": record}, force="floor")
restored: thud.Case = thud.read_case(folder / "mine.nml")
files = thud.write_report(record, folder / "report")
record.plot(kind="force"), thud.plot.levels(impacts), page.plot()
thud.plot.save(pressed.plot(), folder / "figure.png")
tables = flagship.to_dataframe(), many.to_xarray()
floors: list[thud.FloorOptions] = [thud.Rigid(), thud.InfinitePlate(1600.0), thud.Oscillator()]
floors += [thud.Plate(screed_thickness=0.05), thud.JoistFloor(), thud.MeasuredMobility()]
grid = {"x": [0.0, 1.0, 2.0, 3.0], "y": [0.0, 1.0, 2.0, 3.0]}
thud.write_floor_modes(folder / "modes.csv", [50.0], 0.05, **grid, shape=[[[0.05] * 4] * 4])
floors += [thud.ModalFloor(file=str(folder / "modes.csv"))]
plates: list[thud.RectangularFloor] = [thud.LaminateFloor()]
assert all(isinstance(plate, thud.RectangularFloor) for plate in plates)
light: thud.Impact = thud.solve(ball, floor=floors[1])
measured = thud.Mobility(np.array([20.0, 30.0, 40.0, 50.0]), np.full(4, 1e-5 + 0j))
measured.save(folder / "mobility.csv")
point: thud.MobilityFit = thud.fit_mobility(thud.read_mobility(folder / "mobility.csv"), order=1)
moved: thud.FloorImpact | None = light.on_floor
assert moved is not None
impedance: thud.BallImpedance = thud.ball_impedance(light, [1e4, 1e5])
portions: thud.FloorEnergy = moved.injected_energy("third")
print(chosen := floors[1].name, thud.mobility(floors[2], [25.0]).values, moved.difference())
name: thud.FloorName = chosen
floor, room = thud.Plate(thickness=0.2), thud.Room(volume=40.0)
below: thud.RoomPrediction = thud.predict_level(flagship, floor, room)
places: thud.ModalRoom = thud.modal_room(thud.predict_level(flagship, floor, room))
tapping: thud.TappingLevel = thud.tapping_level(floor)
library: dict[str, thud.Construction] = thud.constructions("concrete 180")
deck: thud.Construction = thud.construction(next(iter(library)))
built: thud.Case = deck.case(thud.Case(room=room))
several: thud.FloorComparison = thud.compare_floors({"thin": below, deck.name: built})
sound: thud.RoomSound = thud.listen({"thin": below, "same": below}, pause=0.5)
sound.save(folder / "sound.wav")
heard: tuple[thud.FloorSound, ...] = sound.sounds
(folder / "levels.csv").write_text("frequency,P1\n63,65\n125,64\n250,58\n500,56\n")
site: thud.RoomLevels = thud.read_room_levels(folder / "levels.csv", volume=40.0)
rating: thud.Rating = thud.rating(thud.standardized_level(site.level, 0.6, 40.0))
height = {"height": thud.Parameter(values=[0.5, 1.0])}
mass = {"mass": thud.Parameter(low=2.4, high=2.6)}
modulus = {"youngs_modulus": thud.Parameter(values=[1.6, 2.08], unit="MPa")}
study: thud.Study = thud.read_study({"parameters": height})
thud.sweep(study, folder / "sweep")
kept: thud.Sweep = thud.read_sweep(folder / f"sweep/{study.name}.nc")
chart: thud.Design = thud.design({"parameters": height | modulus})
learned: thud.Surrogate = thud.surrogate({"design": {"size": 64}, "parameters": mass})
learned.save(folder / "mass.nc")
trained = thud.read_surrogate(folder / "mass.nc")
tolerances = {"design": {"size": 8}, "parameters": mass}
spread: thud.Uncertainty = thud.uncertainty(tolerances, surrogate=trained)
shares: thud.Sensitivity = thud.sensitivity({"design": {"size": 4}, "parameters": mass})
targets = (
    thud.ForceTarget(impacts["hollow_sphere"]),
    thud.LevelTarget(many.floor_octave[1].tolist()),
)
exported: thud.BlockedForce = thud.blocked_force(impacts["hollow_sphere"])
exported.save(folder / "force.csv")
problems: list[type[thud.ThudError]] = [thud.InputError, thud.NumericalError]
with warnings.catch_warnings(action="ignore", category=thud.FitWarning):
    found: list[thud.Fit] = [thud.fit(target, ["youngs_modulus"]) for target in targets]
warnings.simplefilter("ignore", thud.PlausibilityWarning)
results = [
    thud.compare(impacts), *again, modes, bands, many, *found, exported, kept, chart, spread,
    shares, below, places, several, tapping, site, rating, learned,
]  # fmt: skip
print(*results, *missed, sep="\n")
