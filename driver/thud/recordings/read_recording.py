"""Recorded drops of one source, from files."""

from __future__ import annotations

import os
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from thud.base.checks import require_whole
from thud.impact.ensemble import MAX_THREADS
from thud.recordings.config import Config, read_config
from thud.recordings.recording import Recording
from thud.recordings.signal_files import open_signals

if TYPE_CHECKING:
    from collections.abc import Iterable

    from thud.base._schema import LimitsSource
    from thud.recordings.checkpoint import Checkpoint


def read_recording(  # noqa: PLR0913 - the keys of the configuration
    paths: str | os.PathLike[str] | Iterable[str | os.PathLike[str]],
    *,
    height: float | None = None,
    mass: float | None = None,
    height_uncertainty: float | None = None,
    mass_uncertainty: float | None = None,
    source: LimitsSource | None = None,
    channel: int | str | None = None,
    unit: str | None = None,
    calibration: float | str | None = None,
    calibration_uncertainty: float | None = None,
    polarity: str | None = None,
    sample_rate: float | None = None,
    low_pass: bool | None = None,
    config: Config | str | os.PathLike[str] | None = None,
    progress: bool = False,
    workers: int = 1,
    keep: str | os.PathLike[str] | Checkpoint | None = None,
) -> Recording:
    """Read recorded drops of one source, from any number of files with one or many drops each.

    Parameters
    ----------
    paths
        Files; see docs/recordings_reading.md for the formats.
    height
        Drop height, m.
    mass
        Mass of the source, kg. With both, restitution follows from the impulse.
    height_uncertainty, mass_uncertainty
        Their standard uncertainties, m and kg.
    source
        Source whose limits apply, ``"rubber_ball"`` or ``"tyre"``.
    channel, unit, calibration, polarity, sample_rate
        As `open_signals` takes them.
    calibration_uncertainty
        Relative standard uncertainty of the force, wherever its calibration comes from.
    low_pass
        Whether levels are those of the force below 1.25 kHz, as in the paper.
    config
        Configuration of the laboratory, or its file; the other arguments come first.
    progress
        Show progress bars.
    workers
        Processes that measure the drops of one file. Scripts that ask for more than one run their
        own work below ``if __name__ == "__main__":``.
    keep
        Directory in which measured drops are kept while others are measured. After an interrupt
        the same call measures only what is left; files or a configuration that have changed begin
        again. At the end nothing of them is left; a `Checkpoint` has them until it is closed.

    Returns
    -------
    Recording

    Raises
    ------
    InputError
        One sentence: what cannot be read or measured.
    """
    known = config if isinstance(config, Config) else read_config(config) if config else Config()
    given: dict[str, Any] = {
        "height": height, "mass": mass, "height_uncertainty": height_uncertainty,
        "mass_uncertainty": mass_uncertainty, "source": source, "channel": channel, "unit": unit,
        "calibration": calibration, "calibration_uncertainty": calibration_uncertainty,
        "polarity": polarity, "sample_rate": sample_rate, "low_pass": low_pass,
    }  # fmt: skip
    given = {key: value for key, value in given.items() if value is not None}
    require_whole("workers", workers, 1, MAX_THREADS)
    known = replace(known, **given)
    files = [paths] if isinstance(paths, str | os.PathLike) else paths
    signals = (
        signal
        for path in files
        for signal in open_signals(
            path,
            channel=known.channel,
            unit=known.unit,
            calibration=known.calibration,
            polarity=known.polarity,
            sample_rate=known.sample_rate,
        )
    )
    return Recording.from_signals(signals, known, progress=progress, workers=workers, keep=keep)
