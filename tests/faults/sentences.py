"""What a refusal must be: one sentence that says where, what and what is allowed."""

from __future__ import annotations

import re

import thud

# Characters of a sentence without the path of its file.
LONGEST = 500
# What a number that is none, a parser or an interpreter leaves in a sentence.
INNER = re.compile(
    r"\b([nN]a[nN]|-?[iI]nf(inity)?)\b|\*\*\*|Traceback|<class |object at 0x"
    r"|\b[A-Z]\w+(Error|Exception)\b|codec|\bndarray\b|\bnumpy\b|\bNone\b|\bdtype\b"
)
CONTROL = re.compile("[\x00-\x1f\x7f-\x9f\ud800-\udfff]")


def fault_of(error: thud.ThudError, path: str, given: str) -> str:
    """Return what is wrong with the sentence of an error about a file, if anything."""
    said = str(error)
    begins = said.startswith(path)
    rest = said.replace(path, "")
    inner = {found[0].lower() for found in INNER.finditer(rest)}
    # Numbers too large to be held are shown as infinite.
    inner -= {"infinity", "inf"} if re.search(r"inf|e\+?\d{3}|\d{300}", given.lower()) else set()
    inner = {word for word in inner if word not in given.lower()}
    wrong = [
        (not begins, "does not name its file"),
        (bool(CONTROL.search(said)), "has characters that do not print"),
        (len(rest) > LONGEST, f"has {len(rest)} characters"),
        (bool(inner), f"has {inner}"),
        (isinstance(error, thud.InputError) and "; allowed: " not in said, "allows nothing"),
        (said.count("; allowed: ") > 1, "allows twice"),
    ]
    return "; ".join(f"{what}: {said!r}" for is_so, what in wrong if is_so)
