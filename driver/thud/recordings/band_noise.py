"""Energy of the noise of drops in bands (docs/recordings_theory.md, section 4)."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.polynomial.legendre import leggauss

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from thud.level.levels import Bands
    from thud.recordings.measured_drop import Drop

# Energy of a functional, as a fraction of the largest, below which it is negligible.
NEGLIGIBLE = 1e-14
# Minimum number of sections of the background whose energy is compared with that of the fitted
# noise, and standard deviations by which it exceeds it.
MIN_GATES = 3
CHANCE = 4.0
# Maximum number of drops whose covariances are in memory at the same time.
MAX_DROPS = 64


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
    energy after its subtraction: by noise, and by quantization with a quiet background. Drops with
    equal rates share the functionals of the longest gate; drops with equal gate lengths also share
    the products of functionals.
    """
    groups: dict[float, dict[int, list[int]]] = {}
    for i, drop in enumerate(drops):
        count = drop.gate[1] - drop.gate[0]
        groups.setdefault(drop.sample_rate, {}).setdefault(count, []).append(i)
    edges = list(zip(bands.lower, bands.upper, strict=True))
    energies = np.empty((len(drops), len(edges), 3))
    for rate, gates in groups.items():
        functionals = [band_functionals(max(gates), rate, *edge) for edge in edges]
        for count, indices in gates.items():
            for k in range(0, len(indices), MAX_DROPS):
                block = indices[k : k + MAX_DROPS]
                rows = [functional[:, :count] for functional in functionals]
                energies[block] = _energies([drops[i] for i in block], rows, edges)
    return energies


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


def _energies(
    drops: Sequence[Drop],
    functionals: Sequence[NDArray[np.float64]],
    edges: Sequence[tuple[float, float]],
) -> NDArray[np.float64]:
    """Return the energies of drops with gates of one length, [n_drop, n_band, 3]."""
    contacts = [drop.contact for drop in drops]
    forces = np.array([drop.force[slice(*drop.gate)] for drop in drops])
    slow_covariance = np.array([contact.covariance for contact in contacts])
    white_variance = np.array([contact.white_variance for contact in contacts])
    further_variance = white_variance - [
        contact.background.variances[0] * contact.sample_rate / 2 for contact in contacts
    ]
    quiet = [contact.quiet_gates for contact in contacts]
    errors = [contact.quantization_errors for contact in contacts]
    energies = np.empty((len(drops), len(edges), 3))
    for band, (rows, edge) in enumerate(zip(functionals, edges, strict=True)):
        values, summed = forces @ rows.T, contacts[0].summed(rows)
        covariance = white_variance[:, None, None] * (rows @ rows.T)
        covariance += summed @ slow_covariance @ summed.T
        # What the contact has beyond the background may be the force: it is not subtracted.
        further = further_variance * (rows**2).sum()
        noise = np.trace(covariance, axis1=1, axis2=2) - further
        excess = np.array([_excess(*pair, rows) for pair in zip(quiet, covariance, strict=True)])
        covariance *= excess[:, None, None]
        noise *= excess
        squares = (covariance**2).sum(axis=(1, 2))
        # The noise in `values` makes the first term too large by twice the second, on average.
        variance = 4 * np.einsum("di,dij,dj->d", values, covariance, values) - 2 * squares
        middle = sum(edge) / 2
        density, spread = np.array([contact.background.density(middle) for contact in contacts]).T
        variance = np.maximum(variance, 2 * squares) + (noise * spread / density) ** 2
        variance += further**2
        # An error e changes the energy by 2 (R f)' R e + |R e|**2.
        changes = [error @ rows.T for error in errors]
        quantized = [
            float(((change + 2 * value) * change).sum(axis=1).std()) if len(change) else 0.0
            for change, value in zip(changes, values, strict=True)
        ]
        energies[:, band] = np.column_stack([noise, np.sqrt(variance), quantized])
    return energies
