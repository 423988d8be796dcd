"""Level of the tapping machine below a floor (ISO 12354-2), for comparison with ball levels."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, TypeGuard

import numpy as np

from thud.base._schema import Plate, Room
from thud.base.bridge import ask
from thud.base.checks import refuse, refuse_value, require_kind
from thud.base.display import Tabulated
from thud.case.case import Case, case_text
from thud.case.constructions import Construction, with_floor

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from thud.base._schema import FloorOptions
    from thud.base.display import Columns


# Rounded mid frequencies of the one-third-octave bands 50 to 3150 Hz; bands from 100 Hz are rated.
FREQUENCY = np.array(
    [50, 63, 80, 100, 125, 160, 200, 250, 315, 400, 500, 630, 800, 1000, 1250, 1600, 2000, 2500,
     3150], dtype=float,
)  # fmt: skip
RATED = slice(3, None)
# Reference curve from 100 to 3150 Hz, dB (ISO 717-2), its value at 500 Hz, and the maximum sum of
# levels above the curve.
CURVE = np.array([62, 62, 62, 62, 62, 62, 61, 60, 59, 58, 57, 54, 51, 48, 45, 42], dtype=float)
AT_500, MAX_EXCESS = 60, 32.0
# Wave speed divided by density of concrete, m4/(kg s), which the constant of the formula includes.
CONCRETE = 3500 / 2300
# Maximum factor by which this quotient may differ; the factor changes the level by 1 dB.
MAX_RATIO = 1.26


@dataclass(frozen=True, eq=False, repr=False)
class TappingLevel(Tabulated):
    """Normalized level of the tapping machine below a homogeneous floor, in bands.

    Attributes
    ----------
    frequency : ndarray, shape (19,)
        Rounded mid frequencies of the one-third-octave bands 50 to 3150 Hz.
    level : ndarray, shape (19,)
        L_n, dB re 20 uPa, for an absorption of 10 m2.
    """

    drawn_by: ClassVar[str] = "room_figures.draw_tapping"

    frequency: NDArray[np.float64]
    level: NDArray[np.float64]

    @property
    def weighted(self) -> int:
        """L_n,w, dB: value at 500 Hz of the shifted reference curve of ISO 717-2."""
        excess = self._tenths - 10 * CURVE
        # Start with a shift at which every excess exceeds the allowed sum.
        shift = int(np.floor(excess.min() / 10 - MAX_EXCESS))
        while np.maximum(excess - 10 * shift, 0).sum() > 10 * MAX_EXCESS:
            shift += 1
        return AT_500 + shift

    @property
    def adaptation(self) -> int:
        """Spectrum adaptation term C_I, dB, from 100 to 2500 Hz (ISO 717-2 annex A)."""
        # Without the band 3150 Hz.
        total = 10 * np.log10((10 ** (self._tenths[:-1] / 100)).sum())
        return int(np.floor(total + 0.5)) - 15 - self.weighted

    @property
    def _tenths(self) -> NDArray[np.float64]:
        """Rated levels in tenths of a decibel, rounded half up (ISO 717-2)."""
        return np.asarray(np.floor(10 * self.level[RATED] + 0.5))

    def columns(self) -> Columns:
        """Return the levels."""
        return {"band, Hz": (self.frequency, "g"), "L_n, dB": (self.level, ".1f")}

    def __repr__(self) -> str:
        """Return weighted level and adaptation term."""
        return f"<TappingLevel: L_n,w {self.weighted} dB, C_I {self.adaptation} dB>"


def tapping_level(floor: Plate | Construction | str, room: Room | None = None) -> TappingLevel:
    """Return the level of the tapping machine below a homogeneous concrete floor.

    L_n = 155 - 30 lg m'' + 10 lg T_s + 10 lg sigma + 10 lg(f/1000 Hz) with T_s = 2.2/(f eta)
    (ISO 12354-2 annex B). Radiation factor sigma and loss factor eta are those of `predict_level`.
    The constant includes density and wave speed of concrete. The floor is the bare plate, without
    flanking walls.

    Parameters
    ----------
    floor
        The plate, or a construction or the name of one.
    room
        Room without a ceiling, of which only the properties of air are used; by default `Room()`.

    Raises
    ------
    InputError
        If the floor is not a bare plate like concrete, or its keys are out of range.

    Examples
    --------
    >>> import thud
    >>> thud.tapping_level(thud.Plate(thickness=0.2))
    <TappingLevel: L_n,w 73 dB, C_I -11 dB>
    """
    require_kind("room", room, Room | None)
    require_kind("floor", floor, Plate | Construction | str)
    case = with_floor(Case(room=room or Room()), floor)
    plate = case.floor
    if not isinstance(plate, Plate):
        refuse_value("floor", floor, "a bare plate of concrete")
    if obstacle := _obstacle(plate, case.room or Room()):
        refuse(*obstacle)
    result = ask("floor_modes", case=case_text(case), frequency=FREQUENCY)["plate"]
    time = 2.2 / (FREQUENCY * result["loss_factor"])
    radiated = time * result["radiation_factor"] * FREQUENCY / 1000
    level = 155 - 30 * np.log10(result["surface_mass"]) + 10 * np.log10(radiated)
    return TappingLevel(FREQUENCY, level)


def has_tapping_level(floor: FloorOptions, room: Room) -> TypeGuard[Plate]:
    """Whether `tapping_level` applies: to a bare isotropic plate similar to concrete."""
    return isinstance(floor, Plate) and not _obstacle(floor, room)


def _obstacle(floor: Plate, room: Room) -> tuple[str, str] | None:
    """Return why the formula does not apply, and to what it does; None if it applies."""
    formula, ratio = "the formula of ISO 12354-2 is for", floor.wave_speed / floor.density
    if not 1 / MAX_RATIO <= ratio / CONCRETE <= MAX_RATIO:
        allowed = f"{CONCRETE / MAX_RATIO:.2f} to {CONCRETE * MAX_RATIO:.2f} m4/(kg s)"
        return f"floor: wave_speed/density = {ratio:.3g}, but {formula} concrete", allowed
    ratios = floor.stiffness_ratio, floor.torsion_ratio
    if ratios != (1, 1):
        stated = "floor: stiffness_ratio = {:g} and torsion_ratio = {:g}".format(*ratios)
        return f"{stated}, but {formula} isotropic floors", "1 and 1"
    layers = {
        "a floating floor": floor.screed_thickness,
        "a covering": floor.covering_stiffness or any(floor.covering_improvement),
        "a subceiling": floor.subceiling_thickness,
        "a ceiling": room.ceiling_mass,
    }
    names = " and ".join(name for name, value in layers.items() if value)
    bare = "plates without floating floor, covering, subceiling and ceiling"
    return (f"{formula} bare plates, but this one has {names}", bare) if names else None
