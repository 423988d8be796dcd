"""The small changes that `./bootstrap mutants` draws."""

from __future__ import annotations

from typing import TYPE_CHECKING

from changes import changes, is_valid

if TYPE_CHECKING:
    from pathlib import Path

PYTHON = '''"""Text with 1 + 2."""
from thud import a
LIMIT = 3

def get(x: int, y: float = 2.0) -> float:
    """Return x + 1."""
    if not x and y <= -1.5:
        raise ValueError(f"{x + 1} - 1")
    return (x * y
            + x[0]) ** 2
'''
FORTRAN = """module thud_a
   use thud_kinds, only: wp
   real(wp), parameter :: limit(*) = [3.0_wp]
   real(wp), intent(in) :: x(3)
   ! Text with 1 + 2.
   y = x(1)*2.5_wp - (a/b)**2 + &
      z
   if (.not. done .and. y >= -1.0e-3_wp) error = 'text - 1'
"""


def changed(path: Path, text: str) -> set[tuple[int, str, str]]:
    """Return line, old and new text of all changes that can be read."""
    path.write_text(text)
    found = [one for one in changes(path, path.name) if is_valid(path, one)]
    assert all(one.apply(text) != text for one in found)
    return {(one.first, text[one.begin : one.end].strip(), one.new) for one in found}


def test_changes_of_python_leave_texts_and_types_alone(tmp_path: Path) -> None:
    assert changed(tmp_path / "a.py", PYTHON) == {
        (3, "3", "4"), (5, "2.0", "4.0"),
        (7, "not", ""), (7, "and", "or"), (7, "<=", "<"), (7, "<=", ">"), (7, "-", ""),
        (7, "1.5", "3.0"), (9, "*", "/"), (9, "+", "-"), (9, "+ x[0]", ""), (9, "0", "1"),
        (9, "**", "*"), (9, "2", "3"),
    }  # fmt: skip


def test_changes_of_fortran_leave_texts_and_declarations_alone(tmp_path: Path) -> None:
    assert changed(tmp_path / "a.f90", FORTRAN) == {
        (3, "3.0_wp", "6.0_wp"),
        (6, "1", "2"), (6, "*", "/"), (6, "2.5_wp", "5.0_wp"), (6, "-", "+"), (6, "- (a/b)**2", ""),
        (6, "/", "*"), (6, "**", "*"), (6, "2", "3"), (6, "+", "-"),
        (8, ".not.", ""), (8, ".and.", ".or."), (8, ">=", ">"), (8, ">=", "<"), (8, "-", ""),
        (8, "1.0e-3_wp", "0.002_wp"),
    }  # fmt: skip
