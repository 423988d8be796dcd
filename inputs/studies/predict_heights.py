"""Levels of a fitted ball at other drop heights, with the spread of the fit.

.venv/bin/python inputs/studies/predict_heights.py outputs/fit_recording

reads fit.json and fitted.nml of fits. The spread is that of linear propagation: derivatives of the
levels times the covariance of the parameters. The truth is that of make_recording.py.
"""

from __future__ import annotations

import json
import sys
from dataclasses import fields, replace
from pathlib import Path

import numpy as np

import thud
from thud.impact.compute import compute

HEIGHTS = (0.1, 1.0, 1.6)  # m
# Relative step of the derivatives: it averages over the release of single nodes of the mesh.
STEP = 5e-3
TRUTH = Path(__file__).parents[1] / "rubber_ball_fe_viscous.nml"


def levels(case: thud.Case, height: float, factors: dict[str, float] | None = None) -> np.ndarray:
    """Return octave levels, dB, of a case at a height, keys of ball and model times factors."""
    groups = {"ball": case.ball, "model": replace(case.model, snapshot_interval=0.0)}
    for name, factor in (factors or {}).items():
        group = next(g for g, kind in groups.items() if name in {f.name for f in fields(kind)})
        value = getattr(groups[group], name)
        groups[group] = replace(groups[group], **{name: value * factor})
    return compute(replace(case, drop=replace(case.drop, height=height), **groups)).levels()


def main() -> None:
    """Print levels, standard deviations and truth."""
    truth = thud.read_case(TRUTH)
    head = "".join(f"{nominal:>14g}" for nominal in thud.get_bands().nominal)
    print(f"{'':<34}{head} Hz")
    for height in HEIGHTS:
        print(
            f"{f'{height:g} m, truth':<34}" + "".join(f"{x:>14.2f}" for x in levels(truth, height))
        )
        for folder in map(Path, sys.argv[1:]):
            found = json.loads((folder / "fit.json").read_text(encoding="utf-8"))
            case = thud.read_case(folder / "fitted.nml")
            names = [
                name for name in found["parameters"] if not name.startswith(("time_shift", "gain"))
            ]
            values = np.array([found["parameters"][name]["value"] for name in names])
            covariance = np.array(found["covariance"], dtype=float)[: len(names), : len(names)]
            slopes = np.column_stack(
                [
                    (levels(case, height, {n: 1 + STEP}) - levels(case, height, {n: 1 - STEP}))
                    for n in names
                ]
            ) / (2 * STEP * values)
            spread = np.sqrt(np.einsum("bi,ij,bj->b", slopes, covariance, slopes))
            row = zip(levels(case, height), spread, strict=True)
            cells = "".join(f"{f'{x:.2f} ± {s:.3f}':>14}" for x, s in row)
            print(f"{f'{height:g} m, {folder.name}':<34}{cells}", flush=True)


if __name__ == "__main__":
    main()
