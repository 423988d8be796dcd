"""The server of the page: plain requests, answered at once or by a stream of reports."""

from __future__ import annotations

import json
import secrets
from importlib import resources
from typing import TYPE_CHECKING, Any

import plotly
from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.middleware import Middleware
from starlette.middleware.trustedhost import TrustedHostMiddleware
from starlette.responses import JSONResponse, PlainTextResponse, Response, StreamingResponse
from starlette.routing import Route

from thud._api import version
from thud.case import read_case
from thud.errors import ThudError
from thud.explorer.answer import answer_case, new_case
from thud.explorer.downloads import DOWNLOADS
from thud.explorer.form import SLOW, form
from thud.explorer.jobs import Jobs

if TYPE_CHECKING:
    from collections.abc import AsyncIterator, Awaitable, Callable, Mapping
    from pathlib import Path

    from starlette.requests import Request

# Largest bodies of a case and of a recording, bytes.
MAX_CASE = 100_000
MAX_RECORDING = 200_000_000
# Header that carries the token.
TOKEN = "x-thud-token"  # noqa: S105 - its name
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


class Refused(Exception):
    """A request that is not answered.

    Attributes
    ----------
    status : int
        Status of HTTP.
    """

    def __init__(self, status: int, message: str) -> None:
        """Take status and sentence."""
        super().__init__(message)
        self.status = status


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
    jobs = Jobs(width)
    about = {"form": form(), "slow": SLOW, "version": version(), "start": start}

    async def page(request: Request) -> Response:
        name = request.path_params.get("name", "index.html")
        if name == "plotly.min.js":
            content = (resources.files(plotly) / "package_data" / name).read_bytes()
        elif name in {"index.html", "explorer.js", "explorer.css"}:
            content = (resources.files(__package__) / "page" / name).read_bytes()
        else:
            raise Refused(404, "there is no such file")
        headers = HEADERS | ({} if name == "index.html" else {"Cache-Control": "max-age=3600"})
        return Response(content, media_type=TYPES[name.rpartition(".")[2]], headers=headers)

    async def describe(request: Request) -> Response:  # noqa: ARG001 - what a route is given
        return JSONResponse(about, headers=HEADERS)

    async def solve(request: Request) -> Response:
        case = new_case(await _values(request))
        return JSONResponse(await run_in_threadpool(answer_case, case), headers=HEADERS)

    async def solve_slowly(request: Request) -> Response:
        return _stream(jobs.run("case", await _values(request)))

    async def measure(request: Request) -> Response:
        content = await _body(request, MAX_RECORDING)
        asked = request.query_params
        numbers = [float(text) if (text := asked.get(key)) else None for key in ("height", "mass")]
        return _stream(jobs.run("recording", asked.get("name", "recording.wav"), content, *numbers))

    async def download(request: Request) -> Response:
        if (what := request.path_params["what"]) not in DOWNLOADS:
            raise Refused(404, "there is no such file")
        make, media = DOWNLOADS[what]
        content = await run_in_threadpool(make, await _values(request))
        return Response(content, media_type=media, headers=HEADERS)

    def guarded(
        endpoint: Callable[[Request], Awaitable[Response]],
    ) -> Callable[[Request], Awaitable[Response]]:
        async def answer(request: Request) -> Response:
            try:
                origin = request.headers.get("origin")
                own = f"{request.url.scheme}://{request.headers.get('host')}"
                if origin not in {None, own}:
                    raise Refused(403, "the request comes from another page")
                given = request.headers.get(TOKEN, "")
                if not secrets.compare_digest(given.encode(), token.encode()):
                    raise Refused(403, "the token is missing: open the address that was printed")
                return await endpoint(request)
            except Refused as refusal:
                return _sentence(str(refusal), refusal.status)
            except (ThudError, TypeError, KeyError, ValueError) as error:
                return _sentence(str(error), 400)

        return answer

    async def plain(request: Request) -> Response:
        try:
            return await page(request)
        except Refused as refusal:
            return _sentence(str(refusal), refusal.status)

    return Starlette(
        routes=[
            Route("/", plain),
            Route("/page/{name}", plain),
            Route("/about", guarded(describe)),
            Route("/solve", guarded(solve), methods=["POST"]),
            Route("/solve_slowly", guarded(solve_slowly), methods=["POST"]),
            Route("/measure", guarded(measure), methods=["POST"]),
            Route("/download/{what}", guarded(download), methods=["POST"]),
        ],
        middleware=[Middleware(TrustedHostMiddleware, allowed_hosts=list(hosts))],
    )


def _sentence(message: str, status: int) -> Response:
    return PlainTextResponse(message, status, headers=HEADERS)


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
            raise Refused(413, f"the data are longer than {largest / 1e6:g} MB; allowed: shorter")
    return bytes(found)


async def _values(request: Request) -> dict[str, dict[str, Any]]:
    """Return the values of keys by group that a request holds."""
    try:
        values = json.loads(await _body(request, MAX_CASE))
    except (UnicodeDecodeError, ValueError, RecursionError):
        values = None
    if not isinstance(values, dict) or not all(isinstance(one, dict) for one in values.values()):
        raise Refused(400, "the request holds no groups of keys")
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
