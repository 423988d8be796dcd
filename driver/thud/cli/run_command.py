"""The command that runs cases as the executable does, and draws them."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

from tqdm import tqdm

from thud.base.bridge import ask, text
from thud.base.display import left_out
from thud.base.errors import InputError, ThudError
from thud.base.files import Results
from thud.case.case import Case, read_case
from thud.cli.command import exit_code, sentence
from thud.impact.compression import new_curve
from thud.impact.compute import new_impact
from thud.impact.free_modes import new_modes

if TYPE_CHECKING:
    import argparse

    from thud.base.bridge import Bundle

NOT_CONFORMING = 3


def run_cases(options: argparse.Namespace) -> int:
    """Run all cases, even where one fails; return the exit code."""
    worst = 0
    options.done = {}
    for path in tqdm(
        options.cases, unit="case", disable=len(options.cases) == 1 or options.quiet or None
    ):
        try:
            conforms = _run_case(path, options)
        except (ThudError, OSError) as error:
            if isinstance(error, OSError) and error.filename is None:
                raise  # of the screen, which is no better for the other cases
            tqdm.write(f"thud-driver: {sentence(error)}", file=sys.stderr)
            failure = exit_code(error)
            worst = failure if worst in (0, NOT_CONFORMING) else max(worst, failure)
        else:
            if options.check and not conforms and worst == 0:
                worst = NOT_CONFORMING
    return worst


def _run_case(path: str, options: argparse.Namespace) -> bool:
    """Run one case as the executable does, then draw it; return whether it conforms."""
    case = read_case(path)
    output = options.output or ""
    if output and len(options.cases) > 1:
        output = os.path.join(output, case.name)  # noqa: PTH118 - may be ""
    if case.name in options.done:
        message = (
            f"{path}: its name {case.name!r} is that of {options.done[case.name]}, "
            "whose results it would replace; allowed: different names, or separate runs"
        )
        raise InputError(message)
    options.done[case.name] = path
    answer = ask(
        "run", path=os.fsencode(path), output=os.fsencode(output), replace=options.replace,
        all=options.all, progress=not options.quiet,
    )  # fmt: skip
    for warning in answer.get("messages", {}).values():
        tqdm.write(f"thud-driver: {text(warning)}", file=sys.stderr)
    folder = Path(output or os.fsdecode(answer["directory"]))
    figures = _figures(answer, options)
    if figures:
        results = Results(folder, inputs=(path,), replace=options.replace)
        results.write(figures, marker=answer["case"])
    if not options.quiet:
        tqdm.write(f"{text(answer['table'])}\n  Results: {folder}\n")
    return bool(answer["conforms"])


def _figures(answer: Bundle, options: argparse.Namespace) -> dict[str, bytes]:
    """Return the files of the figures of a run, drawn from its results in memory."""
    contents: dict[str, bytes] = {}
    if options.no_figures and not options.animation:
        return contents
    case = Case.from_text(text(answer["case"]))
    impact = new_impact(case, answer) if "samples" in answer else None
    modes = new_modes(case.ball, answer) if "modes" in answer else None
    curve = new_curve(case, answer) if "compression" in answer else None
    moving = {"motion": impact, "floor_motion": impact and impact.on_floor}
    with TemporaryDirectory() as folder, left_out("a figure"):
        from thud import plot

        if not options.no_figures:
            count = None if options.all else plot.DEFAULT_COUNT
            contents = plot.figure_files(
                plot.case_figures(impact, modes, curve, count), options.format
            )
        for name, drop in moving.items():
            if options.animation and drop and drop.motion:
                path = Path(folder, f"{name}.gif")
                with left_out(path.name):
                    plot.animate(drop, path)
                    contents[path.name] = path.read_bytes()
    return contents
