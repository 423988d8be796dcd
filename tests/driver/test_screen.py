"""What the commands print: widths, digits, colors and progress, on terminals and in logs."""

from __future__ import annotations

import fcntl
import io
import os
import pty
import re
import shlex
import shutil
import struct
import subprocess
import termios
from collections import Counter
from contextlib import contextmanager, redirect_stderr, redirect_stdout, suppress
from typing import TYPE_CHECKING

import pytest
from conftest import INPUTS, MINIMAL, REPOSITORY, python
from hypothesis import given, strategies as st

import thud
from thud import cli
from thud.base.tables import WIDTH, format_rows, wrap
from thud.cli.screen import RED, YELLOW

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from conftest import CaseFile, Run

FLOORS = {path.stem: path for path in sorted((REPOSITORY / "inputs/floors").glob("*.nml"))}
CONTROL = re.compile(r"\x1b\[[0-9;]*[A-Za-z]")
TERMINAL = {"TERM": "xterm-256color", "COLUMNS": str(WIDTH)}
# Environments in which nothing is colored.
PLAIN = [{"NO_COLOR": "1"}, {"TERM": "dumb"}, {"TERM": ""}]
# Numbers that are nothing but zeros, and negative zeros.
MEANINGLESS = re.compile(r"(?<![\d.])(?:[-−]0(?:\.0+)?|0\.000+)(?![\d.])")
# Names of commands of the driver with arguments, in a directory with a copy of the inputs.
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


def on_terminal(*command: str | Path, **environment: str) -> str:
    """Return what the executable prints on a terminal of 80 columns."""
    own, others = pty.openpty()
    fcntl.ioctl(own, termios.TIOCSWINSZ, struct.pack("HHHH", 24, WIDTH, 0, 0))
    known = {key: value for key, value in os.environ.items() if key != "NO_COLOR"}
    process = subprocess.Popen(
        list(map(str, command)), stdin=others, stdout=others, stderr=others,
        env=known | TERMINAL | environment, start_new_session=True,
    )  # fmt: skip
    os.close(others)
    printed = b""
    # Reading fails once the other end is closed.
    with process, os.fdopen(own, "rb", buffering=0) as screen, suppress(OSError):
        while part := screen.read(65536):
            printed += part
    return printed.decode().replace("\r\n", "\n")


class Terminal(io.StringIO):
    """What the driver takes for a terminal."""

    def isatty(self) -> bool:
        """Return that it is one."""
        return True


@contextmanager
def terminal(**environment: str) -> Iterator[Terminal]:
    """Let this process print on a terminal of 80 columns."""
    screen = Terminal()
    with pytest.MonkeyPatch.context() as patch, redirect_stdout(screen), redirect_stderr(screen):
        patch.delenv("NO_COLOR", raising=False)
        for name, value in {**TERMINAL, **environment}.items():
            patch.setenv(name, value)
        yield screen


def screen_of(command: str) -> str:
    """Return what a command of the driver prints on a terminal."""
    with terminal() as screen:
        assert cli.main(shlex.split(command)) == 0
    return screen.getvalue()


@pytest.fixture(scope="module")
def inputs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a directory with the inputs."""
    folder = tmp_path_factory.mktemp("workplace")
    shutil.copytree(REPOSITORY / "inputs", folder / "inputs")
    # The screen of few samples is that of many.
    study = folder / "inputs/studies/tyre.toml"
    study.write_text(study.read_text().replace("size = 512", "size = 16"))
    return folder


@pytest.fixture
def workplace(inputs: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Make the directory with the inputs the working directory."""
    monkeypatch.chdir(inputs)


def check_screen(printed: str) -> None:
    """Check widths and digits of a screen."""
    lines = re.split(r"[\r\n]", CONTROL.sub("", printed))
    assert len(max(lines, key=len)) <= WIDTH
    assert "Traceback" not in printed
    shown = CONTROL.sub("", re.sub(r"[^\n]*\r", "", printed))
    assert not MEANINGLESS.findall(shown)


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=() if n in QUICK else pytest.mark.slow) for n in COMMANDS]
)
@pytest.mark.usefixtures("workplace")
def test_screens_of_commands_have_80_columns(name: str) -> None:
    if name == "history":
        screen_of(f"{COMMANDS['measure']} -q")
    check_screen(screen_of(COMMANDS[name]))


@pytest.mark.parametrize(
    "path", [INPUTS[0], FLOORS["joists"], *(
        pytest.param(p, marks=pytest.mark.slow)
        for p in [*INPUTS[1:], *(path for name, path in FLOORS.items() if name != "joists")]
    )], ids=lambda path: path.stem,
)  # fmt: skip
@pytest.mark.usefixtures("workplace")
def test_screens_of_runs_have_80_columns(path: Path, executable: str) -> None:
    case = path.relative_to(REPOSITORY)
    for verbose in ([], ["--verbose"]):
        printed = on_terminal(executable, case, *verbose)
        check_screen(printed)
        if path in FLOORS.values():
            assert "E+0" not in printed
            assert re.search(r"velocity of the floor +\d", printed)
    check_screen(screen_of(f"run --no-figures {case}"))


def test_screens_of_options_have_80_columns(executable: str) -> None:
    for option in ("--help", "--keys", "--nonsense"):
        check_screen(on_terminal(executable, option))
    check_screen(screen_of("measure --help"))


def test_numbers_of_the_solver_are_shown_if_asked_for(run: Run, case_file: CaseFile) -> None:
    mesh = "&mesh radial_elements = 4, polar_elements = 32 /\n"
    case = case_file(MINIMAL.replace("hollow_sphere", "finite_element") + mesh)
    words = ("minimum step", "shear modulus", "radial elements")
    brief, verbose = run(case).stdout, run(case, "--verbose").stdout
    assert [(word in brief, word in verbose) for word in words] == [(False, True)] * 3
    assert "minimum_step" in (case.parent / "outputs/case/summary.nml").read_text()


@pytest.mark.usefixtures("working_directory")
def test_colors_are_those_of_the_terminal(
    executable: str, case_file: CaseFile, run: Run, tmp_path: Path
) -> None:
    case_file(MINIMAL.replace("&ball", "&ball poisson_ratio = 0.4"), "ball.nml")
    error = on_terminal(executable, "nowhere.nml")
    assert error.startswith(f"\x1b[{RED}mthud:\x1b[0m nowhere.nml")
    printed = on_terminal(executable, "ball.nml")
    assert f"\x1b[{RED}mdoes not conform\x1b[0m" in printed
    assert f"\x1b[{YELLOW}mthud:\x1b[0m ball.nml: &ball" in printed
    command = "run --no-figures ball.nml"
    assert f"\x1b[{YELLOW}mthud-driver:\x1b[0m ball.nml: &ball" in screen_of(command)
    with terminal() as screen:
        assert cli.main(["run", "nowhere.nml"]) == 1
    assert screen.getvalue().startswith(f"\x1b[{RED}mthud-driver:\x1b[0m nowhere.nml")
    for environment in PLAIN:
        printed = on_terminal(executable, "ball.nml", **environment)
        with terminal(**environment) as screen:
            assert cli.main(command.split()) == 0
        for text in (printed, screen.getvalue()):
            assert "does not conform" in text
            assert "\x1b" not in text
    # In a log a warning is one line, and nothing controls a terminal.
    for log in (run("ball.nml"), python("-m", "thud", *command.split(), cwd=tmp_path)):
        assert re.search(r"(?m)^thud(-driver)?: .* poisson_ratio is 0\.4, rubbers have", log.stderr)
        assert not re.search(r"[\x00-\x09\x0b-\x1f]", log.stdout + log.stderr)


@pytest.mark.usefixtures("working_directory")
def test_progress_is_shown_on_a_terminal_only(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "s.toml").write_text("parameters.height = {low = 0.5, high = 1.5, count = 4}")
    printed = screen_of("sweep --no-figures s.toml")
    assert re.search(r"\r100%\|.*\| 4/4 \[\d\d:\d\d<\d\d:\d\d, .*sample.*\]", printed)
    assert cli.main(["sweep", "--no-figures", "--replace", "s.toml"]) == 0
    assert capsys.readouterr().err == "s: 4 samples of modal_ball\n"
    assert (tmp_path / "outputs/s/s.nc").exists()


def test_paths_stay_whole(capsys: pytest.CaptureFixture[str], case_file: CaseFile) -> None:
    case = case_file(MINIMAL)
    folder = case.parent / ("results of a long name " * 4).strip()
    assert cli.main(["run", "--no-figures", "-o", str(folder), str(case)]) == 0
    assert f"  Results:\n{folder}\n" in capsys.readouterr().out


def test_sentences_are_wrapped_between_words() -> None:
    text = f"{'a' * 40} {'b' * 40}\n# {'c' * 70} {'d-' * 9}d\n{'e' * 100} f"
    assert wrap(text).split("\n") == [
        "a" * 40, f"  {'b' * 40}", f"# {'c' * 70}", f"#   {'d-' * 9}d", "e" * 100, "  f",
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
