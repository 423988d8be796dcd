"""Names, units and meanings of the results of drops: the table of the library, levels and rooms."""

from thud.base._schema import QUANTITIES, SAMPLE_QUANTITIES
from thud.base.quantity import Quantity
from thud.level.levels import BANDWIDTHS, FORCES

ROOM_LEVEL = "room_level"
RATING = "standardised_rating"
_LEVEL = "force exposure level of the {} force, re 1 N and 1 s"
# Dimensions that are bands: those of the levels, and the one-third-octave bands in a room.
BANDS = (*BANDWIDTHS, ROOM_BAND := "room_third")
# Force and bands of the levels that a sample may have, by name.
LEVELS = {
    f"{force}_level" if bands == BANDWIDTHS[0] else f"{force}_{bands}_level": (force, bands)
    for bands in BANDWIDTHS
    for force in FORCES
}
# Bands of the levels of the contact force, by name.
CONTACT_LEVELS = {f"contact_{bands}_level": bands for bands in BANDWIDTHS}


def _level(name: str, symbol: str, meaning: str) -> Quantity:
    """Return a quantity in dB."""
    title = name.replace("_", " ")
    return Quantity(name, title, symbol, "dB", "dB", 1.0, 1, meaning)


def _number(name: str, meaning: str) -> Quantity:
    """Return a pure number."""
    return Quantity(name, name.replace("_", " "), "", "", "", 1.0, 0, meaning)


def _by_name(*quantities: Quantity) -> dict[str, Quantity]:
    return {quantity.name: quantity for quantity in quantities}


# Numbers of each sample.
SCALAR_QUANTITIES = {name: QUANTITIES[name] for name in SAMPLE_QUANTITIES}
SAMPLE_RESULTS = {
    **SCALAR_QUANTITIES,
    **{name: _level(name, "L_{FE}", _LEVEL.format(force)) for name, (force, _) in LEVELS.items()},
    **_by_name(
        _level(
            "margin",
            "",
            "minimum distance of the assessed octave levels to a limit, > 0 inside",
        ),
        _number("conforms", "all criteria of the standard are met"),
        _number("status", "0: computed; otherwise the exit code of the error"),
        _number("reason", "why there are no results"),
    ),
}
# What drops on a floor have in addition, levels of the contact force apart.
FLOOR_QUANTITIES = _by_name(
    Quantity("floor_work", "floor work", "W", "J", "mJ", 1e3, 3,
             "energy that the source gives to the floor"),
    _level(ROOM_LEVEL, "L_{i,Fmax}", "maximum Fast level in the room, re 20 uPa"),
    _level("room_rating", "L_{iA,Fmax}", "A-weighted maximum Fast level in the room, re 20 uPa"),
    _level(RATING, "L'_{iA,Fmax,V,T}", "A-weighted maximum Fast level, standardised, re 20 uPa"),
)  # fmt: skip
# With those on floors, of surrogates and of their training.
ALL_QUANTITIES = {
    **SAMPLE_RESULTS,
    **{name: _level(name, "L_{FE}", _LEVEL.format("contact")) for name in CONTACT_LEVELS},
    **FLOOR_QUANTITIES,
    **_by_name(
        _number("doubtful", "the verdict could change by the errors of the surrogate"),
        _number("peaks", "number of peaks of the assessed force"),
    ),
}
