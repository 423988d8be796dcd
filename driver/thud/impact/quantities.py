"""Names, units and meanings of the results of drops."""

from thud.base import _schema as schema
from thud.level.levels import BANDWIDTHS, FORCES

ROOM_LEVEL = "room_level"
RATING = "standardised_rating"
# Unit and meaning of what drops on a floor have in addition, levels of the contact force apart.
FLOOR_QUANTITIES = {
    "floor_work": ("J", "energy that the source gives to the floor"),
    ROOM_LEVEL: ("dB", "maximum Fast level in the room, re 20 uPa"),
    "room_rating": ("dB", "A-weighted maximum Fast level in the room, re 20 uPa"),
    RATING: ("dB", "A-weighted maximum Fast level, standardised, re 20 uPa"),
}
# Force and bands of the levels that a set may have, by name.
LEVELS = {
    f"{force}_level" if bands == BANDWIDTHS[0] else f"{force}_{bands}_level": (force, bands)
    for bands in BANDWIDTHS
    for force in FORCES
}
# Unit and meaning of the numbers of each set, by name.
SCALAR_QUANTITIES = {
    name: (schema.SCALARS[name][0] or "1", schema.SCALARS[name][1]) for name in schema.OUTCOMES
}
_LEVEL = "force exposure level of the {} force, re 1 N and 1 s"
# Dimensions that are bands: those of the levels, and the thirds in a room.
BANDS = (*BANDWIDTHS, ROOM_BAND := "room_third")
SET_QUANTITIES = {
    **SCALAR_QUANTITIES,
    **{name: ("dB", _LEVEL.format(force)) for name, (force, _) in LEVELS.items()},
    "margin": ("dB", "minimum distance of the judged octave levels to a limit, positive inside"),
    "conforms": ("1", "all criteria of the standard are met"),
    "status": ("1", "0: computed; otherwise the exit code of the error"),
    "reason": ("1", "why there are no results"),
}
# Bands of the levels of the contact force, by name.
CONTACT_LEVELS = {f"contact_{bands}_level": bands for bands in BANDWIDTHS}
CONTACT_LEVEL = ("dB", "force exposure level on the floor that moves, re 1 N and 1 s")
# With those on floors, of surrogates and of their training.
ALL_QUANTITIES = {
    **SET_QUANTITIES,
    **dict.fromkeys(CONTACT_LEVELS, CONTACT_LEVEL),
    **FLOOR_QUANTITIES,
    "doubtful": ("1", "the verdict could change by the errors of the surrogate"),
    "peaks": ("1", "number of peaks of the judged force"),
}
