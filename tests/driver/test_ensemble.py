"""Ensembles: the same numbers as the single solver, whatever stands beside a set."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from conftest import SHELL, naming, python
from hypothesis import given, settings, strategies as st

import thud
from thud.case.keys import with_values
from thud.impact import ensemble

if TYPE_CHECKING:
    from pathlib import Path

FLUX = ["momentum_balance", "retarding", "conservative", "none"]
THIRDS = replace(SHELL, levels=thud.Levels(bands="third"))


def lasting(duration: float) -> thud.Case:
    return replace(SHELL, sampling=thud.Sampling(duration=duration))


def random_sets(count: int, seed: int) -> dict[str, np.ndarray]:
    random = np.random.default_rng(seed)
    radius = random.uniform(0.06, 0.15, count)
    return {
        "outer_radius": radius,
        "wall_thickness": radius * random.uniform(0.15, 0.5, count),
        "mass": random.uniform(1, 8, count),
        "youngs_modulus": random.uniform(0.5e6, 5e6, count),
        "poisson_ratio": random.uniform(0, 0.5, count),
        "gauge_pressure": np.maximum(0, random.uniform(-3e4, 3e4, count)),
        "ambient_pressure": random.uniform(0, 1.2e5, count),
        "heat_capacity_ratio": random.uniform(1, 2, count),
        "height": random.uniform(0.05, 2, count),
        "gravity": random.uniform(1, 20, count),
        "momentum_flux": np.resize(FLUX, count),
    }


def assert_same_bits(one: thud.Ensemble, other: thud.Ensemble, *orders: np.ndarray) -> None:
    """Compare all results but the forces; the orders are those of one and of the other."""
    first, second = (*orders, slice(None), slice(None))[:2]
    found = other.results
    for name, expected in one.results.items():
        np.testing.assert_array_equal(expected[first], found[name][second], name)


def test_equals_the_single_solver() -> None:
    parameters = random_sets(40, 1)
    near = {"outer_radius": 0.06105, "wall_thickness": 0.0244, "mass": 2.59, "height": 1.0,
            "gauge_pressure": 17.8e3, "poisson_ratio": 0.5, "gravity": 9.81,
            "ambient_pressure": 101325.0, "heat_capacity_ratio": 1.4,
            "momentum_flux": "momentum_balance"}  # fmt: skip
    for key, value in near.items():
        parameters[key][:20] = value
    parameters["youngs_modulus"][:20] = np.linspace(1.9e6, 2.2e6, 20)
    case = replace(THIRDS, sampling=thud.Sampling(duration=0.1))
    ensemble = thud.solve_many(parameters, case, forces=True)
    assert not ensemble.status.any()
    for i in range(len(ensemble)):
        impact = thud.solve(with_values(case, {key: v[i] for key, v in parameters.items()}))
        for force in ("elastic", "floor"):
            expected = impact.force(force)
            actual = getattr(ensemble, f"{force}_force")[i]
            np.testing.assert_allclose(actual, expected, rtol=0, atol=1e-10 * expected.max())
            for kind in ("octave", "third"):
                levels = impact.levels(kind, force=force)
                actual = getattr(ensemble, f"{force}_{kind}")[i]
                np.testing.assert_allclose(actual, levels, atol=1e-6)
        for name in ("contact_time", "peak_force", "peak_elastic_force", "max_deflection",
                     "restitution", "impulse"):  # fmt: skip
            assert getattr(ensemble, name)[i] == pytest.approx(getattr(impact, name), rel=1e-10)
        assert ensemble.conforms[i] == bool(impact.assess())
    # Small, heavy balls; some of them conform by the force on the floor.
    assert 2 < np.count_nonzero(ensemble.conforms) < 18


def test_fails_where_the_single_solver_fails() -> None:
    columns = {"height": np.geomspace(0.1, 500, 60), "momentum_flux": np.resize(FLUX, 60)}
    ensemble = thud.solve_many(columns, SHELL)
    assert 0 < np.count_nonzero(ensemble.status) < 60
    for *values, status in zip(*columns.values(), ensemble.status, strict=True):
        try:
            thud.solve(with_values(SHELL, dict(zip(columns, values, strict=True))))
        except thud.NumericalError as error:
            assert "&drop: height" in str(error)
            assert status == 2
        else:
            assert status == 0


@pytest.mark.parametrize("threads", [1, 2, 3])
def test_threads_and_order_change_no_bit(threads: int) -> None:
    parameters = random_sets(301, 2)
    parameters["height"][::17] = 500.0
    parameters["mass"][5] = np.nan
    reference = thud.solve_many(parameters, threads=1, case=lasting(0.1))
    assert_same_bits(reference, thud.solve_many(parameters, threads=threads, case=lasting(0.1)))
    order = np.random.default_rng(3).permutation(301)
    shuffled = {key: values[order] for key, values in parameters.items()}
    found = thud.solve_many(shuffled, threads=threads, case=lasting(0.1))
    assert_same_bits(reference, found, order)
    part = {key: values[order[:45]] for key, values in parameters.items()}
    found = thud.solve_many(part, threads=threads, case=lasting(0.1))
    assert_same_bits(reference, found, order[:45])


def test_invalid_samples_are_marked_and_leave_the_others() -> None:
    parameters = random_sets(40, 4)
    for i in (9, 11, 13):  # the paper's ball, whose ways to fail are known
        for key, value in (vars(SHELL.resolved().ball) | vars(thud.Drop())).items():
            parameters[key][i] = value
    clean = thud.solve_many(parameters, threads=1, model="hollow_sphere")
    broken = {key: values.copy() for key, values in parameters.items()}
    wrong = {
        3: ("outer_radius", -1, 1, naming("&ball: outer_radius", -1.0)),
        7: ("wall_thickness", 1, 1, naming("&ball: wall_thickness", 1.0)),
        9: ("height", 1e5, 2, naming("&drop: height")),
        11: ("youngs_modulus", 1e11, 1, naming("&sampling: sample_rate", "44100.0 Hz")),
        13: ("mass", 500, 1, naming("&sampling: duration", "0.05 s")),
        15: ("poisson_ratio", np.inf, 1, naming("&ball: poisson_ratio", "Infinity")),
    }
    for i, (key, value, *_) in wrong.items():
        broken[key][i] = value
    ensemble = thud.solve_many(broken, threads=1, model="hollow_sphere", forces=True)
    for i, (*_, status, words) in wrong.items():
        assert ensemble.status[i] == status
        assert re.search(words, ensemble.reason[i])
    bad = list(wrong)
    assert set(np.delete(ensemble.reason, bad)) == {""}
    assert np.isnan(ensemble.contact_time[bad]).all()
    assert np.isnan(ensemble.elastic_octave[bad]).all()
    assert not ensemble.conforms[bad].any()
    good = np.setdiff1d(np.arange(40), bad)
    assert ensemble.elastic_force is not None
    assert ensemble.elastic_force.shape == (40, 2205)
    assert np.isnan(ensemble.elastic_force[bad]).all()
    assert np.isfinite(ensemble.elastic_force[good]).all()
    assert_same_bits(clean, ensemble, good, good)


def test_without_levels_the_rest_is_the_same() -> None:
    parameters = random_sets(50, 6)
    whole = thud.solve_many(parameters, model="hollow_sphere")
    bare = thud.solve_many(parameters, levels=False, model="hollow_sphere")
    np.testing.assert_array_equal(bare.contact_time, whole.contact_time)
    np.testing.assert_array_equal(bare.impulse, whole.impulse)
    assert np.isnan(bare.elastic_octave).all()
    assert np.isnan(bare.floor_octave).all()
    assert not bare.conforms.any()


def test_scalars_and_defaults() -> None:
    ensemble = thud.solve_many({}, model="hollow_sphere")
    assert len(ensemble) == 1
    assert {"elastic_octave", "floor_octave"} <= ensemble.results.keys()
    assert not {"elastic_third", "floor_third", "contact_octave"} & ensemble.results.keys()
    alone = thud.solve(SHELL)
    assert ensemble.contact_time[0] == pytest.approx(alone.contact_time, rel=1e-12)
    assert ensemble.contact_time[0] == thud.solve_many({}, SHELL).contact_time[0]
    empty = thud.solve_many({"height": []}, THIRDS)
    assert (len(empty), empty.reason.size) == (0, 0)
    assert empty.results["elastic_third"].shape == (0, 15)


ANY_VALUE = st.one_of(
    st.floats(), st.integers(-(10**400), 10**400), st.text(max_size=3), st.none(),
    st.lists(st.floats(), max_size=5), st.lists(st.sampled_from(FLUX), max_size=3),
)  # fmt: skip


@settings(max_examples=60, deadline=None)
@given(st.dictionaries(st.sampled_from(sorted(random_sets(1, 0))), ANY_VALUE, max_size=4))
def test_any_input_gives_numbers_or_a_clear_error(parameters: dict[str, object]) -> None:
    try:
        ensemble = thud.solve_many(parameters, threads=1, model="hollow_sphere")  # type: ignore[arg-type]
    except thud.InputError:
        return
    assert np.isfinite(ensemble.elastic_octave[ensemble.status == 0]).all()
    assert np.isnan(ensemble.contact_time[ensemble.status != 0]).all()


def watched_calls(monkeypatch: pytest.MonkeyPatch) -> list[tuple[int, int]]:
    """Return the list that the calls of the library fill: numbers of samples and of threads."""
    compute, calls = ensemble._compute, []  # noqa: SLF001

    def watched(*arguments: Any, **options: Any) -> dict[str, np.ndarray]:  # noqa: ANN401
        calls.append((len(arguments[2]), arguments[3]))
        return compute(*arguments, **options)

    monkeypatch.setattr(ensemble, "_compute", watched)
    return calls


def test_threads_are_the_processors_of_the_process(monkeypatch: pytest.MonkeyPatch) -> None:
    calls = watched_calls(monkeypatch)
    # Of this process, 0, and of no other.
    monkeypatch.setattr("os.sched_getaffinity", {0: {1, 4, 5}}.__getitem__)
    thud.solve_many({"mass": [2.4, 2.5]}, model="hollow_sphere")
    assert calls == [(2, 3)]


@pytest.mark.parametrize("method", ["fork", "spawn"])
def test_processes_that_start_after_threads_go_on(method: str, tmp_path: Path) -> None:
    """A forked process has none of the threads that its parent had started."""
    script = tmp_path / "script.py"
    script.write_text(f"""
import multiprocessing
import thud

def peaks(_):
    return thud.solve_many({{"mass": [2.4, 2.5]}}, threads=2).peak_force.tolist()

if __name__ == "__main__":
    before = peaks(0)
    with multiprocessing.get_context("{method}").Pool(2) as pool:
        assert pool.map(peaks, range(4)) == 4 * [before]
    assert peaks(0) == before
""")
    assert python(script, timeout=60).returncode == 0


@pytest.mark.parametrize(
    ("case", "columns", "shortened", "longest", "ratio"),
    [
        (
            replace(SHELL, sampling=thud.Sampling(8000.0)),
            {"youngs_modulus": [99.5e6, 60e6, 150e6, 1.6e6], "height": [8.77, 8.77, 4.0, 1.0]},
            [True, False, True, False], 0.0, 0.0,
        ),
        # Contacts of 0.2 s, whose levels are taken record by record, beside one of 0.02 s.
        (
            thud.Case(model=thud.HollowSphere("none"), sampling=thud.Sampling(duration=0.3)),
            {"mass": [250.0, 2.5, 240.0], "height": [0.01, 1.0, 0.01]}, [False] * 3, 0.15, 0.0,
        ),
        # Small, heavy balls: some bands hold less than 1e-8 of the energy.
        (
            SHELL, {"outer_radius": [0.055] * 3, "wall_thickness": [0.002] * 3,
                    "height": [0.3] * 3, "mass": [1.0, 2.0, 4.0]}, [False] * 3, 0.0, 1e8,
        ),
    ],
    ids=["shorter_steps", "long_contacts", "little_energy"],
)  # fmt: skip
def test_unusual_drops_equal_single_drops(
    case: thud.Case,
    columns: dict[str, list[float]],
    shortened: list[bool],
    longest: float,
    ratio: float,
) -> None:
    many, ratios = thud.solve_many(columns, case), [0.0]
    for i, is_shortened in enumerate(shortened):
        alone = {name: values[i] for name, values in columns.items()}
        one = thud.solve_many(alone, case)
        single = thud.solve(with_values(case, alone))
        assert ("shortened_time_step" in single.model_quantities) == is_shortened
        assert many.contact_time[i] == pytest.approx(single.contact_time, rel=1e-10)
        for force in ("elastic", "floor"):
            found, levels = getattr(many, f"{force}_octave")[i], single.levels(force=force)
            np.testing.assert_array_equal(getattr(one, f"{force}_octave")[0], found)
            energy = np.sum(single.force(force) ** 2) / single.sample_rate
            over = energy / 10 ** (levels / 10)
            ratios.append(over.max())
            # The sums of energies round to some units in the last place of the whole energy.
            rounding = 10 / np.log(10) * 8 * np.finfo(float).eps * over * (ratio > 0)
            np.testing.assert_array_less(abs(found - levels), np.maximum(1e-6, rounding))
    assert max(many.contact_time) > longest
    assert max(ratios) > ratio


def test_calls_of_any_size_give_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    parameters = random_sets(20, 4)
    whole = thud.solve_many(parameters, THIRDS, forces=True)
    calls = watched_calls(monkeypatch)
    # The forces take a call for a few samples; a bar has steps of some samples.
    for most, expected in ((60e3, [13, 7]), (1e9, [20]), (1.0, [1] * 20)):
        calls.clear()
        monkeypatch.setattr(ensemble, "_MAX_VALUES", int(most))
        parts = thud.solve_many(parameters, THIRDS, forces=True)
        assert_same_bits(whole, parts)
        np.testing.assert_array_equal(parts.floor_force, whole.floor_force)
        assert [size for size, _ in calls] == expected
    monkeypatch.setattr(ensemble, "_MAX_VALUES", 2**26)
    calls.clear()
    thud.solve_many({"height": np.ones(9)}, model="hollow_sphere", threads=1, progress=True)
    assert calls == [(4, 1), (4, 1), (1, 1)]


@pytest.mark.parametrize(("bands", "kinds"), [("third", ["third"]), ("both", ["octave", "third"])])
def test_levels_on_a_floor_are_those_of_the_bands(bands: Any, kinds: list[str]) -> None:  # noqa: ANN401
    case = replace(THIRDS, floor=thud.Plate(thickness=0.1), levels=thud.Levels(bands=bands))
    found = thud.solve_many({"height": [0.9]}, case)
    contact = [name for name in found.results if name.startswith("contact_")]
    assert contact == ["contact_time", *(f"contact_{kind}" for kind in kinds)]
    assert found.room_third is None
    below = thud.solve_many({"height": [0.9]}, replace(case, room=thud.Room()))
    assert below.floor_work.tolist() == found.floor_work.tolist()


def test_samples_state_what_studies_state() -> None:
    case = thud.Case(model=thud.HollowSphere(), floor=thud.Plate(), room=thud.Room())
    heights = np.array([0.5, 1.0, -1.0])
    found = thud.solve_many({"height": heights}, case)
    first, second, last = found.notes
    assert (first.code, first.value, first.high) == ("samples_failed", 1, 3)
    assert first.others["reason"] == found.reason[2]
    assert str(first).startswith("1 of 3 samples failed; most frequent reason: ")
    assert (second.code, second.value, second.high) == ("samples_not_standard", 2, 3)
    assert last.code == "no_numerical_errors"
    # Nothing is said of a source without levels, or of a room that is not there.
    unknown = thud.solve_many({"height": [1.0]}, case, levels=False)
    bare = thud.solve_many({"height": [0.5]}, model="hollow_sphere")
    assert unknown.notes == bare.notes == (last,)


def test_model_replaces_that_of_the_case() -> None:
    case = thud.Case(
        model=thud.HollowSphere(momentum_flux="none"), sampling=thud.Sampling(48000.0, 0.04, 9),
        limits=thud.Limits("tyre"), levels=thud.Levels(bands="third"),
    )  # fmt: skip
    plain = thud.solve_many({"height": [1.0]}, case, forces=True)
    assert plain.case == case
    assert plain.floor_force is not None
    assert plain.floor_force.shape == (1, 1920)
    # The options of the case are those of its model only.
    assert thud.solve_many({}, case, model="hollow_sphere").case.model == case.model
    assert thud.solve_many({}, case, model="modal_ball").case.model == thud.ModalBall()
    assert thud.solve_many({}, model="hollow_sphere").case.model == thud.HollowSphere()
    assert thud.solve_many({}, threads=1024, model="hollow_sphere").status.tolist() == [0]


def test_columns_of_a_table_are_parameters() -> None:
    pandas = pytest.importorskip("pandas", reason="the extra studies is not installed")
    columns = {"height": [0.5, 1.0], "momentum_flux": ["retarding", "none"]}
    # Rows have any index; without columns there is the drop of the case.
    found = thud.solve_many(pandas.DataFrame(columns, index=[7, 7]), model="hollow_sphere")
    expected = thud.solve_many(columns, model="hollow_sphere")
    assert list(found.parameters) == list(expected.parameters)
    np.testing.assert_array_equal(found.restitution, expected.restitution)
    assert len(thud.solve_many(pandas.DataFrame(), model="hollow_sphere")) == 1
