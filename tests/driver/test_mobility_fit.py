"""Floors of measured mobilities: tables, universal files, errors, what is refused."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import replace
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from conftest import codes, naming, noted

import thud
from thud.cli import main
from thud.floors import mobility_fit

if TYPE_CHECKING:
    from pathlib import Path

FREQUENCY = np.linspace(10, 1000, 300)
S = 2j * np.pi * FREQUENCY
# Frequency, Hz, modal mass, kg, damping ratio.
MODES = [(18, 400, 0.03), (47, 300, 0.02), (120, 350, 0.03), (310, 250, 0.02)]
MOBILITY = 2e-6 + sum(
    S / m / (S**2 + 2 * z * 2 * np.pi * f * S + (2 * np.pi * f) ** 2) for f, m, z in MODES
)
# Noise of 3 % of each part.
NOISY = MOBILITY * (1 + 0.03 * np.random.default_rng(1).normal(size=(2, 300)).T.dot([1, 1j]))


def write_table(path: Path, titles: str, *columns: np.ndarray) -> Path:
    np.savetxt(path, np.column_stack(columns), delimiter=",", header=titles, comments="")
    return path


def write_universal(
    path: Path, response: int, values: np.ndarray, *systems: dict[str, Any], **words: object
) -> Path:
    pyuff = pytest.importorskip("pyuff")
    one: dict[str, Any] = {
        "type": 58, "binary": 0, **{f"id{i}": "NONE" for i in range(1, 6)}, "func_type": 4,
        "rsp_ent_name": "floor", "rsp_node": 1, "rsp_dir": -3, "ref_ent_name": "floor",
        "ref_node": 1, "ref_dir": -3, "abscissa_spacing": 1, "abscissa_spec_data_type": 18,
        "ordinate_spec_data_type": response, "orddenom_spec_data_type": 13,
        "z_axis_spec_data_type": 0, "x": FREQUENCY, "data": values, **words,
    }  # fmt: skip
    pyuff.UFF(str(path)).write_sets([*systems, one], "overwrite")
    return path


@pytest.fixture(scope="module")
def exact() -> thud.MobilityFit:
    return thud.fit_mobility(thud.Mobility(FREQUENCY, MOBILITY))


def test_modes_and_their_number_are_found(exact: thud.MobilityFit) -> None:
    order = np.argsort(exact.floor.pole_frequency)
    poles = np.column_stack([exact.floor.pole_frequency, exact.floor.damping_ratio])[order]
    np.testing.assert_allclose(poles, [(f, z) for f, _, z in MODES], rtol=1e-8)
    assert exact.floor.direct == pytest.approx(2e-6, rel=1e-6)
    assert exact.error < 1e-10
    assert not exact.notes
    assert abs(exact.to_dataframe()["real_part_dB"]).max() < 1e-9
    np.testing.assert_allclose(exact.fitted.values, MOBILITY, rtol=1e-8)


@pytest.mark.parametrize(
    ("name", "factor"),
    [("concrete 300", 1), ("joists, 1 board", 1), ("concrete 180", 1e3), ("concrete 180", 1e-3)],
)
def test_mobilities_that_no_floor_has_raise_a_warning(name: str, factor: float) -> None:
    frequency = np.linspace(20.0, 700.0, 200)
    values = factor * thud.mobility(thud.construction(name).floor, frequency).values
    notes = thud.fit_mobility(thud.Mobility(frequency, values), order=8).notes
    found = [note for note in notes if note.code == "mobility_implausible"]
    assert len(found) == (factor != 1)
    assert all(not note.low <= note.value <= note.high for note in found)


def test_noise_is_not_fitted() -> None:
    found = thud.fit_mobility(thud.Mobility(FREQUENCY, NOISY))
    # 3 % of both parts: 4.2 %, less by the freedom of 17 coefficients in 600 parts.
    assert found.error == pytest.approx(0.03 * np.sqrt(2), rel=0.1)
    assert len(found.floor.pole_frequency) == len(MODES)
    assert abs(thud.mobility(found.floor, FREQUENCY).values / MOBILITY - 1).mean() < 0.01


# Units per m or per N of data sets 164, and labels with their size in SI units; None is refused.
SYSTEMS = {None: (1.0, 1.0), 1: (1.0, 1.0), 7: (39.37007874, 0.224808943)}
INCH, POUND = 0.0254, 4.4482216
FORCES = {"NONE": 0.0, "N": 1.0, "kN": 1e3, "lbf": POUND, "V": None}
RESPONSES: dict[int, dict[str, float | None]] = {
    8: {"NONE": 0.0, "m": 1.0, "mm": 1e-3, "in": None, "m/s": None, "mil": None},
    11: {"NONE": 0.0, "m/s": 1.0, "mm/s": 1e-3, "(in/s)": INCH, "m": None, "m/s^2": None},
    12: {"NONE": 0.0, "m/s^2": 1.0, "mm/s**2": 1e-3, "m/s/s": 1.0, "g": 9.80665,
         "in/s2": INCH, "m/s": None, "V": None, "dB": None},
}  # fmt: skip


@pytest.mark.parametrize("system", SYSTEMS)
@pytest.mark.parametrize(
    ("response", "above"), [(kind, label) for kind, labels in RESPONSES.items() for label in labels]
)
def test_units_of_universal_files_are_applied_or_refused(
    response: int, above: str, system: int | None, tmp_path: Path
) -> None:
    per_metre, per_newton = SYSTEMS[system]
    units = {"type": 164, "units_code": system, "length": per_metre, "force": per_newton}
    systems = [units | {"temp": 1.0, "temp_offset": 0.0}] if system else []
    power = {8: -1, 11: 0, 12: 1}[response]
    for below, force in FORCES.items():
        length = RESPONSES[response][above]
        labels = {"ordinate_axis_units_lab": above, "orddenom_axis_units_lab": below}
        # Without a label the unit is that of the system.
        scale = (length or 1 / per_metre) / (force or 1 / per_newton)
        agree = system is None or (
            (above in {"NONE", "g"} or (length or 0) * per_metre == pytest.approx(1, rel=1e-3))
            and (below == "NONE" or (force or 0) * per_newton == pytest.approx(1, rel=1e-3))
        )
        values = MOBILITY * S**power / scale
        path = write_universal(tmp_path / "point.uff", response, values, *systems, **labels)
        refused = pytest.raises(thud.InputError, match=naming(path, "unit"))
        with refused if length is None or force is None or not agree else nullcontext():
            assert thud.read_mobility(path).values == pytest.approx(MOBILITY, rel=1e-4)


@pytest.mark.parametrize(
    ("sign", "header", "facts"),
    [
        # Opposite directions, none that is stated, and the reaction of the force.
        (-1, {"rsp_dir": 3}, ()),
        (1, {"rsp_dir": 0}, ()),
        (1, {"orddenom_spec_data_type": 9}, ()),
        (1, {"func_type": 1}, (0,)),
        (1, {"orddenom_spec_data_type": 12}, ("type 11", "type 12")),
        (1, {"abscissa_axis_units_lab": "rad/s"}, ("frequencies", "rad/s")),
    ],
)
def test_header_of_a_universal_file_decides_sign_and_refusal(
    tmp_path: Path, sign: int, header: dict[str, Any], facts: tuple[object, ...]
) -> None:
    path = write_universal(tmp_path / "point.uff", 11, sign * MOBILITY, **header)
    with pytest.raises(thud.InputError, match=naming(path, *facts)) if facts else nullcontext():
        assert thud.read_mobility(path).values == pytest.approx(MOBILITY, rel=1e-4)
    with pytest.raises(thud.InputError, match=naming(path, *(facts or ("'receptance'",)))):
        thud.read_mobility(path, "receptance")


def test_values_that_overflow_end_in_one_sentence(capfd: pytest.CaptureFixture[str]) -> None:
    values = np.where(np.arange(FREQUENCY.size) == 40, 1e308, MOBILITY)
    with pytest.raises(thud.ThudError, match=naming("8 poles")):
        thud.fit_mobility(thud.Mobility(FREQUENCY, values), order=8)
    # The linear algebra says nothing of its own.
    assert capfd.readouterr() == ("", "")


def test_orders_that_fail_are_passed_over(monkeypatch: pytest.MonkeyPatch) -> None:
    usual = mobility_fit._fit  # noqa: SLF001 - what a measurement makes it do is not known

    def fails(measured: thud.Mobility, order: int) -> thud.MobilityFit:
        if order != 2 * len(MODES):
            message = f"order {order} fails"
            raise thud.NumericalError(message)
        return usual(measured, order)

    monkeypatch.setattr(mobility_fit, "_fit", fails)
    assert thud.fit_mobility(thud.Mobility(FREQUENCY, MOBILITY)).error < 1e-6
    monkeypatch.setattr(mobility_fit, "_ORDERS", (2, 4))
    with pytest.raises(thud.NumericalError, match=naming("measurement", "order 2 fails")):
        thud.fit_mobility(thud.Mobility(FREQUENCY, MOBILITY))


def test_negative_lines_raise_a_warning_and_are_left_out() -> None:
    values = MOBILITY - 2 * MOBILITY.real * (np.arange(300) % 10 == 0)
    found = thud.fit_mobility(thud.Mobility(FREQUENCY, values), order=8)
    assert noted(found.notes, "real_part_negative").value == 10
    assert thud.mobility(found.floor, np.geomspace(0.1, 1e6, 5000)).values.real.min() >= 0


def test_command_saves_the_floor(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    table = write_table(
        tmp_path / "point.csv", "frequency,real,imaginary", FREQUENCY, NOISY.real, NOISY.imag
    )
    folder = tmp_path / "out"
    assert main(["mobility", str(table), "--order", "8", "-o", str(folder), "--no-figures"]) == 0
    printed = capsys.readouterr().out
    assert "MobilityFit point: 8 poles" in printed
    assert "octave, Hz" in printed
    fit = thud.fit_mobility(thud.read_mobility(table), order=8)
    fit.save(tmp_path / "fit.nml")
    for path in (folder / "measured_mobility.nml", tmp_path / "fit.nml"):
        path.write_text("&ball /\n&drop /\n&model /\n" + path.read_text())
        assert thud.read_case(path).floor == fit.floor


def test_figure_shows_measurement_and_fit(exact: thud.MobilityFit) -> None:
    upper, lower = exact.plot().axes
    for axes, of in ((upper, abs), (lower, lambda y: np.degrees(np.angle(y)))):
        measured, fitted = axes.get_lines()
        np.testing.assert_array_equal(measured.get_ydata(), of(exact.measured.values))
        line = np.asarray(fitted.get_xdata())
        np.testing.assert_array_equal(
            fitted.get_ydata(), of(thud.mobility(exact.floor, line).values)
        )
        assert line[[0, -1]] == pytest.approx(FREQUENCY[[0, -1]])
    assert upper.get_ylabel() == "Mobility, m/(N s)"


def test_ball_feels_a_noisy_measured_floor_as_the_floor() -> None:
    joists = thud.JoistFloor(source_x=0.4, source_y=0.35)
    frequency = np.linspace(10, 1000, 496)
    noise = 0.03 * np.random.default_rng(2).normal(size=(496, 2)).dot([1, 1j])
    values = thud.mobility(joists, frequency).values * (1 + noise)
    measured = thud.fit_mobility(thud.Mobility(frequency, values), order=40)
    expected = thud.solve(floor=joists).on_floor
    found = thud.solve(floor=measured.floor).on_floor
    assert expected is not None
    assert found is not None
    # 3 % at 496 lines shared by 81 coefficients: 1 % of differences of up to 1.2 dB, and as much
    # by the modes of the sheathing, of which there are more than poles.
    np.testing.assert_allclose(found.difference(), expected.difference(), atol=0.03)
    assert abs(expected.difference()).max() > 0.5


@pytest.mark.parametrize(
    ("titles", "scales", "power", "encoding"),
    [
        ("frequency_kHz,real (mm/Ns),imaginary [m/(N s)]", (1e-3, 1e3, 1), 0, "utf-8"),
        ("f (Hz),real [g/N],imaginary / (m/s^2)/N", (1, 1 / 9.80665, 1), 1, "utf-8"),
        ("f (Hz),real (mm/N),imaginary (m/N)", (1, 1e3, 1), -1, "utf-8"),
        ("frequency,real accelerance,imaginary accelerance", (1, 1, 1), 1, "utf-8"),
        ("Frequenz (Hz),Realteil,Imaginärteil", (1, 1, 1), 0, "latin-1"),
        ("주파수(Hz),실수부,허수부", (1, 1, 1), 0, "cp949"),
        ("周波数（Hz）,実部,虚部", (1, 1, 1), 0, "cp932"),  # noqa: RUF001 - as printed
        ("frequency_Hz,magnitude,phase_deg", (1, 1, 1), 1, "accelerance"),
        ("frequency_Hz,magnitude,phase_deg", (1, 1, 1), -1, "receptance"),
    ],
)
def test_titles_or_the_caller_state_units_and_quantity(
    tmp_path: Path, titles: str, scales: tuple[float, ...], power: int, encoding: str
) -> None:
    values = MOBILITY * S**power
    parts = values.real, values.imag
    quantity: Any = None
    if "magnitude" in titles:
        parts, quantity, encoding = (abs(values), np.degrees(np.angle(values))), encoding, "utf-8"
    columns = zip((FREQUENCY, *parts), scales, strict=True)
    path = write_table(tmp_path / "point.csv", "", *(scale * x for x, scale in columns))
    path.write_bytes(f"{titles}\n".encode(encoding) + path.read_bytes())
    assert thud.read_mobility(path, quantity).values == pytest.approx(MOBILITY)


def scaled_fit(exact: thud.MobilityFit, factor: np.ndarray) -> thud.MobilityFit:
    """Return a fit whose measurement is the floor times a factor."""
    return replace(exact, measured=thud.Mobility(FREQUENCY, factor * exact.fitted.values))


def test_errors_are_relative_to_the_measurement(exact: thud.MobilityFit) -> None:
    factor = np.where(FREQUENCY < 250, 1.25, 0.8 * np.exp(0.3j))
    found = scaled_fit(exact, factor)
    errors = abs(1 / factor - 1)
    assert found.error == pytest.approx(np.sqrt((errors**2).mean()))
    bands = found.to_dataframe().set_index("octave_Hz")
    # The measurement reaches from 10 to 1000 Hz: all octaves.
    assert list(bands.index) == [31.5, 63, 125, 250, 500]
    assert bands["error_%"].iloc[:3].tolist() == pytest.approx([20.0] * 3)
    assert bands["real_part_dB"].iloc[:3].tolist() == pytest.approx([10 * np.log10(0.8)] * 3)
    assert bands["error_%"].iloc[-1] == pytest.approx(100 * errors[-1])
    # A negative real part has no level; octaves that are not covered have no error.
    edges = thud.get_bands()
    octave = (edges.lower[2] <= FREQUENCY) & (edges.upper[2] > FREQUENCY)
    negative = scaled_fit(exact, np.where(octave, -1.0, 1.0)).rows()
    assert [row[2] == "" for row in negative[1:]] == [False, False, True, False, False]
    inside = (edges.lower[1] <= FREQUENCY) & (edges.upper[3] > FREQUENCY)
    for keep, expected in (
        (inside, [125]), (np.append(inside[1:], False), [63, 125]),
        (np.append(False, inside[:-1]), [125, 250]),
    ):  # fmt: skip
        part = replace(exact, measured=thud.Mobility(FREQUENCY[keep], MOBILITY[keep]))
        assert part.to_dataframe()["octave_Hz"].tolist() == expected


@pytest.mark.parametrize(
    ("factor", "free_error", "code"),
    [
        # More than 10 % off; worse than 1.5 times the free fit; neither; exact.
        (1 / 1.101, 0.09, "mobility_misfit"),
        (1 / 1.099, 0.09, ""),
        (1 / 1.05, 0.033, "passivity_misfit"),
        (1 / 1.05, 0.034, ""),
        (1.0 + 1e-9, 0.0, ""),
        (1.0 + 2e-8, 0.0, "passivity_misfit"),
    ],
)
def test_fits_that_miss_raise_a_warning(
    exact: thud.MobilityFit, factor: float, free_error: float, code: str
) -> None:
    found = replace(scaled_fit(exact, np.full(300, factor)), free_error=free_error)
    assert codes(found.notes) == [code] * bool(code)
    assert [note.value for note in found.notes] == pytest.approx([100 * found.error] * bool(code))


def choose(
    monkeypatch: pytest.MonkeyPatch, count: int, errors: dict[int, float]
) -> tuple[int, list[int]]:
    """Return the number of poles of a fit to lines with some errors, and those that were tried."""
    tried = []

    def fit(_: thud.Mobility, order: int) -> SimpleNamespace:
        tried.append(order)
        return SimpleNamespace(order=order, error=errors.get(order, errors[0]))

    monkeypatch.setattr(mobility_fit, "_fit", fit)
    found = mobility_fit._best_fit(thud.Mobility(np.arange(1.0, count + 1), np.ones(count)))  # noqa: SLF001
    return found.order, tried  # type: ignore[attr-defined]


@pytest.mark.parametrize("n_line", [20, 25, 40, 100, 400])
def test_number_of_poles_has_the_least_information_criterion(
    n_line: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """That of n = 2 lines and k = 2 poles + 1 coefficients is n lg error**2 + k lg n."""
    errors = {0: 0.0799, 2: 0.5, 4: 0.2, 6: 0.1, 8: 0.0995, 10: 0.099, 12: 0.08}
    found, tried = choose(monkeypatch, n_line, errors)
    count = 2 * n_line
    criteria = {
        k: count * np.log(errors.get(k, errors[0]) ** 2) + (2 * k + 1) * np.log(count)
        for k in tried
    }
    assert found == min(criteria, key=criteria.__getitem__)
    # Three values for each coefficient; and five numbers in a row without a gain end it.
    orders = [k for k in (*range(2, 17, 2), *range(20, 33, 4), 40, 48, 56, 64)
              if 3 * (2 * k + 1) <= count]  # fmt: skip
    assert tried == orders[: len(tried)]
    assert len(tried) - 1 - tried.index(found) == 5 or tried == orders
    # An exact fit ends it; few lines have few poles, and one at least.
    assert choose(monkeypatch, 400, {0: 1.1e-8, 4: 1e-8}) == (4, [2, 4])
    assert choose(monkeypatch, 2, {0: 1.0}) == (1, [1])


def test_line_at_0_hz_is_left_out_and_few_are_enough(tmp_path: Path) -> None:
    path = write_table(tmp_path / "point.csv", "f,re,im", np.arange(3.0), *2 * [np.ones(3) * 1e-5])
    assert thud.read_mobility(path).frequency.tolist() == [1, 2]
    few = thud.Mobility([20.0, 25.0, 40.0, 50.0], [1e-4] * 4)
    assert thud.fit_mobility(few).floor.damping_ratio
    assert " 1 pole," in repr(thud.fit_mobility(few, order=1))


def test_mobility_is_evaluated_saved_and_drawn(tmp_path: Path) -> None:
    floor = thud.Oscillator()
    of_floor = thud.mobility(floor, FREQUENCY)
    measured = thud.Mobility(FREQUENCY[::-1], of_floor.values[::-1])
    between = (FREQUENCY[5] + FREQUENCY[6]) / 2
    assert of_floor(between) == pytest.approx(thud.mobility(floor, between).values)
    assert measured(between) == pytest.approx([of_floor.values[5:7].mean()])
    of_floor.save(tmp_path / "floor.csv")
    again = thud.read_mobility(tmp_path / "floor.csv")
    np.testing.assert_allclose(again.values, of_floor.values, rtol=1e-9)
    magnitude, real = of_floor.plot().axes[0].get_lines()
    np.testing.assert_array_equal(magnitude.get_ydata(), abs(of_floor.values))
    np.testing.assert_array_equal(real.get_ydata(), of_floor.values.real)
