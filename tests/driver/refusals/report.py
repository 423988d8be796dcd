"""What the calls of `report.toml` use."""

from __future__ import annotations

import json
import os
import shutil
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from conftest import REPOSITORY, SHELL, recorded
from refusals.core import write
from test_history import report

import thud
from thud.comparison.comparison import read_all
from thud.export.force_files import blocked_force
from thud.recordings.config import read_config
from thud.report.ball_history import read_history
from thud.report.recording_files import read_picture

if TYPE_CHECKING:
    from thud.recordings.config import Config
    from thud.report.ball_history import History

# What is only imported for the table.
__all__ = ["blocked_force", "os", "read_all", "read_picture"]


STANDARD = thud.solve()
TYRE = replace(SHELL, name="tyre", limits=thud.Limits("tyre"))
ROOM = thud.Room(positions="standard")
CASE = REPOSITORY / "inputs/rubber_ball_100cm.nml"
DROP = REPOSITORY / "inputs/recordings/drop_1.csv"


@cache
def below() -> thud.RoomPrediction:
    """Return the level below a floor at the positions of the standard."""
    return thud.predict_level(STANDARD, thud.Plate(thickness=0.18), ROOM)


@cache
def dropped(height: float) -> thud.Recording:
    """Return a recording of a drop of known height."""
    return recorded(STANDARD, height=height)


def laboratory(text: str) -> Config:
    """Return the configuration that a file states."""
    return read_config(write("lab.toml", text))


def copied(path: Path) -> Path:
    """Copy a file into the directory of the test, with a link to it; return its path."""
    Path("link.csv").symlink_to(path.name)
    return Path(shutil.copy(path, path.name))


def save(path: Path, content: dict[str, Any]) -> None:
    """Write a report in a directory of its own."""
    path.parent.mkdir()
    path.write_text(json.dumps(content), encoding="utf-8")


def chart(**change: Any) -> History:  # noqa: ANN401
    """Return the history by reports of which the second differs from the first."""
    save(Path("y/report.json"), report("2029-01-01"))
    save(Path("z/report.json"), report("2030-01-01", **change))
    return read_history([Path()])


def criteria(key: str, value: object) -> list[dict[str, Any]]:
    """Return the criteria of a report with a wrong entry."""
    rows: list[dict[str, Any]] = report("2030-01-01")["criteria"]
    rows[2][key] = value
    return rows
