"""Requirements of the standard on the force plate."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from thud.base.note import Note
from thud.level.estimate import NORMAL_FACTOR
from thud.recordings.instruments import FLAT, TOLERANCE

if TYPE_CHECKING:
    from thud.recordings.instruments import Plate

# Maximum force that a plate must measure, N.
RANGE = 5000.0
# What is not known of a plate without some keys.
UNKNOWN = {
    "flat above": {"what": f"response at {FLAT[0]:g} Hz", "keys": "time_constant"},
    "flat below": {"what": f"response up to {FLAT[1]:g} Hz", "keys": "f0, f0_uncertainty"},
    "range": {"what": "measuring range", "keys": "full_scale"},
    "linear": {"what": "linearity", "keys": "linearity"},
}


def check_plate(plate: Plate | None) -> dict[str, tuple[bool | None, Note]]:
    """Check a plate by the standard: flat from 0.2 to 1000 Hz, 0 to 5000 N, linear within 2 %.

    Return whether each requirement is met (None if unknown), and a note on it, by requirement:
    ``"flat above"`` (0.2 Hz), ``"flat below"`` (1000 Hz), ``"range"``, ``"linear"``. The resonance
    of the plate is corrected: what counts is the uncertainty of its frequency. Nothing is checked
    if no plate is stated.
    """
    if plate is None:
        return {}
    known: dict[str, tuple[bool | None, Note]] = {}
    low, high = FLAT
    if plate.time_constant:
        # A high-pass of first order.
        loss = 1 - 1 / math.hypot(1, 1 / (2 * math.pi * low * plate.time_constant))
        known["flat above"] = loss <= TOLERANCE, _note(
            "plate_low", 100 * loss, frequency=low, time_constant=plate.time_constant,
            needed=1 / (2 * math.pi * low * math.sqrt((1 - TOLERANCE) ** -2 - 1)),
        )  # fmt: skip
    if plate.f0_uncertainty:
        # Expanded uncertainty of the resonance, in both directions.
        shift = NORMAL_FACTOR * plate.f0_uncertainty
        frequency = np.linspace(0.0, high, 1001)
        shifted = np.array([plate.response(frequency / (1 + sign * shift)) for sign in (-1, 1)])
        deviation = np.abs(np.abs(shifted / plate.response(frequency)) - 1).max()
        known["flat below"] = (
            bool(deviation <= TOLERANCE),
            _note("plate_high", 100 * deviation, frequency=high, f0=plate.f0, shift=100 * shift),
        )
    if plate.full_scale:
        note = _note("plate_range", plate.full_scale, "N", required=RANGE)
        known["range"] = plate.full_scale >= RANGE, note
    if plate.linearity:
        applied, indicated = np.array(plate.linearity).T
        # The best line through zero; relative deviations give small forces as much weight.
        ratio = indicated / applied
        deviations = np.abs(ratio / ratio.mean() - 1)
        worst = int(np.argmax(deviations))
        is_linear = bool(deviations[worst] <= TOLERANCE)
        # Forces below those of the standard can only show that it is not.
        met = None if is_linear and applied.max() < RANGE else is_linear
        known["linear"] = met, _note(
            "plate_linear", 100 * deviations[worst], first=applied.min(), last=applied.max(),
            worst=applied[worst],
        )  # fmt: skip
    return {
        name: known.get(name, (None, _note("plate_unknown", math.nan, **unknown)))
        for name, unknown in UNKNOWN.items()
    }


def _note(code: str, value: float, unit: str = "%", **others: float | str) -> Note:
    return Note(code, "force plate", float(value), unit=unit, others=others)
