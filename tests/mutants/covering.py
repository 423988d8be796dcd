"""Which tests reach which lines, and their times, measured once for a state of the project."""

from __future__ import annotations

import ast
import json
import re
import shutil
import xml.etree.ElementTree as ET
from collections import defaultdict
from functools import cache
from hashlib import sha256
from pathlib import Path
from subprocess import TimeoutExpired, run
from typing import TYPE_CHECKING

from coverage import CoverageData
from coverage.exceptions import DataError
from tree import ROOT, in_parallel

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

    from changes import Change
    from tree import Tree

# Sources and test files: what the record of the lines depends on.
STATE = (
    "src/**/*.f90",
    "src/**/*.c",
    "driver/**/*.py",
    "tests/fortran/*.pf",
    "tests/fortran/*.f90",
    "tests/driver/*.py",
    "tests/validation/*.py",
)
# Seconds that one file of tests may take; those of the campaign and of the site would take longer.
LIMIT = 900
GCOV = shutil.which("gcov") or "gcov"
LEFT_OUT = {"test_site", "test_explorer_page", "test_faults"}
SETTINGS = """[run]
source = {root}/driver
source_pkgs = thud
dynamic_context = test_function
context = ${{PYTEST_CURRENT_TEST-}}
patch = subprocess
parallel = true
data_file = {data}
"""


class Covering:
    """Tests by the lines that they reach.

    A test is the name of a Fortran suite, or `file::function` of Python, or `file` for what its
    fixtures run. Each file of Python counts as reaching all of the core, whose counts would make
    it several times as slow.
    """

    def __init__(
        self, lines: Mapping[str, Mapping[int, set[str]]], seconds: Mapping[str, float]
    ) -> None:
        self._lines = lines
        self._seconds = seconds

    def of(self, change: Change) -> list[str]:
        """Return the tests that reach a statement, the quickest first.

        A statement outside of procedures counts as reached by the tests that reach its file, or one
        that imports it.
        """
        lines = self._lines.get(change.path, {})
        found = {test for n in range(change.first, change.last + 1) for test in lines.get(n, ())}
        if not found:
            files = [change.path, *_users(change.path)]
            found = {
                test
                for file in files
                for tests in self._lines.get(file, {}).values()
                for test in tests
            }
        if change.path.startswith("src/"):
            found |= {test for test in self._seconds if test.endswith(".py")}
        return sorted(found, key=self.seconds)

    def seconds(self, test: str) -> float:
        """Return what a test took."""
        return self._seconds.get(test, 0.0)


def _users(path: str) -> list[str]:
    """Return the files that import a source."""
    module = f"thud_{Path(path).stem}"
    if path.startswith("driver/"):
        module = path.removeprefix("driver/").removesuffix(".py").replace("/", ".")
    imports = re.compile(rf"^\s*(?:use|from|import) +{re.escape(module)}\b", re.MULTILINE)
    sources = {path for pattern in STATE[:3] for path in ROOT.glob(pattern)}
    return [str(one.relative_to(ROOT)) for one in sources if imports.search(one.read_text())]


@cache
def _bodies(path: Path) -> set[int]:
    """Return the lines of functions; the others run when the file is imported."""
    functions = (
        one
        for one in ast.walk(ast.parse(path.read_text()))
        if isinstance(one, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda)
    )
    bodies = [
        (one.body[0], one.body[-1]) if isinstance(one.body, list) else (one.body, one.body)
        for one in functions
    ]
    return {
        n
        for first, last in bodies
        for n in range(first.lineno, (last.end_lineno or first.lineno) + 1)
    }


def read_covering(
    folder: Path, trees: list[Tree], new_counting: Callable[[], list[Tree]]
) -> Covering:
    """Return the record of the present state of the project.

    What is missing of it is measured: each file of Python by itself in trees, each suite in trees
    whose build counts lines.
    """
    digest = sha256()
    for path in sorted(path for pattern in STATE for path in ROOT.glob(pattern)):
        digest.update(path.read_bytes())
    records = folder / f"covering-{digest.hexdigest()[:16]}"
    records.mkdir(parents=True, exist_ok=True)
    suites = [path.stem for path in (ROOT / "tests/fortran").glob("test_*.pf")]
    files = [path for part in STATE[-2:] for path in ROOT.glob(part) if path.match("test_*.py")]
    jobs = [*(path for path in files if path.stem not in LEFT_OUT), *suites]

    def missing(kind: type) -> list[str | Path]:
        return [job for job in jobs if isinstance(job, kind) and not _record(records, job).exists()]

    def measure(tree: Tree, job: str | Path) -> None:
        place = folder / "data" / _record(records, job).stem
        shutil.rmtree(place, ignore_errors=True)
        place.mkdir(parents=True)
        if isinstance(job, str):
            tree.run_suite(job, GCOV_PREFIX=str(place))
            measured = [(*line, job) for line in _core_lines(tree, place)], {job: 0.0}
        else:
            measured = _python_file(tree, job, place)
        # Processes that a test has left may still write.
        shutil.rmtree(place, ignore_errors=True)
        _record(records, job).write_text(json.dumps(measured))

    in_parallel(measure, trees, missing(Path), "files of tests")
    if missing(str):
        in_parallel(measure, new_counting(), missing(str), "suites")
    lines: dict[str, dict[int, set[str]]] = defaultdict(lambda: defaultdict(set))
    seconds: dict[str, float] = {}
    for job in jobs:
        reached, took = json.loads(_record(records, job).read_text())
        seconds |= took
        for path, number, test in reached:
            lines[path][number].add(test)
    return Covering(lines, seconds)


def _record(records: Path, job: str | Path) -> Path:
    """Return the file of what was measured of a suite, or of a file of tests."""
    return records / (f"{job}.json" if isinstance(job, str) else f"{job.stem}-python.json")


def _python_file(
    tree: Tree, path: Path, room: Path
) -> tuple[list[tuple[str, int, str]], dict[str, float]]:
    """Return the lines that the tests of a file reach, and the seconds of those that pass."""
    name = str(path.relative_to(ROOT))
    settings = room / "settings"
    settings.write_text(SETTINGS.format(root=tree.root, data=room / "data"))
    more = [
        "-m",
        "coverage",
        "run",
        f"--rcfile={settings}",
        "-m",
        "pytest",
        f"--junitxml={room / 'times.xml'}",
        "-ojunit_family=xunit1",  # of the two, the one that takes what oracles record
    ]
    try:
        tree.run_tests([name], *more, seconds=LIMIT, COVERAGE_RCFILE=str(settings))
    except TimeoutExpired:
        return [], {}
    seconds: dict[str, float] = defaultdict(float)
    failed = set()
    for case in ET.parse(room / "times.xml").iter("testcase"):  # noqa: S314 - pytest has written it
        test = f"{name}::{case.get('name', '').partition('[')[0]}"
        seconds[test] += float(case.get("time", 0))
        if case.find("failure") is not None or case.find("error") is not None:
            failed.add(test)
    # A test that fails without a change tells nothing.
    passed = {test: took for test, took in seconds.items() if test not in failed}
    reached = [
        (*place, test)
        for *place, test in _driver_lines(tree, room, name)
        if test in passed or test == name
    ]
    return reached, passed | {name: sum(passed.values())}  # type: ignore[return-value]


def _driver_lines(tree: Tree, room: Path, name: str) -> Iterator[tuple[str, int, str]]:
    """Yield file, line and test of the Python code that was run."""
    for part in room.glob("data.*"):
        data = CoverageData(str(part))
        try:
            data.read()
        except DataError:  # of a process that a test has killed
            continue
        for file in data.measured_files():
            path = Path(file)
            bases = (tree.root / "driver", tree.installed)
            base = next((one for one in bases if path.is_relative_to(one)), None)
            if base is None:  # a copy that a test has made
                continue
            bodies = _bodies(path)
            for line, contexts in data.contexts_by_lineno(file).items():
                for context in contexts if line in bodies else ():
                    test = re.search(r"::(\w+)", context) or re.search(r"\.(test_\w+)$", context)
                    yield (
                        f"driver/{path.relative_to(base)}",
                        line,
                        f"{name}::{test[1]}" if test else name,
                    )


def _core_lines(tree: Tree, room: Path) -> Iterator[tuple[str, int]]:
    """Yield file and line of the Fortran and C code that was run, as gcov counts it."""
    for counts in room.rglob("*.gcda"):
        notes = counts.with_suffix(".gcno")
        notes.symlink_to("/" / notes.relative_to(room))
        said = run(
            [GCOV, "--json-format", "--stdout", counts], capture_output=True, check=False, cwd=room
        )
        for file in json.loads(said.stdout or '{"files": []}')["files"]:
            path = (tree.build / file["file"]).resolve()
            if path.is_relative_to(tree.root / "src"):
                known = str(path.relative_to(tree.root))
                yield from ((known, line["line_number"]) for line in file["lines"] if line["count"])
