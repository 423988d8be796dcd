"""Energy of the noise of drops in bands (docs/recordings_theory.md, section 4)."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.polynomial.legendre import leggauss

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from thud.level.levels import Bands
    from thud.recordings.contact import Contact
    from thud.recordings.measured_drop import Drop

# Energy of a functional, as a fraction of the largest, below which it is negligible.
NEGLIGIBLE = 1e-14
# Minimum number of sections of the background whose energy is compared with that of the fitted
# noise, and standard deviations by which it exceeds it.
MIN_GATES = 3
CHANCE = 4.0
# Gates share the functionals of the next multiple of this number of samples.
GATE_LENGTH = 256


@lru_cache(maxsize=64)
def band_functionals(count: int, rate: float, lower: float, upper: float) -> NDArray[np.float64]:
    """Return functionals of samples whose squares add up to the energy in a band, [n, count].

    They are the eigenvectors of the energy times the square roots of their eigenvalues. About two
    times duration times bandwidth eigenvalues are not negligible.
    """
    time = (np.arange(count) - (count - 1) / 2) / rate
    nodes, weights = leggauss(12 + int(2 * (upper - lower) * count / rate))
    frequency = (lower + upper) / 2 + (upper - lower) / 2 * nodes
    phase = 2 * np.pi * frequency[:, None] * time
    scale = np.sqrt((upper - lower) * weights)[:, None] / rate
    waves = np.concatenate([scale * np.cos(phase), scale * np.sin(phase)])
    _, size, rows = np.linalg.svd(waves, full_matrices=False)
    significant = size**2 > NEGLIGIBLE * size[0] ** 2
    return np.asarray(size[significant, None] * rows[significant])


def band_noise(drops: Sequence[Drop], bands: Bands) -> NDArray[np.float64]:
    """Return energies of the noise within the gates in bands, N2 s, [n_drop, n_band, 3].

    The last axis holds the expected energy of the noise, and the standard deviations of the force's
    energy after its subtraction: by noise, and by quantization with a quiet background.
    """
    edges = list(zip(bands.lower, bands.upper, strict=True))
    energies = np.empty((len(drops), len(edges), 3))
    for i, drop in enumerate(drops):
        quiet, errors = drop.contact.quiet_gates, drop.contact.quantization_errors
        for k, edge in enumerate(edges):
            energies[i, k] = _energies(drop.contact, quiet, errors, *edge)
    return energies


def _energies(
    contact: Contact,
    quiet: NDArray[np.float64],
    errors: NDArray[np.float64],
    lower: float,
    upper: float,
) -> tuple[float, float, float]:
    """Return the energy of the noise in a band, N2 s, and the deviations of that of the force.

    `quiet` are sections of the background, `errors` those of the force by quantization, N.
    """
    force, rate, background = contact.gated, contact.sample_rate, contact.background
    length = GATE_LENGTH * math.ceil(len(force) / GATE_LENGTH)
    rows = band_functionals(length, rate, lower, upper)[:, : len(force)]
    values, covariance = rows @ force, contact.covariance_of(rows)
    # What the contact has beyond the background may be the force: it is not subtracted.
    further = contact.white_variance - background.variances[0] * rate / 2
    further *= float((rows**2).sum())
    excess = _excess(quiet, covariance, rows)
    noise = excess * (float(np.trace(covariance)) - further)
    covariance *= excess
    squares = float((covariance**2).sum())
    # The noise in `values` makes the first term too large by twice the second, on average.
    variance = max(4 * float(values @ covariance @ values) - 2 * squares, 2 * squares)
    density, spread = background.density((lower + upper) / 2)
    variance += (noise * spread / density) ** 2 + further**2
    # An error e changes the energy by 2 (R f)' R e + |R e|**2.
    changes = errors @ rows.T
    quantized = ((changes + 2 * values) * changes).sum(axis=1)
    return noise, math.sqrt(variance), float(quantized.std()) if len(quantized) else 0.0


def _excess(
    gates: NDArray[np.float64], covariance: NDArray[np.float64], rows: NDArray[np.float64]
) -> float:
    """Return the energy of the background in sections over that of the fitted noise in the gate.

    It is 1 unless the former is larger by more than chance: the background is no noise of the fit.
    """
    if len(gates) < MIN_GATES:
        return 1.0
    expected = float(np.trace(covariance))
    deviation = math.sqrt(2 * float((covariance**2).sum()) / len(gates))
    energy = float(((gates @ rows.T) ** 2).sum()) / len(gates)
    return energy / expected if energy > expected + CHANCE * deviation else 1.0
