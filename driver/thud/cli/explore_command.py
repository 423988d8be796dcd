"""The command that opens the explorer, a page in a browser."""

from __future__ import annotations

import platform
import secrets
import socket
import sys
import tempfile
import webbrowser
from pathlib import Path
from typing import TYPE_CHECKING

from thud.base.checks import refuse
from thud.base.extras import require_extra
from thud.cli.command import QUIET, command, files, flag, option
from thud.cli.screen import print_notes, print_path, print_results

if TYPE_CHECKING:
    import argparse

# Host names that are reachable from this machine only.
LOOPBACK = ("127.0.0.1", "localhost", "[::1]")
# Hosts that stand for all addresses of this machine, with the name of one.
ALL_ADDRESSES = {"0.0.0.0": "localhost", "[::]": "[::1]"}  # noqa: S104 - only compared


@command(
    "explore",
    "interactive page in a browser",
    files("case", "CASE.nml|RESULTS", "case, or directory of results, to start with (default: "
          "a standard ball)", "case", "directory", nargs="?"),
    option("--host", "HOST", f"address to listen on (default: {LOOPBACK[0]}, this machine "
           "only)", default=LOOPBACK[0]),
    option("--port", "PORT", "port to listen on (default: any free port)", type=int, default=0),
    flag("--no-browser", "only print the address"),
    QUIET,
)  # fmt: skip
def explore(options: argparse.Namespace) -> int:
    """Serve the page until interrupted; return the exit code."""
    with require_extra("explorer"):
        from thud.explorer.server import new_application, run_server, start_with
    start = start_with(options.case and Path(options.case))
    token = secrets.token_urlsafe(16)
    version_6 = ":" in options.host
    host = f"[{options.host}]" if version_6 else options.host
    hosts = LOOPBACK if host in LOOPBACK else ("*",)
    if not 0 <= options.port < 2**16:
        refuse(f"--port = {options.port} is not a port", f"0 (any free port) to {2**16 - 1}")
    try:
        listener = socket.create_server(
            (options.host, options.port), family=socket.AF_INET6 if version_6 else socket.AF_INET
        )
    except OSError as error:
        refuse(f"{host}:{options.port} is not available", "a free port", error)
    address = f"http://{_reachable_name(host)}:{listener.getsockname()[1]}/#token={token}"
    if not options.quiet:
        print_path("Page", address)
        print_results("Press Ctrl-C to stop.")
        sys.stdout.flush()
    if hosts == ("*",):
        warning = (
            "other machines can reach the page under the name of this one, and it is not "
            "encrypted; anyone with the address can run computations here"
        )
        print_notes([warning])
    application = new_application(start, token=token, hosts=hosts)
    before = tempfile.tempdir
    with listener, tempfile.TemporaryDirectory() as folder:
        tempfile.tempdir = folder
        try:
            if not options.no_browser:
                webbrowser.open(_redirect(Path(folder), address))
            run_server(application, listener)
        finally:
            tempfile.tempdir = before
    return 0


def _reachable_name(host: str) -> str:
    """Return the name of a host in the address of the page.

    From Windows, servers in WSL are reachable as localhost, but not always as 127.0.0.1; so are
    published ports of containers.
    """
    is_wsl = "microsoft" in platform.release().lower()
    return "localhost" if is_wsl and host in LOOPBACK else ALL_ADDRESSES.get(host, host)


def _redirect(folder: Path, address: str) -> str:
    """Return the address of a file that redirects to a page.

    Other users of the machine can see the arguments of the browser, but not read the file.
    """
    path = folder / "open.html"
    path.touch(0o600)
    path.write_text(f'<!doctype html><meta http-equiv="refresh" content="0; url={address}">')
    return path.as_uri()
