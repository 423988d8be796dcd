"""Rules of the sources that no compiler checks."""

from __future__ import annotations

import re

from conftest import REPOSITORY

from thud.base._schema import KEYS

SOURCES = sorted((REPOSITORY / "src").rglob("*.f90"))
FUNCTION = re.compile(
    r"^ *(?:pure |elemental )*function \w+\(.*?result\((\w+)\)(.*?)^ *end function",
    re.DOTALL | re.MULTILINE,
)


def test_threads_share_no_lengths_of_texts() -> None:
    # gfortran keeps the length of a deferred-length result in static memory. These files are used
    # by one thread at a time; everything else states its lengths (see src/base/text.f90).
    deferred = {
        path.name
        for path in SOURCES
        for result, body in FUNCTION.findall(path.read_text())
        if re.search(rf"character\(len=:\), allocatable :: {result}\b", body)
    }
    assert deferred == {"room_table.f90", "schema.f90", "screen.f90", "screen_tables.f90"}


def test_library_does_not_print() -> None:
    for path in SOURCES:
        code = [line.split("!")[0] for line in path.read_text().splitlines()]
        assert not [line for line in code if re.match(r" *(print|write *\( *\*)", line)], path


def test_meanings_of_keys_are_whole() -> None:
    """The library holds 128 characters of a meaning, and cuts what is longer."""
    assert [key.name for key in KEYS if len(key.meaning) > 127] == []
