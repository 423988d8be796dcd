"""The server of the page: plain requests, answered at once or by a stream of reports."""

from __future__ import annotations

import json
import secrets
from importlib import resources
from typing import TYPE_CHECKING, Any

from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException
from starlette.middleware import Middleware
from starlette.middleware.trustedhost import TrustedHostMiddleware
from starlette.requests import ClientDisconnect
from starlette.responses import JSONResponse, PlainTextResponse, Response, StreamingResponse
from starlette.routing import Route

from thud._api import version
from thud.case import read_case
from thud.cli.command import channel_of
from thud.errors import ThudError
from thud.explorer.answer import answer_case, new_case
from thud.explorer.downloads import DOWNLOADS
from thud.explorer.form import SLOW, form
from thud.explorer.jobs import Jobs

if TYPE_CHECKING:
    from collections.abc import AsyncIterator, Awaitable, Callable, Mapping
    from pathlib import Path

    from starlette.requests import Request

    Endpoint = Callable[[Request], Awaitable[Response]]

# Largest bodies of a case and of a recording, bytes.
MAX_CASE = 100_000
MAX_RECORDING = 200_000_000
# Header that carries the token.
TOKEN = "x-thud-token"  # noqa: S105 - its name
# Files of the page, by name: their package and folder.
FILES = dict.fromkeys(("index.html", "explorer.js", "explorer.css"), (__package__, "page")) | {
    "plotly.min.js": ("plotly", "package_data")
}
TYPES = {"html": "text/html", "js": "text/javascript", "css": "text/css"}
# The page loads nothing from elsewhere; Plotly styles its elements.
POLICY = (
    "default-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; "
    "frame-ancestors 'none'; base-uri 'none'; form-action 'none'"
)
HEADERS = {
    "Content-Security-Policy": POLICY,
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
        What the page starts with, see `start_with`.
    token
        Secret that requests must carry.
    hosts
        Names under which the server may be asked.
    width
        Slow works at a time.
    """
    application = Starlette(
        routes=[
            Route("/", _page),
            Route("/page/{name}", _page),
            *(
                Route(path, _guarded(endpoint), methods=methods)
                for path, endpoint, methods in (
                    ("/about", _about, ["GET"]),
                    ("/solve", _solve, ["POST"]),
                    ("/solve_slowly", _solve_slowly, ["POST"]),
                    ("/measure", _measure, ["POST"]),
                    ("/download/{what}", _download, ["POST"]),
                )
            ),
        ],
        middleware=[Middleware(TrustedHostMiddleware, allowed_hosts=list(hosts))],
        # Values of wrong types stop where they are first used.
        exception_handlers=dict.fromkeys((ThudError, TypeError, ValueError, KeyError), _refuse)
        | {ClientDisconnect: _forget},
    )
    application.state.about = {"form": form(), "slow": SLOW, "version": version(), "start": start}
    application.state.token = token
    application.state.jobs = Jobs(width)
    return application


async def _page(request: Request) -> Response:
    name = request.path_params.get("name", "index.html")
    if name not in FILES:
        raise HTTPException(404, "there is no such file")
    package, folder = FILES[name]
    content = (resources.files(package) / folder / name).read_bytes()
    return Response(content, media_type=TYPES[name.rpartition(".")[2]], headers=HEADERS)


async def _about(request: Request) -> Response:
    return JSONResponse(request.app.state.about, headers=HEADERS)


async def _solve(request: Request) -> Response:
    case = new_case(await _values(request))
    return JSONResponse(await run_in_threadpool(answer_case, case), headers=HEADERS)


async def _solve_slowly(request: Request) -> Response:
    return _stream(request.app.state.jobs.run("case", await _values(request)))


async def _measure(request: Request) -> Response:
    content = await _body(request, MAX_RECORDING)
    asked = dict(request.query_params)
    settings: dict[str, Any] = {
        key: float(asked[key]) for key in ("height", "mass") if key in asked
    }
    settings |= {key: asked[key] for key in ("calibration", "unit") if key in asked}
    if "channel" in asked:
        settings["channel"] = channel_of(asked["channel"])
    name = asked.get("name", "recording.wav")
    return _stream(request.app.state.jobs.run("recording", name, content, settings))


async def _download(request: Request) -> Response:
    if (what := request.path_params["what"]) not in DOWNLOADS:
        raise HTTPException(404, "there is no such file")
    make, media = DOWNLOADS[what]
    content = await run_in_threadpool(make, await _values(request))
    return Response(content, media_type=media, headers=HEADERS)


def _guarded(endpoint: Endpoint) -> Endpoint:
    """Refuse requests of other pages, and those without the token."""

    async def answer(request: Request) -> Response:
        own = f"{request.url.scheme}://{request.headers.get('host')}"
        if request.headers.get("origin") not in {None, own}:
            raise HTTPException(403, "the request comes from another page")
        given = request.headers.get(TOKEN, "").encode()
        if not secrets.compare_digest(given, request.app.state.token.encode()):
            raise HTTPException(403, "the token is missing: open the address that was printed")
        return await endpoint(request)

    return answer


async def _refuse(request: Request, error: Exception) -> Response:  # noqa: ARG001 - what is given
    return PlainTextResponse(str(error), 400, headers=HEADERS)


async def _forget(request: Request, error: Exception) -> Response:  # noqa: ARG001 - what is given
    """Answer a page that left while it sent: nobody reads it, and it is no fault."""
    return Response(status_code=400)


def _stream(reports: AsyncIterator[dict[str, Any]]) -> Response:
    async def lines() -> AsyncIterator[str]:
        async for report in reports:
            yield json.dumps(report) + "\n"

    return StreamingResponse(lines(), media_type="application/x-ndjson", headers=HEADERS)


async def _body(request: Request, largest: int) -> bytes:
    """Return the body of a request; it is read no further than it may be long."""
    found = bytearray()
    async for part in request.stream():
        found += part
        if len(found) > largest:
            raise HTTPException(
                413, f"the data are longer than {largest / 1e6:g} MB; allowed: shorter"
            )
    return bytes(found)


async def _values(request: Request) -> dict[str, dict[str, Any]]:
    """Return the values of keys by group that a request holds."""
    try:
        values = json.loads(await _body(request, MAX_CASE))
    except (UnicodeDecodeError, ValueError, RecursionError):
        values = None
    if not isinstance(values, dict) or not all(isinstance(one, dict) for one in values.values()):
        raise HTTPException(400, "the request holds no groups of keys")
    return values


def start_with(path: Path | None) -> dict[str, Any]:
    """Return the values of a case that the page starts with, by group.

    Parameters
    ----------
    path
        Namelist file, or directory of results; without it the default case.
    """
    if path is None:
        return {}
    case = read_case(path / "effective.nml" if path.is_dir() else path)
    return {group: dict(keys) for group, keys in case.to_namelist().items()}
