"""Every public name: found, documented, typed, and with a hint where it is misspelt."""

from __future__ import annotations

import ast
import dataclasses
import inspect
import os
import pydoc
import re
from pathlib import Path
from typing import get_origin

import pytest
from conftest import REPOSITORY, naming, python
from test_examples import EXAMPLES

import thud
from thud.base._schema import MODELS

DRIVER = REPOSITORY / "driver"
# What NumPy's own types hold: shapes of any dimension, data of any type.
NUMPY = r"tuple\[Any, \.\.\.\]|numpy\.(dtype|generic)\[Any\]"
WRONG = {
    'thud.solve(momentum_flux="retardin")': "call-overload",
    'thud.solve(model="finite_elements")': "call-overload",
    "thud.solve(friction=0.2)": "call-overload",
    "thud.solve(height=1.0)": "call-overload",
    'thud.solve(model="finite_element", viscosity="kelvin")': "call-overload",
    'thud.solve(None, None, "modal_ball", harmonic=8)': "call-overload",
    'thud.FiniteElement(law="hooke")': "arg-type",
    'thud.Levels(force="elastik")': "arg-type",
    'thud.solve().levels("fifth")': "arg-type",
    'thud.solve().assess(source="football")': "arg-type",
    'thud.solve_many({}, model="cube")': "arg-type",
    'thud.get_bands("fifth")': "arg-type",
    "thud.slove()": "attr-defined",
    "thud.Ball(radius=0.1)": "call-arg",
}


def test_every_public_name_is_found_and_documented() -> None:
    assert set(dir(thud)) == {*thud.__all__, "__version__"}
    assert len(set(thud.__all__)) == len(thud.__all__)
    for name in thud.__all__:
        found = getattr(thud, name)
        assert inspect.getdoc(found) or get_origin(found), name
    text = pydoc.plain(pydoc.render_doc(thud))
    assert all(name in text for name in thud.__all__)


def test_types_are_part_of_the_package() -> None:
    package = Path(thud.__file__).parent
    for name in ("py.typed", "_core.pyi", "__init__.pyi", "impact/solve.pyi"):
        assert (package / name).read_bytes() == (DRIVER / "thud" / name).read_bytes()


def test_calls_of_each_model_are_those_of_solve() -> None:
    tree = ast.parse((DRIVER / "thud/impact/solve.pyi").read_text())
    wanted = list(inspect.signature(thud.solve).parameters.values())
    shared = {parameter.name for parameter in wanted if parameter.kind is parameter.KEYWORD_ONLY}
    options = {
        node.name: {line.target.id for line in node.body if isinstance(line, ast.AnnAssign)}  # type: ignore[union-attr]
        for node in tree.body
        if isinstance(node, ast.ClassDef)
    }
    assert options.pop("SamplingOptions") == shared
    assert list(options) == [f"{kind.__name__}Options" for kind in MODELS.values()]
    for kind in MODELS.values():
        assert options[f"{kind.__name__}Options"] == {f.name for f in dataclasses.fields(kind)}
    of_case, *calls = (node.args for node in tree.body if isinstance(node, ast.FunctionDef))
    assert ast.unparse(of_case) == "ball: Case"
    for call in calls:
        names = [argument.arg for argument in (*call.args, *call.kwonlyargs)]
        assert names == ["ball", "drop", "model"]
    given = {ast.unparse((call.args + call.kwonlyargs)[-1].annotation or call) for call in calls}
    assert given == {*(f"Literal['{name}']" for name in MODELS), "ModelName | ModelOptions"}


@pytest.mark.slow
def test_type_checkers_know_all_types_and_which_calls_are_wrong(tmp_path: Path) -> None:
    """The examples of the documentation are typed, no public name is of any type."""
    for i, example in enumerate(EXAMPLES):
        (tmp_path / f"example_{i}.py").write_text(example.code)
    (tmp_path / "wrong.py").write_text("\n".join(["import thud", *WRONG]))
    lines = ["import thud"]
    for name in thud.__all__:
        found = getattr(thud, name)
        lines.append(f"reveal_type(thud.{name})")
        if inspect.isclass(found) and not issubclass(found, Exception):
            lines.append(f"def see_{name}(it: thud.{name}) -> None:")
            names = dict.fromkeys([*getattr(found, "__dataclass_fields__", ()), *dir(found)])
            lines += [f"    reveal_type(it.{one})" for one in names if not one.startswith("_")]
            lines.append("    return")
    (tmp_path / "names.py").write_text("\n".join(lines))
    command = ["-m", "mypy", "--strict", *sorted(tmp_path.glob("*.py"))]
    done = python(*command, cwd=tmp_path, env={**os.environ, "MYPYPATH": str(DRIVER)})
    said = re.findall(r"^(\w+)\.py:(\d+): (.*)$", done.stdout, re.MULTILINE)
    types = [text for file, _, text in said if file == "names"]
    assert len(types) > len(thud.__all__), done.stdout + done.stderr
    assert [text for text in types if "Revealed type is" not in text] == []
    assert [text for text in types if re.search(r"\bAny\b", re.sub(NUMPY, "", text))] == []
    assert [line for line in said if line[0].startswith("example")] == []
    errors = {
        int(line): text.rpartition("[")[2].rstrip("]")
        for file, line, text in said
        if file == "wrong" and text.startswith("error: ")
    }
    assert errors == dict(enumerate(WRONG.values(), start=2))


def test_names_whose_packages_are_missing_say_so() -> None:
    code = """if True:
        import sys
        sys.modules["xarray"] = sys.modules["pandas"] = None
        import thud
        assert "sweep" in dir(thud) and not hasattr(thud, "sweep")
        impact = thud.solve()
        lazy = lambda: thud.sweep, lambda: thud.Sensitivity
        for use in (*lazy, impact.to_xarray, impact.to_dataframe):
            try:
                use()
            except thud.InputError as error:
                print(error)
    """
    done = python("-c", code)
    lines = done.stdout.splitlines()
    assert [re.match(r"\w+", line)[0] for line in lines] == [*3 * ["xarray"], "pandas"]  # type: ignore[index]
    assert all(line.endswith('pip install "thud-acoustics[studies]"') for line in lines)


@pytest.mark.parametrize(
    ("module", "heavy"),
    [
        ("thud", {"xarray", "scipy", "SALib", "matplotlib"}),
        ("thud.report.recording_files", {"matplotlib", "weasyprint", "xarray"}),
    ],
)
def test_import_stays_light(module: str, heavy: set[str]) -> None:
    found = python("-c", f"import sys, {module}; print({heavy} & set(sys.modules))")
    assert found.stdout == "set()\n"


def test_misspelt_names_are_told() -> None:
    with pytest.raises(AttributeError, match=naming("'slove'", "'solve'")):
        thud.slove  # noqa: B018
    with pytest.raises(AttributeError, match=naming("'cube'")):
        thud.cube  # noqa: B018
