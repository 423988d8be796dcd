"""Oracles: what tests hold against independent answers, and the record of it; approved snapshots.

`pytest --oracles FILE` runs the tests that have oracles and writes what they measured as JSON, from
which the page `docs/validation.md` is made (`./bootstrap validation`).

`pytest --renew` writes the approved texts in the folders `approved` anew: look at their changes
before you commit them.
"""

from __future__ import annotations

import datetime as dt
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import thud

if TYPE_CHECKING:
    from collections.abc import Callable

OPTION = "--oracles"
RENEW = "--renew"
ORACLES = pytest.StashKey[dict[str, dict[str, Any]]]()
CURVES = pytest.StashKey[dict[str, dict[str, Any]]]()


@pytest.fixture
def oracle(record_property: Callable[[str, object], None]) -> Callable[..., None]:
    """Return a function that holds a difference against its bound, and records both.

    The kinds of oracles are those of `docs/site/validation.py`.
    """

    def hold(what: str, kind: str, difference: object, bound: float, unit: str = "") -> None:
        measured = float(np.max(np.abs(difference)))  # type: ignore[arg-type]
        record_property("oracle", [what, kind, measured, float(bound), unit])
        assert measured <= bound, (what, difference)

    return hold


@pytest.fixture
def curve(record_property: Callable[[str, object], None]) -> Callable[..., None]:
    """Return a function that records a curve of a figure of the page."""

    def keep(figure: str, name: str, x: object, y: object) -> None:
        record_property("curve", [figure, name, np.asarray(x).tolist(), np.asarray(y).tolist()])

    return keep


@pytest.fixture
def approved(request: pytest.FixtureRequest) -> Callable[[str, str], None]:
    """Return a function that compares a text with an approved one, or writes that.

    The approved texts stand in the folder `approved` beside the test.
    """

    def compare(name: str, text: str) -> None:
        path = request.path.parent / "approved" / name
        text = text.rstrip("\n") + "\n"
        if request.config.getoption(RENEW):
            path.parent.mkdir(exist_ok=True)
            path.write_text(text, encoding="utf-8")
        assert path.exists(), f"{path} is missing: pytest {RENEW}"
        assert text == path.read_text("utf-8")

    return compare


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the file of the record, and the switch of approved texts."""
    parser.addoption(OPTION, type=Path, help="run the tests with oracles and write them as JSON")
    parser.addoption(RENEW, action="store_true", help="write the approved texts anew")


def pytest_configure(config: pytest.Config) -> None:
    """Begin with no record."""
    config.stash[ORACLES], config.stash[CURVES] = {}, {}
    config.pluginmanager.register(_Collector(config))


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leave the tests without oracles out where the record is asked for."""
    if config.getoption(OPTION):
        names = {"oracle", "curve"}
        items[:] = [item for item in items if names & set(getattr(item, "fixturenames", ()))]


class _Collector:
    """Takes what tests record, also from other processes."""

    def __init__(self, config: pytest.Config) -> None:
        self.config = config

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Take what a test recorded: of each oracle the comparison nearest to its bound."""
        if report.when != "call":
            return
        for name, found in report.user_properties:
            if name == "curve":
                figure, label, x, y = found
                self.config.stash[CURVES].setdefault(figure, {})[label] = {"x": x, "y": y}
            elif name == "oracle":
                what, kind, measured, bound, unit = found
                known = self.config.stash[ORACLES].get(what)
                entry = {
                    "what": what, "kind": kind, "measured": measured, "bound": bound, "unit": unit,
                    "test": report.nodeid.partition("[")[0],
                }  # fmt: skip
                if not known or measured * known["bound"] > known["measured"] * bound:
                    self.config.stash[ORACLES][what] = entry

    def pytest_sessionfinish(self, exitstatus: int) -> None:
        """Write the record of a run in which every test has passed."""
        path = self.config.getoption(OPTION)
        if path and not hasattr(self.config, "workerinput") and exitstatus == pytest.ExitCode.OK:
            record = {
                "version": thud.__version__,
                "date": dt.datetime.now(dt.UTC).date().isoformat(),
                "oracles": sorted(
                    self.config.stash[ORACLES].values(), key=lambda o: (o["test"], o["what"])
                ),
                "curves": dict(sorted(self.config.stash[CURVES].items())),
            }
            path.write_text(json.dumps(record, indent=1, ensure_ascii=False) + "\n", "utf-8")
