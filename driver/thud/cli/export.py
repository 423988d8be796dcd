"""The command that writes the force of a case or a recording for other programs."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from thud.case import read_case
from thud.checks import refuse
from thud.impact import compute

if TYPE_CHECKING:
    import argparse

    from thud.impact import Impact
    from thud.recordings.recording import Recording


def run_export(options: argparse.Namespace) -> int:
    """Write the blocked force in the formats that are asked for; return the exit code."""
    from thud import export_force  # noqa: PLC0415 - SciPy takes its time

    chosen = [kind for kind in export_force.EXPORTS if getattr(options, kind)]
    if not chosen:
        kinds = ", ".join(f"--{kind}" for kind in export_force.EXPORTS)
        refuse("export has no format", f"one or more of {kinds}")
    source = _read(options.source, options.config)
    for remark in source.remarks:
        print(f"thud-driver: {remark}", file=sys.stderr)
    force = export_force.blocked_force(source, drop=options.drop, rate=options.rate)
    folder = Path(options.output)
    folder.mkdir(parents=True, exist_ok=True)
    for kind in chosen:
        ending, export = export_force.EXPORTS[kind]
        paths = export(force, folder / f"{force.name}{ending}")
        if not options.quiet:
            print(*paths, sep="\n")
    return 0


def _read(path: str, config: str | None) -> Impact | Recording:
    """Return the impact of a case, or the recording, of a file."""
    from thud.recordings.formats import FORMATS  # noqa: PLC0415 - SciPy takes its time
    from thud.recordings.recording import read_recording  # noqa: PLC0415 - likewise

    endings = {ending for one in FORMATS for ending in one.suffixes}
    if os.path.splitext(path)[1].lower() in endings:  # noqa: PTH122 - may hold a zero byte
        return read_recording(path, config=config)
    return compute(read_case(path))
