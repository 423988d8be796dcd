"""Levels as the target of a fit."""

from __future__ import annotations

from collections.abc import Sized
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from thud.base._schema import SAMPLE_QUANTITIES
from thud.base.checks import refuse, refuse_unknown, require_choice, shown
from thud.base.immutable import Plain
from thud.impact.compute import compute
from thud.level.levels import BANDWIDTHS, FORCES, get_bands
from thud.studies.fitting.comparison import STEP, Comparison, numbers, require_positive

# Relative step of the derivatives of a contact time, which jumps by up to 1e-3 from node to node of
# finite elements.
CONTACT_STEP = 5e-2

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from thud.base._schema import BandSet, LevelsForce
    from thud.case.case import Case
    from thud.impact.impact import Impact
    from thud.studies.arrays import Array


@dataclass(frozen=True, eq=False)
class LevelTarget(Plain):
    """Levels to be fitted, and other quantities of the impact.

    Attributes
    ----------
    levels : sequence of float, shape (n_band,)
        Force exposure levels, dB.
    uncertainty : float or sequence of float or None
        Standard deviations of the levels, dB; None: one for all, estimated from the residual.
    bands : str
        ``"octave"`` or ``"third"``.
    frequencies : sequence of float or None
        Nominal mid frequencies of the levels, Hz; None: all bands.
    quantities : mapping of str to tuple of float
        Value and standard deviation of other quantities by name, such as ``"contact_time"``, in SI
        units; see `SampleQuantities`.
    force : str or None
        ``"floor"`` or ``"elastic"``: the force of the model whose levels are compared; None: the
        assessed force of the case.
    fixed : mapping of str to object
        Keys of ball, drop and model that are different for this target, such as the drop height.
    """

    levels: Sequence[float]
    uncertainty: float | Sequence[float] | None = None
    bands: BandSet = "octave"
    frequencies: Sequence[float] | None = None
    quantities: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    force: LevelsForce | None = None
    fixed: Mapping[str, object] = field(default_factory=dict)

    def compare(self) -> LevelComparison:
        """Return the comparison of an impact with the levels."""
        require_choice("bands", self.bands, BANDWIDTHS)
        if self.force is not None:
            require_choice("force", self.force, FORCES)
        nominal = get_bands(self.bands).nominal.tolist()
        frequencies = nominal
        if self.frequencies is not None:
            count = len(self.frequencies) if isinstance(self.frequencies, Sized) else 1
            frequencies = numbers("frequencies", self.frequencies, count).tolist()
        if not set(frequencies) <= set(nominal) or len(set(frequencies)) < len(frequencies):
            listed = ", ".join(f"{frequency:g}" for frequency in nominal)
            refuse(
                f"frequencies = {shown(self.frequencies)} are not allowed",
                f"nominal mid frequencies of {self.bands} bands, {listed}",
            )
        levels = numbers("levels", self.levels, len(frequencies))
        deviation = np.ones_like(levels)
        if self.uncertainty is not None:
            entries: object = self.uncertainty
            if isinstance(entries, float | int):
                entries = [entries] * len(levels)
            deviation = numbers("uncertainty", entries, len(levels))
        refuse_unknown("quantities", self.quantities, SAMPLE_QUANTITIES)
        quantities = {name: numbers(name, pair, 2) for name, pair in self.quantities.items()}
        if quantities and self.uncertainty is None:
            refuse("uncertainty of the levels is missing", "dB, above 0")
        target = np.concatenate([levels, [pair[0] for pair in quantities.values()]])
        deviation = np.concatenate([deviation, [pair[1] for pair in quantities.values()]])
        for value in deviation.tolist():
            require_positive("uncertainty", value, "dB or SI units")
        return LevelComparison(
            weighted_target=target / deviation,
            known_noise=self.uncertainty is not None,
            step=CONTACT_STEP if "contact_time" in quantities else STEP,
            bands=self.bands,
            force=self.force,
            indices=[nominal.index(f) for f in frequencies],
            extra=list(quantities),
            target=target,
            deviation=deviation,
        )


@dataclass(frozen=True, eq=False, kw_only=True)
class LevelComparison(Comparison["Impact"]):
    """Levels and other quantities, prepared for a fit; see `Comparison` for the rest.

    Attributes
    ----------
    bands : str
        ``"octave"`` or ``"third"``.
    force : str or None
        Force of the model; None: the assessed one.
    indices : list of int
        Indices of the compared bands.
    extra : list of str
        Names of the other quantities.
    target, deviation : ndarray, shape (size,)
        Compared quantities and their standard deviations, dB, s and 1.
    """

    unit = "dB"
    bands: BandSet
    force: LevelsForce | None
    indices: list[int]
    extra: list[str]
    target: Array
    deviation: Array

    def solve(self, case: Case) -> Impact:
        """Return the impact of a case."""
        return compute(case)

    def values(self, impact: Impact) -> Array:
        """Return levels, dB, and other quantities, s and 1, of an impact, shape (size,)."""
        levels = impact.levels(self.bands, force=self.force)[list(self.indices)]
        exact = {"contact_time": "exact_contact_time"}
        extra = [impact.quantity(exact.get(name, name)) for name in self.extra]
        return np.concatenate([levels, extra])

    def misfit(self, result: Impact, own: Array) -> Array:  # noqa: ARG002
        """Return model minus target over standard deviation, shape (n,)."""
        return (self.values(result) - self.target) / self.deviation

    def columns(self, result: Impact, own: Array) -> dict[str, list[object]]:  # noqa: ARG002
        """Return target and model side by side, dB, s and 1: columns by their names."""
        nominal = get_bands(self.bands).nominal
        names = [f"{nominal[i]:g} Hz" for i in self.indices]
        model = self.values(result)
        return {
            "quantity": [*names, *(name.replace("_", " ") for name in self.extra)],
            "target": self.target.tolist(),
            "uncertainty": self.deviation.tolist(),
            "model": model.tolist(),
            "residual": (model - self.target).tolist(),
        }
