"""Server of the page; separate processes compute the answers."""

from __future__ import annotations

import json
import re
import secrets
import shutil
import socket
from contextlib import AsyncExitStack
from dataclasses import asdict
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import anyio
import uvicorn
from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.middleware import Middleware
from starlette.middleware.gzip import GZipMiddleware
from starlette.middleware.trustedhost import TrustedHostMiddleware
from starlette.requests import ClientDisconnect
from starlette.responses import HTMLResponse, JSONResponse, StreamingResponse
from starlette.routing import Mount, Route
from starlette.staticfiles import StaticFiles

from thud.base._schema import KEYS
from thud.base.checks import refuse
from thud.case.case import read_case
from thud.case.keys import humanize
from thud.explorer.downloads import DOWNLOADS
from thud.explorer.form import construction_form, form
from thud.explorer.jobs import INPUT_ERRORS, Jobs
from thud.explorer.messages import describe_error
from thud.explorer.models import floor_facts, model_facts
from thud.explorer.page_file import first_answer, render_page
from thud.explorer.recording_fields import FIELDS

if TYPE_CHECKING:
    from collections.abc import AsyncGenerator, Awaitable, Callable, Mapping, Sequence

    from starlette.datastructures import UploadFile
    from starlette.requests import Request
    from starlette.responses import Response
    from starlette.types import Receive, Scope, Send

    Endpoint = Callable[[Request], Awaitable[Response]]
    Reports = AsyncGenerator[dict[str, Any], None]

# Maximum size of a case and of the files of a recording, bytes.
MAX_CASE = 100_000
MAX_RECORDING = 200_000_000
# Group and name of the keys that name files: all texts but the name of the case.
FILE_KEYS = [(key.group, key.name) for key in KEYS if key.kind == "text" and key.group != "case"]
# Maximum length of the name of a copy of a file, of up to four bytes a character.
MAX_NAME = 50
# Maximum number of requests at a time, time that an idle connection stays open, s, and maximum size
# of the head of a request, bytes.
MAX_REQUESTS = 500
IDLE_TIME = 10
MAX_HEAD = 16_384
# Header that carries the token.
TOKEN = "x-thud-token"  # noqa: S105 - its name
# Level of compression: higher ones save a few percent and take twice as long.
COMPRESSION = 6
# Time limit of a task, s.
TIME_LIMIT = 300.0
# Headers of all responses; the page has its own policy.
HEADERS = [
    ("Cache-Control", "no-cache"),
    ("X-Content-Type-Options", "nosniff"),
    ("Referrer-Policy", "no-referrer"),
]


def new_application(
    start: Mapping[str, Any], *, token: str, hosts: tuple[str, ...], width: int = 4
) -> Starlette:
    """Return the application.

    Parameters
    ----------
    start
        Initial values of the page, see `start_with`.
    token
        Secret that requests must carry.
    hosts
        Host names in requests that the server accepts.
    width
        Maximum number of concurrent tasks.
    """
    if not token:
        refuse("the token is empty", "a secret text")
    application = Starlette(
        routes=[
            Route("/", _page),
            Mount("/page", StaticFiles(packages=[("thud.explorer", "page")])),
            Route("/about", _guarded(_about)),
            *(
                Route(path, _guarded(endpoint, limit), methods=["POST"])
                for path, endpoint, limit in (
                    ("/solve", _with_case("case"), MAX_CASE),
                    ("/improve", _with_case("improve"), MAX_CASE),
                    *((f"/download/{name}", _with_case(name), MAX_CASE) for name in DOWNLOADS),
                    ("/measure", _with_files("recording", "table"), MAX_RECORDING),
                    ("/report", _with_files("report", "table"), MAX_RECORDING),
                    ("/fit", _with_files("fit", "table", "case"), MAX_RECORDING),
                    ("/press", _with_files("press", "case"), MAX_RECORDING),
                )
            ),
        ],
        middleware=[
            Middleware(TrustedHostMiddleware, allowed_hosts=list(hosts)),
            Middleware(GZipMiddleware, compresslevel=COMPRESSION),
        ],
        exception_handlers=dict.fromkeys(
            (*INPUT_ERRORS, HTTPException, ClientDisconnect), _report_error
        ),
    )
    floors = floor_facts()
    application.state.about = {
        "form": form(),
        "constructions": construction_form(),
        "recording": list(map(asdict, FIELDS)),
        "models": model_facts(),
        "floors": floors,
        "start": start,
        "max_recording": MAX_RECORDING,
    }
    # The page itself is sent without a token, and holds nothing of a user.
    first = {"model": {"name": application.state.about["models"][0]["name"]}}
    application.state.first = None if start else first_answer(first)
    application.state.offered = [
        values.get(group, {}).get(name)
        for values in (start, *(facts["values"] for facts in floors))
        for group, name in FILE_KEYS
    ]
    application.state.token = token
    application.state.jobs = Jobs(width, TIME_LIMIT)
    return application


async def _page(request: Request) -> Response:
    content, policy = render_page(request.app.state.first)
    return HTMLResponse(content, headers={"Content-Security-Policy": policy})


async def _about(request: Request) -> Response:
    return JSONResponse(request.app.state.about)


def _with_case(task: str) -> Endpoint:
    """Return an endpoint that sends the report of a task on a case."""

    async def answer(request: Request) -> Response:
        values = _case(request, await request.body())
        return _Reports(request.app.state.jobs.run(task, values), AsyncExitStack())

    return answer


def _with_files(task: str, *names: str) -> Endpoint:
    """Return an endpoint that sends the report of a task on the files of a form.

    The arguments of the task are the paths of copies of the files, and the values of the named
    fields of the form.
    """

    async def answer(request: Request) -> Response:
        async with AsyncExitStack() as stack:
            folder = stack.enter_context(TemporaryDirectory())
            async with request.form() as form:
                files = [value for value in form.getlist("file") if not isinstance(value, str)]
                values = [
                    {"table": _table, "case": _case}[name](request, str(form.get(name, "{}")))
                    for name in names
                ]
                if not files:
                    raise HTTPException(400, "the request contains no form with a file")
                paths = await anyio.to_thread.run_sync(_copy, files, folder)
            reports = request.app.state.jobs.run(task, paths, *values)
            return _Reports(reports, stack.pop_all())

    return answer


def _copy(files: Sequence[UploadFile], folder: str) -> list[str]:
    """Return the paths of copies of files; their names have no folder, are short and differ."""
    paths: list[str] = []
    for number, file in enumerate(files, 1):
        name = "".join(filter(str.isprintable, re.split(r"[/\\]", file.filename or "")[-1]))
        name = name[-MAX_NAME:].strip(". ") or "recording"
        path = Path(folder, name)
        path = path.with_name(f"{number} {name}") if path.exists() else path
        with path.open("wb") as target:
            shutil.copyfileobj(file.file, target)
        paths.append(str(path))
    return paths


def _guarded(endpoint: Endpoint, max_length: int = 0) -> Endpoint:
    """Return an endpoint that rejects requests without the token, or too long ones."""

    async def answer(request: Request) -> Response:
        token = request.headers.get(TOKEN, "").encode()
        if not secrets.compare_digest(token, request.app.state.token.encode()):
            message = "open the full address shown in the terminal: it holds the token"
            raise HTTPException(403, message)
        # The server ends a body that is longer than its head states.
        length = request.headers.get("content-length")
        if length is None and request.method == "POST":
            raise HTTPException(411, "the request does not state the length of its data")
        if int(length or 0) > max_length:
            message = f"the data are larger than {max_length / 1e6:g} MB; allowed: less"
            raise HTTPException(413, message)
        return await endpoint(request)

    return answer


async def _report_error(request: Request, error: Exception) -> Response:  # noqa: ARG001 - an error handler
    if isinstance(error, HTTPException):
        return JSONResponse({"error": error.detail, "field": None}, error.status_code)
    return JSONResponse(describe_error(error), 400)


class _Reports(StreamingResponse):
    """Response with reports as lines; closes the reports and their resources at its end."""

    def __init__(self, reports: Reports, stack: AsyncExitStack) -> None:
        stack.push_async_callback(reports.aclose)
        self._stack = stack
        lines = (json.dumps(report, allow_nan=False) + "\n" async for report in reports)
        super().__init__(lines, media_type="application/x-ndjson")

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        async with self._stack:
            await super().__call__(scope, receive, send)


def _table(_: Request, content: bytes | str) -> dict[str, Any]:
    """Return a JSON object."""
    try:
        values = json.loads(content)
    except (UnicodeDecodeError, ValueError, RecursionError):
        values = None
    if not isinstance(values, dict):
        raise HTTPException(400, "the request does not contain a table of plain values")
    return values


def _case(request: Request, content: bytes | str) -> dict[str, dict[str, Any]]:
    """Return the values of a case, by group and key: each value is plain, or a list of plain ones.

    Raise InputError if they name a file that the server does not offer itself.
    """
    values = _table(request, content)
    if not all(map(_is_group, values.values())):
        raise HTTPException(400, "the request does not contain groups of keys with plain values")
    for group, name in FILE_KEYS:
        path = values.get(group, {}).get(name)
        if path and path not in request.app.state.offered:
            problem = f"{humanize(name).capitalize()} cannot be chosen on the page"
            refuse(problem, "a file that it offers", subject=f"{group}.{name}")
    return values


def _is_group(keys: object) -> bool:
    """Whether a value of JSON is a table of plain values, and lists of them."""
    if not isinstance(keys, dict):
        return False
    lists = (value if isinstance(value, list) else [value] for value in keys.values())
    return not any(isinstance(entry, list | dict) for entries in lists for entry in entries)


def start_with(path: Path | None) -> dict[str, Any]:
    """Return the initial values of the page, by group and key.

    The path is a namelist file or a directory of results; None means the default case.
    """
    if path is None:
        return {}
    case = read_case(path / "effective.nml" if path.is_dir() else path)
    return {group: dict(keys) for group, keys in case.to_namelist().items()}


def run_server(application: Starlette, listener: socket.socket) -> None:
    """Serve an application on a listening socket until a signal."""
    # Without it the body of an answer may wait 40 ms for the acknowledgment of its head.
    listener.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    config = uvicorn.Config(
        application,
        http="h11",
        log_level="warning",
        headers=HEADERS,
        limit_concurrency=MAX_REQUESTS,
        timeout_keep_alive=IDLE_TIME,
        h11_max_incomplete_event_size=MAX_HEAD,
        timeout_graceful_shutdown=1,
    )
    uvicorn.Server(config).run(sockets=[listener])
