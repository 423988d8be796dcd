"""Surrogates against the models they learn, against jumps, and against the exact verdict."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from conftest import names_in, naming
from scipy.stats import binom, norm

import thud
from thud import cli
from thud.studies import surrogate as training
from thud.studies.sampling import unit_samples
from thud.studies.surrogate import MIN_DROPS, regress
from thud.studies.trained_surrogate import assess_many, differing_keys

if TYPE_CHECKING:
    from pathlib import Path

    from conftest import ErrorsOf

pytest.importorskip("sklearn", reason="the extra surrogate is not installed")

FIXED = {"model": "modal_ball", "damping_law": "rising", "loss_factor": 0.2}
REGION: dict[str, Any] = {
    "name": "region",
    "fixed": FIXED,
    "parameters": {
        "height": {"low": 98, "high": 102, "unit": "cm"},
        "youngs_modulus": {"low": 1.7, "high": 1.9, "unit": "MPa"},
        "wall_thickness": {"low": 30, "high": 31, "unit": "mm"},
    },
}
# Within the region, around a ball that conforms.
TOLERANCES: dict[str, Any] = {
    "name": "tolerances",
    "fixed": {**FIXED, "youngs_modulus": 1.8e6},
    "design": {"size": 100, "seed": 4},
    "parameters": {
        "height": {"low": 98.5, "high": 101.5, "unit": "cm"},
        "wall_thickness": {"low": 30.2, "high": 30.8, "unit": "mm"},
    },
}
# The contact time is given: it and the levels depend on mass and height by powers.
LUMPED: dict[str, Any] = {
    "name": "lumped",
    "fixed": {"model": "hunt_crossley", "contact_time": 0.02, "restitution": 0.8},
    "parameters": {"mass": {"low": 2.0, "high": 3.0}, "height": {"low": 0.5, "high": 2.0}},
}


@pytest.fixture(scope="module")
def trained() -> thud.Surrogate:
    """Return a surrogate of the modal ball."""
    return thud.surrogate(REGION)


@pytest.fixture(scope="module")
def direct() -> thud.Uncertainty:
    """Return what the model itself says of the tolerances."""
    return thud.uncertainty(TOLERANCES)


@pytest.mark.slow
def test_held_out_drops_lie_within_the_stated_error(
    trained: thud.Surrogate, direct: thud.Uncertainty
) -> None:
    answered = thud.uncertainty(TOLERANCES, surrogate=trained).dataset
    found = np.abs(answered["floor_octave"] - direct.dataset["floor_octave"]).values
    outside = (found > trained.error_of("floor_octave")).sum(axis=0)
    # 5 % of the drops may lie outside; as many as this by chance once in 1000 times.
    assert (outside <= binom.ppf(0.999, len(found), 0.05)).all()
    for name in ("contact_time", "restitution"):
        ratio = 20 * np.abs(np.log10(answered[name] / direct.dataset[name])).values
        outside = (ratio > trained.error_of(name)).sum()
        assert outside <= binom.ppf(0.999, len(found), 0.05)
        assert answered[name].attrs["surrogate_error"] == trained.error_of(name)
    assert trained.worst[1] <= trained.bound == 0.1


def test_probability_lies_in_the_range_that_is_stated(
    trained: thud.Surrogate, direct: thud.Uncertainty
) -> None:
    result = thud.uncertainty(TOLERANCES, surrogate=trained)
    assert direct.surrogate_range is None
    assert result.surrogate_range
    low, high = result.surrogate_range
    assert low <= result.probability <= high
    # Of the verdicts that are decided, 5 % for each of seven quantities may err at most.
    sure = ~result.dataset["undecided"].values
    wrong = (result.dataset["conforms"] != direct.dataset["conforms"]).values[sure].mean()
    assert wrong <= 7 * 0.05
    assert abs(result.probability - direct.probability) <= high - low + wrong
    assert result.rows()[-1][0] == "  with errors of the surrogate"
    assert "surrogate of" in result.dataset.attrs["surrogate"]


def test_margin_and_verdict_are_those_of_the_library(direct: thud.Uncertainty) -> None:
    known = direct.dataset
    height = known["height"].values
    values = np.column_stack([
        known["floor_octave"], known["contact_time"], known["restitution"],
        np.ones(len(height)), np.full(len(height), 2.5), height,
    ])  # fmt: skip
    none = np.zeros_like(values)
    found = assess_many(values, none, "rubber_ball")
    np.testing.assert_array_equal(found["margin"], known["margin"])
    np.testing.assert_array_equal(found["conforms"], known["conforms"])
    assert not found["undecided"].any()
    assert 0 < found["conforms"].sum() < len(height)


def test_powers_of_a_lumped_source_are_learned() -> None:
    learned = thud.surrogate({**LUMPED, "surrogate": {"error": 0.01}})
    found = thud.sensitivity({**LUMPED, "design": {"size": 64}}, surrogate=learned)
    exact = thud.sensitivity({**LUMPED, "design": {"size": 64}})
    assert "surrogate" not in exact.indices
    share = found.indices["surrogate"].values[:5]
    # What the errors explain of the variance is at most what the bound allows.
    assert (share < (0.01 / 0.9) ** 2).all()
    difference = np.abs(found.indices["total"] - exact.indices["total"]).isel(output=slice(0, 5))
    assert (difference < 0.01).all()
    assert found.rows()[0][-1] == "error of the surrogate"
    # Of other quantities the variances are those in dB; what does not vary has none.
    time, peak = found.indices["surrogate"].values[5:7]
    missed = learned.mean_square("peak_force")[0]
    assert peak == pytest.approx(missed / np.var(20 * np.log10(found.dataset["peak_force"].values)))
    assert np.isnan(time)


def test_what_exceeds_the_bound_is_withheld() -> None:
    learned = thud.surrogate(LUMPED)
    place = learned.labels.index("peak force")
    worse = learned.residuals.copy()
    worse[:, place] = 0.2
    coarse = replace(learned, residuals=worse)
    assert coarse.to_dataframe().query("withheld").index.tolist() == ["peak force"]
    found = thud.sensitivity({**LUMPED, "design": {"size": 8}}, surrogate=coarse)
    assert np.isnan(found.dataset["peak_force"]).all()
    assert np.isfinite(found.dataset["floor_octave"]).all()
    assert np.isnan(found.indices["total"].sel(output="peak force")).all()
    assert found.dataset.attrs["surrogate"].endswith("above 0.1 dB: peak force")


def test_stated_errors_hold_as_often_as_they_say(trained: thud.Surrogate) -> None:
    # Of normal residuals the share within the error is known; it is to be 95 % or more in 95 % of
    # all trainings or more, and not in all.
    draw = np.random.default_rng(6)
    for count in (64, 200):
        points = np.zeros((count, 3))
        residuals = draw.normal(size=(count, 2000))
        errors = replace(trained, points=points, residuals=residuals).errors
        held = int((2 * norm.cdf(errors) - 1 >= 0.95).sum())
        assert binom.ppf(1e-4, 2000, 0.95) <= held < 2000


def test_leave_one_out_is_what_it_says() -> None:
    # The closed form against training without each point, with the same kernel.
    points = np.random.default_rng(3).random((40, 2))
    values = np.sin(5 * points[:, :1]) + points[:, 1:] ** 2
    values += 0.05 * np.random.default_rng(4).normal(size=(40, 1))
    whole = regress(points, values, np.array([True]))
    from sklearn.gaussian_process.kernels import Matern, WhiteKernel

    # The noise follows from the weights: K w = z.
    scale = values.std()
    normal, weights = (values - values.mean()) / scale, whole["weights"] / scale
    shape = Matern(whole["length"], nu=2.5)(points)
    amplitude, noise = np.linalg.lstsq(
        np.column_stack([shape @ weights, weights]), normal[:, 0], rcond=None
    )[0]
    # Weights hold the amplitude of the kernel.
    assert amplitude == pytest.approx(1.0, rel=1e-6)
    for i in (0, 17, 39):
        rest = np.arange(40) != i
        kernel = shape[np.ix_(rest, rest)] + noise * WhiteKernel(1.0)(points[rest])
        predicted = shape[i, rest] @ np.linalg.solve(kernel, normal[rest])
        residual = (predicted - normal[i])[0] * scale
        assert residual == pytest.approx(whole["residuals"][i, 0], rel=1e-4, abs=1e-9)


def test_a_response_with_a_jump_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    smooth = training.solve_many

    def jump(columns: dict[str, Any], *rest: Any, **words: Any) -> thud.Ensemble:  # noqa: ANN401
        found = smooth(columns, *rest, **words)
        levels = found.floor_octave.copy()
        levels[:, 4] += columns["mass"] > 2.5
        return replace(found, floor_octave=levels)

    study = {**LUMPED, "surrogate": {"size": 128}}
    assert thud.surrogate(study).worst[1] < 0.01
    monkeypatch.setattr(training, "solve_many", jump)
    words = naming("floor level 500 Hz", 128, "0.1 dB", "[surrogate] error")
    with pytest.raises(thud.NumericalError, match=words):
        thud.surrogate(study)


def test_drops_are_added_until_the_bound_holds(monkeypatch: pytest.MonkeyPatch) -> None:
    study = {**REGION, "fixed": {"model": "hollow_sphere"}}
    first = thud.surrogate(study)
    assert len(first.points) == 64
    bound = 0.6 * first.worst[1]
    found = thud.surrogate({**study, "surrogate": {"error": bound, "size": 2048}})
    assert len(found.points) > 64
    assert found.worst[1] <= bound
    np.testing.assert_array_equal(found.points[:64], first.points)
    # Steps add a half or a third, up to the maximum; drops are those of one sequence.
    monkeypatch.setattr(training, "regress", lambda points, drops, _: {
        "length": np.ones(points.shape[1]), "weights": np.zeros_like(drops),
        "residuals": np.ones_like(drops),
    })  # fmt: skip
    plan = training.read_training({**study, "surrogate": {"size": 400}})
    counts, step = [], None
    while step is None or len(step.points) < 400:
        step = training.extend(step, plan, None, progress=False)
        counts.append(len(step.points))
    assert counts == [64, 96, 128, 192, 256, 384, 400]
    whole = unit_samples("sobol", 3, 400, 0, 0, 400)
    np.testing.assert_array_equal(step.points, whole)
    heights = step.region[0, 0] + whole[:, 0] * np.ptp(step.region[0])
    drops = thud.solve_many({"height": heights, **{
        name: low + whole[:, i] * (high - low)
        for i, (name, (low, high)) in enumerate(plan.region.items()) if i
    }}, step.case)  # fmt: skip
    np.testing.assert_array_equal(step.drops[:, -5:], drops.floor_octave)


def test_peaks_that_differ_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(training, "peak_count", lambda force, _: 1 + (force.max() > 1500))
    with pytest.raises(thud.InputError, match=naming("peaks", 1, 2)):
        thud.surrogate(LUMPED)


def test_points_outside_the_region_are_refused(trained: thud.Surrogate) -> None:
    wide = {**TOLERANCES, "parameters": {"height": {"values": [0.9, 1.0]}}}
    study = {name: entry for name, entry in wide.items() if name != "design"}
    study["fixed"] = {**study["fixed"], "wall_thickness": 0.0305}
    found = thud.sweep(study, surrogate=trained).dataset
    assert found["status"].values.tolist() == [1, 0]
    reasons = found["reason"].values.tolist()
    assert re.search(naming("height", 0.9, 0.98, 1.02), reasons[0])
    assert not reasons[1]
    assert np.isnan(found["floor_octave"].values[0]).all()
    assert np.isnan(found["contact_time"].values[0])
    assert not found["conforms"].values[0]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"fixed": {**FIXED, "loss_factor": 0.1}}, naming("loss_factor", 0.1, "surrogate")),
        ({"fixed": {"model": "hollow_sphere"}}, naming("surrogate", "model")),
        ({"parameters": {"mass": {"low": 2.4, "high": 2.6}}}, naming("mass", "surrogate")),
        (
            {
                "fixed": {"model": "modal_ball"},
                "parameters": {"damping_law": {"values": ["rising"]}},
            },
            naming("damping_law", "surrogate", "height"),
        ),
    ],
)
def test_other_cases_are_refused(
    trained: thud.Surrogate, change: dict[str, Any], words: str
) -> None:
    with pytest.raises(thud.InputError, match=words):
        thud.uncertainty({**TOLERANCES, **change}, surrogate=trained)
    with pytest.raises(thud.InputError, match=naming("mass", "surrogate")):
        trained.predict(trained.case, {"mass": np.array([2.5])})


def test_files_of_a_run_make_no_other_case() -> None:
    # Studies write no snapshots; a fit keeps what its case says of them.
    cases = [
        thud.Case(model=thud.FiniteElement(snapshot_interval=interval)) for interval in (0.0, 1e-3)
    ]
    assert not differing_keys(*cases)
    other = replace(cases[0], drop=thud.Drop(height=0.9))
    assert differing_keys(cases[0], other) == [("&drop: height", "1.0", "0.9")]


def test_files_hold_everything(trained: thud.Surrogate, tmp_path: Path) -> None:
    path = tmp_path / "ball.npz"
    trained.save(path)
    again = thud.read_surrogate(path)
    assert again.digest == trained.digest
    study = {**TOLERANCES, "surrogate": {"file": str(path)}}
    one, other = thud.uncertainty(study), thud.uncertainty(TOLERANCES, surrogate=trained)
    np.testing.assert_array_equal(one.levels, other.levels)
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    (tmp_path / "damaged.npz").write_bytes(content)
    (tmp_path / "pickle.npz").write_bytes(b"")
    np.savez(tmp_path / "pickle.npz", header=np.array([object()]), allow_pickle=True)
    for name in ("damaged.npz", "pickle.npz", "missing.npz"):
        with pytest.raises(thud.InputError, match=naming(name)):
            thud.read_surrogate(tmp_path / name)
    changed = replace(trained, drops=trained.drops + 0.1)
    assert changed.digest != trained.digest
    # What is not finished, or of another version, is refused when it is used.
    for part, words in (("bound", "not finished"), ("version", "0.0")):
        value = {"bound": 1e-9, "version": "0.0"}[part]
        replace(trained, **{part: value}).save(path)
        with pytest.raises(thud.InputError, match=words):
            thud.uncertainty(study)


def test_training_resumes_and_results_are_kept(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    errors_of: ErrorsOf,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    path = tmp_path / "lumped.toml"
    path.write_text(
        "fixed = {model='hunt_crossley', contact_time=0.02, restitution=0.8}\n"
        "parameters = {mass={low=2, high=3}, height={low=1, high=2}}\n"
    )
    command = ["surrogate", str(path), "--no-figures", "-o", str(tmp_path / "results")]
    assert cli.main(["surrogate", str(path), "-o", str(tmp_path / "results")]) == 0
    assert "floor level 500 Hz" in capsys.readouterr().out
    folder = tmp_path / "results"
    assert set(names_in(folder)) == {"lumped_surrogate.npz", "lumped.svg", "thud.txt"}
    first = thud.read_surrogate(folder / "lumped_surrogate.npz")
    # A training takes the drops that are there, and keeps those of each step.
    with monkeypatch.context() as patch:
        patch.setattr(training, "solve_many", None)
        assert cli.main(command) == 0
    assert thud.read_surrogate(folder / "lumped_surrogate.npz").digest == first.digest
    path.write_text(f"{path.read_text()}surrogate = {{error=1e-9, size=96}}\n")
    assert "96 drops" in errors_of(*command, code=2)
    longer = thud.read_surrogate(folder / "lumped_surrogate.npz")
    np.testing.assert_array_equal(longer.drops[:64], first.drops)
    assert len(longer.drops) == 96
    path.write_text(path.read_text().partition("surrogate")[0])
    # Another region needs other drops, and the old ones are not removed without a word.
    path.write_text(path.read_text().replace("high=3", "high=4"))
    assert "lumped" in errors_of(*command)
    assert cli.main([*command, "--replace"]) == 0
    assert thud.read_surrogate(folder / "lumped_surrogate.npz").region.max() == 4


def test_results_that_are_written_hold_the_errors(trained: thud.Surrogate, tmp_path: Path) -> None:
    one = thud.uncertainty(TOLERANCES, surrogate=trained)
    thud.uncertainty(TOLERANCES, tmp_path, surrogate=trained)
    other = thud.read_sweep(tmp_path / "tolerances.nc").dataset
    np.testing.assert_array_equal(one.dataset["floor_octave"], other["floor_octave"])
    np.testing.assert_array_equal(
        other["floor_octave"].attrs["surrogate_error"], trained.error_of("floor_octave")
    )
    # The model itself has other results.
    with pytest.raises(thud.InputError, match=naming("tolerances.nc", "surrogate")):
        thud.uncertainty(TOLERANCES, tmp_path)


def test_map_shows_undecided_verdicts(trained: thud.Surrogate) -> None:
    study = {
        "fixed": {**FIXED, "height": 1.0},
        "parameters": {
            "wall_thickness": {"low": 30, "high": 31, "count": 21, "unit": "mm"},
            "youngs_modulus": {"low": 1.7, "high": 1.9, "count": 21, "unit": "MPa"},
        },
    }
    margin = np.abs(thud.design(study, surrogate=trained).dataset["margin"].values)
    # Errors of the levels as large as half of the margins.
    error = float(np.median(margin))
    level = ["level" in name for name in trained.labels]
    residuals = np.full_like(trained.residuals, error) * level
    found = thud.design(study, surrogate=replace(trained, residuals=residuals, bound=error))
    undecided = found.dataset["undecided"]
    limits = {one.name: one for one in thud.assess_levels([0] * 5, 0, 0, 1, 0, 0).criteria}
    rest = [
        (found.dataset[name] >= limits[name].lower) & (found.dataset[name] <= limits[name].upper)
        for name in ("contact_time", "restitution")
    ]
    near = found.dataset["margin"] < error
    np.testing.assert_array_equal(
        undecided, near & (found.dataset["margin"] >= -error) & rest[0] & rest[1]
    )
    assert 0 < int(undecided.sum()) < undecided.size
    assert ("undecided because of the surrogate", f"{int(undecided.sum())}") in found.rows()
    labels = [text.get_text() for text in thud.plot.draw_design(found).legends[0].get_texts()]
    assert "Undecided by surrogate" in labels


def test_figure_shows_held_out_errors(trained: thud.Surrogate) -> None:
    figure = thud.plot.draw_surrogate(trained)
    (axes,) = figure.axes
    labels = [label.get_text() for label in axes.get_yticklabels()]
    assert labels == [
        "Contact time", "Restitution",
        *(f"Level {band} Hz" for band in ("31.5", "63", "125", "250", "500")),
    ]  # fmt: skip
    shown = [line.get_xdata() for line in axes.lines if len(line.get_xdata()) == 64]
    np.testing.assert_array_equal(shown[-1], trained.residuals[:, trained.assessed][:, -1])


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ({"error": 0}, naming("[surrogate] error", 0)),
        ({"error": "x"}, naming("[surrogate] error", "'x'")),
        ({"size": 10}, naming("[surrogate] size", 10, 64)),
        ({"drops": 100}, naming("[surrogate]", "'drops'")),
        ({"file": "none.npz"}, naming("[surrogate]", "'file'")),
    ],
)
def test_tables_are_checked(table: dict[str, Any], words: str) -> None:
    with pytest.raises(thud.InputError, match=words):
        thud.surrogate({**LUMPED, "surrogate": table})


@pytest.mark.parametrize(
    ("table", "words"),
    [({"file": "none.npz"}, "none.npz"), ({"file": "a", "size": 64}, "'size'"), ({}, "file")],
)
def test_studies_name_a_trained_surrogate(table: dict[str, Any], words: str) -> None:
    study = {**LUMPED, "design": {"kind": "sobol", "size": 4}, "surrogate": table}
    with pytest.raises(thud.InputError, match=naming("surrogate", words)):
        thud.sweep(study)


def test_only_real_parameters_are_learned() -> None:
    ends = {"low": 1.0, "high": 2.0}
    for name, entry in (
        ("sample_rate", {"low": 20000.0, "high": 44100.0}), ("substeps", {"low": 1, "high": 3}),
        ("density", ends), ("damping_law", {"values": ["rising"]}),
        ("height", {"std": 0.1, "mean": 1.0}),
        ("height", {**ends, "count": 3}), ("height", {**ends, "scale": "log"}),
    ):  # fmt: skip
        study = {"fixed": {"model": "modal_ball"}, "parameters": {name: entry}}
        with pytest.raises(thud.InputError, match=naming("surrogate", name)):
            thud.surrogate(study)
    with pytest.raises(thud.InputError, match=naming("density", "surrogate", "mass")):
        thud.surrogate({**REGION, "fixed": {**FIXED, "density": 1100.0}})


def test_drops_without_result_are_refused() -> None:
    study = {**LUMPED, "parameters": {**LUMPED["parameters"], "mass": {"low": -1, "high": 3}}}
    with pytest.raises(thud.InputError, match=naming(64, "&ball: mass")):
        thud.surrogate(study)


def test_fewest_drops_are_those_of_the_order_statistic() -> None:
    # The largest of n bounds 95 % with a confidence of 1 - 0.95**n.
    fewest = math.ceil(math.log(0.05) / math.log(0.95))
    assert fewest <= MIN_DROPS < 1.1 * fewest


def test_verdict_is_undecided_where_errors_reach_a_limit() -> None:
    criteria = thud.assess_levels(np.zeros(5), 0, 0, 0, 0, 0).criteria
    middle = np.array([(one.lower + one.upper) / 2 for one in criteria])
    half = np.array([(one.upper - one.lower) / 2 for one in criteria])

    def verdict(value: np.ndarray, error: np.ndarray) -> tuple[float, bool, bool]:
        found = assess_many(value[None], error[None], "rubber_ball")
        return tuple(found[name][0] for name in ("margin", "conforms", "undecided"))  # type: ignore[return-value]

    none = np.zeros(10)
    margin, conforms, undecided = verdict(middle, none)
    assert margin == pytest.approx(half[:5].min())
    assert (conforms, undecided) == (True, False)
    for i in (0, 4, 5, 6, 9):
        one = np.eye(10)[i]
        for side in (-1, 1):
            inside, outside = (middle + side * r * half * one for r in (0.9, 1.1))
            # An error of less than a tenth of the half width, and one of more.
            for r, is_undecided in ((0.09, False), (0.11, True)):
                error = r * half * one
                assert verdict(inside, error)[1:] == (True, is_undecided)
                assert verdict(outside, error)[1:] == (False, is_undecided)
    # A sample that surely fails another criterion is decided.
    failed = middle + 2 * half * np.eye(10)[6] + 0.9 * half * np.eye(10)[0]
    assert verdict(failed, 0.2 * half * np.eye(10)[0])[1:] == (False, False)


def answering() -> thud.Surrogate:
    """Return a surrogate whose weights are 0: it predicts the mean of its drops."""
    names = {"floor_octave": 5, "elastic_octave": 5, "contact_time": 1, "restitution": 1}
    mean = np.array(
        [39.0, 31, 23, 17, 12.5, 1, 2, 3, 4, 5, 20 * np.log10(0.02), 20 * np.log10(0.8)]
    )
    return thud.Surrogate(
        thud.Case(model=thud.HollowSphere()), ("height", "mass"),
        np.array([[0.9, 1.1], [2.0, 3.0]]), names, 0.1, 1, 0, thud.__version__,
        np.random.default_rng(1).random((64, 2)), np.tile(mean, (64, 1)), np.ones(2),
        np.zeros((64, 12)), np.random.default_rng(2).normal(0, 0.02, (64, 12)),
    )  # fmt: skip


def test_answers_are_the_verdict_of_what_is_predicted() -> None:
    surrogate = answering()
    case = replace(surrogate.case, levels=thud.Levels(force="floor"))
    surrogate = replace(surrogate, case=case)
    height = np.array([1.0, 0.985, 1.2, 0.9, 1.1, 0.9 - 1e-12, 1.1 + 1e-12, 0.9 - 1e-8])
    found = surrogate.predict(case, {"height": height, "mass": 2.5})
    assert found["status"].tolist() == [0, 0, 1, 0, 0, 0, 0, 1]
    good = found["status"] == 0
    assert found["floor_octave"][good] == pytest.approx(np.tile(surrogate.drops[0, :5], (6, 1)))
    assert found["contact_time"][good] == pytest.approx(0.02)
    assert found["restitution"][good] == pytest.approx(0.8)
    assert found["conforms"].tolist() == [True] + [False] * 7
    assert [bool(reason) for reason in found["reason"]] == (~good).tolist()
    assert "height = 1.2" in found["reason"][2]
    # Errors: sorted magnitudes, at the order statistic.
    sizes = np.sort(abs(surrogate.residuals), axis=0)
    below = [
        sum(math.comb(64, k) * 0.95**k * 0.05 ** (64 - k) for k in range(n + 1)) for n in range(64)
    ]
    place = next(n for n, share in enumerate(below) if share >= 0.95)
    assert surrogate.errors.tolist() == sizes[place].tolist()
    assert surrogate.error_of("elastic_octave").tolist() == sizes[place][5:10].tolist()
    assert surrogate.mean_square("contact_time") == pytest.approx(
        (surrogate.residuals[:, 10] ** 2).mean()
    )
    judged = [0, 1, 2, 3, 4, 10, 11]
    worst = judged[int(np.argmax(surrogate.errors[judged]))]
    assert surrogate.worst == (surrogate.labels[worst], surrogate.errors[worst])
    # A level at its limit within the error is undecided, and so is a time by its ratio.
    limit = thud.assess_levels(np.zeros(5), 0, 0, 0, 0, 0).criteria[5].upper
    for decibels, is_undecided in ((0.5, True), (1.5, False)):
        drops = surrogate.drops.copy()
        drops[:, 10] = 20 * np.log10(limit) - decibels * surrogate.errors[10]
        near = replace(surrogate, drops=drops).predict(case, {"height": np.array([1.0])})
        assert near["undecided"].tolist() == [is_undecided]


def test_quantity_that_varies_by_rounding_only_is_its_mean() -> None:
    points = np.random.default_rng(1).random((20, 2))
    varying = 30 + points.sum(axis=1)
    values = np.column_stack([varying, 7 + 1e-12 * points[:, 0], np.full(20, np.nan)])
    found = regress(points, values, np.array([True, False, False]))
    assert not found["weights"][:, 1].any()
    assert not found["residuals"][:, 1].any()
    assert found["residuals"][:, 0].any()
    assert np.isnan(found["residuals"][:, 2]).all()
