"""Make what follows from the library's schema: classes, typed calls, public names, reference.

Run by ``./bootstrap schema``: thud --schema | python driver/generate_schema.py [DIRECTORY]
"""

from __future__ import annotations

import json
import sys
import textwrap
from pathlib import Path
from typing import Any

TYPES = {"real": "float", "whole": "int", "flag": "bool", "text": "str"}
HEAD = '''"""Groups of the input, keys and results as the library declares them.

Made by ``./bootstrap schema`` from ``thud --schema``; do not edit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Literal

from thud.base.key import Group, Key, Quantity

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

__all__ = [
{names}]

# Choices of keys.
{choices}'''
SOLVE = '''"""The calls of `thud.solve` by model, for type checkers.

Made by ``./bootstrap schema`` from ``thud --schema``; do not edit.
"""

from collections.abc import Sequence
from typing import Literal, TypedDict, Unpack, overload

from thud.base._schema import (
{names})
from thud.case.case import Case
from thud.case.constructions import Construction
from thud.impact.impact import Impact
'''
# A model is given by name, in its place or as a keyword; the first is the default.
CALL = '''
@overload
def solve(
    ball: Ball | None{default}, drop: Drop | None{default}, {star}model: {model},
    **options: Unpack[{options}],
) -> Impact:
    """Drop a ball on a floor{by}."""
'''
OF_CASE = '''
@overload
def solve(ball: Case) -> Impact:
    """Compute the impact of a case."""
'''
# Base of the floors of rectangular plates, named like a group.
RECTANGULAR = "rectangular_floor"
# What the groups of every model say, and those that a case may ask for.
GROUPS = {
    "ball": "The ball or another source: geometry, mass and material",
    "drop": "The drop: height and gravity",
    "sampling": "Samples of the force: rate, duration and steps between them",
    "levels": "How levels are computed, and of which force",
    "limits": "The source whose limits apply",
}
OPTIONAL = {
    "modes": "Free modes that are requested.",
    "compression": "Quasi-static compression that is requested.",
    "unknowns": "What is not known of the source: keys, and the distributions of their values.",
    "room": "Room below the floor.",
}
# What uses the keys of such an owner.
USERS = {
    "modes": "free modes",
    "compression": "a quasi-static compression",
    "unknowns": "`thud-driver assess`",
    "floor": "drops on a floor",
    "room": "the level in the room below",
}
INDENT = " " * 8
LONGEST = 100
PAGE = """# Keys of an input file

Made by `./bootstrap schema` from the library's own declarations. Each key has its default, its SI
unit, and its choices or its range: `(` and `)` exclude a limit, `[` and `]` include it.
`thud --keys` prints the same as a commented input file.
"""

Entry = dict[str, Any]


def class_name(name: str) -> str:
    """Return the name of the class of a group or model."""
    return "".join(word.capitalize() for word in name.split("_"))


def allowed(key: Entry) -> str:
    """Return what a key allows: its choices, or an interval."""
    if key["choices"]:
        return ", ".join(f"`'{choice}'`" for choice in key["choices"])
    if "lower" not in key:
        return ""
    ends = [
        f"`{end}`" if isinstance(end, str) else f"{end:g}" for end in (key["lower"], key["upper"])
    ]
    low, high = (end.replace("e+0", "e").replace("e+", "e").replace("e-0", "e-") for end in ends)
    return f"{'(' if key['lower_open'] else '['}{low}, {high}{')' if key['upper_open'] else ']'}"


def choice_name(key: Entry) -> str:
    """Return the name of the type of a choice."""
    return class_name(key["owner"] or key["group"]) + class_name(key["name"])


def literal(name: str, words: list[str]) -> str:
    """Return the type of one of some words as Python writes it."""
    line = f"{name} = Literal[{', '.join(map(quoted, words))}]\n"
    if len(line) <= LONGEST:
        return line
    entries = "".join(f"    {quoted(word)},\n" for word in words)
    return f"{name} = Literal[\n{entries}]\n"


def python_type(key: Entry) -> str:
    """Return the type of a key's value."""
    if key["kind"] == "choice":
        return choice_name(key)
    if key["kind"] == "texts":
        return "Sequence[str]"
    if key["kind"] == "list":
        entry = "int" if key["whole"] else "float"
        # A list that is not empty by default is often a single number.
        return f"{entry} | Sequence[{entry}]" if key["default"] else f"Sequence[{entry}]"
    return TYPES[key["kind"]] + (" | None" if key["default"] is None else "")


def python_default(key: Entry) -> str:
    """Return the default of a key as Python writes it."""
    default = tuple(key["default"]) if key["kind"] in {"list", "texts"} else key["default"]
    return json.dumps(default) if isinstance(default, str) else repr(default)


def python_class(
    title: str, keys: list[Entry], group: str, kind: str = "", base: str = "Group"
) -> str:
    """Return the dataclass of some keys; a model and a floor name their kind of names."""
    attributes: list[str] = []
    members = [f'    name: ClassVar[{kind}] = "{group}"'] if kind else []
    for key in keys:
        unit = f", {key['unit']}" if key["unit"] else ""
        words = [key["meaning"][0].upper() + key["meaning"][1:] + unit, allowed(key)]
        if key["default"] is None:
            words.append("None: that of the standard ball by the model")
        default = python_default(key)
        if key["group"] != group:
            words.append(f"group ``&{key['group']}``")
        type_name = python_type(key)
        text = INDENT + "; ".join(filter(None, words)) + "."
        plain_type = type_name.replace("Sequence[", "sequence of ").rstrip("]")
        if key["kind"] == "choice":
            plain_type = "str"
        attributes.append(f"    {key['name']} : {plain_type}")
        attributes += textwrap.wrap(text, 99, subsequent_indent=INDENT)
        members.append(f"    {key['name']}: {type_name} = {default}")
    # The keys of a base follow those of a class.
    options = ", kw_only=True" if group == RECTANGULAR else ""
    head = f"\n\n@dataclass(frozen=True{options})\nclass {class_name(group)}({base}):\n"
    head += f'    """{title}'
    if not keys:
        return "\n".join([f'{head}"""', "", *members, ""])
    attributes = ["\n    Attributes", "    ----------", *attributes, '    """\n']
    return "\n".join([head, *attributes, *members, ""])


def shared_groups(schema: Entry) -> list[str]:
    """Return the groups that every model uses."""
    shared = [key["group"] for key in schema["keys"] if not key["owner"]]
    return [group for group in dict.fromkeys(shared) if group not in {"case", "model"}]


def optional_groups(schema: Entry) -> list[str]:
    """Return the groups that a case may have beside those of models and floors."""
    owners = dict.fromkeys(key["owner"] for key in schema["keys"] if key["owner"])
    known = {*schema["models"], *schema["floors"], "floor"}
    return [owner for owner in owners if owner not in known]


def shared_keys(schema: Entry) -> tuple[list[str], list[Entry]]:
    """Return the floors whose edges are supported, and the keys that they all declare alike."""
    owned = {floor: [key for key in schema["keys"] if key["owner"] == floor]
             for floor in schema["floors"]}  # fmt: skip
    names = [floor for floor, keys in owned.items() if any(k["name"] == "support" for k in keys)]
    alike = [{json.dumps(without_place(key)) for key in owned[floor]} for floor in names]
    shared = [without_place(key) for key in owned[names[0]]]
    return names, [key for key in shared if all(json.dumps(key) in keys for keys in alike)]


def without_place(key: Entry) -> Entry:
    """Return a key of a floor as one of `RectangularFloor`."""
    return key | {"owner": RECTANGULAR, "group": RECTANGULAR}


def public_names(schema: Entry) -> list[str]:
    """Return the names that the package offers of its schema."""
    groups = [*shared_groups(schema), *optional_groups(schema)]
    names = map(class_name, [*groups, *schema["models"], *schema["floors"]])
    return sorted(
        [*names, class_name(RECTANGULAR), "FloorName", "FloorOptions", "ModelName", "ModelOptions"]
    )


def with_public_names(stub: str, schema: Entry) -> str:
    """Return the stub of the package with the names of the schema."""
    head, begin, rest = stub.partition("from .base._schema import (\n")
    names = "".join(f"    {name} as {name},\n" for name in public_names(schema))
    return head + begin + names + rest[rest.index(")") :]


def python_module(schema: Entry) -> str:
    """Return the text of ``base/_schema.py``."""
    keys, models, floors = schema["keys"], schema["models"], schema["floors"]
    groups, optional = shared_groups(schema), optional_groups(schema)
    rectangular, shared = shared_keys(schema)
    inherited = {key["name"] for key in shared}
    with_type = [
        key for key in keys if key["owner"] not in rectangular or key["name"] not in inherited
    ]
    choices = [literal(choice_name(key), key["choices"])
               for key in [*with_type, *shared] if key["choices"]]  # fmt: skip
    choices.append(literal("BandSet", [*schema["band_sets"]]))
    quoted_names = "".join(f"    {quoted(name)},\n" for name in public_names(schema))
    parts = [HEAD.format(names=quoted_names, choices="".join(choices))]
    for group in groups:
        members = [key for key in keys if (key["owner"], key["group"]) == ("", group)]
        title = f"{GROUPS.get(group, 'Keys')} (group ``&{group}``)."
        parts.append(python_class(title, members, group))
    for owner in optional:
        members = [key for key in keys if key["owner"] == owner]
        parts.append(python_class(OPTIONAL[owner], members, owner))
    for model in models:
        members = [key for key in keys if key["owner"] == model]
        title = f"Options of the source model ``{model}``."
        parts.append(python_class(title, members, model, "ModelName"))
    parts.append(python_class("What all floors of rectangular plates have.", shared, RECTANGULAR))
    for floor in floors:
        members = [key for key in keys if key["owner"] == floor]
        title, base = f"Floor ``{floor}``.", "Group"
        if floor in rectangular:
            members = [key for key in members if key["name"] not in inherited]
            base = class_name(RECTANGULAR)
            title = f"Floor ``{floor}``, with all keys of `{base}`."
        parts.append(python_class(title, members, floor, "FloorName", base))
    quantities = schema["quantities"]
    of_impacts = quantities[: schema["history_quantities"]]
    of_samples = quantities[: schema["sample_quantities"]]
    parts += [
        union("ModelOptions", models),
        union("FloorOptions", floors),
        table("Source models by name, the default first.", "MODELS: dict[str, type[ModelOptions]]",
              [f"{name}.name: {name}" for name in map(class_name, models)]),
        table("Floors by name, the default first.", "FLOORS: dict[str, type[FloorOptions]]",
              [f"{name}.name: {name}" for name in map(class_name, floors)]),
        table("Groups that every model uses.", "GROUPS: dict[str, type[Group]]",
              [f"{quoted(group)}: {class_name(group)}" for group in groups]),
        table("Groups that a case may have.", "OPTIONAL_GROUPS: dict[str, type[Group]]",
              [f"{quoted(group)}: {class_name(group)}" for group in optional]),
        quantity_class("ImpactQuantities", "Numbers that describe an impact.", of_impacts, "float"),
        quantity_class("SampleQuantities", "Numbers that describe each of many samples.",
                       of_samples, "NDArray[np.float64]", ", shape (n_sample,)"),
        table("The table of quantities.", "QUANTITIES",
              [f"{quoted(entry['name'])}: {python_quantity(entry)}" for entry in quantities]),
        "\n# Those of them that describe a single impact, and each of many samples.\n",
        f"IMPACT_QUANTITIES = tuple(QUANTITIES)[:{len(of_impacts)}]\n",
        f"SAMPLE_QUANTITIES = tuple(QUANTITIES)[:{len(of_samples)}]\n",
        table("Nominal and exact mid frequencies, and edges of the bands of each set, Hz.",
              "BANDS: dict[BandSet, dict[str, tuple[float, ...]]]",
              [f"{quoted(name)}: {bands_entry(bands)}"
               for name, bands in schema["band_sets"].items()]),
        table("Nominal frequencies of the bands of each set that a rating is made of, Hz.",
              "RATED_BANDS: dict[BandSet, tuple[float, ...]]",
              [f"{quoted(name)}: {tuple(bands)!r}"
               for name, bands in schema["rated_bands"].items()]),
        table("Name, unit, lower and upper limit of the criteria of each source.",
              "LIMITS: dict[LimitsSource, tuple[tuple[str, str, float, float], ...]]",
              [f"{quoted(source)}: ({', '.join(map(limits_entry, limits))})"
               for source, limits in schema["limits"].items()]),
        "\n# Verdicts on a criterion, a source or a room.\n",
        f"VERDICTS = ({', '.join(map(quoted, schema['verdicts']))})\n",
        "\n# Maximum A-weighted levels of the classes 1, 2, ... of KS F 2863-2, dB.\n",
        f"CLASS_LIMITS = {tuple(schema['class_limits'])!r}\n",
        "\n# Probability from which a requirement on a rating is met.\n",
        f"MET_FROM = {schema['met_from']!r}\n",
        table("Single-number ratings of a level in a room, with symbols, bands and standards.",
              "RATINGS: dict[RoomRating, str]",
              [f"{quoted(name)}: {quoted(title)}" for name, title in schema["ratings"].items()]),
        table("Values of the standard ball by model and key; without a model for free modes alone.",
              "STANDARD_BALL: dict[tuple[str, str], float]",
              [f"({quoted(entry['model'])}, {quoted(entry['key'])}): {entry['value']!r}"
               for entry in schema["standard_ball"]]),
        "\n# Every key, in the order of an input file.\nKEYS = (\n",
        *(f"    {python_key(key)},\n" for key in keys),
        ")\n",
        "_CLASSES = {**GROUPS, **OPTIONAL_GROUPS, **MODELS, **FLOORS}\n",
        "for _name, _class in _CLASSES.items():\n",
        "    _class.keys = {key.name: key for key in KEYS if (key.owner or key.group) == _name}\n",
    ]  # fmt: skip
    return "".join(parts)


def union(name: str, members: list[str]) -> str:
    """Return the type of an object of one of some classes as Python writes it."""
    classes = list(map(class_name, members))
    line = f"{name} = {' | '.join(classes)}\n"
    if len(line) > LONGEST:
        line = f"{name} = (\n    " + "\n    | ".join(classes) + "\n)\n"
    return f"\n\n{line}" if name == "ModelOptions" else line


def python_calls(schema: Entry) -> str:
    """Return the text of ``impact/solve.pyi``."""
    keys, models = schema["keys"], schema["models"]
    owned = {model: [key for key in keys if key["owner"] == model] for model in models}
    choices = {choice_name(key) for key in keys if key["owner"] in models and key["choices"]}
    names = sorted({"Ball", "Drop", "FloorOptions", "ModelName", "ModelOptions", "Room", *choices})
    parts = [SOLVE.format(names="".join(f"    {name},\n" for name in names))]
    shared = [key for key in keys if key["group"] == "sampling"]
    for name, base, members in [
        ("Sampling", "TypedDict", shared),
        *((class_name(model), "SamplingOptions", owned[model]) for model in models),
    ]:
        parts.append(f"\nclass {name}Options({base}, total=False):\n")
        parts += [f"    {key['name']}: {python_type(key)}\n" for key in members]
        if base == "TypedDict":
            parts.append(
                "    floor: FloorOptions | Construction | str | None\n    room: Room | None\n"
            )
    parts.append(OF_CASE)
    for model in models:
        words = {"options": f"{class_name(model)}Options", "by": f" by the model ``{model}``"}
        name = f"Literal[{quoted(model)}]"
        if model == models[0]:
            parts.append(CALL.format(default=" = ...", star="", model=f"{name} = ...", **words))
        else:
            parts.append(CALL.format(default="", star="", model=name, **words))
            parts.append(CALL.format(default=" = ...", star="*, ", model=name, **words))
    parts.append(CALL.format(default=" = ...", star="", model="ModelName | ModelOptions = ...",
                             options="SamplingOptions", by=""))  # fmt: skip
    return "".join(parts)


def table(comment: str, name: str, entries: list[str]) -> str:
    """Return a dictionary as Python writes it."""
    lines = "".join(f"    {entry},\n" for entry in entries)
    return f"\n# {comment}\n{name} = {{\n{lines}}}\n"


def bands_entry(bands: dict[str, list[float]]) -> str:
    """Return the frequencies of bands as Python writes them."""
    return repr({name: tuple(values) for name, values in bands.items()}).replace("'", '"')


def limits_entry(entry: Entry) -> str:
    """Return a criterion as Python writes it."""
    return repr(tuple(entry.values())).replace("'", '"')


def python_quantity(entry: Entry) -> str:
    """Return the `Quantity` of a quantity."""
    values = (quoted(v) if isinstance(v, str) else repr(v) for v in entry.values())
    return f"Quantity({', '.join(values)})"


def quantity_class(
    name: str, title: str, quantities: list[Entry], type_name: str, shape: str = ""
) -> str:
    """Return the dataclass of some quantities."""
    text = f'\n\n@dataclass(frozen=True, eq=False, kw_only=True)\nclass {name}:\n    """{title}\n'
    text += "\n    Attributes\n    ----------\n"
    plain = "ndarray" if shape else type_name
    for entry in quantities:
        unit = f", {entry['unit']}" if entry["unit"] else ""
        meaning = entry["meaning"][0].upper() + entry["meaning"][1:]
        text += f"    {entry['name']} : {plain}{shape}\n        {meaning}{unit}.\n"
    text += '    """\n\n'
    return text + "".join(f"    {entry['name']}: {type_name}\n" for entry in quantities)


def python_key(key: Entry) -> str:
    """Return the `Key` of a key."""
    parts = [key[part] for part in ("owner", "group", "name", "kind", "unit", "meaning")]
    if key["choices"] or "lower" in key:
        parts.append(tuple(key["choices"]))
    if "lower" in key:
        parts += [key["lower"], key["upper"], *([True] if key["whole"] else [])]
    words = [quoted(p) if isinstance(p, str) else repr(p) for p in parts]
    words += [f"{end}=True" for end in ("lower_open", "upper_open") if key.get(end)]
    if key["needs"]:
        words.append(f"needs={tuple(map(str, key['needs']))}")
    return f"Key({', '.join(words)})"


def quoted(text: str) -> str:
    """Return a text as Python writes it."""
    return json.dumps(text)


def standard_values(key: Entry, standard: list[Entry]) -> str:
    """Return the values of the standard ball for a key, with the models if they differ."""
    models: dict[float, list[str]] = {}
    for entry in standard:
        if entry["key"] == key["name"] and key["owner"] in {"", entry["model"]}:
            models.setdefault(entry["value"], []).append(entry["model"] or "free modes")
    if len(models) == 1:
        return repr(next(iter(models)))
    return ", ".join(f"{value!r} ({', '.join(names)})" for value, names in models.items())


def page(schema: Entry) -> str:
    """Return the reference of all keys in Markdown."""
    text, seen, group = PAGE, set(), ""
    for key in schema["keys"]:
        if (key["group"], key["name"]) in seen:
            continue
        seen.add((key["group"], key["name"]))
        if key["group"] != group:
            group = key["group"]
            owners = sorted({k["owner"] for k in schema["keys"] if k["group"] == group} - {""})
            users = [USERS.get(owner, f"`{owner}`") for owner in owners]
            used = f"Used by {' and '.join(users)}.\n\n" if users else ""
            text = f"{text.rstrip()}\n\n## `&{group}`\n\n{used}"
        default = python_default(key) if key["default"] not in ([], "") else ""
        if key["default"] is None:
            default = standard_values(key, schema["standard_ball"])
        value = f" = {default} {key['unit']}".rstrip() if default else f" {key['unit']}".rstrip()
        text += f"`{key['name']}`{value}\n: {key['meaning']}"
        text += f"; {given}\n\n" if (given := allowed(key)) else "\n\n"
    return f"{text.rstrip()}\n"


def main() -> None:
    """Write the files below a directory, by default that of the project."""
    schema = json.load(sys.stdin)
    root = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parents[1]
    package = root / "driver/thud"
    (package / "base/_schema.py").write_text(python_module(schema), encoding="utf-8")
    (package / "impact/solve.pyi").write_text(python_calls(schema), encoding="utf-8")
    stub = package / "__init__.pyi"
    stub.write_text(with_public_names(stub.read_text(encoding="utf-8"), schema), encoding="utf-8")
    (root / "docs/keys.md").write_text(page(schema), encoding="utf-8")


if __name__ == "__main__":
    main()
