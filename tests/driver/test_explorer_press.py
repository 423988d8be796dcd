"""The curve of a press on the page: the fitted modulus, and files that are no curve."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from starlette.testclient import TestClient

import thud
from thud.explorer import server

if TYPE_CHECKING:
    from collections.abc import Iterator

TRUE_RATIO = 1.1
BALL = thud.Case().resolved()

VALUES: dict[str, Any] = {"model": {"name": "modal_ball"}}


@pytest.fixture(scope="module")
def client() -> Iterator[TestClient]:
    """Return a client of the server that has the token."""
    application = server.new_application({}, token="a", hosts=("127.0.0.1",))  # noqa: S106
    with TestClient(application, base_url="http://127.0.0.1", headers={server.TOKEN: "a"}) as found:
        yield found


def curve(ratio: float = TRUE_RATIO) -> tuple[np.ndarray, np.ndarray]:
    """Return deflection, mm, and force, N, of a press, with noise of 1 N."""
    exact = thud.compress(BALL.ball, BALL.model or "modal_ball", max_deflection=0.03, points=61)
    noise = np.random.default_rng(1).normal(size=exact.force.size)
    return 1e3 * exact.deflection, ratio * exact.force + noise


def table(titles: str, *columns: np.ndarray) -> str:
    """Return a file of columns."""
    rows = [",".join(f"{value:.6g}" for value in row) for row in zip(*columns, strict=True)]
    return "\n".join([*([titles] if titles else []), *rows])


def fitted(client: TestClient, content: str, values: dict[str, Any] = VALUES) -> dict[str, Any]:
    """Return the last report of a fit to the curve in a file."""
    files = {"file": ("press 1.csv", content)}
    response = client.post("/press", files=files, data={"case": json.dumps(values)})
    assert response.status_code == 200, response.text
    report: dict[str, Any] = json.loads(response.text)
    return report


@pytest.mark.parametrize(
    ("titles", "scales"),
    [
        ('"Deflection, mm","Force, N"', (1.0, 1.0)),
        ("deflection_m,force_N", (1e-3, 1.0)),
        ("Weg [mm],Standardkraft [kN]", (1.0, 1e-3)),
    ],
)
def test_modulus_is_that_of_the_curve(
    client: TestClient, titles: str, scales: tuple[float, float]
) -> None:
    deflection, force = curve()
    content = table(titles, scales[0] * deflection, scales[1] * force)
    answer = fitted(client, content)["answer"]
    modulus = answer["values"]["ball"]["youngs_modulus"]
    assert modulus == pytest.approx(TRUE_RATIO * BALL.ball.youngs_modulus, rel=0.02)
    ((key, low, high),) = answer["intervals"]
    assert key == "ball.youngs_modulus"
    assert low < modulus < high
    assert answer["file"] == "press 1.csv"
    assert answer["is_explained"]


def test_unloading_branch_of_a_press_is_left_out(client: TestClient) -> None:
    deflection, force = curve()
    both = [np.concatenate([x, x[-2::-1]]) for x in (deflection, force)]
    answer = fitted(client, table("deflection (mm),force (N)", *both))["answer"]
    assert answer["values"]["ball"]["youngs_modulus"] > 1.7e6


def test_curve_that_the_model_does_not_explain_says_so(client: TestClient) -> None:
    deflection, force = curve()
    content = table("deflection (mm),force (N)", deflection, force**2 / 400)
    assert not fitted(client, content)["answer"]["is_explained"]


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("force (N)\n1\n2", "0 columns in a unit of m among force (N)"),
        ("travel,force (N)\n0,0\n1,2", "of m among travel (no unit)"),
        ("travel (mm),way (cm),force (N)\n0,0,0\n1,1,2", "2 columns in a unit of m among travel"),
        ("travel (mm),force (N)\n0,0\n1,nan", "column 2, 'force': a value is not finite"),
        ("travel (mm),force (N)\n0,0\n1,2", "press 1.csv: "),
    ],
)  # fmt: skip
def test_bad_curves_name_file_column_and_what_is_expected(
    client: TestClient, content: str, words: str
) -> None:
    report = fitted(client, content)
    assert words in report["error"], report["error"]
    assert report["field"] is None


def test_model_without_a_modulus_is_not_fitted_to_a_press(client: TestClient) -> None:
    report = fitted(client, "travel (mm),force (N)\n0,0\n1,2", {"model": {"name": "two_mass"}})
    assert "a press determines no parameter of the model “Tyre: belt and rim”" in report["error"]
