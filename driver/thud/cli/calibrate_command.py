"""The command that finds N per unit from a record of a known force."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

from thud.cli.command import QUIET, Command, argument
from thud.recordings.channel import channel_of

if TYPE_CHECKING:
    import argparse


def run_calibrate(options: argparse.Namespace) -> int:
    """Print the lines of a configuration that a calibration record gives; return the exit code."""
    from thud.recordings.calibration import calibrate

    found = calibrate(
        options.record,
        force=options.force,
        mass=options.mass,
        channel=channel_of(options.channel),
        unit=options.unit,
        uncertainty=options.uncertainty,
    )
    print(f'calibration = "{found.chain}"')
    print(f"calibration_uncertainty = {found.uncertainty:.2g}")
    if not options.quiet:
        print(f"# {found.origin}")
    if not options.uncertainty:
        told = "the uncertainty of the known force is not given and not counted (--uncertainty)"
        print(f"thud-driver: {told}", file=sys.stderr)
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
            metavar="PART",
            help="its relative standard uncertainty, such as 0.001",
        ),
        argument("--channel", metavar="NAME|NUMBER", help="channel of the force"),
        argument("--unit", help="unit of the recorded values, where the file does not say it"),
        QUIET,
    ),
    run_calibrate,
    "nothing is written",
)
