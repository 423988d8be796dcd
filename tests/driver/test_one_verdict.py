"""One file has one peak, one set of levels and one verdict, whatever command is asked."""

from __future__ import annotations

from typing import TYPE_CHECKING

import f90nml
import numpy as np
import pytest
from conftest import INPUTS

import thud
from thud import cli

if TYPE_CHECKING:
    from pathlib import Path

    from thud.base._schema import LevelsForce

WITH_IMPACT = [path for path in INPUTS if thud.read_case(path).model]
# The batches of the shell model repeat the single solver to this part of the peak, and dB.
BATCH = 1e-9


@pytest.mark.parametrize("path", WITH_IMPACT, ids=lambda path: path.stem)
@pytest.mark.slow
@pytest.mark.usefixtures("working_directory")
def test_every_command_has_the_same_peak_levels_and_verdict(
    path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    case = thud.read_case(path)
    impact = thud.solve(case)
    levels, conformity = impact.levels(), impact.assess()

    assert cli.main(["run", "-q", "--no-figures", str(path)]) == 0
    summary = f90nml.read(f"outputs/{case.name}/summary.nml")
    peak = {"floor": "peak_force", "elastic": "peak_elastic_force"}[case.levels.force]
    assert summary["summary"][peak] == impact.peak()
    assert summary["verdict"]["value"][:5] == levels.tolist()
    assert summary["verdict"]["conforms"] == (conformity.conforms == "conforms")

    capsys.readouterr()
    assert cli.main(["compare", str(path)]) == 0
    shown = {line[:20].strip(): line[20:].strip() for line in capsys.readouterr().out.splitlines()}
    assert shown["peak force, N"] == f"{impact.peak():.0f}"
    assert [shown[f"{f:g} Hz, dB"].split()[0] for f in thud.get_bands().nominal] == [
        f"{level:.2f}" for level in levels
    ]
    # The cell of a long verdict has several lines.
    assert conformity.conforms.startswith(shown["verdict"].split("  ")[0])

    study = {"case": str(path), "parameters": {"height": {"values": [case.drop.height]}}}
    swept = thud.sweep(study).dataset
    near = BATCH if isinstance(case.model, thud.HollowSphere) else 0.0
    assert swept[peak].item() == pytest.approx(impact.peak(), rel=near, abs=0)
    np.testing.assert_allclose(
        swept[f"{case.levels.force}_octave"].values.ravel(), levels, rtol=0, atol=1e3 * near
    )
    meets_all = all(c.lower <= c.value <= c.upper for c in conformity.criteria)
    assert swept["conforms"].item() == meets_all

    drops = thud.solve_many({"height": [case.drop.height]}, case)
    assert drops.conforms[0] == meets_all
    np.testing.assert_allclose(
        getattr(drops, f"{case.levels.force}_octave")[0], levels, rtol=0, atol=1e3 * near
    )
    read = thud.read_results(f"outputs/{case.name}")
    assert (read.peak(), read.levels().tolist()) == (impact.peak(), levels.tolist())
    assert read.assess().rows() == conformity.rows()


@pytest.mark.parametrize("force", ["elastic", "floor"])
def test_fit_to_its_own_force_or_levels_finds_the_ball_again(force: LevelsForce) -> None:
    case = thud.Case(levels=thud.Levels(force=force))
    recorded = thud.solve(case)
    for target in (recorded, thud.LevelTarget(recorded.levels())):
        found = thud.fit(target, {"youngs_modulus": {"start": 1.5e6}}, case)
        assert found.case.ball.youngs_modulus == pytest.approx(1.56e6, rel=1e-6)
        impact = thud.solve(found.case)
        assert found.result.peak() == impact.peak()
        assert found.result.levels().tolist() == impact.levels().tolist()
