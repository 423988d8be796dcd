"""Commands on floors and rooms: compare floors, listen, rate levels, fit a mobility."""

from __future__ import annotations

import re
import warnings
from collections import Counter
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

from thud.base._schema import JoistFloor
from thud.base.checks import refuse
from thud.base.errors import PlausibilityWarning
from thud.base.files import is_one_of, replace_file
from thud.base.tables import format_rows
from thud.case.case import read_case
from thud.cli.command import (
    NO_FIGURES,
    PAGE,
    QUIET,
    Command,
    argument,
    file_of,
    number,
    output,
    results_of,
    save_result,
)
from thud.cli.screen import print_notes, print_path, print_results, shows_progress

if TYPE_CHECKING:
    import argparse
    from collections.abc import Iterable, Sequence

    from thud.case.case import Case
    from thud.case.constructions import Construction
    from thud.floors.floor_comparison import FloorComparison


def compare_floor_cases(options: argparse.Namespace) -> int:
    """Compare floors, print the table and save the page; return the exit code.

    With ``--list`` print the constructions of the library instead.
    """
    from thud.case.constructions import construction_rows, constructions

    if options.list is not None:
        print_results(format_rows(construction_rows(constructions(options.list).values())))
        return 0
    files = [name for name in options.construction if name.endswith(".toml")]
    results = results_of(options, "floors", [*options.cases, *files])
    results.require(f"floors{ending}" for ending in PAGE)
    cases, _ = _floor_cases(options.cases, options.construction)
    comparison = _compare(cases, options)
    print_notes(comparison.warnings)
    paths = results.write(comparison.files())
    if not options.quiet:
        print_results(format_rows(comparison.rows()))
        print_path("Page", paths[-1])
    return 0


def _compare(cases: dict[str, Case], options: argparse.Namespace) -> FloorComparison:
    """Return the predictions of cases, with progress on a terminal."""
    from thud.floors.floor_comparison import compare_floors

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", PlausibilityWarning)
        return compare_floors(cases, progress=shows_progress(quiet=options.quiet))


def predict(options: argparse.Namespace) -> int:
    """Predict the levels below floors, print and save them; return the exit code."""
    from thud.report.floor_files import contents, file_names, screen_text
    from thud.report.predicted_floor import PredictedFloor

    stated = (("Project", options.project), ("Client", options.client))
    details = tuple((name, text.strip()) for name, text in stated if text and text.strip())
    if details and not options.report:
        refuse("project and client are part of a report", "--report with them")
    details += (("Date", datetime.now().astimezone().date().isoformat()),)
    files = [name for name in options.construction if name.endswith(".toml")]
    results = results_of(options, "prediction", [*options.cases, *files])
    cases, chosen = _floor_cases(options.cases, options.construction)
    # Names of files, whatever a case is named.
    names = {name: re.sub(r"\W+", "_", case.name) for name, case in cases.items()}
    for file, count in Counter(names.values()).items():
        if count > 1:
            refuse(f"{count} floors would have the file {file}.html", "different names")
    results.require(file_names(names.values(), report=options.report))
    comparison = _compare(cases, options)
    floors = [
        PredictedFloor(name.replace("_", " "), names[name], prediction, chosen.get(name), details)
        for name, prediction in comparison.predictions.items()
    ]
    written = contents(floors, results.folder, report=options.report)
    results.write(written)
    if not options.quiet:
        print_results("\n\n".join(map(screen_text, floors)))
    print_notes(comparison.warnings)
    if not options.quiet:
        print_path("Results", results.folder)
    return 0


def _floor_cases(
    paths: Iterable[str], names: Sequence[str]
) -> tuple[dict[str, Case], dict[str, Construction]]:
    """Return the cases of files, and of constructions with the source and room of the first.

    Both are by their names; the constructions themselves are returned, too.
    """
    from thud.case.constructions import construction

    cases: dict[str, Case] = {}
    chosen: dict[str, Construction] = {}
    first: Case | None = None

    def add(name: str, origin: str, case: Case) -> None:
        if name in cases:
            refuse(f"{origin}: {name!r} also names another floor", "different names")
        cases[name] = case

    for path in paths:
        if not Path(path).exists():
            refuse(
                f"{path}: there is no such file",
                "the path of a case; of a construction --construction NAME, see "
                "`thud-driver floor --list`",
            )
        case = read_case(path)
        first = first or case
        # A room alone is that of the constructions.
        if case.floor or not names:
            add(case.name, path, case)
    for name in names:
        entry = construction(name)
        case = entry.case(first)
        add(entry.name, f"--construction {name}", case)
        chosen[entry.name] = entry
        if isinstance(case.floor, JoistFloor):
            print_notes([f"{entry.name}: joists span {case.floor.length:g} m"])
        if entry.note:
            print_notes([f"{entry.name}: {entry.note}"])
    if not cases:
        refuse(
            "no floor is stated",
            "case files, or --construction NAME; `thud-driver floor --list` lists the names",
        )
    return cases, chosen


_FLOORS = (
    argument(
        "cases",
        nargs="*",
        type=file_of("case"),
        metavar="CASE.nml",
        help="namelist files with floor and room",
    ),
    argument(
        "--construction",
        action="append",
        default=[],
        metavar="NAME|FILE.toml",
        help="also a construction of the library or of a file, with ball, drop, model, room and "
        "sides of the first case (default: a ball that conforms); may be repeated",
    ),
)
FLOOR = Command(
    "compare floors and rooms of several cases and constructions on one page",
    (
        *_FLOORS,
        argument(
            "--list",
            nargs="?",
            const="",
            metavar="WORDS",
            help="only list the constructions of the library, all or those that contain the words",
        ),
        *output("the page (default: outputs/floors)"),
        QUIET,
    ),
    compare_floor_cases,
    "nothing is written",
)


def listen_to_cases(options: argparse.Namespace) -> int:
    """Write the sounds below the floors of cases, print their levels; return the exit code."""
    from thud.export.room_sound import NOTE, listen

    path = Path(options.output or Path("outputs", "listen", "listen.wav"))
    if path.suffix.lower() != ".wav":
        refuse(f"--output {path} is not a sound file", "a name that ends with .wav")
    files = [name for name in options.construction if name.endswith(".toml")]
    inputs = (*options.cases, *files)
    if is_one_of(path, inputs):
        refuse(f"{path} is an input, which is never replaced", "another file")
    cases, _ = _floor_cases(options.cases, options.construction)
    sound = listen(
        _compare(cases, options).predictions,
        position=options.position,
        pause=options.pause,
        repeat=options.repeat,
        seed=options.seed,
    )
    print_notes(sound.warnings)
    path.parent.mkdir(parents=True, exist_ok=True)
    replace_file(path, sound.wav())
    if not options.quiet:
        print_results(format_rows(sound.rows()))
        print_results(f"Full scale: {sound.full_scale:g} Pa\nThe sound is {NOTE}.")
        print_path("Sound", path)
    return 0


LISTEN = Command(
    "sound of the impacts in the rooms below, as a calibrated WAV file",
    (
        *_FLOORS,
        argument(
            "-o",
            "--output",
            metavar="FILE.wav",
            help="the sound (default: outputs/listen/listen.wav)",
        ),
        argument(
            "--position",
            nargs=2,
            type=int,
            metavar=("BALL", "MICROPHONE"),
            help="numbers of positions, from 1 (default: levels nearest to the mean)",
        ),
        argument(
            "--pause",
            type=number,
            default=1.0,
            metavar="S",
            help="time between the end of a sound and the next impact (default: 1 s)",
        ),
        argument(
            "--repeat",
            type=int,
            default=1,
            metavar="N",
            help="repetitions of all floors in their order (default: 1)",
        ),
        argument("--seed", type=int, default=0, metavar="N", help="seed of the noise (default: 0)"),
        QUIET,
    ),
    listen_to_cases,
)

PREDICT = Command(
    "level in the room below each floor, with its uncertainty, tables and a report",
    (
        *_FLOORS,
        argument(
            "--report",
            action="store_true",
            help="also two pages for each floor (PDF, HTML), and what would change its rating",
        ),
        argument("--project", metavar="TEXT", help="project, on the first page of the report"),
        argument("--client", metavar="TEXT", help="client, on the first page of the report"),
        *output("the results (default: outputs/prediction)"),
        QUIET,
    ),
    predict,
    "nothing is written",
)


def rate(options: argparse.Namespace) -> int:
    """Rate measured levels, print and save the result; return the exit code."""
    from thud.floors.survey import rating_table, read_room_levels

    room = read_room_levels(options.levels, volume=options.volume)
    shown = f"{format_rows(room.rows())}\n\n{format_rows(rating_table(room))}"
    if (scatter := room.position_uncertainty) is not None:
        shown += f"\n\n  Standard uncertainty from the scatter of the positions: {scatter:.1f} dB"
    file = "room_levels.csv", room.to_csv().encode()
    return save_result(options, options.levels, room, shown, file, "room_levels")


RATE = Command(
    "rating of levels measured in the room below",
    (
        argument(
            "levels",
            metavar="LEVELS.csv|LEVELS.xlsx",
            help="frequency, levels at positions; optional: background, reverberation_time",
        ),
        argument("--volume", type=float, metavar="M3", help="volume of the room"),
        *output("the results (default: outputs/<name of the file>)"),
        NO_FIGURES,
        QUIET,
    ),
    rate,
)


def fit_mobility_table(options: argparse.Namespace) -> int:
    """Fit a measured mobility, print the errors, save the floor; return the exit code."""
    from thud.floors.mobility_fit import fit_mobility

    result = fit_mobility(options.table, quantity=options.quantity, order=options.order)
    shown = f"{repr(result)[1:-1]}\n{format_rows(result.rows())}"
    file = "measured_mobility.nml", result.namelist().encode()
    return save_result(options, options.table, result, shown, file, "mobility_fit")


MOBILITY = Command(
    "fit poles to a measured mobility and save it as a floor for cases",
    (
        argument(
            "table",
            metavar="TABLE.csv|TABLE.uff",
            help="columns frequency, real, imaginary (or magnitude, phase), or a universal file",
        ),
        argument(
            "--quantity",
            choices=("mobility", "accelerance", "receptance"),
            help="quantity of the table (default: mobility)",
        ),
        argument("--order", type=int, metavar="N", help="number of poles (default: automatic)"),
        *output("the results (default: outputs/<name of the file>)"),
        NO_FIGURES,
        QUIET,
    ),
    fit_mobility_table,
)
