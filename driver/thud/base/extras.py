"""Packages that only some functions need."""

from __future__ import annotations

import re
from contextlib import contextmanager
from typing import TYPE_CHECKING

from thud.base.checks import refuse

if TYPE_CHECKING:
    from collections.abc import Iterator


# Distributions that have another name than what is imported.
_DISTRIBUTIONS = {"sklearn": "scikit-learn"}


@contextmanager
def require_extra(extra: str) -> Iterator[None]:
    """Raise InputError where a package is not installed, with those of an optional extra."""
    try:
        yield
    except ModuleNotFoundError as error:
        wanted = packages(extra)
        missing = _DISTRIBUTIONS.get(str(error.name), str(error.name))
        names = wanted if missing in wanted else [missing]
        refuse(f"{missing} is not installed", f"pip install {' '.join(names)}", error)


def packages(extra: str) -> list[str]:
    """Return the names of the packages of an extra; none where thud itself is not installed."""
    from importlib.metadata import PackageNotFoundError, requires

    try:
        lines = requires("thud") or []
    except PackageNotFoundError:
        return []
    found = (re.fullmatch(rf"([\w.-]+).*extra == ['\"]{extra}['\"]", line) for line in lines)
    return [match[1] for match in found if match]
