"""Tables of the quantities and levels that the kinds of results have."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from thud.base._schema import QUANTITIES, SAMPLE_QUANTITIES
from thud.base.quantity import Quantity
from thud.level.levels import BANDWIDTHS, FORCES

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from thud.impact.outcomes import Ensemble

ROOM_LEVEL = "room_level"
ROOM_RATING = "room_rating"
# Dimensions of bands: octaves and one-third-octave bands of forces, and rated bands in a room.
BANDS = (*BANDWIDTHS, ROOM_BAND := "room_third")
# Force and bands of the levels of a sample, by name.
LEVELS = {
    f"{force}_level" if bands == BANDWIDTHS[0] else f"{force}_{bands}_level": (force, bands)
    for bands in BANDWIDTHS
    for force in FORCES
}
# Bands of the levels of the contact force, by name.
CONTACT_LEVELS = {f"contact_{bands}_level": bands for bands in BANDWIDTHS}
# Second dimension of results; the first is the sample.
DIMENSIONS: dict[str, str] = {
    **{name: bands for name, (_, bands) in LEVELS.items()}, **CONTACT_LEVELS, ROOM_LEVEL: ROOM_BAND
}  # fmt: skip


def _level(name: str, force: str) -> Quantity:
    """Return the declaration of the levels of a force."""
    meaning = f"force exposure level of the {force} force, re 1 N and 1 s"
    return Quantity(name, name.replace("_", " "), "L_{FE}", "dB", "dB", 1.0, 2, meaning)


def _number(name: str, meaning: str) -> Quantity:
    """Return the declaration of a pure number, a truth value or a text."""
    return Quantity(name, name, "", "", "", 1.0, 0, meaning)


SCALAR_QUANTITIES = {name: QUANTITIES[name] for name in SAMPLE_QUANTITIES}
# Results of each sample.
SAMPLE_RESULTS = {
    **SCALAR_QUANTITIES,
    **{name: _level(name, force) for name, (force, _) in LEVELS.items()},
    "margin": QUANTITIES["margin"],
    "conforms": _number("conforms", "all criteria of the standard are met"),
    "status": _number("status", "0: computed; otherwise the exit code of the error"),
    "reason": _number("reason", "why there are no results"),
}
# Additional results of drops on a floor, except levels of the contact force.
FLOOR_QUANTITIES = {
    "floor_work": QUANTITIES["floor_work"],
    ROOM_LEVEL: Quantity(
        ROOM_LEVEL, "level in the room", "L_{i,Fmax}", "dB", "dB", 1.0, 1,
        "maximum Fast level in the room, re 20 uPa",
    ),
    ROOM_RATING: QUANTITIES[ROOM_RATING],
}  # fmt: skip
# All results of samples, including those of surrogates and of their training.
ALL_QUANTITIES = {
    **SAMPLE_RESULTS,
    **{name: _level(name, "contact") for name in CONTACT_LEVELS},
    **FLOOR_QUANTITIES,
    "undecided": _number("undecided", "the verdict could change by the errors of the surrogate"),
    "peaks": QUANTITIES["peak_count"],
}


def sample_results(ensemble: Ensemble) -> dict[str, NDArray[Any]]:
    """Return the results of all samples by their names in `ALL_QUANTITIES`."""
    results: dict[str, NDArray[Any]] = {}
    for name in SAMPLE_RESULTS:
        if name not in LEVELS:
            results[name] = getattr(ensemble, name)
        elif LEVELS[name] in ensemble.levels:
            results[name] = ensemble.levels[LEVELS[name]]
    results |= {f"contact_{bands}_level": level for bands, level in ensemble.contact_levels.items()}
    floor_results = {name: getattr(ensemble, name) for name in FLOOR_QUANTITIES}
    return results | {name: v for name, v in floor_results.items() if v is not None}
