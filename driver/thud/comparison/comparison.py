"""Models and recordings of the same drop on one page."""

from __future__ import annotations

import math
import os
import time
import warnings
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from itertools import chain, combinations, count
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from tqdm import tqdm

from thud.base._schema import LIMITS, QUANTITIES, SAMPLE_QUANTITIES, VERDICTS
from thud.base.checks import refuse, refuse_value, require_choice, require_kind
from thud.base.display import Tabulated, column_rows
from thud.base.errors import PlausibilityWarning, ThudError
from thud.base.files import Results
from thud.case.case import Case, read_case
from thud.impact.compute import compute
from thud.impact.impact import Impact
from thud.level.assessment import ImpactOrRecording
from thud.level.levels import FORCES, SOURCES
from thud.plot.impact_figures import common_source
from thud.plot.pages import comparison_html
from thud.plot.save_figures import page_files

if TYPE_CHECKING:
    from thud.base._schema import LevelsForce, LimitsSource
    from thud.base.display import Columns
    from thud.base.key import Quantity
    from thud.base.note import Note
    from thud.level.assessment import Criterion, Verdict
    from thud.recordings.recording import ImpactResult

# Endings of namelist files; all other files are read as recordings.
NAMELISTS = (".nml", ".namelist", "")
# Relative tolerance of the velocity of a recording, for a drop height of at least 0.85 m ± 1 cm.
VELOCITY_TOLERANCE = 0.015
# Quantities that are no criteria.
_OTHERS = [
    name
    for name in SAMPLE_QUANTITIES
    if name not in {"peak_force", "peak_elastic_force", *(name for name, *_ in LIMITS[SOURCES[0]])}
]


@dataclass(frozen=True, eq=False, repr=False)
class Comparison(Tabulated):
    """Impacts of the same drop, in columns of a table.

    Attributes
    ----------
    impacts : dict of str to Impact or Recording
        Impacts and recordings by their names.
    run_times : dict of str to float
        Computing time of each model, s.
    force : str or None
        The compared force, ``"floor"`` or ``"elastic"``; None: the assessed force of each case.
    source : str
        Impact source whose limits apply.
    """

    drawn_by: ClassVar[str] = "pages.draw_comparison"

    impacts: dict[str, ImpactResult]
    run_times: dict[str, float]
    force: LevelsForce | None = None
    source: LimitsSource = "rubber_ball"

    @property
    def notes(self) -> tuple[Note, ...]:
        """Warnings of all impacts; their subjects begin with the name of the impact."""
        notes = [(name, note) for name, impact in self.impacts.items() for note in impact.notes]
        return tuple(
            # A file has the name of its impact.
            note
            if Path(note.subject).stem == name
            else replace(note, subject=f"{name}, {note.subject}".removesuffix(", "))
            for name, note in notes
            if note.is_warning
        )

    def __repr__(self) -> str:
        """Return the names of the compared impacts."""
        return f"<Comparison: {', '.join(self.impacts)}>"

    def columns(self) -> Columns:
        """Return force, method, criteria, quantities, times and verdicts; a row for each impact."""
        impacts = self.impacts.values()
        verdicts = self._verdicts()
        values: dict[Quantity, list[float]] = {
            criteria[0].quantity: [criterion.value for criterion in criteria]
            for criteria in zip(*(verdict.criteria for verdict in verdicts), strict=True)
        }
        values[QUANTITIES["peak_force"]] = [impact.peak(self.force) for impact in impacts]
        for other in map(QUANTITIES.__getitem__, _OTHERS):
            values[other] = [impact.quantity(other.name) for impact in impacts]
        times = [1e3 * self.run_times.get(name, math.nan) for name in self.impacts]
        return {
            "name": ([*self.impacts], ""),
            "assessed force": ([impact.assessed_force(self.force) for impact in impacts], ""),
            "method of levels": ([impact.case.levels.method for impact in impacts], ""),
            **{
                quantity.label: (quantity.display_scale * np.array(row), f"z.{quantity.decimals}f")
                for quantity, row in values.items()
            },
            "computing time, ms": (times, ".3g"),
            "verdict": ([v.conforms for v in verdicts], ""),
        }

    def rows(self) -> list[tuple[str, ...]]:
        """Return rows of text without empty ones: a column for each impact, and the limits."""
        criteria = zip(*(verdict.criteria for verdict in self._verdicts()), strict=True)
        assessed = {entries[0].quantity.label: entries for entries in criteria}
        rows = [("", *self.impacts, f"limits, {self.source.replace('_', ' ')}")]
        for title, *cells in [*zip(*column_rows(self.columns()), strict=True)][1:]:
            entries = assessed.get(title, ())
            texts = map(_cell, entries) if entries else cells
            rows.append((title, *texts, entries[0].shown_limits if entries else ""))
        return [row for row in rows if any(row[1:-1])]

    def _verdicts(self) -> list[Verdict]:
        """Return the verdict on each impact."""
        return [impact.assess(self.source, self.force) for impact in self.impacts.values()]

    def html(self) -> str:
        """Return a page with interactive plots and the table as self-contained HTML."""
        return comparison_html(self)

    def files(self) -> dict[str, bytes]:
        """Return ``comparison.svg`` and ``comparison.html`` by name."""
        return page_files("comparison", self.plot, self.html())

    def save(self, path: str | os.PathLike[str], *, replace: bool = False) -> None:
        """Write `files` into a directory of their own, which is replaced as a whole.

        Results of something else are replaced only if `replace` is true. Raise InputError if the
        directory holds any other file, and OSError if a file cannot be written.
        """
        Results(Path(path), "compare", replace=replace).write(self.files())


def _cell(criterion: Criterion) -> str:
    """Return the value of a criterion, and whether it is too low, too high or undecided."""
    if np.isnan(criterion.value):
        return "unknown"
    quantity, verdict = criterion.quantity, criterion.conforms
    text = f"{criterion.value * quantity.display_scale:z.{quantity.decimals}f}"
    if verdict == VERDICTS[0]:
        return text
    state = "low" if criterion.value < criterion.lower else "high"
    return f"{text} {state if verdict == VERDICTS[1] else verdict}"


# Values of a mapping are checked when they are used: mypy infers no type for several kinds.
def compare(
    impacts: Mapping[str, object] | Iterable[Case | ImpactResult],
    force: LevelsForce | None = None,
    source: LimitsSource | None = None,
    *,
    progress: bool = False,
) -> Comparison:
    """Compare models and recordings of the same drop.

    Parameters
    ----------
    impacts
        Cases (which are solved), impacts and recordings: a mapping by names, or a list with the
        names of the cases.
    force
        ``"floor"`` or ``"elastic"``; by default the assessed force of each case.
    source
        ``"rubber_ball"`` or ``"tyre"``: source of the limits; by default that of the cases and
        recordings.
    progress
        Show a progress bar.

    Returns
    -------
    Comparison
        Its `save` writes the page.

    Raises
    ------
    InputError
        If there is nothing to compare, or the drops or the limits differ. Recordings of unknown
        height are not checked.

    Warns
    -----
    PlausibilityWarning
        For each of `Comparison.notes`.
    """
    if force is not None:
        require_choice("force", force, FORCES)
    if source is not None:
        require_choice("source", source, SOURCES)
    named = _named(impacts)
    solved: dict[str, ImpactResult] = {}
    run_times = {}
    for name, item in tqdm(named.items(), unit="case", disable=not progress, leave=False):
        if isinstance(item, Case):
            start = time.perf_counter()
            try:
                solved[name] = compute(item)
            except ThudError as error:
                raise error.within(name) from error
            run_times[name] = time.perf_counter() - start
        else:
            solved[name] = item
    _require_same_drop(solved)
    limits = common_source(solved, source)
    result = Comparison(solved, run_times, force, limits)
    for note in result.notes:
        warnings.warn(note.message, PlausibilityWarning, stacklevel=2)
    return result


def _require_same_drop(impacts: Mapping[str, ImpactResult]) -> None:
    """Raise InputError if drops differ by more than the tolerance of measured heights."""
    known = {n: i for n, i in impacts.items() if not math.isnan(i.impact_velocity)}
    for first, second in combinations(known.values(), 2):
        are_models = isinstance(first, Impact) and isinstance(second, Impact)
        tolerance = 0.0 if are_models else VELOCITY_TOLERANCE
        slow, fast = sorted((first.impact_velocity, second.impact_velocity))
        if fast <= slow * (1 + tolerance):
            continue
        listed = ", ".join(f"{n} falls with {i.impact_velocity:.4g} m/s" for n, i in known.items())
        refuse(
            f"&drop: height or gravity differs ({listed})",
            f"the same drop: impact velocities within {tolerance:.1%}",
        )


def _named(impacts: object) -> dict[str, Case | ImpactResult]:
    """Return cases and impacts by name, checked."""
    allowed = (
        "one or more cases, impacts or recordings, by name or in a list "
        "(files: read_case, read_recording)"
    )
    if isinstance(impacts, Mapping):
        pairs = list(impacts.items())
    else:
        items = [impacts] if isinstance(impacts, Case | ImpactOrRecording) else impacts
        if not isinstance(items, Iterable) or isinstance(
            items, str | bytes | os.PathLike | np.ndarray
        ):
            refuse_value("impacts", items, allowed)
        pairs = [(getattr(item, "name", type(item).__name__.lower()), item) for item in items]
    if not pairs:
        refuse("impacts is empty", allowed)
    named: dict[str, Case | ImpactResult] = {}
    for name, item in pairs:
        require_kind("name", name, str)
        require_kind(name, item, Case | ImpactOrRecording)
        # Cases from Python often share their name.
        names = chain([name], (f"{name} ({n})" for n in count(2)))
        named[next(free for free in names if free not in named)] = item
    return named


def read_all(paths: Iterable[str | os.PathLike[str]]) -> dict[str, Case | ImpactResult]:
    """Read namelist files (``.nml``) and recordings, by the names of the cases and the files.

    Raises
    ------
    InputError
        If a file cannot be read, or two have the same name.
    """
    # SciPy is slow to import.
    from thud.recordings.recording import read_recording

    items: dict[str, Case | ImpactResult] = {}
    for path in map(Path, paths):
        is_case = path.suffix.lower() in NAMELISTS
        item: Case | ImpactResult = read_case(path) if is_case else read_recording(path)
        if item.name in items:
            refuse(f"{path}: {item.name!r} also names another input", "different names")
        items[item.name] = item
    return items
