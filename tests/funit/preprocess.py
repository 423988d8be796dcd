"""Turn pFUnit suites into Fortran for the stand-in: one file per suite and the driver.

Usage: preprocess.py DRIVER.f90 SUITE.pf... ; a suite `x.pf` becomes `x.F90` beside the driver.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

TEST = re.compile(r"\s*@test\s*$", re.IGNORECASE)
ASSERT = re.compile(r"\s*@(assert\w+)\s*\((.*)\)\s*$", re.IGNORECASE)
DIRECTIVE = re.compile(r"\s*@")
SUBROUTINE = re.compile(r"\s*subroutine\s+(\w+)", re.IGNORECASE)


def translate(suite: Path) -> tuple[str, list[str]]:
    """Return the Fortran of a suite and the names of its tests."""
    lines: list[str] = []
    tests: list[str] = []
    awaiting = False
    for number, line in enumerate(suite.read_text(encoding="utf-8").splitlines(), start=1):
        if TEST.match(line):
            awaiting = True
            lines.append("")
            continue
        if awaiting and (found := SUBROUTINE.match(line)):
            tests.append(found[1])
            awaiting = False
        if called := ASSERT.match(line):
            lines += [
                f"      call {called[1]}({called[2]}, &",
                f"         location=SourceLocation('{suite.name}', {number}))",
                "      if (anyExceptions()) return",
                f'#line {number + 1} "{suite.name}"',
            ]
        elif DIRECTIVE.match(line):
            sys.exit(f"{suite}:{number}: the stand-in does not know {line.strip()}")
        else:
            lines.append(line)
    return "\n".join([f'#line 1 "{suite.name}"', *lines]) + "\n", tests


def main() -> None:
    """Translate the suites of the command line."""
    driver = Path(sys.argv[1])
    uses: list[str] = []
    calls: list[str] = []
    for suite in map(Path, sys.argv[2:]):
        code, tests = translate(suite)
        (driver.parent / f"{suite.stem}.F90").write_text(code, encoding="utf-8")
        for test in tests:
            alias = f"t{len(calls)}"
            uses.append(f"   use {suite.stem}, only: {alias} => {test}")
            calls.append(f"   call run_test('{suite.stem}: {test}', {alias})")
    program = ["program driver", "   use funit, only: finish_tests, run_test", *uses]
    program += [
        "   implicit none (type, external)",
        *calls,
        "   call finish_tests()",
        "end program",
    ]
    driver.write_text("\n".join(program) + "\n", encoding="utf-8")


main()
