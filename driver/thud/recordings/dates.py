"""Dates in the forms that files and laboratories write."""

from __future__ import annotations

from datetime import datetime

DATE_FORMATS = ("%d.%m.%Y", "%Y/%m/%d", "%Y:%m:%d", "%d-%b-%y", "%d-%b-%Y", "%d %b %Y")
TIME_FORMATS = ("", " %H:%M:%S", " %H:%M")


def read_date(text: str) -> datetime | None:
    """Return a date written in ISO 8601 or one of the other known formats; None if in none.

    >>> read_date("03.05.2024").date().isoformat()
    '2024-05-03'
    """
    line = " ".join(text.split())
    try:
        return datetime.fromisoformat(line).replace(tzinfo=None)
    except ValueError:
        pass
    for form in (date + time for date in DATE_FORMATS for time in TIME_FORMATS):
        try:
            return datetime.strptime(line, form)  # noqa: DTZ007 - files state no time zone
        except ValueError:
            continue
    return None
