"""Input of a run: the groups of a namelist file, read and written with f90nml."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import TYPE_CHECKING, TypeAlias, TypeVar

import f90nml
import numpy as np

from thud.base._schema import (
    FLOORS,
    GROUPS,
    KEYS,
    MODELS,
    STANDARD_BALL,
    Ball,
    Compression,
    Drop,
    FloorOptions,
    Levels,
    Limits,
    ModalBall,
    ModelOptions,
    Modes,
    Room,
    Sampling,
    Unknowns,
)
from thud.base.bridge import ask, text
from thud.base.checks import (
    MAX_NUMBER,
    refuse,
    refuse_unknown,
    refuse_value,
    require_choice,
    require_kind,
    shown,
)
from thud.base.display import Displayed
from thud.base.errors import InputError
from thud.base.files import replace_file
from thud.base.key import Group, require_keywords

if TYPE_CHECKING:
    from dataclasses import Field
    from typing import Any, Self

GroupType = TypeVar("GroupType", bound=Group)
# Values by group and key, as f90nml has them.
Namelist: TypeAlias = "Mapping[str, Mapping[str, object]]"
# Names of the keys that take lists of numbers or texts.
LISTS = {key.name for key in KEYS if key.kind in {"list", "texts"}}
# Source model of a case that names none.
DEFAULT_MODEL = ModalBall
# Optional groups of an impact, and all optional groups of a case.
IMPACT_GROUPS: dict[str, type[Group]] = {
    "compression": Compression,
    "unknowns": Unknowns,
    "room": Room,
}
OPTIONAL_GROUPS: dict[str, type[Group]] = {"modes": Modes, **IMPACT_GROUPS}


def group_of(model: str, option: Field[Any]) -> str:
    """Return the namelist group of an option of a model."""
    group: str = option.metadata.get("group", model)
    return group


def new_model(model: str | ModelOptions | None, options: Mapping[str, object]) -> ModelOptions:
    """Return the options of a model by its name, by default those of the first one.

    Raise InputError if a name is not known.
    """
    if isinstance(model, ModelOptions):
        if options:
            problem = f"model is an object of {type(model).__name__}, with {', '.join(options)}"
            refuse(problem, "options in the object, or as keywords with the name of a model")
        return model
    model = DEFAULT_MODEL.name if model is None else model
    require_choice("&model: name", model, MODELS)
    require_keywords(f"&{model}", options, [option.name for option in fields(MODELS[model])])
    return MODELS[model](**options)  # type: ignore[arg-type]


@dataclass(frozen=True, eq=False, repr=False)
class Case(Group, Displayed):
    """Input of one run.

    Attributes
    ----------
    name : str
        Name of the case, also of its output directory.
    model : HollowSphere, ModalBall, FiniteElement, MeasuredModes, HuntCrossley, TwoMass or None
        Options of the source model, by default `ModalBall()`; None: no impact.
    modes : Modes or None
        Options of the free modes; None: no free modes.
    floor : FloorOptions or None
        Floor on which the ball is dropped in addition to the rigid floor; None: no other floor.
    room : Room or None
        Room below the floor; None: no level in a room.
    compression : Compression or None
        Options of the quasi-static compression by the source model; None: no compression.
    unknowns : Unknowns or None
        What is not known of the source; None: the calibrated set of the standard ball, which
        `assess` has for finite elements and the modal ball.
    ball, drop, sampling, levels, limits
        The other namelist groups.
    """

    name: str = "python"
    ball: Ball = field(default_factory=Ball)
    drop: Drop = field(default_factory=Drop)
    model: ModelOptions | None = field(default_factory=DEFAULT_MODEL)
    sampling: Sampling = field(default_factory=Sampling)
    levels: Levels = field(default_factory=Levels)
    limits: Limits = field(default_factory=Limits)
    modes: Modes | None = None
    floor: FloorOptions | None = None
    room: Room | None = None
    compression: Compression | None = None
    unknowns: Unknowns | None = None

    def __repr__(self) -> str:
        """Return what is computed."""
        model = self.model.name if isinstance(self.model, ModelOptions) else ""
        modes = "free modes" if self.modes else ""
        floor = f"on {getattr(self.floor, 'name', None)}" if self.floor else ""
        room = "room below" if self.room else ""
        press = "quasi-static compression" if self.compression else ""
        return f"<Case {self.name}: {', '.join(filter(None, (model, floor, modes, room, press)))}>"

    def rows(self) -> list[tuple[str, ...]]:
        """Return header and rows of text."""
        units = {(key.owner or key.group, key.name): key.unit for key in KEYS}
        rows: list[tuple[str, ...]] = [("group", "key", "value", "unit")]
        for group, entries in vars(self.resolved()).items():
            if isinstance(entries, Group):
                owner = str(getattr(entries, "name", group))
                for key, value in vars(entries).items():
                    rows.append((owner, key, str(value), units[owner, key]))
        return rows

    def resolved(self) -> Self:
        """Return the case with the values of the standard ball by its model where keys are None."""
        name = self.model.name if self.model else ""
        model = self.model and _resolved(self.model, name)
        return replace(self, ball=_resolved(self.ball, name), model=model)

    def to_namelist(self) -> Namelist:
        """Return the case as a namelist, which prints as the text of a file.

        It has every key but those of the standard ball that are None.

        Raise InputError if a value is not a number, a text or, if the key takes a list, a list of
        numbers.
        """
        for group, kind in GROUPS.items():
            require_kind(group, getattr(self, group), kind)
        require_kind("model", self.model, ModelOptions | None)
        require_kind("floor", self.floor, FloorOptions | None)
        for group, optional in OPTIONAL_GROUPS.items():
            require_kind(group, getattr(self, group), optional | None)
        groups: dict[str, dict[str, object]] = {
            "case": {"name": self.name},
            "ball": vars(self.ball),
        }
        if self.modes:
            groups["modes"] = vars(self.modes)
        if self.model:
            groups["model"] = {"name": self.model.name}
            groups |= {group: vars(getattr(self, group)) for group in GROUPS}
            for option in fields(self.model):
                values = groups.setdefault(group_of(self.model.name, option), {})
                values[option.name] = getattr(self.model, option.name)
        if self.floor:
            groups["floor"] = {"name": self.floor.name}
            groups |= {self.floor.name: options} if (options := vars(self.floor)) else {}
        groups |= {
            group: vars(options) for group in IMPACT_GROUPS if (options := getattr(self, group))
        }
        namelist = f90nml.Namelist()
        model = self.model.name if self.model else ""
        for group, options in groups.items():
            is_source = group not in {*FLOORS, "room"}
            plain = {
                key: _plain(group, key, value)
                for key, value in options.items()
                if value is not None or not is_source or (model, key) not in STANDARD_BALL
            }
            namelist[group] = {key: value for key, value in plain.items() if value != []}
        result: Namelist = namelist
        return result

    @classmethod
    def from_text(cls, content: str) -> Self:
        """Return the case in the text of a namelist file; missing keys have their default."""
        return cls.from_namelist(f90nml.reads(content))

    @classmethod
    def from_namelist(cls, namelist: Namelist) -> Self:
        """Return the case in a namelist; missing keys have their default."""
        content: dict[str, Any] = dict(namelist)
        groups = {
            group: kind(**content[group]) for group, kind in GROUPS.items() if group in content
        }
        optional: dict[str, Any] = {
            group: kind(**_with_lists(content[group]))
            for group, kind in IMPACT_GROUPS.items()
            if group in content
        }
        model = modes = None
        if "modes" in content:
            modes = Modes(**content["modes"])
        if "model" in content or not modes:
            name = content.get("model", {}).get("name", DEFAULT_MODEL.name)
            kind = MODELS[name]
            options = {}
            for option in fields(kind):
                entries = content.get(group_of(kind.name, option), {})
                if option.name in entries:
                    options[option.name] = entries[option.name]
            model = new_model(name, _with_lists(options))
        floor = None
        if "floor" in content:
            name = content["floor"].get("name", next(iter(FLOORS)))
            floor = FLOORS[name](**_with_lists(content.get(name, {})))
        name = content.get("case", {}).get("name", cls.name)
        return cls(name=name, model=model, floor=floor, modes=modes, **groups, **optional)


def _resolved(group: GroupType, model: str) -> GroupType:
    """Return a group with the values of the standard ball by a model where keys are None."""
    values = {
        name: STANDARD_BALL[model, name]
        for name, value in vars(group).items()
        if value is None and (model, name) in STANDARD_BALL
    }
    return replace(group, **values)  # type: ignore[type-var]


def tables_case(tables: Mapping[str, Any]) -> Case:
    """Return the case in tables of keys by group, such as those of JSON or TOML.

    Raise InputError if a group, or the name of model or floor, is not known, or a group is not a
    table; `check_case` checks the values.
    """
    refuse_unknown("the case", tables, {key.group for key in KEYS} | {"model", "floor"})
    for group, keys in tables.items():
        if not isinstance(keys, Mapping):
            refuse(f"&{group} = {shown(keys)} is not a table", "keys and their values")
        known = [key.name for key in KEYS if key.group == group]
        refuse_unknown(f"&{group}", keys, known or ["name"])
    for group, choices in (("model", MODELS), ("floor", FLOORS)):
        if group in tables:
            require_choice(f"&{group}: name", tables[group].get("name"), list(choices))
    return Case.from_namelist(tables)


def _with_lists(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return values of keys as read by `f90nml`; single values of list keys become tuples."""
    return {
        key: (tuple(value) if isinstance(value, list) else (value,)) if key in LISTS else value
        for key, value in values.items()
    }


def _plain(group: str, key: str, value: object) -> float | str | list[float | str]:
    """Return a value converted to a type that f90nml can write."""
    if isinstance(value, np.generic | np.ndarray):
        value = value.tolist()
    if isinstance(value, list | tuple) and key in LISTS:
        return [_plain(group, key, entry) for entry in value]  # type: ignore[misc]
    is_plain = isinstance(value, int | float) or (isinstance(value, str) and value.isprintable())
    if not is_plain or (isinstance(value, int) and abs(value) > MAX_NUMBER):
        refuse_value(f"&{group}: {key}", value, "a number or plain text")
    return value  # type: ignore[return-value]


def case_text(case: Case) -> bytes:
    """Return the text of the namelist file of a case, for the library."""
    return f"{case.to_namelist()}\n".encode(errors="surrogateescape")


def impact_only(case: Case) -> Case:
    """Return a case without free modes, compression and unknowns, which an impact does not use.

    `free_modes`, `compress` and `assess` use them; fits and studies may compute drops outside the
    ranges of the unknowns.
    """
    return replace(case, modes=None, compression=None, unknowns=None)


def read_case(path: str | os.PathLike[str]) -> Case:
    """Read a case, with every key, from a namelist file.

    Raises
    ------
    InputError
        If the input is invalid; the message names file, group, key, value and allowed range.
    """
    return Case.from_text(text(ask("effective_case", path=os.fsencode(path))["case"]))


def check_case(case: Case) -> None:
    """Raise InputError with the message of the library if a case is invalid."""
    ask("check", case=case_text(case))


def is_portable_name(name: object) -> bool:
    """Whether a value is a name for files that any system can hold, as the library knows them."""
    if not isinstance(name, str) or not name.isprintable() or name != name.strip():
        return False
    try:
        check_case(Case(name=name))
    except InputError:
        return False
    return True


def write_case(case: Case, path: str | os.PathLike[str]) -> None:
    """Write a case as a namelist file, atomically.

    Parameters
    ----------
    case
        The case.
    path
        Path of the file; an existing file is replaced.

    Raises
    ------
    InputError
        If the case has a value that is not allowed; nothing is written.
    OSError
        If the file cannot be written.
    """
    check_case(case)
    replace_file(path, case_text(case))
