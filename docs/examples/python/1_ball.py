"""Conformity of a ball."""

import subprocess

import thud

# %% solve, Impact, ModelName
impact = thud.solve(model="modal_ball")
print(impact)
figure = impact.plot()

# %% Ball, Drop, ModalBall, ModelOptions
thin = thud.Ball(wall_thickness=0.029)
print(thud.solve(thin, thud.Drop(height=0.8), model=thud.ModalBall(loss_factor=0.2)))

# %% Case, Sampling, Levels, Limits
case = thud.Case(
    ball=thud.Ball(mass=2.4),
    sampling=thud.Sampling(sample_rate=48000.0),
    levels=thud.Levels(force="floor", method="exact"),
    limits=thud.Limits(source="rubber_ball"),
)
print(thud.solve(case).assess())

# %% write_case, read_case
thud.write_case(thud.Case(drop=thud.Drop(height=0.5)), "half_metre.nml")
print(thud.read_case("half_metre.nml").drop)

# %% read_results
# The executable writes what the library reads.
subprocess.run(["thud", "inputs/rubber_ball_100cm.nml", "-o", "results"], check=True)
print(thud.read_results("results"))

# %% FiniteElement
print(thud.solve(model=thud.FiniteElement(viscosity="kelvin_voigt", loss_factor=0.2)))

# %% HollowSphere
print(thud.solve(model=thud.HollowSphere()))

# %% HuntCrossley
print(thud.solve(model=thud.HuntCrossley(contact_time=0.02, restitution=0.8)))

# %% TwoMass
print(thud.solve(model=thud.TwoMass()))

# %% MeasuredModes
modes = thud.MeasuredModes(
    frequency=(24.0, 89.0), damping_ratio=(0.05, 0.1), effective_mass=(2.4, 0.1)
)
print(thud.solve(model=modes))

# %% Motion
impact = thud.solve(model=thud.FiniteElement(snapshot_interval=0.002))
print(impact.motion)

# %% Verdict, Criterion
verdict = thud.solve().assess()
print(verdict)
for criterion in verdict.criteria:
    print(criterion.name, criterion.value, criterion.unit, criterion.conforms)

# %% assess, Estimate
verdict = thud.assess(thud.solve())
print(verdict.criteria[0].estimate)

# %% assess_levels
print(thud.assess_levels([39.0, 31.0, 23.0, 17.0, 12.5], contact_time=0.020))

# %% force_exposure_levels
impact = thud.solve()
print(thud.force_exposure_levels(impact.floor_force, impact.sample_rate, "octave"))

# %% get_bands, Bands
bands = thud.get_bands("third")
print(bands.nominal)

# %% compare, Comparison
comparison = thud.compare({"modal": thud.solve(), "shell": thud.solve(model="hollow_sphere")})
print(comparison)

# %% free_modes, FreeModes, Modes
print(thud.free_modes(thud.Ball(), count=4).frequency)
case = thud.Case(modes=thud.Modes(count=4))  # of the executable: &modes count = 4 /
thud.write_case(case, "modes.nml")

# %% loss_factors
print(thud.loss_factors(thud.FiniteElement(), [31.5, 125.0]))

# %% compress, CompressionCurve, Compression
print(thud.compress(thud.Ball(), max_deflection=0.02))
case = thud.Case(compression=thud.Compression(max_deflection=0.02))  # of the executable
thud.write_case(case, "press.nml")

# %% Unknowns
unknowns = thud.Unknowns(
    key=("youngs_modulus",), low=(1.4e6,), high=(1.7e6,), reason=("data sheet of the rubber",)
)
print(thud.assess(thud.Case(unknowns=unknowns)))
