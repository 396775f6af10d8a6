"""Names of terms, keys and functions in generated Python code, and compilation of this code."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from functools import lru_cache
from types import CodeType

from confab.reasoner.limits import check

COMPILING = 4e-7
"""Seconds of compilation per character of Python source; a compilation can't be interrupted."""


def identifier(prefix: str, name: str) -> str:
    """Return an ASCII identifier for a term; distinct terms have distinct identifiers.

    Identifiers are ASCII because Python treats some different Unicode letters, for example µ and μ, as equal.
    """
    clean = re.sub(r"[^A-Za-z0-9]", lambda m: "__" if m[0] == "_" else f"_{ord(m[0]):x}_", name)
    return f"{prefix}_{clean}"


def written(term: str) -> str:
    """Return a term as a Python expression."""
    return identifier("v", term[1:]) if term.startswith("?") else repr(term)


def tuple_written(items: Iterable[str]) -> str:
    """Return the Python expression of a tuple with the given elements."""
    return "(" + "".join(f"{item}, " for item in items) + ")"


def key_written(arguments: Sequence[str]) -> str:
    """Return the Python expression of the table key for the arguments of a symbol."""
    return written(arguments[0]) if len(arguments) == 1 else tuple_written(map(written, arguments))


MOST_LOOPS = 15
"""Maximum number of nested loops in one function; Python nests at most 20 loops."""


class GeneratorFunction:
    """Lines of Python code that define a generator function; each opened line indents the lines that follow.

    After `MOST_LOOPS` nested loops, the function calls another function, which has the lines that follow.
    """

    def __init__(self, name: str, parameters: Iterable[str] = ()) -> None:
        self.lines: list[str] = []
        self._begin(name, parameters)

    def _begin(self, name: str, parameters: Iterable[str]) -> None:
        self._name, self._depth, self._loops = name, 0, 0
        self.open(f"def {name}({', '.join(parameters)}):")

    def add(self, line: str) -> None:
        """Add a line."""
        self.lines.append("    " * self._depth + line)

    def open(self, line: str) -> None:
        """Add a line, and indent the lines that follow."""
        self.add(line)
        self._depth += 1

    def loop(self, line: str, names: Sequence[str]) -> None:
        """Open a loop; `names` are the names that the lines in the loop may use."""
        if self._loops == MOST_LOOPS:
            further = f"{self._name}_more"
            self.add(f"yield from {further}({', '.join(names)})")
            self._begin(further, names)
        self.open(line)
        self._loops += 1


@lru_cache(maxsize=256)
def code(source: str) -> CodeType:
    """Return the compiled code of Python source; raise `OutOfTimeError` if too little time is left for the compilation."""
    check("compiling conditions", COMPILING * len(source))
    return compile(source, "<compiled behaviours>", "exec")
