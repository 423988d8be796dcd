"""Sweeps: designs, units, datasets, and bad input."""

from __future__ import annotations

import doctest
import itertools
import os
import re
import resource
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import xarray as xr
from conftest import SHELL, naming, noted, python
from scipy.stats import qmc

import thud
from thud.base import tables, units
from thud.base._schema import MODELS, SAMPLE_QUANTITIES
from thud.base.units import power_of, scaled
from thud.case.keys import known_keys, with_values
from thud.studies import fit, run, sampling, sweep

if TYPE_CHECKING:
    from pathlib import Path
    from types import ModuleType


HEIGHTS = {"parameters": {"height": {"values": [50, 100], "unit": "cm"}}}


def swept(fixed: dict[str, Any], parameters: dict[str, Any], **tables: object) -> xr.Dataset:
    """Return the results of a sweep."""
    return thud.sweep({"fixed": fixed, "parameters": parameters, **tables}).dataset


def test_dataset_tells_units_and_where_it_comes_from(tmp_path: Path) -> None:
    path = tmp_path / "two.toml"
    path.write_text('[parameters]\nheight = { values = [50, 100], unit = "cm" } # two\n')
    thud.sweep(path, tmp_path)
    with xr.open_dataset(tmp_path / "two.nc", engine="h5netcdf") as found:
        assert found["height"].attrs["units"] == "m"
        assert found["height"].values.tolist() == [0.5, 1.0]
        for variable in (*found.data_vars.values(), *found.coords.values()):
            assert variable.attrs["units"]
            assert variable.attrs["long_name"]
        assert found.attrs["study"] == path.read_text()
        assert found.attrs["thud_version"] == thud.__version__
        assert found.attrs["compiler"].startswith("GCC version")
        assert "/" not in found.attrs["compiler"]
        assert "youngs_modulus = 1560000.0" in found.attrs["resolved_case"]


@pytest.mark.parametrize(
    ("kind", "design", "makers"),
    [("sweep", "grid", set()), ("sweep", "sobol", {"scipy"}),
     ("sensitivity", "saltelli", {"scipy", "salib"})],
)  # fmt: skip
def test_other_makers_of_points_are_another_study(
    kind: str, design: str, makers: set[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    size = {} if design == "grid" else {"size": 4}
    form = {"values": [1]} if design == "grid" else {"low": 1, "high": 2}
    tables = {"design": {"kind": design, **size}, "parameters": {"height": form}}
    drawn = thud.read_study(tables, kind)
    before = drawn.identity
    monkeypatch.setattr("thud.studies.study.metadata.version", lambda _: "0.0.1")
    changed = {name for name, text in drawn.identity.items() if text != before[name]}
    assert changed == {f"{name}_version" for name in makers}


@pytest.mark.parametrize("module", [fit, sweep, tables, units])
def test_examples_are_true(module: ModuleType) -> None:
    found = doctest.testmod(module)
    assert found.attempted > 0
    assert found.failed == 0


def test_every_unit_of_a_key_has_multiples() -> None:
    for model in MODELS.values():
        for key in known_keys(thud.Case(model=model())).values():
            assert power_of(key.unit or "1", key.unit, key.name) == 0
            assert key.meaning
            assert (key.kind == "choice") == bool(key.choices)


def test_multiples_are_exact() -> None:
    assert [scaled(i, -3) for i in range(1000)] == [float(f"{i}e-3") for i in range(1000)]
    assert scaled(1.6, 6) == 1.6e6


@pytest.mark.parametrize("design", ["random", "latin_hypercube", "sobol"])
def test_drawn_designs_fill_their_range(design: str) -> None:
    whole = sampling.unit_samples(design, 3, 256, 5)
    assert not np.array_equal(sampling.unit_samples(design, 3, 256, 6), whole)
    if design == "random":
        # Six standard errors of the mean of a uniform distribution.
        assert abs(whole.mean() - 0.5) < 6 / np.sqrt(12 * whole.size)
    else:
        # One point in each of n strata, for every parameter.
        strata = np.sort((whole * 256).astype(int), axis=0)
        np.testing.assert_array_equal(strata, np.arange(256)[:, None].repeat(3, axis=1))
    if design == "sobol":
        assert qmc.discrepancy(whole) < 0.2 * qmc.discrepancy(
            np.random.default_rng(1).random((256, 3))
        )


def test_list_pairs_values_and_entries_of_lists() -> None:
    ratios = {"damping_ratio": [0.05, 0.05], "effective_mass": [2.4, 0.1]}
    found = swept(
        {"model": "measured_modes", "frequency": [24, 89], **ratios},
        {
            "frequency(2)": {"values": [80, 0.09], "unit": "Hz"},
            "damping_ratio(1)": {"values": [4, 6], "unit": "%"},
        },
        design={"kind": "list"},
    )
    assert found["contact_time"].dims == ("sample",)
    ratios["damping_ratio"] = [0.04, 0.05]
    impact = thud.solve(model="measured_modes", frequency=[24.0, 80.0], **ratios)
    assert float(found["peak_force"][0]) == impact.peak_force
    assert found["frequency_2"].values.tolist() == [80.0, 0.09]
    assert found["frequency_2"].attrs["key"] == "frequency(2)"


def test_key_named_as_a_result_keeps_both() -> None:
    times = {"contact_time": {"values": [18, 22], "unit": "ms"}}
    found = swept({"model": "hunt_crossley", "restitution": 0.8}, times)
    np.testing.assert_allclose(found["contact_time"], found["hunt_crossley_contact_time"])


def test_density_and_temperature_act_on_mass_and_modulus() -> None:
    density = 2.5 / (4 / 3 * np.pi * (0.089**3 - 0.057**3))
    parameters = {"temperature": {"values": [20, 30]}, "outer_radius": {"values": [0.089]}}
    law = {"reference": 20, "coefficient": -0.01}
    found = swept({"density": density}, parameters, temperature=law)["contact_time"]
    for place, modulus in enumerate((1.56e6, 1.404e6)):
        impact = thud.solve(thud.Ball(youngs_modulus=modulus))
        assert float(found[place, 0]) == pytest.approx(impact.contact_time, rel=1e-12)


WLF = {"reference": 20, "c1": 8.0, "c2": 120.0}


def shifted(model: str, temperature: float, **law: object) -> tuple[float, float]:
    """Return modulus and loss factor that a study uses at a temperature."""
    given = {
        "fixed": {"model": model, "youngs_modulus": 2e6, **law},
        "temperature": {**WLF, "coefficient": 0.003},
        "parameters": {"temperature": {"values": [temperature]}},
    }
    study = thud.read_study(given)
    found = study.key_columns(study.parameter_columns(0, 1))
    return float(found["youngs_modulus"][0]), float(found["loss_factor"][0])


def test_temperature_shifts_the_frequency_of_the_loss() -> None:
    # At 10 degC a = 10**(80/110): the material behaves as it would at a times the frequency.
    factor = 10 ** (8 * 10 / 110)
    law: dict[str, Any] = {"fractional_order": 0.4, "loss_factor": 0.1}
    modulus, loss = shifted("finite_element", 10, **law, viscosity="fractional")
    pot = 0.1 / np.sin(0.2 * np.pi)
    expected = 1 - pot * np.exp(0.2j * np.pi).real + pot * factor**0.4 * np.exp(0.2j * np.pi)
    assert modulus == pytest.approx(0.97 * 2e6 * expected.real, rel=1e-12)
    assert loss == pytest.approx(expected.imag / expected.real, rel=1e-12)
    # The library's own law at the shifted frequency, within the error of its series.
    material = thud.FiniteElement(**law, viscosity="fractional")
    assert loss == pytest.approx(thud.loss_factors(material, [74 * factor])[0], rel=0.01)
    # The modal ball has the same law; Kelvin and Voigt's modulus does not depend on frequency.
    assert shifted("modal_ball", 10, **law, damping_law="fractional") == (modulus, loss)
    viscous = {"finite_element": {"viscosity": "kelvin_voigt"}}
    viscous["modal_ball"] = {"damping_law": "rising"}
    for model, word in viscous.items():
        found = shifted(model, 10, **word, loss_factor=0.1)
        assert found == pytest.approx((0.97 * 2e6, 0.1 * factor), rel=1e-12)
    # At the reference nothing changes.
    found = shifted("modal_ball", 20, **law, damping_law="fractional")
    assert found == pytest.approx((2e6, 0.1), rel=1e-14)


def test_samples_below_the_range_of_the_shift_have_no_results() -> None:
    fixed = {"model": "modal_ball", "damping_law": "rising"}
    found = swept(fixed, {"temperature": {"values": [20, -100]}}, temperature=WLF)
    assert found["status"].values.tolist() == [0, 1]
    assert "NaN" in str(found["reason"].values[1])


@pytest.mark.parametrize("fixed", [{"bands": "both"}, {"force": "floor", "source": "tyre"}])
def test_samples_give_what_single_drops_give(fixed: dict[str, str]) -> None:
    values = {"height": [0.5, 1.0], "mass": [2.4, 7.3], "momentum_flux": ["none", "retarding"]}
    parameters = {name: {"values": some} for name, some in values.items()}
    fixed = {"model": "hollow_sphere", **fixed}
    study = thud.read_study({"fixed": fixed, "parameters": parameters})
    found = thud.sweep(study).dataset
    kinds = ("octave", "third") if "bands" in fixed else ("octave",)
    assert {name for name in found.dims if name not in values} == {*kinds}
    for kind in kinds:
        assert found[kind].values.tolist() == thud.get_bands(kind).nominal.tolist()
    for place in itertools.product(*values.values()):
        keys = dict(zip(values, place, strict=True))
        one, impact = found.sel(keys), thud.solve(with_values(study.case, keys))
        # What the ensemble promises: 1e-10 in forces, 1e-6 dB in levels.
        for name in SAMPLE_QUANTITIES:
            assert float(one[name]) == pytest.approx(getattr(impact, name), rel=1e-9)
        for force, kind in itertools.product(("elastic", "floor"), kinds):
            levels = impact.levels(kind, force=force)
            np.testing.assert_allclose(one[f"{force}_{kind}"], levels, rtol=0, atol=1e-6)
        assert bool(one["conforms"]) == bool(impact.assess())


def test_each_worker_computes_blocks_on_one_thread(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []

    solve_many = thud.solve_many

    def count(parameters: dict[str, Any], case: thud.Case, **options: Any) -> thud.Ensemble:  # noqa: ANN401
        asked.append(options["threads"])
        return solve_many(parameters, case, **options)

    monkeypatch.setattr(run, "solve_many", count)
    thud.sweep(HEIGHTS, workers=3)
    thud.sweep({**HEIGHTS, "fixed": {"method": "fft"}})
    thud.sweep({"parameters": {"sample_rate": {"values": [44100, 48000]}}})
    assert asked == [1, 1, 1]


def test_blocks_of_slow_models_are_small() -> None:
    fixed = [{"model": name} for name in ("hollow_sphere", "modal_ball", "finite_element")]
    fixed.append({**fixed[0], "method": "fft"})
    sizes = [thud.read_study({**HEIGHTS, "fixed": keys}).block_size for keys in fixed]
    assert sizes[0] > 100 * sizes[3]
    assert sizes[3] == sizes[1] > sizes[2] >= 1


def test_fixed_model_is_that_of_the_case_or_has_its_defaults() -> None:
    given = {"model": {"name": "modal_ball"}, "modal_ball": {"rings": 70}}
    for model, rings in (("modal_ball", 70), ("hollow_sphere", None)):
        study = thud.read_study({"case": given, "fixed": {"model": model}, **HEIGHTS})
        assert study.case.model is not None
        assert study.case.model.name == model
        assert getattr(study.case.model, "rings", None) == rings


def test_fixed_values_may_suit_parameters_only() -> None:
    # The ball does not exist with the radius of the case.
    thick = {"fixed": {"wall_thickness": 0.1}, "parameters": {"outer_radius": {"values": [0.2]}}}
    assert (thud.sweep(thick).dataset["status"] == 0).all()


def test_design_that_exceeds_the_memory_is_told(tmp_path: Path) -> None:
    # 12 numbers for each of 2**24 base samples: 1.6 GB.
    names = ("height", "mass", "gravity", "outer_radius", "wall_thickness", "youngs_modulus")
    ranges = "\n".join(f"{name} = {{low = 1, high = 2}}" for name in names)
    (tmp_path / "large.toml").write_text(f"design.size = {2**24}\n[parameters]\n{ranges}\n")
    limit = 3 * 2**29
    done = python(
        *("-P", "-m", "thud", "sensitivity", "-q", "large.toml"),
        cwd=tmp_path,
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (limit, limit)),
    )
    assert done.returncode == 1
    (line,) = done.stderr.splitlines()
    assert re.search(naming("[design] size", 2**24), line)


def test_values_by_names_of_keys_are_a_grid() -> None:
    height = thud.Parameter(low=50, high=100, count=2, unit="cm")
    masses = {"values": np.array([2.4, 2.6])}
    fixed = {"model": "hollow_sphere", "substeps": np.int64(2)}
    table = {"fixed": fixed, "parameters": {"height": height, "mass": masses}}
    masses = {"values": [2.4, 2.6]}
    plain = {"fixed": fixed | {"substeps": 2}, "parameters": {"height": height, "mass": masses}}
    of_table = thud.sweep(table)
    assert of_table.dataset.identity == thud.sweep(plain).dataset.identity
    same = replace(SHELL, sampling=replace(SHELL.sampling, substeps=2))
    found = thud.sweep({"height": height, "mass": [2.4, 2.6]}, case=same)
    assert found.dataset.drop_attrs().identical(of_table.dataset.drop_attrs())
    frame = found.to_dataframe()
    assert frame.loc[0.5, 2.6]["floor_octave_63"] == found.dataset["floor_octave"].values[0, 1, 1]
    # Scalars, ranges and columns are arrays, as for `solve_many`.
    values = {"height": found.dataset["height"], "substeps": range(2, 4), "mass": 2.4}
    sizes = {"height": 2, "substeps": 2, "mass": 1, "octave": 5}
    assert dict(thud.sweep(values).dataset.sizes) == sizes


@pytest.mark.parametrize("kind", ["sensitivity", "design", "uncertainty"])
def test_results_are_functions_of_their_samples(kind: str, tmp_path: Path) -> None:
    form = {"values": [0.9, 1.1]} if kind == "design" else {"low": 0.9, "high": 1.1}
    study = {"parameters": {"height": form}, "design": {} if kind == "design" else {"size": 8}}
    first = getattr(thud, kind)(study, tmp_path)
    second = type(first)(thud.read_sweep(tmp_path / "python.nc").dataset)
    assert second.rows() == first.rows()
    first.save(tmp_path / "saved.nc")
    assert type(first)(thud.read_sweep(tmp_path / "saved.nc").dataset).rows() == first.rows()


def test_samples_state_sources_that_do_not_conform() -> None:
    """The shell reads low from 125 Hz on; the source of a room whose case names none conforms."""
    case = {"floor": {"name": "plate"}, "room": {}}
    parameters = {"plate.thickness": {"values": [0.14, 0.2]}}
    shell = {"case": {**case, "model": {"name": "hollow_sphere"}}, "parameters": parameters}
    note = noted(thud.sweep(shell).notes, "samples_not_standard")
    assert (note.value, note.high) == (2, 2)
    assert thud.sweep({"case": case, "parameters": parameters}).notes == ()
