"""The command that copies the inputs of the documentation."""

from __future__ import annotations

import shutil
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING

from thud.base.checks import refuse
from thud.base.files import own_path
from thud.cli.command import QUIET, Command, argument

if TYPE_CHECKING:
    import argparse


def copy_examples(options: argparse.Namespace) -> int:
    """Copy the inputs into a directory of their own; return the exit code."""
    target = Path(options.directory)
    if target.exists() or target.is_symlink():
        refuse(f"{target} exists", "a directory that is to be made")
    with resources.as_file(resources.files("thud") / "inputs") as source:
        if not source.is_dir():
            refuse("this package has no inputs", "an installed one; in a clone they are in inputs/")
        target.parent.mkdir(parents=True, exist_ok=True)
        part = own_path(target.with_name(f".{target.name}.part"))
        try:
            # Installers compile the scripts.
            shutil.copytree(source, part, ignore=shutil.ignore_patterns("__pycache__"))
            part.rename(target)
        except shutil.Error as error:
            refuse(f"{target} cannot be written", "a place with space that you may write to", error)
        finally:
            shutil.rmtree(part, ignore_errors=True)
    if not options.quiet:
        print(f"Inputs: {target}")
    return 0


EXAMPLES = Command(
    "copy the inputs of the documentation: cases, studies, recordings, floors",
    (
        argument(
            "directory",
            nargs="?",
            default="inputs",
            metavar="DIR",
            help="directory that is made (default: inputs)",
        ),
        QUIET,
    ),
    copy_examples,
    "what was copied is kept",
)
