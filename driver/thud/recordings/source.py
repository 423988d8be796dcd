"""Sources of a force: impacts of a model and recordings."""

from __future__ import annotations

from thud.base.checks import require_kind
from thud.impact.impact import Impact


def require_source(name: str, value: object) -> None:
    """Raise InputError unless a value is an impact or a recording."""
    if isinstance(value, Impact):
        return
    # Recordings import SciPy, which takes longer than many impacts.
    from thud.recordings.recording import Recording

    require_kind(name, value, Impact | Recording)
