"""Assess a recording."""

import thud

# %% read_recording, Recording
recording = thud.read_recording("inputs/recordings/drop_1.csv", height=1.0, mass=2.5)
print(recording)
print(recording.assess())
figure = recording.plot()

# %% write_report
recording = thud.read_recording("inputs/recordings/drop_1.csv", height=1.0, mass=2.5)
print(thud.write_report(recording, "report"))
