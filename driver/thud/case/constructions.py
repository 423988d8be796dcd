"""Library of floor constructions: TOML files with a floor, its layers and sources of all values."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from thud.base._schema import (
    FLOORS,
    KEYS,
    FloorOptions,
    JoistFloor,
    RectangularFloor,
    Room,
)
from thud.base.checks import (
    refuse,
    refuse_unknown,
    refuse_value,
    require_choice,
    require_kind,
    require_number,
    shown,
    suggestion,
)
from thud.base.display import Displayed
from thud.base.errors import InputError
from thud.base.files import inputs_folder
from thud.base.toml_tables import read_toml
from thud.case.case import Case, check_case

if TYPE_CHECKING:
    from collections.abc import Iterator

    from matplotlib.figure import Figure

# Keys of the room that belong to a construction: its suspended ceiling.
CEILING_KEYS = tuple(
    key.name for key in KEYS if key.owner == "room" and key.name.startswith("ceiling_")
)
# Entries of a file, the texts first; the others are tables.
_TEXTS = ("name", "kind", "floor", "note")
_ENTRIES = (*_TEXTS, "layers", "keys", "room")
_OPTIONAL = ("note", "room")
_UNITS = {(key.owner, key.name): key.unit for key in KEYS}


class Layer(NamedTuple):
    """A layer of a floor.

    Attributes
    ----------
    material : str
        Its name.
    thickness, density : float
        Thickness, m, and mean density, kg/m3.
    width, spacing : float
        Width of members such as joists, and the distance between their axes, m; 0: none.
    """

    material: str
    thickness: float
    density: float
    width: float = 0.0
    spacing: float = 0.0

    def __str__(self) -> str:
        """Return thickness and material."""
        return f"{1e3 * self.thickness:g} mm {self.description}"

    @property
    def description(self) -> str:
        """Material, and width and spacing of members."""
        if not self.spacing:
            return self.material
        return f"{self.material}, {1e3 * self.width:g} mm wide, {self.spacing:g} m apart"


@dataclass(frozen=True, repr=False)
class Construction(Displayed):
    """A floor construction.

    Attributes
    ----------
    name, kind : str
        Name, unique in the library, and kind, such as ``"timber joists"``.
    floor : FloorOptions
        Floor that describes the construction.
    room : dict of str to float
        Keys of `Room` that describe its suspended ceiling; empty without one.
    layers : tuple of Layer
        Layers from top to bottom: material, thickness, m, and mean density, kg/m3.
    sources : dict of str to str
        Source of the value of each stated key of floor and room.
    note : str
        What the floor neglects; may be empty.
    """

    name: str
    kind: str
    floor: FloorOptions
    room: dict[str, float]
    layers: tuple[Layer, ...]
    sources: dict[str, str]
    note: str = ""

    @property
    def mass_per_area(self) -> float:
        """Mass of all layers, kg/m2."""
        return sum(layer.thickness * layer.density for layer in self.layers)

    def case(self, source: Case | None = None) -> Case:
        """Return a case with this construction as floor and ceiling.

        Parameters
        ----------
        source
            Case whose ball, drop, model and room are used; by default the standard ball, and a room
            as large as the floor, 2.5 m high, with 0.5 s. A suspended ceiling of the room stays
            unless the construction has its own. The floor takes length and width of its room, or of
            its floor if the room does not state both or is in a corner of the floor. Joists span
            the length that the construction states, else that of the joists of `source`, else the
            shorter side; the room turns with them.

        Raises
        ------
        InputError
            If `source` is not a case.
        """
        require_kind("source", source, Case | None)
        source = source or Case(room=Room())
        ceiling: dict[str, Any] = {**self.room}
        room = replace(source.room or Room(), **ceiling)
        name = "_".join(re.findall(r"\w+", self.name))
        result = replace(source, name=name, modes=None, floor=self.floor, room=room)
        sides = _sides(source)
        if not sides or not isinstance(self.floor, RectangularFloor):
            return result
        length, width = sides
        if isinstance(self.floor, JoistFloor):
            if not isinstance(source.floor, JoistFloor) and length > width:
                length, width = width, length
                room = replace(
                    room, length=room.width, width=room.length,
                    corner_x=room.corner_y, corner_y=room.corner_x,
                )  # fmt: skip
            if "length" in self.sources:
                length = self.floor.length
        return replace(result, room=room, floor=replace(self.floor, length=length, width=width))

    def rows(self) -> list[tuple[str, ...]]:
        """Return header and a row of text for each stated key."""
        rows: list[tuple[str, ...]] = [("key", "value", "unit", "source")]
        for key, source in self.sources.items():
            owner = "room" if key in self.room else self.floor.name
            value = self.room[key] if key in self.room else getattr(self.floor, key)
            values = value if isinstance(value, tuple) else (value,)
            text = ", ".join(f"{v:g}" if isinstance(v, float) else str(v) for v in values)
            rows.append((key, text, _UNITS[owner, key], source))
        return rows

    def plot(self) -> Figure:
        """Draw the section of the floor with its layers."""
        from thud.plot.floor_figures import draw_construction

        return draw_construction(self)

    def __repr__(self) -> str:
        """Return name and layers."""
        return f"<Construction {self.name}: {', '.join(map(str, self.layers))}>"


@dataclass(frozen=True, repr=False)
class Constructions(Displayed):
    """Floor constructions: a sequence, with access by name.

    Attributes
    ----------
    entries : tuple of Construction
        The constructions, sorted by kind and name.
    """

    entries: tuple[Construction, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the constructions."""
        return tuple(entry.name for entry in self.entries)

    def rows(self) -> list[tuple[str, ...]]:
        """Return header and a row of text for each construction."""
        header = ("construction", "layers from top to bottom", "mass, kg/m2")
        layers = (", ".join(map(str, entry.layers)) for entry in self.entries)
        masses = (f"{entry.mass_per_area:.0f}" for entry in self.entries)
        return [header, *zip(self.names, layers, masses, strict=True)]

    def __getitem__(self, name: str) -> Construction:
        """Return a construction by its name, in which case and commas do not matter.

        Raise InputError if the name is not known.
        """
        names = [_words(known) for known in self.names]
        if _words(name) not in names:
            refuse(
                f"construction = {shown(name)} is not known{suggestion(name, self.names)}",
                "names that thud-driver floor --list shows, or the path of a TOML file",
            )
        return self.entries[names.index(_words(name))]

    def __iter__(self) -> Iterator[Construction]:
        """Iterate over the constructions."""
        return iter(self.entries)

    def __len__(self) -> int:
        """Return the number of constructions."""
        return len(self.entries)

    def __repr__(self) -> str:
        """Return the names."""
        return f"<Constructions, {len(self)}: {'; '.join(self.names)}>"


def constructions(text: str = "") -> Constructions:
    """Return the floor constructions of the library.

    Parameters
    ----------
    text
        Words that name, kind and materials contain, such as ``"joists resilient"``; by default all
        constructions are returned.

    Raises
    ------
    InputError
        If no construction contains the words.

    Examples
    --------
    >>> import thud
    >>> thud.constructions("screed 200 15").names
    ('concrete 200, screed on 15 MN/m3', 'hollow core 200, screed on 15 MN/m3')
    """
    require_kind("text", text, str)
    words = _words(text)
    chosen = tuple(entry for entry in _library() if all(word in _searched(entry) for word in words))
    if not chosen:
        kinds = ", ".join(dict.fromkeys(entry.kind for entry in _library()))
        refuse(f"no construction contains {shown(text)}", f"words such as those of {kinds}")
    return Constructions(chosen)


def construction(name: str | os.PathLike[str]) -> Construction:
    """Return a floor construction.

    Parameters
    ----------
    name
        Name in the library, or the path of a TOML file, which ends with ``.toml``.

    Raises
    ------
    InputError
        If the name is not known, or the file is not a construction.

    Examples
    --------
    >>> import thud
    >>> thud.construction("concrete 180").floor.thickness
    0.18
    """
    require_kind("construction", name, str | os.PathLike)
    if isinstance(name, str) and not name.endswith(".toml"):
        return Constructions(_library())[name]
    return read_construction(Path(name))


def with_floor(case: Case, floor: FloorOptions | Construction | str | None) -> Case:
    """Return a case with another floor: its options, or a construction or the name of one."""
    if isinstance(floor, str):
        floor = construction(floor)
    return floor.case(case) if isinstance(floor, Construction) else replace(case, floor=floor)


def _library() -> tuple[Construction, ...]:
    """Return all constructions, whose dictionaries are the caller's."""
    return tuple(replace(c, room={**c.room}, sources={**c.sources}) for c in _read_library())


@cache
def _read_library() -> tuple[Construction, ...]:
    files = (inputs_folder() / "constructions").glob("*.toml")
    entries = map(read_construction, files)
    return tuple(sorted(entries, key=lambda entry: (entry.kind, _order(entry.name))))


def _order(name: str) -> list[tuple[int, str]]:
    """Return what sorts names by their words, and by the values of numbers in them."""
    words = re.findall(r"\d+|[^\d\s,]+", name)
    return [(int(word) if word.isdigit() else 0, word) for word in words]


def _searched(entry: Construction) -> str:
    materials = " ".join(layer.material for layer in entry.layers)
    return " ".join(_words(f"{entry.name} {entry.kind} {materials}"))


def _words(text: str) -> list[str]:
    """Return the words of a text in lower case, without commas."""
    return text.lower().replace(",", " ").split()


def _sides(case: Case) -> tuple[float, float] | None:
    """Return length and width of the room of a case, else those of its floor; None if unknown."""
    room = case.room or Room()
    in_corner = room.corner_x or room.corner_y
    for owner in (case.floor if in_corner else room, case.floor):
        length, width = getattr(owner, "length", 0.0), getattr(owner, "width", 0.0)
        if length and width:
            return length, width
    return None


def read_construction(path: Path) -> Construction:
    """Read a construction from a TOML file.

    Raise InputError with the path if the file is not a construction.
    """
    content, _ = read_toml(path)
    try:
        return _new_construction(content)
    except InputError as error:
        raise error.within(path) from error


def _new_construction(content: Mapping[str, Any]) -> Construction:
    """Return the construction in the tables of a file."""
    refuse_unknown("the construction", content, _ENTRIES)
    for key in _ENTRIES:
        if key not in content and key not in _OPTIONAL:
            refuse(f"{key} is missing", ", ".join(_ENTRIES))
    for key in _TEXTS:
        _require_text(key, content.get(key, "none"))
    require_choice("floor", content["floor"], FLOORS)
    keys, room = (_read_keys(name, content.get(name, {})) for name in ("keys", "room"))
    refuse_unknown("[room]", room, CEILING_KEYS)
    groups: dict[str, Any] = {
        "floor": {"name": content["floor"]},
        content["floor"]: {key: value for key, (value, _) in keys.items()},
        "room": {key: value for key, (value, _) in room.items()},
    }
    case = Case.from_namelist(groups if room else {**groups, "room": {}})
    check_case(case if room else replace(case, room=None))
    assert case.floor is not None  # noqa: S101 - the tables have a floor
    return Construction(
        name=content["name"],
        kind=content["kind"],
        floor=case.floor,
        room={key: float(value) for key, (value, _) in room.items()},
        layers=_read_layers(content["layers"]),
        sources={key: source for key, (_, source) in (keys | room).items()},
        note=content.get("note", ""),
    )


def _read_keys(table: str, keys: object) -> dict[str, tuple[Any, str]]:
    """Return value and source of each key in a table."""
    if not isinstance(keys, Mapping):
        refuse(f"[{table}] is not a table", "keys with value and source")
    for key, entry in keys.items():
        if not isinstance(entry, Mapping) or set(entry) != {"value", "source"}:
            refuse_value(f"[{table}] {key}", entry, "{ value = ..., source = '...' }")
        _require_text(f"[{table}] {key}: source", entry["source"])
    return {key: (entry["value"], entry["source"]) for key, entry in keys.items()}


def _read_layers(layers: object) -> tuple[Layer, ...]:
    """Return the layers in a list of tables."""
    if not isinstance(layers, list) or not layers:
        refuse_value("layers", layers, "a list of tables with material, thickness and density")
    result = []
    for number, table in enumerate(layers, 1):
        try:
            layer = Layer(**table)
        except TypeError as error:
            allowed = "a table of material, thickness and density, for members width and spacing"
            refuse(f"layer {number} = {shown(table)} is not allowed", allowed, error)
        _require_text(f"layer {number}: material", layer.material)
        for key in table.keys() - {"material"}:
            require_number(f"layer {number}: {key}", table[key])
            if table[key] <= 0:
                refuse_value(f"layer {number}: {key}", table[key], "positive numbers")
        result.append(layer)
    return tuple(result)


def _require_text(name: str, value: object) -> None:
    """Raise InputError if a value is not a text, or is empty."""
    if not isinstance(value, str) or not value.strip() or not value.isprintable():
        refuse_value(name, value, "a text in one line")
