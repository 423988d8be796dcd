"""The page of the program: what the server answers, refuses and keeps to itself."""

from __future__ import annotations

import asyncio
import io
import json
import re
import signal
import socket
import tempfile
import tomllib
import webbrowser
from base64 import b64decode
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import unquote

import f90nml
import numpy as np
import pytest
import uvicorn
from conftest import REPOSITORY
from starlette.routing import Route
from starlette.testclient import TestClient
from synthetic import half_sine

import thud
from thud import cli
from thud.base._schema import FLOORS, MODELS
from thud.base.note import Note
from thud.case.case import check_case
from thud.explorer import improve, page_file, server
from thud.explorer.answer import new_case
from thud.explorer.criteria import RESULTS
from thud.explorer.decisive import decisive_warnings
from thud.explorer.form import construction_form, form
from thud.explorer.models import floor_facts
from thud.explorer.recording_fields import FIELDS
from thud.impact.compute import compute
from thud.level.assessment import Criterion
from thud.level.estimate import Estimate
from thud.recordings.config import config_from
from thud.report.contents import report_criteria
from thud.report.rows import entry_text, expanded_text

if TYPE_CHECKING:
    from collections.abc import AsyncGenerator, Iterator

    from conftest import ErrorsOf

TOKEN = "secret"  # noqa: S105 - of the test
HEAD = {server.TOKEN: TOKEN}
SHELL: dict[str, Any] = {"model": {"name": "hollow_sphere"}}
MODAL: dict[str, Any] = {"model": {"name": "modal_ball"}}
FLOOR: dict[str, Any] = {"floor": {"name": "plate"}}
MODES: dict[str, Any] = {
    "model": {"name": "measured_modes"},
    "measured_modes": {
        "frequency": [24.0, 89.0], "damping_ratio": [0.05, 0.1], "effective_mass": [2.4, 0.1],
    },
}  # fmt: skip
RECORDINGS = REPOSITORY / "inputs/recordings"
# The same drop as sound, which needs a calibration, and as a table.
SOUND, TABLE = ((name, (RECORDINGS / name).read_bytes()) for name in ("drop_1.wav", "drop_1.csv"))
DROP: dict[str, Any] = {"height": 1, "mass": 2.5}
CALIBRATED: dict[str, Any] = {**DROP, "calibration": "2000 N/FS"}
FORM_TYPE = "multipart/form-data; boundary=edge"


def new_client(start: dict[str, Any], **options: int) -> TestClient:
    """Return a client with the token of a server that begins with a case."""
    application = server.new_application(start, token=TOKEN, hosts=("127.0.0.1",), **options)
    return TestClient(application, base_url="http://127.0.0.1", headers=HEAD)


@pytest.fixture(scope="module")
def client() -> Iterator[TestClient]:
    with new_client({}) as found:
        yield found


def last_report(client: TestClient, path: str, **request: Any) -> dict[str, Any]:  # noqa: ANN401 - as the client
    response = client.post(path, **request)
    assert response.status_code == 200, response.text
    found: dict[str, Any] = response.json()
    return found


def form_body(content: bytes, name: str = "a.wav") -> bytes:
    head = f'Content-Disposition: form-data; name="file"; filename="{name}"'
    case = f'--edge\r\nContent-Disposition: form-data; name="case"\r\n\r\n{json.dumps(SHELL)}\r\n'
    return f"{case}--edge\r\n{head}\r\n\r\n".encode() + content + b"\r\n--edge--\r\n"


def form_of(
    *files: tuple[str, bytes],
    case: dict[str, Any] | None = None,
    **fields: Any,  # noqa: ANN401 - of a form
) -> dict[str, Any]:
    """Return the arguments of a request with files and values of fields, as the page sends them."""
    table: dict[str, Any] = {}
    for item in FIELDS:
        if item.name in fields:
            *group, key = item.path
            factor = 0.01 if item.unit == "%" else 1
            (table.setdefault(group[0], {}) if group else table)[key] = factor * fields[item.name]
    data = {"table": json.dumps(table), "case": json.dumps(case or {})}
    return {"files": [("file", file) for file in files], "data": data}


def answer_of(client: TestClient, path: str, values: object) -> Any:  # noqa: ANN401 - as the client
    return last_report(client, path, json=values)["answer"]


def measured(client: TestClient, *files: tuple[str, bytes], **fields: Any) -> dict[str, Any]:  # noqa: ANN401 - of a form
    found: dict[str, Any] = last_report(client, "/measure", **form_of(*files, **fields))["answer"]
    return found


def test_fields_are_those_of_the_schema() -> None:
    groups = {(group["part"], group["name"]): group for group in form()}
    assert {*(("model", name) for name in MODELS), *(("floor", name) for name in FLOORS)} < {
        *groups
    }

    def field(group: tuple[str, str], name: str) -> dict[str, Any]:
        (found,) = (one for one in groups[group]["fields"] if one["name"] == name)
        return dict(found)

    thickness = field(("ball", "ball"), "wall_thickness")
    default = thud.Ball().wall_thickness
    assert [thickness[key] for key in ("unit", "power", "default")] == ["mm", -3, default]
    low, high = thickness["slider"]["ends"]
    assert low < 1e3 * default < high
    law = field(("model", "finite_element"), "law")
    assert list(law["choices"].values()) == ["neo-Hookean", "Mooney–Rivlin"]


def test_constructions_of_the_page_are_floors_of_the_library() -> None:
    known = {group["name"]: group for group in form()}
    entries = construction_form()
    assert [entry["name"] for entry in entries] == list(thud.constructions())
    for entry in entries:
        values = SHELL | {"floor": {"name": entry["floor"]}, entry["floor"]: entry["keys"]}
        case = new_case(values | {"room": entry["room"]})
        expected = thud.construction(entry["name"])
        assert (case.floor, case.room) == (expected.floor, expected.case().room)
        # The page fills fields by their names.
        fields = {
            field["name"] for name in (entry["floor"], "room") for field in known[name]["fields"]
        }
        assert {*entry["keys"], *entry["room"]} == set(entry["sources"]) <= fields


def test_ends_of_sliders_are_allowed() -> None:
    # What is not complete without values has none to try.
    empty = {"measured_modes", "hunt_crossley", "measured_mobility", "modal_floor"}
    refused = set()
    for group in form():
        name, part = group["name"], group["part"]
        choice = {part: {"name": name}} if part != name else {}
        floor = FLOOR if name == "room" else {}
        for field in group["fields"] if name not in empty else []:
            for end in (field.get("slider") or {"ends": ()})["ends"]:
                value = float(f"{end}e{field['power']}")
                key = {field["name"]: int(value) if field["kind"] == "whole" else value}
                try:
                    check_case(new_case(SHELL | floor | choice | {field["group"]: key}))
                except thud.InputError:
                    refused.add(field["name"])
    # Their ranges depend on other keys.
    assert refused == {"outer_radius", "wall_thickness", "belt_mass"}


def test_answer_is_that_of_the_library(client: TestClient) -> None:
    answer = answer_of(client, "/solve", SHELL | {"drop": {"height": 0.5}})
    impact = thud.solve(drop=thud.Drop(height=0.5), model="hollow_sphere")
    assert answer["levels"]["level"] == pytest.approx(impact.levels(), rel=1e-5)
    assert answer["result"] == RESULTS[impact.assess().conforms]
    numbers = {name: value for name, value, *_ in answer["numbers"]}
    assert numbers["contact time"] == pytest.approx(1e3 * impact.contact_time, abs=5.1e-3)
    error = numbers["numerical error of an octave up to"]
    assert error == impact.level_error.max() > 0
    assert max(answer["force"]["value"]) == pytest.approx(impact.floor_force.max(), rel=1e-2)


@pytest.mark.slow
@pytest.mark.parametrize("path", ["/solve", "/improve", "/download/case.nml", "/press", "/fit"])
def test_page_names_no_file_of_the_machine(client: TestClient, tmp_path: Path, path: str) -> None:
    (tmp_path / "secret").write_text("password 123\n")
    messages = set()
    for name in ("secret", "missing"):
        case = SHELL | {"floor": {"name": "modal_floor"}, "room": {}}
        case["modal_floor"] = {"file": str(tmp_path / name)}
        is_form = path in {"/press", "/fit"}
        response = client.post(path, **(form_of(SOUND, case=case) if is_form else {"json": case}))
        assert response.status_code == 400
        messages.add(response.json()["error"])
    # It does not even say whether a file exists.
    (message,) = messages
    assert message == "File cannot be chosen on the page; allowed: a file that it offers"


def test_page_opens_files_of_the_command_and_its_own(tmp_path: Path) -> None:
    assert server.FILE_KEYS == [("modal_floor", "file")]
    own = tmp_path / "modes.csv"
    own.write_bytes((REPOSITORY / "inputs/floors/modal_slab.csv").read_bytes())
    (stated,) = (facts["values"] for facts in floor_facts() if facts["name"] == "modal_floor")
    start: dict[str, Any] = SHELL | {"floor": {"name": "modal_floor"}} | stated
    with new_client({}) as other:
        assert answer_of(other, "/solve", start)["floor"]
    start["modal_floor"]["file"] = str(own)
    with new_client(start) as other:
        assert answer_of(other, "/solve", start)["floor"]


def test_floor_and_room_are_answered(client: TestClient) -> None:
    values = SHELL | {"floor": {"name": "joist_floor"}, "room": {"volume": 30}}
    answer = answer_of(client, "/solve", values)
    impact = thud.solve(floor=thud.JoistFloor(), model="hollow_sphere").on_floor
    assert impact is not None
    layers = [(layer["thickness"], layer["spacing"]) for layer in answer["section"]["layers"]]
    floor = thud.JoistFloor()
    assert layers == [(floor.sheathing_thickness, 0), (floor.joist_height, floor.spacing)]
    size = answer["room"]["size"]
    assert size["length"] * size["width"] * size["height"] == pytest.approx(size["volume"]) == 30
    assert answer["motion"] is None
    velocity = 1e3 * impact.floor_velocity.max()
    assert max(answer["floor"]["velocity"]["value"]) == pytest.approx(velocity, rel=0.05)
    numbers = {name: value for name, value, _ in answer["floor"]["numbers"]}
    change = 20 * np.log10(impact.peak_force / thud.solve(model="hollow_sphere").peak_force)
    assert numbers["peak force relative to rigid floor"] == pytest.approx(change)
    assert [row[0] for row in answer["floor"]["octaves"]] == [31.5, 63, 125, 250, 500]
    energy = [row[-1] for row in answer["floor"]["octaves"]]
    assert energy == pytest.approx(1e3 * impact.injected_energy().energy, rel=1e-5)
    assert len(answer["room"]["level"]) == 12


def test_file_of_the_laboratory_is_read_with_its_recordings(client: TestClient) -> None:
    config = RECORDINGS / "lab.toml"
    files = ("lab.toml", config.read_bytes()), SOUND
    answer = measured(client, *files)
    known = thud.read_recording(RECORDINGS / SOUND[0], config=config)
    assert answer["levels"]["level"] == pytest.approx(known.levels(), abs=1e-4)
    assert answer["asks"] == []
    # A field of the page replaces its value, and the others of the same table stay.
    other = measured(client, *files, plate_Q=10, source="tyre")
    assert other["levels"]["level"] != answer["levels"]["level"]
    assert [other["criteria"][0][end] for end in ("lower", "upper")] == [46, 48]


def table_of(force: np.ndarray, rate: float) -> tuple[str, bytes]:
    rows = [f"{i / rate:.9g},{value:.9g}" for i, value in enumerate(force)]
    return "drop.csv", "\n".join(["time_s,force_N", *rows]).encode()


def test_drawn_force_of_a_recording_is_low_passed(client: TestClient) -> None:
    rate, start = 48000.0, 0.3
    pulse = half_sine(rate, start, round(0.6 * rate))
    # A ripple of 10 % above the cutoff.
    ripple = 0.1 * pulse * np.sin(2 * np.pi * 4000.0 * np.arange(len(pulse)) / rate)
    noise = np.random.default_rng(1).normal(scale=0.5, size=len(pulse))
    answer = measured(client, table_of(pulse + ripple + noise, rate))
    time, value = (np.array(answer["force"][key]) for key in ("time", "value"))
    expected = np.interp(1e-3 * time + start, np.arange(len(pulse)) / rate, pulse)
    inside = (time > 2) & (time < 18)
    # The ripple has an amplitude of 150 N. In the standard uncertainty of first touch, 0.06 ms, the
    # force rises by 14 N.
    assert abs(value - expected)[inside].max() < 40


# Names of files that are no plain names.
NAMES = ["../../etc/passwd.wav", "x.exe", "a\0b.wav", "", "x" * 5000]


@pytest.mark.parametrize(
    ("kind", "content"),
    [
        *((FORM_TYPE, form_body(b"\0" * 100, name)) for name in NAMES),
        ("text/csv", b"1,2"),
        ("multipart/form-data", b"1,2"),
        (FORM_TYPE, b"1,2"),
        (FORM_TYPE, b"--edge\r\n\r\n\r\n--edge--"),
        (FORM_TYPE, form_body(b"") * 200),
    ],
)
def test_no_form_is_answered_by_a_sentence(client: TestClient, kind: str, content: bytes) -> None:
    response = client.post("/measure", content=content, headers={"Content-Type": kind})
    report = response.json()
    assert report.keys() == {"error", "field"}
    # Names of copies are those of the files, without a folder.
    assert "/" not in report["error"]


def test_page_asks_for_the_plate_of_the_example_and_is_right_with_it(client: TestClient) -> None:
    truth = tomllib.loads((RECORDINGS / "truth.toml").read_text())["drop"][0]["levels"][4]
    known = DROP | {"calibration_uncertainty": 0.1}
    answer = measured(client, TABLE, **known)
    octave = answer["criteria"][4]
    # The plate lifts the level, but the range holds the truth: nothing is decided.
    assert 1 < abs(octave["value"] - truth) < octave["uncertainty"]
    assert octave["result"] == "undecided"
    # So are the peaks: those of a ringing plate may be none of the ball.
    assert answer["result"] == "undecided"
    (asked,) = answer["asks"]
    assert asked["values"] == {"plate_f0": "1100", "plate_Q": "24"}
    # The share of the resonance is asked for next, as half of it would conform.
    known |= {name: float(text) for name, text in asked["values"].items()}
    answer = measured(client, TABLE, **known)
    assert answer["result"] == "undecided"
    assert [ask["values"] for ask in answer["asks"]] == [{"plate_share": ""}]
    assert answer["criteria"][4]["mark"] == "†"
    assert answer["largest"] == ["500 Hz", "share of the plate's resonance, assumed"]
    answer = measured(client, TABLE, **known, plate_share=1, plate_f0_uncertainty=0.1)
    octave = answer["criteria"][4]
    assert octave["value"] == pytest.approx(truth, abs=0.1)
    assert octave["result"] == answer["result"] == "does_not_conform"
    assert answer["asks"] == []


def test_calibration_that_is_not_stated_leaves_the_verdict_undecided(client: TestClient) -> None:
    known = DROP | {"plate_f0": 1100, "plate_Q": 25, "plate_share": 1, "plate_f0_uncertainty": 0.01}
    answer = measured(client, TABLE, **known)
    assert answer["result"] == "undecided"
    assert answer["criteria"][4]["not_stated"] == ["calibration"]
    # The uncertainty that is stated for 500 Hz is the largest that decides it.
    found = re.search(r"500 Hz .* ([\d.]+) % of calibration", answer["excluded"])
    assert found
    for factor, result in ((0.9, "does_not_conform"), (1.1, "undecided")):
        known["calibration_uncertainty"] = factor * float(found[1])
        assert measured(client, TABLE, **known)["criteria"][4]["result"] == result


@pytest.mark.parametrize(
    ("note", "is_open"),
    [
        (Note("aliasing", value=0.6), True), (Note("aliasing", value=0.4), False),
        (Note("flat_top"), True), (Note("effective_mass"), False),
    ],
)  # fmt: skip
def test_warnings_without_effect_on_the_verdict_stay_folded(note: Note, *, is_open: bool) -> None:
    criteria = [
        Criterion(name, Estimate(value, 0.0, "dB"), 10.0, 14.0)
        for name, value in {"octave_500": 10.5, "octave_31_5": 12.0}.items()
    ]
    assert decisive_warnings([note], criteria) == [note] * is_open


def test_several_files_are_the_drops_of_one_measurement(client: TestClient) -> None:
    paths = [RECORDINGS / f"drop_{i}.csv" for i in range(1, 4)]
    request = form_of(
        *((path.name, path.read_bytes()) for path in paths), **DROP, plate_f0=1100, plate_Q=25
    )
    answer = last_report(client, "/measure", **request)["answer"]
    config = config_from(DROP | {"plate": {"f0": 1100, "Q": 25}})
    recording = thud.read_recording(paths, config=config)
    assert answer["drops"] == 3
    assert answer["criteria"][0]["uncertainty_kind"] == "measured"
    assert answer["result"] == RESULTS[recording.assess().conforms]
    assert answer["levels"]["level"] == pytest.approx(recording.levels(), rel=1e-5)
    # Values have the digits of their uncertainty.
    texts = [(entry_text(row), expanded_text(row)) for row in report_criteria(recording)]
    shown = [(entry["value_text"], entry["uncertainty_text"]) for entry in answer["criteria"]]
    assert shown == texts
    thirds = recording.levels("third")
    assert answer["levels"]["thirds"]["level"] == pytest.approx(thirds, rel=1e-5)
    assert not any("recording_" in warning for warning in answer["warnings"])
    # The report is made only when it is asked for. It is complete, and has the names of the files.
    assert "report" not in answer
    report = last_report(client, "/report", **request)["answer"]
    assert all(path.name in report for path in paths)
    assert "recording_" not in report
    assert not re.search(r'(src|href)="(?!data:|#)', report)


def copies_in(folder: Path) -> list[Path]:
    """Return directories of copies and works; the server of forks has one of its own."""
    return [path for path in folder.iterdir() if not path.name.startswith("pymp-")]


def test_recordings_and_works_leave_no_files(
    client: TestClient, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    for height, kind in ((1, "answer"), ("high", "error")):
        request = form_of(SOUND, **CALIBRATED | {"height": height})
        assert kind in last_report(client, "/measure", **request)
    assert not copies_in(tmp_path)


@pytest.mark.parametrize("path", ["/solve", "/improve", "/fit"])
@pytest.mark.parametrize("depth", [3, 3000])
def test_nested_values_get_a_sentence(client: TestClient, path: str, depth: int) -> None:
    nested = [
        place % (depth * start + "1" + depth * end)
        for place in (
            "%s",
            '{"drop": %s}',
            '{"drop": {"height": %s}}',
            '{"drop": {"height": [%s]}}',
        )
        for start, end in (("[", "]"), ('{"a": ', "}"))
    ]
    for content in (*nested, "[]", '{"drop": [1]}'):
        request: dict[str, Any] = {"content": content}
        if path == "/fit":
            request = form_of(SOUND)
            request["data"]["case"] = content
        response = client.post(path, **request)
        assert response.status_code == 400
        assert "plain values" in response.json()["error"]


# Tokens that are not that of the server: none, empty, parts of it, longer, of other letters.
TOKENS = ["", "é", "guess", TOKEN[:1], TOKEN[:-1], TOKEN[1:], TOKEN + "x"]
HOSTS = [
    "rebound.example", "rebound.example:80", "127.0.0.1.rebound.example", "rebound.127.0.0.1",
    "127.0.0.1@rebound.example", "localhost.rebound.example", "127.1", "2130706433", "",
]  # fmt: skip


def status_of(client: TestClient, method: str, address: str, headers: dict[str, str]) -> int:
    """Return the status of a request with these headers only."""
    bare = TestClient(client.app, base_url="http://127.0.0.1")
    content = json.dumps(SHELL) if method == "POST" else None
    encoded = {name.encode(): value.encode() for name, value in headers.items()}
    return bare.request(method, address, content=content, headers=encoded).status_code


@pytest.mark.parametrize(
    ("headers", "expected"),
    [
        ({}, 403),
        *(({server.TOKEN: token}, 403) for token in TOKENS),
        *(({**HEAD, "Host": host}, 400) for host in HOSTS),
    ],
)
def test_strangers_are_refused(client: TestClient, headers: dict[str, str], expected: int) -> None:
    routes = {r.path: r.methods for r in client.app.routes if isinstance(r, Route)}  # type: ignore[attr-defined]
    assert {"/about", "/solve", "/measure", "/improve", "/fit", "/download/case.nml"} < set(routes)
    # The page itself and its modules hold nothing of a user.
    for address in ("/", "/page/plot.js"):
        assert status_of(client, "GET", address, headers) == (expected if expected == 400 else 200)
    for path in routes.keys() - {"/"}:
        for method in routes[path]:
            assert status_of(client, method, path, headers) == expected, (method, path)


def test_other_pages_are_allowed_nothing(client: TestClient) -> None:
    # A browser asks before it sends a token to another page than its own.
    asking = {"Origin": "http://elsewhere.example", "Access-Control-Request-Method": "POST"}
    answer = client.options("/solve", headers=asking)
    assert not any(name.startswith("access-control") for name in answer.headers)


def test_first_picture_is_in_the_page_and_modules_are_files(client: TestClient) -> None:
    response = client.get("/", headers={"Accept-Encoding": "gzip"})
    assert TOKEN not in response.text
    assert response.headers["content-encoding"] == "gzip"
    assert int(response.headers["content-length"]) < 25_000
    policy = response.headers["content-security-policy"]
    # The page plays what it has downloaded with its token, and no other sound.
    assert "media-src blob:;" in policy
    (nonce,) = set(re.findall(r"'nonce-([^']+)'", policy))
    assert nonce not in client.get("/").text
    # A script without it could not import those of the first picture, which are data.
    tags = re.findall(r'<(?:script|style|link rel="modulepreload")([^>]*)>', response.text)
    assert all(f'nonce="{nonce}"' in tag or "application/json" in tag for tag in tags)
    (imports,) = re.findall(r'"importmap"[^>]*>(.*?)</script>', response.text)
    modules = json.loads(imports)["imports"]
    folder = modules.pop("thud/")
    assert set(modules) == {f"thud/{name}.js" for name in page_file.FIRST}
    for module, data in modules.items():
        address = module.replace("thud/", folder)
        file = client.get(address)
        assert file.headers["content-type"].startswith("text/javascript")
        assert unquote(data.removeprefix("data:text/javascript,")) == file.text
        tag = {"If-None-Match": file.headers["etag"]}
        assert client.get(address, headers=tag).status_code == 304


def test_first_answer_is_in_the_page_but_no_case_of_a_user(client: TestClient) -> None:
    def first_of(one: TestClient) -> Any:  # noqa: ANN401 - of JSON
        (text,) = re.findall(r'id="first_answer">(.*?)</script>', one.get("/").text, re.DOTALL)
        return json.loads(text)

    first = first_of(client)
    assert first["values"] == {"model": {"name": "modal_ball"}}
    assert first["answer"]["result"] == "conforms"
    with new_client(SHELL) as other:
        assert first_of(other) is None


def test_no_path_reaches_the_file_system(client: TestClient) -> None:
    for path in ("/page/..%2f..%2fserver.py", "/page/server.py", "/page/%2fetc%2fpasswd"):
        assert client.get(path).status_code == 404
    assert client.post("/download/..%2fcase.nml", json=SHELL).status_code == 404


@pytest.mark.parametrize("path", ["/solve", "/download/case.nml", "/improve", "/measure", "/fit"])
def test_bodies_may_be_as_long_as_allowed_and_no_longer(client: TestClient, path: str) -> None:
    is_form = path in {"/measure", "/fit"}
    limit = server.MAX_RECORDING if is_form else server.MAX_CASE
    kind = FORM_TYPE if is_form else "application/json"
    body = form_body(b"\0") if is_form else json.dumps(SHELL).encode()

    def status(length: int | None) -> int:
        stated = {} if length is None else {"Content-Length": str(length)}
        headers = {"Content-Type": kind, **stated}
        return client.post(path, content=iter([body]), headers=headers).status_code

    # The server itself ends a body that is longer than its head states.
    assert [status(n) for n in (limit, limit + 1, None)] == [200, 413, 411]


def test_downloads_are_what_they_say(client: TestClient, tmp_path: Path) -> None:
    values = SHELL | {"drop": {"height": 0.7}}
    path = tmp_path / "case.nml"
    path.write_text(answer_of(client, "/download/case.nml", values))
    assert thud.read_case(path).drop.height == 0.7
    head, *rows = answer_of(client, "/download/force.csv", values).splitlines()
    assert head == "time_s,force_N"
    force = np.array([line.split(",") for line in rows], dtype=float)[:, 1]
    expected = thud.solve(drop=thud.Drop(0.7), model="hollow_sphere").floor_force.max()
    assert force.max() == pytest.approx(expected, rel=1e-8)


@pytest.mark.parametrize("values", [{}, MODES, SHELL | FLOOR | {"room": {"volume": 30.0}}])
def test_script_computes_the_case(
    client: TestClient, values: dict[str, Any], capsys: pytest.CaptureFixture[str]
) -> None:
    text = answer_of(client, "/download/case.py", values)
    namespace: dict[str, Any] = {}
    exec(compile(text, "case.py", "exec"), namespace)  # noqa: S102 - it is the result
    assert namespace["case"] == new_case(values | {"case": {"name": "python"}})
    assert f"{namespace['impact'].levels().round(2)}" in capsys.readouterr().out
    assert ("predict_level" in text) == ("room" in values)


def test_smallest_change_that_conforms_is_found(client: TestClient) -> None:
    source = {"damping_law": "rising", "loss_factor": 0.15}
    values = {"model": {"name": "modal_ball"}, "modal_ball": source}
    changes = answer_of(client, "/improve", values)["changes"]
    (change,) = (entry for entry in changes if entry["key"] == "modal_ball.loss_factor")
    assert change["factor"] == pytest.approx(change["value"] / 0.15)
    sizes = [abs(np.log(entry["factor"])) for entry in changes]
    assert sizes == sorted(sizes)
    # The step before does not conform.
    for loss, conforms in ((change["value"], True), (change["value"] / 1.07, False)):
        model = thud.ModalBall(damping_law="rising", loss_factor=loss)
        assert (thud.solve(model=model).assess().conforms == "conforms") == conforms


@pytest.mark.parametrize(
    ("values", "reason"),
    [
        (SHELL, "no_parameter"),
        (MODES, "no_parameters"),
        (SHELL | FLOOR | {"room": {"volume": 50.0, "required": 60.0}}, "other_source"),
    ],
)
def test_search_without_changes_says_why(values: dict[str, Any], reason: str) -> None:
    assert improve.improve(values) == {"changes": [], "reason": reason, "constructions": []}


def test_layers_that_meet_the_requirement_of_a_room_are_found() -> None:
    # A small plate has few modes.
    layers = {"thickness": 0.18, "screed_thickness": 0.05, "layer_stiffness": 15e6}
    plate = layers | {"length": 3.5, "width": 3.0}
    # The screed becomes just twice as thick, its most.
    room = {"volume": 50.0, "required": 48.0, "rating": "thirds"}
    changes = improve.improve(FLOOR | {"plate": plate, "room": room})["changes"]
    assert [entry["key"] for entry in changes] == [f"plate.{name}" for name in layers]
    for change in changes:
        name = change["key"].partition(".")[2]
        below = thud.Room(**room)  # type: ignore[arg-type]
        floor = thud.Plate(**plate | {name: change["value"]})
        prediction = thud.predict_level(floor=floor, room=below)
        assert change["level"] == prediction.rating.rounded
        assert change["probability"] == prediction.probability
        assert prediction.verdict == "conforms"
        # The step before does not conform.
        step = change["value"] / 0.9 if name == "layer_stiffness" else change["value"] - 0.01
        before = thud.predict_level(floor=thud.Plate(**plate | {name: step}), room=below)
        assert before.verdict != "conforms"


def test_bare_slab_that_no_change_helps_gets_a_screed(monkeypatch: pytest.MonkeyPatch) -> None:
    # Not even twice as thick.
    monkeypatch.setattr(improve, "LAYER_STEPS", np.array([9, 18]))
    plate = vars(thud.construction("concrete 180").floor)
    answer = improve.improve(FLOOR | {"plate": plate, "room": {"required": 46.0}})
    assert (answer["changes"], answer["reason"]) == ([], "no_layer")
    known = answer["constructions"]
    assert "concrete 180, screed on 6 MN/m3" in [entry["name"] for entry in known]
    assert [entry["level"] for entry in known] == sorted(entry["level"] for entry in known)


def test_fit_to_a_recording_returns_its_values(client: TestClient) -> None:
    truth = {"model": {"name": "hunt_crossley"}, "drop": {"height": 0.9}}
    truth |= {"hunt_crossley": {"contact_time": 0.019, "restitution": 0.75}}
    impact = compute(new_case(truth))
    rate, length = 44100, 44100 // 3
    force = np.random.default_rng(1).normal(scale=0.3, size=length)
    force[length // 2 :][: len(impact.time)] += impact.floor_force[: length // 2]
    start = truth | {"hunt_crossley": {"contact_time": 0.021, "restitution": 0.8}}
    request = form_of(table_of(force, rate), height=0.9, mass=2.5, case=start)
    answer = last_report(client, "/fit", **request)["answer"]
    fitted = answer["values"]["hunt_crossley"]
    assert fitted["contact_time"] == pytest.approx(0.019, rel=0.01)
    assert fitted["restitution"] == pytest.approx(0.75, abs=0.01)
    assert answer["values"]["drop"] == {"height": 0.9}
    for key, low, high in answer["intervals"]:
        assert low < fitted[key.partition(".")[2]] < high
    assert answer["file"] == "drop.csv"
    assert answer["is_explained"]
    assert answer["residual"][0] < 3


def test_measured_modes_below_a_floor_say_that_the_floor_does_not_move(client: TestClient) -> None:
    values = MODES | {"floor": {"name": "plate"}, "room": {}}
    notes = thud.predict_level(compute(new_case(values))).notes
    (note,) = (note for note in notes if note.code == "blocked_model")
    assert str(note) in answer_of(client, "/solve", values)["warnings"]


def test_sound_in_the_room_is_that_of_the_case(client: TestClient) -> None:
    values = SHELL | FLOOR | {"room": {"volume": 50.0}}
    answer = answer_of(client, "/download/room.wav", values)
    impact = thud.solve(floor=thud.Plate(), room=thud.Room(volume=50.0), model="hollow_sphere")
    sound = thud.listen(thud.predict_level(impact))
    assert b64decode(answer["wav"]) == sound.wav()
    assert answer["full_scale"] == sound.full_scale


def test_page_starts_with_a_case_or_results(tmp_path: Path) -> None:
    case = REPOSITORY / "inputs/rubber_ball_160cm.nml"
    assert server.start_with(case)["drop"]["height"] == 1.6
    assert cli.main(["run", str(case), "--no-figures", "-q", "-o", str(tmp_path / "r")]) == 0
    assert server.start_with(tmp_path / "r")["drop"]["height"] == 1.6
    assert server.start_with(None) == {}
    text = json.dumps(server.start_with(case))
    assert f90nml.Namelist(json.loads(text))["ball"]["mass"] == 2.5


def test_port_that_is_taken_is_named(errors_of: ErrorsOf) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        assert str(port) in errors_of("explore", "--no-browser", "--port", port)


def test_browser_gets_the_token_by_a_file_of_its_user(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    opened: list[Path] = []

    def look(address: str) -> None:
        path = Path(address.removeprefix("file://"))
        opened.append(path)
        assert path.stat().st_mode & 0o777 == 0o600
        assert path.parent.stat().st_mode & 0o777 == 0o700
        assert capsys.readouterr().out.split()[1] in path.read_text()

    monkeypatch.setattr(webbrowser, "open", look)
    monkeypatch.setattr(uvicorn.Server, "run", lambda *_, **__: None)
    before = signal.getsignal(signal.SIGTERM)
    try:
        assert cli.main(["explore"]) == 0
    finally:
        signal.signal(signal.SIGTERM, before)
    (path,) = opened
    assert not path.parent.exists()


def leave(application: Any, path: str, *bodies: bytes) -> list[dict[str, Any]]:  # noqa: ANN401 - as a client has it
    """Return what an application sends to a page with the token that leaves after its bodies."""
    rest = iter([{"type": "http.request", "body": body} for body in bodies])
    sent: list[dict[str, Any]] = []
    scope = {
        "type": "http", "method": "POST", "path": path, "query_string": b"", "scheme": "http",
        "server": ("127.0.0.1", 80), "root_path": "",
        "headers": [
            (b"host", b"127.0.0.1"),
            (server.TOKEN.encode(), TOKEN.encode()),
            (b"content-type", FORM_TYPE.encode()),
            (b"content-length", b"2000"),
        ],
    }  # fmt: skip

    async def receive() -> dict[str, Any]:
        return next(rest, {"type": "http.disconnect"})

    async def send(message: dict[str, Any]) -> None:
        sent.append(message)

    async def call() -> None:
        await asyncio.wait_for(application(scope, receive, send), 20)

    asyncio.run(call())
    return sent


def test_page_that_leaves_leaves_no_copy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    application = server.new_application({}, token=TOKEN, hosts=("127.0.0.1",), width=1)
    # The second waits for ever where the first has kept its place.
    for _ in range(2):
        leave(application, "/measure", form_body(SOUND[1]))
    assert not copies_in(tmp_path)


def test_page_that_leaves_while_it_sends_is_no_traceback(client: TestClient) -> None:
    assert leave(client.app, "/solve")[0]["status"] == 400


@pytest.mark.parametrize("path", ["/solve", "/download/case.py"])
def test_page_that_leaves_while_it_waits_ends_its_work(path: str) -> None:
    application = server.new_application({}, token=TOKEN, hosts=("127.0.0.1",), width=1)
    ended = []

    async def work(*_: object) -> AsyncGenerator[dict[str, Any], None]:
        try:
            await asyncio.sleep(60)
            yield {}
        finally:
            ended.append(path)

    application.state.jobs.run = work
    leave(application, path, json.dumps(SHELL).encode())
    assert ended == [path]


BALL = thud.Case().resolved()
TRUE_RATIO = 1.1


@pytest.fixture(scope="module")
def curve() -> tuple[np.ndarray, np.ndarray]:
    """Return deflection, mm, and force, N, of a press, with noise of 1 N."""
    exact = thud.compress(BALL.ball, BALL.model or "modal_ball", max_deflection=0.03, points=61)
    noise = np.random.default_rng(1).normal(size=exact.force.size)
    return 1e3 * exact.deflection, TRUE_RATIO * exact.force + noise


def pressed(client: TestClient, titles: str, *columns: np.ndarray) -> dict[str, Any]:
    """Return the answer of a fit to the columns of a press with titles."""
    text = io.StringIO()
    np.savetxt(text, np.column_stack(columns), "%.6g", ",", header=titles, comments="")
    request = form_of(("press 1.csv", text.getvalue().encode()), case=MODAL)
    answer: dict[str, Any] = last_report(client, "/press", **request)["answer"]
    return answer


@pytest.mark.parametrize(
    ("titles", "scales"),
    [
        ('"Deflection, mm","Force, N"', (1.0, 1.0)),
        ("deflection_m,force_N", (1e-3, 1.0)),
        ("Weg [mm],Standardkraft [kN]", (1.0, 1e-3)),
    ],
)
def test_modulus_is_that_of_the_curve_of_a_press(
    client: TestClient,
    curve: tuple[np.ndarray, np.ndarray],
    titles: str,
    scales: tuple[float, float],
) -> None:
    scaled = (scale * one for scale, one in zip(scales, curve, strict=True))
    answer = pressed(client, titles, *scaled)
    modulus = answer["values"]["ball"]["youngs_modulus"]
    assert modulus == pytest.approx(TRUE_RATIO * BALL.ball.youngs_modulus, rel=0.02)
    ((key, low, high),) = answer["intervals"]
    assert key == "ball.youngs_modulus"
    assert low < modulus < high
    assert answer["file"] == "press 1.csv"
    assert answer["is_explained"]


def test_only_the_loading_branch_is_fitted_and_what_it_does_not_explain_is_said(
    client: TestClient, curve: tuple[np.ndarray, np.ndarray]
) -> None:
    titles, (deflection, force) = "deflection (mm),force (N)", curve
    both = [np.concatenate([x, x[-2::-1]]) for x in curve]
    expected = pressed(client, titles, *curve)["values"]
    assert pressed(client, titles, *both)["values"] == expected
    answer = pressed(client, titles, deflection, force**2 / 400)
    assert not answer["is_explained"]
    assert answer["residual"][1] > 0.05
