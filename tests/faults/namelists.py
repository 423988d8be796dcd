"""Namelists by grammar and mutation: refused in a sentence, or computed in another process."""

from __future__ import annotations

import json
import math
import re
import signal
import subprocess
import sys
import warnings
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from campaign import Finding

import thud
from thud._schema import GROUPS, KEYS, MODELS

if TYPE_CHECKING:
    import random
    from collections.abc import Iterable

    from thud.key import Key

# Seconds that a case may take, and a share of them before it counts as hung.
CASE_TIME, SHARE_TIME = 20, 900
# Models that take too long to be computed often, and the part of their cases that is.
SLOW = {"modal_ball": 0.05, "finite_element": 0.01}
NUMBERS = ["0", "-1", "1e-300", "1e300", "nan", "inf", "-0.0", "1d0", "1e", "2*1.0", "9" * 400,
           "''", ".true.", "1,2", "", "(1,2)", "0x1p3", "é", "1e-9", "0.5", "100", "3"]  # fmt: skip
INSERTIONS = ["&", "/", "'", '"', "!", "\0", "\t", "\n", "\r", "=", ",", "*", "é", "&ball", "&end",
              "x" * 300, "'" * 99, "(1)", "%", "$"]  # fmt: skip


def check_namelists(tries: list[tuple[int, random.Random]], _: Path) -> Iterable[Finding]:
    """Read, check and compute namelists in another process, which names each before it begins."""
    texts = {number: _text(chance) for number, chance in tries}
    numbers = list(texts)
    while numbers:
        given = json.dumps([(number, texts[number]) for number in numbers])
        command = [sys.executable, __file__]
        try:
            done = subprocess.run(
                command,
                input=given,
                capture_output=True,
                text=True,
                timeout=SHARE_TIME,
                check=False,
            )
            said, word = done.stdout, "crashed"
        except subprocess.TimeoutExpired as error:
            said = error.stdout.decode() if isinstance(error.stdout, bytes) else error.stdout or ""
            word = "hung"
        found = [line.split("\t", 2) for line in said.splitlines()]
        for number, verdict, detail in (line for line in found if len(line) == 3):
            text = texts[int(number)] if verdict in ("crashed", "hung", "NaN", "mixed") else ""
            yield Finding(verdict, f"{detail}: {text!r}" if text else "")
        numbers = numbers[sum(len(line) == 3 for line in found) :]
        if numbers:
            # The process has ended with the first of those that are left.
            yield Finding(word, repr(texts[numbers.pop(0)]))


def _text(chance: random.Random) -> str:
    """Return a namelist: groups of one model with some keys, most of them mutated a little."""
    model = chance.choice(list(MODELS))
    groups = [
        "ball",
        "drop",
        "sampling",
        "levels",
        "limits",
        "case",
        "modes",
        "compression",
        "floor",
    ]
    text = f"&model name = '{model}' /\n"
    for group in ("ball", "drop", *chance.sample(groups[2:], chance.randrange(4))):
        text += f"&{group} {_keys([k for k in KEYS if k.group == group], chance)} /\n"
    owned = {key.group for key in KEYS if key.owner == model}
    for group in chance.sample(sorted(owned), chance.randint(0, len(owned))):
        keys = [key for key in KEYS if key.owner == model and key.group == group]
        text += f"&{group} {_keys(keys, chance)} /\n"
    for _ in range(chance.choice([0, 0, 0, 1, 2])):
        at = chance.randrange(len(text) + 1)
        text = (
            text[:at] + chance.choice([*INSERTIONS, ""]) + text[at + chance.choice([0, 0, 1, 9]) :]
        )
    return text


def _keys(keys: list[Key], chance: random.Random) -> str:
    """Return some keys with values inside, at or outside their ranges."""
    chosen = chance.sample(keys, chance.randint(0, min(3, len(keys))))
    return " ".join(f"{key.name} = {_value(key, chance)}" for key in chosen)


def _value(key: Key, chance: random.Random) -> str:
    """Return a value of a key, as a rule inside its range, near its usual value."""
    if chance.random() < 0.1:
        return chance.choice(NUMBERS)
    if key.kind == "choice":
        return f"'{chance.choice(key.choices)}'"
    if key.kind == "flag":
        return chance.choice([".true.", ".false."])
    if key.kind == "text":
        return "'text'"
    low = key.lower if isinstance(key.lower, float) else 0.0
    high = key.upper if isinstance(key.upper, float) else 1e9
    usual = USUAL.get((key.owner, key.group, key.name))
    if usual and chance.random() < 0.8:
        value = usual * math.exp(chance.gauss(0, 0.7))
    else:
        value = math.exp(chance.uniform(math.log(max(low, 1e-9)), math.log(max(high, 1e-8))))
    return str(round(value)) if key.whole else repr(value)


def _usual() -> dict[tuple[str, str, str], float]:
    """Return the defaults of keys by owner, group and name."""
    owners: dict[str, object] = {group: kind() for group, kind in GROUPS.items()}
    owners |= {name: kind() for name, kind in MODELS.items()}
    found = {}
    for key in KEYS:
        default = getattr(owners.get(key.owner or key.group), key.name, None)
        if isinstance(default, int | float) and default > 0:
            found[key.owner, key.group, key.name] = float(default)
    return found


USUAL = _usual()


class _Late(Exception):  # noqa: N818 - no error
    """A case takes too long."""


def _late(*_: object) -> None:
    raise _Late


def _try(number: int, text: str) -> tuple[str, str]:
    """Return what becomes of a namelist."""
    path = Path(f"case_{number}.nml")
    path.write_text(text, encoding="utf-8")
    try:
        case = thud.read_case(path)
        model = case.model.name if case.model else ""
        if not model or number % 1000 >= 1000 * SLOW.get(model, 1):
            return "accepted", ""
        impact = thud.solve_case(case)
        levels = [impact.levels(force=force) for force in ("elastic", "floor")]
    except thud.ThudError as error:
        said = str(error)
        if re.search(r"\bNaN\b", said) and "nan" not in text.lower():
            return "NaN", said
        return ("refused", "") if len(said) < 1500 else ("crashed", f"a sentence of {len(said)}")
    finally:
        path.unlink()
    arrays = [impact.floor_force, impact.elastic_force, *levels]
    whole = all(np.isfinite(array).all() for array in arrays[:2])
    numbers = (impact.contact_time, impact.restitution, impact.peak_force, impact.impulse)
    if (
        not whole
        or any(np.isnan(array).any() for array in arrays)
        or not np.isfinite(numbers).all()
    ):
        return "NaN", "in results"
    return "computed", ""


def main() -> None:
    """Try the namelists of the standard input; print number, verdict and detail of each."""
    warnings.simplefilter("ignore")
    signal.signal(signal.SIGALRM, _late)
    for number, text in json.load(sys.stdin):
        signal.alarm(CASE_TIME)
        try:
            verdict, detail = _try(number, text)
        except _Late:
            verdict, detail = "stopped", ""
        except Exception as error:  # noqa: BLE001 - that is the question
            verdict, detail = "crashed", repr(error)
        signal.alarm(0)
        detail = " ".join(detail.split())
        sys.stdout.write(f"{number}\t{verdict}\t{detail}\n")
        sys.stdout.flush()


if __name__ == "__main__":
    import os
    import tempfile

    with tempfile.TemporaryDirectory(prefix="thud_faults_") as place:
        os.chdir(place)
        main()
        os.chdir("/")
