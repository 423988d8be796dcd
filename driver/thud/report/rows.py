"""Criteria as rows of text, for the report and the terminal."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from thud.base._schema import VERDICTS
from thud.level.estimate import NORMAL_FACTOR
from thud.level.levels import get_bands
from thud.recordings.instruments import AMPLITUDE_DECIBEL

if TYPE_CHECKING:
    from collections.abc import Sequence

    from thud.base.key import Quantity
    from thud.level.estimate import Estimate
    from thud.recordings.recording import Recording
    from thud.report.contents import ReportCriterion

NOT_KNOWN = "not known"
COUNT = "peak_count"
HEAD = (
    "Criterion", "Value", "U (95 %)", "Limits", "Margin", "P (outside)", "Spread", "Background",
    "Verdict",
)  # fmt: skip
# Significant digits of an uncertainty, and the width below which it is shown as zero.
DIGITS, MIN_WIDTH = 2, 1e-6
# Maximum of the degrees of freedom that are shown: above, Student's t differs by less than 0.1 %.
MAX_FREEDOM = 1000.0
# Contribution that is unknown if only one drop has a value, and mark of an uncertainty without it
# or without contributions that are not stated.
SCATTER = "scatter between drops"
INCOMPLETE = "†"


def capital(text: str) -> str:
    """Return a text with a capital."""
    return text[:1].upper() + text[1:]


def criterion_row(entry: ReportCriterion) -> tuple[str, ...]:
    """Return a criterion of a report as texts, in the columns of `HEAD`.

    Value and margin have the decimals of U with two significant digits (JCGM 100, 7.2.6). A U that
    lacks contributions is marked; `excluded_text` names them.
    """
    criterion, expanded = entry.criterion, expanded_text(entry)
    quantity = criterion.quantity
    scale = quantity.display_scale
    has_budget = expanded[-1].isdigit()
    return (
        capital(quantity.label),
        entry_text(entry),
        f"{expanded} {INCOMPLETE}" if entry.excluded else expanded,
        criterion.shown_limits.replace("-", "−") + " *" * entry.has_own_limits,
        _text(entry.margin, scale, _decimals_of(quantity, entry.expanded)),
        risk_text(criterion.probability) if has_budget else "–",
        "–" if math.isnan(entry.spread) else width_text(entry.spread * scale),
        _text(entry.background, scale, quantity.decimals),
        criterion.conforms,
    )


def drop_table(recording: Recording) -> list[tuple[str, ...]]:
    """Return a row of text for each drop: first touch, contact, restitutions, peak and levels.

    The number after ± is the standard uncertainty due to the noise of the drop.
    """
    drops, levels = recording.drops, recording.average().drops.level.tolist()
    methods = [*dict.fromkeys(method for drop in drops for method in drop.restitutions)]
    restitutions = [f"restitution by {method} (± u)" for method in methods] or ["restitution"]
    head = ("drop", "at, s", "contact, ms (± u)", *restitutions, "peak, N")
    rows: list[tuple[str, ...]] = [(*head, *(f"{f:g} Hz, dB" for f in get_bands().nominal))]
    rows += [
        (
            drop.name,
            number(drop.onset, 3),
            _with_u(drop.contact_time, 1e3, 3),
            *(_with_u(drop.restitutions.get(method), 1.0, 4) for method in methods or [""]),
            _text(drop.peak_force.value, 1.0, 0),
            *(_text(level, 1.0, 2) for level in own),
        )
        for drop, own in zip(drops, levels, strict=True)
    ]
    return rows


def _with_u(estimate: Estimate | None, scale: float, decimals: int) -> str:
    if estimate is None or math.isnan(estimate.value):
        return NOT_KNOWN
    numbers = (estimate.value, estimate.uncertainty)
    return " ± ".join(number(scale * value, decimals) for value in numbers)


def entry_text(entry: ReportCriterion) -> str:
    """Return the value of a criterion as text; see `value_text`."""
    estimate = entry.criterion.estimate
    quantity = entry.criterion.quantity
    return value_text(quantity, estimate.value, entry.expanded, is_bound=estimate.upper_bound)


def value_text(quantity: Quantity, value: float, expanded: float, *, is_bound: bool) -> str:
    """Return a value with the decimals of its expanded uncertainty, as text."""
    if math.isnan(value):
        return NOT_KNOWN
    text = _text(value, quantity.display_scale, _decimals_of(quantity, expanded))
    return f"at most {text}" if is_bound else text


def _text(value: float, scale: float, decimals: int) -> str:
    """Return a value in another unit as text; a dash if there is none."""
    return "–" if math.isnan(value) else number(value * scale, decimals)


def risk_text(probability: float) -> str:
    """Return the probability that the true value lies outside the limits, as text.

    >>> risk_text(0.9871), risk_text(1.0), risk_text(1e-5)
    ('1.3 %', '< 0.01 %', '> 99.9 %')
    """
    if math.isnan(probability):
        return "–"
    percent = 100 * (1 - probability)
    if percent >= 99.95:  # noqa: PLR2004
        return "> 99.9 %"
    return "< 0.01 %" if percent < 0.01 else f"{percent:.{2 if percent < 1 else 1}f} %"  # noqa: PLR2004


def reason_text(entries: Sequence[ReportCriterion]) -> str:
    """Return the criteria that are undecided or not met, and whether U is incomplete."""
    parts = []
    for verdict in VERDICTS[1:]:
        matching = [entry.criterion for entry in entries if entry.criterion.conforms == verdict]
        if names := [criterion.quantity.title for criterion in matching]:
            parts.append(f"{verdict}: {', '.join(names)}")
    parts = parts or ["all criteria are met"]
    if any(entry.excluded for entry in entries):
        parts.append(f"U is incomplete where it is marked {INCOMPLETE}")
    return "; ".join(parts)


def excluded_text(entries: Sequence[ReportCriterion], name: str = "U") -> str:
    """Return what the marked uncertainties lack, as a sentence; empty if none is marked.

    `name` is what the sentence calls the uncertainty.
    """
    names = list(dict.fromkeys(name for entry in entries for name in entry.excluded))
    lacking = [name for name in names if name != SCATTER]
    parts = [f"{', '.join(lacking)} (uncertainty not stated: undecided)"] if lacking else []
    parts += [f"{SCATTER} (unknown from one drop)"] if SCATTER in names else []
    if not parts:
        return ""
    decided = list(filter(None, map(_allowance_text, entries)))
    allowed = (
        f" Stated standard uncertainties that decide: {'; '.join(decided)}." if decided else ""
    )
    return f"{INCOMPLETE} {name} excludes {'; '.join(parts)}.{allowed}"


def _allowance_text(entry: ReportCriterion) -> str:
    """Return with which uncertainty of what is not stated a criterion is decided, if any."""
    criterion, lacking = entry.criterion, [name for name in entry.excluded if name != SCATTER]
    if not lacking or not criterion.allowance:
        return ""
    quantity = criterion.quantity
    size = f"{criterion.allowance * quantity.display_scale:.2g} {quantity.display_unit}".rstrip()
    if lacking == ["calibration"] and criterion.unit == "dB":
        percent = 100 * criterion.allowance / AMPLITUDE_DECIBEL
        size = f"{percent:.2g} % of calibration (U {NORMAL_FACTOR * percent:.2g} %)"
    return f"{quantity.title} {criterion.conforms_if_stated} up to {size}"


def expanded_text(entry: ReportCriterion) -> str:
    """Return the expanded uncertainty; a dash if there is none, "not stated" if unknown."""
    criterion = entry.criterion
    if criterion.name == COUNT or math.isnan(criterion.value):
        return "–"
    if not criterion.estimate.contributions:
        return "not stated"
    if not math.isfinite(entry.expanded):
        return NOT_KNOWN
    return width_text(entry.expanded * criterion.quantity.display_scale)


def _decimals_of(quantity: Quantity, expanded: float) -> int:
    """Return the decimals of an expanded uncertainty, or those of its quantity."""
    width = expanded * quantity.display_scale
    return _decimals(width) if MIN_WIDTH < width < math.inf else quantity.decimals


def width_text(width: float) -> str:
    """Return the width of an interval with two significant digits as text.

    >>> width_text(0.0996), width_text(1234.0)
    ('0.10', '1200')
    """
    return number(width, _decimals(width)) if width > MIN_WIDTH else "0"


def _decimals(width: float) -> int:
    """Return the number of decimals that leaves two significant digits of a width."""
    exponent = math.floor(math.log10(float(f"{width:.{DIGITS - 1}e}")))
    return DIGITS - 1 - exponent


def freedom_text(freedom: float) -> str:
    """Return degrees of freedom as text, with the digits that give k again.

    >>> freedom_text(4.0), freedom_text(4.5678)
    ('4', '4.568')
    """
    if freedom == math.inf:
        return "∞"
    return f"> {MAX_FREEDOM:g}" if freedom > MAX_FREEDOM else f"{freedom:.4g}"


def number(value: float, decimals: int) -> str:
    """Return a number as text, with a typographic minus sign and no negative zero.

    >>> number(-1.004, 1)
    '−1.0'
    """
    return f"{round(value, decimals):z.{max(decimals, 0)}f}".replace("-", "−")
