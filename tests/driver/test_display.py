"""The contract of results: text, HTML, notes, table, dataset, figure and file of every result."""

from __future__ import annotations

import inspect
from functools import cache
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree as ET

import numpy as np
import pytest
import xarray as xr
from conftest import recorded
from matplotlib.figure import Figure

import thud
from thud.base.display import Displayed, Tabulated
from thud.base.note import Note
from thud.base.tables import format_rows

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

LUMPED: thud.ModelOptions = thud.HuntCrossley(contact_time=0.02, restitution=0.8)
MASS = {"mass": {"low": 2.4, "high": 2.6}}
GRID = {"mass": {**MASS["mass"], "count": 2}, "height": {"values": [0.5, 1.0]}}
OCTAVES = np.array([63.0, 125.0, 250.0, 500.0])
FREQUENCY = np.array([20.0, 30.0, 40.0, 50.0])
LIMITED = {"model": "hunt_crossley", "contact_time": 0.02, "restitution": 0.8}


def study(size: int = 4) -> dict[str, Any]:
    return {"fixed": LIMITED, "parameters": MASS, "design": {"size": size}}


@cache
def impact() -> thud.Impact:
    return thud.solve(model="hollow_sphere", floor=thud.InfinitePlate(1600.0))


@cache
def below() -> thud.RoomPrediction:
    return thud.predict_level(impact(), thud.Plate(thickness=0.2), thud.Room(volume=40.0))


def moved() -> thud.FloorImpact:
    assert impact().on_floor
    return impact().on_floor


@cache
def sound() -> thud.RoomSound:
    return thud.listen({"thin": below(), "same": below()}, pause=0.5)


def press() -> thud.CompressionCurve:
    return thud.compress(points=5)


def measured() -> thud.Mobility:
    return thud.Mobility(FREQUENCY, np.full(4, 1e-5 + 1e-6j))


# An example of every result that is public, and the ending of its file.
RESULTS: dict[Callable[[], Displayed], str] = {
    impact: ".csv",
    moved: ".csv",
    lambda: moved().injected_energy(): ".csv",
    lambda: recorded(impact()): ".csv",
    lambda: impact().assess(): ".csv",
    lambda: thud.compare({"<b>&": impact(), "two": recorded(impact())}): "",
    lambda: thud.solve_many({"mass": [2.0, -1.0, 2.5]}): ".csv",
    lambda: thud.free_modes(count=2): ".vtu",
    press: ".csv",
    lambda: thud.blocked_force(impact()): ".csv",
    measured: ".csv",
    lambda: thud.fit_mobility(measured(), order=1): ".nml",
    lambda: thud.ball_impedance(impact(), [1e4, 1e5]): ".csv",
    below: ".csv",
    lambda: thud.modal_room(below()): ".csv",
    lambda: thud.compare_floors({"one": below(), "two": below()}): "",
    lambda: thud.tapping_level(thud.Plate()): ".csv",
    lambda: thud.RoomLevels("site", "octave", OCTAVES, np.full((2, 4), 60.0)): ".csv",
    lambda: thud.rating([60.0, 55, 50, 45]): ".csv",
    thud.get_bands: ".csv",
    sound: ".wav",
    lambda: sound().sounds[0]: ".csv",
    lambda: thud.sweep({"fixed": LIMITED, "parameters": GRID}): ".nc",
    lambda: thud.design({"fixed": LIMITED, "parameters": GRID}): ".nc",
    lambda: thud.uncertainty(study()): ".nc",
    lambda: thud.sensitivity(study()): ".nc",
    lambda: thud.surrogate(study(64)): ".nc",
    lambda: thud.fit(thud.solve(model=LUMPED), ["mass"], thud.Case(model=LUMPED)): "",
    lambda: thud.fit(
        thud.CompressionTarget(press().deflection, press().force), ["youngs_modulus"]
    ): "",
}
# Numbers and definitions that have no figure.
WITHOUT_FIGURE = (thud.Rating, thud.Bands)


@pytest.fixture(scope="module", params=RESULTS.items(), ids=map(str, range(len(RESULTS))))
def example(request: pytest.FixtureRequest) -> tuple[Displayed, str]:
    make, ending = request.param
    return made(make), ending


@cache
def made(make: Callable[[], Displayed]) -> Displayed:
    return make()


def test_every_public_result_has_an_example() -> None:
    public = {getattr(thud, name) for name in thud.__all__}
    kinds = {kind for kind in public if inspect.isclass(kind) and issubclass(kind, Displayed)}
    assert kinds == {type(made(make)) for make in RESULTS}


def test_results_have_a_line_and_a_table(example: tuple[Displayed, str]) -> None:
    result, _ = example
    text = repr(result)
    assert "\n" not in text
    assert "array" not in text
    assert len(text) < 160
    assert text.startswith(f"<{type(result).__name__}")
    title, table = ET.fromstring(f"<html>{result._repr_html_()}</html>")  # noqa: S314
    # Indices of symbols are below the line.
    assert _plain("".join(title.itertext())) == _plain(text[1:-1])
    cells = [[_plain("".join(cell.itertext())) for cell in row] for row in table]
    assert cells == [[*map(_plain, row)] for row in result.rows()]
    assert len({len(row) for row in cells}) == 1
    assert all(isinstance(note, Note) for note in result.notes)
    assert not isinstance(inspect.getattr_static(result, "warnings", None), property)


def _plain(text: str) -> str:
    return text.replace("_", "")


def test_results_are_data(example: tuple[Displayed, str], tmp_path: Path) -> None:
    """Tables and datasets have the same numbers, and units; files are not empty."""
    result, ending = example
    table, data = result.to_dataframe(), result.to_xarray()
    assert isinstance(data, xr.Dataset)
    assert len(table)
    assert table.columns.is_unique
    if isinstance(result, Tabulated):
        # Both follow from `columns`, in their order.
        assert len(data.dims) == 1
        for name, column in zip(result.columns(), table, strict=True):
            variable = data[name.partition(", ")[0].replace(" ", "_")]
            assert variable.attrs["units"] == (name.partition(", ")[2] or "1")
            np.testing.assert_array_equal(variable.values, table[column].to_numpy())
    path = tmp_path / f"result{ending}"
    result.save(path)
    files = [*path.iterdir()] if path.is_dir() else [path]
    assert path.is_dir() == (not ending)
    assert all(file.stat().st_size for file in files)
    if ending:  # a file of another format is not written under this name
        with pytest.raises(thud.InputError, match=r"result\.xyz"):
            result.save(tmp_path / "result.xyz")


def test_results_are_drawn(example: tuple[Displayed, str]) -> None:
    """Axes of a user show the same as a panel of the own figure, and no figure is made."""
    result, _ = example
    if isinstance(result, WITHOUT_FIGURE):
        with pytest.raises(thud.InputError):
            result.plot()
        return
    own = result.plot()
    left, right = Figure().subplots(1, 2)
    assert isinstance(own, Figure)
    assert result.plot(right) is right.figure
    assert right.has_data()
    assert not left.has_data()
    assert any(np.allclose(right.get_xlim(), axes.get_xlim()) for axes in own.axes)
    labels = {axes.get_xlabel() for axes in own.axes} | {own.get_supxlabel()}
    assert right.get_xlabel() in labels
    assert len(right.lines) in [len(axes.lines) for axes in own.axes]
    # A single curve needs no legend, but its explanation.
    for legend in filter(None, (*own.legends, right.get_legend())):
        assert len(legend.get_texts()) > 1 or legend.get_title().get_text()


def test_lines_name_what_causes_a_verdict_and_how_many_fail(flagship: thud.Impact) -> None:
    shell = impact().assess()
    causes = [entry.name for entry in shell.criteria if entry.conforms != "conforms"]
    assert len(causes) == 3
    assert all(name in repr(shell) for name in causes)
    assert "octave" not in repr(flagship.assess())
    many = repr(thud.solve_many({"mass": [2.0, -1.0, -2.0]}))
    assert {text: text in many for text in ("0 conform", "2 failed", "not assessed")} == {
        "0 conform": True, "2 failed": True, "not assessed": False,
    }  # fmt: skip
    assert "not assessed" in repr(thud.solve_many({"mass": [2.4]}, levels=False))


def test_criteria_are_drawn_as_fractions_of_their_ranges(flagship: thud.Impact) -> None:
    verdict = flagship.assess()
    (axes,) = verdict.plot().axes
    first, (drawn,) = verdict.criteria[0], axes.lines[0].get_xdata()
    assert drawn == pytest.approx((first.value - first.lower) / (first.upper - first.lower))


def test_a_table_has_one_list_of_columns() -> None:
    level = thud.TappingLevel(np.array([50.0, 63.0]), np.array([60.04, np.nan]))
    assert level.rows() == [("band, Hz", "L_n, dB"), ("50", "60.0"), ("63", "")]
    assert level.to_csv() == "band_Hz,L_n_dB\n50,60.04\n63,nan\n"


def test_warnings_are_shown() -> None:
    with pytest.warns(thud.PlausibilityWarning):
        odd = thud.solve(thud.Ball(mass=0.5, youngs_modulus=1e5))
    assert [row[1] for row in odd.rows() if row[0] == "warning"] == list(map(str, odd.notes))
    # The sentences of the library name their subject themselves.
    assert [note.message for note in odd.notes] == list(map(str, odd.notes)) != []


def test_impact_dataset_has_units_and_provenance(flagship: thud.Impact, tmp_path: Path) -> None:
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
    assert found["third"].to_numpy().tolist() == thud.get_bands("third").nominal.tolist()
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
    varied = {"height": {"values": heights["height"]}}
    study = thud.sweep({"parameters": varied, "fixed": {"bands": "both"}}).dataset
    names = set(study.data_vars) & set(found.data_vars)
    assert {"floor_octave", "elastic_third", "margin", "reason"} <= names
    for name in names:
        np.testing.assert_array_equal(found[name].values, study[name].values)
        assert found[name].attrs == study[name].attrs
    np.testing.assert_array_equal(found["floor_force"], many.floor_force)
    assert found["time"].to_numpy()[-1] == pytest.approx(many.case.sampling.duration, abs=1e-4)
    assert found["height"].to_numpy().tolist() == heights["height"]
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
