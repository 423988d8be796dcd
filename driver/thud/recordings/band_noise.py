"""Energy of a band and of the noise in it, of many drops (docs/recordings_theory.md, section 4)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.polynomial.legendre import leggauss

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from thud.level.levels import Bands
    from thud.recordings.measured_drop import Drop

# Functionals whose energy is less than this part of the largest one add nothing.
NEGLIGIBLE = 1e-14
# Drops whose covariances are in memory at once.
AT_ONCE = 64


def band_functionals(count: int, rate: float, lower: float, upper: float) -> NDArray[np.float64]:
    """Return functionals of samples whose squares add up to the energy in a band, [n, count].

    They are the eigenvectors of the band's energy times the root of their eigenvalues: of about
    two times time times band width, all others are zero.
    """
    time = (np.arange(count) - (count - 1) / 2) / rate
    nodes, weights = leggauss(12 + int(2 * (upper - lower) * count / rate))
    frequency = (lower + upper) / 2 + (upper - lower) / 2 * nodes
    phase = 2 * np.pi * frequency[:, None] * time
    scale = np.sqrt((upper - lower) * weights)[:, None] / rate
    waves = np.concatenate([scale * np.cos(phase), scale * np.sin(phase)])
    _, size, rows = np.linalg.svd(waves, full_matrices=False)
    kept = size**2 > NEGLIGIBLE * size[0] ** 2
    return np.asarray(size[kept, None] * rows[kept])


def band_noise(drops: Sequence[Drop], bands: Bands) -> NDArray[np.float64]:
    """Return energies of the noise of the gates in bands, N2 s, [n_drop, n_band, 2].

    The expected energy, and the standard deviation of the energy of the force when that is
    subtracted from what is measured. Drops of one rate share the functionals of the longest gate,
    and those with gates of one length their products.
    """
    alike: dict[float, dict[int, list[int]]] = {}
    for place, drop in enumerate(drops):
        count = drop.gate[1] - drop.gate[0]
        alike.setdefault(drop.sample_rate, {}).setdefault(count, []).append(place)
    edges = list(zip(bands.lower, bands.upper, strict=True))
    found = np.empty((len(drops), len(edges), 2))
    for rate, gates in alike.items():
        functionals = [band_functionals(max(gates), rate, *edge) for edge in edges]
        for count, places in gates.items():
            for k in range(0, len(places), AT_ONCE):
                some = places[k : k + AT_ONCE]
                rows = [one[:, :count] for one in functionals]
                found[some] = _energies([drops[place] for place in some], rows, edges)
    return found


def _energies(
    drops: Sequence[Drop],
    functionals: Sequence[NDArray[np.float64]],
    edges: Sequence[tuple[float, float]],
) -> NDArray[np.float64]:
    """Return what `band_noise` does of drops with gates of one length, [n_drop, n_band, 2]."""
    contacts = [drop.contact for drop in drops]
    forces = np.array([drop.force[slice(*drop.gate)] for drop in drops])
    slow = np.array([one.covariance for one in contacts])
    white = np.array([one.background.variances[0] * one.sample_rate / 2 for one in contacts])
    found = np.empty((len(drops), len(edges), 2))
    for band, (rows, edge) in enumerate(zip(functionals, edges, strict=True)):
        values, summed = forces @ rows.T, contacts[0].summed(rows)
        covariance = white[:, None, None] * (rows @ rows.T) + summed @ slow @ summed.T
        noise = np.trace(covariance, axis1=1, axis2=2)
        squares = (covariance**2).sum(axis=(1, 2))
        # The first term is too large by twice the second, on the mean.
        variance = 4 * np.einsum("di,dij,dj->d", values, covariance, values) - 2 * squares
        middle = sum(edge) / 2
        density, spread = np.array([one.background.density(middle) for one in contacts]).T
        variance = np.maximum(variance, 2 * squares) + (noise * spread / density) ** 2
        found[:, band] = np.column_stack([noise, np.sqrt(variance)])
    return found
