"""The verdict over what is not known of a source."""

from __future__ import annotations

import re
import subprocess
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import f90nml
import numpy as np
import pytest
from conftest import naming
from scipy.stats import truncnorm

import thud
from thud.base.tables import format_rows, wrap
from thud.cli import main
from thud.comparison import comparison
from thud.level.estimate import NORMAL_FACTOR
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
    message = "nothing is known to vary in this case: .*model = .*; allowed: &unknowns with key"
    with pytest.raises(thud.InputError, match=message):
        thud.assess(thud.Case())


@pytest.mark.parametrize(
    ("group", "key", "value", "allowed"),
    [("drop", "height", 0.9, "0.95 <= height <= 1.05"),
     ("ball", "youngs_modulus", 1.6e6, "1.87e+06 <= youngs_modulus"),
     ("model", "layer_stiffness", 1e9, "&contact: layer_stiffness = 1000000000.0 differs")],
)  # fmt: skip
def test_message_names_the_key_outside_the_default_unknowns(
    group: str, key: str, value: float, allowed: str
) -> None:
    case = thud.read_case(FLAGSHIP)
    other = replace(case, **{group: replace(getattr(case, group), **{key: value})})
    with pytest.raises(thud.InputError, match=re.escape(allowed)):
        thud.assess(other)


def hunt_crossley(**unknowns: tuple[float, float]) -> thud.Case:
    ends = list(zip(*unknowns.values(), strict=True))
    stated = thud.Unknowns(tuple(unknowns), *ends, reason=("an example",) * len(unknowns))
    model = thud.HuntCrossley(stiffness=61685.0, exponent=1.0, restitution=0.8)
    return thud.Case(model=model, unknowns=stated)


def test_unknown_without_effect_is_refused() -> None:
    case = hunt_crossley(stiffness=(5e4, 8e4), youngs_modulus=(1e6, 3e6))
    with pytest.raises(thud.InputError, match=r"= 1e\+06 and 3e\+06 make the same drop"):
        thud.assess(case)


@pytest.mark.parametrize(
    ("model", "key", "low", "high", "message"),
    [(thud.FiniteElement(viscosity="fractional", fractional_order=0.3, loss_factor=0.143),
      "loss_factor", 0.1, 0.9, "&unknowns: loss_factor = 0.9 are impossible"),
     (thud.FiniteElement(viscosity="kelvin_voigt"), "fractional_order", 0.2, 0.5,
      "fractional_order = 1 of the drop is outside low = 0.2 and high = 0.5")],
)  # fmt: skip
def test_impossible_ranges_are_refused_before_any_drop(  # noqa: PLR0913, PLR0917
    model: thud.FiniteElement,
    key: str,
    low: float,
    high: float,
    message: str,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def fail(*_: object) -> None:
        pytest.fail("a drop is computed")

    monkeypatch.setattr(model_assessment, "compute", fail)
    unknowns = thud.Unknowns(key=(key,), low=(low,), high=(high,), reason=("an example",))
    with pytest.raises(thud.InputError, match=re.escape(message)):
        thud.assess(replace(thud.read_case(FLAGSHIP), model=model, unknowns=unknowns))


def test_method_is_that_of_the_measured_time_if_the_estimate_is_too_low(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def train(*_: object, **__: object) -> None:
        message = "a surrogate is trained"
        raise thud.NumericalError(message)

    monkeypatch.setattr(model_assessment, "_train", train)
    times = iter([0.0, 8.0])
    monkeypatch.setattr(model_assessment.time, "process_time", lambda: next(times))
    with pytest.raises(thud.NumericalError, match="trained"):
        thud.assess(hunt_crossley(stiffness=(5e4, 8e4)), progress=True)
    # A drop takes 1 s.
    assert "up to an estimated 17 min on one core" in capsys.readouterr().err


def test_direct_drops_are_computed_in_small_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    for name, value in (("SAMPLES", 300), ("INDEX_SAMPLES", 8)):
        monkeypatch.setattr(model_assessment, name, value)
    case = hunt_crossley(stiffness=(5e4, 8e4))
    expected = thud.assess(case)
    sizes = []
    solve_many = model_assessment.solve_many

    def counted(columns: dict[str, Any], *others: Any, **options: Any) -> thud.Ensemble:  # noqa: ANN401
        sizes.append(len(columns["stiffness"]))
        return solve_many(columns, *others, **options)

    monkeypatch.setattr(model_assessment, "solve_many", counted)
    length = case.sampling.sample_rate * case.sampling.duration
    monkeypatch.setattr(model_assessment, "_MAX_BYTES", 16 * length * 100)
    found = thud.assess(case)
    assert max(sizes) == 100
    assert found.identity == expected.identity


def test_numerical_errors_of_direct_drops_widen_the_range(monkeypatch: pytest.MonkeyPatch) -> None:
    case = hunt_crossley(stiffness=(5e4, 8e4))
    coarse = replace(case, sampling=replace(case.sampling, sample_rate=8000.0))
    monkeypatch.setattr(model_assessment, "SAMPLES", 512)
    monkeypatch.setattr(model_assessment, "INDEX_SAMPLES", 16)
    criterion, finer = (thud.assess(c).criteria[4] for c in (coarse, case))
    assert criterion.high - criterion.low > finer.high - finer.low
    # The restitution does not vary; its error alone is a range.
    source = model_assessment._direct_source(  # noqa: SLF001
        thud.solve(case), find_unknowns(case)[0], progress=False
    )
    source.numerical_errors[:, 6] = 0.01
    restitution = source.assess().criteria[6]
    assert not restitution.indices
    low, high = (float(end) for end in restitution.range.split(" to "))
    assert low < 0.8 < high


def test_huge_standard_deviation_is_uniform() -> None:
    fractions = np.linspace(0, 1, 11)
    for deviation in (2e3, 1e18):
        values = Unknown("mass", 2.0, 3.0, deviation, "").quantiles(fractions, 2.5)
        np.testing.assert_allclose(values, 2 + fractions, rtol=1e-6)


def test_comparison_shares_equal_verdicts_only() -> None:
    case = thud.read_case(FLAGSHIP)
    unknowns = thud.Unknowns(
        key=("youngs_modulus",), low=(1.87e6,), high=(2.29e6,), reason=("hardness",),
        standard_deviation=(2e4,),
    )  # fmt: skip
    soft, hard = (
        replace(case, name=name, ball=replace(case.ball, youngs_modulus=e), unknowns=unknowns)
        for name, e in (("soft", 1.95e6), ("hard", 2.2e6))
    )
    impacts = {one.name: thud.solve(one) for one in (soft, hard)}
    impacts["twin"] = impacts["hard"]
    found = model_assessment.assess_impacts(impacts)
    reverse = model_assessment.assess_impacts(dict(reversed(impacts.items())))
    assert {n: v.identity for n, v in found.items()} == {n: v.identity for n, v in reverse.items()}
    assert found["twin"] is found["hard"]
    assert found["soft"].identity != found["hard"].identity


def test_verdict_does_not_depend_on_the_mesh_of_the_case() -> None:
    case = thud.read_case(FLAGSHIP)
    coarse = replace(case, model=replace(case.model, radial_elements=3, polar_elements=16))
    found, expected = (thud.assess(thud.solve(one)) for one in (coarse, case))
    assert found.identity == expected.identity


def test_probability_is_an_interval_within_its_bounds() -> None:
    verdict = thud.assess(thud.read_case(FLAGSHIP))
    wide = replace(verdict, probability_range=(0.0, 0.67))
    assert wide.shown_probability == "0 to 67 %"
    assert replace(verdict, probability_range=(0.6, 1.0)).shown_probability == "60 to 100 %"


@pytest.mark.parametrize(
    ("inside", "adverse", "favorable"),
    [(960, 958, 1000), (960, 900, 962), (500, 100, 500), (0, 0, 400), (1000, 1000, 1000)],
)
def test_errors_count_on_the_side_that_they_change(
    inside: int, adverse: int, favorable: int
) -> None:
    samples = [np.arange(1000) < count for count in (inside, adverse, favorable)]
    probability, (low, high) = model_assessment._probability(*samples)  # noqa: SLF001
    assert probability == inside / 1000
    sampling = NORMAL_FACTOR * np.sqrt(probability * (1 - probability) / 1000)
    assert low == pytest.approx(probability - np.hypot(sampling, (inside - adverse) / 1000))
    assert high == pytest.approx(
        min(probability + np.hypot(sampling, (favorable - inside) / 1000), 1.0)
    )


def test_wide_probabilities_raise_a_warning() -> None:
    verdict = thud.assess(thud.read_case(FLAGSHIP))
    assert not verdict.warnings
    criteria = list(verdict.criteria)
    criteria[4] = replace(criteria[4], probability_range=(0.29, 0.71))
    errors = {
        model_assessment._SURROGATE: np.full(10, 0.1),  # noqa: SLF001
        model_assessment._NUMERICAL: np.full(10, 0.2),  # noqa: SLF001
    }
    (warning,) = model_assessment._warnings(tuple(criteria), errors)  # noqa: SLF001
    assert warning == (
        "500 Hz: the probability is 29 to 71 %, so wide mainly because of the numerical error of "
        "the drops, 0.2 dB: refine &mesh or &sampling"
    )


def test_numerical_error_makes_the_verdict_of_a_drop_undecided(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    ball = thud.Ball(poisson_ratio=0.5, youngs_modulus=2.08e6)
    model = thud.FiniteElement(radial_elements=3, polar_elements=16)
    impact = thud.solve(thud.Case(ball=ball, model=model))
    verdict = impact.assess()
    assert all(c.lower <= c.value <= c.upper for c in verdict.criteria)
    assert verdict.result == "undecided"
    assert not verdict
    (cause,) = (c for c in verdict.criteria if c.result == "undecided")
    assert cause.estimate.expanded == pytest.approx(impact.octave_500_error)
    assert verdict.rows()[0][2] == "numerical error"
    thud.write_case(impact.case, tmp_path / "case.nml")
    folder = tmp_path / "results"
    run = ["run", "--no-figures", "--check", "-o", str(folder), str(tmp_path / "case.nml")]
    assert main(run) == 3
    assert "it is undecided whether the source conforms" in capsys.readouterr().out
    summary = f90nml.read(folder / "summary.nml")["verdict"]
    assert (summary["conforms"], summary["result"]) == (False, "undecided")
    assert summary["numerical_error"][4] == impact.octave_500_error
    assert "10.5,14.5,undecided" in (folder / "levels.csv").read_text()
    header, *rows = (folder / "model_verdict.csv").read_text().splitlines()
    assert header.startswith("criterion,unit,value,low,high,")
    assert len(rows) == len(verdict.criteria) + 1
    assert comparison.compare({"coarse": impact}).rows()[7][1].endswith(" undecided")


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
        lambda case: replace(case, sampling=replace(case.sampling, sample_rate=16000.0)),
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
    assert first.result == second.result == "undecided"
    low, high = first.probability_range
    assert low < second.probability < high
    page = comparison.compare(cases)
    assert page.rows()[-1][1:3] == ("undecided",) * 2
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
    low, high = contact.probability_range
    assert low - 0.01 <= expected <= high + 0.01
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
    ("low", "high", "result"),
    [(0.96, 0.96, "conforms"), (0.95, 1.0, "conforms"), (0.94, 0.94, "undecided"),
     (0.94, 0.98, "undecided"), (0.06, 0.06, "undecided"),
     (0.02, 0.06, "undecided"), (0.0, 0.05, "does not conform")],
)  # fmt: skip
def test_outcome_needs_95_percent(low: float, high: float, result: str) -> None:
    verdict = thud.assess(thud.read_case(EXAMPLE))
    assert replace(verdict, probability_range=(low, high)).result == result
    criterion = replace(verdict.criteria[0], probability_range=(low, high))
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
    assert f"{wrap(f'  {verdict.message}')}\n" in printed
    # The values of the case do not conform; whether the source does is undecided.
    assert "  With these values the source does not conform to the limits" in printed
    assert "  The source" not in printed
    assert main(["assess", str(FLAGSHIP)]) == 0
    assert capsys.readouterr().out.startswith(f"{wrap(str(verdict))}\nResults: ")
    undecided = [c.criterion.quantity.title for c in verdict.criteria if c.result != "conforms"]
    assert undecided == ["63 Hz", "500 Hz"]
    assert all(title in verdict.message for title in undecided)
    for folder in ("rubber_ball_fe", "rubber_ball_fe_unknowns"):
        text = Path(f"outputs/{folder}/model_verdict.csv").read_text()
        assert text == verdict.to_csv()
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
    shown = f"{format_rows(verdict.rows())}\nby {verdict.method}\n{verdict.message}"
    assert f"\n{wrap(shown)}\n" in page
