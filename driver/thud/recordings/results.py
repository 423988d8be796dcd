"""Tables and files of a measured recording."""

from __future__ import annotations

import csv
import io
import math
from typing import TYPE_CHECKING

from thud._api import version
from thud.files import replace_file
from thud.levels import BANDWIDTHS, get_bands

if TYPE_CHECKING:
    from pathlib import Path

    from thud.recordings.estimates import Estimate
    from thud.recordings.recording import Recording
    from thud.recordings.verdict import Decision

# Title, size of the unit in SI units, and decimals of each criterion after the octaves.
_SHOWN = {
    "contact_time": ("contact time, ms", 1e-3, 2),
    "restitution": ("restitution", 1.0, 3),
    "peak_count": ("peaks of the force", 1.0, 0),
    "mass": ("mass, kg", 1.0, 3),
    "drop_height": ("drop height, m", 1.0, 3),
}


def drop_table(recording: Recording) -> list[tuple[str, ...]]:
    """Return rows of text, a drop each: touch, contact, restitution, peak and levels."""
    nominal = get_bands().nominal
    levels = recording.average().drops
    head = ("drop", "at, s", "contact, ms", "restitution", "peak, N")
    rows: list[tuple[str, ...]] = [(*head, *(f"{f:g} Hz, dB" for f in nominal))]
    rows += [
        (
            drop.name,
            f"{drop.onset:.3f}",
            _with_doubt(drop.contact_time, 1e-3, 2),
            _with_doubt(drop.restitution, 1.0, 3),
            f"{drop.peak_force.value:.0f}",
            *(f"{level:z.2f}" for level in levels[i]),
        )
        for i, drop in enumerate(recording.drops)
    ]
    return rows


def table(recording: Recording) -> list[tuple[str, ...]]:
    """Return rows of text: value, expanded uncertainty, limits, margin, verdict by criterion."""
    rows: list[tuple[str, ...]] = [
        ("criterion", "value", "uncertainty (95 %)", "limits", "margin", "verdict")
    ]
    octaves = [(f"level, {f:g} Hz octave, dB", 1.0, 2) for f in get_bands().nominal]
    shown = [*octaves, *_SHOWN.values()]
    for decision, (title, unit, decimals) in zip(
        recording.conformity().decisions, shown, strict=True
    ):
        rows.append((title, *_cells(decision, unit, decimals)))
    return rows


def _cells(decision: Decision, unit: float, decimals: int) -> tuple[str, ...]:
    limits = " to ".join(
        dict.fromkeys(f"{end / unit:g}" for end in (decision.lower, decision.upper))
    )
    if math.isnan(decision.value):
        return ("not known", "", limits, "", decision.verdict)
    doubt = decision.quantity.expanded / unit
    bound = "at most " if decision.quantity.upper_bound else ""
    return (
        f"{bound}{decision.value / unit:z.{decimals}f}",
        "" if doubt == 0 else "not known" if math.isnan(doubt) else f"{doubt:.{decimals + 1}f}",
        limits,
        f"{decision.margin / unit:z.{decimals}f}",
        decision.verdict,
    )


def _with_doubt(estimate: Estimate, unit: float, decimals: int) -> str:
    if math.isnan(estimate.value):
        return "not known"
    return f"{estimate.value / unit:.{decimals}f} ± {estimate.uncertainty / unit:.{decimals + 1}f}"


def verdict_sentence(recording: Recording) -> str:
    """Return the verdict in a sentence."""
    found = recording.conformity()
    name = found.source.replace("_", " ")
    words = [decision.verdict for decision in found.decisions]
    sentence = {
        "conforms": f"The source conforms to the limits of the {name}",
        "does not conform": f"The source does not conform to the limits of the {name}",
        "cannot be decided": f"Whether the source conforms to the limits of the {name} "
        "cannot be decided",
    }[found.verdict]
    counts = ", ".join(
        f"{words.count(word)} {word}" for word in dict.fromkeys(words) if words.count(word)
    )
    return f"{sentence} at 95 %: of {len(words)} criteria {counts}."


def levels_csv(recording: Recording) -> str:
    """Return octave and third levels, their uncertainty and background as text."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    head = "bandwidth nominal_Hz level_dB standard_uncertainty_dB background_dB spread_dB flag"
    writer.writerow(head.split())
    for bands in BANDWIDTHS:
        found = recording.average(bands)
        for i, nominal in enumerate(get_bands(bands).nominal):
            numbers = (found.level, found.uncertainty, found.background, found.spread)
            cells = ["" if math.isnan(one[i]) else repr(float(one[i])) for one in numbers]
            writer.writerow([bands, f"{nominal:g}", *cells, found.flag[i]])
    return text.getvalue()


def criteria_csv(recording: Recording) -> str:
    """Return value, uncertainties, limits and verdict of each criterion as text, SI units."""
    text = io.StringIO()
    text.write(f"# thud {version()}; SI units, levels in dB re 1 N; uncertainty expanded, 95 %\n")
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["criterion", "unit", "value", "uncertainty", "lower", "upper", "verdict"])
    for one in recording.conformity().decisions:
        numbers = (one.value, one.quantity.expanded, one.lower, one.upper)
        cells = ["" if math.isnan(number) else repr(float(number)) for number in numbers]
        writer.writerow([one.name, one.unit, *cells, one.verdict])
    return text.getvalue()


def save(recording: Recording, folder: Path, *, figures: bool = True) -> None:
    """Write levels, criteria, and, with figures, pictures and report to a directory.

    Raises
    ------
    OSError
        Where they cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    replace_file(folder / "levels.csv", levels_csv(recording).encode())
    replace_file(folder / "criteria.csv", criteria_csv(recording).encode())
    if figures:
        from thud.report import write_report  # noqa: PLC0415 - matplotlib takes its time

        write_report(recording, folder)
