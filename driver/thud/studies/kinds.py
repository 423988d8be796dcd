"""Kinds of studies; the module of a kind is imported when the kind is used."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any, NamedTuple

from thud.base.checks import require_choice
from thud.base.extras import require_extra

if TYPE_CHECKING:
    from thud.studies.kind import Kind
    from thud.studies.study import Source, Study


class KindInfo(NamedTuple):
    """Help of the command of a kind of study, and whether it computes samples."""

    help: str
    has_samples: bool = True


# A key names the command, the function, and the module with the `Kind` as ``KIND``.
KINDS = {
    "sweep": KindInfo("drops over a grid, a list or a random design of parameters"),
    "sensitivity": KindInfo("Sobol indices: how much each parameter affects each result"),
    "design": KindInfo("which geometries and materials conform to the standards"),
    "uncertainty": KindInfo("effect of tolerances on levels and conformity"),
}


def get_kind(name: str) -> Kind[Any, Any]:
    """Return a kind of study by name.

    Raises InputError if it is unknown or its dependencies are missing.
    """
    require_choice("kind", name, KINDS)
    with require_extra("studies"):
        kind: Kind[Any, Any] = importlib.import_module(f"thud.studies.{name}").KIND
    return kind


def read_study(source: Source, kind: str = "sweep") -> Study:
    """Read a study.

    Parameters
    ----------
    source
        Path of a TOML file, or its content as a mapping; see docs/studies.md.
    kind
        ``"sweep"``, ``"sensitivity"``, ``"design"`` or ``"uncertainty"``.

    Returns
    -------
    Study
        The study, complete and checked.

    Raises
    ------
    InputError
        If the study is invalid; the message names file, table, key and what is allowed.
    """
    study: Study = get_kind(kind).read_study(source)
    return study
