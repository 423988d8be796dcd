"""Rules of the sources that no compiler checks."""

from __future__ import annotations

import re

from conftest import REPOSITORY

SOURCES = sorted((REPOSITORY / "src").glob("*/*.f90"))
FUNCTION = re.compile(
    r"^ *(?:pure |elemental )*function \w+\(.*?result\((\w+)\)(.*?)^ *end function",
    re.DOTALL | re.MULTILINE,
)
ORDER = ["base", "source", "fem", "level", "floor", "io", "app", "python"]


def test_threads_share_no_lengths_of_texts() -> None:
    # gfortran keeps the length of a deferred-length result in static memory. These files are used
    # by one thread at a time; everything else states its lengths (see src/base/text.f90).
    deferred = {
        path.name
        for path in SOURCES
        for result, body in FUNCTION.findall(path.read_text())
        if re.search(rf"character\(len=:\), allocatable :: {result}\b", body)
    }
    assert deferred == {"case.f90", "command_line.f90", "file.f90", "report.f90", "table.f90"}


def test_folders_import_downwards_only() -> None:
    home = {
        match[1]: path.parent.name
        for path in SOURCES
        for match in re.finditer(r"^module (thud_\w+)$", path.read_text(), re.MULTILINE)
    }
    for path in SOURCES:
        for used in re.findall(r"^ *use (thud_\w+)", path.read_text(), re.MULTILINE):
            assert ORDER.index(home[used]) <= ORDER.index(path.parent.name), f"{path}: {used}"
            if "fem" in home.values():
                assert (path.parent.name, home[used]) != ("level", "fem"), f"{path}: {used}"


def test_library_does_not_print() -> None:
    for path in SOURCES:
        code = [line.split("!")[0] for line in path.read_text().splitlines()]
        assert not [line for line in code if re.match(r" *(print|write *\( *\*)", line)], path
