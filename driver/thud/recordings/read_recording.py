"""Recorded drops of one source, from files."""

from __future__ import annotations

import os
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from thud.base.arguments import check_arguments
from thud.recordings.config import Config, read_config
from thud.recordings.recording import Recording
from thud.recordings.signal_files import open_signals

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from thud.base._schema import LimitsSource


@check_arguments
def read_recording(  # noqa: PLR0913 - the keys of the configuration
    paths: str | os.PathLike[str] | Iterable[str | os.PathLike[str]],
    *,
    height: float | None = None,
    mass: float | None = None,
    height_uncertainty: float | None = None,
    mass_uncertainty: float | None = None,
    source: LimitsSource | None = None,
    channel: int | str | None = None,
    channels: str | Sequence[int | str] | None = None,
    unit: str | None = None,
    calibration: float | str | Sequence[float | str] | None = None,
    calibration_uncertainty: float | None = None,
    polarity: str | None = None,
    sample_rate: float | None = None,
    drops: str | None = None,
    leave_out: Mapping[str, str] | None = None,
    begin: float | None = None,
    end: float | None = None,
    config: Config | str | os.PathLike[str] | None = None,
    progress: bool = False,
) -> Recording:
    """Measure recorded drops of one source, from files with one or more drops each.

    Parameters
    ----------
    paths
        Files; see docs/recordings_reading.md for the formats.
    height
        Drop height, m.
    mass
        Mass of the source, kg. Mass and height give the restitution by the impulse.
    height_uncertainty, mass_uncertainty
        Their standard uncertainties, m and kg.
    source
        Source whose limits apply, ``"rubber_ball"`` or ``"tyre"``.
    channel, channels, unit, calibration, polarity, sample_rate
        As for `open_signals`.
    calibration_uncertainty
        Relative standard uncertainty of the force.
    drops
        Numbers of the drops to be measured, such as ``"1-5, 8"``. They count over all files.
    leave_out
        Numbers of drops to be left out, with the reason: ``{"3": "touched"}``.
    begin, end
        Section of each file that is searched for drops, s.
    config
        Configuration of the laboratory, or its file; other arguments override it.
    progress
        Show progress bars.

    Returns
    -------
    Recording

    Raises
    ------
    InputError
        If a file cannot be read or a drop cannot be measured.
    """
    settings = config if isinstance(config, Config) else read_config(config) if config else Config()
    stated: dict[str, Any] = {
        "height": height, "mass": mass, "height_uncertainty": height_uncertainty,
        "mass_uncertainty": mass_uncertainty, "source": source, "channel": channel,
        "channels": channels, "unit": unit,
        "calibration": calibration, "calibration_uncertainty": calibration_uncertainty,
        "polarity": polarity, "sample_rate": sample_rate,
        "drops": drops, "leave_out": leave_out, "begin": begin, "end": end,
    }  # fmt: skip
    stated = {key: value for key, value in stated.items() if value is not None}
    # Either choice of channels overrides both of the configuration.
    if stated.keys() & {"channel", "channels"}:
        settings = replace(settings, channel=None, channels=None)
    if leave_out:
        stated["leave_out"] = {**settings.leave_out, **leave_out}
    settings = replace(settings, **stated)
    files = [paths] if isinstance(paths, str | os.PathLike) else paths
    signals = (signal for path in files for signal in open_signals(path, settings))
    return Recording.from_signals(signals, settings, progress=progress)
