"""The verdict over what is not known of a source."""

from __future__ import annotations

import re
import subprocess
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from conftest import naming
from scipy.stats import truncnorm

import thud
from thud.base.tables import format_rows
from thud.cli import main
from thud.comparison import comparison
from thud.studies import bundled_surrogate, model_assessment
from thud.studies.bundled_surrogate import FILE, find_unknowns
from thud.studies.unknowns import STANDARD_BALL, Unknown

if TYPE_CHECKING:
    from collections.abc import Callable

ROOT = Path(__file__).parents[2]
FLAGSHIP = ROOT / "inputs/rubber_ball_fe.nml"
VISCOUS = ROOT / "inputs/rubber_ball_fe_viscous.nml"
EXAMPLE = ROOT / "inputs/rubber_ball_unknowns.nml"
UNKNOWNS = thud.Unknowns(
    key=("friction", "fractional_order"),
    low=(0.0, 0.2),
    high=(0.5, 1.0),
    reason=("it's dry", "no measurement"),
)

BULK_RATIO = thud.Unknowns(key=("bulk_ratio",), low=(100,), high=(300,), reason=("fillers",))


def with_unknowns(**changes: object) -> thud.Case:
    return replace(thud.read_case(FLAGSHIP), unknowns=replace(UNKNOWNS, **changes))  # type: ignore[arg-type]


def test_unknowns_survive_files(tmp_path: Path) -> None:
    case = with_unknowns(standard_deviation=(0.1, 0.0))
    thud.write_case(case, tmp_path / "case.nml")
    assert thud.read_case(tmp_path / "case.nml").unknowns == case.unknowns


def test_executable_accepts_and_echoes_unknowns(tmp_path: Path, executable: str) -> None:
    coarse = thud.FiniteElement(radial_elements=2, polar_elements=16)
    thud.write_case(replace(with_unknowns(), model=coarse), tmp_path / "case.nml")
    subprocess.run([executable, "case.nml"], cwd=tmp_path, check=True, capture_output=True)
    (echo,) = tmp_path.glob("outputs/*/effective.nml")
    assert thud.read_case(echo).unknowns == UNKNOWNS
    assert "= 'it''s dry', 'no measurement'" in echo.read_text()


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            {"key": ("frction", "fractional_order")},
            "key = 'frction' is not allowed (did you mean 'friction'?)",
        ),
        ({"key": ("friction", "friction")}, "key = 'friction' is given twice"),
        ({"key": ("sample_rate", "friction")}, "key = 'sample_rate' is not allowed"),
        ({"low": (0.0,)}, "low has 1 entries; allowed: 2, one for each key"),
        ({"reason": ()}, "reason has 0 entries; allowed: 2, one for each key"),
        ({"key": ()}, "key is missing; allowed: names of keys"),
        ({"standard_deviation": (0.1,)}, "standard_deviation has 1 entries; allowed: 2"),
        ({"low": (-0.1, 0.2)}, "low = -0.1 of friction is not allowed; allowed: 0 <= friction"),
        ({"high": (0.5, 1.5)}, "high = 1.5 of fractional_order is not allowed; allowed: 0 <"),
        ({"low": (0.5, 0.2)}, "low = 0.5 and high = 0.5 of friction are not allowed"),
        ({"low": (0.1, 0.2)}, "friction = 0.0, is outside low = 0.1 and high = 0.5"),
    ],
)
def test_message_names_what_is_wrong_with_unknowns(
    changes: dict[str, object], message: str, tmp_path: Path
) -> None:
    with pytest.raises(thud.InputError, match=re.escape(message)):
        thud.write_case(with_unknowns(**changes), tmp_path / "case.nml")


@pytest.mark.parametrize("text", ["it is", "'a', b", "'a' 'b", "1, 2", f"'{'x' * 129}'"])
def test_list_of_texts_needs_quotes(text: str, tmp_path: Path) -> None:
    path = tmp_path / "case.nml"
    path.write_text(f"&unknowns key = {text} / &model name = 'finite_element' /")
    with pytest.raises(thud.InputError, match=r"is not a list of up to 16|a quote is not closed"):
        thud.read_case(path)


def test_normal_distribution_is_truncated() -> None:
    unknown = Unknown("youngs_modulus", 1.95, 2.3, 0.1, "")
    fractions = np.linspace(0, 1, 11)
    expected = truncnorm.ppf(fractions, (1.95 - 2.1) / 0.1, (2.3 - 2.1) / 0.1, 2.1, 0.1)
    np.testing.assert_allclose(unknown.quantiles(fractions, 2.1), expected, rtol=1e-9)


def test_default_unknowns_have_reasons_and_stand_on_their_page() -> None:
    page = (ROOT / "docs/verdict.md").read_text()
    for unknown in STANDARD_BALL:
        row = f"| `{unknown.key}` | {unknown.low:.4g} | {unknown.high:.4g} | {unknown.reason} |"
        assert row in page


def test_own_unknowns_replace_the_defaults() -> None:
    assert [unknown.key for unknown in find_unknowns(with_unknowns())[0]] == list(UNKNOWNS.key)
    assert find_unknowns(thud.read_case(FLAGSHIP))[0] == STANDARD_BALL


def test_nothing_is_known_to_vary_elsewhere() -> None:
    message = "nothing is known to vary in this case; allowed: &unknowns with key"
    with pytest.raises(thud.InputError, match=message):
        thud.assess(thud.Case())


# Bundled surrogate: drops at random points, in units of the stated 95 % errors.


def errors_at_random_points(
    count: int, seed: int
) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    surrogate = bundled_surrogate.bundled_surrogate()
    low, high = surrogate.region.T
    points = low + np.random.default_rng(seed).random((count, len(low))) * (high - low)
    columns = dict(zip(surrogate.keys, points.T, strict=True))
    drops = thud.solve_many(columns, surrogate.case)
    predicted = surrogate.predict(surrogate.case, columns)
    assert not drops.status.any()
    assert not predicted["status"].any()
    differences = [
        (predicted["floor_level"] - drops.floor_octaves) / surrogate.error_of("floor_level")
    ]
    for name in ("contact_time", "restitution"):
        ratio = 20 * np.log10(predicted[name] / getattr(drops, name))
        differences.append((ratio / surrogate.error_of(name))[:, np.newaxis])
    return np.abs(np.concatenate(differences, axis=1))


def test_bundled_surrogate_has_its_stated_error() -> None:
    relative = errors_at_random_points(6, 1)
    # Of 42 numbers, 2 are expected beyond 1; 8 or more have a probability of 0.1 %.
    assert (relative > 1).sum() < 8
    assert relative.max() < 5


@pytest.mark.slow
def test_bundled_surrogate_has_its_stated_error_at_many_points() -> None:
    relative = errors_at_random_points(200, 2)
    # 95 % less three standard deviations of a fraction of 200.
    assert ((relative <= 1).mean(axis=0) >= 0.95 - 3 * np.sqrt(0.95 * 0.05 / 200)).all()


def test_bundled_surrogate_is_small_and_belongs_to_its_study() -> None:
    path = Path(bundled_surrogate.__file__).with_name(FILE)
    assert path.stat().st_size <= 1e6
    study = thud.read_study(ROOT / "inputs/studies/standard_ball.toml", "surrogate")
    surrogate = bundled_surrogate.bundled_surrogate()
    assert surrogate.keys == tuple(parameter.name for parameter in study.parameters)
    np.testing.assert_allclose(surrogate.region, [(p.low, p.high) for p in study.parameters])
    assert find_unknowns(study.case)[1]
    # Otherwise: ./bootstrap surrogate
    found, expected = dict(surrogate.identity), dict(study.identity)
    for identity in (found, expected):
        identity.pop("scikit-learn_version")
    assert found == expected


@pytest.mark.parametrize(
    "change",
    [
        lambda case: replace(case, drop=replace(case.drop, height=0.5)),
        lambda case: replace(case, ball=replace(case.ball, ambient_pressure=9e4)),
        lambda case: replace(case, ball=replace(case.ball, youngs_modulus=1.6e6)),
        lambda case: replace(case, model=replace(case.model, layer_stiffness=1e9)),
        lambda case: replace(case, model=replace(case.model, viscosity="none")),
        lambda case: replace(case, model=thud.HollowSphere()),
        lambda case: replace(case, unknowns=replace(UNKNOWNS, high=(1.5, 1.0))),
        lambda case: replace(case, unknowns=BULK_RATIO),
    ],
)  # fmt: skip
def test_bundled_surrogate_is_not_used_for_other_cases(
    change: Callable[[thud.Case], thud.Case],
) -> None:
    case = change(thud.read_case(FLAGSHIP))
    assert not find_unknowns(case)[1]


@pytest.mark.parametrize(
    "change",
    [
        lambda case: replace(case, name="other", floor=thud.InfinitePlate(), modes=thud.Modes()),
        lambda case: replace(case, model=replace(case.model, radial_elements=6, polar_elements=48)),
        lambda case: replace(case, sampling=replace(case.sampling, verify=True)),
        lambda case: replace(case, levels=replace(case.levels, bands="both")),
        lambda case: replace(case, ball=replace(case.ball, mass=2.45)),
        lambda case: replace(case, model=replace(case.model, snapshot_interval=1e-3)),
    ],
)
def test_bundled_surrogate_covers_the_neighborhood(
    change: Callable[[thud.Case], thud.Case],
) -> None:
    assert find_unknowns(change(thud.read_case(FLAGSHIP)))[1]


def test_changed_model_is_noticed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    impact = thud.solve(thud.read_case(FLAGSHIP))
    assert model_assessment.assess_impact(impact)
    surrogate = bundled_surrogate.bundled_surrogate()
    other = replace(surrogate, mean=surrogate.mean + 1.0)
    monkeypatch.setattr(model_assessment, "bundled_surrogate", lambda: other)
    assert model_assessment.assess_impact(impact) is None
    assert main(["run", "--no-figures", "-o", str(tmp_path), str(FLAGSHIP)]) == 0
    assert "not known: run thud-driver assess" in capsys.readouterr().out
    # A few drops of a coarse mesh replace the surrogate.
    coarse = replace(impact.case, model=thud.FiniteElement(radial_elements=2, polar_elements=16))
    for name, value in (("SAMPLES", 100), ("INDEX_SAMPLES", 4), ("_DIRECT_TIME", np.inf)):
        monkeypatch.setattr(model_assessment, name, value)
    expected = "100 drops; not by the bundled surrogate: the surrogate predicts "
    assert thud.assess(coarse).method.startswith(expected)


def test_version_of_the_bundled_surrogate_does_not_matter(monkeypatch: pytest.MonkeyPatch) -> None:
    surrogate = bundled_surrogate.bundled_surrogate()
    older = replace(surrogate, identity={**surrogate.identity, "thud": "0.1.0"})
    bundled_surrogate.bundled_surrogate.cache_clear()
    monkeypatch.setattr(bundled_surrogate, "read_surrogate", lambda _: older)
    assert thud.assess(thud.read_case(FLAGSHIP)).method == surrogate.accuracy


def test_two_damping_laws_of_the_same_ball_have_one_verdict() -> None:
    cases = [thud.read_case(path) for path in (FLAGSHIP, VISCOUS)]
    plain = [thud.solve(case).assess().result for case in cases]
    assert plain == ["does not conform", "conforms"]
    first, second = (thud.assess(case) for case in cases)
    assert first.result == second.result == "undecided by the model"
    assert abs(first.probability - second.probability) < first.error
    page = comparison.compare(cases)
    assert page.rows()[-1][1:3] == ("undecided by the model",) * 2
    assert len({id(verdict) for verdict in page.model_verdicts.values()}) == 1
    (reason,) = page.reasons
    assert reason.startswith("Over what is not known of rubber_ball_fe and rubber_ball_fe_viscous:")
    assert reason in page.html()


def test_verdict_of_direct_drops_is_that_of_a_closed_form() -> None:
    # A linear spring: the contact time is half a period, pi sqrt(mass / stiffness).
    model = thud.HuntCrossley(stiffness=61685.0, exponent=1.0, restitution=1.0)
    unknowns = thud.Unknowns(key=("stiffness",), low=(5e4,), high=(8e4,), reason=("an example",))
    verdict = thud.assess(thud.Case(model=model, unknowns=unknowns))
    (contact,) = (c for c in verdict.criteria if c.name == "contact_time")
    ends = np.pi**2 * 2.5 / np.array([0.022, 0.018]) ** 2
    expected = (min(ends[1], 8e4) - max(ends[0], 5e4)) / 3e4
    assert contact.probability == pytest.approx(expected, abs=contact.error + 0.01)
    quantiles = 5e4 + np.array([0.975, 0.025]) * 3e4
    np.testing.assert_allclose(
        [contact.low, contact.high], np.pi * np.sqrt(2.5 / quantiles), atol=5e-5
    )
    assert contact.indices["stiffness"] == pytest.approx(1.0, abs=0.1)
    assert contact.main_unknown == "stiffness"
    # Without losses the restitution is 1, for every stiffness.
    (restitution,) = (c for c in verdict.criteria if c.name == "restitution")
    assert restitution.probability == 0
    assert verdict.result == "does not conform"


@pytest.mark.parametrize(
    ("probability", "error", "result"),
    [(0.96, 0.0, "conforms"), (0.95, 0.0, "conforms"), (0.94, 0.0, "undecided by the model"),
     (0.96, 0.02, "undecided by the model"), (0.06, 0.0, "undecided by the model"),
     (0.04, 0.02, "undecided by the model"), (0.04, 0.0, "does not conform")],
)  # fmt: skip
def test_outcome_needs_95_percent(probability: float, error: float, result: str) -> None:
    verdict = thud.assess(thud.read_case(EXAMPLE))
    assert replace(verdict, probability=probability, error=error).result == result
    criterion = replace(verdict.criteria[0], probability=probability, error=error)
    assert criterion.result == result


def test_lists_of_unequal_length_are_refused() -> None:
    unknowns = thud.Unknowns(key=("friction",), low=(0.0,), high=(), reason=("none known",))
    case = thud.Case(ball=thud.Ball.standard(), model=thud.FiniteElement(), unknowns=unknowns)
    with pytest.raises(thud.InputError, match=naming("&unknowns", "high")):
        thud.compare({"ball": case})


def test_run_prints_the_verdict(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["run", "--no-figures", str(FLAGSHIP)]) == 0
    printed = capsys.readouterr().out
    verdict = thud.assess(thud.read_case(FLAGSHIP))
    assert f"  {verdict.message}\n" in printed
    # The values of the case do not conform; whether the source does is undecided.
    assert "  With these values the source does not conform to the limits" in printed
    assert "  The source" not in printed
    assert main(["assess", str(FLAGSHIP)]) == 0
    assert verdict.message in capsys.readouterr().out.splitlines()
    assert main(["assess", "-q", "--check", str(FLAGSHIP)]) == 3


def test_studies_and_fits_may_leave_the_ranges_of_unknowns() -> None:
    unknowns = thud.Unknowns(key=("mass",), low=(2.4,), high=(2.6,), reason=("scales",))
    case = thud.Case(unknowns=unknowns)
    parameters = {"mass": {"values": [1.0, 2.0]}}
    swept = thud.sweep({"case": case.to_namelist(), "parameters": parameters})
    assert not swept.dataset["status"].any()
    light = thud.solve(thud.Ball(mass=2.2))
    found = thud.fit(light, {"mass": thud.Parameter(low=1.0, high=3.0)}, case, unknowns=[])
    assert found.values["mass"] == pytest.approx(2.2, rel=1e-3)


def test_case_that_the_surrogate_covers_keeps_its_drop() -> None:
    case = thud.read_case(VISCOUS)
    _, covered = find_unknowns(case)
    assert covered
    viscous, fractional = (thud.solve(one) for one in (case, covered))
    np.testing.assert_allclose(viscous.levels(), fractional.levels(), atol=0.02)


def test_page_shows_the_verdict() -> None:
    page = (ROOT / "docs/verdict.md").read_text()
    verdict = thud.assess(thud.read_case(FLAGSHIP))
    assert f"\n{format_rows(verdict.rows())}\nby {verdict.method}\n{verdict.message}\n" in page
