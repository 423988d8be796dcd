"""Criteria as rows of text, for the report and the terminal."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Sequence

NOT_KNOWN = "not known"
COUNT = "peak_count"
# Title, size of the unit and decimals of each criterion that is not a level.
STYLES = {
    "contact_time": ("Contact time, ms", 1e-3, 2),
    "restitution": ("Restitution", 1.0, 3),
    COUNT: ("Peaks of the force", 1.0, 0),
    "mass": ("Mass, kg", 1.0, 3),
    "drop_height": ("Drop height, m", 1.0, 3),
}
HEAD = (
    "Criterion", "Value", "U (95 %)", "Limits", "Margin", "Spread", "Background", "Verdict",
)  # fmt: skip


class Style(NamedTuple):
    """Format of a criterion: title, size of its unit, and decimals."""

    title: str
    unit: float
    decimals: int

    def text(self, value: float | None, unknown: str = NOT_KNOWN) -> str:
        """Return a value in the unit of the criterion as text."""
        return unknown if value is None else number(value / self.unit, self.decimals)


def criterion_style(criterion: dict[str, Any]) -> Style:
    """Return the format of a criterion of a report."""
    if criterion["band"] is not None:
        return Style(f"{criterion['band']:g} Hz, dB", 1.0, 2)
    name = criterion["name"]
    unit = f", {criterion['unit']}" if criterion["unit"] else ""
    return Style(*STYLES.get(name, (name.replace("_", " ").capitalize() + unit, 1.0, 3)))


def criterion_row(criterion: dict[str, Any]) -> tuple[str, ...]:
    """Return a criterion of a report as texts, in the columns of `HEAD`."""
    style = criterion_style(criterion)
    value, margin = criterion["value"], criterion["margin"]
    bound = "at most " if criterion["upper_bound"] else ""
    ends = [f"{end / style.unit:g}".replace("-", "−") for end in limits_of(criterion)]
    mark = "" if criterion["limits_of_standard"] else " *"
    return (
        style.title,
        bound * (value is not None) + style.text(value),
        expanded_text(criterion),
        " to ".join(dict.fromkeys(ends)) + mark,
        style.text(margin, "–"),
        _width(style, criterion["spread"], "–"),
        style.text(criterion["background"], "–"),
        criterion["verdict"],
    )


def criterion_rows(criteria: Sequence[dict[str, Any]]) -> list[tuple[str, ...]]:
    """Return the criteria of a report as rows of text below `HEAD`."""
    return [HEAD, *map(criterion_row, criteria)]


def limits_of(criterion: dict[str, Any]) -> tuple[float, float]:
    """Return minimum and maximum of a criterion."""
    return criterion["lower"], criterion["upper"]


def expanded_text(criterion: dict[str, Any]) -> str:
    """Return the expanded uncertainty; a dash if there is none, "not stated" if unknown."""
    if criterion["name"] == COUNT or criterion["value"] is None:
        return "–"
    if not criterion["contributions"]:
        return "not stated"
    return _width(criterion_style(criterion), criterion["expanded_uncertainty"], NOT_KNOWN)


def number(value: float, decimals: int) -> str:
    """Return a number as text, with a typographic minus sign and no negative zero.

    >>> number(-1.004, 1)
    '−1.0'
    """
    return f"{value:z.{decimals}f}".replace("-", "−")


def _width(style: Style, value: float | None, unknown: str) -> str:
    """Return the width of an interval as text, with one decimal more than a value."""
    return style._replace(decimals=style.decimals + 1).text(value, unknown)
