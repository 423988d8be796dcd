"""The parts of studies one by one: parameters, designs, temperature, maps."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import xarray as xr
from conftest import naming
from scipy.stats import norm

import thud
from thud.base._schema import KEYS
from thud.studies import sampling
from thud.studies.design import Design
from thud.studies.parameter import MAX_VALUES, Parameter, read_varied
from thud.studies.sensitivity import sobol_indices
from thud.studies.study import read_design
from thud.studies.temperature import Temperature, read_temperature
from thud.studies.uncertainty import Uncertainty

CASE = thud.Case()
REAL = next(key for key in KEYS if (key.group, key.name) == ("drop", "height"))
WHOLE = next(key for key in KEYS if (key.group, key.name) == ("modal_ball", "rings"))


def real(**words: Any) -> Parameter:  # noqa: ANN401 - of any kind
    return Parameter(**words, name=REAL.name, key=REAL)


def whole(**words: Any) -> Parameter:  # noqa: ANN401 - of any kind
    return Parameter(**words, name=WHOLE.name, key=WHOLE)


def test_quantiles_are_the_inverse_of_their_distributions() -> None:
    share = np.array([0.0, 0.1, 0.25, 0.5, 0.9, 0.999])
    assert real(low=2.0, high=6.0).quantiles(share) == pytest.approx(2 + 4 * share)
    logarithmic = real(low=2.0, high=32.0, scale="log").quantiles(share)
    assert np.log2(logarithmic) == pytest.approx(1 + 4 * share)
    normal = real(mean=5.0, std=0.5).quantiles(share)
    assert norm.cdf(normal[1:], 5, 0.5) == pytest.approx(share[1:])
    assert 5 - 0.5 * 9 < normal[0] < 5 - 0.5 * 8
    assert real(values=(7, 8, 9, 5)).quantiles(share).tolist() == [7, 7, 8, 9, 5, 5]
    # Each whole number has the share up to the next; of logarithms its own.
    found = whole(low=10, high=12).quantiles(np.array([0, 0.33, 0.34, 0.66, 0.67, 0.9999]))
    assert found.tolist() == [10, 10, 11, 11, 12, 12]
    edges = np.log(np.array([3, 4]) / 2) / np.log(2)
    found = whole(low=2, high=3, scale="log").quantiles(np.append(edges[0] + [-1e-9, 1e-9], 1.0))
    assert found.tolist() == [2, 3, 3]


def test_grids_have_their_ends_and_count() -> None:
    assert real(low=1.0, high=3.0, count=5).grid().tolist() == [1, 1.5, 2, 2.5, 3]
    assert real(low=1.0, high=4.0, count=3, scale="log").grid() == pytest.approx([1, 2, 4])
    assert real(values=(3, 1, 2)).grid().tolist() == [3, 1, 2]
    assert real().grid().size == 0
    assert whole(low=1, high=4, count=3).grid().tolist() == [1, 2, 4]
    # Whole numbers are each there once.
    few = whole(low=1, high=4, count=30)
    assert (few.grid().tolist(), few.size) == ([1, 2, 3, 4], 4)
    assert [p.size for p in (real(low=1.0, high=2.0, count=7), real(values=(1, 2)), real())] == [
        7,
        2,
        0,
    ]
    assert whole(low=1, high=9).size == 0


@pytest.mark.parametrize(
    ("name", "given", "words"),
    [
        ("height", {"low": 1, "high": 2}, ""), ("height", {"low": 1, "high": 1}, naming("low", 1)),
        ("height", {"low": 0, "high": 1, "scale": "log"}, naming("low", 0)),
        ("height", {"low": -1, "high": 1}, ""), ("height", {"low": 1, "high": 2, "count": 2}, ""),
        ("height", {"low": 1, "high": 2, "count": 1}, naming("count", 1)),
        ("height", {"low": 1, "high": 2, "count": MAX_VALUES + 1}, naming("count", 2, MAX_VALUES)),
        ("rings", {"low": 10, "high": 12, "count": 3}, ""),
        ("rings", {"low": 10, "high": 12, "count": 4}, naming("count", 4)),
        ("rings", {"std": 2}, "whole"), ("height", {"std": 0}, naming("std", 0)),
        ("height", {"std": 0.1}, ""), ("height", {"values": []}, "values"),
        ("rings", {"values": [10.5]}, "10.5"), ("height", {"values": [math.nan]}, "nan"),
        ("height", {"low": 1}, "high"), ("height", {}, "values"),
    ],
)  # fmt: skip
def test_bounds_of_parameters(name: str, given: dict[str, Any], words: str) -> None:
    if words:
        with pytest.raises(thud.InputError, match=words):
            read_varied(name, given, CASE, 1.0)
    else:
        found = read_varied(name, {**given, "unit": "cm"} if name == "height" else given, CASE, 0.7)
        size = 0.01 if name == "height" else 1
        for word in ("low", "high", "std"):
            if word in given:
                assert getattr(found, word) == pytest.approx(size * given[word])
        assert found.mean == (0.7 if "std" in given else None)
        assert found.count == given.get("count", 0)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"size": 0, "kind": "random"}, naming("size", 0)), ({"size": 1, "kind": "random"}, ""),
        ({"size": 3, "kind": "saltelli"}, naming("size", 3)), ({"size": 4, "kind": "saltelli"}, ""),
        ({"size": 12, "kind": "sobol"}, naming("size", 8, 16)), ({"size": 16, "kind": "sobol"}, ""),
        ({"size": 12, "kind": "latin_hypercube"}, ""), ({"size": MAX_VALUES + 1}, "size"),
        ({"size": 5, "seed": -1}, "seed"), ({"size": 5, "seed": 2}, ""),
        ({"kind": "grid"}, naming("values", "grid")),
    ],
)  # fmt: skip
def test_bounds_of_designs(given: dict[str, Any], words: str) -> None:
    kinds = (*sampling.SAMPLED, "grid", "list")
    parameters = (real(low=1.0, high=2.0),)
    if words:
        with pytest.raises(thud.InputError, match=words):
            read_design(given, kinds, parameters)
    else:
        kind = given.get("kind", "random")
        expected = {"design": kind, "size": given["size"], "seed": given.get("seed", 0)}
        assert read_design(given, kinds, parameters) == expected


def test_grids_and_lists_need_values_that_fit() -> None:
    two, three = real(low=1.0, high=2.0, count=2), real(values=(1, 2, 3))
    assert read_design({"kind": "list"}, ("list",), (three, three)) == {"design": "list"}
    with pytest.raises(thud.InputError, match=naming("values")):
        read_design({"kind": "list"}, ("list",), (two, three))
    with pytest.raises(thud.InputError, match=naming("count", "random")):
        read_design({"size": 4}, ("random",), (two,))
    largest = (replace(two, count=2**12), replace(two, count=2**12))
    assert read_design({}, ("grid",), largest) == {"design": "grid"}
    with pytest.raises(thud.InputError, match=naming("grid", MAX_VALUES)):
        read_design({}, ("grid",), (*largest, three))


def test_samples_of_saltelli_exchange_one_column_each() -> None:
    """A, A with one column of B for each parameter, B: the points of Saltelli's design."""
    points = sampling.unit_samples("saltelli", 3, 8, 5).reshape(8, 5, 3)
    first, second = points[:, 0], points[:, 4]
    for matrix in (first, second):
        # A point in each of eight strata.
        strata = np.sort((8 * matrix).astype(int), axis=0)
        np.testing.assert_array_equal(strata, np.arange(8)[:, None].repeat(3, axis=1))
    for j in range(3):
        mixed = np.where(np.arange(3) == j, second, first)
        np.testing.assert_array_equal(points[:, 1 + j], mixed)
    other = sampling.unit_samples("saltelli", 3, 8, 6)
    assert not np.array_equal(other, points.reshape(40, 3))


def test_what_varies_by_rounding_only_has_no_indices() -> None:
    draw = np.random.default_rng(0).random(4 * 16)
    for size, known in ((1e-13, False), (1e-11, True)):
        for middle in (1.0, -1e5):
            found = sobol_indices(middle * (1 + size * draw), 2, 1)
            assert np.isfinite(found[2]).all() == known
    assert np.isnan(sobol_indices(np.full(64, np.nan), 2)).all()


def test_shift_is_that_of_williams_landel_and_ferry() -> None:
    law = Temperature(20.0, c1=8.0, c2=100.0)
    at = np.array([20.0, 30.0, 5.0, -50.0, -80.0, -90.0])
    above = at[:4] - 20
    assert np.log10(law.shift(at)[:4]) == pytest.approx(-8 * above / (100 + above))
    assert np.isnan(law.shift(at)[4:]).all()
    assert Temperature(20.0, coefficient=-0.01).shift(at).tolist() == [1] * 6
    assert law.keys == ("youngs_modulus", "loss_factor")
    assert Temperature(20.0, coefficient=-0.01).keys == ("youngs_modulus",)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"reference": 20, "coefficient": 0}, ""), ({"reference": 20, "c1": 8, "c2": 1}, ""),
        ({"reference": 20, "c1": 0, "c2": 1}, naming("c1", 0)),
        ({"reference": 20, "c1": 8}, naming("c2")),
        ({"reference": 20, "c1": 8, "c2": -1}, naming("c2", -1)),
        ({"coefficient": 1}, naming("reference")),
        ({"reference": 20}, naming("coefficient")), (None, naming("[temperature]", "parameter")),
    ],
)  # fmt: skip
def test_bounds_of_the_law_of_temperature(given: dict[str, float] | None, words: str) -> None:
    case = thud.Case(model=thud.ModalBall(damping_law="rising"))
    varying = (read_varied("temperature", {"values": [20, 30]}, CASE, None),)
    if words:
        with pytest.raises(thud.InputError, match=words):
            read_temperature(given, case, varying)
        return
    found = read_temperature(given, case, varying)
    assert {word: getattr(found, word) for word in given} == given
    with pytest.raises(thud.InputError, match=naming("[temperature]", "parameter")):
        read_temperature(given, case, ())


def uncertainty(levels: np.ndarray, conforms: list[bool], **more: Any) -> Uncertainty:  # noqa: ANN401
    """Return the uncertainty of samples with these levels; the last sample has no results."""
    levels = np.vstack([levels, np.full(5, np.nan)])
    status = [0] * (len(levels) - 1) + [1]
    variables = {"conforms": [*conforms, False], "status": status, **more}
    dataset = xr.Dataset(
        {name: ("sample", values) for name, values in variables.items()},
        attrs={"limits": "rubber_ball", "assessed_force": "floor"},
    )
    return Uncertainty(dataset.assign(floor_octave=(("sample", "octave"), levels)))


def test_range_of_a_surrogate_counts_undecided_samples_twice() -> None:
    undecided = [True, False, False, True, True, False, False, False, False]
    found = uncertainty(np.zeros((8, 5)), [True] * 3 + [False] * 5, undecided=undecided)
    assert found.surrogate_range == (2 / 8, 5 / 8)
    assert found.probability == 3 / 8
    assert (found.conforming, found.computed) == (3, 8)
    assert found.standard_error == pytest.approx(math.sqrt(3 / 8 * 5 / 8 / 8))


@pytest.mark.parametrize(("hits", "trials"), [(0, 10), (10, 10), (3, 7), (368, 500)])
def test_interval_is_wilson_s(hits: int, trials: int) -> None:
    found = uncertainty(np.zeros((trials, 5)), [i < hits for i in range(trials)]).interval
    share, z = hits / trials, norm.ppf(0.975)
    # At its ends the share is z standard errors off: a quadratic equation.
    coefficients = (1 + z**2 / trials, -2 * share - z**2 / trials, share**2)
    assert found == pytest.approx(sorted(np.roots(coefficients).real), abs=1e-12)


def test_table_of_the_uncertainty_has_the_shares_within_the_limits() -> None:
    criteria = thud.assess_levels(np.zeros(5), 0, 0, 0, 0, 0).criteria[:5]
    draw = np.random.default_rng(3)
    levels = np.array([(c.lower + c.upper) / 2 for c in criteria]) + draw.normal(0, 2, (200, 5))
    # Limits are allowed values.
    levels[0], levels[1] = ([getattr(c, end) for c in criteria] for end in ("lower", "upper"))
    # A set without result has no rating.
    rating = draw.normal(50, 20, 201)

    def spread(level: np.ndarray) -> tuple[str, ...]:
        ordered = np.sort(level)
        low, high = (ordered[int(p * 199)] + (p * 199) % 1 * (ordered[int(p * 199) + 1]
                     - ordered[int(p * 199)]) for p in (0.025, 0.975))  # fmt: skip
        deviation = math.sqrt(((level - level.mean()) ** 2).sum() / 199)
        return f"{level.mean():.2f}", f"{deviation:.2f}", f"{low:.2f} to {high:.2f}"

    rows = uncertainty(levels, [True] * 50 + [False] * 150, room_rating=rating).rows()
    for row, level, one in zip(rows[1:6], levels.T, criteria, strict=True):
        share = sum(one.lower <= v <= one.upper for v in level) / 200
        assert row[1:] == (*spread(level), f"{100 * share:.1f} %")
    assert rows[6][1:] == (*spread(rating[:200]), "")


def test_best_place_of_a_map_is_shown_in_its_unit() -> None:
    study = {
        "parameters": {
            "height": {"values": [90, 100, 110], "unit": "cm"},
            "mass": {"values": [2.6, 2.4]},
        }
    }
    found = thud.design(study)
    margin = found.dataset["margin"].values
    rows = dict(found.rows())
    i, j = np.unravel_index(margin.argmax(), margin.shape)
    assert rows["samples"] == "6"
    assert float(rows["largest margin, dB"]) == pytest.approx(margin.max(), abs=0.006)
    assert float(rows["  at height, cm"]) == pytest.approx([90, 100, 110][i])
    assert float(rows["  at mass, kg"]) == [2.4, 2.6][j]
    assert int(rows["octave levels conform"]) == (margin >= 0).sum()
    assert int(rows["all criteria conform"]) == found.dataset["conforms"].sum()
    # Of a room, the lowest rating.
    rating = xr.zeros_like(found.dataset["margin"]) + np.arange(6.0).reshape(3, 2)[::-1]
    dataset = found.dataset.assign(room_rating=rating)
    rows = dict(Design(dataset).rows())
    assert (rows["  at height, cm"], rows["  at mass, kg"]) == ("110", "2.4")


@pytest.mark.parametrize(
    ("fixed", "parameters", "expected"),
    [
        ({}, {"mass": [2.4, 2.6], "height": [0.9, 1.1]}, (2.5, 1.0)),
        # On the edge, and beyond it.
        ({}, {"mass": [2.5, 2.6], "height": [0.9, 1.0]}, (2.5, 1.0)),
        ({}, {"mass": [2.51, 2.6], "height": [0.9, 1.1]}, None),
        ({"mass": 2.45}, {"poisson_ratio": [0.49, 0.5], "height": [0.9, 1.1]}, (0.5, 1)),
        ({}, {"density": [1000, 1400], "height": [0.9, 1.1]}, None),
        ({"density": 1200}, {"height": [0.9, 1.1], "gravity": [9, 10]}, (1, 9.81)),
    ],
)  # fmt: skip
def test_mark_of_a_map_is_the_case(
    fixed: dict[str, Any], parameters: dict[str, Any], expected: tuple[float, float] | None
) -> None:
    given = {"fixed": fixed, "parameters": {n: {"values": v} for n, v in parameters.items()}}
    assert thud.design(given).mark == (expected and pytest.approx(expected))
