"""Damaged bytes, damaged texts, and what is wrong with the sentence that refuses them."""

from __future__ import annotations

import json
import re
from typing import TYPE_CHECKING, Any

import thud

if TYPE_CHECKING:
    import random

NUMBERS = [0, 1, 7, 127, 128, 255, 256, 2**15, 2**16 - 1, 2**20, 2**31 - 1, 2**31, 2**32 - 1,
           2**32, 2**40, 2**62, 2**63 - 1, 2**63, 2**64 - 1]  # fmt: skip
WORDS = [
    "0", "-1", "-0.0", "nan", "inf", "-inf", "1e999", "1e-999", "1e300", "1e-300", "1e-9",
    "0x10", "1_0", "1d0", "2*1.0", "3*", "1,2", "1,5", "2.5 3.5", "1.0.0", "1e", "+", ".5", "5.",
    "2147483648", "99999999999999999999", ".true.", "'a' 'b'", "'it''s'", "''", "'", '"x"', '"',
    ",", ";", "\t", "\n", "\r", "\r\n", "\0", "#", "!", "&", "&end", "&ball mass = 2 /", "/", "=",
    "(1)", "%", "$", "\\", "--", "µ", "é", "\ufeff", "\u2028", "\udcff", "\x1b", "x" * 300,
    "9" * 400,    "12" * 200, "    -1\n", "    58\n", "fs=0\n", "dt=-1\n", "unit=kN\n", "mm", "Hz",
]  # fmt: skip
# What a number that is none, a parser or an interpreter leaves in a sentence.
INNER = re.compile(
    r"\b([nN]a[nN]|-?[iI]nf(inity)?)\b|\*\*\*|Traceback|<class |object at 0x"
    r"|\b[A-Z]\w+(Error|Exception)\b|codec|\bndarray\b|\bnumpy\b|\bNone\b|\bdtype\b"
)
REMEDY = re.compile("; (allowed: |set )")
# Characters of a sentence without the path of its file.
LONGEST = 500


def damaged(data: bytes, chance: random.Random) -> bytes:
    """Return bytes of which some are flipped, replaced, removed, doubled or moved."""
    for _ in range(chance.choice([1, 1, 1, 2, 2, 3, 5])):
        size = len(data)
        if not size:
            break
        # What matters most stands at the begin.
        at = chance.randrange(min(size, 2048) if chance.random() < 0.6 else size)
        part = data[at : at + chance.randint(1, chance.choice([16, 4096]))]
        other = chance.randrange(size)
        width = chance.choice([1, 2, 4, 8])
        number = chance.choice(NUMBERS) % 2 ** (8 * width)
        flipped = bytearray(part)
        for _ in range(chance.randint(1, 8)):
            flipped[chance.randrange(len(part))] ^= 1 << chance.randrange(8)
        replaced, by = chance.choice([
            (len(part), bytes(flipped)),
            (len(part), chance.randbytes(len(part))),
            (size, b""),
            (len(part), b""),
            (len(part), bytes(len(part))),
            (len(part), b"\xff" * len(part)),
            (0, part),
            (width, number.to_bytes(width, chance.choice(["little", "big"]))),
            (0, chance.choice(WORDS).encode(errors="surrogateescape")),
            (len(part), data[other : other + len(part)]),
        ])  # fmt: skip
        data = data[:at] + by + data[at + replaced :]
    return data


def damaged_text(text: str, chance: random.Random) -> str:
    """Return a text of which some words or lines are replaced, removed, doubled or exchanged."""
    for _ in range(chance.choice([1, 1, 2, 4])):
        parts = re.split(r"(\n)" if chance.random() < 0.4 else r"([\s,;=\[\]{}]+)", text)
        at, other = chance.randrange(len(parts)), chance.randrange(len(parts))
        word = chance.choice(WORDS)
        parts[at] = chance.choice([word, word, "", parts[at] * 2, parts[other]])
        text = "".join(parts)
    return text


def fault_of(error: thud.ThudError, path: str, given: str) -> str:
    """Return what is wrong with the sentence of an error about a file, if anything."""
    said = str(error)
    rest = said.replace(path, "")
    # What the library of a format says stands in parentheses.
    inner = {found[0].lower() for found in INNER.finditer(re.sub(r"\(.*\)", "", rest))}
    # Numbers too large to be held are shown as infinite.
    inner -= {"infinity", "inf"} if re.search(r"inf|e\+?\d{3}|\d{300}", given.lower()) else set()
    inner = {word for word in inner if word not in given.lower()}
    wrong = [
        (not said.startswith(path), "does not name its file"),
        (bool(re.search("[\x00-\x1f\x7f-\x9f\ud800-\udfff]", said)), "does not print"),
        (len(rest) > LONGEST, f"has {len(rest)} characters"),
        (bool(inner), f"has {inner}"),
        (isinstance(error, thud.InputError) and len(REMEDY.findall(said)) != 1, "has no remedy"),
    ]
    return "; ".join(f"{what}: {said!r}" for is_so, what in wrong if is_so)


def toml(table: dict[str, Any]) -> str:
    """Return tables as TOML; tables in tables stand in one line."""

    def text(value: object) -> str:
        if isinstance(value, dict):
            return f"{{{', '.join(f'{json.dumps(k)} = {text(v)}' for k, v in value.items())}}}"
        if isinstance(value, list):
            return f"[{', '.join(map(text, value))}]"
        plain = json.dumps(value, ensure_ascii=False)
        return plain.replace("NaN", "nan").replace("Infinity", "inf")

    return "".join(f"{json.dumps(key)} = {text(value)}\n" for key, value in table.items())
