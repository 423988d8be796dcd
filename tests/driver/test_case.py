"""Cases as dataclasses and namelist files."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from conftest import INPUTS, MINIMAL, naming

import thud
from thud.base._schema import FLOORS, GROUPS, MODELS, OPTIONAL_GROUPS

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from conftest import CaseFile, Run


def test_defaults_are_those_of_the_library(case_file: CaseFile) -> None:
    assert thud.read_case(case_file("&model /")) == thud.Case(name="case")


@pytest.mark.parametrize("path", INPUTS, ids=lambda path: path.stem)
def test_written_case_reads_back_the_same(path: Path, tmp_path: Path) -> None:
    case = thud.read_case(path)
    assert case.name == path.stem
    thud.write_case(case, tmp_path / "copy.nml")
    assert thud.read_case(tmp_path / "copy.nml") == case


@pytest.mark.parametrize(
    ("make", "subject", "value", "ends"),
    [
        (lambda: thud.Ball(outer_radius=-1), "ball.outer_radius", -1, (0, 10)),
        (lambda: thud.Ball(wall_thickness=-1), "ball.wall_thickness", -1, (0, np.nan)),
        (lambda: thud.Ball(mass=10**5000), "ball.mass", np.nan, (1e-12, 1e6)),
        (lambda: thud.Drop(height=np.inf), "drop.height", np.nan, (1e-12, 1e6)),
        (lambda: thud.FiniteElement(radial_elements=-1), "mesh.radial_elements", -1, (0, 64)),
        (lambda: thud.Plate(edges="x"), "plate.edges", np.nan, (np.nan, np.nan)),  # type: ignore[arg-type]
    ],
)  # fmt: skip
def test_values_are_checked_when_a_group_is_made(
    make: Callable[[], object], subject: str, value: float, ends: tuple[float, float]
) -> None:
    """Keys of a file, such as those of ``&mesh``, are named by their groups there."""
    with pytest.raises(thud.InputError, match=naming(f"&{subject.replace('.', ': ')}")) as refused:
        make()
    note = refused.value.note
    assert note is not None
    assert note.subject == subject
    np.testing.assert_array_equal([note.value, note.low, note.high], [value, *ends])


def test_every_default_is_allowed() -> None:
    for kind in (GROUPS | OPTIONAL_GROUPS | MODELS | FLOORS).values():
        default = vars(kind())
        assert kind.keys.keys() == default.keys()
        for name, value in default.items():
            if value not in {None, ()}:
                kind.keys[name].require(value)
        # As the library writes limits: 1000000, 1e13.
        assert not any("e+" in key.allowed for key in kind.keys.values())


def test_file_may_begin_with_a_byte_order_mark(case_file: CaseFile) -> None:
    plain = thud.read_case(case_file(MINIMAL))
    assert thud.read_case(case_file(f"\N{ZERO WIDTH NO-BREAK SPACE}{MINIMAL}")) == plain


def test_echo_has_no_value_of_the_standard_ball_that_the_law_does_not_use(
    case_file: CaseFile, run: Run, tmp_path: Path
) -> None:
    case = "&ball / &drop / &model name = 'finite_element' / &mesh radial_elements = 2 / "
    result = run(case_file(case + "&material viscosity = 'kelvin_voigt' /"))
    (echo,) = tmp_path.glob("outputs/*/effective.nml")
    for text in (result.stdout, echo.read_text()):
        assert "loss_factor" in text
        assert "fractional_order" not in text
