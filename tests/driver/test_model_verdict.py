"""The verdict over what is not known of a source."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from conftest import REPOSITORY, codes, load_script, naming
from scipy.stats import binomtest, spearmanr

import thud
from thud.base._schema import MODELS, STANDARD_BALL
from thud.base.tables import format_rows, wrap
from thud.cli import main
from thud.impact.compute import compute
from thud.level.assessment import wilson_interval
from thud.studies import calibrated_set

if TYPE_CHECKING:
    from pathlib import Path

COARSE = thud.FiniteElement(radial_elements=2, polar_elements=16)
ELEMENT_SETS = calibrated_set.calibrated_set("finite_element")
LINEAR = thud.HuntCrossley(stiffness=61685.0, exponent=1.0, restitution=1.0)


def modulus(model: str, factor: float) -> float:
    return factor * STANDARD_BALL[model, "youngs_modulus"]


@pytest.mark.parametrize("model", ["modal_ball", "finite_element"])
def test_sets_are_those_of_the_standard_ball(model: str) -> None:
    verdict = thud.assess(thud.Case(model=MODELS[model]()))
    assert verdict
    assert verdict.counts == (32, 32)
    assert "conforms_by_calibration" in codes(verdict.notes)


@pytest.mark.parametrize(
    ("keys", "fixed"),
    [
        ({}, ()), ({"friction": 0.2}, ("friction",)),
        *(({"viscosity": law}, ("loss_factor", "fractional_order"))
          for law in ("kelvin_voigt", "none", "constant_loss")),
        ({"loss_frequency": 100.0, "poisson_ratio": 0.49}, ("poisson_ratio", "loss_factor")),
        ({"youngs_modulus": 2.2e6, "loss_factor": 0.2, "fractional_order": 0.5},
         ("loss_factor", "fractional_order")),
    ],
)  # fmt: skip
def test_stated_parameters_are_fixed(keys: dict[str, Any], fixed: tuple[str, ...]) -> None:
    in_ball = {key for key in keys if hasattr(thud.Ball, key)}
    ball = thud.Ball(**{key: keys[key] for key in in_ball})
    model = replace(COARSE, **{key: keys[key] for key in keys.keys() - in_ball})
    verdict = thud.assess(thud.Case(ball=ball, model=model))
    assert verdict.fixed == fixed
    assert set(verdict.unknowns) == ELEMENT_SETS.keys() - set(fixed)
    assert ("keys_fixed" in codes(verdict.notes)) == bool(fixed)


@pytest.mark.parametrize(
    ("model", "count"),
    [
        (thud.ModalBall(), 0), (thud.ModalBall(damping_law="constant"), 1),
        (thud.ModalBall(damping_law="constant", loss_factor=0.3), 0),
        (COARSE, 1), (replace(COARSE, viscosity="none"), 1),
        (replace(COARSE, viscosity="kelvin_voigt"), 2),
        (replace(COARSE, viscosity="kelvin_voigt", loss_factor=0.2), 1),
    ],
)  # fmt: skip
def test_notes_have_the_warnings_of_the_drop(model: Any, count: int) -> None:  # noqa: ANN401
    """Of a coarse mesh, and of a loss factor that is not stated with another damping law."""
    case = thud.Case(model=model)
    notes = compute(case).notes
    assert len(notes) == count
    assert set(codes(notes)) <= set(codes(thud.assess(case).notes))


def test_drops_are_those_of_the_sets(monkeypatch: pytest.MonkeyPatch) -> None:
    """The modulus of the case multiplies those of the sets; range, counts and correlation."""
    ball = thud.Ball(youngs_modulus=modulus("modal_ball", 1.1))
    verdict = thud.assess(thud.Case(ball=ball))
    sets = dict(calibrated_set.calibrated_set("modal_ball"))
    sets["youngs_modulus"] = 1.1 * sets["youngs_modulus"]
    drops = thud.solve_many(sets)
    assert verdict.counts == (drops.conforms.sum(), 32)
    level = drops.floor_octave[:, 4]
    criterion = verdict.criteria[4]
    assert criterion.range == (level.min(), level.max())
    inside = (level >= criterion.lower) & (level <= criterion.upper)
    assert criterion.counts == (inside.sum(), 32)
    assert criterion.probability == inside.mean()
    correlation = {key: abs(spearmanr(values, level).statistic) for key, values in sets.items()}
    assert criterion.main_unknown == max(correlation, key=correlation.__getitem__)
    assert not verdict.criteria[8].main_unknown
    assert criterion.value == pytest.approx(thud.solve(ball).levels()[4], abs=1e-9)
    assert thud.assess(thud.solve(ball)).to_csv() == verdict.to_csv()

    def fail(*_: object, **__: object) -> thud.Ensemble:
        status = np.zeros(33, dtype=np.int32)
        status[1:7] = 1
        return replace(drops, status=status, reason=np.full(33, "it bursts", dtype=object))

    monkeypatch.setattr(calibrated_set, "solve_many", fail)
    with pytest.raises(thud.InputError, match=naming(6, 33, "it bursts")):
        thud.assess(thud.Case())


def test_results_that_are_read_back_have_the_same_verdict(tmp_path: Path) -> None:
    (tmp_path / "soft.nml").write_text("&ball youngs_modulus = 1.5e6 /")
    out = tmp_path / "out"
    assert main(["run", "-q", "--no-figures", str(tmp_path / "soft.nml"), "-o", str(out)]) == 0
    case = thud.Case(ball=thud.Ball(youngs_modulus=1.5e6))
    assert thud.assess(thud.read_results(out)).rows() == thud.assess(case).rows()


# Unknowns of the case.


def test_verdict_over_a_stiffness_is_that_of_a_closed_form() -> None:
    # A linear spring: the contact time is half a period, pi sqrt(mass / stiffness).
    unknowns = thud.Unknowns(("stiffness",), (5e4,), (8e4,), reason=("an example",))
    verdict = thud.assess(thud.Case(model=LINEAR, unknowns=unknowns))
    (contact,) = (c for c in verdict.criteria if c.name == "contact_time")
    ends = np.pi**2 * 2.5 / np.array([0.022, 0.018]) ** 2
    assert contact.interval
    assert contact.interval[0] <= (ends[1] - ends[0]) / 3e4 <= contact.interval[1]
    longest, shortest = np.pi * np.sqrt(2.5 / np.array([5e4, 8e4]))
    assert contact.range == pytest.approx((shortest, longest), abs=5e-5)
    assert contact.main_unknown == "stiffness"
    # Without losses the restitution is 1, for every stiffness.
    assert verdict.counts == (0, 256)
    assert not verdict


def test_unknowns_replace_keys_of_the_set(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(calibrated_set, "SAMPLES", 64)
    model = replace(COARSE, friction=0.3, viscosity="kelvin_voigt", loss_factor=0.2)
    unknowns = thud.Unknowns(("friction", "fractional_order"), (0.2, 0.3), (0.4, 1.0),
                             reason=("inclined plane", "not measured"))  # fmt: skip
    verdict = thud.assess(thud.Case(model=model, unknowns=unknowns))
    assert verdict.fixed == ("loss_factor",)
    assert set(verdict.unknowns) == ELEMENT_SETS.keys() - {"loss_factor"}
    assert verdict.counts
    assert verdict.counts[1] == 64


# Outcome.


@pytest.mark.parametrize(("inside", "count"), [(0, 32), (1, 32), (16, 32), (32, 32), (250, 256)])
def test_interval_is_that_of_wilson(inside: int, count: int) -> None:
    expected = binomtest(inside, count).proportion_ci(method="wilson")
    assert wilson_interval(inside, count) == pytest.approx((expected.low, expected.high))


def test_outcome_is_that_of_all_drops() -> None:
    verdict = thud.assess(thud.Case())
    for inside, result in ((32, "conforms"), (31, "undecided"), (0, "does not conform")):
        for entry in (verdict, verdict.criteria[0]):
            assert replace(entry, counts=(inside, 32)).conforms == result


def test_command_writes_what_it_prints(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    case = thud.Case("soft", thud.Ball(youngs_modulus=modulus("modal_ball", 0.9)))
    thud.write_case(case, "soft.nml")
    verdict = thud.assess(case)
    assert main(["assess", "--check", "soft.nml"]) == 3
    assert wrap(format_rows(verdict.rows())) in capsys.readouterr().out
    text = (tmp_path / "outputs/soft_verdict/verdict.csv").read_text()
    assert text == verdict.to_csv()
    assert text.count("\n") == 2 + len(verdict.criteria)


def test_page_shows_the_verdict() -> None:
    page = (REPOSITORY / "docs/verdict.md").read_text()
    verdict = thud.assess(thud.Case(ball=thud.Ball(youngs_modulus=1.46e6)))
    shown = "\n".join([format_rows(verdict.rows()), *(note.message for note in verdict.notes)])
    assert f"\n{wrap(shown)}\n" in page


@pytest.mark.slow
@pytest.mark.parametrize(
    ("model", "count", "balls"),
    [
        ("modal_ball", 150, [
            (0.9, 1.0, {}), (1.05, 1.0, {}), (1.0, 1.0, {"wall_thickness": 0.034}),
            (1.0, 1.0, {"mass": 2.6}), (0.97, 0.99, {"mass": 2.45})]),
        ("finite_element", 16, [(0.9, 1.0, {}), (1.1, 1.0, {})]),
    ],
)  # fmt: skip
def test_probability_is_that_of_other_sets(
    model: str, count: int, balls: list[tuple[float, float, dict[str, float]]]
) -> None:
    """Parameters drawn anew from the same distribution, within twice the stated error.

    The balls are near the limits: factor of the modulus, drop height, and keys.
    """
    calibration = load_script("driver/calibrate_standard_ball.py")
    sets, _ = calibration.draw_sets(model, count, 1, progress=False)
    for factor, height, keys in balls:
        ball = thud.Ball(**keys, youngs_modulus=modulus(model, factor))
        case = thud.Case(ball=ball, drop=thud.Drop(height), model=MODELS[model]())
        verdict = thud.assess(case)
        meshed = calibrated_set._calibrated_mesh(case)  # noqa: SLF001
        columns = {**sets, "youngs_modulus": factor * sets["youngs_modulus"]}
        expected = thud.solve_many(columns, meshed).conforms.mean()
        assert verdict.interval
        low, high = verdict.interval
        assert abs(expected - (low + high) / 2) <= high - low
