"""Sign and peak of a recorded force, and whether both are plausible."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from thud.base.checks import refuse
from thud.base.note import Note

if TYPE_CHECKING:
    from thud.recordings.signal import Signal

# Peak forces of heavy/soft sources, N: from drops of some centimeters to the tyre on stiff floors.
PEAKS = (300.0, 15000.0)
# Maximum factor beyond this range that a drop height can explain.
MAX_FACTOR = 20.0
# Factors by which a peak in another unit is wrong.
WRONG_UNITS = {"kN": 1000.0, "mN": 0.001}
# How channels of forces are chosen, for messages.
HINT = 'channels = "sum" for load cells under one plate, or channel = the force'
POLARITIES = {"positive": 1.0, "negative": -1.0}
# Minimum ratio of the peaks of both signs from which the sign is determined.
MIN_PEAK_RATIO = 1.5
# Minimum peak of a load cell of the opposite sign, as a fraction of the peak of the sum, that
# raises a warning.
MIN_OPPOSITE = 0.05
# Number of samples per read, and approximate number from which the background level is estimated.
BLOCK = 2**18
SAMPLED = 2**16


def find_peaks(signal: Signal) -> tuple[float, float]:
    """Return the largest deviations of a force above and below its background level, N.

    Raise InputError if values are not finite or all equal.
    """
    low, high = np.inf, -np.inf
    stride = max(1, signal.n_sample // SAMPLED)
    thinned = []
    for start in range(0, signal.n_sample, BLOCK):
        block = signal.read(start, min(signal.n_sample, start + BLOCK))
        low, high = min(low, float(block.min())), max(high, float(block.max()))
        thinned.append(block[-start % stride :: stride].copy())
    if low == high:
        refuse(f"{signal.name}: all samples are {low:g}", "a recording of drops")
    thin = np.concatenate(thinned)
    edge = max(1, thin.size // 100)
    # If the pulse fills the record, the background is at one end only; with many drops, overall.
    levels = [float(np.median(section)) for section in (thin[:edge], thin[-edge:], thin)]
    middle = low + (high - low) / 2
    background = max(levels, key=lambda level: abs(level - middle))
    return high - background, background - low


def orient(signal: Signal, polarity: str | None = None) -> Signal:
    """Return a signal whose compression is positive, with notes on its peak and its load cells.

    With a stated polarity it is positive already. A single load cell may be lifted, so that the
    sum decides on the sign. Raise InputError if the sign is not clear, if the peak is impossible,
    or if all samples of the signal or of a load cell are equal.
    """
    notes: list[Note] = []
    up, down = find_peaks(signal)
    if not polarity and max(up, down) < MIN_PEAK_RATIO * min(up, down):
        refuse(
            f"{signal.name}: the sign is not clear, the peaks are {up:.4g} N and {-down:.4g} N",
            "polarity = 'positive' or 'negative', the sign of a compression",
            subject="polarity",
        )
    if not polarity and down > up:
        notes.append(Note("sign_changed", signal.name, -down, unit="N"))
        cells = tuple(replace(cell, scale=-cell.scale) for cell in signal.cells)
        signal, up, down = replace(signal, scale=-signal.scale, cells=cells), down, up
    is_assumed = any(note.code == "unit_assumed" for note in signal.notes)
    notes += check_peak(up, down, signal.name, assumed=is_assumed)
    for cell in signal.cells:
        above, below = find_peaks(cell)
        if below > max(MIN_PEAK_RATIO * above, MIN_OPPOSITE * up):
            others: dict[str, float | str] = {"part": cell.name, "total": up}
            notes.append(Note("cell_sign", value=-below, unit="N", others=others))
    return replace(signal, notes=(*signal.notes, *notes))


def check_peak(peak: float, opposite: float, name: str, *, assumed: bool = False) -> list[Note]:
    """Return warnings about a peak force, N, and that of the opposite sign.

    Raise InputError if the unit must be wrong, or may be if it is `assumed`.
    """
    low, high = PEAKS
    notes = []
    if not low <= peak <= high:
        allowed = f"{low:g} to {high:g} N for heavy/soft sources"
        if assumed:
            unknown = f"{name}: the values are without a unit and reach {peak:.4g}"
            refuse(unknown, f"{allowed}, or unit")
        if low <= opposite <= high:
            cause = "the polarity is wrong, or the force does not return from its peak"
            refuse(f"{name}: the peaks are {-opposite:.4g} N and {peak:.4g} N; {cause}", allowed)
        if not low / MAX_FACTOR <= peak <= high * MAX_FACTOR:
            fitting = [unit for unit, size in WRONG_UNITS.items() if low <= peak * size <= high]
            mends = [f"unit = {unit!r}" for unit in fitting] + ["a calibration"]
            refuse(
                f"{name}: the peak is {peak:.4g} N; unit or calibration is wrong",
                f"{allowed}; {', or '.join(mends)}",
            )
        notes.append(Note("peak_unusual", name, peak, low, high, "N"))
    if opposite > MIN_PEAK_RATIO * peak:
        others = {"opposite": -opposite}
        notes.append(Note("polarity_doubtful", name, peak, unit="N", others=others))
    return notes
