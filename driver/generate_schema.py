"""Make driver/thud/_schema.py and docs/keys.md from the library's schema; run by ``./bootstrap schema``.

Usage: thud --schema | python driver/generate_schema.py [DIRECTORY]
"""

from __future__ import annotations

import json
import sys
import textwrap
from pathlib import Path
from typing import Any

TYPES = {"real": "float", "whole": "int", "flag": "bool", "choice": "str", "text": "str"}
HEAD = '''"""Groups of the input, keys and results as the library declares them.

Made by ``./bootstrap schema`` from ``thud --schema``; do not edit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import ClassVar

from thud.key import Key

__all__ = [
{names}]
'''
PAGE = """# Keys of an input file

Made by `./bootstrap schema` from the library's own declarations. SI units. `thud --keys` prints the
same as a commented input file.
"""

Entry = dict[str, Any]


def class_name(name: str) -> str:
    """Return the name of the class of a group or model."""
    return "".join(word.capitalize() for word in name.split("_"))


def allowed(key: Entry) -> str:
    """Return what a key allows, in words."""
    if key["choices"]:
        return ", ".join(f'"{choice}"' for choice in key["choices"])
    if "lower" not in key:
        return ""
    ends = [end if isinstance(end, str) else f"{end:g}" for end in (key["lower"], key["upper"])]
    signs = ["<" if key[open_] else "<=" for open_ in ("lower_open", "upper_open")]
    return f"{ends[0]} {signs[0]} {key['name']} {signs[1]} {ends[1]}"


def python_type(key: Entry) -> str:
    """Return the type of a key's value."""
    if key["kind"] == "list":
        return f"Sequence[{'int' if key['whole'] else 'float'}]"
    return TYPES[key["kind"]]


def python_default(key: Entry) -> str:
    """Return the default of a key as Python writes it."""
    default = tuple(key["default"]) if key["kind"] == "list" else key["default"]
    return json.dumps(default) if isinstance(default, str) else repr(default)


def python_class(title: str, keys: list[Entry], group: str, model: str = "") -> str:
    """Return the dataclass of some keys."""
    lines = ["", "", "@dataclass(frozen=True)", f"class {class_name(group)}:", f'    """{title}', ""]
    lines += ["    Attributes", "    ----------"]
    for key in keys:
        words = [key["meaning"][0].upper() + key["meaning"][1:]]
        words[0] += f", {key['unit']}" if key["unit"] else ""
        words += [allowed(key)] if allowed(key) else []
        words += [f"group ``&{key['group']}``"] if key["group"] != group else []
        lines.append(f"    {key['name']} : {python_type(key).replace('Sequence[', 'sequence of ').rstrip(']')}")
        indent = " " * 8
        lines += textwrap.wrap("; ".join(words) + ".", 99, initial_indent=indent, subsequent_indent=indent)
    lines += ['    """', ""]
    if model:
        lines += [f'    name: ClassVar[str] = "{model}"']
    for key in keys:
        default = python_default(key)
        if key["group"] != group:
            default = f'field(default={default}, metadata={{"group": "{key["group"]}"}})'
        lines.append(f"    {key['name']}: {python_type(key)} = {default}")
    return "\n".join(lines) + "\n"


def python_module(schema: Entry) -> str:
    """Return the text of ``_schema.py``."""
    keys = schema["keys"]
    shared = [key for key in keys if not key["owner"] and key["group"] not in {"case", "model"}]
    groups = list(dict.fromkeys(key["group"] for key in shared))
    names = sorted(map(class_name, [*groups, "modes", *schema["models"]]))
    text = HEAD.replace("{names}", "".join(f'    "{name}",\n' for name in names))
    for group in groups:
        text += python_class(f"Group ``&{group}``.", [k for k in shared if k["group"] == group], group)
    text += python_class("Free modes that are asked for.", [k for k in keys if k["owner"] == "modes"], "modes")
    for model in schema["models"]:
        title = f"Options of the source model ``{model}``."
        text += python_class(title, [k for k in keys if k["owner"] == model], model, model)
    names = [class_name(model) for model in schema["models"]]
    text += f"\n\nModelOptions = {' | '.join(names)}\n"
    text += "\n# Source models by name, the default first.\nMODELS: dict[str, type[ModelOptions]] = {\n"
    text += "".join(f"    {name}.name: {name},\n" for name in names) + "}\n"
    text += "\n# Groups that every model uses.\nGROUPS = {\n"
    text += "".join(f'    "{group}": {class_name(group)},\n' for group in groups) + "}\n"
    text += "\n# Unit and meaning of the numbers that describe an impact; the first ones describe each of many.\n"
    text += "SCALARS = {\n"
    for scalar in schema["scalars"]:
        text += f'    "{scalar["name"]}": ({json.dumps(scalar["unit"])}, {json.dumps(scalar["meaning"])}),\n'
    text += "}\n\n# Every key, in the order of an input file.\nKEYS = (\n"
    for key in keys:
        ends = [float(key.get(end, 0)) if not isinstance(key.get(end, 0), str) else key[end] for end in ("lower", "upper")]
        parts = [key[part] for part in ("owner", "group", "name", "kind", "unit", "meaning")]
        parts += [tuple(key["choices"])] if key["choices"] or "lower" in key else []
        parts += ends if "lower" in key else []
        text += f"    Key({', '.join(json.dumps(p) if isinstance(p, str) else repr(p) for p in parts)}),\n"
    return text + ")\n"


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
            users = [("free modes" if owner == "modes" else f"`{owner}`") for owner in owners]
            text += f"\n## `&{group}`\n\n" + (f"Used by {' and '.join(users)}.\n\n" if users else "")
            text += "| key | default | unit | allowed | meaning |\n|---|---|---|---|---|\n"
        default = python_default(key) if key["default"] not in ([], "") else ""
        cells = [f"`{key['name']}`", default, key["unit"], allowed(key), key["meaning"]]
        text += f"| {' | '.join(cells)} |\n"
    return text


def main() -> None:
    """Write both files below a directory, by default that of the project."""
    schema = json.load(sys.stdin)
    root = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parents[1]
    (root / "driver/thud/_schema.py").write_text(python_module(schema), encoding="utf-8")
    (root / "docs/keys.md").write_text(page(schema), encoding="utf-8")


if __name__ == "__main__":
    main()
