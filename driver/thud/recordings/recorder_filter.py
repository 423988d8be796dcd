"""The low-pass filter of a recorder or amplifier before sampling."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from thud.base.checks import refuse
from thud.base.note import Note
from thud.base.units import frequency_text
from thud.recordings.config_values import Choice, Number, Table, key

if TYPE_CHECKING:
    from numpy.typing import NDArray

KINDS = ("bessel", "butterworth")
MAX_ORDER = 12
# Response at the highest corrected frequency: there the correction amplifies the noise by 3.
LOWEST_RESPONSE = 1 / 3
# If no filter is stated, it is assumed to be at worst a Bessel filter of this order whose cutoff is
# this fraction of the sample rate.
ASSUMED_ORDER = 4
ASSUMED_CUTOFF = 0.25


@dataclass(frozen=True)
class RecorderFilter(Table):
    """The low-pass filter of the recorder or amplifier, which is corrected."""

    title = "filter: "
    kind: str = key(
        Choice((*KINDS, "none")), "Bessel or Butterworth; none if its response is flat in the bands"
    )
    order: int | None = key(Number(1, MAX_ORDER, whole=True), "order")
    cutoff: float = key(Number(1.0, 1e9, "Hz"), "cutoff at -3 dB", math.nan)
    cutoff_uncertainty: float | None = key(
        Number(0.0, 0.5), "relative standard uncertainty of the cutoff"
    )

    def __post_init__(self) -> None:
        """Raise InputError if a value is not allowed, or one is missing."""
        super().__post_init__()
        self.require("kind")
        if self.kind != "none":
            self.require("order", "cutoff")
        elif len(self.stated) > 1:
            refuse("filter: kind = 'none' has an order or a cutoff", "kind alone, or another kind")

    def response(self, frequency: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Return the ratio of output and input, at frequencies in Hz."""
        # SciPy is slow to import, and a configuration is read by every command.
        from scipy.signal import bessel, butter, freqs_zpk

        if self.kind == "bessel":
            zpk = bessel(self.order, self.cutoff, analog=True, output="zpk", norm="mag")
        else:
            zpk = butter(self.order, self.cutoff, analog=True, output="zpk")
        return np.asarray(freqs_zpk(*zpk, worN=frequency)[1])

    @property
    def highest(self) -> float:
        """Highest corrected frequency, Hz."""
        frequency = self.cutoff * np.geomspace(1, 8, 400)
        falling = np.abs(self.response(frequency))[::-1]
        return float(np.interp(LOWEST_RESPONSE, falling, frequency[::-1]))

    def note(self, sample_rate: float) -> Note:
        """Return a note on the correction at a sample rate, Hz."""
        highest = min(self.highest, sample_rate / 2)
        return Note(
            "filter_corrected", value=self.cutoff, high=highest, unit="Hz",
            others={"kind": self.kind.capitalize(), "order": self.order or 0},
        )  # fmt: skip

    def require_above(self, edge: float) -> None:
        """Raise InputError if the response is below 1/3 at the highest edge of bands, Hz."""
        if self.highest < edge:
            refuse(
                f"filter: the cutoff, {frequency_text(self.cutoff)}, is too low for the bands, "
                f"which reach up to {frequency_text(edge)}: the response falls to 1/3 at "
                f"{frequency_text(self.highest)}",
                f"{frequency_text(self.cutoff * edge / self.highest)} or more",
            )

    def shifted(self) -> RecorderFilter:
        """Return the filter with a cutoff that is higher by its standard uncertainty."""
        return replace(self, cutoff=self.cutoff * (1 + (self.cutoff_uncertainty or 0.0)))


def assumed_filter(sample_rate: float) -> RecorderFilter:
    """Return the filter with the strongest attenuation that is assumed if none is stated."""
    return RecorderFilter("bessel", ASSUMED_ORDER, ASSUMED_CUTOFF * sample_rate)
