"""The command ``thud-driver``: cases with figures, studies, and the figures of the paper."""

from __future__ import annotations

import argparse
import os
import signal
import sys
import threading
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

from tqdm import tqdm

import thud
from thud._api import call, api, text
from thud.checks import require_output
from thud.files import add_files
from thud.study_commands import FORMATS, add_study_commands
from thud.tables import aligned

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from matplotlib.figure import Figure

NOT_CONFORMING = 3
INTERRUPTED = 130


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command.

    Parameters
    ----------
    arguments
        Words of the command line; by default those of this process.

    Returns
    -------
    int
        0 done, 1 bad input or usage, 2 numerical failure, 3 checked and not conforming,
        130 interrupted.
    """
    parser = _parser()
    try:
        options = parser.parse_args(arguments)
    except SystemExit as stop:
        # argparse leaves with 2 for bad usage, which is a numerical failure here.
        return thud.InputError.exit_code if stop.code else 0
    try:
        code = int(options.command(options))
        sys.stdout.flush()
    except KeyboardInterrupt:
        print(f"thud-driver: interrupted; {options.kept}", file=sys.stderr)
        return INTERRUPTED
    except (thud.ThudError, OSError) as error:
        if isinstance(error, OSError) and error.filename is None:
            # A screen that is full or closed; what Python still wants to write goes nowhere.
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        print(f"thud-driver: {_sentence(error)}", file=sys.stderr)
        return _exit_code(error)
    return code


def _parser() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    parser = argparse.ArgumentParser(
        prog="thud-driver",
        description="Cases with figures, studies, and the figures of the paper.",
        epilog="Exit codes: 0 done, 1 bad input or usage, 2 numerical failure, "
        "3 not conforming (run --check), 130 interrupted.",
    )
    parser.add_argument("--version", action="version", version=f"thud {thud.__version__}")
    parser.set_defaults(kept="what was finished is kept")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")

    run = commands.add_parser("run", help="run cases, write their results and figures")
    run.set_defaults(command=_run)
    run.add_argument("cases", nargs="+", metavar="CASE.nml", help="namelist files")
    run.add_argument(
        "-o",
        "--output",
        metavar="DIR",
        help="directory for the results; one below it for each of several cases "
        "(default: outputs/<case name>)",
    )
    run.add_argument("--check", action="store_true", help="exit with 3 where a source fails")
    run.add_argument(
        "-q", "--quiet", action="store_true", help="show nothing but errors and remarks"
    )
    run.add_argument("--no-figures", action="store_true", help="results only")
    run.add_argument(
        "--animation", action="store_true", help="also motion.gif, of cases with snapshots"
    )

    compare = commands.add_parser("compare", help="models and recordings of one drop on one page")
    compare.set_defaults(command=_compare, kept="a page is kept only when it is done")
    compare.add_argument(
        "cases",
        nargs="+",
        metavar="CASE.nml|RECORD.csv",
        help="namelist files, and recordings with columns of time, s, and force, N",
    )
    compare.add_argument(
        "-o",
        "--output",
        metavar="DIR",
        default="outputs/comparison",
        help="directory for the page (default: outputs/comparison)",
    )
    compare.add_argument("--force", choices=("elastic", "floor"), default="floor")
    compare.add_argument("--source", choices=("rubber_ball", "tyre"), default="rubber_ball")
    compare.add_argument("-q", "--quiet", action="store_true", help="show nothing but errors")

    add_study_commands(commands)

    fit = commands.add_parser("fit", help="parameters of a model from a force or from levels")
    fit.set_defaults(command=_fit, kept="a fit is kept only when it is done")
    fit.add_argument("study", metavar="STUDY.toml", help="target, parameters and base case")
    fit.add_argument(
        "-o", "--output", metavar="DIR", help="directory for the results (default: outputs/<study>)"
    )
    fit.add_argument("-q", "--quiet", action="store_true", help="show nothing but warnings")
    fit.add_argument("--no-figures", action="store_true", help="results only")

    figures = commands.add_parser(
        "figures", help="draw the figures of the paper and of the documentation"
    )
    figures.set_defaults(command=_figures)
    figures.add_argument(
        "-o",
        "--output",
        metavar="DIR",
        type=Path,
        default=Path("outputs/figures"),
        help="directory for the figures (default: outputs/figures)",
    )
    figures.add_argument(
        "-q", "--quiet", action="store_true", help="show nothing but errors and remarks"
    )
    return parser


def _run(options: argparse.Namespace) -> int:
    """Run the cases of the command line; a bad one does not keep the others from running."""
    worst = 0
    options.done = {}
    for path in tqdm(options.cases, unit="case", disable=len(options.cases) == 1 or options.quiet):
        try:
            conforms = _run_case(path, options)
        except (thud.ThudError, OSError) as error:
            tqdm.write(f"thud-driver: {_sentence(error)}", file=sys.stderr)
            failure = _exit_code(error)
            worst = failure if worst in (0, NOT_CONFORMING) else max(worst, failure)
        else:
            if options.check and not conforms and worst == 0:
                worst = NOT_CONFORMING
    return worst


def _run_case(path: str, options: argparse.Namespace) -> bool:
    """Run one case as the executable does, then draw it; return whether it conforms."""
    require_output(options.output)
    case = thud.read_case(path)
    output = options.output or ""
    if output and len(options.cases) > 1:
        output = os.path.join(output, case.name)  # noqa: PTH118 - may be ""
    if case.name in options.done:
        message = (
            f"{path}: its name {case.name!r} is that of {options.done[case.name]}, "
            "whose results it would replace; allowed: cases of different names, or one by one"
        )
        raise thud.InputError(message)
    options.done[case.name] = path
    with _interruptible():
        directory, table, remark, conforming = call(
            api.run, os.fsencode(path), os.fsencode(output), not options.quiet
        )
    if text(remark):
        tqdm.write(f"thud-driver: {text(remark)}", file=sys.stderr)
    # The library pads its answer with blanks; a directory of the user's may end with them.
    folder = Path(output or os.fsdecode(directory.rstrip()))
    marker = (folder / "effective.nml").read_bytes()
    with TemporaryDirectory() as name:
        drawn = Path(name)
        if not options.no_figures:
            _draw(drawn, _case_figures(case, folder))
        if options.animation and (folder / "motion.pvd").exists():
            thud.mesh_plot.animate(thud.read_results(folder), drawn / "motion.gif")
        add_files(folder, {path.name: path.read_bytes() for path in drawn.iterdir()}, marker)
    if not options.quiet:
        tqdm.write(f"{text(table)}\n  Results: {folder}\n")
    return bool(conforming)


@contextmanager
def _interruptible() -> Iterator[None]:
    """Let an interrupt end the process at once; Python would wait for the end of the call.

    Nothing is lost: results are written as a whole, or not at all.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    usual = signal.signal(signal.SIGINT, signal.SIG_DFL)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, usual)


def _case_figures(case: thud.Case, folder: Path) -> dict[str, Callable[[], Figure]]:
    """Return the figures of a case whose results are in a directory."""
    figures: dict[str, Callable[[], Figure]] = {}
    if case.modes:
        modes = thud.free_modes(case.ball, **vars(case.modes))
        figures["modes"] = lambda: thud.mesh_plot.mode_shapes(modes)
    if case.model:
        impact = thud.read_results(folder)
        name = case.name.replace("_", " ")
        source = case.limits.source
        figures["force"] = lambda: thud.plot.force_history({name: impact}, force=None)
        figures["levels"] = lambda: thud.plot.levels({name: impact}, source=source)
        if impact.motion:
            figures["motion"] = lambda: thud.mesh_plot.motion(impact)
        model = case.model
        if isinstance(model, thud.FiniteElement) and model.viscosity != "none":
            figures["loss_factor"] = lambda: thud.mesh_plot.loss_factor(
                {model.viscosity.replace("_", " "): model}
            )
    return figures


def _figures(options: argparse.Namespace) -> int:
    """Draw the figures of the paper and of the documentation."""
    from thud.figures import get_figures  # noqa: PLC0415 - matplotlib takes its time

    options.output.mkdir(parents=True, exist_ok=True)
    _draw(options.output, get_figures(), quiet=options.quiet)
    if not options.quiet:
        print(f"Figures: {options.output}")
    return 0


def _compare(options: argparse.Namespace) -> int:
    """Compare cases and recordings."""
    require_output(options.output)
    found = thud.read_all(options.cases)
    comparison = thud.compare(found, options.force, options.source, progress=not options.quiet)
    paths = comparison.save(options.output)
    if not options.quiet:
        print(aligned([thud.comparison.HEADER, *comparison.table()]))
        print(f"Page: {paths[-1]}")
    return 0


def _fit(options: argparse.Namespace) -> int:
    """Fit parameters as a study says."""
    require_output(options.output)
    return int(thud.fitting.run(options))


def _draw(folder: Path, figures: dict[str, Callable[[], Figure]], *, quiet: bool = True) -> None:
    """Draw figures and save them as PNG and SVG."""
    for name, draw in tqdm(figures.items(), unit="figure", disable=quiet, leave=False):
        figure = draw()
        for ending in FORMATS:
            thud.plot.save(figure, folder / f"{name}{ending}")


def _exit_code(error: Exception) -> int:
    """Return the exit code of an error; a file that cannot be written is bad input."""
    return error.exit_code if isinstance(error, thud.ThudError) else thud.InputError.exit_code


def _sentence(error: Exception) -> str:
    """Return an error as one sentence."""
    if isinstance(error, OSError):
        place = error.filename or "standard output"
        return f"{place}: {error.strerror}; allowed: a place that you may write to"
    return str(error)


if __name__ == "__main__":
    sys.exit(main())
