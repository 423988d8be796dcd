"""The level below a floor."""

import numpy as np

import thud

# %% predict_level, RoomPrediction, Room
prediction = thud.predict_level(thud.solve(), "concrete 180", thud.Room(volume=40.0))
print(prediction)
print(prediction.level, "dB in", prediction.frequency, "Hz")

# %% construction, constructions, Construction
print(list(thud.constructions("screed 200 15")))
floor = thud.construction("concrete 180")
print(thud.solve(floor.case()))

# %% Plate, FloorOptions, RectangularFloor
impact = thud.solve(floor=thud.Plate(thickness=0.14))
print(thud.predict_level(impact))

# %% LaminateFloor
print(thud.solve(floor=thud.construction("clt 160").floor))

# %% JoistFloor
print(thud.solve(floor=thud.construction("joists, 1 board").floor))

# %% FloorImpact, FloorEnergy
moved = thud.solve(floor=thud.Plate(thickness=0.14)).on_floor
if moved:
    print(moved)
    print(moved.floor_work, "J")

# %% Rigid, InfinitePlate, Oscillator, FloorName
for floor in (
    thud.Rigid(),
    thud.InfinitePlate(resistance=1600.0),
    thud.Oscillator(mass=20.0, stiffness=1e6, damping=500.0),
):
    print(floor.name, thud.solve(floor=floor).contact_time)

# %% mobility, Mobility
frequency = [31.5, 63.0, 125.0]
found = thud.mobility(thud.InfinitePlate(resistance=1600.0), frequency)
print(found.values)

# %% read_mobility, fit_mobility, MobilityFit, MeasuredMobility
slab = thud.ModalFloor(file="inputs/floors/modal_slab.csv", source_x=0.4, source_y=0.35)
thud.mobility(slab, np.arange(12.0, 300.0)).save("measured.csv")
fitted = thud.fit_mobility(thud.read_mobility("measured.csv"))
print(fitted)
print(thud.solve(floor=fitted.floor))

# %% write_floor_modes, ModalFloor
x, y = np.linspace(0.0, 4.0, 9), np.linspace(0.0, 3.0, 7)
shape = [np.outer(np.sin(n * np.pi * x / 4), np.sin(np.pi * y / 3)) for n in (1, 2)]
thud.write_floor_modes("modes.csv", [24.0, 41.0], 0.03, x=x, y=y, shape=shape, modal_mass=800.0)
print(thud.solve(floor=thud.ModalFloor(file="modes.csv", residual_compliance=1e-9)))

# %% compare_floors, FloorComparison
print(thud.compare_floors({"bare": "concrete 180", "floating": "concrete 180, screed on 15 MN/m3"}))

# %% ball_impedance, BallImpedance
print(thud.ball_impedance(thud.solve(), resistance=[1e5, 1e6]))

# %% modal_room, ModalRoom
prediction = thud.predict_level(thud.solve(), "concrete 180")
print(thud.modal_room(prediction))

# %% listen, RoomSound, FloorSound
prediction = thud.predict_level(thud.solve(), "concrete 180")
sound = thud.listen({"concrete": prediction})
sound.save("floors.wav")
print(sound)

# %% blocked_force, BlockedForce
force = thud.blocked_force(thud.solve())
print(force)

# %% read_room_levels, RoomLevels
levels = thud.read_room_levels("inputs/floors/field_levels.csv")
print(levels)

# %% rating, Rating
print(thud.rating([65.3, 64.5, 58.0, 55.8]))

# %% standardized_level
print(thud.standardized_level([65.3, 64.5], reverberation_time=[0.8, 0.7], volume=40.0))

# %% tapping_level, TappingLevel
print(thud.tapping_level(thud.Plate(thickness=0.2)))
