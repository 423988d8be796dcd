"""The campaign of faults: nothing crashes, hangs, is lost or mixed, no number is wrong.

`python tests/faults/run.py` makes all of it, which takes hours, and goes on after an interrupt;
`--small` makes tries spread over all of it. Exit code 1 where a fault was found.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from pathlib import Path

from aliasing import check_aliasing
from attempts import attempts
from campaign import Part, Report
from checkouts import NAMES, check_checkouts
from clusters import check_clusters
from crowds import check_crowds, check_starts, check_threads
from directories import check_calls, check_damage, check_races
from directories import plan as plan_calls
from edges import check_elements, check_lumped, check_many, check_modal
from foreign_files import check_foreign
from kills import check_kills, check_slow_kills
from memory import check_memory
from places import check_places
from servers import check_explorer
from soak import check_soak
from steps import check_steps
from steps import plan as plan_steps


def parts() -> dict[str, Part]:
    """Return the parts of the campaign by name."""
    return {
        "calls": Part(lambda: len(plan_calls()), 60, check_calls),
        "races": Part(80, 8, check_races),
        "damage": Part(10_000, 60, check_damage, share=100),
        "kills": Part(10_000, 15, check_kills),
        "slow kills": Part(500, 1, check_slow_kills),
        "steps": Part(lambda: len(plan_steps()), 4, check_steps),
        "places": Part(3000, 12, check_places),
        "foreign": Part(3000, 16, check_foreign),
        "crowds": Part(1000, 4, check_crowds),
        "threads": Part(3000, 100, check_threads, share=100),
        "aliasing": Part(2000, 40, check_aliasing, share=100),
        "starts": Part(100, 1, check_starts),
        "explorer": Part(2000, 8, check_explorer),
        "clusters": Part(400, 2, check_clusters),
        "soak": Part(100_000, 100, check_soak, share=100),
        "memory": Part(1000, 12, check_memory),
        "namelists": Part(1_000_000, 400, attempts("namelists"), share=5000),
        "recordings": Part(100_000, 60, attempts("damaged_recordings"), share=2000),
        "studies": Part(100_000, 60, attempts("study_files"), share=500),
        "tables": Part(10_000, 60, attempts("table_files"), share=500),
        "many": Part(100_000, 200, check_many, share=1000),
        "lumped": Part(20_000, 60, check_lumped, share=100),
        "modal": Part(10_000, 8, check_modal, share=10),
        # A build takes minutes.
        "checkouts": Part(len(NAMES), 0, check_checkouts),
        "elements": Part(1000, 4, check_elements, share=4),
    }


def main() -> int:
    """Run the campaign; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--small", action="store_true", help="some tries of each part")
    parser.add_argument("--seed", type=int, default=None, help="of what is random")
    parser.add_argument("--part", action="append", help="part to run (default: all)")
    parser.add_argument(
        "--report", type=Path, default=Path("outputs/faults.json"), help="counts; it goes on there"
    )
    options = parser.parse_args()
    seed = options.seed if options.seed is not None else 0 if not options.small else time.time_ns()
    print(f"seed {seed}")
    report = Report(seed, None if options.small else options.report)
    with tempfile.TemporaryDirectory(prefix="thud_faults_") as folder:
        for name, part in parts().items():
            if options.part and name not in options.part:
                continue
            report.run(name, part, part.small, Path(folder), spread=options.small)
            print(report, flush=True)
    return 1 if report.faults else 0


if __name__ == "__main__":
    sys.exit(main())
