"""Figures of the inputs of the repository: studies, fits, floors, rooms, validation."""

from __future__ import annotations

import json
import runpy
from functools import cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import thud
from thud.plot import floor_steps, plate_modes
from thud.plot.fit_figures import confidence
from thud.studies.fit import run_fit

if TYPE_CHECKING:
    from collections.abc import Callable

    from matplotlib.figure import Figure

REPOSITORY = Path(__file__).parents[2]
INPUTS = REPOSITORY / "inputs"
STUDIES = INPUTS / "studies"


@cache
def study(kind: str, name: str) -> Any:  # noqa: ANN401 - of any kind
    """Return the result of a study."""
    run = run_fit if kind == "fit" else getattr(thud, kind)
    return run(STUDIES / f"{name}.toml")


@cache
def surrogate() -> thud.Surrogate:
    """Return the surrogate of the standard ball; its training takes minutes and is kept."""
    return thud.surrogate(STUDIES / "flagship.toml", REPOSITORY / "outputs/flagship")


def flagship_design() -> Figure:
    """Draw the map of wall and modulus by the surrogate, whose file the study reads."""
    surrogate()
    figure: Figure = study("design", "flagship_design").plot()
    return figure


@cache
def prediction() -> thud.RoomPrediction:
    """Return the prediction of single positions on the page on rooms."""
    return thud.predict_level(floor=thud.Plate(thickness=0.18), room=thud.Room(volume=50.0))


def floating_floor() -> Figure:
    """Draw the first prediction of the page on rooms."""
    room = thud.Room(volume=50.0, required=49.0, rating="octaves")
    return thud.predict_level(floor="concrete 210, Korean apartment floor", room=room).plot()


@cache
def floors() -> thud.FloorComparison:
    """Return the comparison of three slabs."""
    paths = {f"concrete, {mm} mm": INPUTS / f"floors/concrete_{mm}.nml" for mm in (140, 180, 220)}
    return thud.compare_floors({name: thud.read_case(path) for name, path in paths.items()})


def validation_figures() -> dict[str, Callable[[], Figure]]:
    """Return the figures of the page on validation by name."""
    page = runpy.run_path(str(REPOSITORY / "docs/site/validation.py"))
    curves = json.loads(page["RECORD"].read_text(encoding="utf-8"))["curves"]
    return {name: partial(draw, curves[key]) for name, (draw, key) in page["FIGURES"].items()}


RESULTS: dict[str, Callable[[], Figure]] = {
    "construction": lambda: thud.construction(
        "CLT 160, gravel, screed on 10 MN/m3, ceiling"
    ).plot(),
    "fit_confidence": lambda: confidence(study("fit", "fit_force")),
    "fit_force": lambda: study("fit", "fit_force").plot(),
    "fit_recording": lambda: study("fit", "fit_recording").plot(),
    "fit_recording_constant_loss": lambda: study("fit", "fit_recording_constant_loss").plot(),
    "floor_modes": lambda: plate_modes(prediction().floor),
    "floors": lambda: floors().plot(),
    "floors_steps": lambda: floor_steps(floors()),
    "law_of_loss": lambda: study("sweep", "law_of_loss").plot(),
    "modal_room": lambda: thud.modal_room(prediction()).plot(),
    "room_levels": lambda: thud.read_room_levels(
        INPUTS / "floors/field_levels.csv", volume=41.4
    ).plot(),
    "room_prediction": floating_floor,
    "study_design": lambda: study("design", "design").plot(),
    "study_flagship_design": flagship_design,
    "study_floor_design": lambda: study("design", "floor_design").plot(),
    "study_sensitivity": lambda: study("sensitivity", "sensitivity").plot(),
    "study_surrogate": lambda: surrogate().plot(),
    "study_sweep": lambda: study("sweep", "sweep").plot(),
    "study_uncertainty": lambda: study("uncertainty", "uncertainty").plot(),
    **validation_figures(),
}
