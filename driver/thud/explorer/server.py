"""Server of the page; separate processes compute the answers."""

from __future__ import annotations

import json
import secrets
import shutil
import socket
from contextlib import AsyncExitStack, aclosing, asynccontextmanager
from dataclasses import asdict
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, BinaryIO

import anyio
import uvicorn
from starlette.applications import Starlette
from starlette.datastructures import FormData, UploadFile
from starlette.exceptions import HTTPException
from starlette.formparsers import MultiPartException, MultiPartParser
from starlette.middleware import Middleware
from starlette.middleware.gzip import GZipMiddleware
from starlette.middleware.trustedhost import TrustedHostMiddleware
from starlette.requests import ClientDisconnect
from starlette.responses import JSONResponse, Response, StreamingResponse
from starlette.routing import Route

from thud.base._schema import KEYS
from thud.base.bridge import version
from thud.base.checks import refuse
from thud.case.case import read_case
from thud.case.keys import humanize
from thud.explorer.criteria import glossary
from thud.explorer.downloads import DOWNLOADS
from thud.explorer.form import construction_form, form
from thud.explorer.jobs import INPUT_ERRORS, Jobs
from thud.explorer.messages import describe_error
from thud.explorer.models import floor_facts, model_facts
from thud.explorer.page_file import new_page
from thud.explorer.presets import presets
from thud.explorer.recording_fields import FIELDS, PRESS_FIELDS, recording_table

if TYPE_CHECKING:
    from collections.abc import AsyncGenerator, Awaitable, Callable, Iterator, Mapping, Sequence

    from starlette.requests import Request
    from starlette.types import Receive, Scope, Send

    Endpoint = Callable[[Request], Awaitable[Response]]

# Maximum size of a case and of the files of a recording, bytes.
MAX_CASE = 100_000
MAX_RECORDING = 200_000_000
# Keys that name files, by group: all texts but the name of the case and the lists of unknowns.
FILE_KEYS = {
    key.group: [other.name for other in KEYS if other.group == key.group and other.kind == "text"]
    for key in KEYS
    if key.kind == "text" and key.group != "case"
}
# Maximum length of the name of a copy of a file, of up to four bytes a character.
MAX_NAME = 50
# Maximum number of files and of fields in a form.
MAX_FILES = 100
MAX_FIELDS = 100
# Maximum number of requests at a time, and time that an idle connection stays open, s.
MAX_REQUESTS = 500
IDLE_TIME = 10
# Header that carries the token.
TOKEN = "x-thud-token"  # noqa: S105 - its name
# Header of a downloaded sound with its full scale, Pa.
FULL_SCALE = "x-thud-full-scale"
# Maximum pause between two chunks of a body, s, and its maximum duration: a time, s, plus that of
# its bytes at a rate, 1/s.
BODY_TIMEOUT = 20.0
BODY_TIME, BODY_RATE = 60.0, 50_000.0
# Level of compression: higher ones save a few percent and take twice as long.
COMPRESSION = 6
# Time limits of a task and of a task that is expected to be quick, s; after that it runs again as a
# slow task.
TIME_LIMIT = 300.0
QUICK_TIME_LIMIT = 1.0
HEADERS = {
    "Content-Security-Policy": "default-src 'none'; frame-ancestors 'none'",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-store",
}


def new_application(
    start: Mapping[str, Any], *, token: str, hosts: tuple[str, ...], width: int = 2
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
        Maximum number of concurrent slow tasks, and of copies of recordings; the maximum number of
        quick tasks is twice as large.
    """
    if not token:
        refuse("the token is empty", "a secret text")
    slow = Jobs(width, TIME_LIMIT)
    quick = Jobs(2 * width, QUICK_TIME_LIMIT, late={"answer": None}, reuse=True)

    @asynccontextmanager
    async def lifespan(_: Starlette) -> AsyncGenerator[None, None]:
        yield
        quick.close()

    application = Starlette(
        routes=[
            Route("/", _page),
            *(
                Route(path, _guarded(endpoint), methods=methods)
                for path, endpoint, methods in (
                    ("/about", _about, ["GET"]),
                    ("/solve", _solve, ["POST"]),
                    ("/measure", _measure, ["POST"]),
                    ("/report", _report, ["POST"]),
                    ("/improve", _improve, ["POST"]),
                    ("/fit", _fit, ["POST"]),
                    ("/press", _press, ["POST"]),
                    ("/download/{name}", _download, ["POST"]),
                )
            ),
        ],
        middleware=[
            Middleware(TrustedHostMiddleware, allowed_hosts=list(hosts)),
            Middleware(GZipMiddleware, compresslevel=COMPRESSION),
        ],
        exception_handlers=dict.fromkeys((*INPUT_ERRORS, HTTPException, _TaskError), _report_error)
        | {ClientDisconnect: _ignore_error},
        lifespan=lifespan,
    )
    application.state.about = {
        "form": form(),
        "constructions": construction_form(),
        "recording": list(map(asdict, FIELDS)),
        "press": list(map(asdict, PRESS_FIELDS)),
        "models": model_facts(),
        "floors": floor_facts(),
        "presets": presets(),
        "glossary": glossary(),
        "version": version(),
        "start": start,
        "max_recording": MAX_RECORDING,
    }
    # The page itself is sent without a token, and holds nothing of a user.
    application.state.page = new_page(None if start else presets()[0]["values"])
    application.state.offered = {
        path
        for values in (start, *(facts["values"] for facts in floor_facts()))
        for _, keys in _files_in(values)
        for path in keys.values()
    }
    application.state.token = token
    application.state.slow = slow
    application.state.quick = quick
    application.state.copies = anyio.Semaphore(width)
    return application


async def _page(request: Request) -> Response:
    page = request.app.state.page
    headers = {
        **HEADERS, "Content-Security-Policy": page.policy, "Cache-Control": "no-cache",
        "ETag": page.tag,
    }  # fmt: skip
    if page.tag in request.headers.get("if-none-match", ""):
        return Response(status_code=304, headers=headers)
    return Response(page.content, media_type="text/html", headers=headers)


async def _about(request: Request) -> Response:
    return JSONResponse(request.app.state.about, headers=HEADERS)


async def _solve(request: Request) -> Response:
    values = await _values(request)
    answer = await _answer(request, request.app.state.quick.run("quick case", values))
    if answer is None:
        return _Reports(request.app.state.slow.run("case", values), AsyncExitStack())
    return JSONResponse({"answer": answer}, headers=HEADERS)


async def _measure(request: Request) -> Response:
    return await _with_files(request, "recording", lambda form: (recording_table(form),))


async def _report(request: Request) -> Response:
    return await _with_files(request, "report", lambda form: (recording_table(form),))


async def _improve(request: Request) -> Response:
    reports = request.app.state.slow.run("improve", await _values(request))
    return _Reports(reports, AsyncExitStack())


async def _fit(request: Request) -> Response:
    return await _with_files(
        request, "fit", lambda form: (recording_table(form), _groups(request, form.get("case", "")))
    )


async def _press(request: Request) -> Response:
    return await _with_files(
        request, "press", lambda form: (dict(form), _groups(request, form.get("case", "")))
    )


async def _with_files(
    request: Request, task: str, arguments: Callable[[Mapping[str, str]], tuple[object, ...]]
) -> Response:
    """Return reports of a slow task on the files of a form.

    Its arguments are the paths of copies of the files, and the `arguments` of the fields of the
    form.
    """
    state = request.app.state
    async with AsyncExitStack() as stack:
        await stack.enter_async_context(state.copies)
        folder = stack.enter_context(TemporaryDirectory())
        async with _received(request) as form:
            fields = {name: value for name, value in form.items() if isinstance(value, str)}
            further = arguments({name: text for name, text in fields.items() if text})
            files = [value for value in form.getlist("file") if isinstance(value, UploadFile)]
            if not files:
                raise HTTPException(400, "the request contains no file")
            paths = [
                str(Path(folder, name)) for name in _names([file.filename or "" for file in files])
            ]
            for file, path in zip(files, paths, strict=True):
                await anyio.to_thread.run_sync(_copy, file.file, path)
        return _Reports(state.slow.run(task, paths, *further), stack.pop_all())


@asynccontextmanager
async def _received(request: Request) -> AsyncGenerator[FormData, None]:
    """Yield the form in the body of a request, and close its files."""
    if not request.headers.get("content-type", "").startswith("multipart/form-data"):
        raise HTTPException(400, "the request does not contain a form with files")
    parser = MultiPartParser(
        request.headers, _body(request, MAX_RECORDING),
        max_files=MAX_FILES, max_fields=MAX_FIELDS, max_part_size=MAX_CASE,
    )  # fmt: skip
    try:
        form = await parser.parse()
    except MultiPartException as error:
        raise HTTPException(400, f"the form cannot be read: {error.message}") from None
    try:
        yield form
    finally:
        await form.close()


def _names(names: Sequence[str]) -> list[str]:
    """Return names for copies of files: the same, but without folders, short and different.

    >>> _names(["../a b.wav", "a b.wav", ".."])
    ['a b.wav', '2 a b.wav', 'recording']
    """
    result: list[str] = []
    for number, name in enumerate(names, 1):
        path = Path("".join(filter(str.isprintable, name)).replace("\\", "/"))
        ending = "".join(c for c in path.suffix if c.isascii() and c.isalnum())[:8]
        title = path.stem.strip(". ")[:MAX_NAME] or "recording"
        title = f"{title}.{ending}" if ending else title
        result.append(f"{number} {title}" if title in result else title)
    return result


def _copy(source: BinaryIO, path: str) -> None:
    with Path(path).open("wb") as target:
        shutil.copyfileobj(source, target)


async def _download(request: Request) -> Response:
    if (name := request.path_params["name"]) not in DOWNLOADS:
        raise HTTPException(404, "there is no such file")
    reports = request.app.state.slow.run("download", name, await _values(request))
    content, full_scale = await _answer(request, reports)
    headers = HEADERS if full_scale is None else HEADERS | {FULL_SCALE: repr(full_scale)}
    return Response(content, media_type=DOWNLOADS[name][1], headers=headers)


async def _answer(request: Request, reports: AsyncGenerator[dict[str, Any], None]) -> Any:  # noqa: ANN401 - of any task
    """Return the answer at the end of reports; cancel the task if the page disconnects."""
    report: dict[str, Any] = {}

    async def cancel_on_disconnect() -> None:
        while (await request.receive())["type"] != "http.disconnect":
            pass
        group.cancel_scope.cancel()

    async with anyio.create_task_group() as group, aclosing(reports):
        group.start_soon(cancel_on_disconnect)
        async for report in reports:  # noqa: B007 - the last report is used
            pass
        group.cancel_scope.cancel()
    if "error" in report:
        raise _TaskError(report)
    if "answer" not in report:
        raise ClientDisconnect
    return report["answer"]


def _guarded(endpoint: Endpoint) -> Endpoint:
    """Return an endpoint that rejects requests from other pages or without the token."""

    async def answer(request: Request) -> Response:
        origin = f"{request.url.scheme}://{request.headers.get('host')}"
        if request.headers.get("origin") not in {None, origin}:
            raise HTTPException(403, "the request comes from another page")
        token = request.headers.get(TOKEN, "").encode()
        if not secrets.compare_digest(token, request.app.state.token.encode()):
            message = "open the full address shown in the terminal: it holds the token"
            raise HTTPException(403, message)
        return await endpoint(request)

    return answer


async def _report_error(request: Request, error: Exception) -> Response:  # noqa: ARG001 - an error handler
    if isinstance(error, _TaskError):
        return JSONResponse(error.report, 400, headers=HEADERS)
    if isinstance(error, HTTPException):
        report = {"error": error.detail, "field": None}
        return JSONResponse(report, error.status_code, headers=HEADERS)
    return JSONResponse(describe_error(error), 400, headers=HEADERS)


async def _ignore_error(request: Request, error: Exception) -> Response:  # noqa: ARG001 - an error handler
    """Return an empty response, which nobody reads, to a page that has disconnected."""
    return Response(status_code=400)


class _TaskError(Exception):
    """A task has ended with an error; `report` is its last report."""

    def __init__(self, report: dict[str, Any]) -> None:
        super().__init__(report["error"])
        self.report = report


class _Reports(StreamingResponse):
    """Response with reports as lines; closes the reports and their resources at its end."""

    def __init__(
        self, reports: AsyncGenerator[dict[str, Any], None], stack: AsyncExitStack
    ) -> None:
        stack.push_async_callback(reports.aclose)
        self._stack = stack
        lines = (json.dumps(report, allow_nan=False) + "\n" async for report in reports)
        super().__init__(lines, media_type="application/x-ndjson", headers=HEADERS)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        async with self._stack:
            await super().__call__(scope, receive, send)


async def _body(request: Request, max_length: int) -> AsyncGenerator[bytes, None]:
    """Yield the chunks of a body; raise HTTPException if it is too long, too slow or stops."""
    length = 0
    start = anyio.current_time()
    chunks = request.stream()
    while True:
        rest = start + BODY_TIME + length / BODY_RATE - anyio.current_time()
        try:
            with anyio.fail_after(min(BODY_TIMEOUT, rest)):
                chunk = await anext(chunks)
        except StopAsyncIteration:
            return
        except TimeoutError:
            slow = f"the data arrive too slowly; allowed: {BODY_RATE / 1e3:g} kB/s or more"
            stop = f"no data received for {BODY_TIMEOUT:g} s; allowed: less"
            message = slow if rest < BODY_TIMEOUT else stop
            raise HTTPException(408, message) from None
        length += len(chunk)
        if length > max_length:
            message = f"the data are larger than {max_length / 1e6:g} MB; allowed: less"
            raise HTTPException(413, message)
        yield chunk


async def _values(request: Request) -> dict[str, dict[str, Any]]:
    """Return the values in the body of a request, by group and key."""
    return _groups(request, b"".join([chunk async for chunk in _body(request, MAX_CASE)]))


def _groups(request: Request, content: bytes | str) -> dict[str, dict[str, Any]]:
    """Return the values of JSON, by group and key: each value is plain, or a list of plain ones.

    Raise InputError if they name a file that the server does not offer itself.
    """
    try:
        values = json.loads(content)
    except (UnicodeDecodeError, ValueError, RecursionError):
        values = None
    if not (isinstance(values, dict) and all(map(_is_group, values.values()))):
        raise HTTPException(400, "the request does not contain groups of keys with plain values")
    for group, keys in _files_in(values):
        for name, path in keys.items():
            if not isinstance(path, str) or path not in request.app.state.offered:
                problem = f"{humanize(name).capitalize()} cannot be chosen on the page"
                refuse(problem, "a file that it offers", subject=f"{group}.{name}")
    return values


def _is_group(keys: object) -> bool:
    """Whether a value of JSON is a table of plain values, and lists of them."""
    if not isinstance(keys, dict):
        return False
    lists = (value if isinstance(value, list) else [value] for value in keys.values())
    return not any(isinstance(entry, list | dict) for entries in lists for entry in entries)


def _files_in(values: Mapping[str, Any]) -> Iterator[tuple[str, dict[str, str]]]:
    """Yield groups with the files that they name, by key."""
    for group, names in FILE_KEYS.items():
        keys = values.get(group)
        if isinstance(keys, dict):
            yield group, {name: keys[name] for name in names if keys.get(name)}


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
        limit_concurrency=MAX_REQUESTS,
        timeout_keep_alive=IDLE_TIME,
        timeout_graceful_shutdown=1,
    )
    uvicorn.Server(config).run(sockets=[listener])
