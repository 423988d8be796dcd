"""The command that compares cases and recordings on one page."""

from __future__ import annotations

from typing import TYPE_CHECKING

from thud.checks import require_output
from thud.tables import aligned

if TYPE_CHECKING:
    import argparse


def compare_cases(options: argparse.Namespace) -> int:
    """Compare cases and recordings; return the exit code."""
    from thud import comparison  # noqa: PLC0415 - matplotlib takes its time

    require_output(options.output)
    found = comparison.read_all(options.cases)
    page = comparison.compare(found, options.force, options.source, progress=not options.quiet)
    paths = page.save(options.output)
    if not options.quiet:
        print(aligned([comparison.HEADER, *page.table()]))
        print(f"Page: {paths[-1]}")
    return 0
