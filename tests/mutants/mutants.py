"""Small changes of the sources, and whether tests notice them: `./bootstrap mutants`.

Draws changes of `src` and `driver` by a seed, makes each in a copy of the project, and runs the
tests that reach the changed line, the quickest first. Lists the changes that all of them let pass.
An interrupted run goes on where it ended. Exit code 1 where a change is not noticed.
"""

from __future__ import annotations

import argparse
import difflib
import itertools
import json
import os
import random
import sys
import threading
from functools import partial
from pathlib import Path
from subprocess import TimeoutExpired
from typing import TYPE_CHECKING

from changes import Change, changes, is_valid
from covering import read_covering
from tree import GRACE, ROOT, Tree, in_parallel

if TYPE_CHECKING:
    from collections.abc import Iterator

    from covering import Covering

FOLDER = ROOT / "build/mutants"
SOURCES = ("src/**/*.f90", "src/**/*.c", "driver/thud/**/*.py")
GENERATED = {"_schema.py"}


def draw(paths: list[Path], seed: int) -> Iterator[Change]:
    """Yield changes in random order: each line that has some is as likely as another."""
    chance = random.Random(seed)  # noqa: S311
    lines: dict[tuple[str, int], list[Change]] = {}
    for path in sorted({path for pattern in SOURCES for path in ROOT.glob(pattern)}):
        name = str(path.relative_to(ROOT))
        if path.name in GENERATED or not any(path.is_relative_to(one) for one in paths):
            continue
        text = path.read_text()
        for change in changes(path, name):
            lines.setdefault((name, text.count("\n", 0, change.begin)), []).append(change)
    drawn = [chance.choice(found) for found in chance.sample([*lines.values()], len(lines))]
    yield from (change for change in drawn if is_valid(ROOT / change.path, change))


def notice(tree: Tree, change: Change, covering: Covering, limit: float) -> str:
    """Return which test notices a change, "passes" where none does, or that it cannot be built."""
    tests = covering.of(change)
    if not tests:
        return "passes: no test reaches it"
    try:
        if not tree.put(change):
            return "not built"
        for suite in (test for test in tests if ".py" not in test):
            if not tree.run_suite(suite):
                return suite
        python, total = [], 0.0
        for test in (test for test in tests if ".py" in test):
            total += covering.seconds(test)
            if python and total > limit:
                break
            python.append(test)
        if python and tree.run_tests(python, seconds=3 * total + GRACE):
            return f"one of {len(python)} tests of Python"
    except TimeoutExpired:
        return "hangs"
    return "passes" if total <= limit else f"passes {len(python)} of {len(tests)} tests"


def difference(change: Change) -> str:
    """Return a change as a difference of texts."""
    text = (ROOT / change.path).read_text()
    lines = difflib.unified_diff(
        text.splitlines(),
        change.apply(text).splitlines(),
        change.path,
        change.path,
        n=1,
        lineterm="",
    )
    return "\n".join([*lines][2:])


def _source(text: str) -> Path:
    """Return the path of sources, or raise ArgumentTypeError."""
    path = Path(text).resolve()
    if not path.exists() or not path.is_relative_to(ROOT):
        message = f"{text} is no folder or file of this project"
        raise argparse.ArgumentTypeError(message)
    return path


def main() -> int:
    """Draw changes, run the tests, list what was not noticed; return the exit code."""
    parser = argparse.ArgumentParser(
        description=__doc__.partition("\n")[0], prog="./bootstrap mutants"
    )
    parser.add_argument(
        "paths", nargs="*", type=_source, metavar="PATH", help="folders or files (default: all)"
    )
    parser.add_argument(
        "--count", type=int, default=100, metavar="N", help="changes (default: 100)"
    )
    parser.add_argument("--seed", type=int, default=1, help="of the draw (default: 1)")
    parser.add_argument(
        "--limit",
        type=float,
        default=600.0,
        metavar="S",
        help="seconds of tests for one change (default: 600)",
    )
    options = parser.parse_args()
    width = len(os.sched_getaffinity(0))

    def new_trees(name: str, flags: str) -> list[Tree]:
        return [Tree(FOLDER / f"{name}-{n}", flags) for n in range(width)]

    trees = new_trees("tree", "-O1")
    covering = read_covering(FOLDER, trees, partial(new_trees, "coverage", "-O1 --coverage"))
    record = FOLDER / f"seed-{options.seed}.json"
    known: dict[str, str] = json.loads(record.read_text()) if record.exists() else {}
    drawn = draw(options.paths or [ROOT / "src", ROOT / "driver"], options.seed)
    counted: list[tuple[Change, str]] = []
    lock = threading.Lock()

    def attempt(tree: Tree, change: Change) -> None:
        key = f"{change}\n{difference(change)}"
        found = known.get(key) or notice(tree, change, covering, options.limit)
        with lock:
            # Whether what has passed is noticed by now is found anew.
            if not found.startswith("passes"):
                known[key] = found
                record.write_text(json.dumps(known, indent=1))
            if found != "not built":
                counted.append((change, found))
                if found.startswith("passes"):
                    print(f"{change.path}: {found}\n{difference(change)}\n", flush=True)

    while more := list(itertools.islice(drawn, options.count - len(counted))):
        in_parallel(attempt, trees, more, "changes")
    passed = [change for change, found in counted if found.startswith("passes")]
    noticed = len(counted) - len(passed)
    print(f"{noticed} of {len(counted)} changes are noticed (seed {options.seed})")
    return 1 if passed else 0


if __name__ == "__main__":
    sys.exit(main())
