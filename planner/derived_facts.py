"""Defined situations in generated Python code: a defined situation is derived when its value is read from a table."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from confab.planner.generated import identifier, written
from confab.planner.transitions import Cell, Key, PythonWriter, Table, arguments_of
from confab.reasoner.derivation import strata
from confab.reasoner.limits import check
from confab.reasoner.symbols import FALSE, TRUE


class CompiledRules:
    """The rules of a problem as Python, compiled once for all tables."""

    def __init__(self, writer: PythonWriter) -> None:
        self.domain = writer.problem.domain
        self._bind = writer.function(["rules = {}", *_lines(writer)], "rules")

    def define(self, table: Table) -> None:
        """Make a table derive its defined situations, before any compiled function is bound to the table."""
        for group in strata(self.domain.rules):
            stratum = Stratum(table)
            for name in group:
                table.now[name] = DerivedCells(name, len(self.domain.situations[name].arguments), stratum)
        tests = self._bind(table.now, table.holders)
        for name in self.domain.rules:
            cells = table.now[name]
            assert isinstance(cells, DerivedCells)
            cells.stratum.tests[name] = tests[name]


def _lines(writer: PythonWriter) -> Iterator[str]:
    """Yield the lines that define a function for each defined situation type in `rules`."""
    for name, rules in writer.problem.domain.rules.items():
        arguments = [f"a{i}" for i in range(len(writer.problem.domain.situations[name].arguments))]
        yield f"def {identifier('rule', name)}({', '.join(arguments)}):"
        for rule in rules:
            kinds, bound = rule.behavior.kinds, {p.name for p in rule.parameters}
            put = ", ".join(written(p.name) for p in rule.parameters)
            tests = [writer.member(p.name, p.kind) for p in rule.parameters]
            tests += writer.conjunction(rule.conditions, bound, kinds, name)
            yield f"    {put}, = {', '.join(arguments)},"
            yield f"    if {' and '.join(f'({test})' for test in tests)}: return True"
        yield "    return False"
        yield f"rules[{name!r}] = {identifier('rule', name)}"


class DerivedCells(dict[Key, str]):
    """A mapping from the symbols of a defined situation type: the mapping stores no values, and `get` derives each value."""

    def __init__(self, name: str, arity: int, stratum: Stratum) -> None:
        super().__init__()
        self.name, self.alone, self.stratum = name, arity == 1, stratum

    def get(self, key: Key, default: str | None = None) -> str:  # type: ignore[override]
        """Return whether the situation holds for the arguments of a key; a key of another length has no value."""
        if isinstance(key, str) is not self.alone:
            return default  # type: ignore[return-value]
        return TRUE if self.stratum.holds((self.name, key)) else FALSE


class Stratum:
    """Mutually dependent defined situation types, with the truth values known since the last change of the table.

    The requested situations, and all situations that their rules read, are evaluated in rounds until no more become
    true; the remaining situations are false. Other situations aren't evaluated, and the interpreter's stack doesn't
    limit the depth of a derivation.
    """

    def __init__(self, table: Table) -> None:
        self.table, self.age = table, -1
        self.tests: dict[str, Callable[..., bool]] = {}
        self.known: dict[Cell, bool] = {}
        self.asked: dict[Cell, None] | None = None  # the symbols read during a derivation, with the results

    def holds(self, cell: Cell) -> bool:
        """Return whether a symbol is true; during another derivation, return the preliminary value."""
        if self.age != self.table.age:
            self.age = self.table.age
            self.known.clear()
        found = self.known.get(cell)
        if found is not None:
            return found
        if self.asked is not None:
            self.asked[cell] = None
            return False
        self.asked = {cell: None}
        try:
            found = self._worked_out(cell, self.asked)
            if not found:
                for other in self.asked:
                    self.known.setdefault(other, False)
        finally:
            self.asked = None
        return found

    def _worked_out(self, cell: Cell, asked: dict[Cell, None]) -> bool:
        order, done, known = [cell], 0, self.known
        while True:
            grown = False
            while done < len(order):  # the symbols that were read for the first time
                grown |= self._try(order[done])
                done += 1
                if len(asked) > len(order):
                    order += list(asked)[len(order) :]
            if cell in known:
                return True
            for other in reversed(order):  # other symbols depend on the symbols that were read last
                if other not in known:
                    grown |= self._try(other)
            if cell in known or not (grown or len(asked) > len(order)):
                return cell in known
            order += list(asked)[len(order) :]

    def _try(self, cell: Cell) -> bool:
        check("deriving facts from rules")
        found = self.tests[cell[0]](*arguments_of(cell[1]))
        if found:
            self.known[cell] = True
        return found
