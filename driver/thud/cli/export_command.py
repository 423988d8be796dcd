"""The command that writes the force of a case or a recording for other programs."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

from thud.base.checks import refuse
from thud.case.case import read_case
from thud.cli.command import QUIET, Command, argument, output, print_notes, results_of
from thud.impact.compute import compute

if TYPE_CHECKING:
    import argparse

    from thud.level.impact_result import ImpactResult

# By option: what it writes.
KINDS = {
    "wav": "32-bit floats, with their scale in a text file beside it",
    "csv": "table of time and force",
    "uff": "universal file, data set 58",
    "mat": "MATLAB file of time, force and spectrum",
    "spectrum": "table of the complex spectrum",
}


def run_export(options: argparse.Namespace) -> int:
    """Write the blocked force in the formats that are asked for; return the exit code."""
    from thud.export import force_files

    chosen = [kind for kind in KINDS if getattr(options, kind)]
    if not chosen:
        refuse("export: no format is given", ", ".join(f"--{kind}" for kind in KINDS))
    source = _read(options.source, options.config)
    print_notes(source.warnings)
    force = force_files.blocked_force(source, drop=options.drop, rate=options.rate)
    contents: dict[str, bytes] = {}
    for kind in chosen:
        ending, make = force_files.EXPORTS[kind]
        contents |= make(force, f"{force.name}{ending}")
    paths = results_of(options, "export", [options.source, options.config]).write(contents)
    if not options.quiet:
        print(*paths, sep="\n")
    return 0


def _read(path: str, config: str | None) -> ImpactResult:
    """Return the impact of a case, or the recording, of a file."""
    from thud.recordings.formats import FORMATS
    from thud.recordings.read_recording import read_recording

    endings = {ending for one in FORMATS for ending in one.suffixes}
    if os.path.splitext(path)[1].lower() in endings:  # noqa: PTH122 - may hold a zero byte
        return read_recording(path, config=config)
    if config is not None:
        refuse(f"{path}: --config {config} is of recordings", "none for a case")
    return compute(read_case(path))


EXPORT = Command(
    "write the blocked force of a case or a recording for other programs",
    (
        argument("source", metavar="CASE.nml|RECORDING", help="namelist file, or recording"),
        *(argument(f"--{kind}", action="store_true", help=what) for kind, what in KINDS.items()),
        *output("the files (default: outputs/export)"),
        argument("--rate", type=float, metavar="HZ", help="resample to this rate"),
        argument("--drop", type=int, default=1, help="drop of a recording (default: 1)"),
        argument("--config", metavar="LAB.toml", help="configuration of a recording"),
        QUIET,
    ),
    run_export,
)
