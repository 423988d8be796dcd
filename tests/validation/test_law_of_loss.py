"""The damping laws against an independent element code."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

import thud

if TYPE_CHECKING:
    from collections.abc import Callable

STUDY = Path(__file__).parents[2] / "inputs/studies/law_of_loss.toml"

# Quadratic elements at large strain, its finest mesh, each law at the restitution 0.805: order,
# contact time, ms, and octaves of 63, 250 and 500 Hz, dB.
REFERENCE = np.array(
    [
        [0.15, 19.64, 30.67, 17.87, 9.82],
        [0.3, 19.66, 30.74, 17.69, 10.14],
        [0.5, 19.65, 30.86, 17.65, 10.64],
        [0.7, 19.56, 31.00, 17.79, 11.25],
        [1.0, 19.27, 31.34, 17.94, 12.14],
    ]
)


def test_band_of_the_laws_is_that_of_the_independent_code(
    oracle: Callable[..., None], curve: Callable[..., None]
) -> None:
    found = thud.sweep(STUDY).dataset
    # The study says so; its loss factors have four digits.
    np.testing.assert_allclose(found["restitution"], 0.805, atol=0.002)
    found = found.set_index(sample="fractional_order").sel(sample=REFERENCE[:, 0])
    # Release is a glancing contact: two samples of the record, and the digits of the reference.
    np.testing.assert_allclose(1e3 * found["contact_time"], REFERENCE[:, 1], atol=0.06)
    levels = found["floor_octave"].sel(octave=[63, 250, 500])
    # The default mesh, and four digits of the loss factor.
    oracle(
        "damping laws by quadratic elements: 63, 250 and 500 Hz",
        "independent code",
        levels - REFERENCE[:, 2:],
        0.08,
        "dB",
    )
    for place, octave in enumerate((63, 250, 500)):
        curve(
            "damping laws",
            f"{octave} Hz: quadratic elements",
            REFERENCE[:, 0],
            REFERENCE[:, 2 + place],
        )
        curve("damping laws", f"{octave} Hz: thud", REFERENCE[:, 0], levels.sel(octave=octave))
