"""Verdict on a source over what is not known of its material: the calibrated set."""

from __future__ import annotations

import csv
from dataclasses import replace
from functools import lru_cache
from importlib import resources
from typing import TYPE_CHECKING

import numpy as np

from thud.base._schema import STANDARD_BALL, FiniteElement, ModalBall
from thud.base.checks import refuse, require_kind
from thud.base.note import Note
from thud.case.case import Case, check_case
from thud.case.keys import find_key, value_in, with_values
from thud.impact.compute import compute
from thud.impact.ensemble import solve_many
from thud.impact.impact import Impact
from thud.level.assessment import Verdict, assess_levels
from thud.studies.sampling import unit_samples
from thud.studies.unknowns import blocked_case, stated_unknowns

if TYPE_CHECKING:
    from collections.abc import Mapping

    from thud.studies.arrays import Array, Columns
    from thud.studies.unknowns import Unknown


# Equally likely parameters of the standard ball, made by `./bootstrap calibrate`.
FILE = "standard_ball.csv"
# Mesh with which the elements were calibrated: its numerical error is part of the parameters.
MESH = {"radial_elements": 6, "polar_elements": 48}
# Number of drops over the unknowns of a case, and their seed.
SAMPLES = 256
_SEED = 0
# Maximum fraction of drops without results.
_MAX_FAILED = 0.1
# Relative differences of values that do not vary.
_ROUNDING = 1e-9


@lru_cache(maxsize=4)
def calibrated_set(model: str) -> Mapping[str, Array]:
    """Return equally likely parameters of the standard ball by key; empty: a model without them."""
    lines = (resources.files("thud.studies") / FILE).read_text("utf-8").splitlines()
    rows = csv.DictReader(line for line in lines if not line.startswith("#"))
    entries = [row for row in rows if row.pop("model") == model]
    keys = [key for key, value in entries[0].items() if value] if entries else []
    return {key: np.array([float(entry[key]) for entry in entries]) for key in keys}


def assess(case: Case | Impact, *, progress: bool = False) -> Verdict:
    """Assess a source over what is not known of it.

    Not known of a ball by finite elements or modes is its material: each set of parameters of the
    standard ball that agrees with the standards makes a drop on a rigid floor. The modulus of a
    case multiplies that of the sets by its ratio to the default; other parameters that the case
    states replace those of the sets. ``Case.unknowns`` adds or replaces ranges; other models need
    it (docs/verdict.md).

    Parameters
    ----------
    case
        The case, or an impact of it; its drop on the rigid floor is assessed.
    progress
        Show a progress bar.

    Returns
    -------
    Verdict
        With ranges, probabilities and main unknowns.

    Raises
    ------
    InputError
        If nothing is known to vary, or too many drops have no results.
    """
    require_kind("case", case, Case | Impact)
    if isinstance(case, Impact):
        case = case.case
    if case.model is None:
        refuse("&model is missing", "a case with a source model")
    check_case(case)
    stated = stated_unknowns(case)
    sets = calibrated_set(case.model.name)
    if not sets and not stated:
        models = ", ".join(repr(model.name) for model in (ModalBall, FiniteElement))
        refuse(
            "nothing is known to vary with this source model",
            f"&unknowns with key, low, high and reason, or model = {models}",
        )
    alone = blocked_case(case, stated)
    varied, fixed = _varied_set(alone, sets)
    case = _calibrated_mesh(alone.resolved())
    for unknown in stated:
        ends = {unknown.key: np.array([unknown.low, unknown.high])}
        if np.array_equal(*_criteria(case, ends, progress=False)):
            refuse(
                f"&unknowns: {unknown.key} = {unknown.low:g} and {unknown.high:g} make the same "
                "drop: this source does not use it",
                "keys that change the drop of the case",
            )
    if stated:
        varied = _samples(case, varied, stated)
        fixed = tuple(key for key in fixed if key not in varied)
    # The first drop is that of the case.
    columns = {key: np.append(value_in(case, key) or 0.0, v) for key, v in varied.items()}
    values = _criteria(case, columns, progress=progress)
    failed = np.isnan(values).any(axis=1)
    columns = {key: column[~failed] for key, column in columns.items()}
    drop = compute(with_values(alone, {key: float(x[0]) for key, x in columns.items()}))
    counts = {"drops": len(values) - 1.0, "lost": float(failed.sum())}
    notes = (
        Note("drops_varied", others={"names": ", ".join(columns), **counts}),
        *(unknown.note for unknown in stated),
        *drop.notes,
        *([Note("keys_fixed", others={"names": ", ".join(fixed)})] if fixed else []),
        *([Note("conforms_by_calibration")] if sets else []),
    )
    return _verdict(case, columns, values[~failed], fixed, notes)


def _varied_set(case: Case, sets: Mapping[str, Array]) -> tuple[Columns, tuple[str, ...]]:
    """Return the parameters of the sets for a case, and the keys that the case fixes."""
    model, result = case.model, dict(sets)

    def is_stated(key: str) -> bool:
        return getattr(model, key, getattr(case.ball, key, None)) is not None

    stated = {key for key in sets if is_stated(key)}
    if is_stated("loss_frequency"):
        stated.add("loss_factor")
    # Keys of another damping law than that of the case.
    needs = {key: find_key(key, case)[0].needs for key in sets}
    stated |= {key for key, need in needs.items() if need and getattr(model, need[0]) != need[1]}
    if sets and model and "youngs_modulus" in stated and case.ball.youngs_modulus:
        ratio = case.ball.youngs_modulus / STANDARD_BALL[model.name, "youngs_modulus"]
        result["youngs_modulus"] = ratio * sets["youngs_modulus"]
    fixed = tuple(key for key in sets if key in stated and key != "youngs_modulus")
    return {key: column for key, column in result.items() if key not in fixed}, fixed


def _calibrated_mesh(case: Case) -> Case:
    """Return a case of elements with the mesh of the calibration, unless it states one."""
    model = case.model
    if not isinstance(model, FiniteElement):
        return case
    keys = {key: number for key, number in MESH.items() if not getattr(model, key)}
    return replace(case, model=replace(model, snapshot_interval=0.0, **keys))  # type: ignore[arg-type]


def _samples(case: Case, sets: Columns, unknowns: tuple[Unknown, ...]) -> Columns:
    """Return random sets, in which random values of the unknowns replace their keys."""
    points = unit_samples("random", len(unknowns) + 1, SAMPLES, _SEED)
    rows = points[:, -1]
    result = {key: column[(rows * len(column)).astype(int)] for key, column in sets.items()}
    for i, unknown in enumerate(unknowns):
        middle = float(value_in(case, unknown.key) or 0.0)
        result[unknown.key] = unknown.quantiles(points[:, i], middle)
    return result


def _criteria(case: Case, columns: Columns, *, progress: bool) -> Array:
    """Return the criteria of drops, shape (n, n_criterion); NaN: no result.

    Raise InputError if the first drop, or too many of them, have none.
    """
    drops = solve_many(columns, case, forces=True, progress=progress)
    failed = drops.status != 0
    if failed[0] or failed.mean() > _MAX_FAILED:
        refuse(
            f"{failed.sum()} of {failed.size} drops have no result ({drops.reason[failed][0]})",
            "a source, and ranges of &unknowns, whose drops have results",
        )
    others = [columns.get(key, value_in(case, key)) for key in ("mass", "height")]
    fixed = [np.broadcast_to(np.asarray(other, dtype=float), failed.size) for other in others]
    levels = getattr(drops, f"{case.levels.force}_octave")
    numbers = levels, drops.contact_time, drops.restitution, np.asarray(drops.peaks)
    return np.column_stack([*numbers, *fixed])


def _verdict(
    case: Case, columns: Columns, values: Array, fixed: tuple[str, ...], notes: tuple[Note, ...]
) -> Verdict:
    """Return the verdict by the criteria of drops, of which the first is that of the case."""
    octaves, (time, restitution, peaks, mass, height) = np.split(values[0], [5])
    drops = values[1:]
    plain = assess_levels(
        octaves, time, restitution, peaks, mass, height, source=case.limits.source
    )
    limits = np.array([(criterion.lower, criterion.upper) for criterion in plain.criteria])
    inside = (drops >= limits[:, 0]) & (drops <= limits[:, 1])
    criteria = tuple(
        replace(
            criterion,
            range=(float(drops[:, i].min()), float(drops[:, i].max())),
            counts=(int(inside[:, i].sum()), len(drops)),
            main_unknown=_main_unknown(columns, drops[:, i]),
        )
        for i, criterion in enumerate(plain.criteria)
    )
    counts = int(inside.all(axis=1).sum()), len(drops)
    return replace(
        plain, criteria=criteria, counts=counts, unknowns=tuple(columns), fixed=fixed, notes=notes
    )


def _main_unknown(columns: Columns, values: Array) -> str:
    """Return the unknown with the largest rank correlation; empty if the values do not vary."""
    if np.ptp(values) <= _ROUNDING * np.abs(values).max():
        return ""
    # Equal values have one rank.
    ranks = np.unique(values, return_inverse=True)[1]
    sizes = {
        key: abs(float(np.corrcoef(np.unique(column[1:], return_inverse=True)[1], ranks)[0, 1]))
        for key, column in columns.items()
        if np.ptp(column[1:]) > 0
    }
    return max(sizes, key=lambda key: sizes[key], default="")
