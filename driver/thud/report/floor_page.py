"""The page of a predicted floor: two sheets of A4, in one HTML file with its figures."""

from __future__ import annotations

from string import Template
from typing import TYPE_CHECKING

import numpy as np

from thud.base.bridge import version
from thud.case.keys import humanize
from thud.floors.prediction import rating_title, source_note
from thud.floors.resonances import floor_frequencies, resonances, room_frequencies
from thud.level.rating import class_text
from thud.report.fonts import FAMILY
from thud.report.markup import css_string, escaped, inline_svg, labeled, notes, pair_rows, symbols
from thud.report.predicted_floor import (
    CAVEAT,
    band_rows,
    difference_text,
    number_text,
    octave_titles,
    remedy,
    verdict_text,
)
from thud.report.template import PAGE

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from thud.floors.prediction import RoomPrediction
    from thud.report.predicted_floor import PredictedFloor

BODY = Template("""<header>
<div class="verdict"><b>$rating</b><br>$box</div>
<h1>Predicted impact sound</h1>
<p>$name</p>
<p class="details">$details</p>
</header>
<table class="columns"><tr>
<td><h2>Construction, to scale</h2>$section</td>
<td><h2>Room and source</h2><table class="pairs">$about</table></td>
</tr></table>
<h2>Ratings</h2>
$ratings
<h2>Assumptions and their sources</h2>
$assumptions
<p class="rule">$assumed</p>
<div class="levels">
<h2>Maximum Fast levels in the room below, one-third octaves</h2>
<table class="columns"><tr>
<td>$figure</td>
<td><h2>What makes the rating uncertain</h2>
$contributions
<p class="rule">$about_contributions</p>
<h2>What would change it</h2>
$changes
<p class="rule">Changes of the rating, each predicted again, all else unchanged.</p></td>
</tr></table>
$bands
<p class="rule">$columns</p>
$octaves
</div>
<h2>Lowest natural frequencies, Hz</h2>
$modes
<p class="rule">$resonances</p>
<h2>How certain the computation is</h2>
<p class="rule">$computation</p>
<h2>How certain the model is</h2>
<p class="rule">$model</p>
$warnings
<footer>$footer</footer>
""")

# Widths of the columns of bands in print, mm: as their titles need them.
WIDTHS = (8.5, 14, 19, 16, 12, 10, 14, 22, 19, 17, 22)
STYLE = """
.verdict b { text-transform: none; }
.whole { white-space: nowrap; }
.details { font-size: 1em; }
/* With the figure, more than half a page: it begins the second one. */
.levels { break-inside: avoid; }
.figure { height: auto; }
.named td:last-child, .named th:last-child { text-align: left; white-space: normal;
  padding-left: 1.2em; overflow-wrap: anywhere; }
.named td { vertical-align: top; }
.texts td, .texts th { text-align: left; white-space: normal; }
.bands thead th { white-space: normal; overflow-wrap: normal; vertical-align: bottom; }
.cards { margin-top: 0.2em; }
.columns h2:first-child { margin-top: 0; }
@media print {
  .figure { height: auto; }
  .cards th, .cards td { padding-top: 0.25mm; padding-bottom: 0.25mm; }
  .narrow td:last-child, .narrow th:last-child { width: 22mm; }
  .values th:first-child { width: 64mm; }
  .values th:nth-child(2) { width: 28mm; }
  .narrow td:nth-last-child(2):not(:first-child), .narrow th:nth-last-child(2):not(:first-child) {
    width: 22mm; }
  .octaves th:first-child, .modes th:first-child { width: 64mm; }
"""
STYLE += "".join(
    f"  .bands th:nth-child({i}) {{ width: {width}mm; }}\n" for i, width in enumerate(WIDTHS, 1)
)
STYLE += """  .bands td, .bands th { padding-left: 0.5mm; }
}
@media print, (min-width: 60.01em) {
  .verdict { width: 52%; }
  .values td:nth-child(2) { min-width: 8em; }
}
@media screen and (max-width: 60em) {
  .named tr { grid-template-columns: 7em 1fr; }
  .narrow tr { grid-template-columns: 1fr auto; }
  .narrow td:first-child { grid-column: auto; font-weight: normal; }
  .cards.narrow td:last-child::before { display: none; }
}
"""
ABOUT_COLUMNS = (
    "The force level is the force exposure level of the force on the floor; the energy is what "
    "this force transfers to the bearing floor, below a floating plate if there is one."
)
ABOUT_CROSSOVER = (
    " Up to {last} Hz the level is that of the modes of floor and room, above, where modes of the "
    "room overlap, it is statistical."
)
ABOUT_EDGES = (
    " The support of the floor is not known: the level is the energy mean of those with simply "
    "supported and with clamped edges."
)
ABOUT_CONTRIBUTIONS = (
    "Standard uncertainties; their root sum of squares is that of the rating. The largest becomes "
    "smaller by {remedy}."
)
ABOUT_MODEL = (
    "The levels are those of rigid boxes, with no measurement behind them: no measured floor has "
    "been compared with these predictions. The uncertainty excludes mistakes in the assumed values "
    "above, workmanship, paths that are not described, and furniture."
)


def floor_page(floor: PredictedFloor, section: str, figure: str) -> str:
    """Return the page as self-contained HTML, with the section and the levels as SVG."""
    prediction = floor.prediction
    body = BODY.substitute(
        rating=escaped(str(prediction.rating)),
        box="<br>".join(map(symbols, _box(floor))),
        name=escaped(floor.name),
        details="<br>".join(escaped(f"{name}: {text}") for name, text in floor.details),
        section=_figure(section, "s"),
        about=pair_rows(_about(floor)),
        ratings=_table(
            [
                ("Rating", "Value"),
                *((title, text) for title, _, _, text in floor.ratings),
            ],
            "named values texts",
        ),
        assumptions=_table(floor.assumptions, "named values texts"),
        assumed=_assumed(floor),
        figure=_figure(figure, "l"),
        contributions=_table(
            [
                ("Contribution", "dB"),
                *((name, f"{value:.1f}") for name, value in floor.contributions.items()),
            ],
            "narrow",
        ),
        about_contributions=escaped(ABOUT_CONTRIBUTIONS.format(remedy=remedy(prediction))),
        changes=_table(
            [
                ("Change", "dB"),
                *((change.text, difference_text(change)) for change in floor.changes),
            ],
            "narrow",
        ),
        bands=_table(band_rows(floor), "bands scroll"),
        columns=escaped(_about_columns(floor)),
        octaves=_table(
            [
                ("Maximum Fast levels, octaves", *octave_titles()),
                ("", *(number_text(level, ".1f") for level in prediction.octave_level)),
            ],
            "octaves",
        ),
        modes=_table(_mode_rows(prediction), "modes"),
        resonances=escaped(_about_resonances(prediction)),
        computation=escaped(_about_computation(floor)),
        model=escaped(ABOUT_MODEL),
        warnings=notes("Warnings", prediction.warnings or ["none"]),
        footer=escaped(f"thud {version()} · predicted, not measured · end of report"),
    )
    return PAGE.substitute(
        title=escaped(f"Predicted impact sound: {floor.name}"),
        family=FAMILY,
        identity=css_string(f"Predicted impact sound: {floor.name}"),
        style=STYLE,
        body=body,
    )


def page_texts(floor: PredictedFloor) -> str:
    """Return the texts of a page that users have stated, in any script."""
    texts = [floor.name, *(layer.description for layer in floor.layers)]
    texts += [text for row in [*floor.details, *floor.assumptions] for text in row]
    return "".join(texts + ([floor.construction.note] if floor.construction else []))


def _box(floor: PredictedFloor) -> list[str]:
    """Return the lines below the rating."""
    prediction = floor.prediction
    name = prediction.room.rating
    lines = [
        verdict_text(prediction),
        f"{rating_title(prediction, name)} in the room below, 50 to 630 Hz",
        class_text(prediction.korean_class) * (name == "octaves"),
        source_note(prediction).capitalize(),
        CAVEAT.capitalize(),
    ]
    return [*filter(None, lines)]


def _mode_rows(prediction: RoomPrediction) -> list[tuple[str, ...]]:
    """Return the lowest natural frequencies of floor and room, Hz."""
    floor, room = floor_frequencies(prediction), room_frequencies(prediction)
    numbers = range(1, max(len(floor), len(room)) + 1)
    rows = {
        "Floor": [f"{frequency:.1f}" for frequency in floor],
        "Room": [f"{frequency:.1f}" for frequency in room.values()],
        "Half wavelengths along length, width, height": [
            ", ".join(map(str, order)) for order in room
        ],
    }
    padded = (
        (title, *cells, *["–"] * (len(numbers) - len(cells))) for title, cells in rows.items()
    )
    return [("", *map(str, numbers)), *padded]


def _about_resonances(prediction: RoomPrediction) -> str:
    """Return the resonances of the plates of a floor, and how they are computed."""
    values = (f"{name} {number_text(f)} Hz" for name, f in resonances(prediction).items())
    text = "The floor is simply supported unless its support is stated; the room has rigid walls."
    if resonant := "; ".join(values):
        text += f" Resonances of both masses on the stiffness between them: {resonant}."
    return text


def _about(floor: PredictedFloor) -> list[tuple[str, str]]:
    """Return room and source."""
    prediction = floor.prediction
    sides = " × ".join(f"{side:.3g}" for side in prediction.size)  # noqa: RUF001
    times = np.unique(np.round(prediction.reverberation_time, 2))
    time = " to ".join(f"{value:g}" for value in dict.fromkeys((times[0], times[-1])))
    source, room = prediction.source, prediction.room
    case = source.case
    kind = humanize(source.limits_source or "source that is not stated")
    # A recording has no case of its own, only the velocity.
    drop = f" dropped from {case.drop.height:.3g} m" if case.model else ""
    limits = f"limits of the {kind}"
    model = humanize(case.model.name) if case.model else "recording or measured modes"
    forces = {
        "contact": "on the mobile floor",
        "blocked": "on a rigid floor",
    }
    conforms = not prediction.source_notes
    pairs = [
        ("Room", f"{sides} m, {number_text(prediction.volume)} m³"),
        ("Reverberation", f"T = {time} s, of the {humanize(room.reverberation_of)} room"),
        (
            "Flanking walls",
            f"A-weighted energy: {floor.path_shares}" if room.wall_lengths else "none described",
        ),
        ("Ceiling", _ceiling(prediction)),
        ("Source", f"{source.mass:.3g} kg{drop}, {source.impact_velocity:.3g} m/s; {limits}"),
        (
            "Source levels",
            "conform to the standards" if conforms else "do not conform: see warnings",
        ),
        ("Source model", f"{model}; force {forces[prediction.force]}"),
    ]
    if floor.construction and floor.construction.note:
        pairs.append(("Note", floor.construction.note))
    return pairs


def _ceiling(prediction: RoomPrediction) -> str:
    """Return the mass of the ceiling of floor or room."""
    floor, room = prediction.floor, prediction.room
    hung = getattr(floor, "subceiling_thickness", 0.0) * getattr(floor, "subceiling_density", 0.0)
    mass = hung or room.ceiling_mass
    return f"{mass:g} kg/m²" if mass else "none described"


def _assumed(floor: PredictedFloor) -> str:
    """Return the values that are not listed, as HTML."""
    drawn = " Thicknesses marked as assumed are for the drawing only." * (
        floor.construction is None
    )
    # A value is not separated from its unit.
    values = (f'<span class="whole">{escaped(text)}</span>' for text in floor.defaults)
    return f"Default values – {'; '.join(values)}.{drawn}"


def _about_columns(floor: PredictedFloor) -> str:
    """Return what the columns of bands mean."""
    prediction = floor.prediction
    text = ABOUT_COLUMNS
    if prediction.n_modal:
        text += ABOUT_CROSSOVER.format(last=f"{prediction.frequency[prediction.n_modal - 1]:g}")
    return text + ABOUT_EDGES * prediction.has_edges


def _about_computation(floor: PredictedFloor) -> str:
    """Return the error of solving the equations, as stated for the source."""
    errors = getattr(floor.prediction.source, "level_error", np.array(np.nan))
    solved = (
        "The equations of floor and room are solved without random numbers: the same input gives "
        "the same result. The error of leaving out their higher modes is not stated."
    )
    if not np.isfinite(errors).all():
        return f"{solved} The numerical error of the force is not known."
    return (
        f"{solved} The numerical error of the force, estimated from a coarser computation, is at "
        f"most {errors.max():.2g} dB in its octaves. This says nothing on whether the "
        "equations describe the building."
    )


def _figure(svg: str, prefix: str) -> str:
    """Return a figure as inline SVG; a note if it could not be drawn."""
    return inline_svg(svg, prefix) if svg else "<p>not drawn</p>"


def _table(rows: Iterable[Sequence[str]], kind: str) -> str:
    """Return rows of text, the header first, as a table."""
    head, *body = rows
    titles = "".join(f"<th>{escaped(title)}</th>" for title in head)
    # What scrolls can be reached by keys.
    focus = ' tabindex="0"' if "scroll" in kind else ""
    lines = "\n".join(f"<tr>{labeled([symbols(c) for c in row], head)}</tr>" for row in body)
    return (
        f'<table class="cards {kind}"{focus}><thead><tr>{titles}</tr></thead>\n'
        f"<tbody>{lines}</tbody></table>"
    )
