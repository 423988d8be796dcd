"""A background that lies within one step of quantization."""

from __future__ import annotations

from typing import TYPE_CHECKING

from thud.base.note import Note

if TYPE_CHECKING:
    from thud.recordings.contact import Contact
    from thud.recordings.drops import Section

# Standard deviation of the offset as a fraction of the peak: 0.03 dB at 31.5 Hz.
MAX_OFFSET = 5e-4


def check(section: Section, contact: Contact) -> tuple[Note, ...]:
    """Return a warning if the quantization of a background makes its offset uncertain."""
    del section
    quantization = contact.background.quantization
    if quantization.offset < MAX_OFFSET * contact.peak:
        return ()
    others = {"step": quantization.step}
    return (Note("coarse_steps", value=quantization.offset, unit="N", others=others),)
