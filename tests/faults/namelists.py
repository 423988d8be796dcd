"""Namelists by grammar and mutation: refused in a sentence, or computed, written and read back."""

from __future__ import annotations

import itertools
import math
import re
import shutil
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from attempts import SANITIZED
from sentences import fault_of

import thud
from thud.base._schema import FLOORS, GROUPS, KEYS, MODELS, Compression, Modes, Room
from thud.base.bridge import ask
from thud.case.case import case_text

if TYPE_CHECKING:
    import random

    from thud.base.key import Key

NUMBERS = [
    "0", "-1", "1e-300", "1e300", "1e-160", "1e160", "nan", "inf", "-0.0", "1d0", "1e", "2*1.0",
    "3*", "9" * 400, "''", ".true.", "1,2", "", "(1,2)", "0x1p3", "é", "1e-9", "0.5", "100", "3",
    "1e5", "-1e-9", "2147483648", "'a' 'b'", "1 2", "5,,7", "1.0.0", "1e999", "tru", "'it''s'",
    '"x"', "+1", "1_8", "-", "+", ".", ".x", "number", "whole", "flag", "word", "list",
    "1 number", "1, list", "'a' word", "1, -", "-inf", "1e-310", "1+3", ".5", "5.", "t", ".f.",
]  # fmt: skip
INSERTIONS = [
    "&", "/", "'", '"', "!", "\0", "\t", "\n", "\r", "\r\n", "=", ",", "*", "é", "&ball", "&end",
    "&ball /", "x" * 300, "'" * 99, "(1)", "%", "$", "\udcff", "\ufeff",
    "&model name = 'two_mass' /", "mass = 2", "&" * 50, "&x" * 40, "&ball mass = 2 /", ";", "\\",
    "\x1b", "\x7f", "\u2028", "\u00a0",
]  # fmt: skip
# Fractions of the cases that are computed, by the time of their models.
FRACTIONS, SIMPLE = {"finite_element": 0.005, "modal_ball": 0.2}, 0.5
# Fraction of the cases without a model, and of those over a radiator, that are computed.
WITHOUT_MODEL, OVER_RADIATOR = 0.05, 0.2
# Floors over which a room may be.
RADIATORS = ("plate", "laminate_floor", "joist_floor")
# Groups that a case of their owner has.
NEEDED = (
    "modes", "mesh", "room", "compression", "measured_modes", "measured_mobility", "hunt_crossley",
)  # fmt: skip
# Samples beyond which the results of a case count as grown memory.
MANY_SAMPLES = 500_000
NO_NUMBER = re.compile(rb"(?i)(?<![a-z_])(nan|inf|infinity)(?![a-z_])|\*\*\*")


def attempt(chance: random.Random) -> tuple[str, str]:
    """Return what becomes of a namelist, and how to see it."""
    text = _text(chance)
    path = Path("case.nml")
    path.write_bytes(text.encode(errors="surrogateescape"))
    effective = b""
    try:
        effective = ask("effective_case", path=str(path))["case"].encode(errors="surrogateescape")
        word, detail = _tried(path, effective, chance)
    except thud.ThudError as error:
        detail = fault_of(error, "case.nml", text)
        word = "raw" if detail else "failed" if effective else "refused"
    finally:
        path.unlink()
        shutil.rmtree("o", ignore_errors=True)
    return word, f"{detail}: {text!r}" if detail else ""


def _tried(path: Path, effective: bytes, chance: random.Random) -> tuple[str, str]:
    if NO_NUMBER.search(re.sub(rb"'.*?'", b"", effective)):
        return "NaN", "in the effective input"
    if _effective(effective) != effective:
        return "mixed", "the effective input is not that of itself"
    model = re.search(rb"&model\s+name += '(\w+)'", effective)
    name = model[1].decode() if model else ""
    dice = chance.random()
    if dice > 0.99 or dice < 0.005:
        case = thud.read_case(path)
        if _effective(case_text(case)) != effective:
            return "mixed", "the case of Python is another one"
    fraction = WITHOUT_MODEL
    if name:
        fraction = FRACTIONS.get(name, SIMPLE)
    if any(b"'%s'" % floor.encode() in effective for floor in RADIATORS):
        fraction *= OVER_RADIATOR
    sampling = dict(re.findall(rb"^ +(sample_rate|duration) += (\S+)", effective, re.MULTILINE))
    if dice > fraction or math.prod(map(float, sampling.values())) > MANY_SAMPLES:
        return "accepted", ""
    # With sanitizers all takes ten times as long.
    if SANITIZED and chance.random() < 0.8:
        return "accepted", ""
    return _computed(path, effective, has_model=bool(name), again=chance.random() < 0.2)


def _effective(text: bytes) -> bytes:
    """Return the effective input of a text."""
    path = Path("again.nml")
    path.write_bytes(text)
    try:
        found: bytes = ask("effective_case", path="again.nml")["case"].encode(
            errors="surrogateescape"
        )
    except thud.InputError as error:
        return str(error).encode()
    finally:
        path.unlink()
    return found


def _computed(path: Path, effective: bytes, *, has_model: bool, again: bool) -> tuple[str, str]:
    """Run a case as the executable does, and look at all that it leaves."""
    out = Path("o")
    out.mkdir()
    found = ask("run", path=str(path), folder=str(out), progress=0)
    _fill_free_limits(found.get("levels", {}))
    if wrong := _no_numbers("", found):
        return "NaN", wrong
    files = {one.name: one.read_bytes() for one in out.iterdir() if one.is_file()}
    for name, content in files.items():
        may_be = any(word in content.lower() for word in (b"nan", b"inf", b"***"))
        if may_be and (bad := NO_NUMBER.search(content)):
            return "NaN", f"{name}: {content[max(0, bad.start() - 80) : bad.end() + 20]!r}"
    if files["effective.nml"] != effective:
        return "mixed", "effective.nml is not the effective input"
    wrong = ""
    if again and has_model:
        impact = thud.read_results(out)
        if not np.array_equal(impact.floor_force, found["force"]["floor_force_N"]):
            return "mixed", "results are not read as they were computed"
        wrong = _levels(impact)
    if wrong:
        return "NaN", wrong
    differing = _differing(files) if again else []
    return ("mixed", f"not reproduced: {differing}") if differing else ("computed", "")


def _differing(files: dict[str, bytes]) -> list[str]:
    """Return the files that a run of the effective input makes otherwise."""
    Path("o/effective.nml").rename("effective.nml")
    shutil.rmtree("o")
    Path("o").mkdir()
    try:
        ask("run", path="effective.nml", folder="o", progress=0)
    finally:
        Path("effective.nml").unlink()
    again = {one.name: one.read_bytes() for one in Path("o").iterdir() if one.is_file()}
    return [name for name in files.keys() | again if files.get(name) != again.get(name)]


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


def _levels(impact: thud.Impact) -> str:
    """Return what is not finite of the levels of an impact and what follows from them."""
    kinds = itertools.product(("octave", "third"), ("exact", "fft"), ("elastic", "floor"))
    for bands, method, force in kinds:
        if not np.isfinite(impact.levels(bands, method, force)).all():  # type: ignore[arg-type]
            return f"levels: {bands} {method} {force}"
    texts = [*impact.rows(), *(impact.on_floor.rows() if impact.on_floor else ())]
    if impact.case.room:
        texts += thud.predict_level(impact).rows()
    wrong = [row for row in texts if NO_NUMBER.search(" ".join(map(str, row)).encode())]
    return f"rows: {wrong}" if wrong else ""


def _text(chance: random.Random) -> str:
    """Return a namelist: groups of one model with some keys, most of them mutated a little."""
    model = chance.choice(list(MODELS))
    groups = [
        "ball",
        "drop",
        *chance.sample(["sampling", "levels", "limits", "case"], chance.randrange(3)),
    ]
    text = f"&model name = '{model}' /\n" if chance.random() < 0.95 else ""
    owners = [model]
    if chance.random() < 0.35:
        floor = chance.choice(list(FLOORS))
        owners += [floor] + ["room"] * (chance.random() < (0.5 if floor in RADIATORS else 0.01))
        text += f"&floor name = '{floor}' /\n"
    owners += ["modes"] * (chance.random() < 0.05) + ["compression"] * (chance.random() < 0.08)
    owners += ["unknowns"] * (chance.random() < 0.08)
    steady = chance.random()
    length = chance.choice([1, 1, 2, 3, 12])
    for group in groups:
        text += _group(group, [key for key in KEYS if key.group == group], length, steady, chance)
    seen = set(groups)
    for owner in owners:
        for group in {key.group: None for key in KEYS if key.owner == owner}:
            if group in seen or not (group in NEEDED or chance.random() < 0.8):
                continue
            seen.add(group)
            keys = [key for key in KEYS if (key.owner, key.group) == (owner, group)]
            text += _group(group, keys, length, steady, chance)
    for _ in range(chance.choice([0, 0, 0, 0, 0, 1, 2])):
        at = chance.randrange(len(text) + 1)
        insertion = chance.choice([*INSERTIONS, ""])
        text = text[:at] + insertion + text[at + chance.choice([0, 0, 1, 9]) :]
    return text


def _group(group: str, keys: list[Key], length: int, steady: float, chance: random.Random) -> str:
    """Return a group with some keys; lists of a group have one length, as a rule."""
    # What a case cannot do without is given.
    given = [key for key in keys if key.kind == "list" and group.startswith("measured")]
    if group == "hunt_crossley":
        given = [key for key in keys if key.name in ("contact_time", "restitution")]
    if group == "mesh":
        given = keys
    rest = [key for key in keys if key not in given]
    may_differ = group == "measured_modes" and chance.random() < 0.8
    text = "allow_mass_mismatch = .true. " if may_differ else ""
    chosen = given + chance.sample(rest, chance.randint(0, min(3, len(rest))))
    if chance.random() < 0.02:
        chosen = chance.sample(chosen, len(chosen) // 2)
    text += " ".join(f"{key.name} = {_value(key, length, steady, chance)}" for key in chosen)
    return f"&{group} {text} /\n"


def _value(key: Key, length: int, steady: float, chance: random.Random) -> str:
    """Return a value of a key; the steadier a case, the nearer to its usual values."""
    if chance.random() < 0.04 * (1 - steady):
        return chance.choice(NUMBERS)
    if key.kind == "choice":
        return f"'{chance.choice(key.choices)}'"
    if key.kind == "flag":
        return chance.choice([".true.", ".false."])
    if key.kind == "text":
        return chance.choice(["'text'", "'a.b-c_d'", "'é'", "'a/b'", "' '", "'..'"])
    if key.kind == "texts":
        return ", ".join(chance.choices(TEXTS, k=length))
    count = 1 if key.kind != "list" else length if chance.random() < 0.97 else chance.randrange(20)
    return ", ".join(_number(key, steady, chance) for _ in range(count))


def _number(key: Key, steady: float, chance: random.Random) -> str:
    low = key.lower if isinstance(key.lower, float) else 0.0
    high = key.upper if isinstance(key.upper, float) else 1e9
    usual = USUAL.get((key.owner, key.group, key.name))
    if chance.random() < 0.05 * (1 - steady):
        value = chance.choice([low, high, np.nextafter(low, high), np.nextafter(high, low)])
    elif key.name in ("radial_elements", "polar_elements"):
        value = chance.choice([2, 2, 3, 4] if key.name.startswith("r") else [8, 8, 12, 16, 20])
    elif usual and chance.random() < 0.5 + 0.5 * steady:
        value = usual * math.exp(chance.gauss(0, 0.7 * (1 - steady)))
    elif low < 0:
        value = chance.uniform(low, high)
    else:
        value = math.exp(chance.uniform(math.log(max(low, 1e-9)), math.log(max(high, 1e-8))))
    if chance.random() < 0.9 + 0.1 * steady:
        value = min(max(value, low), high)
    return str(round(value)) if key.whole and math.isfinite(value) else repr(float(value))


# Entries of lists of texts: keys of all models and of one, and other texts.
TEXTS = ("'mass'", "'height'", '"friction"', "'youngs_modulus'", "'it''s'", "'é'", "''", "'mass")


def _usual() -> dict[tuple[str, str, str], float]:
    """Return usual values of keys by owner, group and name: defaults, and some of lists."""
    owners: dict[str, object] = {
        **{group: kind() for group, kind in GROUPS.items()},
        **{name: kind() for name, kind in (MODELS | FLOORS).items()},
        "modes": Modes(), "compression": Compression(), "room": Room(),
    }  # fmt: skip
    found = {}
    for key in KEYS:
        default = getattr(owners.get(key.owner or key.group), key.name, None)
        if isinstance(default, int | float) and default > 0:
            found[key.owner, key.group, key.name] = float(default)
    lists = {
        ("measured_modes", "frequency"): 40.0, ("measured_modes", "damping_ratio"): 0.1,
        ("measured_modes", "effective_mass"): 1.0, ("hunt_crossley", "contact_time"): 0.02,
        ("hunt_crossley", "restitution"): 0.6, ("measured_mobility", "pole_frequency"): 60.0,
        ("measured_mobility", "damping_ratio"): 0.03, ("measured_mobility", "residue_real"): 0.01,
        ("measured_mobility", "residue_imaginary"): 1e-4,
        ("plate", "point_x"): 1.0, ("plate", "point_y"): 1.0,
        ("laminate_floor", "point_x"): 1.0, ("laminate_floor", "point_y"): 1.0,
        ("joist_floor", "point_x"): 1.0, ("joist_floor", "point_y"): 1.0,
        ("room", "reverberation_time"): 0.5, ("room", "wall_lengths"): 4.0,
        ("modal_ball", "static_families"): 12.0,
    }  # fmt: skip
    found |= {(owner, owner, name): value for (owner, name), value in lists.items()}
    prony = {"prony_share": 0.3, "prony_time": 0.001}
    return found | {("finite_element", "material", name): v for name, v in prony.items()}


USUAL = _usual()
