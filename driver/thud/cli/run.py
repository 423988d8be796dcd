"""The command that runs cases as the executable does, and draws them."""

from __future__ import annotations

import os
import signal
import sys
import threading
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from tqdm import tqdm

from thud._api import api, call, text
from thud.case import Case, read_case
from thud.checks import require_output
from thud.cli.command import exit_code, sentence
from thud.cli.figures import draw_all
from thud.errors import InputError, ThudError
from thud.free_modes import free_modes
from thud.models import FiniteElement
from thud.results import read_results

if TYPE_CHECKING:
    import argparse
    from collections.abc import Callable, Iterator

    from matplotlib.figure import Figure

NOT_CONFORMING = 3


def run_cases(options: argparse.Namespace) -> int:
    """Run cases, a bad one or not; return the exit code."""
    worst = 0
    options.done = {}
    for path in tqdm(options.cases, unit="case", disable=len(options.cases) == 1 or options.quiet):
        try:
            conforms = _run_case(path, options)
        except (ThudError, OSError) as error:
            tqdm.write(f"thud-driver: {sentence(error)}", file=sys.stderr)
            failure = exit_code(error)
            worst = failure if worst in (0, NOT_CONFORMING) else max(worst, failure)
        else:
            if options.check and not conforms and worst == 0:
                worst = NOT_CONFORMING
    return worst


def _run_case(path: str, options: argparse.Namespace) -> bool:
    """Run one case as the executable does, then draw it; return whether it conforms."""
    require_output(options.output)
    case = read_case(path)
    output = options.output or ""
    if output and len(options.cases) > 1:
        output = os.path.join(output, case.name)  # noqa: PTH118 - may be ""
    if case.name in options.done:
        message = (
            f"{path}: its name {case.name!r} is that of {options.done[case.name]}, "
            "whose results it would replace; allowed: cases of different names, or one by one"
        )
        raise InputError(message)
    options.done[case.name] = path
    with _interruptible():
        directory, table, remark, conforming = call(
            api.run, os.fsencode(path), os.fsencode(output), not options.quiet
        )
    if text(remark):
        tqdm.write(f"thud-driver: {text(remark)}", file=sys.stderr)
    # The library pads its answer with blanks; a directory of the user's may end with them.
    folder = Path(output or os.fsdecode(directory.rstrip()))
    if not options.no_figures:
        draw_all(folder, _case_figures(case, folder))
    if options.animation and (folder / "motion.pvd").exists():
        from thud.mesh_plot import animate  # noqa: PLC0415 - plotly takes its time

        animate(read_results(folder), folder / "motion.gif")
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


def _case_figures(case: Case, folder: Path) -> dict[str, Callable[[], Figure]]:
    """Return the figures of a case whose results are in a directory."""
    from thud import mesh_plot, plot  # noqa: PLC0415 - matplotlib takes its time

    figures: dict[str, Callable[[], Figure]] = {}
    if case.modes:
        modes = free_modes(case.ball, **vars(case.modes))
        figures["modes"] = lambda: mesh_plot.mode_shapes(modes)
    if case.model:
        impact = read_results(folder)
        name = case.name.replace("_", " ")
        source = case.limits.source
        figures["force"] = lambda: plot.force_history({name: impact}, force=None)
        figures["levels"] = lambda: plot.levels({name: impact}, source=source)
        if impact.motion:
            figures["motion"] = lambda: mesh_plot.motion(impact)
        model = case.model
        if isinstance(model, FiniteElement) and model.viscosity != "none":
            figures["loss_factor"] = lambda: mesh_plot.loss_factor(
                {model.viscosity.replace("_", " "): model}
            )
    return figures
