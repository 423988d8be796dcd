"""Commands on floors and rooms: compare floors, listen, rate levels, fit a mobility."""

from __future__ import annotations

import re
from collections import Counter
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from thud.base._schema import JoistFloor
from thud.base.checks import refuse
from thud.base.files import is_one_of
from thud.base.tables import format_rows
from thud.case.case import read_case
from thud.cli.command import (
    NO_FIGURES,
    QUIET,
    argument,
    command,
    figures_of,
    files,
    finish,
    flag,
    kind_of,
    number,
    option,
    output,
    results_of,
)
from thud.cli.screen import print_notes, print_path, print_results, shows_progress

if TYPE_CHECKING:
    import argparse

    from thud.case.case import Case
    from thud.case.constructions import Construction
    from thud.floors.floor_comparison import FloorComparison


class Floors(NamedTuple):
    """The floors of a command: cases and constructions by name, and its input files."""

    cases: dict[str, Case]
    constructions: dict[str, Construction]
    inputs: list[str]

    def compare(self, options: argparse.Namespace) -> FloorComparison:
        """Return the predictions of all floors, with progress on a terminal."""
        from thud.floors.floor_comparison import compare_floors

        return compare_floors(self.cases, progress=shows_progress(quiet=options.quiet))


def _read_floors(options: argparse.Namespace) -> Floors:
    """Return the floors that are stated: cases, and constructions of the library or of files.

    Constructions have the source and the room of the first case. A name of an argument that is
    neither a case nor a file is that of a construction.
    """
    from thud.case.constructions import construction

    stated = [name for name in options.floors if kind_of(name) == "case" or Path(name).exists()]
    paths = [name for name in stated if kind_of(name) != "TOML file"]
    names = [name for name in options.floors if name not in paths] + options.construction
    floors = Floors({}, {}, paths + [name for name in names if kind_of(name) == "TOML file"])
    first: Case | None = None

    def add(name: str, origin: str, case: Case) -> None:
        if name in floors.cases:
            refuse(f"{origin}: {name!r} also names another floor", "different names")
        floors.cases[name] = case

    for path in paths:
        case = read_case(path)
        first = first or case
        # A room alone is that of the constructions.
        if case.floor or not names:
            add(case.name, path, case)
    for name in names:
        entry = construction(name)
        case = entry.case(first)
        add(entry.name, f"construction {name}", case)
        floors.constructions[entry.name] = entry
        if isinstance(case.floor, JoistFloor):
            print_notes([f"{entry.name}: joists span {case.floor.length:g} m"])
        if entry.note:
            print_notes([f"{entry.name}: {entry.note}"])
    if not floors.cases:
        refuse(
            "no floor is stated",
            "case files, or names of constructions, which `thud-driver floor --list` lists",
        )
    return floors


_FLOORS = (
    files("floors", "CASE.nml|NAME|FILE.toml", "namelist files with floor and room; constructions "
          "of the library or of a file, with ball, drop, model, room and sides of the first case "
          "(default: a ball that conforms)", "case", "TOML file", nargs="*"),
    option("--construction", "NAME|FILE.toml", "also this construction; may be repeated",
           action="append", default=[]),
)  # fmt: skip


@command(
    "floor",
    "compare floors and rooms of several cases and constructions on one page",
    *_FLOORS,
    option("--list", "WORDS", "only list the constructions of the library, all or those that "
           "contain the words", nargs="?", const=""),
    *output("the page (default: outputs/floors)"),
    QUIET,
)  # fmt: skip
def compare_floor_cases(options: argparse.Namespace) -> int:
    """Compare floors, print the table and save the page; return the exit code.

    With ``--list`` print the constructions of the library instead.
    """
    from thud.case.constructions import construction_rows, constructions

    if options.list is not None:
        print_results(format_rows(construction_rows(constructions(options.list).values())))
        return 0
    floors = _read_floors(options)
    results = results_of(options, "floors", floors.inputs)
    results.require(["floors.svg", "floors.html"])
    comparison = floors.compare(options)
    shown = format_rows(comparison.rows())
    return finish(options, results, comparison.files(), shown, comparison.notes)


@command(
    "predict",
    "level in the room below each floor, with its uncertainty, tables and a report",
    *_FLOORS,
    flag("--report", "also two pages for each floor (PDF, HTML), and what would change its "
         "rating"),
    option("--project", "TEXT", "project, on the first page of the report"),
    option("--client", "TEXT", "client, on the first page of the report"),
    *output("the results (default: outputs/prediction)"),
    QUIET,
)  # fmt: skip
def predict(options: argparse.Namespace) -> int:
    """Predict the levels below floors, print and save them; return the exit code."""
    from thud.report.floor_files import contents, file_names, screen_text
    from thud.report.predicted_floor import PredictedFloor

    stated = (("Project", options.project), ("Client", options.client))
    details = tuple((name, text.strip()) for name, text in stated if text and text.strip())
    if details and not options.report:
        refuse("project and client are part of a report", "--report with them")
    details += (("Date", datetime.now().astimezone().date().isoformat()),)
    floors = _read_floors(options)
    results = results_of(options, "prediction", floors.inputs)
    # Names of files, whatever a case is named.
    names = {name: re.sub(r"\W+", "_", case.name) for name, case in floors.cases.items()}
    for file, count in Counter(names.values()).items():
        if count > 1:
            refuse(f"{count} floors would have the file {file}.html", "different names")
    results.require(file_names(names.values(), report=options.report))
    comparison = floors.compare(options)
    predicted = [
        PredictedFloor(
            name.replace("_", " "), names[name], prediction, floors.constructions.get(name), details
        )
        for name, prediction in comparison.predictions.items()
    ]
    written = contents(predicted, results.folder, report=options.report)
    shown = "\n\n".join(map(screen_text, predicted))
    return finish(options, results, written, shown, comparison.notes)


@command(
    "listen",
    "sound of the impacts in the rooms below, as a calibrated WAV file",
    *_FLOORS,
    argument("-o", "--output", metavar="FILE.wav",
             help="the sound (default: outputs/listen/listen.wav)"),
    argument("--position", nargs=2, type=int, metavar=("BALL", "MICROPHONE"),
             help="numbers of positions, from 1 (default: levels nearest to the mean)"),
    option("--pause", "S", "time between the end of a sound and the next impact (default: 1 s)",
           type=number, default=1.0),
    option("--seed", "N", "seed of the noise (default: 0)", type=int, default=0),
    QUIET,
)  # fmt: skip
def listen_to_cases(options: argparse.Namespace) -> int:
    """Write the sounds below the floors of cases, print their levels; return the exit code."""
    from thud.export.room_sound import NOTE, listen

    path = Path(options.output or Path("outputs", "listen", "listen.wav"))
    if path.suffix.lower() != ".wav":
        refuse(f"--output {path} is not a sound file", "a name that ends with .wav")
    floors = _read_floors(options)
    if is_one_of(path, floors.inputs):
        refuse(f"{path} is an input, which is never replaced", "another file")
    chosen = {name: getattr(options, name) for name in ("position", "pause", "seed")}
    sound = listen(floors.compare(options).predictions, **chosen)
    print_notes(sound.notes)
    path.parent.mkdir(parents=True, exist_ok=True)
    sound.save(path)
    if not options.quiet:
        print_results(format_rows(sound.rows()))
        print_results(f"Full scale: {sound.full_scale:g} Pa\nThe sound is {NOTE}.")
        print_path("Sound", path)
    return 0


@command(
    "rate",
    "rating of levels measured in the room below",
    files("levels", "LEVELS.csv|LEVELS.xlsx", "frequency, levels at positions; optional: "
          "background, reverberation_time", "recording", "table of levels"),
    option("--volume", "M3", "volume of the room", type=number),
    *output("the results (default: outputs/<name of the file>)"),
    NO_FIGURES,
    QUIET,
)  # fmt: skip
def rate(options: argparse.Namespace) -> int:
    """Rate measured levels, print and save the result; return the exit code."""
    from thud.floors.survey import rating_table, read_room_levels

    room = read_room_levels(options.levels, volume=options.volume)
    shown = f"{format_rows(room.rows())}\n\n{format_rows(rating_table(room))}"
    if (scatter := room.position_uncertainty) is not None:
        shown += f"\n\n  Standard uncertainty from the scatter of the positions: {scatter:.1f} dB"
    contents = {"room_levels.csv": room.to_csv().encode()}
    contents |= figures_of(options, {"room_levels": room.plot})
    results = results_of(options, room.name, [options.levels])
    return finish(options, results, contents, shown, room.notes)


@command(
    "mobility",
    "fit poles to a measured mobility and save it as a floor for cases",
    files("table", "TABLE.csv|TABLE.uff", "columns frequency, real, imaginary (or magnitude, "
          "phase), or a universal file", "recording"),
    argument("--quantity", choices=("mobility", "accelerance", "receptance"),
             help="quantity of the table (default: mobility)"),
    option("--order", "N", "number of poles (default: automatic)", type=int),
    *output("the results (default: outputs/<name of the file>)"),
    NO_FIGURES,
    QUIET,
)  # fmt: skip
def fit_mobility_table(options: argparse.Namespace) -> int:
    """Fit a measured mobility, print the errors, save the floor; return the exit code."""
    from thud.floors.mobility_fit import fit_mobility
    from thud.floors.mobility_table import read_mobility

    measured = read_mobility(options.table, options.quantity)
    result = fit_mobility(measured, order=options.order)
    contents = {"measured_mobility.nml": result.namelist().encode()}
    contents |= figures_of(options, {"mobility_fit": result.plot})
    results = results_of(options, result.name, [options.table])
    shown = f"{repr(result)[1:-1]}\n{format_rows(result.rows())}"
    return finish(options, results, contents, shown, result.notes)
