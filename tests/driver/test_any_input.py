"""Whatever a user types: a result or one clear sentence, never anything else.

Files are damaged by the campaign of faults (`tests/faults/test_faults.py`).
"""

from __future__ import annotations

import io
import re
import subprocess
import tempfile
from contextlib import chdir, redirect_stderr, redirect_stdout
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from conftest import MINIMAL, naming
from hypothesis import given, settings, strategies as st

import thud
from thud import cli
from thud.base._schema import FLOORS, KEYS, MODELS, OPTIONAL_GROUPS
from thud.case.case import attribute_of

if TYPE_CHECKING:
    from thud.base.key import Key


@given(
    force=st.lists(st.floats(), max_size=50),
    sample_rate=st.floats(),
    bands=st.sampled_from(["octave", "third"]),
    method=st.sampled_from(["exact", "fft"]),
)
@settings(max_examples=200, deadline=None)
def test_any_record(force: list[float], sample_rate: float, bands: str, method: str) -> None:
    try:
        levels = thud.force_exposure_levels(force, sample_rate, bands, method)
    except thud.InputError as error:
        assert str(error)
    else:
        assert np.isfinite(levels).all()


# Numbers that Fortran or Python alone would read.
NO_NUMBERS = [
    "'heavy'", "heavy", "nan", "inf", "1e999", "1 2", "2,5", "2.5 kg", "1*", "1+3", "1.5d", "0x1p3",
]  # fmt: skip
# Keys without which a model is refused.
NEEDED = {
    "hunt_crossley": {"contact_time": 0.02, "restitution": 0.8},
    "measured_modes": {"frequency": 24.0, "damping_ratio": 0.1, "effective_mass": 2.5},
}
# Floors that name no file.
PLATES = [name for name in FLOORS if name not in {"measured_mobility", "modal_floor"}]


def ends(key: Key) -> tuple[float, float]:
    """Return the limits of a key, those that other keys or nothing set as common numbers."""
    low, high = (
        limit if isinstance(limit, float) and np.isfinite(limit) else other
        for limit, other in ((key.lower, -10.0), (key.upper, 10.0))
    )
    return low, high


def values(key: Key) -> st.SearchStrategy[object]:
    """Return the values that a key allows by itself."""
    low, high = ends(key)
    if key.kind == "choice":
        return st.sampled_from(key.choices)
    if key.kind in {"text", "texts"}:
        return st.text("aZ' é/&!=,", min_size=1, max_size=9).map(str.strip).filter(bool)
    if key.kind == "flag":
        return st.booleans()
    if key.kind == "whole" or key.whole:
        return st.integers(int(low), int(high))
    number = st.floats(low, high, exclude_min=key.lower_open, exclude_max=key.upper_open)
    if max(low, 1e-3) < min(high, 1e3):
        number |= st.floats(max(low, 1e-3), min(high, 1e3))
    return st.lists(number, min_size=1, max_size=3).map(tuple) if key.kind == "list" else number


def wrong_texts(key: Key) -> st.SearchStrategy[str]:
    """Return what no key of this kind is."""
    if key.kind == "choice":
        return st.sampled_from(["'cube'", "''", "1", f"'{key.choices[0][:-1]}'"])
    if key.kind == "flag":
        return st.sampled_from(["'yes'", "2", "maybe"])
    beyond = [
        repr(type(limit)(limit + sign * (abs(limit) or 1)))
        for limit, sign in ((key.lower, -1), (key.upper, 1))
        if isinstance(limit, float) and np.isfinite(limit)
    ]
    beyond += [repr(key.lower)] * key.lower_open * isinstance(key.lower, float)
    many = key.kind == "list"
    texts = [text for text in NO_NUMBERS if not (many and text in {"1 2", "2,5"})]
    return st.sampled_from(texts + beyond + ["1.5"] * (key.kind == "whole" or key.whole))


def typed(value: object) -> str:
    """Return a value as a user types it in a namelist."""
    if isinstance(value, bool):
        return ".true." if value else "F"
    if isinstance(value, str):
        return "'" + value.replace("'", "''") + "'"
    return ", ".join(map(repr, value)) if isinstance(value, tuple) else repr(value)


def namelist(chosen: dict[str, str], texts: dict[Key, str]) -> str:
    """Return the namelist of a model, a floor and some keys."""
    groups: dict[str, list[str]] = {"ball": [], "drop": []}
    for group, name in chosen.items():
        groups[group] = [f"name = '{name}'"]
    for key, text in texts.items():
        groups.setdefault(key.group, []).append(f"{key.name} = {text}")
    return "".join(f"&{group} {' '.join(lines)} /\n" for group, lines in groups.items())


@given(data=st.data())
@settings(max_examples=100, deadline=None)
def test_keys_of_any_namelist_are_taken_or_refused(data: st.DataObject, executable: str) -> None:
    """No key is ignored, and the executable refuses what Python refuses, in the same words."""
    model, floor = data.draw(st.sampled_from([*MODELS])), data.draw(st.sampled_from(PLATES))
    owners = {"", model, floor, "floor", *OPTIONAL_GROUPS} - {"unknowns"}
    keys = [one for one in KEYS if one.owner in owners and one.name != "name"]
    stated = {
        key: data.draw(values(key))
        for key in data.draw(st.lists(st.sampled_from(keys), max_size=3, unique=True))
    }
    needed = NEEDED.get(model, {})
    texts = {
        key: str(needed[key.name]) for key in KEYS if key.owner == model and key.name in needed
    }
    texts |= {key: typed(value) for key, value in stated.items()}
    wrong = data.draw(st.none() | st.sampled_from([k for k in keys if "text" not in k.kind]))
    if wrong:
        texts = {wrong: data.draw(wrong_texts(wrong))}
    with tempfile.TemporaryDirectory() as folder, chdir(folder):
        Path("case.nml").write_text(namelist({"model": model, "floor": floor}, texts))
        try:
            case = thud.read_case("case.nml")
        except thud.InputError as error:
            said = str(error)
        else:
            assert not wrong, texts
            for key, value in stated.items():
                found = getattr(getattr(case, attribute_of(key)), key.name)
                assert found == value, key
            thud.write_case(case, "again.nml")
            assert thud.read_case("again.nml") == thud.read_case("case.nml")
            return
        # What another key or group does not allow is named together with it.
        each = [(name,) for key in stated for name in (key.name, f"&{key.group}")]
        facts = [(f"&{wrong.group}", wrong.name)] if wrong else each
        assert any(re.search(naming("case.nml", *names), said) for names in facts), (said, texts)
        assert "\n" not in said
        done = subprocess.run(
            [executable, "case.nml"], capture_output=True, text=True, check=False, timeout=60
        )
        assert (done.returncode, done.stdout) == (1, "")
        assert done.stderr == f"thud: {said}\n"
        assert not Path("outputs").exists()


STUDY = "fixed.model = 'hollow_sphere'\nparameters.height.values = [0.5, 1]"
# Files that commands find, most of them of another kind than they want.
FILES = {
    "case.nml": MINIMAL, "bad.nml": "&ball", "study.toml": STUDY,
    "bad.toml": "parameters = 3", "levels.csv": "frequency,P1\n63,65\n125,64\n250,58\n500,56\n",
    "bad.csv": "a,b\n1,x\n", "a.wav": "RIFF", "report.json": "{}",
}  # fmt: skip
WORDS = [
    *FILES, "folder", "missing.nml", "case", "", " ", "-1", "1e999", "2", "é\n", "a\0b", "out",
    "case.nml/out", "--what", "rubber_ball", "P1",
]  # fmt: skip


@st.composite
def command_lines(draw: st.DrawFn) -> list[str]:
    """Return a command with options and their values, most of them with a file."""
    name = draw(st.sampled_from([*cli.COMMANDS, "swep", "study.toml", "--version", ""]))
    line, word = [name], st.sampled_from(WORDS)
    known = cli.COMMANDS[name].arguments if name in cli.COMMANDS else ()
    options = [entry for entry in known if entry[0][0].startswith("-")]
    fit = [path for path in FILES if path[path.index(".") :] in str(known[:1])]
    line += draw(st.lists(st.sampled_from(fit or WORDS) | word, min_size=len(fit) > 0, max_size=2))
    for names, how in draw(st.lists(st.sampled_from(options), max_size=3)) if options else ():
        line.append(draw(st.sampled_from(names)))
        if how.get("action", "append") == "append":
            line.append(draw(st.sampled_from(how.get("choices", WORDS)) | word))
    if any(names == ("--no-figures",) for names, _ in known):
        line.append("--no-figures")
    # The explorer would serve its page.
    return [*line, "missing.nml"] if name == "explore" else line


@given(line=command_lines())
@settings(max_examples=60, deadline=None)
def test_any_command_line_ends_with_a_code_and_one_sentence(line: list[str]) -> None:
    said = io.StringIO()
    with tempfile.TemporaryDirectory() as folder, chdir(folder):
        for path, text in FILES.items():
            Path(path).write_text(text)
        Path("folder").mkdir()
        with redirect_stdout(io.StringIO()), redirect_stderr(said):
            code = cli.main(line)
    errors = said.getvalue()
    assert code in {0, 1, 2, 3}
    assert "Traceback" not in errors
    # Each of several cases has its own.
    assert code in {0, 3} or 1 <= errors.count("\n") < len(line) + (len(line) < 2)
