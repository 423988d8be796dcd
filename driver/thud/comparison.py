"""Models and recordings of the same drop on one page."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from tqdm import tqdm

from thud.case import Case, read_case
from thud.checks import require_kind
from thud.errors import InputError, ThudError
from thud.files import replace_file
from thud.impact import Impact, solve_case
from thud.levels import octave_limits
from thud.plot.comparison import comparison_page
from thud.plot.comparison_html import comparison_html
from thud.plot.look import save_all
from thud.recording import Recording

if TYPE_CHECKING:
    import os
    from collections.abc import Iterable, Mapping

    from matplotlib.figure import Figure

HEADER = ("", "contact, ms", "peak, N", "restitution", "level - nominal, dB", "conforms", "run, ms")


@dataclass(frozen=True)
class Comparison:
    """Impacts of the same drop, side by side.

    Attributes
    ----------
    impacts : dict of str to Impact or Recording
        What is compared, by its name.
    run_times : dict of str to float
        Computing time of each model, s.
    force : str
        ``"elastic"`` or ``"floor"``: the force that is compared.
    source : str
        Source of the limits.
    """

    impacts: dict[str, Impact | Recording]
    run_times: dict[str, float]
    force: str = "floor"
    source: str = "rubber_ball"

    def table(self) -> list[tuple[str, ...]]:
        """Return one row of text per impact, in the order of `HEADER`."""
        lower, upper = octave_limits(self.source)
        nominal, tolerance = (lower + upper) / 2, (upper - lower) / 2
        rows: list[tuple[str, ...]] = []
        for name, impact in self.impacts.items():
            difference = impact.levels(method="exact", force=self.force) - nominal
            met = int(np.sum(np.abs(difference) <= tolerance))
            bounce = impact.restitution
            spent = self.run_times.get(name)
            rows.append(
                (
                    name,
                    f"{1e3 * impact.contact_time:.2f}",
                    f"{impact.force(self.force).max():.0f}",
                    "not known" if np.isnan(bounce) else f"{bounce:.3f}",
                    "  ".join(f"{value:+.1f}" for value in difference),
                    f"{met} of 5 octaves",
                    "" if spent is None else f"{1e3 * spent:.1f}",
                )
            )
        return rows

    def figure(self) -> Figure:
        """Return the page as a matplotlib figure."""
        return comparison_page(self.impacts, self.force, self.source, self.table())

    def html(self) -> str:
        """Return the page as self-contained HTML with interactive plots."""
        return comparison_html(self.impacts, self.force, self.source, self.table())

    def save(self, directory: str | os.PathLike[str]) -> list[Path]:
        """Write ``comparison.png``, ``.svg`` and ``.html`` and return their paths.

        Raises
        ------
        OSError
            Where they cannot be written.
        """
        folder = Path(directory)
        folder.mkdir(parents=True, exist_ok=True)
        pictures = save_all({"comparison": self.figure()}, folder)
        page = folder / "comparison.html"
        replace_file(page, self.html().encode())
        return [*pictures, page]


def compare(
    impacts: Mapping[str, Case | Impact | Recording],
    force: str = "floor",
    source: str = "rubber_ball",
    *,
    progress: bool = False,
) -> Comparison:
    """Compare models and recordings of the same drop.

    Parameters
    ----------
    impacts
        Cases (which are solved), impacts and recordings by name; one or more.
    force
        ``"elastic"`` or ``"floor"``.
    source
        ``"rubber_ball"`` or ``"tyre"``: source of the limits.
    progress
        Show a progress bar.

    Returns
    -------
    Comparison
        Its `save` writes the page.

    Raises
    ------
    InputError
        Where there is nothing to compare, or the drops differ.
    """
    if not impacts:
        message = "impacts is empty; allowed: one or more cases, impacts or recordings by name"
        raise InputError(message)
    solved: dict[str, Impact | Recording] = {}
    run_times = {}
    for name, given in tqdm(impacts.items(), unit="case", disable=not progress, leave=False):
        require_kind(name, given, Case | Impact | Recording)
        if isinstance(given, Case):
            start = time.perf_counter()
            try:
                solved[name] = solve_case(given)
            except ThudError as error:
                message = f"{name}: {error}"
                raise type(error)(message) from error
            run_times[name] = time.perf_counter() - start
        else:
            solved[name] = given
    speeds = {
        name: impact.impact_velocity
        for name, impact in solved.items()
        if isinstance(impact, Impact)
    }
    if len(set(speeds.values())) > 1:
        listed = ", ".join(f"{name} falls with {speed:.4g} m/s" for name, speed in speeds.items())
        message = f"&drop: height or gravity differs ({listed}); allowed: cases of the same drop"
        raise InputError(message)
    return Comparison(solved, run_times, force, source)


def read_all(paths: Iterable[str | os.PathLike[str]]) -> dict[str, Case | Recording]:
    """Read namelist files and recordings (``.csv``); their names are those of the cases or files.

    Raises
    ------
    InputError
        Names the file; also raised where two have the same name.
    """
    found: dict[str, Case | Recording] = {}
    for path in map(Path, paths):
        given: Case | Recording
        if path.suffix.lower() == ".csv":
            name, given = path.stem, Recording.from_csv(path)
        else:
            given = read_case(path)
            name = given.name
        if name in found:
            message = f"{path}: {name!r} also names another input; allowed: different names"
            raise InputError(message)
        found[name] = given
    return found
