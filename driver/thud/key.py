"""One key of the input."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

Kind = Literal["real", "whole", "choice", "flag", "list", "text"]


@dataclass(frozen=True)
class Key:
    """What the library declares of a key.

    Attributes
    ----------
    owner : str
        The source model, or ``"modes"``, that uses it; empty where every impact does.
    group, name : str
        Namelist group and name.
    kind : str
        ``"real"``, ``"whole"``, ``"choice"``, ``"flag"``, ``"list"`` (of numbers) or ``"text"``.
    unit : str
        SI unit; empty for pure numbers.
    meaning : str
        What it means.
    choices : tuple of str
        What a choice may be.
    lower, upper : float or str
        Ends of the allowed range of numbers; an end that depends on other keys of the group is a
        product or quotient of numbers and their names.
    whole : bool
        It takes whole numbers.
    """

    owner: str
    group: str
    name: str
    kind: Kind = "real"
    unit: str = ""
    meaning: str = ""
    choices: tuple[str, ...] = ()
    lower: float | str = -math.inf
    upper: float | str = math.inf
    whole: bool = False
