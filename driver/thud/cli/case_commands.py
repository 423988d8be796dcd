"""Commands on cases: run, compare, export and inputs of the documentation."""

from __future__ import annotations

import os
import shutil
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

from tqdm import tqdm

from thud.base.bridge import ask, notes
from thud.base.checks import refuse
from thud.base.display import warn_if_not_drawn
from thud.base.errors import ThudError
from thud.base.files import Results, inputs_folder
from thud.base.tables import format_rows
from thud.case.case import Case, read_case
from thud.cli.command import (
    NO_FIGURES,
    NOT_CONFORMING,
    QUIET,
    argument,
    command,
    exit_code,
    file_of,
    files,
    finish,
    flag,
    kind_of,
    message_of,
    option,
    output,
    results_of,
)
from thud.cli.screen import print_error, print_notes, print_path, print_results, shows_progress
from thud.impact.compression import new_curve
from thud.impact.compute import compute, new_impact
from thud.impact.free_modes import new_modes
from thud.level.levels import FORCES, SOURCES

if TYPE_CHECKING:
    import argparse

    from thud.base.bridge import Bundle
    from thud.recordings.recording import ImpactResult


@command(
    "run",
    "run cases, write their results and figures",
    files("cases", "CASE.nml", "namelist files", "case", nargs="+"),
    *output(
        "the results; several cases have a subdirectory each (default: outputs/<case name>)"
    ),
    flag("--check", "exit with 3 unless all sources conform with the values of their cases "
         "(assess --check: over what is not known)"),
    NO_FIGURES,
    argument("--format", choices=("svg", "png", "pdf"), default="svg",
             help="format of the figures (default: svg)"),
    flag("--all", "also write quantities of the model against time (model_histories.csv) and "
         "every figure"),
    flag("--animation", "also write motion.gif of cases with snapshots"),
    argument("-v", "--verbose", action="store_true",
             help="also show numbers of the solver: resolution, quantities of the model"),
    QUIET,
)  # fmt: skip
def run_cases(options: argparse.Namespace) -> int:
    """Run all cases, even if one fails; return the exit code."""
    if options.verbose and options.quiet:
        refuse("--verbose contradicts --quiet", "one of them")
    worst = 0
    options.done = {}
    for path in tqdm(
        options.cases,
        unit="case",
        disable=len(options.cases) == 1 or not shows_progress(quiet=options.quiet),
        leave=False,
    ):
        try:
            conforms = _run_case(path, options)
        except (ThudError, OSError) as error:
            if isinstance(error, OSError) and error.filename is None:
                raise  # standard output fails for the other cases, too
            print_error(message_of(error))
            failure = exit_code(error)
            worst = failure if worst in (0, NOT_CONFORMING) else max(worst, failure)
        else:
            if options.check and not conforms and worst == 0:
                worst = NOT_CONFORMING
    return worst


def _run_case(path: str, options: argparse.Namespace) -> bool:
    """Run a case like the executable and draw its figures; return whether it conforms."""
    case = read_case(path)
    output = options.output or ""
    if output and len(options.cases) > 1:
        output = os.path.join(output, case.name)  # noqa: PTH118 - may be ""
    # Windows and macOS do not distinguish case.
    key = case.name.casefold()
    if key in options.done:
        refuse(
            f"{path}: {case.name!r} is also the name of {options.done[key]}, "
            "whose results would be replaced",
            "different names, or separate runs",
        )
    options.done[key] = path
    results = Results(
        Path(output or Path("outputs", case.name)),
        "run",
        case.name,
        (path,),
        replace=options.replace,
    )
    results.require()
    with results.new_folder() as folder:
        answer = ask(
            "run", path=os.fsencode(path), folder=os.fsencode(folder), all=options.all,
            verbose=options.verbose, progress=not options.quiet,
        )  # fmt: skip
        print_notes(f"{path}: {value}" for value in notes(answer.get("warnings", {})))
        results.write_into(folder, _figures(answer, options))
    if not options.quiet:
        print_results(answer["table"].removesuffix("\n"))
        print_path("  Results", f"{results.folder}\n")
    return bool(answer["conforms"])


@command(
    "assess",
    "assess a case over what is not known of its source",
    files("case", "CASE.nml", "namelist file", "case"),
    *output("the verdict (default: outputs/<case name>_verdict)"),
    flag("--check", "exit with 3 unless the source conforms over what is not known of it "
         "(run --check: with the values of the case)"),
    QUIET,
)  # fmt: skip
def assess_case(options: argparse.Namespace) -> int:
    """Assess a case over what is not known of its source; return the exit code."""
    from thud.studies.calibrated_set import assess

    case = read_case(options.case)
    results = results_of(options, f"{case.name}_verdict", (options.case,), case.name)
    results.require()
    verdict = assess(case, progress=shows_progress(quiet=options.quiet))
    shown = "\n".join([format_rows(verdict.rows()), *(note.message for note in verdict.notes)])
    contents = {"verdict.csv": verdict.to_csv().encode()}
    return finish(options, results, contents, shown, verdict=verdict)


def _figures(answer: Bundle, options: argparse.Namespace) -> dict[str, bytes]:
    """Draw the figures of a run from its results in memory."""
    contents: dict[str, bytes] = {}
    if options.no_figures and not options.animation:
        return contents
    case = Case.from_text(answer["case"])
    impact = new_impact(case, answer) if "force" in answer else None
    modes = new_modes(case.ball, answer) if "modes" in answer else None
    curve = new_curve(case, answer) if "compression" in answer else None
    moving = {"motion": impact, "floor_motion": impact and impact.on_floor}
    with TemporaryDirectory() as folder, warn_if_not_drawn("a figure"):
        from thud import plot

        if not options.no_figures:
            count = None if options.all else plot.DEFAULT_COUNT
            contents = plot.figure_files(
                plot.case_figures(impact, modes, curve, count), options.format
            )
        for name, drop in moving.items():
            if options.animation and drop and drop.motion:
                path = Path(folder, f"{name}.gif")
                with warn_if_not_drawn(path.name):
                    plot.animate(drop, path)
                    contents[path.name] = path.read_bytes()
    return contents


@command(
    "compare",
    "compare models and recordings of the same drop on one page",
    files("cases", "CASE.nml|RECORD.csv", "namelist files, and recordings with columns of "
          "time, s, and force, N", "case", "recording", nargs="+"),
    *output("the page (default: outputs/comparison)"),
    argument("--force", choices=FORCES,
             help="force to compare (default: &levels force of each case)"),
    argument("--source", choices=SOURCES,
             help="source of the limits (default: &limits source of the cases)"),
    QUIET,
)  # fmt: skip
def compare_cases(options: argparse.Namespace) -> int:
    """Compare cases and recordings; return the exit code."""
    from thud.comparison import comparison

    results = results_of(options, "comparison", options.cases)
    results.require(f"comparison{ending}" for ending in (".svg", ".html"))
    items = comparison.read_all(options.cases)
    progress = shows_progress(quiet=options.quiet)
    page = comparison.compare(items, options.force, options.source, progress=progress)
    return finish(options, results, page.files(), format_rows(page.rows()), page.notes)


# Help of the options that choose formats.
KINDS = {
    "wav": "32-bit floats, with their scale in the comment",
    "csv": "table of time and force",
    "mat": "MATLAB file of time, force and spectrum",
    "spectrum": "table of the complex spectrum",
}


@command(
    "export",
    "write the blocked force of a case or a recording for other programs",
    files("source", "CASE.nml|RECORDING", "namelist file, or recording", "case", "recording"),
    *(flag(f"--{kind}", meaning) for kind, meaning in KINDS.items()),
    *output("the files (default: outputs/<name>_export)"),
    option("--drop", "N", "index of the drop in a recording (default: 1)", type=int, default=1),
    option("--config", "LAB.toml", "configuration of a recording", type=file_of("TOML file")),
    QUIET,
)
def run_export(options: argparse.Namespace) -> int:
    """Write the blocked force in the chosen formats; return the exit code."""
    from thud.export import force_files

    chosen = [kind for kind in KINDS if getattr(options, kind)]
    if not chosen:
        refuse("export: no format is chosen", ", ".join(f"--{kind}" for kind in KINDS))
    source = _read_source(options.source, options.config)
    force = force_files.blocked_force(source, drop=options.drop)
    formats = (force_files.EXPORTS[kind] for kind in chosen)
    contents = {f"{force.name}{ending}": make(force) for ending, make in formats}
    inputs = options.source, options.config
    warnings = (note for note in source.notes if note.is_warning)
    results = results_of(options, f"{force.name}_export", inputs, force.name)
    return finish(options, results, contents, "\n".join(contents), warnings)


def _read_source(path: str, config: str | None) -> ImpactResult:
    """Return the recording in a file, or the impact of the case in it."""
    from thud.recordings.recording import read_recording

    if kind_of(path) == "recording":
        return read_recording(path, config=config)
    if config is not None:
        refuse(f"{path}: --config {config} is for recordings only", "none for a case")
    return compute(read_case(path))


@command(
    "examples",
    "copy the inputs of the documentation: cases, studies, recordings, floors, constructions",
    argument("directory", nargs="?", default="inputs", metavar="DIR",
             help="new directory (default: inputs)"),
    QUIET,
)  # fmt: skip
def copy_examples(options: argparse.Namespace) -> int:
    """Copy the inputs into a directory of their own; return the exit code."""
    target = Path(options.directory)
    if target.exists() or target.is_symlink():
        refuse(f"{target} exists", "a new directory")
    target.parent.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory(dir=target.parent) as folder:
        try:
            # Installers compile Python scripts.
            ignored = shutil.ignore_patterns("__pycache__")
            shutil.copytree(inputs_folder(), Path(folder, "inputs"), ignore=ignored).rename(target)
        except shutil.Error as error:
            refuse(f"{target} cannot be written", "a writable directory with free space", error)
    if not options.quiet:
        print_path("Inputs", target)
    return 0
