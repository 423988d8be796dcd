"""Make the manual pages and the completions of shells in share, of what both commands say.

Run by ``./bootstrap setup``: python -P driver/generate_manual.py THUD [DIRECTORY], with the path of
the executable.
"""

from __future__ import annotations

import re
import subprocess
import sys
import textwrap
from argparse import ArgumentParser
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import shtab

from thud.cli import COMMANDS, new_parser
from thud.cli.command import Argument, Command, argument

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

REPOSITORY = Path(__file__).parents[1]
DESCRIPTIONS = {
    "thud": "Drops the source of a case and leaves its force, its levels and the verdict, and the "
    "input with all defaults, as files in a directory; prints the verdict.",
    "thud-driver": "Runs cases as thud(1) does and draws them; assesses recordings, compares, fits "
    "and varies. thud-driver COMMAND --help shows the arguments of one command.",
}
COMPLETIONS = {
    "bash": "bash-completion/completions/{}",
    "zsh": "zsh/site-functions/_{}",
    "fish": "fish/vendor_completions.d/{}.fish",
}
# A line of the executable's help: short and long name, value, meaning.
OPTION = re.compile(r"^  (-\w, )?(--\w+)? ?([A-Z][\w.]*)? +(\S.*(?:\n {9,}.*)*)", re.MULTILINE)
# Of a case with all keys: a group, or a comment of one or more lines and its key; optional groups
# are commented out.
KEY = re.compile(
    r"^(?:! )?(?:(&\w+)|   ! ((?:.+\n(?:! )?   ! )*.+)\n(?:! )?   (\w+ = .*))$", re.MULTILINE
)
WIDTH = 78


class Program(NamedTuple):
    """What a program says of itself; `calls` are the ways to call it.

    `exit_codes` are numbers, each with its meaning, with commas between.
    """

    name: str
    purpose: str
    calls: list[str]
    arguments: tuple[Argument, ...]
    commands: Mapping[str, Command]
    exit_codes: str


def executable(text: str) -> Program:
    """Return the executable by its help."""
    purpose, calls, options = re.split(r"\n\n(?:Usage: )?", text)[:3]
    arguments = []
    for short, long, value, meaning in OPTION.findall(f"\n{options}\n"):
        names = [name for name in (short.strip(", "), long) if name] or [value]
        settings = {"metavar": value} if value else {"action": "store_true"}
        arguments.append(argument(*names, help=" ".join(meaning.split()), **settings))
    codes = text.split("Exit codes: ")[1]
    calls = " ".join(calls.split())
    return Program("thud", purpose, calls.split(" | "), tuple(arguments), {}, codes)


def driver() -> Program:
    """Return thud-driver by its table of commands."""
    parser = new_parser()
    purpose, epilog = str(parser.description), str(parser.epilog)
    arguments = (
        argument("-h", "--help", action="store_true", help="show the commands, or those of one"),
        argument("--version", action="store_true", help="show the version"),
    )
    codes = epilog.removeprefix("Exit codes: ")
    calls = ["thud-driver COMMAND ...", "--help", "--version"]
    return Program("thud-driver", purpose, calls, arguments, COMMANDS, codes)


def completion(program: Program, shell: str) -> str:
    """Return the completion of a program for a shell."""
    parser = ArgumentParser(prog=program.name, add_help=False)
    add_arguments(parser, program.arguments)
    if program.commands:
        commands = parser.add_subparsers(metavar="COMMAND")
        for name, command in program.commands.items():
            add_arguments(commands.add_parser(name, help=command.help), command.arguments)
    # In zsh, shtab completes the first of several files only.
    return shtab.complete(parser, shell=shell).replace('"(*):', '"*:').rstrip() + "\n"


def add_arguments(parser: ArgumentParser, arguments: Iterable[Argument]) -> None:
    """Add arguments to a parser; those that are files or directories are completed as such."""
    for names, settings in arguments:
        action = parser.add_argument(*names, **settings)
        values = str(settings.get("metavar")).split("|")
        endings = [Path(value).suffix for value in values]
        if "DIR" in values:
            action.complete = shtab.DIRECTORY
        elif all(endings):
            patterns = [f"*{ending}" for ending in endings]
            action.complete = shtab.glob(*patterns) | {"zsh": f"_files -g '{' '.join(patterns)}'"}
        elif any(endings) or {"FILE", "REPORT"} & set(values):
            action.complete = shtab.FILE


def value_of(names: tuple[str, ...], settings: Mapping[str, object]) -> str:
    """Return the word for the value of an argument; empty where it takes none."""
    choices = settings.get("choices")
    if isinstance(choices, tuple):
        return "|".join(choices)
    if settings.get("action"):
        return ""
    return str(settings.get("metavar", names[-1].lstrip("-").upper()))


def call(arguments: Iterable[Argument]) -> str:
    """Return arguments as a command takes them."""
    options, words = [], []
    for names, settings in arguments:
        value = value_of(names, settings)
        if names[0].startswith("-"):
            options.append(f"[{names[-1]} {value}".rstrip() + "]")
        else:
            form = {"+": "{} ...", "?": "[{}]"}.get(str(settings.get("nargs")), "{}")
            words.append(form.format(value))
    return " ".join([*options, *words])


def plain(text: str) -> str:
    """Return prose in roff, with options and numbers as they are typed."""
    text = re.sub(r"(?<!\w)-[\w-]+", lambda found: roff(found[0]), text)
    text = textwrap.fill(text, WIDTH, break_long_words=False, break_on_hyphens=False)
    # At the beginning of a line both would be commands.
    return re.sub(r"^(?=[.'])", r"\\&", text, flags=re.MULTILINE)


def roff(text: str) -> str:
    """Return text in roff as it is typed."""
    return text.replace("\\", "\\e").replace("-", "\\-").replace("'", "\\(aq")


def typed(text: str) -> str:
    """Return what is typed, in bold."""
    return f"\\fB{roff(text)}\\fR"


def entry(term: str, meaning: str) -> str:
    """Return an entry of a list of terms in roff."""
    return f".TP\n{term}\n{plain(meaning)}\n"


def entries(arguments: Iterable[Argument]) -> str:
    """Return the entries of arguments."""
    text = ""
    for names, settings in arguments:
        value = value_of(names, settings)
        term = f"\\fI{roff(value)}\\fR" if value else ""
        if names[0].startswith("-"):
            term = " ".join(filter(None, [", ".join(map(typed, names)), term]))
        text += entry(term, settings["help"])
    return text


def manual(program: Program, date: str, keys: str = "") -> str:
    """Return the manual page of a program, with the keys of its input as ``thud --keys`` tells."""
    name = program.name
    purpose = program.purpose[0].lower() + program.purpose[1:].rstrip(".")
    calls = [f"{typed(name)} {plain(one.removeprefix(name).strip())}\n" for one in program.calls]
    parts = [
        f'.TH {roff(name.upper())} 1 {date} thud "User Commands"\n',
        # Neither hyphens in names that are typed, nor gaps in lines.
        f".nh\n.ad l\n.SH NAME\n{roff(name)} \\- {purpose}\n",
        ".SH SYNOPSIS\n" + ".br\n".join(calls),
        f".SH DESCRIPTION\n{plain(DESCRIPTIONS[name])}\n",
        f".SH OPTIONS\n{entries(program.arguments)}",
    ]
    if program.commands:
        parts.append(".SH COMMANDS\n")
    for word, command in program.commands.items():
        usage = f"{typed(f'{name} {word}')} {plain(call(command.arguments))}"
        parts.append(f".SS {word}\n{plain(command.help)}\n.PP\n{usage}\n")
        parts.append(entries(command.arguments))
    if keys:
        parts.append(".SH KEYS\nGroups and keys of an input file, with their defaults. SI units.\n")
    for group, comment, default in KEY.findall(keys):
        meaning = " ".join(re.sub(r"\n(! )?   ! ", "\n", comment).split())
        parts.append(f".SS {group}\n" if group else entry(typed(default), meaning))
    parts.append('.SH "EXIT STATUS"\n')
    for number, meaning in re.findall(r"(\d+) ([^,]+?)[,.]", program.exit_codes):
        parts.append(entry(typed(number), " ".join(meaning.split())))
    other = "thud" if program.commands else "thud-driver"
    parts.append(f'.SH "SEE ALSO"\n.BR {roff(other)} (1)\n')
    return "".join(parts)


def main() -> None:
    """Write the files below a directory, by default that of the project."""
    program, *rest = sys.argv[1:]
    share = Path(*rest or [REPOSITORY]) / "share"
    told = {
        option: subprocess.run([program, option], capture_output=True, text=True, check=True).stdout
        for option in ("--help", "--keys")
    }
    citation = (REPOSITORY / "CITATION.cff").read_text(encoding="utf-8")
    date = citation.partition("date-released: ")[2].partition("\n")[0]
    thud = executable(told["--help"])
    texts = {
        "man/man1/thud.1": manual(thud, date, told["--keys"]),
        "man/man1/thud-driver.1": manual(driver(), date),
    }
    for shell, path in COMPLETIONS.items():
        texts |= {path.format(one.name): completion(one, shell) for one in (thud, driver())}
    for path, text in texts.items():
        (share / path).parent.mkdir(parents=True, exist_ok=True)
        (share / path).write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
