"""Unknowns of a case: files, messages, distributions."""

from __future__ import annotations

import subprocess
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.stats import truncnorm

import thud
from thud.studies.unknowns import Unknown

if TYPE_CHECKING:
    from pathlib import Path

FRICTION = thud.Unknowns(("friction", "fractional_order"), (0.0, 0.2), (0.5, 1.0),
                         reason=("it's dry", "not measured"))  # fmt: skip
COARSE = thud.FiniteElement(radial_elements=2, polar_elements=16)
ELEMENTS = thud.Case(model=COARSE, unknowns=FRICTION)


def test_unknowns_survive_files(tmp_path: Path, executable: str) -> None:
    case = replace(ELEMENTS, unknowns=replace(FRICTION, standard_deviation=(0.1, 0)))
    thud.write_case(case, tmp_path / "case.nml")
    assert thud.read_case(tmp_path / "case.nml").unknowns == case.unknowns
    subprocess.run([executable, "case.nml"], cwd=tmp_path, check=True, capture_output=True)
    (echo,) = tmp_path.glob("outputs/*/effective.nml")
    assert thud.read_case(echo).unknowns == case.unknowns


def test_normal_distribution_is_truncated_and_a_wide_one_uniform() -> None:
    fractions = np.linspace(0, 1, 11)
    expected = truncnorm.ppf(fractions, (1.95 - 2.1) / 0.1, (2.3 - 2.1) / 0.1, 2.1, 0.1)
    found = Unknown("youngs_modulus", 1.95, 2.3, 0.1, "").quantiles(fractions, 2.1)
    np.testing.assert_allclose(found, expected, rtol=1e-9)
    for deviation in (2e3, 1e18):
        values = Unknown("mass", 2.0, 3.0, deviation, "").quantiles(fractions, 2.5)
        np.testing.assert_allclose(values, 2 + fractions, rtol=1e-6)


def test_studies_and_fits_may_leave_the_ranges_of_unknowns() -> None:
    unknowns = thud.Unknowns(key=("mass",), low=(2.4,), high=(2.6,), reason=("scales",))
    case = thud.Case(unknowns=unknowns)
    swept = thud.sweep({"case": case.to_namelist(), "parameters": {"mass": {"values": [1.0, 2.0]}}})
    assert not swept.dataset["status"].any()
