"""What the commands print: widths, digits, colors and progress, on terminals and in logs."""

from __future__ import annotations

import fcntl
import os
import pty
import re
import shutil
import struct
import subprocess
import sys
import termios
from collections import Counter
from typing import TYPE_CHECKING

import pytest
from conftest import INPUTS, MINIMAL, REPOSITORY
from hypothesis import given, strategies as st

import thud
from thud import cli
from thud.base.tables import WIDTH, format_rows, wrap
from thud.cli.screen import RED, YELLOW

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from conftest import CaseFile

FLOORS = {path.stem: path for path in sorted((REPOSITORY / "inputs/floors").glob("*.nml"))}
CONTROL = re.compile(r"\x1b\[[0-9;]*[A-Za-z]")
COLOR_ENDS = "\x1b[0m"
# Numbers that are nothing but zeros, and negative zeros.
MEANINGLESS = re.compile(r"(?<![\d.])(?:[-−]0(?:\.0+)?|0\.000+)(?![\d.])")
# Names of commands with arguments; they are run in a directory with a copy of the inputs.
COMMANDS = {
    "assess": "assess inputs/rubber_ball_modal.nml",
    "compare": "compare inputs/rubber_ball_100cm.nml inputs/recordings/drop_1.csv "
    "inputs/rubber_ball_fe.nml inputs/rubber_ball_fe_viscous.nml inputs/rubber_ball_modal.nml",
    "fit a force": "fit --no-figures inputs/studies/fit_force.toml",
    "floor": "floor inputs/floors/concrete_140.nml inputs/floors/clt_200.nml "
    "inputs/floors/joists.nml inputs/floors/floating_soft.nml "
    "--construction 'CLT 160, gravel, screed on 10 MN/m3, ceiling'",
    "history": "history outputs/lab",
    "listen": "listen inputs/floors/concrete_140.nml inputs/floors/joists.nml",
    "measure": "measure --no-figures --config inputs/recordings/lab.toml -o outputs/lab "
    + " ".join(f"inputs/recordings/drop_{i}.wav" for i in range(1, 6)),
    "predict": "predict inputs/floors/concrete_180_ceiling.nml inputs/floors/joists.nml",
    "rate": "rate --no-figures inputs/floors/field_levels.csv --volume 50",
    "sensitivity": "sensitivity --no-figures inputs/studies/tyre.toml",
    "sweep": "sweep --no-figures inputs/studies/sweep.toml",
}
QUICK = ("assess", "predict", "rate")


def on_terminal(
    *command: str | Path, folder: Path, environment: Mapping[str, str] | None = None
) -> str:
    """Return what a command prints on a terminal of 80 columns."""
    own, others = pty.openpty()
    fcntl.ioctl(own, termios.TIOCSWINSZ, struct.pack("HHHH", 24, WIDTH, 0, 0))
    known = {key: value for key, value in os.environ.items() if key not in {"NO_COLOR", "COLUMNS"}}
    process = subprocess.Popen(
        list(map(str, command)), cwd=folder, stdin=others, stdout=others, stderr=others,
        env=known | {"TERM": "xterm-256color"} | dict(environment or {}), start_new_session=True,
    )  # fmt: skip
    os.close(others)
    printed = b""
    with process:
        while True:
            try:
                part = os.read(own, 65536)
            except OSError:  # the other end is closed
                break
            if not part:
                break
            printed += part
    os.close(own)
    return printed.decode().replace("\r\n", "\n")


def widest(printed: str) -> str:
    """Return the widest line of what a terminal shows."""
    return max(re.split(r"[\r\n]", CONTROL.sub("", printed)), key=len)


@pytest.fixture(scope="module")
def workplace(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a directory with the inputs."""
    folder = tmp_path_factory.mktemp("workplace")
    shutil.copytree(REPOSITORY / "inputs", folder / "inputs")
    return folder


def check_screen(printed: str) -> None:
    """Check widths and digits of a screen."""
    assert len(widest(printed)) <= WIDTH
    assert "Traceback" not in printed
    shown = CONTROL.sub("", re.sub(r"[^\n]*\r", "", printed))
    assert not MEANINGLESS.findall(shown)


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=() if n in QUICK else pytest.mark.slow) for n in COMMANDS]
)
def test_screens_of_commands_have_80_columns(name: str, workplace: Path) -> None:
    if name == "history":
        measure = f"{sys.executable} -m thud {COMMANDS['measure']} -q"
        subprocess.run(["/bin/sh", "-c", measure], cwd=workplace, check=True, capture_output=True)
    command = f"exec {sys.executable} -m thud {COMMANDS[name]}"
    printed = on_terminal("/bin/sh", "-c", command, folder=workplace)
    check_screen(printed)


@pytest.mark.parametrize(
    "path", [*INPUTS[:3], FLOORS["joists"], *(
        pytest.param(p, marks=pytest.mark.slow)
        for p in [*INPUTS[3:], *(path for name, path in FLOORS.items() if name != "joists")]
    )], ids=lambda path: path.stem,
)  # fmt: skip
def test_screens_of_runs_have_80_columns(path: Path, executable: str, workplace: Path) -> None:
    case = path.relative_to(REPOSITORY)
    for verbose in ([], ["--verbose"]):
        printed = on_terminal(executable, case, *verbose, folder=workplace)
        check_screen(printed)
        if path in FLOORS.values():
            assert "E+0" not in printed
            assert re.search(r"velocity of the floor +\d", printed)
    run = (sys.executable, "-m", "thud", "run", "--no-figures", case)
    check_screen(on_terminal(*run, folder=workplace))


def test_screens_of_options_have_80_columns(executable: str, tmp_path: Path) -> None:
    driver = [sys.executable, "-m", "thud", "measure", "--help"]
    for command in (*([executable, one] for one in ("--help", "--keys", "--nonsense")), driver):
        assert len(widest(on_terminal(*command, folder=tmp_path))) <= WIDTH


def test_numbers_of_the_solver_are_shown_if_asked_for(
    executable: str, workplace: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    case = "inputs/rubber_ball_fe.nml"
    words = ("minimum step", "shear modulus", "radial elements")
    brief = on_terminal(executable, case, folder=workplace)
    assert not any(word in brief for word in words)
    printed = on_terminal(executable, case, "--verbose", folder=workplace)
    assert all(word in printed for word in words)
    summary = (workplace / "outputs/rubber_ball_fe/summary.nml").read_text()
    assert "minimum_step" in summary
    assert cli.main(["run", "--verbose", "--quiet", case]) == 1
    assert "--verbose" in capsys.readouterr().err


def test_colors_are_those_of_the_terminal(
    executable: str, case_file: CaseFile, tmp_path: Path
) -> None:
    case_file(MINIMAL.replace("&ball", "&ball poisson_ratio = 0.4"), "ball.nml")
    commands = ([executable, "ball.nml"], [sys.executable, "-m", "thud", "run", "--no-figures"])
    for *start, name in (commands[0], [*commands[1], "ball.nml"]):
        error = on_terminal(*start, "nowhere.nml", folder=tmp_path)
        assert re.match(rf"\x1b\[{RED}mthud(-driver)?:\x1b\[0m nowhere\.nml", error)
        command = [*start, name]
        printed = on_terminal(*command, folder=tmp_path)
        assert (f"\x1b[{RED}mdoes not conform{COLOR_ENDS}" in printed) == (command[0] == executable)
        assert re.search(rf"\x1b\[{YELLOW}mthud(-driver)?:\x1b\[0m ball\.nml: &ball", printed)
        for environment in ({"NO_COLOR": "1"}, {"TERM": "dumb"}, {"TERM": ""}):
            printed = on_terminal(*command, folder=tmp_path, environment=environment)
            assert "does not conform" in printed
            assert "\x1b" not in printed
        log = subprocess.run(
            command, cwd=tmp_path, check=True, text=True, stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT, env=os.environ | {"TERM": "xterm-256color"},
        ).stdout  # fmt: skip
        assert re.search(r"(?m)^thud(-driver)?: .* poisson_ratio is 0\.4, rubbers have", log)
        assert not re.search(r"[\x00-\x09\x0b-\x1f]", log)


def test_progress_is_shown_on_a_terminal_only(tmp_path: Path) -> None:
    (tmp_path / "s.toml").write_text("parameters.height = {low = 0.5, high = 1.5, count = 4}")
    command = [sys.executable, "-m", "thud", "sweep", "--no-figures", "s.toml"]
    printed = on_terminal(*command, folder=tmp_path)
    assert re.search(r"\r100%\|.*\| 4/4 \[\d\d:\d\d<\d\d:\d\d, .*sample/s\]", printed)
    shutil.rmtree(tmp_path / "outputs")
    log = subprocess.run(command, cwd=tmp_path, check=True, text=True, capture_output=True)
    assert re.fullmatch(r"s: 4 samples of modal_ball\n", log.stderr)


def test_paths_stay_whole(capsys: pytest.CaptureFixture[str], case_file: CaseFile) -> None:
    case = case_file(MINIMAL)
    folder = case.parent / ("results of a long name " * 4).strip()
    assert cli.main(["run", "--no-figures", "-o", str(folder), str(case)]) == 0
    assert f"  Results:\n{folder}\n" in capsys.readouterr().out


def test_sentences_are_wrapped_between_words() -> None:
    text = f"{'a' * 40} {'b' * 40}\n# {'c' * 70} {'d' * 20}\n{'e' * 100} f"
    assert wrap(text).split("\n") == [
        "a" * 40, f"  {'b' * 40}", f"# {'c' * 70}", f"#   {'d' * 20}", "e" * 100, "  f",
    ]  # fmt: skip


TEXTS = st.text(st.sampled_from("ab -_±1"), max_size=60)


@given(st.integers(1, 14).flatmap(
    lambda count: st.lists(st.tuples(*[TEXTS] * count), min_size=1, max_size=4)
))  # fmt: skip
def test_tables_have_all_characters_in_80_columns(rows: list[tuple[str, ...]]) -> None:
    printed = format_rows(rows)
    assert max(map(len, printed.split("\n"))) <= WIDTH
    cells = Counter("".join("".join(row) for row in rows))
    assert Counter({**cells, " ": 0}) <= Counter(printed)


def test_zero_has_no_sign() -> None:
    quantity = thud.base.key.Quantity("q", "q", "", "", "", 1.0, 2, "")
    assert [quantity.show(value) for value in (-0.0, 0.0, -1.0)] == ["0", "0", "-1.00"]
