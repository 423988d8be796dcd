"""Surrogates against the models they learn, against jumps, and against the exact verdict."""

from __future__ import annotations

import itertools
import math
import re
from copy import copy
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import xarray as xr
from conftest import names_in, naming
from scipy.stats import binom, norm

import thud
from thud import cli
from thud.studies import run
from thud.studies.trained_surrogate import MIN_DROPS, assess_many, differing_keys, regress

if TYPE_CHECKING:
    from collections.abc import Callable

pytest.importorskip("sklearn", reason="the extra surrogate is not installed")

FIXED = {"model": "modal_ball", "damping_law": "rising", "loss_factor": 0.2}
REGION: dict[str, Any] = {
    "name": "region",
    "design": {"size": 64},
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
    "design": {"kind": "sobol", "size": 64},
    "fixed": {"model": "hunt_crossley", "contact_time": 0.02, "restitution": 0.8},
    "parameters": {"mass": {"low": 2.0, "high": 3.0}, "height": {"low": 0.5, "high": 2.0}},
}


def altered(surrogate: thud.Surrogate, **values: object) -> thud.Surrogate:
    """Return a surrogate with other attributes than follow from its drops."""
    result = copy(surrogate)
    vars(result).update(values)
    return result


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
    assert trained.worst[1] <= 0.1


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


def test_powers_of_a_lumped_source_are_learned() -> None:
    learned = thud.surrogate(LUMPED)
    found = thud.sensitivity({**LUMPED, "design": {"size": 64}}, surrogate=learned)
    exact = thud.sensitivity({**LUMPED, "design": {"size": 64}})
    assert "surrogate" not in exact.indices
    share = found.indices["surrogate"].values[:5]
    # What the errors explain of the variance is at most that of errors of 0.01 dB.
    assert (share < (0.01 / 0.9) ** 2).all()
    difference = np.abs(found.indices["total"] - exact.indices["total"]).isel(output=slice(0, 5))
    assert (difference < 0.01).all()
    assert found.rows()[0][-1] == "error of the surrogate"
    # Of other quantities the variances are those in dB; what does not vary has none.
    time, peak = found.indices["surrogate"].values[5:7]
    missed = learned.mean_square("peak_force")[0]
    assert peak == pytest.approx(missed / np.var(20 * np.log10(found.dataset["peak_force"].values)))
    assert np.isnan(time)


def test_stated_errors_hold_as_often_as_they_say(trained: thud.Surrogate) -> None:
    # Of normal residuals the share within the error is known; it is to be 95 % or more in 95 % of
    # all trainings or more, and not in all.
    draw = np.random.default_rng(6)
    for count in (64, 200):
        points = np.zeros((count, 3))
        residuals = draw.normal(size=(count, 2000))
        errors = altered(trained, points=points, residuals=residuals).errors
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


def of_changed_drops(
    monkeypatch: pytest.MonkeyPatch, change: Callable[[dict[str, Any]], None]
) -> thud.Surrogate:
    """Return the surrogate of the lumped source with changed results of its drops."""
    evaluate = run.evaluate

    def changed(*block: Any) -> dict[str, Any]:  # noqa: ANN401
        results = evaluate(*block)
        results["floor_octave"] = results["floor_octave"].copy()
        change(results | {"mass": block[1]["mass"]})
        return results

    monkeypatch.setattr(run, "evaluate", changed)
    return thud.surrogate(LUMPED)


def test_error_of_a_response_with_a_jump_is_stated(monkeypatch: pytest.MonkeyPatch) -> None:
    assert thud.surrogate(LUMPED).worst[1] < 0.01

    def jump(results: dict[str, Any]) -> None:
        results["floor_octave"][:, 4] += results["mass"] > 2.5

    label, error = of_changed_drops(monkeypatch, jump).worst
    assert label == "floor level 500 Hz"
    assert error > 0.1


def test_peaks_that_differ_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    def add_peak(results: dict[str, Any]) -> None:
        results["peaks"][7] = 2

    with pytest.raises(thud.InputError, match=naming("peaks", 1, 2)):
        of_changed_drops(monkeypatch, add_peak)


def test_drops_are_those_of_the_study(trained: thud.Surrogate) -> None:
    values = trained.region[:, 0] + trained.points * np.ptp(trained.region, axis=1)
    drops = thud.solve_many(dict(zip(trained.keys, values.T, strict=True)), trained.case)
    np.testing.assert_allclose(trained.drops[:, -5:], drops.floor_octave, atol=1e-9)
    strata = np.sort((trained.points * 64).astype(int), axis=0)
    np.testing.assert_array_equal(strata, np.arange(64)[:, None].repeat(3, axis=1))


def test_points_outside_the_region_are_refused(trained: thud.Surrogate) -> None:
    fixed = {**TOLERANCES["fixed"], "wall_thickness": 0.0305}
    heights = {"height": {"values": [0.9, 1.0]}}
    found = thud.sweep({"fixed": fixed, "parameters": heights}, surrogate=trained).dataset
    assert found["status"].values.tolist() == [1, 0]
    outside, inside = found["reason"].values.tolist()
    assert re.search(naming("height", 0.9, 0.98, 1.02), outside)
    assert not inside
    assert np.isnan(found["floor_octave"].values[0]).all()
    assert np.isnan(found["contact_time"].values[0])
    assert not found["conforms"].values[0]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"fixed": {**FIXED, "loss_factor": 0.1}}, ("loss_factor", 0.1, "surrogate")),
        ({"fixed": {"model": "hollow_sphere"}}, ("surrogate", "model")),
        ({"parameters": {"mass": {"low": 2.4, "high": 2.6}}}, ("mass", "surrogate")),
        ({"fixed": {"model": "modal_ball"}, "parameters": {"damping_law": {"values": ["rising"]}}},
         ("damping_law", "surrogate", "height")),
    ],
)  # fmt: skip
def test_other_cases_are_refused(
    trained: thud.Surrogate, change: dict[str, Any], words: tuple[object, ...]
) -> None:
    with pytest.raises(thud.InputError, match=naming(*words)):
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


@pytest.mark.usefixtures("working_directory")
def test_command_writes_a_surrogate_that_studies_read(trained: thud.Surrogate) -> None:
    text = "\n".join(
        f"{group}.{name} = " + repr(entry).replace("':", "' =")
        for group in ("fixed", "design", "parameters")
        for name, entry in REGION[group].items()
    )
    Path("region.toml").write_text(text)
    assert cli.main(["surrogate", "region.toml", "-q", "-o", "."]) == 0
    assert names_in(Path()) == ["region.nc", "region.svg", "region.toml"]
    study = {**TOLERANCES, "surrogate": "region.nc"}
    one, other = thud.uncertainty(study), thud.uncertainty(TOLERANCES, surrogate=trained)
    np.testing.assert_array_equal(one.levels, other.levels)
    assert thud.read_surrogate("region.nc").digest == trained.digest
    assert altered(trained, drops=trained.drops + 0.1).digest != trained.digest
    # Drops of another version, too few drops, and other studies are refused.
    old = trained.dataset.assign_attrs(thud_version="0.0")
    few = trained.dataset.isel(sample=slice(0, MIN_DROPS - 1))
    thud.Surrogate(old).save("old.nc")
    thud.Sweep(few).save("few.nc")
    thud.sweep({"height": [1.0]}).save("sweep.nc")
    refused = {"old": "0.0", "few": "surrogate", "sweep": "surrogate"}
    for path, word in refused.items():
        with pytest.raises(thud.InputError, match=naming(word)):
            thud.uncertainty({**study, "surrogate": f"{path}.nc"})


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
    residuals = np.full_like(trained.residuals, error)
    residuals *= ["level" in name for name in trained.labels]
    found = thud.design(study, surrogate=altered(trained, residuals=residuals))
    data, undecided = found.dataset, found.dataset["undecided"]
    expected = (data["margin"] < error) & (data["margin"] >= -error)
    for one in thud.assess_levels([0] * 5, 0, 0, 1, 0, 0).criteria:
        if one.name in {"contact_time", "restitution"}:
            expected &= (data[one.name] >= one.lower) & (data[one.name] <= one.upper)
    np.testing.assert_array_equal(undecided, expected)
    assert 0 < int(undecided.sum()) < undecided.size
    assert ("undecided because of the surrogate", f"{int(undecided.sum())}") in found.rows()
    labels = [text.get_text() for text in found.plot().legends[0].get_texts()]
    assert "Undecided by surrogate" in labels


def test_figure_shows_held_out_errors(trained: thud.Surrogate) -> None:
    (axes,) = trained.plot().axes
    shown = [line.get_xdata() for line in axes.lines if len(line.get_xdata()) == 64]
    assessed = trained.residuals[:, trained.assessed]
    np.testing.assert_array_equal(shown, assessed.T)


def test_verdict_is_undecided_where_errors_reach_a_limit() -> None:
    criteria = thud.assess_levels(np.zeros(5), 0, 0, 0, 0, 0).criteria
    lower, upper = np.array([(one.lower, one.upper) for one in criteria]).T
    # The number of peaks is allowed one value.
    middle, half, each = (lower + upper) / 2, (upper - lower) / 2, np.eye(10)[[0, 4, 5, 6, 9]]
    found = assess_many(middle[None], np.zeros((1, 10)), "rubber_ball")
    assert found["margin"] == pytest.approx(half[:5].min())
    # Inside or outside by a tenth of the half width, and an error of less than that, or of more.
    for distance, side, error in itertools.product((0.9, 1.1), (-1, 1), (0.09, 0.11)):
        values = middle + side * distance * half * each
        found = assess_many(values, error * half * each, "rubber_ball")
        assert found["conforms"].tolist() == [distance < 1] * 5
        assert found["undecided"].tolist() == [error > 0.1] * 5
    # A sample that surely fails another criterion is decided.
    failed = middle + half * (2 * each[3] + 0.9 * each[0])
    found = assess_many(failed[None], 0.2 * half * each[:1], "rubber_ball")
    assert (found["conforms"], found["undecided"]) == (False, False)


def test_answers_are_the_verdict_of_what_is_predicted() -> None:
    """With weights of 0 a surrogate predicts the mean of its drops."""
    names = {"floor_octave": 5, "elastic_octave": 5, "contact_time": 1, "restitution": 1}
    mean = [39.0, 31, 23, 17, 12.5, 1, 2, 3, 4, 5, 20 * np.log10(0.02), 20 * np.log10(0.8)]
    case = thud.Case(model=thud.HollowSphere(), levels=thud.Levels(force="floor"))
    surrogate = altered(
        object.__new__(thud.Surrogate), case=case, keys=("height", "mass"),
        region=np.array([[0.9, 1.1], [2.0, 3.0]]), outputs=names, peaks=1,
        dataset=xr.Dataset(attrs={"thud_version": thud.__version__}),
        points=np.random.default_rng(1).random((64, 2)), drops=np.tile(mean, (64, 1)),
        length=np.ones(2), weights=np.zeros((64, 12)),
        residuals=np.random.default_rng(2).normal(0, 0.02, (64, 12)),
    )  # fmt: skip
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
        near = altered(surrogate, drops=drops).predict(case, {"height": np.array([1.0])})
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
