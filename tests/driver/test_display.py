"""Text, HTML, figures, datasets and tables of results."""

from __future__ import annotations

from typing import TYPE_CHECKING
from xml.etree import ElementTree as ET

import numpy as np
import pytest
import xarray as xr
from conftest import recorded

import thud
from thud.base.tables import format_rows

if TYPE_CHECKING:
    from pathlib import Path

    from thud.base.display import Displayed

MASS = {"mass": {"low": 2.4, "high": 2.6}}


def results(impact: thud.Impact) -> list[Displayed]:
    many = thud.solve_many({"mass": [2.0, -1.0]})
    judged = impact.assess()
    record = recorded(impact)
    modes = thud.free_modes(count=2)
    grid = {"mass": {**MASS["mass"], "count": 2}, "height": {"values": [0.5, 1.0]}}
    studies = [
        thud.design({"parameters": grid}),
        thud.uncertainty({"parameters": MASS, "design": {"size": 4}}),
        thud.sensitivity({"parameters": MASS, "design": {"size": 4}}),
        thud.fit(thud.solve(), ["mass"]),
        thud.compare({"one": impact, "two": record}),
    ]
    basics = [impact, judged, many, modes, record, thud.get_bands("third")]
    return [*basics, *studies]


def test_results_have_a_line_and_a_table(flagship: thud.Impact) -> None:
    for result in results(flagship):
        text = repr(result)
        assert "\n" not in text
        assert "array" not in text
        assert len(text) < 120
        assert text.startswith(f"<{type(result).__name__}")
        title, table = ET.fromstring(f"<html>{result._repr_html_()}</html>")  # noqa: S314
        assert title.text == text[1:-1]
        assert [[cell.text or "" for cell in row] for row in table] == [
            list(r) for r in result.rows()
        ]
        widths = {len(row) for row in result.rows()}
        assert len(widths) == 1


def test_texts_name_verdicts_and_numbers(flagship: thud.Impact) -> None:
    """Of a verdict what causes it, of many drops how many conform and failed."""
    shell = thud.solve(model="hollow_sphere").assess()
    causes = [entry.name for entry in shell.criteria if entry.conforms != "conforms"]
    assert len(causes) == 3
    assert all(name in repr(shell) for name in causes)
    assert "octave" not in repr(flagship.assess())
    assert shell.rows()[-1][-1] == "does not conform"
    for masses, levels, words in (
        ([2.0, -1.0], True, ("2 drops", "0 conform", "1 failed")),
        ([-1.0, -2.0], True, ("0 conform", "2 failed")),
        ([2.4, 2.5], False, ("2 drops", "not assessed")),
    ):
        text = repr(thud.solve_many({"mass": masses}, levels=levels))
        assert all(word in text for word in words)


def test_verdict_has_every_form_of_a_result(flagship: thud.Impact, tmp_path: Path) -> None:
    verdict = flagship.assess()
    table, data = verdict.to_dataframe(), verdict.to_xarray()
    assert table["criterion"].tolist() == [*(c.name for c in verdict.criteria), "all"]
    np.testing.assert_array_equal(data["value"][:-1], [c.value for c in verdict.criteria])
    assert data["result"].values[-1] == verdict.conforms
    verdict.save(tmp_path / "verdict.csv")
    assert (tmp_path / "verdict.csv").read_text() == verdict.to_csv()
    (own,) = verdict.plot().axes  # type: ignore[union-attr]
    axes = thud.plot.empty_axes(3.0)[1]
    assert verdict.plot(axes) is axes
    assert own.get_xlim() == axes.get_xlim()
    low, value, high = sorted((axes.lines[0].get_xdata()[0], 0.0, 1.0))
    assert (low, high) == (0.0, 1.0)
    first = verdict.criteria[0]
    assert value == pytest.approx((first.value - first.lower) / (first.upper - first.lower))


def test_a_table_has_one_list_of_columns(flagship: thud.Impact) -> None:
    level = thud.TappingLevel(np.array([50.0, 63.0]), np.array([60.04, np.nan]))
    assert level.rows() == [("band, Hz", "L_n, dB"), ("50", "60.0"), ("63", "")]
    assert level.to_csv() == "band_Hz,L_n_dB\n50,60.04\n63,nan\n"
    for result in (thud.get_bands(), thud.free_modes(count=2), thud.predict_level(
        flagship, thud.Plate(), thud.Room()
    )):  # fmt: skip
        table = result.to_dataframe()
        assert len(table) == len(result.rows()) - 1
        assert table.columns[0].endswith("_Hz")
        data = result.to_xarray()
        (axis,) = data.dims
        assert data[axis].attrs["units"] == "Hz"
        assert len(data.data_vars) == len(table.columns) - 1


def test_warnings_are_shown() -> None:
    with pytest.warns(thud.PlausibilityWarning):
        odd = thud.solve(thud.Ball(mass=0.5, youngs_modulus=1e5))
    assert [row[1] for row in odd.rows() if row[0] == "warning"] == list(odd.warnings)
    assert odd.warnings


def test_html_is_escaped(flagship: thud.Impact) -> None:
    shown = thud.compare({"<script>&": flagship})._repr_html_()
    assert "<script>" not in shown
    assert shown.count("&lt;script&gt;&amp;") == 2


def test_figure_shows_force_and_levels(flagship: thud.Impact) -> None:
    history, octaves = flagship.plot().axes
    assert history.get_xlabel() == "Time since first touch, ms"
    (line,) = [line for line in octaves.lines if len(line.get_xdata()) == 5]
    np.testing.assert_array_equal(line.get_ydata(), flagship.levels())
    record = recorded(flagship)
    (octaves,) = record.plot().axes
    labels = octaves.get_legend_handles_labels()[1]
    assert labels[:2] == ["Tolerance, rubber ball", "Nominal"]
    (forces,) = record.plot("force").axes
    assert forces.get_xlabel() == "Time since first touch, ms"


def test_dataset_of_an_impact_has_units_and_provenance(
    flagship: thud.Impact, tmp_path: Path
) -> None:
    found = flagship.to_xarray()
    np.testing.assert_array_equal(found["floor_force"], flagship.floor_force)
    np.testing.assert_array_equal(
        found["contact_radius"], flagship.model_histories["contact_radius_m"]
    )
    assert found["contact_radius"].attrs["units"] == "m"
    assert found["velocity"].attrs["units"] == "m/s"
    assert found["minimum_volume_ratio"].attrs["units"] == "1"
    np.testing.assert_array_equal(found["time"], flagship.time)
    third = flagship.levels("third", force="elastic")
    np.testing.assert_array_equal(found["elastic_third"], third)
    assert found["third"].values.tolist() == thud.get_bands("third").nominal.tolist()
    assert float(found["peak_force"]) == flagship.peak_force
    assert bool(found["conforms"])
    assert all({"units", "long_name"} <= set(entry.attrs) for entry in found.variables.values())
    assert thud.Case.from_text(found.attrs["case"]) == flagship.case
    assert thud.Case.from_text(found.attrs["resolved_case"]) == flagship.case.resolved()
    assert found.attrs["thud_version"] == thud.__version__
    found.to_netcdf(tmp_path / "impact.nc", engine="h5netcdf")
    xr.testing.assert_equal(xr.load_dataset(tmp_path / "impact.nc", engine="h5netcdf"), found)


def test_dataset_of_an_ensemble_is_that_of_a_study() -> None:
    heights = {"height": [0.5, 1.0, 500.0]}
    many = thud.solve_many(heights, thud.Case(levels=thud.Levels(bands="third")), forces=True)
    found = many.to_xarray()
    fixed = {"bands": "both"}
    study = thud.sweep(
        {"parameters": {"height": {"values": heights["height"]}}, "fixed": fixed}
    ).dataset
    names = set(study.data_vars) & set(found.data_vars)
    assert {"floor_octave", "elastic_third", "margin", "reason"} <= names
    for name in names:
        np.testing.assert_array_equal(found[name].values, study[name].values)
        assert found[name].attrs == study[name].attrs
    np.testing.assert_array_equal(found["floor_force"], many.floor_force)
    assert found["time"].values[-1] == pytest.approx(many.case.sampling.duration, abs=1e-4)
    assert found["height"].values.tolist() == heights["height"]
    assert found.attrs["case"] == study.attrs["case"].replace("'both'", "'third'")
    # Keys that are named as results are.
    lumped = thud.solve_many({"contact_time": [0.02], "restitution": [0.8]}, model="hunt_crossley")
    assert float(lumped.to_xarray()["hunt_crossley_contact_time"][0]) == 0.02


def test_table_of_an_impact_has_the_columns_of_its_files(flagship: thud.Impact) -> None:
    table = flagship.to_dataframe()
    assert table.index.name == "time_s"
    names = [name for name in table if name not in flagship.model_histories]
    components = [f"{name}_N" for name in flagship.components]
    motion, forces = ["deflection_m", "velocity_m_per_s"], ["elastic_force_N", "floor_force_N"]
    assert names == [*motion, *components, *forces]
    np.testing.assert_array_equal(table["floor_force_N"], flagship.floor_force)
    assert set(flagship.model_histories) < set(table)


def test_labels_and_numbers_of_wide_tables_stay_whole() -> None:
    rows = [
        ("", *("rubber_ball_fe_viscous",) * 3, "limits, rubber ball", "range"),
        ("peak deflection, mm", "1", "2 ± 0.1", "3", "1", "18.18 to 20.38"),
    ]
    for table in format_rows(rows).split("\n\n"):
        assert table.split("\n")[-1].startswith("peak deflection, mm  ")
    for number in ("  2 ± 0.1", "18.18 to 20.38"):
        assert number in format_rows(rows)
