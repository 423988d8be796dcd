"""The list of kinds: what follows from a line of it."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest
from conftest import REPOSITORY, names_in, python

import thud
from thud import cli
from thud.studies.kinds import KINDS, result_type


@pytest.mark.parametrize("name", KINDS)
def test_every_kind_follows_from_its_line(name: str) -> None:
    assert result_type(name).kind == name
    assert result_type(name) is getattr(thud, name.capitalize())
    assert callable(getattr(thud, name))
    assert cli.COMMANDS[name].help == KINDS[name].help


@pytest.mark.parametrize(
    ("name", "size"), [("design", 0), ("sensitivity", 16), ("sweep", 0), ("uncertainty", 30)]
)
def test_command_writes_files(
    name: str, size: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    design = f"design.size = {size}\n" if size else ""
    more = ["study_indices.csv"] if name == "sensitivity" else []
    values = "low=2, high=3" if size else "values=[2, 3]"
    text = f"parameters = {{mass={{{values}}}, height={{{values}}}}}"
    (tmp_path / "study.toml").write_text(design + text)
    assert cli.main([name, str(tmp_path / "study.toml"), "-o", str(tmp_path / "out")]) == 0
    written = names_in(tmp_path / "out")
    assert written == sorted(["study.nc", "study.svg", *more])
    # A table, and the files.
    assert capsys.readouterr().out.count("\n") > 2
    if more:
        lines = (tmp_path / "out" / more[0]).read_text().splitlines()
        assert lines[0] == "output,parameter,first_order,first_order_interval,total,total_interval"
        assert len(lines) == 1 + 7 * 2


@pytest.mark.slow
def test_kind_is_added_by_one_file_and_one_line(tmp_path: Path) -> None:
    page = (REPOSITORY / "docs/how_to_add.md").read_text()
    text = page.partition("## A kind of study")[2].partition("## A figure")[0]
    module, line = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    copy = tmp_path / "thud"
    shutil.copytree(Path(thud.__file__).parent, copy, ignore=shutil.ignore_patterns("__pycache__"))
    (copy / "studies/scatter.py").write_text(module)
    kinds = copy / "studies/kinds.py"
    kinds.write_text(kinds.read_text().replace("KINDS = {\n", f"KINDS = {{\n{line}"))
    with (copy / "__init__.pyi").open("a") as stub:
        stub.write(re.findall(r"`(from .studies.scatter [^`]*)`", text)[0] + "\n")
    (tmp_path / "mass.toml").write_text("design.size = 9\nparameters.mass.std = 0.1")
    for command in (
        ["-m", "thud", "scatter", "mass.toml"],
        ["-c", "import thud; print(thud.scatter('mass.toml').table())"],
    ):
        done = python(*command, cwd=tmp_path)
        assert done.returncode == 0, done.stderr
        assert "peak force, N" in done.stdout
    names = names_in(tmp_path / "outputs/mass")
    assert names == ["mass.nc", "mass.svg"]
