"""Small changes of sources: an operator, a sign, a constant, an index, a dropped term.

Of kept tools universalmutator knows both languages, but neither strings nor comments, and most of
its changes of Fortran do not compile; cosmic-ray and mutmut know Python only.
"""

from __future__ import annotations

import ast
import itertools
import re
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

# Operators and what replaces them, by language.
_SHARED = {
    "+": ["-"], "-": ["+"], "*": ["/"], "/": ["*"], "<": ["<=", ">="], "<=": ["<", ">"],
    ">": [">=", "<="], ">=": [">", "<"], "min": ["max"], "max": ["min"],
}  # fmt: skip
PYTHON = _SHARED | {
    "**": ["*"], "//": ["*"], "%": ["*"], "==": ["!="], "!=": ["=="], "and": ["or"], "or": ["and"],
    "is": ["is not"], "is not": ["is"], "in": ["not in"], "not in": ["in"], "not": [""],
    "any": ["all"], "all": ["any"], "True": ["False"], "False": ["True"],
}  # fmt: skip
FORTRAN = _SHARED | {
    "**": ["*"], "==": ["/="], "/=": ["=="], ".and.": [".or."], ".or.": [".and."], ".not.": [""],
    "any": ["all"], "all": ["any"], ".true.": [".false."], ".false.": [".true."],
}  # fmt: skip
C = _SHARED | {"==": ["!="], "!=": ["=="], "&&": ["||"], "||": ["&&"], "!": [""]}

_OPERATOR = re.compile(r"is not|not in|\*\*|//|[=!<>]=|\b(?:is|in|and|or)\b|[-+*/%<>]")
_NUMBER = r"(?<![\w.])(?:\d+\.\d*|\d+)(?:[ed][+-]?\d+)?(?:_wp)?(?![\w.])"
_TOKENS = {
    ".f90": r"\(\*\)|\*\*|//|==|/=|<=|>=|=>|\(/|/\)|\.(?:and|or|not|true|false)\."
    r"|\b(?:min|max|any|all)(?=\()|[-+*/<>]|",
    ".c": r"\+\+|--|->|&&|\|\||==|!=|<=|>=|<<|>>|[-+*/]=|[-+*/<>!]|",
}
# Lines without code to be changed: imports, declarations without values, ends.
_IDLE = {
    ".f90": re.compile(
        r"\s*(?:use|implicit|import|private|public|contains|end|module|interface|procedure)\b"
        r"|\s*(?:pure |elemental |impure |recursive )*(?:subroutine|function)\b|.*\bintent\("
        r"|[^=(]*(?:\([^)]*\))?[^=]*::[^=]*$"
    ),
    ".c": re.compile(r"\s*#|\s*(?:static |const |extern )*(?:struct|int|char|void|long)\b[^=]*$"),
}
_TEXT = {
    ".f90": re.compile(r"'[^']*'|\"[^\"]*\"|!.*"),
    ".c": re.compile(r"\"(?:\\.|[^\"\\])*\"|'(?:\\.|[^'\\])*'|//.*|/\*.*?\*/"),
}


class Change(NamedTuple):
    """A change of a source.

    Attributes
    ----------
    path : str
        The source, relative to the root of the project.
    first, last : int
        Lines of the statement, from 1.
    begin, end : int
        Characters of the text that are replaced.
    new : str
        What replaces them.
    """

    path: str
    first: int
    last: int
    begin: int
    end: int
    new: str

    def apply(self, text: str) -> str:
        """Return the changed source."""
        return text[: self.begin] + self.new + text[self.end :]


def changes(path: Path, name: str) -> list[Change]:
    """Return all changes of a source that is known by a name."""
    text = path.read_text()
    found = _Source(text).changes() if path.suffix == ".py" else _text(text, path.suffix)
    return [Change(name, *one) for one in found]


def is_valid(path: Path, change: Change) -> bool:
    """Return whether a changed Python source can be read; of others their compiler decides."""
    try:
        return path.suffix != ".py" or bool(ast.parse(change.apply(path.read_text())))
    except SyntaxError:
        return False


def _other_number(number: str) -> str:
    """Return the next whole number, or the double of a real one."""
    value = number.removesuffix("_wp")
    if value.isdecimal():
        return f"{int(value) + 1}{number[len(value) :]}"
    return f"{2 * float(value.replace('d', 'e')) or 1.0!r}{number[len(value) :]}"


class _Source:
    """A Python source, whose changes its syntax tree shows."""

    def __init__(self, text: str) -> None:
        self._text = text
        self._data = text.encode()
        self._starts = [0]
        for line in self._data.splitlines(keepends=True):
            self._starts.append(self._starts[-1] + len(line))

    def changes(self) -> Iterator[tuple[int, int, int, int, str]]:
        """Yield statement, place and new text of each change."""
        for statement in ast.parse(self._text).body:
            yield from self._visit(statement, (1, 1))

    def _visit(
        self, node: ast.AST, lines: tuple[int, int]
    ) -> Iterator[tuple[int, int, int, int, str]]:
        """Yield the changes of a node and of those below it, but of texts, types and imports."""
        if isinstance(node, ast.JoinedStr | ast.Import | ast.ImportFrom):
            return
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.dump(node.test):
            return
        if isinstance(node, ast.stmt):
            last = node.end_lineno or node.lineno
            if body := getattr(node, "body", None):
                last = max(node.lineno, body[0].lineno - 1)
            lines = node.lineno, last
        for change in self._of_node(node):
            yield *lines, *change
        for field, value in ast.iter_fields(node):
            if field not in {"annotation", "returns", "decorator_list"}:
                for child in value if isinstance(value, list) else [value]:
                    # Whether lengths are checked changes nothing where they agree.
                    if isinstance(child, ast.AST) and getattr(child, "arg", "") != "strict":
                        yield from self._visit(child, lines)

    def _of_node(self, node: ast.AST) -> Iterator[tuple[int, int, str]]:
        match node:
            case ast.BinOp():
                yield from self._operators([node.left, node.right])
                if isinstance(node.op, ast.Add | ast.Sub):
                    yield from self._dropped(node)
            case ast.Compare():
                yield from self._operators([node.left, *node.comparators])
            case ast.BoolOp():
                yield from self._operators(node.values)
            case ast.UnaryOp(op=ast.Not() | ast.USub()):
                begin, end = self._span(node)[0], self._span(node.operand)[0]
                yield begin, begin + len(self._text[begin:end].rstrip("( \n")), ""
            case ast.Constant(value=bool()):
                yield *self._span(node), str(not node.value)
            case ast.Constant(value=int() | float()):
                begin, end = self._span(node)
                number = self._text[begin:end].replace("_", "")
                if re.fullmatch(_NUMBER, number):
                    yield begin, end, _other_number(number)
            case ast.Call(func=ast.Name(id="min" | "max" | "any" | "all" as name)):
                yield *self._span(node.func), PYTHON[name][0]

    def _operators(self, operands: list[ast.expr]) -> Iterator[tuple[int, int, str]]:
        """Yield the changes of the operators between operands."""
        for before, after in itertools.pairwise(operands):
            begin, end = self._span(before)[1], self._span(after)[0]
            if found := _OPERATOR.search(self._text, begin, end):
                yield from ((*found.span(), new) for new in PYTHON.get(found[0], []))

    def _dropped(self, node: ast.BinOp) -> Iterator[tuple[int, int, str]]:
        """Yield the change that drops the second term, where no bracket would be left behind."""
        begin = self._span(node.left)[1]
        if not re.search(r"[()]", self._text[begin : self._span(node.right)[0]]):
            yield begin, self._span(node)[1], ""

    def _span(self, node: ast.AST) -> tuple[int, int]:
        """Return where the text of a node begins and ends."""
        first = self._at(node.lineno, node.col_offset)  # type: ignore[attr-defined]
        return first, self._at(node.end_lineno, node.end_col_offset)  # type: ignore[attr-defined]

    def _at(self, line: int, column: int) -> int:
        return len(self._data[: self._starts[line - 1] + column].decode())


def _text(text: str, suffix: str) -> Iterator[tuple[int, int, int, int, str]]:
    """Yield the changes of Fortran or C, found in the lines without their texts and comments."""
    tokens = re.compile(_TOKENS[suffix] + _NUMBER, re.IGNORECASE)
    table = FORTRAN if suffix == ".f90" else C
    offset, first = 0, 1
    lines = text.splitlines(keepends=True)
    for number, line in enumerate(lines, 1):
        code = _TEXT[suffix].sub(lambda found: "\0" * len(found[0]), line)
        goes_on = number > 1 and lines[number - 2].rstrip().endswith("&")
        first = first if goes_on else number
        begin = code.index("::") + 2 if suffix == ".f90" and "::" in code else 0
        idle = _IDLE[suffix].match(code) or (goes_on and _IDLE[suffix].match(lines[first - 1]))
        for token in () if idle else tokens.finditer(code, begin):
            place = offset + token.start(), offset + token.end()
            word = token[0].lower()
            news = [_other_number(word)] if word[0].isdigit() else table.get(word, [])
            binary = re.search(r"[\w)\]]\s*$", code[: token.start()])
            if word == "-" and not binary:
                news = [""]
            elif word in {"+", "-"} and (term := _term(code, token.end())):
                yield first, number, place[0], offset + term, ""
            yield from ((first, number, *place, new) for new in news)
        offset += len(line)


def _term(code: str, begin: int) -> int:
    """Return where a term ends that a sign begins, or 0 where that is not on this line."""
    depth = 0
    for place in range(begin, len(code)):
        one = code[place]
        depth += (one in "([") - (one in ")]")
        operator = one in "+-" and code[begin:place].strip() and code[place - 1] not in "ed*/("
        if depth < 0 or (depth == 0 and (one in ",;\n<>=&" or operator)):
            return 0 if one == "&" else begin + len(code[begin:place].rstrip())
    return 0
