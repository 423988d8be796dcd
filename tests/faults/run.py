"""The campaign of faults: nothing crashes, hangs, is lost or mixed, no number is wrong.

`python tests/faults/run.py` makes all of it, which takes hours, and goes on after an interrupt;
`--small` makes tries spread over all of it. Exit code 1 where a fault was found.
"""

from __future__ import annotations

import argparse
import sys
import time
from functools import partial
from pathlib import Path

import mutate_recordings
import namelists
import study_files
import table_files
from aliasing import check_aliasing
from attempts import find
from campaign import Part, Report, each
from checkouts import NAMES, check_checkouts
from crowds import check_starts, check_threads
from edge_cases import LUMPED, WEIGHTS
from edges import check_many, check_models
from servers import check_explorer
from soak import check_soak


def parts() -> dict[str, Part]:
    """Return the parts of the campaign by name."""
    return {
        "threads": Part(3000, 100, check_threads, share=100),
        "aliasing": Part(2000, 40, check_aliasing, share=100),
        "starts": Part(100, 1, check_starts),
        "explorer": Part(2000, 8, check_explorer),
        "soak": Part(100_000, 100, check_soak, share=100),
        "namelists": Part(1_000_000, 400, each(namelists.attempt), limit=10, may_stop=True),
        "recordings": Part(100_000, 1000, each(mutate_recordings.attempt), limit=20),
        "studies": Part(100_000, 60, each(study_files.attempt), limit=20, may_stop=True),
        "tables": Part(10_000, 60, each(table_files.attempt), limit=20, may_stop=True),
        "many": Part(100_000, 200, check_many, share=1000),
        "lumped": Part(20_000, 60, check_models(LUMPED, WEIGHTS)),
        "modal": Part(10_000, 8, check_models(["modal_ball"]), limit=20, may_stop=True),
        "elements": Part(1000, 4, check_models(["finite_element"]), limit=15, may_stop=True),
        # A build takes minutes.
        "checkouts": Part(len(NAMES), 0, check_checkouts, limit=900),
    }


def main() -> int:
    """Run the campaign; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--small", action="store_true", help="some tries of each part")
    parser.add_argument("--tries", type=int, help="tries of each part, spread over all of it")
    parser.add_argument("--seed", type=int, default=0, help="of what is random")
    parser.add_argument("--part", action="append", help="part to run (default: all)")
    parser.add_argument("--report", type=Path, help="counts (default: outputs/faults.json; none "
                        "with --small); the campaign goes on there")  # fmt: skip
    options = parser.parse_args()
    path = options.report or (None if options.small else Path("outputs/faults.json"))
    report = Report(options.seed, path)
    for name, part in parts().items():
        if options.part and name not in options.part:
            continue
        start = time.monotonic()
        tries = part.count()
        count = options.tries or (part.small if options.small else tries)
        report.run(name, tries, min(count, tries), partial(find, name, part))
        print(report)
        print(f"{name}: {time.monotonic() - start:.0f} s", flush=True)
    return 1 if report.faults else 0


if __name__ == "__main__":
    sys.exit(main())
