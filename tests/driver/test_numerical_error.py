"""The numerical error that every impact states."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from conftest import MINIMAL

import thud
from thud.explorer.answer import answer_case

if TYPE_CHECKING:
    from pathlib import Path

    from conftest import CaseFile, Run

# Coarse resolutions and steps, of which the impacts warn.
pytestmark = pytest.mark.filterwarnings("ignore::thud.PlausibilityWarning")
COARSE = "&ball / &drop / &model name = 'modal_ball' /"
COARSE += " &modal_ball rings = 10, highest_frequency = 300 /"


def error_lines(shown: str) -> list[str]:
    """Return the numerical errors at 500 Hz, dB, that the executable shows."""
    return [line.split()[4] for line in shown.splitlines() if "error at 500 Hz" in line]


def test_results_keep_the_stated_error(case_file: CaseFile, run: Run, tmp_path: Path) -> None:
    path = case_file(COARSE)
    with pytest.warns(thud.PlausibilityWarning, match=r"numerical error in dB at .*500 Hz"):
        impact = thud.solve(thud.read_case(path))
    error = impact.level_error
    bands = ("31_5", "63", "125", "250", "500")
    assert error.tolist() == [getattr(impact, f"octave_{band}_error") for band in bands]
    assert error[4] > max(0.2, error[0])
    assert error_lines(run(path, "--output", "results").stdout) == [f"{error[4]:.2f}"]
    read = thud.read_results(tmp_path / "results")
    assert read.level_error == pytest.approx(error)
    assert float(impact.to_xarray()["octave_500_error"]) == error[4]
    # Small errors are not shown.
    impact = thud.solve()
    assert 0 < impact.level_error.max() < 0.15
    assert impact.notes == ()
    assert error_lines(run(case_file(MINIMAL)).stdout) == []


def test_results_have_no_unknown_error(case_file: CaseFile, run: Run, tmp_path: Path) -> None:
    run(case_file("&ball / &drop / &model /"), "--output", "results")
    summary = tmp_path / "results/summary.nml"
    lines = summary.read_text().splitlines(keepends=True)
    summary.write_text("".join(line for line in lines if "_error = " not in line))
    impact = thud.read_results(tmp_path / "results")
    scalars = impact.contact_time_error, impact.restitution_error, impact.peak_force_error
    assert np.isnan([*impact.level_error, *scalars]).all()
    assert "octave_500_error" not in impact.to_xarray()
    assert impact.restitution > 0


def test_verdict_and_page_do_not_take_an_unknown_error_as_small(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    known = thud.solve()
    unknown = replace(known, octave_500_error=np.nan)
    assert known.assess().criteria[4].estimate.expanded == pytest.approx(known.octave_500_error)
    assert unknown.assess().criteria[4].conforms == "undecided"
    assert unknown.assess().rows()[5][2] == "unknown"
    monkeypatch.setattr("thud.explorer.answer.compute", lambda _: unknown)
    titles = [title for title, *_ in answer_case(known.case)["numbers"]]
    assert "contact time" in titles
    assert not any("numerical error" in title for title in titles)


def test_shortened_steps_are_stated() -> None:
    assert "shortened_time_step" not in thud.solve(model="hollow_sphere").model_quantities
    with pytest.warns(thud.PlausibilityWarning, match="youngs_modulus"):
        impact = thud.solve(thud.Ball(youngs_modulus=2e10), model="hollow_sphere")
    assert impact.model_quantities["shortened_time_step"] == pytest.approx(1 / (4 * 44100))


def test_reduced_step_of_an_unstable_run_is_stated() -> None:
    # The bound on the step is closest for elements that are flat along the wall.
    options: dict[str, Any] = {
        "ball": thud.Ball(youngs_modulus=2.08e6), "model": "finite_element", "radial_elements": 16,
        "polar_elements": 16, "step_safety": 0.98, "fractional_order": 0.3, "loss_factor": 0.143,
    }  # fmt: skip
    quantities = thud.solve(**options).model_quantities
    assert "reduced_step_safety" not in quantities
    quantities = thud.solve(drop=thud.Drop(height=5.0), **options).model_quantities
    assert quantities["reduced_step_safety"] == pytest.approx(0.49)


def test_run_that_breaks_down_by_its_step_is_repeated() -> None:
    """It ended with a surface too deep in the layer, though half the step computes it."""
    ball = thud.Ball(0.0905, wall_thickness=0.01138, mass=1.2264, youngs_modulus=686214.0)
    impact = thud.solve(
        ball, thud.Drop(10.79), "finite_element", duration=0.3, radial_elements=3,
        polar_elements=32, layer_stiffness=1.2e10, viscosity="constant_loss", loss_factor=0.1,
        law="mooney_rivlin",
    )  # fmt: skip
    assert impact.model_quantities["reduced_step_safety"] < 0.85
    assert impact.energy_residual < 5e-3


VERIFIED: dict[str, dict[str, Any]] = {
    "shell": {"model": "hollow_sphere", "sample_rate": 8000.0},
    "modes of the user": {"model": "modal_ball", "rings": 20, "highest_frequency": 800.0},
    "elements of the user": {"model": "finite_element", "polar_elements": 24},
}


@pytest.mark.parametrize("name", VERIFIED)
def test_verification_is_a_drop_at_a_finer_resolution(name: str) -> None:
    impact = thud.solve(**VERIFIED[name], verify=True)
    plain = thud.solve(**VERIFIED[name])
    assert not any(name.startswith("finer") for name in plain.model_quantities)
    quantities = impact.model_quantities
    finer = {name[6:]: quantities[name] for name in quantities if name.startswith("finer_")}
    levels = impact.levels(force="floor")
    assert (levels == plain.levels(force="floor")).all()
    change, error = np.array(list(finer.values())[:5]) - levels, impact.level_error
    assert np.abs(change).max() > 0
    # The finer drop has errors of its own.
    assert (np.abs(change) < 1.5 * error + 0.02).all()
    assert abs(finer["contact_time"] - impact.exact_contact_time) < 1e-4
    assert abs(finer["restitution"] - impact.restitution) < 1e-2
    assert finer["peak_force"] == pytest.approx(impact.peak_force, rel=1e-2)


def test_verification_is_printed_beside_the_stated_error(case_file: CaseFile, run: Run) -> None:
    path = case_file(f"{MINIMAL} &sampling sample_rate = 8000, verify = .true. /")
    impact = thud.solve(thud.read_case(path))
    shown = run(path).stdout
    lines = [line.split() for line in shown.splitlines() if "level, 500 Hz octave" in line]
    finer, error = impact.model_quantities["finer_octave_500"], impact.level_error[4]
    change = finer - impact.levels(force="floor")[4]
    numbers = [f"{finer:.2f}", "dB", f"{change:.2f}", f"{error:.2f}"]
    assert lines[-1] == ["level,", "500", "Hz", "octave", *numbers]
    assert re.search(r"sample rate +16\.00 kHz", shown)
    assert "-0.00" not in shown


RESOLUTIONS = {
    "&model name = 'finite_element' / &mesh radial_elements = 3, polar_elements = 24 /": (
        ("radial elements 3", "polar elements 24"), "radial_elements = 3, polar_elements = 24",
        {"radial_elements": 4, "polar_elements": 34},
    ),
    "&model name = 'modal_ball' / &modal_ball rings = 10, highest_frequency = 300 /": (
        ("rings 10", "highest frequency 300.0 Hz", "substeps 1"),
        "rings = 10, highest_frequency = 300", {"rings": 14, "highest_frequency": 1960.0},
    ),
    "&model name = 'modal_ball' /": (
        ("rings 40", "highest frequency 1.400 kHz", "substeps 1"), "", {"rings": 56},
    ),
}  # fmt: skip


@pytest.mark.parametrize("text", RESOLUTIONS)
def test_resolution_is_stated(text: str, case_file: CaseFile, run: Run) -> None:
    shown, keys, finer = RESOLUTIONS[text]
    path = case_file(f"&ball / &drop / {text} &sampling verify = .true. /")
    result = run(path, "--verbose", "--output", "results")
    assert set(shown) <= {" ".join(line.split()) for line in result.stdout.splitlines()}
    assert keys in result.stderr
    quantities = thud.solve(thud.read_case(path)).model_quantities
    assert {name: quantities[f"finer_{name}"] for name in finer} == pytest.approx(finer)


def test_errors_of_the_drop_on_a_floor_are_shown(case_file: CaseFile, run: Run) -> None:
    path = case_file(f"{COARSE} &floor name = 'infinite_plate' / &sampling verify = .true. /")
    with pytest.warns(thud.PlausibilityWarning, match="numerical error"):
        impact = thud.solve(thud.read_case(path))
    assert impact.on_floor
    result = run(path)
    errors = impact.level_error[4], impact.on_floor.level_error[4]
    assert error_lines(result.stdout) == [f"{error:.2f}" for error in errors]
    assert result.stdout.count("at a finer resolution") == 2
    assert result.stderr.count("numerical error in dB") == 2
    assert result.stderr.count("&floor: numerical error") == 1


AWKWARD = {
    "thin wall": {"outer_radius": 0.06, "wall_thickness": 0.0075, "youngs_modulus": 6.3e6},
    "no losses": {
        "outer_radius": 0.105, "wall_thickness": 0.02625, "youngs_modulus": 0.94e6,
        "poisson_ratio": 0.47,
    },
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("name", AWKWARD)
def test_elements_refine_themselves_or_state_the_error(name: str) -> None:
    """Against finer meshes than those of the default, which are 8 x 109 and 16 x 154."""
    keys = AWKWARD[name]
    inner = keys["outer_radius"] - keys["wall_thickness"]
    mass = 1150 * 4 / 3 * np.pi * (keys["outer_radius"] ** 3 - inner**3)
    options = {"viscosity": "none"} if name == "no losses" else {}

    def solved(**mesh: int) -> thud.Impact:
        keywords: Any = {"model": "finite_element", "duration": 0.12, **options, **mesh}
        return thud.solve(thud.Ball(**keys, mass=mass), thud.Drop(height=0.25), **keywords)

    radial, polar = (12, 144) if name == "thin wall" else (18, 168)
    impact, finer = solved(), solved(radial_elements=radial, polar_elements=polar)
    coarse = solved(radial_elements=8, polar_elements=64)
    levels = finer.levels(force="floor")
    error = np.abs(impact.levels(force="floor") - levels)
    stated = impact.level_error + finer.level_error
    assert (error < stated + 0.02).all()
    assert error.max() < 0.6 * np.abs(coarse.levels(force="floor") - levels).max()


# Slow shear waves: the surface sticks and slips an octave lower than that of the standard ball.
LARGE = thud.Ball(
    outer_radius=0.13, wall_thickness=0.0468, mass=7.81, youngs_modulus=1e6, poisson_ratio=0.49
)


def slipping(
    friction: float,
    mesh: tuple[int, int] = (3, 24),
    ball: thud.Ball = thud.Ball(),  # noqa: B008 - immutable
    **options: object,
) -> thud.Impact:
    radial, polar = mesh
    keys = {"model": "finite_element", "radial_elements": radial, "polar_elements": polar}
    return thud.solve(ball, friction=friction, **keys, **options)  # type: ignore[arg-type]


def test_stick_and_slip_raises_the_stated_error() -> None:
    """Meshes that are too coarse for it agree with each other."""
    least = np.array([0.05, 0.2, 0.4, 2.0, 2.0]) * 64 / 24
    for friction in (0.4, 0.9):
        assert (slipping(friction).level_error >= least).all()
    for friction in (0.0, 0.3, 1.0):
        assert (slipping(friction).level_error < least).any()
    viscous = slipping(0.4, viscosity="kelvin_voigt").level_error
    assert (viscous < least).any()
    fine = slipping(0.4, (8, 96)).level_error
    assert (fine >= least * 24 / 96).all()
    assert (fine < least).all()


@pytest.mark.slow
def test_stated_error_covers_that_of_friction() -> None:
    for friction, ball in (0.2, thud.Ball()), (0.4, thud.Ball()), (0.8, LARGE):
        coarse = slipping(friction, (8, 64), ball, duration=0.1)
        fine = slipping(friction, (16, 128), ball, duration=0.1)
        change = np.abs(coarse.levels(force="floor") - fine.levels(force="floor"))
        assert (change <= coarse.level_error + 0.01).all()


@pytest.mark.parametrize("modulus", [1e4, 3e4, 5e4, 3e5])
def test_duration_that_a_message_allows_is_accepted(modulus: float) -> None:
    soft = thud.Ball(youngs_modulus=modulus, poisson_ratio=0.49)
    # A coarse mesh: only the check of the duration matters.
    coarse = thud.FiniteElement(radial_elements=2, polar_elements=16)
    with pytest.raises(thud.ThudError, match=r"is too short|ends before contact 1") as raised:
        thud.solve(soft, model=coarse)
    (shortest,) = re.findall(r"at least ([\d.]+) s$", str(raised.value))
    assert len(shortest.lstrip("0.")) <= 3
    try:
        thud.solve(soft, model=coarse, duration=float(shortest))
    except thud.ThudError as error:
        assert "is too short" not in str(error)
