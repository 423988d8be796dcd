"""The commands of ``thud-driver`` that run studies."""

from __future__ import annotations

import sys
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Any

import thud
from thud.checks import replace_file, require_output
from thud.levels import BANDWIDTHS
from thud.tables import format_rows

if TYPE_CHECKING:
    import argparse
    from collections.abc import Callable

    import xarray as xr
    from matplotlib.figure import Figure

_COMMANDS = {
    "sweep": "drops over a grid, a list or a random design of parameters",
    "sensitivity": "Sobol indices: which parameter matters for what",
    "design": "which geometry and material conform to the standards",
    "uncertainty": "how tolerances spread the levels, and how surely a ball conforms",
}


def add_study_commands(commands: Any) -> None:  # noqa: ANN401 - argparse does not export its type
    """Add the commands of studies to those of the command line."""
    for name, meaning in _COMMANDS.items():
        parser = commands.add_parser(name, help=meaning)
        parser.set_defaults(command=_run, kind=name)
        parser.add_argument("study", metavar="STUDY.toml", help="what varies around which case")
        parser.add_argument(
            "-o",
            "--output",
            metavar="DIR",
            help="directory for the results; an interrupted study goes on there "
            "(default: outputs/<study name>)",
        )
        parser.add_argument("--yes", action="store_true", help="start however many sets there are")
        parser.add_argument(
            "--backend",
            choices=("threads", "processes", "dask"),
            help="where sets are computed; the results are the same (default: threads)",
        )
        parser.add_argument("--workers", type=int, metavar="N", help="threads or processes")
        parser.add_argument("--scheduler", metavar="ADDRESS", help="of Dask, tcp://host:8786")
        parser.add_argument("-q", "--quiet", action="store_true", help="show nothing but errors")


def _run(options: argparse.Namespace) -> int:
    """Run a study, draw its figure, print what it tells."""
    from thud import plot  # noqa: PLC0415 - takes its time
    from thud.studies.run import describe  # noqa: PLC0415

    require_output(options.output)
    study = thud.read_study(options.study, options.kind)
    folder = Path(options.output or Path("outputs") / study.name)
    studies: dict[str, tuple[Callable[..., Any], Callable[..., Figure]]] = {
        "sweep": (thud.sweep, plot.draw_sweep),
        "sensitivity": (thud.sensitivity, plot.draw_sensitivity),
        "design": (thud.design_map, plot.draw_design_map),
        "uncertainty": (thud.uncertainty, plot.draw_uncertainty),
    }
    compute, draw = studies[options.kind]
    if not options.quiet:
        print(describe(study), file=sys.stderr)
    result = compute(
        study,
        folder,
        backend=options.backend,
        workers=options.workers,
        scheduler=options.scheduler,
        yes=options.yes,
        progress=not options.quiet,
    )
    dataset = result if options.kind == "sweep" else result.dataset
    if options.kind == "sensitivity":
        replace_file(folder / f"{study.name}_indices.csv", result.csv())
    computed = int((dataset["status"] == 0).sum())
    if computed:
        plot.save_all({study.name: draw(result)}, folder)
    if not options.quiet:
        print(format_rows(_summary(dataset) if options.kind == "sweep" else result.table()))
        print(f"Results: {folder}")
    _print_failures(dataset)
    return 0 if computed else thud.NumericalError.exit_code


def _summary(dataset: xr.Dataset) -> list[tuple[str, ...]]:
    """Return header and rows of text: the range of each result."""
    rows: list[tuple[str, ...]] = [("", "least", "median", "largest")]
    for name, variable in dataset.data_vars.items():
        if variable.dtype.kind == "f":
            bands = next((name for name in BANDWIDTHS if name in variable.dims), None)
            for band in dataset[bands].values if bands else [None]:
                values = variable.sel({bands: band}) if bands else variable
                place = "" if band is None else f" {band:g} Hz"
                label = f"{name}{place}, {variable.attrs['units']}"
                numbers = (values.min(), values.median(), values.max())
                rows.append((label, *(f"{float(number):.4g}" for number in numbers)))
    rows.append(("conforming sets", "", "", f"{int(dataset['conforms'].sum())}"))
    return rows


def _print_failures(dataset: xr.Dataset) -> None:
    """Say how many sets have no results, and why."""
    failed = dataset["status"].values != 0
    if failed.any():
        ((reason, _),) = Counter(dataset["reason"].values[failed]).most_common(1)
        print(
            f"thud-driver: {failed.sum()} of {failed.size} sets have no results, such as: {reason}",
            file=sys.stderr,
        )
