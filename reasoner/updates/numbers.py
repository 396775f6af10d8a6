"""Compilation of the numbers in an update: variables that denote amounts, calculations, and comparisons."""

from __future__ import annotations

from collections.abc import Collection
from contextlib import suppress
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, TypeAlias

from confab.reasoner.amounts import written
from confab.reasoner.condition_nodes import Properties, argument_properties
from confab.reasoner.updates.nodes import Nodes
from confab.reasoner.updates.scope import VariableScope, middle_of
from confab.reasoner.updates.words import NumberLiteral, Said, Triple, UpdateError, Word, term

ARITHMETIC = ("AdditiveExpression", "MultiplicativeExpression", "UnaryMinus")


@dataclass(frozen=True)
class NumberPattern:
    """An amount with its arguments, or a static relation that assigns a number to its arguments."""

    kind: str
    of: str
    terms: tuple[str, ...]

    @property
    def properties(self) -> Properties:
        """The properties of a node that refers to the amount or relation."""
        return {self.kind: [self.of], **argument_properties(self.terms)}


@dataclass(frozen=True)
class Sum:
    """The arithmetic operation `sign` on two numbers."""

    sign: str
    left: Side
    right: Side


Side: TypeAlias = "NumberPattern | Sum | NumberLiteral"


@dataclass(frozen=True)
class Numbers:
    """Compiler of the numeric expressions of one behaviour or rule."""

    nodes: Nodes
    scope: VariableScope

    def is_number(self, tree: Any) -> bool:
        """Return whether an expression denotes a number."""
        one = unwrapped(tree)
        if isinstance(one, Word):
            return one in self.scope.numbers
        return getattr(one, "name", "") in ARITHMETIC or isinstance(_term_or_none(one), NumberLiteral)

    def expression(self, tree: Any, known: Collection[str], at: int) -> Side:
        """Return the compiled form of a numeric expression, with amounts substituted for the variables that denote amounts."""
        one = unwrapped(tree)
        if isinstance(one, NumberLiteral):
            return one
        if isinstance(one, Word) and one in self.scope.numbers and one in known:
            said = self.scope.numbers[one]
            return self.measured(said, known) if isinstance(said, Triple) else self.expression(said, known, at)
        name = getattr(one, "name", "")
        if name == "UnaryMinus":
            found = self.expression(one.expr, known, at)
            if isinstance(found, NumberLiteral):
                return NumberLiteral(-found.value)
            return Sum("-", NumberLiteral(Fraction(0)), found)
        if name in ARITHMETIC:
            found = self.expression(one.expr, known, at)
            for sign, other in zip(one.op, one.other, strict=True):
                found = Sum(str(sign), found, self.expression(other, known, at))
            return found
        number = _term_or_none(one)
        if isinstance(number, NumberLiteral):
            return number
        what = f"{one} is no number" if isinstance(one, Word) else "this is no number"
        raise UpdateError(what, "compare and calculate with numbers, and with variables that amounts give one", at)

    def measured(self, one: Triple, known: Collection[str]) -> NumberPattern:
        """Return the amount or relation that a triple names, with the arguments: the triple's subject, and possibly others."""
        prop, at = self.scope.iri(one.predicate), one.predicate.at
        terms = [self.scope.put(each, known, at) for each in (one.subject, *middle_of(one))]
        kind = "relation" if prop in self.scope.vocabulary.measures else "situationType"
        return NumberPattern(kind, self.scope.vocabulary.properties.get(prop, prop), tuple(terms))

    def comparison(self, left: Side, sign: str, right: Side, negated: bool, at: int) -> str:
        """Return the node of a comparison of two numeric expressions."""
        node = self.nodes.condition("Comparison", at, {"sign": [sign]}, negated)
        self.side(node, "left", left, at)
        self.side(node, "right", right, at)
        return node

    def side(self, node: str, name: str, side: Side, at: int) -> None:
        """Add an operand to a node.

        An amount on the left and a number on the right become properties of the node; other operands become separate nodes.
        """
        if name == "left" and isinstance(side, NumberPattern):
            self.nodes.said[node] |= side.properties
            return
        if name == "right" and isinstance(side, NumberLiteral):
            self.nodes.said[node]["amount"] = [written(side.value)]
            return
        inner = self.nodes.new("amount", "Calculation", at)
        self.nodes.said[node][name] = [inner]
        match side:
            case NumberPattern():
                self.nodes.said[inner] |= side.properties
            case NumberLiteral(value):
                self.nodes.said[inner]["amount"] = [written(value)]
            case Sum(sign, left, right):
                self.nodes.said[inner]["sign"] = [sign]
                self.side(inner, "left", left, at)
                self.side(inner, "right", right, at)


def _term_or_none(tree: Any) -> Said | None:
    """Return a term of the grammar; return None for an expression that isn't a term."""
    with suppress(UpdateError):
        return term(tree, 0)
    return None


def unwrapped(expression: Any) -> Any:
    """Return an expression of the syntax tree without the nested levels that have only one operand."""
    passing = ("ConditionalOrExpression", "ConditionalAndExpression", "RelationalExpression", "AdditiveExpression")
    while getattr(expression, "name", "") in (*passing, "MultiplicativeExpression") and not expression.other:
        expression = expression.expr
    return expression
