"""Models and recordings of the same drop on one page."""

from __future__ import annotations

import math
import os
import time
import warnings
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import chain, combinations, count
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from tqdm import tqdm

from thud.base._schema import LIMITS, QUANTITIES, SAMPLE_QUANTITIES, VERDICTS
from thud.base.checks import refuse, refuse_value, require_choice, require_kind
from thud.base.display import Displayed
from thud.base.errors import PlausibilityWarning, ThudError
from thud.base.files import Results
from thud.case.case import Case, read_case
from thud.impact.compute import compute
from thud.impact.impact import Impact
from thud.level.assessment import ImpactOrRecording
from thud.level.levels import FORCES, SOURCES
from thud.plot.impact_figures import common_source
from thud.plot.pages import comparison_figure, comparison_html
from thud.plot.save_figures import page_files

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from thud.base._schema import LevelsForce, LimitsSource
    from thud.level.assessment import Criterion
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
class Comparison(Displayed):
    """Impacts of the same drop, side by side.

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

    impacts: dict[str, ImpactResult]
    run_times: dict[str, float]
    force: LevelsForce | None = None
    source: LimitsSource = "rubber_ball"

    @property
    def warnings(self) -> list[str]:
        """Warnings of all impacts, each after the name of its impact."""
        return [
            f"{name}: {warning}"
            for name, impact in self.impacts.items()
            for warning in impact.warnings
        ]

    def __repr__(self) -> str:
        """Return the names of the compared impacts."""
        return f"<Comparison: {', '.join(self.impacts)}>"

    def rows(self) -> list[tuple[str, ...]]:
        """Return rows of text: names, force, method, criteria, quantities, times, verdicts.

        Each impact has a column; the last column has the limits.
        """
        columns = [self._column(name) for name in self.impacts]
        criteria = next(iter(self.impacts.values())).assess(self.source, self.force).criteria
        limits = {criterion.quantity.label: criterion.shown_limits for criterion in criteria}
        rows: list[tuple[str, ...]] = [
            ("", *self.impacts, f"limits, {self.source.replace('_', ' ')}")
        ]
        for title in columns[0]:
            cells = [column[title] for column in columns]
            if any(cells):
                rows.append((title, *cells, limits.get(title, "")))
        return rows

    def _column(self, name: str) -> dict[str, str]:
        """Return the cells of an impact by their titles."""
        impact, seconds = self.impacts[name], self.run_times.get(name)
        verdict = impact.assess(self.source, self.force)
        peak, others = QUANTITIES["peak_force"], map(QUANTITIES.__getitem__, _OTHERS)
        return {
            "assessed force": impact.assessed_force(self.force),
            "method of levels": impact.case.levels.method,
            **{criterion.quantity.label: _cell(criterion) for criterion in verdict.criteria},
            peak.label: peak.show(impact.peak(self.force)),
            **{other.label: other.show(impact.quantity(other.name)) for other in others},
            "computing time, ms": f"{1e3 * seconds:.3g}" if seconds else "",
            "verdict": verdict.conforms,
        }

    def plot(self) -> Figure:
        """Draw forces and levels."""
        return comparison_figure(self.impacts, self.force, self.source)

    def html(self) -> str:
        """Return a page with interactive plots and the table as self-contained HTML."""
        return comparison_html(self.impacts, self.force, self.source, self.rows())

    def files(self) -> dict[str, bytes]:
        """Return ``comparison.svg`` and ``comparison.html`` by name."""
        return page_files("comparison", self.plot, self.html())

    def save(self, directory: str | os.PathLike[str], *, replace: bool = False) -> list[Path]:
        """Write the contents of `files` into a directory of their own; return the paths.

        A directory is replaced as a whole: one that holds results of something else only if
        `replace` is true. Raise InputError if it holds any other file, and OSError if a file cannot
        be written.
        """
        return Results(Path(directory), "compare", replace=replace).write(self.files())


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
        For each of `Comparison.warnings`.
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
    for warning in result.warnings:
        warnings.warn(warning, PlausibilityWarning, stacklevel=2)
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
    from thud.recordings.read_recording import read_recording

    items: dict[str, Case | ImpactResult] = {}
    for path in map(Path, paths):
        is_case = path.suffix.lower() in NAMELISTS
        item: Case | ImpactResult = read_case(path) if is_case else read_recording(path)
        if item.name in items:
            refuse(f"{path}: {item.name!r} also names another input", "different names")
        items[item.name] = item
    return items
