"""Tokenizer of PDDL: a text as nested lists of words with their positions."""

from __future__ import annotations

import re
from dataclasses import dataclass

from confab.reasoner.limits import checked

MOST_BYTES = 32 * 2**20
TOKEN = re.compile(r"[()]|-(?=[A-Za-z])|[^\s();?]+|\?[^\s();?]*|;[^\n]*|\s+")
"""Pattern of a token. A variable begins at its ``?``, as in ``(aircraft?a)``. A type begins at its name, as in ``(?b -boat)``."""

NUMBER = re.compile(r"[+-]?([0-9]{1,30}\.?[0-9]{0,30}|\.[0-9]{1,30})(e[+-]?[0-9]{1,2})?")


@dataclass(frozen=True)
class PddlWord:
    """A name or number in lower case, with its line and column."""

    text: str
    line: int
    column: int


@dataclass(frozen=True)
class Form:
    """A list in parentheses, with its line and column."""

    items: tuple[PddlWord | Form, ...]
    line: int
    column: int

    @property
    def head(self) -> str:
        """The first item of the list if the item is a word, otherwise an empty text."""
        return self.items[0].text if self.items and isinstance(self.items[0], PddlWord) else ""


class PddlError(ValueError):
    """Raised for PDDL that can't be used; the message states file, line and column, the error, and the expected text."""


def form_of(text: str, file: str) -> Form:
    """Parse a PDDL text, which must consist of a single list, and return this list."""
    stack: list[tuple[list[PddlWord | Form], int, int]] = []
    line, start = 1, 0
    done: Form | None = None
    for match in checked(TOKEN.finditer(text), f"reading {file}"):
        token, column = match.group(), match.start() - start + 1
        if token == "(":
            if done is not None:
                raise PddlError(f"{file}:{line}:{column}: text behind the last ')'")
            stack.append(([], line, column))
        elif token == ")":
            if not stack:
                raise PddlError(f"{file}:{line}:{column}: ')' without '('")
            items, row, col = stack.pop()
            form = Form(tuple(items), row, col)
            if stack:
                stack[-1][0].append(form)
            else:
                done = form
        elif token[0] == ";" or token.isspace():
            newlines = token.count("\n")
            if newlines:
                line += newlines
                start = match.start() + token.rindex("\n") + 1
        elif not stack:
            raise PddlError(f"{file}:{line}:{column}: wanted '(define …', got '{token[:40]}'")
        else:
            stack[-1][0].append(PddlWord(token.lower(), line, column))
    if stack:
        _, row, col = stack[-1]
        raise PddlError(f"{file}:{row}:{col}: this '(' is never closed")
    if done is None:
        raise PddlError(f"{file}:1:1: wanted '(define …', the file is empty")
    return done


def is_number(item: PddlWord | Form) -> bool:
    """Return whether an item is a number."""
    return isinstance(item, PddlWord) and NUMBER.fullmatch(item.text) is not None
