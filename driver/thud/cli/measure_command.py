"""The command that measures recordings: levels, verdict, figures, report."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from thud.base.tables import format_rows
from thud.cli.command import (
    NO_FIGURES,
    QUIET,
    Command,
    argument,
    output,
    print_notes,
    results_of,
)
from thud.level.levels import SOURCES
from thud.recordings.channel import channel_of

if TYPE_CHECKING:
    import argparse

NOT_CONFORMING = 3
# Drops that the screen shows.
SHOWN = 50


def measure(options: argparse.Namespace) -> int:
    """Measure recordings, print the verdict and save results; return the exit code."""
    from thud.recordings.checkpoint import Checkpoint
    from thud.recordings.read_recording import read_recording
    from thud.report import recording_files

    figures = not options.no_figures
    files = results_of(options, Path(options.drops[0]).stem, [*options.drops, options.config])
    files.require(recording_files.file_names(figures=figures))
    folder = files.folder
    # Drops stay until the results are written.
    with Checkpoint(folder) as kept:
        recording = read_recording(
            options.drops,
            height=options.height,
            mass=options.mass,
            height_uncertainty=options.height_uncertainty,
            mass_uncertainty=options.mass_uncertainty,
            source=options.source,
            channel=channel_of(options.channel),
            unit=options.unit,
            calibration=options.calibration,
            calibration_uncertainty=options.calibration_uncertainty,
            polarity=options.polarity,
            sample_rate=options.sample_rate,
            low_pass=options.low_pass or None,
            config=options.config,
            progress=not options.quiet and sys.stderr.isatty(),
            workers=len(os.sched_getaffinity(0)) if options.workers is None else options.workers,
            checkpoint=kept,
        )
        verdict = recording.assess()
        recording_files.save(recording, files, figures=figures)
    if not options.quiet:
        rows = recording_files.drop_table(recording)
        print(format_rows(rows[: SHOWN + 1]))
        if len(rows) > SHOWN + 1:
            print(f"and {len(rows) - SHOWN - 1} more drops, in {folder / 'report.json'}")
        print()
        print(format_rows(recording_files.table(recording)))
        print()
        for step in (*recording_files.sentences(recording, "steps"), *recording.level_steps):
            print(f"  {step}")
        print(f"  {recording_files.verdict_text(recording)}")
    messages = recording_files.sentences(recording, "warnings")
    print_notes((*recording.own_warnings, *recording.outliers, *messages))
    if not options.quiet:
        print(f"Results: {folder}")
    return NOT_CONFORMING if options.check and not verdict else 0


MEASURE = Command(
    "levels, verdict and calibration report of recorded drops",
    (
        argument(
            "drops", nargs="+", metavar="FILE", help="recordings, with one or many drops each"
        ),
        argument("--source", choices=SOURCES, help="source of the limits (default: rubber_ball)"),
        argument("--mass", type=float, metavar="KG", help="mass of the source"),
        argument("--height", type=float, metavar="M", help="drop height"),
        argument("--mass-uncertainty", type=float, metavar="KG", help="its standard uncertainty"),
        argument("--height-uncertainty", type=float, metavar="M", help="its standard uncertainty"),
        argument("--config", metavar="LAB.toml", help="laboratory, instruments, calibration"),
        argument("--channel", metavar="NAME|NUMBER", help="channel of the force"),
        argument("--unit", help="unit of the recorded values, if the file does not state it"),
        argument(
            "--calibration", metavar="N/UNIT", help='such as "250 N/V" or "4.1 pC/N, 10 mV/pC"'
        ),
        argument(
            "--calibration-uncertainty",
            type=float,
            metavar="FRACTION",
            help="relative standard uncertainty of the calibration, such as 0.005",
        ),
        argument(
            "--polarity", choices=("positive", "negative"), help="sign of a compression in the file"
        ),
        argument("--sample-rate", type=float, metavar="HZ", help="if the file does not state it"),
        argument(
            "--low-pass", action="store_true", help="levels of the force low-passed at 1.25 kHz"
        ),
        argument(
            "--workers", type=int, metavar="N", help="processes (default: one for each processor)"
        ),
        *output("the results (default: outputs/<name of the first file>)"),
        argument("--check", action="store_true", help="exit with 3 unless the source conforms"),
        NO_FIGURES,
        QUIET,
    ),
    measure,
    "drops of an interrupted measurement are taken up by the same command",
)
