"""Level of the tapping machine below a floor, for reference beside the ball's (ISO 12354-2)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeGuard

import numpy as np

from thud.base._schema import Plate, Room
from thud.base.bridge import ask
from thud.base.checks import refuse, require_kind
from thud.base.display import Displayed
from thud.case.case import Case, case_text

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from thud.base._schema import FloorOptions


# One-third-octave bands 50 to 3150 Hz: rounded mid frequencies; those from 100 Hz on are rated.
FREQUENCY = np.array(
    [50, 63, 80, 100, 125, 160, 200, 250, 315, 400, 500, 630, 800, 1000, 1250, 1600, 2000, 2500,
     3150], dtype=float,
)  # fmt: skip
RATED = slice(3, None)
# Reference curve from 100 to 3150 Hz, dB (ISO 717-2), its value at 500 Hz, and the allowed sum of
# the excesses.
CURVE = np.array([62, 62, 62, 62, 62, 62, 61, 60, 59, 58, 57, 54, 51, 48, 45, 42], dtype=float)
AT_500, MAX_EXCESS = 60, 32.0
# Ratio of wave speed, m/s, and density, kg/m3, of concrete, which the constant of the formula
# includes, and the factor by which that of a floor may differ, which changes the level by 1 dB.
CONCRETE, MAX_RATIO = 3500 / 2300, 1.26


@dataclass(frozen=True, eq=False, repr=False)
class TappingLevel(Displayed):
    """Normalized level of the tapping machine below a homogeneous floor, in bands.

    Attributes
    ----------
    frequency : ndarray, shape (19,)
        Rounded mid frequencies of the one-third-octave bands 50 to 3150 Hz.
    level : ndarray, shape (19,)
        L_n, dB re 20 uPa, for an absorption of 10 m2.
    """

    frequency: NDArray[np.float64]
    level: NDArray[np.float64]

    @property
    def weighted(self) -> int:
        """L_n,w, dB: the reference curve of ISO 717-2 shifted by whole decibels."""
        excess = self._tenths - 10 * CURVE
        # From where every excess is above the allowed sum.
        shift = int(np.floor(excess.min() / 10 - MAX_EXCESS))
        while np.maximum(excess - 10 * shift, 0).sum() > 10 * MAX_EXCESS:
            shift += 1
        return AT_500 + shift

    @property
    def adaptation(self) -> int:
        """Spectrum adaptation term C_I, dB, from 100 to 2500 Hz (ISO 717-2 annex A)."""
        # Without that of 3150 Hz.
        total = 10 * np.log10((10 ** (self._tenths[:-1] / 100)).sum())
        return int(np.floor(total + 0.5)) - 15 - self.weighted

    @property
    def _tenths(self) -> NDArray[np.float64]:
        """Rated levels to one decimal, a half rounded up (ISO 717-2), in tenths of a decibel."""
        return np.asarray(np.floor(10 * self.level[RATED] + 0.5))

    def rows(self) -> list[tuple[str, ...]]:
        """Return header and rows of text, a band each."""
        result = zip(self.frequency, self.level, strict=True)
        return [("band, Hz", "L_n, dB"), *((f"{f:g}", f"{level:.1f}") for f, level in result)]

    def __repr__(self) -> str:
        """Return the single numbers."""
        return f"<TappingLevel: L_n,w {self.weighted} dB, C_I {self.adaptation} dB>"


def tapping_level(floor: Plate, room: Room | None = None) -> TappingLevel:
    """Return the level of the tapping machine below a homogeneous concrete floor.

    L_n = 155 - 30 lg m'' + 10 lg T_s + 10 lg sigma + 10 lg(f/1000 Hz), T_s = 2.2/(f eta), with the
    radiation and losses of the prediction of heavy impacts (ISO 12354-2 annex B). The constant
    includes density and wave speed of concrete; the floor is the bare plate, without floating
    floor, ceiling or flanking walls.

    Parameters
    ----------
    floor
        A plate.
    room
        Room whose air is used (default: that of `Room`).

    Raises
    ------
    InputError
        If the floor is no plate, or out of range.

    Examples
    --------
    >>> import thud
    >>> thud.tapping_level(thud.Plate(thickness=0.2))
    <TappingLevel: L_n,w 71 dB, C_I -11 dB>
    """
    require_kind("floor", floor, Plate)
    if not _is_near_concrete(floor):
        refuse(
            f"floor: wave_speed/density = {floor.wave_speed / floor.density:.3g} is not that of "
            "concrete, for which the formula of ISO 12354-2 is valid",
            f"{CONCRETE / MAX_RATIO:.2f} to {CONCRETE * MAX_RATIO:.2f} m4/(kg s)",
        )
    if not _is_isotropic(floor):
        refuse(
            f"floor: stiffness_ratio = {floor.stiffness_ratio:g} and torsion_ratio = "
            f"{floor.torsion_ratio:g}, but the formula of ISO 12354-2 is for isotropic floors",
            "1 and 1",
        )
    require_kind("room", room, Room | None)
    case = Case(floor=floor, room=room or Room())
    result = ask("radiator", case=case_text(case), frequency=FREQUENCY)
    time = 2.2 / (FREQUENCY * result["loss_factor"])
    radiated = time * result["radiation_factor"] * FREQUENCY / 1000
    level = 155 - 30 * np.log10(result["surface_mass"]) + 10 * np.log10(radiated)
    return TappingLevel(FREQUENCY, level)


def has_tapping_level(floor: FloorOptions) -> TypeGuard[Plate]:
    """Whether `tapping_level` is for a floor: an isotropic plate, near concrete."""
    return isinstance(floor, Plate) and _is_near_concrete(floor) and _is_isotropic(floor)


def _is_near_concrete(floor: Plate) -> bool:
    return 1 / MAX_RATIO <= floor.wave_speed / floor.density / CONCRETE <= MAX_RATIO


def _is_isotropic(floor: Plate) -> bool:
    return (floor.stiffness_ratio, floor.torsion_ratio) == (1, 1)
