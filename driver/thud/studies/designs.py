"""Designs: which sets a study has, as its table ``[design]`` says."""

from __future__ import annotations

import math
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

from thud.checks import LARGEST_SEED, require_whole, require_words
from thud.errors import InputError
from thud.studies.parameters import MAX_VALUES, Normal, Parameter, Uniform

if TYPE_CHECKING:
    from collections.abc import Mapping

# By study: the designs that it takes, the default first.
DESIGNS = {
    "sweep": ("grid", "list", "random", "latin_hypercube", "sobol"),
    "sensitivity": ("saltelli",),
    "design": ("grid",),
    "uncertainty": ("random",),
}
DRAWN = ("random", "latin_hypercube", "sobol", "saltelli")
# Fewer base samples than this give no Sobol indices.
MIN_SAMPLES = 4
# NumPy counts no further.
_MAX_SETS = 2**63 - 1


def makers(design: str) -> dict[str, str]:
    """Return the versions of what draws the points of a design; other versions may draw others."""
    names = {"saltelli": ("scipy", "SALib")}.get(design, ("scipy",) if design in DRAWN else ())
    return {f"{name.lower()}_version": version(name) for name in names}


def read_design(
    given: Mapping[str, Any], kind: str, parameters: tuple[Parameter, ...]
) -> tuple[str, int, int]:
    """Return kind, size and seed of a design.

    Parameters
    ----------
    given
        The table ``[design]``.
    kind
        The kind of study.
    parameters
        Its parameters.

    Raises
    ------
    InputError
        Where the design does not suit the study or its parameters.
    """
    allowed = DESIGNS[kind]
    design = given.get("kind", allowed[0])
    if design not in allowed:
        message = f"[design] kind = {design!r} is not allowed; allowed: {', '.join(allowed)}"
        raise InputError(message)
    words = ("kind", "size", "seed") if design in DRAWN else ("kind",)
    require_words(f"[design] of kind {design}", given, words)
    for parameter in parameters:
        spread = parameter.spread
        if design in DRAWN and isinstance(spread, Uniform) and spread.count:
            message = (
                f"[parameters] {parameter.name}: count has no use in a {design} design; "
                f"allowed: low, high and scale"
            )
            raise InputError(message)
        gridless = isinstance(spread, Normal) or (isinstance(spread, Uniform) and not spread.count)
        if design not in DRAWN and gridless:
            message = (
                f"[parameters] {parameter.name} has no values for a {design} design; "
                f"allowed: values = [...], or low, high and count"
            )
            raise InputError(message)
    if design == "list" and len({p.spread.size for p in parameters}) > 1:
        message = "[parameters] differ in their number of values; allowed: the same for all"
        raise InputError(message)
    if design == "grid" and math.prod(p.spread.size for p in parameters) > _MAX_SETS:
        message = "[parameters] make too many sets; allowed: up to 2^63 - 1 in a grid"
        raise InputError(message)
    if design not in DRAWN:
        return design, 0, 0
    size, seed = given.get("size", 0), given.get("seed", 0)
    least = MIN_SAMPLES if design == "saltelli" else 1
    require_whole("[design] size", size, least, MAX_VALUES)
    require_whole("[design] seed", seed, 0, LARGEST_SEED)
    if design in {"sobol", "saltelli"} and size & (size - 1):
        near = 1 << size.bit_length() - 1
        message = (
            f"[design] size = {size} breaks the balance of Sobol's points; "
            f"allowed: powers of 2, such as {near} or {2 * near}"
        )
        raise InputError(message)
    return design, size, seed
