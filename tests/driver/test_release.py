"""The version is one: in the library, the changelog and the citation."""

from __future__ import annotations

import re

from conftest import REPOSITORY

import thud


def test_changelog_begins_with_this_version() -> None:
    text = (REPOSITORY / "CHANGELOG.md").read_text(encoding="utf-8")
    found = re.findall(r"^## (.+)$", text, re.MULTILINE)
    released = [
        re.fullmatch(r"(\d+)\.(\d+)\.(\d+) - \d{4}-\d\d-\d\d", one)
        for one in found
        if one != "Unreleased"
    ]
    versions = [tuple(map(int, one.groups())) for one in released if one]
    assert len(versions) == len(released)
    assert versions == sorted(versions, reverse=True)
    assert ".".join(map(str, versions[0])) == thud.__version__


def test_citation_is_of_this_version_and_its_date() -> None:
    changes = (REPOSITORY / "CHANGELOG.md").read_text(encoding="utf-8")
    citation = (REPOSITORY / "CITATION.cff").read_text(encoding="utf-8")
    version, date = re.findall(r"^(?:version|date-released): (.+)$", citation, re.MULTILINE)
    assert f"\n## {version} - {date}\n" in changes
    assert version == thud.__version__
