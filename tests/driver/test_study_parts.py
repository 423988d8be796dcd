"""The parts of studies one by one: parameters, designs, temperature, maps."""

from __future__ import annotations

import math
import statistics
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import xarray as xr
from conftest import naming
from hypothesis import assume, given, settings, strategies as st
from scipy.stats import loguniform, norm, uniform

import thud
from thud.base.units import SIZES
from thud.case.keys import known_keys
from thud.level.assessment import wilson_interval
from thud.studies import sampling
from thud.studies.design import Design
from thud.studies.parameter import MAX_VALUES
from thud.studies.sensitivity import sobol_indices
from thud.studies.uncertainty import Uncertainty

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from thud.base.key import Key

SCALES = ["linear", "log"]
DESIGNS = ("random", "latin_hypercube", "sobol")

# Keys that may vary in any study: numbers, words and flags.
VARIED = [
    key
    for key in known_keys(thud.Case()).values()
    if key.kind in {"real", "whole", "choice", "flag"} and key.name not in {"bands", "temperature"}
]


@st.composite
def parameters(draw: st.DrawFn) -> tuple[Key, dict[str, Any], float]:
    """Return a key, a table of its values, and the size of its unit in that of the key."""
    key = draw(st.sampled_from(VARIED))
    kinds: dict[str, st.SearchStrategy[Any]] = {
        "real": st.floats(1e-3, 1e3), "whole": st.integers(1, 1000), "flag": st.booleans(),
        "choice": st.sampled_from(key.choices or ("",)),
    }  # fmt: skip
    value = kinds[key.kind]
    forms = [
        st.fixed_dictionaries({"values": st.lists(value, min_size=1, max_size=5)}),
        st.fixed_dictionaries({"low": value, "high": value, "scale": st.sampled_from(SCALES)}),
        st.fixed_dictionaries({"std": value, "mean": value}),
    ][: {"real": 3, "whole": 2}.get(key.kind, 1)]
    table: dict[str, Any] = draw(st.one_of(forms))
    assume("low" not in table or table["low"] < table["high"])
    if key.kind != "real":
        return key, table, 1
    sizes = SIZES.get(key.unit, {key.unit: 1.0})
    decimal = [unit for unit, size in sizes.items() if round(np.log10(size), 9).is_integer()]
    table["unit"] = draw(st.sampled_from(decimal))
    return key, table, sizes[table["unit"]]


def quantiles(key: Key, table: dict[str, Any], fraction: NDArray[np.float64]) -> ArrayLike:
    """Return the values below which fractions of the distribution lie, in the unit of the table."""
    if values := table.get("values"):
        return [values[int(share * len(values))] for share in fraction]
    if "std" in table:
        return np.asarray(norm.ppf(fraction, table["mean"], table["std"]))
    # A whole number has the probability of the interval up to the next one.
    whole = key.kind == "whole"
    low, high = table["low"], table["high"] + whole
    even = uniform(low, high - low) if table["scale"] == "linear" else loguniform(low, high)
    result = even.ppf(fraction)
    return np.floor(result) if whole else result


@given(parameter=parameters(), design=st.sampled_from(DESIGNS), seed=st.integers(0, 2**32 - 1))
@settings(deadline=None)
def test_study_has_the_values_that_it_states(
    parameter: tuple[Key, dict[str, Any], float], design: str, seed: int
) -> None:
    key, table, size = parameter
    tables = {"design": {"kind": design, "size": 32, "seed": seed}}
    study = thud.read_study({**tables, "parameters": {key.name: table}})
    found = study.parameter_columns(0, 32)[key.name]
    expected = quantiles(key, table, sampling.unit_samples(design, 1, 32, seed)[:, 0])
    if key.kind in {"real", "whole"}:
        np.testing.assert_allclose(found, size * np.asarray(expected), rtol=1e-9)
    else:
        assert found.tolist() == expected
    of_python = {key.name: thud.Parameter(**table)}
    assert thud.read_study({**tables, "parameters": of_python}).identity == study.identity


@given(parameter=parameters(), place=st.integers(0, 4))
@settings(deadline=None)
def test_study_names_what_is_wrong_with_a_parameter(
    parameter: tuple[Key, dict[str, Any], float], place: int
) -> None:
    key, table, _ = parameter
    # Of a random design no range has a count.
    wrong = {"lower": 1, "unit": "furlong", "count": 3, next(iter(table)): ["x"], "start": 1}
    word = [*wrong][place]
    study = {"design": {"kind": "random", "size": 8}}
    with pytest.raises(thud.InputError, match=naming(f"[parameters] {key.name}", word)):
        thud.read_study({**study, "parameters": {key.name: {**table, word: wrong[word]}}})


@pytest.mark.parametrize(
    ("name", "table", "expected"),
    [
        ("height", {"low": 1.0, "high": 3.0, "count": 5}, [1, 1.5, 2, 2.5, 3]),
        ("height", {"low": 1.0, "high": 4.0, "count": 3, "scale": "log"}, [1, 2, 4]),
        ("height", {"values": [3, 1, 2]}, [3, 1, 2]),
        ("rings", {"low": 11, "high": 14, "count": 3}, [11, 12, 14]),
        ("rings", {"low": 11, "high": 14, "count": 4}, [11, 12, 13, 14]),
    ],
)
def test_grids_have_their_ends_and_count(
    name: str, table: dict[str, Any], expected: list[float]
) -> None:
    study = thud.read_study({"parameters": {name: table}})
    assert study.count == len(expected)
    assert study.parameter_columns(0, study.count)[name] == pytest.approx(expected)


def test_largest_grid_is_that_of_the_limit() -> None:
    two = {"low": 1, "high": 2, "count": 2**12}
    study = thud.read_study({"parameters": {"height": two, "mass": two}})
    assert study.count == MAX_VALUES


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
    assert found.interval == wilson_interval(3, 8)


def test_table_of_the_uncertainty_has_the_shares_within_the_limits() -> None:
    criteria = thud.assess_levels(np.zeros(5), 0, 0, 0, 0, 0).criteria[:5]
    draw = np.random.default_rng(3)
    levels = np.array([(c.lower + c.upper) / 2 for c in criteria]) + draw.normal(0, 2, (200, 5))
    # Limits are allowed values.
    levels[0], levels[1] = ([getattr(c, end) for c in criteria] for end in ("lower", "upper"))
    # A set without result has no rating.
    rating = draw.normal(50, 20, 201)

    def spread(level: np.ndarray) -> tuple[str, ...]:
        low, *_, high = statistics.quantiles(level, n=40, method="inclusive")
        return f"{level.mean():.2f}", f"{statistics.stdev(level):.2f}", f"{low:.2f} to {high:.2f}"

    rows = uncertainty(levels, [True] * 50 + [False] * 150, room_rating=rating).rows()
    for row, level, one in zip(rows[1:6], levels.T, criteria, strict=True):
        share = sum(one.lower <= v <= one.upper for v in level) / 200
        assert row[1:] == (*spread(level), f"{100 * share:.1f} %")
    assert rows[6][1:] == (*spread(rating[:200]), "")


def test_best_place_of_a_map_is_shown_in_its_unit() -> None:
    height = thud.Parameter(values=[90, 100, 110], unit="cm")
    found = thud.design({"height": height, "mass": [2.6, 2.4]})
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
