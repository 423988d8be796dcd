"""Declaration of a key of the input."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

Kind = Literal["real", "whole", "choice", "flag", "list", "text"]


@dataclass(frozen=True)
class Key:
    """Key as the library declares it.

    Attributes
    ----------
    owner : str
        The source model, or ``"modes"``, that uses it; empty for keys of every impact.
    group, name : str
        Namelist group and name.
    kind : str
        ``"real"``, ``"whole"``, ``"choice"``, ``"flag"``, ``"list"`` (of numbers) or ``"text"``.
    unit : str
        SI unit; empty for pure numbers.
    meaning : str
        Description.
    choices : tuple of str
        Allowed values of a choice.
    lower, upper : float or str
        Limits of the allowed range; one that depends on other keys of the group is a product or
        quotient of numbers and names of keys.
    whole : bool
        Whether it takes whole numbers only.
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
