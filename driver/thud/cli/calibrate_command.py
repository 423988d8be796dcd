"""The command that finds N per unit from a record of a known force."""

from __future__ import annotations

from typing import TYPE_CHECKING

from thud.cli.command import QUIET, Command, argument, print_notes
from thud.recordings.channel import channel_of

if TYPE_CHECKING:
    import argparse


def run_calibrate(options: argparse.Namespace) -> int:
    """Print the lines of a configuration that a calibration record gives; return the exit code."""
    from thud.recordings.calibration import calibrate

    result = calibrate(
        options.record,
        force=options.force,
        mass=options.mass,
        channel=channel_of(options.channel),
        unit=options.unit,
        uncertainty=options.uncertainty,
    )
    print(f'calibration = "{result.chain}"')
    print(f"calibration_uncertainty = {result.uncertainty:.2g}")
    if not options.quiet:
        print(f"# {result.origin}")
    if not options.uncertainty:
        print_notes(["uncertainty of the known force not stated: not included (--uncertainty)"])
    return 0


CALIBRATE = Command(
    "N per unit from a record in which a known force is put on or taken off the plate",
    (
        argument("record", metavar="FILE", help="record of the known force"),
        argument("--mass", type=float, metavar="KG", help="known mass"),
        argument("--force", type=float, metavar="N", help="or known force"),
        argument(
            "--uncertainty",
            type=float,
            default=0.0,
            metavar="FRACTION",
            help="its relative standard uncertainty, such as 0.001",
        ),
        argument("--channel", metavar="NAME|NUMBER", help="channel of the force"),
        argument("--unit", help="unit of the recorded values, if the file does not state it"),
        QUIET,
    ),
    run_calibrate,
    "nothing is written",
)
