"""Commands on recordings: measure, calibrate, and the history of a ball."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from thud.base.checks import refuse
from thud.base.tables import format_rows
from thud.cli.command import (
    NO_FIGURES,
    QUIET,
    argument,
    command,
    figures_of,
    file_of,
    files,
    finish,
    flag,
    number,
    option,
    output,
    results_of,
)
from thud.cli.screen import print_notes, print_results, shows_progress
from thud.recordings.config import Config, read_config

if TYPE_CHECKING:
    import argparse

    from thud.cli.command import Argument

# Maximum number of drops that are printed.
MAX_PRINTED = 50


# Keys of the configuration that are options of `measure`, and the words for their values.
OF_THE_CONFIGURATION = {
    "source": "", "mass": "KG", "height": "M", "mass_uncertainty": "KG", "height_uncertainty": "M",
    "channel": "NAME|NUMBER", "channels": "sum|F1+F2", "unit": "UNIT", "calibration": "N/UNIT",
    "calibration_uncertainty": "FRACTION", "polarity": "", "sample_rate": "HZ", "drops": "NUMBERS",
    "begin": "S", "end": "S",
}  # fmt: skip
FLAGS = {"begin": "--from", "end": "--to"}


def _option(name: str) -> Argument:
    """Return the option of a key of the configuration."""
    entry = Config.__dataclass_fields__[name].metadata
    help_text = ", ".join(filter(None, (entry["title"], entry["hint"])))
    # Of the check of a number or a choice.
    limits = getattr(entry["check"], "keywords", {})
    settings: dict[str, Any] = {"dest": name, "help": help_text}
    if "allowed" in limits:
        settings["choices"] = tuple(limits["allowed"])
    else:
        settings["metavar"] = OF_THE_CONFIGURATION[name]
    if "low" in limits:
        settings["type"] = number
    if name == "calibration":
        settings["action"] = "append"
    return argument(FLAGS.get(name, f"--{name.replace('_', '-')}"), **settings)


@command(
    "measure",
    "levels, verdict and calibration report of recorded drops",
    files("recordings", "FILE", "recordings of one or more drops each", "recording", nargs="+"),
    option("--config", "LAB.toml", "file on laboratory, instruments, calibration",
           type=file_of("TOML file")),
    *map(_option, OF_THE_CONFIGURATION),
    option("--leave-out", "NUMBERS", "drops to be left out", action="append"),
    option("--because", "TEXT", "why drops are left out", action="append"),
    *output("the results (default: outputs/<name of the first file>)"),
    flag("--check", "exit with 3 unless the source conforms"),
    flag("--stages", "draw the first drop after each stage of its measurement (stages.svg)"),
    NO_FIGURES,
    QUIET,
)  # fmt: skip
def measure(options: argparse.Namespace) -> int:
    """Measure recordings, print the verdict and save results; return the exit code."""
    from thud.recordings.recording import read_recording
    from thud.report import recording_files
    from thud.report.contents import missing_keys, report_data
    from thud.report.rows import drop_table, excluded_text

    figures = not options.no_figures
    inputs = [*options.recordings, options.config]
    results = results_of(options, Path(options.recordings[0]).stem, inputs)
    results.require(recording_files.file_names(figures=figures, stages=options.stages))
    config = read_config(options.config) if options.config else Config()
    config = config.updated(
        leave_out=_left_out(options) or None,
        **{name: getattr(options, name) for name in OF_THE_CONFIGURATION},
    )
    progress = shows_progress(quiet=options.quiet)
    recording = read_recording(options.recordings, config=config, progress=progress)
    data = report_data(recording)
    stages = recording.stages if options.stages else None
    recording_files.save(data, results, figures=figures, stages=stages)
    rows = drop_table(recording)
    parts = [format_rows(rows[: MAX_PRINTED + 1])]
    if len(rows) > MAX_PRINTED + 1:
        path = results.folder / "report.json"
        parts.append(f"and {len(rows) - MAX_PRINTED - 1} more drops: {path}")
    parts += ["", format_rows(recording_files.table(data.criteria)), ""]
    lines = [*data.left_out, *data.processing, recording_files.verdict_text(data)]
    lines.append(excluded_text(data.criteria))
    if figures:
        missing = ", ".join(missing_keys(recording.config, recording.origins)) or "nothing"
        lines.append(f"Missing in the report (ISO/IEC 17025:2017, 7.8): {missing}")
    shown = "\n".join([*parts, *(f"  {line}" for line in lines if line)])
    return finish(options, results, {}, shown, data.warnings, data.verdict)


def _left_out(options: argparse.Namespace) -> dict[str, str]:
    """Return the numbers of the drops to be left out, with their reasons."""
    numbers, reasons = options.leave_out or [], options.because or []
    if len(reasons) == 1:
        reasons *= len(numbers)
    if reasons and not numbers:
        refuse("--because is stated without --leave-out", "--leave-out 3")
    if len(reasons) != len(numbers):
        refuse("--leave-out: a drop is left out without a reason", '--because "touched"')
    return dict(zip(numbers, reasons, strict=True))


# Options of `calibrate` for a known force.
OF_A_FORCE = ("mass", "force", "gravity", "uncertainty", "unit")


@command(
    "calibrate",
    "calibration from a record of a known force applied to or removed from the plate, or of taps",
    files("record", "FILE", "record of the known force or of the taps", "recording"),
    flag("--tap", "the record holds taps with a hammer: print the resonance of the plate"),
    option("--mass", "KG", "mass that exerts the known force", type=number),
    option("--force", "N", "known force, if no mass is given", type=number),
    option("--gravity", "M/S2", "local gravity for --mass, such as 9.798 (default: 9.80665, "
           "with an uncertainty)", type=number),
    option("--uncertainty", "FRACTION", "relative standard uncertainty of the mass or force, "
           "such as 0.001", type=number),
    option("--channel", "NAME|NUMBER", "channel of the force"),
    option("--unit", "UNIT", "unit of the recorded values, if the file does not state it"),
    QUIET,
)  # fmt: skip
def run_calibrate(options: argparse.Namespace) -> int:
    """Print the configuration lines of a calibration record; return the exit code."""
    from thud.recordings.calibration import calibrate
    from thud.recordings.plate_tap import calibrate_tap

    if options.tap:
        for name in OF_A_FORCE:
            if getattr(options, name) is not None:
                refuse(f"calibrate: --{name.replace('_', '-')} with --tap", "a known force or taps")
        plate = calibrate_tap(options.record, channel=options.channel)
        lines, origin, notes = plate.lines(), str(plate), plate.notes
    else:
        chosen = {name: getattr(options, name) for name in (*OF_A_FORCE, "channel")}
        chosen["uncertainty"] = options.uncertainty or 0.0
        result = calibrate(options.record, **chosen)
        uncertainty = f"calibration_uncertainty = {result.uncertainty:.2g}"
        lines = f'calibration = "{result.chain}"\n{uncertainty}'
        origin, notes = result.origin, result.notes
    print(lines)
    if not options.quiet:
        for text in (origin, *(note for note in notes if not note.is_warning)):
            print_results(f"# {text}")
    print_notes([note for note in notes if note.is_warning])
    return 0


@command(
    "history",
    "control chart of a ball from its calibration reports",
    files("reports", "REPORT", "report.json files, or directories with such files",
          "calibration report", "directory", nargs="+"),
    *output("the chart (default: outputs/history)"),
    QUIET,
)  # fmt: skip
def run_history(options: argparse.Namespace) -> int:
    """Draw the control chart of the reports of a ball; return the exit code."""
    # Matplotlib and SciPy are slow to import.
    from thud.report.ball_history import read_history
    from thud.report.ball_history_figure import draw_history

    history = read_history(options.reports)
    results = results_of(options, "history", options.reports)
    contents = figures_of(options, {"history": partial(draw_history, history)})
    parts = [history.title, format_rows(history.table()), *history.warnings()]
    return finish(options, results, contents, "\n".join(parts))
