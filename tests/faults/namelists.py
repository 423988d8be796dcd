"""Namelists, most of them damaged: refused in a sentence, or computed, written and read back."""

from __future__ import annotations

import math
import re
import shutil
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from cases import draw, draw_case
from damage import WORDS, damaged_text, fault_of

import thud
from thud.base._schema import KEYS, MODELS
from thud.base.bridge import ask
from thud.case.case import case_text

if TYPE_CHECKING:
    import random

INPUTS = Path(__file__).parents[2] / "inputs"
# Fraction of the accepted cases that are computed, of what takes long and of the rest.
SLOW, FRACTION = 0.05, 0.6
# Samples beyond which the results of a case count as grown memory.
MAX_SAMPLES = 500_000
NO_NUMBER = re.compile(rb"(?i)(?<![a-z_])(nan|inf|infinity)(?![a-z_])|\*\*\*")


@cache
def _examples() -> list[str]:
    """Return the namelists of the repository that name no other file."""
    texts = [path.read_text() for path in sorted(INPUTS.rglob("*.nml"))]
    return [text for text in texts if "modal_floor" not in text]


def _draw_text(chance: random.Random) -> str:
    """Return an example or a drawn case, with some keys from their whole range, or damaged."""
    text = chance.choice(_examples())
    if chance.random() < 0.7:
        text = case_text(draw_case(chance.choice(list(MODELS)), chance)).decode()
    for _ in range(chance.choice([0, 0, 1, 3])):
        key = chance.choice([key for key in KEYS if key.group not in {"model", "floor", "case"}])
        entry = f"    {key.name} = {_value(key, chance)}"
        # A group that is there must not come again.
        if f"&{key.group}\n" in text:
            before, group, after = text.partition(f"&{key.group}\n")
            after = re.sub(rf"^    {key.name} = .*$", "", after, count=1, flags=re.MULTILINE)
            text = before + group + entry + "\n" + after
        else:
            text += f"&{key.group}\n{entry}\n/\n"
    return damaged_text(text, chance) if chance.random() < 0.4 else text


def _value(key: Any, chance: random.Random) -> str:  # noqa: ANN401 - a key of the schema
    """Return a value of a key as it is typed."""
    if chance.random() < 0.1:
        return chance.choice(WORDS)
    if key.kind in {"text", "texts"}:
        return chance.choice(["'text'", "'é'", "'a/b'", "' '", "'mass', \"height\"", "'mass"])
    values = {one.name: 1.0 for one in KEYS}
    count = chance.choice([1, 1, 2, 12]) if key.kind == "list" else 1
    drawn = [draw(key, values, chance) for _ in range(count)]
    return ", ".join(f".{one}." if isinstance(one, bool) else repr(one) for one in drawn)


def attempt(chance: random.Random) -> tuple[str, str]:
    """Return what becomes of a namelist, and how to see it."""
    text = _draw_text(chance)
    path = Path("case.nml")
    path.write_bytes(text.encode(errors="surrogateescape"))
    effective = b""
    try:
        effective = _effective(path)
        word, detail = _tried(path, effective, chance)
    except thud.ThudError as error:
        detail = fault_of(error, "case.nml", text)
        word = "raw" if detail else "failed" if effective else "refused"
    finally:
        for one in Path().glob("*.nml"):
            one.unlink()
        shutil.rmtree("o", ignore_errors=True)
    return word, f"{detail}: {text!r}" if detail else ""


def _effective(path: Path) -> bytes:
    """Return the effective input of a file."""
    text: str = ask("effective_case", path=str(path))["case"]
    return text.encode(errors="surrogateescape")


def _tried(path: Path, effective: bytes, chance: random.Random) -> tuple[str, str]:
    if NO_NUMBER.search(re.sub(rb"'.*?'", b"", effective)):
        return "NaN", "in the effective input"
    again = Path("again.nml")
    again.write_bytes(effective)
    if _effective(again) != effective:
        return "mixed", "the effective input is not that of itself"
    if chance.random() < 0.05:
        again.write_bytes(case_text(thud.read_case(path)))
        if _effective(again) != effective:
            return "mixed", "the case of Python is another one"
    sampling = dict(re.findall(rb"^ +(sample_rate|duration) += (\S+)", effective, re.MULTILINE))
    slow = rb"'(finite_element|\w*plate|\w+_floor)'|&(room|modes|compression)"
    is_slow = re.search(slow, effective)
    is_long = math.prod(map(float, sampling.values())) > MAX_SAMPLES
    if is_long or chance.random() > (SLOW if is_slow else FRACTION):
        return "accepted", ""
    return _computed(path, effective)


def _computed(path: Path, effective: bytes) -> tuple[str, str]:
    """Run a case as the executable does, and look at all that it leaves."""
    out = Path("o")
    out.mkdir()
    found = ask("run", path=str(path), folder="o", progress=0)
    files = {one.name: one.read_bytes() for one in out.iterdir() if one.is_file()}
    _fill_free_limits(found.get("levels", {}))
    if wrong := _no_numbers("", found):
        return "NaN", wrong
    for name, content in files.items():
        if bad := NO_NUMBER.search(content):
            return "NaN", f"{name}: {content[max(0, bad.start() - 80) : bad.end() + 20]!r}"
    if files["effective.nml"] != effective:
        return "mixed", "effective.nml is not the effective input"
    return "computed", ""


def _fill_free_limits(levels: dict[str, Any]) -> None:
    """Give 0 to the limits of the bands that say that they have none; no others may lack one."""
    for name in [name for name in levels if name.startswith("verdict_")]:
        free = np.array([word == "no limit" for word in levels[name].split("\n")])
        for limit in ("lower_limit_dB", "upper_limit_dB"):
            levels[limit] = np.where(free, 0.0, levels[limit])


def _no_numbers(name: str, found: object) -> str:
    """Return the name of the first entry that is not finite."""
    if isinstance(found, dict):
        inner = (_no_numbers(f"{name}.{key}", value) for key, value in found.items())
        return next(filter(None, inner), "")
    if isinstance(found, str):
        is_number = NO_NUMBER.search(found.encode(errors="surrogateescape"))
        return f"{name}: {found!r}" if is_number else ""
    # A warning that is about no range has none.
    is_range = re.search(r"warnings\.(value|low|high)$", name)
    return "" if is_range or np.isfinite(found).all() else name  # type: ignore[call-overload]
