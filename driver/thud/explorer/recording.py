"""Answer of recorded drops for the page, and their calibration report."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from thud.base.checks import refuse
from thud.base.toml_tables import read_toml
from thud.explorer.answer import common_answer
from thud.explorer.criteria import largest_contribution
from thud.explorer.decisive import decisive_warnings
from thud.explorer.recording_fields import TABLES
from thud.impact.contact_time import contact_force
from thud.recordings.config import config_from
from thud.recordings.instruments import ASSUMED_SHARE
from thud.recordings.recording import read_recording
from thud.recordings.signal import open_signals
from thud.report.contents import report_criteria, report_data
from thud.report.page import report_page
from thud.report.recording_files import draw_figures
from thud.report.rows import INCOMPLETE, entry_text, excluded_text, expanded_text

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from thud.level.assessment import Verdict
    from thud.recordings.config import Config
    from thud.recordings.recording import Recording

# Ending of the name of the file on laboratory, instruments and calibration.
LABORATORY = ".toml"


def answer_recording(paths: Sequence[str], table: Mapping[str, Any]) -> dict[str, Any]:
    """Return the answer of recorded drops of one source.

    `paths` are copies of the files with their names, in one folder, and `table` is a table of the
    configuration. Its values replace those of a file of the laboratory among the files.
    """
    recording = read_copies(paths, table)
    verdict = recording.assess()
    answer = common_answer(recording, verdict, *contact_force(recording, "floor"))
    rows = report_criteria(recording)
    for entry, row in zip(answer["criteria"], rows, strict=True):
        entry["value_text"] = entry_text(row)
        entry["uncertainty_text"] = expanded_text(row)
        entry["mark"] = INCOMPLETE if row.excluded else ""
    answer["excluded"] = excluded_text(rows, "The uncertainty")
    answer["largest"] = largest_contribution(verdict) or ()
    answer["limits"]["assumed"] = "source" not in table
    answer["drops"] = len(recording.drops)
    answer["asks"] = _asks(recording, verdict)
    answer["warnings"] = [note.message for note in recording.notes if note.is_warning]
    decisive = decisive_warnings(recording.notes, verdict.criteria)
    answer["open_warnings"] = [note.message for note in decisive]
    return answer


def calibration_report(paths: Sequence[str], table: Mapping[str, Any]) -> str:
    """Return the page with the calibration report of recorded drops, as `answer_recording`."""
    recording = read_copies(paths, table)
    return report_page(report_data(recording), (draw_figures(recording) or {}).values())


def read_copies(paths: Sequence[str], table: Mapping[str, Any]) -> Recording:
    """Return the recording in copies of files, whose folder becomes the working directory.

    So messages name the files without the folder. Raise InputError if they are no recording.
    """
    os.chdir(Path(paths[0]).parent)
    names = [Path(path).name for path in paths]
    recorded = [name for name in names if not _is_laboratory(name)]
    config = _config_of([name for name in names if _is_laboratory(name)], table)
    if not recorded:
        refuse(f"{names[0]}: is the file of a laboratory", "together with recordings")
    signals = (signal for name in recorded for signal in open_signals(name, config))
    return replace(read_recording(signals, config=config), name=Path(recorded[0]).stem)


def _is_laboratory(name: str) -> bool:
    return Path(name).suffix.lower() == LABORATORY


def _config_of(paths: Sequence[str], table: Mapping[str, Any]) -> Config:
    """Return the configuration of files of a laboratory, at most one, and of a table."""
    if len(paths) > 1:
        refuse(f"{', '.join(paths)}: are {len(paths)} files of laboratories", "one")
    stated: dict[str, Any] = {}
    for path in paths:
        stated, _ = read_toml(Path(path))
        # Its errors name the file.
        config_from(stated, path)
    both = {
        name: {**stated[name], **table[name]} for name in TABLES if name in stated and name in table
    }
    config = config_from({**stated, **table, **both})
    if config.report.accreditation_mark:
        refuse("accreditation_mark cannot be sent by a page", "thud-driver measure")
    return config


def _asks(recording: Recording, verdict: Verdict) -> list[dict[str, Any]]:
    """Return the fields that change the verdict and are not stated, with estimates.

    Each has the code of the reason and what this is about: the frequency at which the plate rings,
    Hz, or the title of a level.
    """
    config = recording.config
    ringing = next((drop.ringing for drop in recording.drops if drop.ringing), None)
    result: list[dict[str, Any]] = []
    if ringing:
        frequency = f"{ringing.frequency:.0f}"
        values = {"plate_f0": frequency, "plate_Q": f"{ringing.quality:.2g}"}
        result.append({"code": "plate_rings", "subject": frequency, "values": values})
    title, contribution = largest_contribution(verdict) or ("", "")
    if contribution == ASSUMED_SHARE:
        result.append({"code": "share_assumed", "subject": title, "values": {"plate_share": ""}})
    missing = [name for name in ("height", "mass") if getattr(config, name) is None]
    if missing:
        result.append({"code": "missing", "subject": "", "values": dict.fromkeys(missing, "")})
    return result
