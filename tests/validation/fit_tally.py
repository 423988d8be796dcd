"""Fits to records whose truth is known: how many hold it, miss it, and miss it in silence."""

from __future__ import annotations

import sys
import warnings
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from scipy import stats

import thud

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping

    from numpy.typing import NDArray

    # Fits of a name: their number, and options.
    Fits = Callable[..., Iterable[thud.Fit]]

CONFIDENCE = 0.9
# Standard errors beyond which an estimate is a miss.
ERRORS = 3.0
# A count outside of bounds that hold for all numbers of a table has this probability.
SURPRISE = 1e-3


def quiet_fit(*arguments: Any, **options: Any) -> thud.Fit:  # noqa: ANN401 - of `thud.fit`
    """Return a fit whose warnings do not matter."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return thud.fit(*arguments, confidence=CONFIDENCE, **options)


def random_of(name: str, seed: int) -> np.random.Generator:
    """Return random numbers of a record, of its own for each name."""
    return np.random.default_rng([seed, *name.encode()])


class Tally(NamedTuple):
    """Of fits: by fit, whether it warns; by fit and parameter, all relative to the truth.

    `covered` tells whether an interval holds the truth; `widths` are standard errors.
    """

    warned: NDArray[np.bool_]
    covered: NDArray[np.bool_]
    errors: NDArray[np.float64]
    widths: NDArray[np.float64]

    @property
    def missed(self) -> NDArray[np.bool_]:
        """Whether a fit misses the truth by more than `ERRORS`."""
        return np.asarray((np.abs(self.errors) > ERRORS * self.widths).any(axis=1))

    @property
    def silent(self) -> int:
        """Number of misses without a warning."""
        return int((self.missed & ~self.warned).sum())

    @property
    def is_honest(self) -> bool:
        """Whether the intervals cover, in all fits or in those without a warning."""
        groups = self.covered, self.covered[~self.warned]
        return any(
            (group.sum(axis=0) >= stats.binom.ppf(SURPRISE, len(group), CONFIDENCE)).all()
            for group in groups
        )


def tally(fits: Iterable[thud.Fit], truth: Mapping[str, float]) -> Tally:
    """Return what fits find of a truth."""
    warned, covered, errors, widths = [], [], [], []
    for fit in fits:
        ends = fit.intervals()
        warned.append(bool(fit.warnings))
        covered.append([ends[key][0] < value < ends[key][1] for key, value in truth.items()])
        errors.append([fit.values[key] / value - 1 for key, value in truth.items()])
        widths.append([fit.standard_errors[key] / value for key, value in truth.items()])
    return Tally(*map(np.array, (warned, covered, errors, widths)))


def print_tallies(names: Iterable[str], fits: Fits, truth: Mapping[str, float], usual: int) -> None:
    """Print a row for each name: with the unknowns of a fit, and where it trusts its case.

    The number of fits of each is the first argument of the command, or the usual one.
    """
    count = int(sys.argv[1]) if len(sys.argv) > 1 else usual
    columns = ["", "unknowns", "warned", "missed", "in silence"]
    columns += [f"{what} of {key}, %" for key in truth
                for what in ("covered", "error", "standard error")]  # fmt: skip
    sys.stdout.write(f"{count} fits each; medians\n| {' | '.join(columns)} |\n")
    sys.stdout.write("|---" * len(columns) + "|\n")
    for name in names:
        for options in ({}, {"unknowns": ()}):
            found = tally(fits(name, count, **options), truth)
            cells = [name, "none" if options else "all", found.warned.sum(), found.missed.sum()]
            cells.append(found.silent if found.is_honest else f"{found.silent}, not honest")
            for values in zip(found.covered.T, found.errors.T, found.widths.T, strict=True):
                numbers = np.mean(values[0]), *np.median(np.abs(values[1:]), axis=1)
                cells += [f"{100 * number:.2g}" for number in numbers]
            sys.stdout.write(f"| {' | '.join(map(str, cells))} |\n")
            sys.stdout.flush()
