"""Library of floor constructions: TOML files with a floor, its layers and sources of all values."""

from __future__ import annotations

import os
import re
from copy import deepcopy
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from thud.base._schema import FLOORS, FloorOptions, JoistFloor, RectangularFloor, Room
from thud.base.checks import refuse, refuse_unknown, refuse_value, require_kind, shown, suggestion
from thud.base.errors import InputError
from thud.base.files import inputs_folder
from thud.base.immutable import Immutable
from thud.base.toml_tables import (
    TomlTable,
    between,
    key,
    one_of,
    read_toml,
    require_table,
    to_line,
    to_text,
)
from thud.case.case import Case, check_case

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from matplotlib.figure import Figure

# Keys of the room that belong to a construction: its suspended ceiling.
CEILING_KEYS = tuple(name for name in Room.keys if name.startswith("ceiling_"))


@dataclass(frozen=True)
class Layer(TomlTable):
    """A layer of a floor, with width and spacing of members such as joists; 0: none."""

    material: str = key(to_text, "name of the material", "")
    thickness: float = key(between(1e-9, 10.0, "m"), "thickness", 0.0)
    density: float = key(between(0.1, 1e5, "kg/m3"), "mean density", 0.0)
    width: float = key(between(1e-3, 1e3, "m"), "width of members such as joists", 0.0)
    spacing: float = key(between(1e-3, 1e3, "m"), "distance between their axes", 0.0)

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
class Construction(Immutable):
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

    @property
    def section(self) -> str:
        """Layers from top to bottom, in words."""
        return ", ".join(map(str, self.layers))

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
                corner: dict[str, Any] = {"corner_x": room.corner_y, "corner_y": room.corner_x}
                room = replace(room, length=room.width, width=room.length, **corner)
            if "length" in self.sources:
                length = self.floor.length
        return replace(result, room=room, floor=replace(self.floor, length=length, width=width))

    def plot(self) -> Figure:
        """Draw the section of the floor with its layers."""
        from thud.plot.floor_figures import draw_section

        return draw_section(self.layers, self.name)

    def __repr__(self) -> str:
        """Return name and layers."""
        return f"<Construction {self.name}: {self.section}>"


class Library(dict[str, Construction]):
    """Constructions by name; an entry is contained as its name is."""

    def __contains__(self, entry: object) -> bool:
        """Whether a construction, or one of this name, is in the library."""
        return super().__contains__(getattr(entry, "name", entry))


def constructions(text: str = "") -> Library:
    """Return the floor constructions of the library by name, sorted by kind and name.

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
    >>> list(thud.constructions("screed 200 15"))
    ['concrete 200, screed on 15 MN/m3', 'hollow core 200, screed on 15 MN/m3']
    """
    words = _plain(text).split()
    chosen = Library()
    for entry in _library().values():
        materials = (layer.material for layer in entry.layers)
        if all(word in _plain(" ".join((entry.name, entry.kind, *materials))) for word in words):
            chosen[entry.name] = deepcopy(entry)
    if not chosen:
        kinds = ", ".join(dict.fromkeys(entry.kind for entry in _library().values()))
        refuse(f"no construction contains {shown(text)}", f"words such as those of {kinds}")
    return chosen


def construction(name: str | os.PathLike[str]) -> Construction:
    """Return a floor construction.

    Parameters
    ----------
    name
        Name in the library, in which case and commas do not matter, or the path of a TOML file,
        which ends with ``.toml``.

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
    if not isinstance(name, str) or name.endswith(".toml"):
        return read_construction(Path(name))
    if entry := _library().get(_plain(name)):
        return deepcopy(entry)
    hint = suggestion(name, [entry.name for entry in _library().values()])
    return refuse(
        f"construction = {shown(name)} is not known{hint}",
        "names that thud-driver floor --list shows, or the path of a TOML file",
    )


def construction_rows(entries: Iterable[Construction]) -> list[tuple[str, ...]]:
    """Return header and a row of text for each construction."""
    header = ("construction", "layers from top to bottom", "mass, kg/m2")
    return [header, *((e.name, e.section, f"{e.mass_per_area:.0f}") for e in entries)]


def with_floor(case: Case, floor: FloorOptions | Construction | str | None) -> Case:
    """Return a case with another floor: its options, or a construction or the name of one."""
    if isinstance(floor, str):
        floor = construction(floor)
    return floor.case(case) if isinstance(floor, Construction) else replace(case, floor=floor)


@cache
def _library() -> dict[str, Construction]:
    """Return all constructions by `_plain` name, sorted by kind, words and numbers of the names."""
    entries = map(read_construction, (inputs_folder() / "constructions").glob("*.toml"))
    # Numbers, of four digits, are sorted by their value, and after words.
    named = {re.sub(r"\d+", lambda n: f"~{n[0]:0>4}", _plain(e.name)): e for e in entries}
    ordered = sorted(named.items(), key=lambda entry: (entry[1].kind, entry[0]))
    return {_plain(entry.name): entry for _, entry in ordered}


def _plain(text: str) -> str:
    """Return a text in lower case, without commas, with single blanks."""
    return " ".join(text.lower().replace(",", " ").split())


def _sides(case: Case) -> tuple[float, float] | None:
    """Return length and width of the room of a case, else those of its floor; None if unknown."""
    room = case.room or Room()
    in_corner = room.corner_x or room.corner_y
    for owner in (case.floor if in_corner else room, case.floor):
        length, width = getattr(owner, "length", 0.0), getattr(owner, "width", 0.0)
        if length and width:
            return length, width
    return None


def _to_sourced(name: str, value: object) -> Mapping[str, Any]:
    """Return a table of keys, each a table of value and source."""
    for word, entry in require_table(name, value).items():
        if not isinstance(entry, dict) or entry.keys() != {"value", "source"}:
            refuse_value(f"[{name}] {word}", entry, "a table of value and source")
        to_text(f"[{name}] {word}: source", entry["source"])
    return require_table(name, value)


def _to_layers(name: str, value: object) -> tuple[Layer, ...]:
    """Return the layers in a list of tables."""
    if not isinstance(value, list) or not value:
        refuse_value(name, value, "a list of tables with material, thickness and density")
    layers = []
    for i, table in enumerate(value, 1):
        try:
            layers.append(Layer.read("the table", table))
            layers[-1].require("material", "thickness", "density")
        except InputError as error:
            label = f"layer {i}"
            raise error.within(label) from error
    return tuple(layers)


@dataclass(frozen=True)
class _File(TomlTable):
    """Tables of a file."""

    name: str = key(to_text, "name of the construction", "")
    kind: str = key(to_text, "kind, such as timber joists", "")
    floor: str = key(one_of(FLOORS), "name of the floor", "")
    layers: tuple[Layer, ...] = key(_to_layers, "layers from top to bottom", ())
    keys: dict[str, Any] = key(_to_sourced, "keys of the floor", {})
    room: dict[str, Any] = key(_to_sourced, "keys of the suspended ceiling", {})
    note: str = key(to_line, "what the floor neglects", "")


def read_construction(path: Path) -> Construction:
    """Read a construction from a TOML file.

    Raise InputError with the path if the file is not a construction.
    """
    content, _ = read_toml(path)
    try:
        file = _File.read("the construction", content)
        file.require("name", "kind", "floor", "layers")
        refuse_unknown("[room]", file.room, CEILING_KEYS)
        floor, room = (
            {name: entry["value"] for name, entry in table.items()}
            for table in (file.keys, file.room)
        )
        case = Case.from_namelist({"floor": {"name": file.floor}, file.floor: floor, "room": room})
        check_case(case if room else replace(case, room=None))
    except InputError as error:
        raise error.within(path) from error
    assert case.floor is not None  # noqa: S101 - the tables have a floor
    sources = {name: entry["source"] for name, entry in (file.keys | file.room).items()}
    room = {name: float(value) for name, value in room.items()}
    return Construction(file.name, file.kind, case.floor, room, file.layers, sources, file.note)
