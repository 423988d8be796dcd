"""Commands on cases: run, compare, export and inputs of the documentation."""

from __future__ import annotations

import os
import shutil
import warnings
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

from tqdm import tqdm

from thud.base._schema import VERDICTS
from thud.base.bridge import ask, notes
from thud.base.checks import refuse
from thud.base.display import warn_if_not_drawn
from thud.base.errors import InputError, PlausibilityWarning, ThudError
from thud.base.files import Results, inputs_folder
from thud.base.tables import format_rows
from thud.case.case import Case, read_case
from thud.cli.command import (
    NOT_CONFORMING,
    PAGE,
    QUIET,
    Command,
    argument,
    exit_code,
    file_of,
    message_of,
    output,
    results_of,
)
from thud.cli.screen import print_error, print_notes, print_path, print_results, shows_progress
from thud.impact.compression import new_curve
from thud.impact.compute import compute, new_impact
from thud.impact.free_modes import new_modes

if TYPE_CHECKING:
    import argparse

    from thud.base.bridge import Bundle
    from thud.recordings.recording import ImpactResult


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
        message = (
            f"{path}: {case.name!r} is also the name of {options.done[key]}, "
            "whose results would be replaced; allowed: different names, or separate runs"
        )
        raise InputError(message)
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


def assess_case(options: argparse.Namespace) -> int:
    """Assess a case over what is not known of its source; return the exit code."""
    from thud.studies.calibrated_set import assess

    case = read_case(options.case)
    results = results_of(options, f"{case.name}_verdict", (options.case,), case.name)
    results.require()
    verdict = assess(case, progress=shows_progress(quiet=options.quiet))
    results.write({"verdict.csv": verdict.to_csv().encode()})
    if not options.quiet:
        print_results("\n".join([format_rows(verdict.rows()), *verdict.notes]))
        print_path("Results", results.folder)
    return NOT_CONFORMING if options.check and verdict.conforms != VERDICTS[0] else 0


ASSESS = Command(
    "assess a case over what is not known of its source",
    (
        argument("case", type=file_of("case"), metavar="CASE.nml", help="namelist file"),
        *output("the verdict (default: outputs/<case name>_verdict)"),
        argument(
            "--check",
            action="store_true",
            help="exit with 3 unless the source conforms over what is not known of it "
            "(run --check: with the values of the case)",
        ),
        QUIET,
    ),
    assess_case,
)


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


def compare_cases(options: argparse.Namespace) -> int:
    """Compare cases and recordings; return the exit code."""
    from thud.comparison import comparison

    results = results_of(options, "comparison", options.cases)
    results.require(f"comparison{ending}" for ending in PAGE)
    items = comparison.read_all(options.cases)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", PlausibilityWarning)
        page = comparison.compare(
            items,
            options.force,
            options.source,
            progress=shows_progress(quiet=options.quiet),
        )
    print_notes(page.warnings)
    paths = results.write(page.files())
    if not options.quiet:
        print_results(format_rows(page.rows()))
        print_path("Page", paths[-1])
    return 0


# Help of the options that choose formats.
KINDS = {
    "wav": "32-bit floats, with their scale in the comment",
    "csv": "table of time and force",
    "uff": "universal file, data set 58",
    "mat": "MATLAB file of time, force and spectrum",
    "spectrum": "table of the complex spectrum",
}


def run_export(options: argparse.Namespace) -> int:
    """Write the blocked force in the chosen formats; return the exit code."""
    from thud.export import force_files

    chosen = [kind for kind in KINDS if getattr(options, kind)]
    if not chosen:
        refuse("export: no format is chosen", ", ".join(f"--{kind}" for kind in KINDS))
    source = _read_source(options.source, options.config)
    print_notes(source.warnings)
    force = force_files.blocked_force(source, drop=options.drop, rate=options.rate)
    formats = (force_files.EXPORTS[kind] for kind in chosen)
    contents = {f"{force.name}{ending}": make(force) for ending, make in formats}
    inputs = options.source, options.config
    results = results_of(options, f"{force.name}_export", inputs, force.name)
    paths = results.write(contents)
    if not options.quiet:
        print(*paths, sep="\n")
    return 0


def _read_source(path: str, config: str | None) -> ImpactResult:
    """Return the recording in a file, or the impact of the case in it."""
    from thud.recordings.formats import FORMATS
    from thud.recordings.read_recording import read_recording

    endings = {ending for file_format in FORMATS for ending in file_format.suffixes}
    if os.path.splitext(path)[1].lower() in endings:  # noqa: PTH122 - may hold a zero byte
        return read_recording(path, config=config)
    if config is not None:
        refuse(f"{path}: --config {config} is for recordings only", "none for a case")
    return compute(read_case(path))


EXPORT = Command(
    "write the blocked force of a case or a recording for other programs",
    (
        argument(
            "source",
            type=file_of("case", "recording"),
            metavar="CASE.nml|RECORDING",
            help="namelist file, or recording",
        ),
        *(
            argument(f"--{kind}", action="store_true", help=meaning)
            for kind, meaning in KINDS.items()
        ),
        *output("the files (default: outputs/<name>_export)"),
        argument("--rate", type=float, metavar="HZ", help="resample to this rate"),
        argument(
            "--drop", type=int, default=1, help="index of the drop in a recording (default: 1)"
        ),
        argument("--config", metavar="LAB.toml", help="configuration of a recording"),
        QUIET,
    ),
    run_export,
)


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


EXAMPLES = Command(
    "copy the inputs of the documentation: cases, studies, recordings, floors, constructions",
    (
        argument(
            "directory",
            nargs="?",
            default="inputs",
            metavar="DIR",
            help="new directory (default: inputs)",
        ),
        QUIET,
    ),
    copy_examples,
    "copied files are kept",
)
