"""Input of a run: the groups of a namelist file, read and written with f90nml."""

from __future__ import annotations

import os
from dataclasses import dataclass, field, fields, replace
from typing import TYPE_CHECKING, TypeAlias

import f90nml

from thud.base._schema import (
    FLOORS,
    GROUPS,
    KEYS,
    MODELS,
    OPTIONAL_GROUPS,
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
from thud.base.bridge import ask
from thud.base.checks import refuse, refuse_unknown, require_choice, require_kind, suggestion
from thud.base.files import replace_file
from thud.base.immutable import Immutable
from thud.base.toml_tables import require_table

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping
    from typing import Any, Self

    from thud.base.key import Group, Key

# Values by group and key, as f90nml has them.
Namelist: TypeAlias = "Mapping[str, Mapping[str, object]]"
# Names of the keys by namelist group.
_NAMES: dict[str, list[str]] = {}
for _key in KEYS:
    _NAMES.setdefault(_key.group, []).append(_key.name)


def attribute_of(key: Key) -> str:
    """Return the name of the attribute of a `Case` that holds a key, or would hold it."""
    return "model" if key.owner in MODELS else "floor" if key.owner in FLOORS else key.group


_ATTRIBUTES = [(key, attribute_of(key)) for key in KEYS]


def new_model(model: str | ModelOptions | None, options: Mapping[str, object]) -> ModelOptions:
    """Return the options of a model by its name, by default those of the first one.

    Raise InputError if a name is not known.
    """
    if isinstance(model, ModelOptions):
        if options:
            problem = f"model is an object of {type(model).__name__}, with {', '.join(options)}"
            refuse(problem, "options in the object, or as keywords with the name of a model")
        return model
    model = require_choice("&model: name", ModalBall.name if model is None else model, MODELS)
    known = [option.name for option in fields(MODELS[model])]
    for word in options.keys() - known:
        owners = dict.fromkeys(key.owner or f"&{key.group}" for key in KEYS if key.name == word)
        hint = suggestion(word, [*known, *_NAMES["sampling"]])
        of = f", but of {' and '.join(owners)}" if owners else hint
        refuse(f"{word!r} is no option of {model}{of}", ", ".join(known))
    return MODELS[model](**options)  # type: ignore[arg-type]


@dataclass(frozen=True, repr=False)
class Case(Immutable):
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
    model: ModelOptions | None = field(default_factory=ModalBall)
    sampling: Sampling = field(default_factory=Sampling)
    levels: Levels = field(default_factory=Levels)
    limits: Limits = field(default_factory=Limits)
    modes: Modes | None = None
    floor: FloorOptions | None = None
    room: Room | None = None
    compression: Compression | None = None
    unknowns: Unknowns | None = None

    def __post_init__(self) -> None:
        """Raise TypeError if a group is of a wrong type."""
        super().__post_init__()
        KEYS[0].require(self.name)
        chosen = {"model": ModelOptions, "floor": FloorOptions}
        kinds: dict[str, Any] = {**GROUPS, **chosen, **OPTIONAL_GROUPS}
        for group, kind in kinds.items():
            if group in GROUPS or getattr(self, group) is not None:
                require_kind(group, getattr(self, group), kind)

    def __repr__(self) -> str:
        """Return what is computed."""
        model = self.model.name if self.model else ""
        modes = "free modes" if self.modes else ""
        floor = f"on {self.floor.name}" if self.floor else ""
        room = "room below" if self.room else ""
        press = "quasi-static compression" if self.compression else ""
        return f"<Case {self.name}: {', '.join(filter(None, (model, floor, modes, room, press)))}>"

    def entries(self) -> Iterator[tuple[Key, object, float | None]]:
        """Yield each key that the case has, but its name, with the value.

        If that is None, the value of the standard ball by the model follows, else None.
        """
        model = self.model.name if self.model else ""
        for key, attribute in _ATTRIBUTES:
            options = getattr(self, attribute, None)
            is_used = self.model or attribute not in GROUPS or attribute == "ball"
            if options and is_used and key.owner in {"", attribute, getattr(options, "name", "")}:
                value = getattr(options, key.name)
                is_open = value is None and key.owner in {"", model}
                yield key, value, STANDARD_BALL.get((model, key.name)) if is_open else None

    def resolved(self) -> Self:
        """Return the case with the values of the standard ball by its model where keys are None."""
        values: dict[str, dict[str, object]] = {}
        for key, _, standard in self.entries():
            if standard is not None:
                values.setdefault(attribute_of(key), {})[key.name] = standard
        changed = {name: replace(getattr(self, name), **new) for name, new in values.items()}
        return replace(self, **changed)

    def to_namelist(self) -> Namelist:
        """Return the case as a namelist, which prints as the text of a file.

        It has every key but those of the standard ball that are None.
        """
        groups: dict[str, dict[str, object]] = {}
        for key, value, _ in ((KEYS[0], self.name, None), *self.entries()):
            group = groups.setdefault(key.group, {})
            if value is not None and value != ():
                group[key.name] = [*value] if isinstance(value, tuple) else value
        namelist: Any = f90nml.Namelist()  # a dictionary of groups would be sorted
        namelist.update(groups)
        return namelist  # type: ignore[no-any-return]

    @classmethod
    def from_text(cls, content: str) -> Self:
        """Return the case in the text of a namelist file; missing keys have their default."""
        return cls.from_namelist(f90nml.reads(content))

    @classmethod
    def from_namelist(cls, namelist: Namelist) -> Self:
        """Return the case in a namelist, or other tables of keys by group.

        Missing keys have their default. Raise InputError if a group, a key, or the name of model
        or floor is not known, a group is not a table, or a value is not allowed.
        """
        content: dict[str, Any] = dict(namelist)
        refuse_unknown("the case", content, _NAMES)
        for group, keys in content.items():
            refuse_unknown(f"&{group}", require_table(f"&{group}", keys), _NAMES[group])
        optional = {group: kind for group, kind in OPTIONAL_GROUPS.items() if group in content}
        kinds: dict[str, type[Group]] = {**GROUPS, **optional}
        for group, choices in (("model", MODELS), ("floor", FLOORS)):
            if group in content or (group == "model" and "modes" not in content):
                name = content.get(group, {}).get("name", next(iter(choices)))
                require_choice(f"&{group}: name", name, choices)
                kinds[group] = choices[name]
        attributes: dict[str, Any] = {"model": None, **content.get("case", {})}
        for attribute, kind in kinds.items():
            keys = [key for key in kind.keys.values() if key.name in content.get(key.group, {})]
            attributes[attribute] = kind(**{k.name: content[k.group][k.name] for k in keys})
        return cls(**attributes)


def case_text(case: Case) -> bytes:
    """Return the text of the namelist file of a case, for the library."""
    return f"{case.to_namelist()}\n".encode(errors="surrogateescape")


def impact_only(case: Case) -> Case:
    """Return a case without free modes, compression and unknowns, which an impact does not use."""
    return replace(case, modes=None, compression=None, unknowns=None)


def read_case(path: str | os.PathLike[str]) -> Case:
    """Read a case, with every key, from a namelist file.

    Raises
    ------
    InputError
        If the input is invalid; the message names file, group, key, value and allowed range.
    """
    require_kind("path", path, str | os.PathLike)
    return Case.from_text(ask("effective_case", path=os.fsencode(path))["case"])


def check_case(case: Case) -> None:
    """Raise InputError with the message of the library if a case is invalid."""
    ask("check", case=case_text(case))


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
    require_kind("case", case, Case)
    check_case(case)
    replace_file(path, case_text(case))
