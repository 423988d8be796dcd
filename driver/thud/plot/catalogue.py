"""Which figures there are: those that the files of this package declare."""

import importlib
import pkgutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from thud.free_modes import FreeModes
from thud.impact import Impact


def case_figures(impact: Impact | None = None, modes: FreeModes | None = None) -> dict[str, Figure]:
    """Draw the figures of a case.

    Parameters
    ----------
    impact
        The impact, of a case with a source model.
    modes
        The free modes, of a case that asks for them.

    Returns
    -------
    dict of str to Figure
        Figures by the names of their files, without those that have nothing to show.
    """
    given = {"IMPACT_FIGURES": impact, "MODES_FIGURES": modes}
    drawn = {
        name: draw(results)
        for kind, results in given.items()
        if results
        for name, draw in _declared(kind).items()
    }
    return {name: figure for name, figure in drawn.items() if figure}


def documentation_figures() -> dict[str, Callable[[], Figure]]:
    """Return functions that compute and draw the figures of the documentation, by name."""
    return _declared("DOCUMENTATION_FIGURES")


def _declared(kind: str) -> dict[str, Callable[..., Any]]:
    """Return what the files of this package declare under a name."""
    package = __name__.rpartition(".")[0]
    found = pkgutil.iter_modules([str(Path(__file__).parent)])
    modules = [importlib.import_module(f"{package}.{file.name}") for file in found]
    return {name: draw for module in modules for name, draw in getattr(module, kind, {}).items()}
