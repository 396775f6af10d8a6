"""Removal of unnecessary variables from schemas: variables that no effect names.

For example, a move that requires some free crane becomes one operator instead of one operator for each crane. The conditions on the
removed variable become an auxiliary rule over the other terms of these conditions. Each join then has the rows of one part instead
of all pairs of rows of both parts.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

from confab.planner.grounded.schemas import Schema, TablePattern
from confab.reasoner.amounts import terms_of
from confab.reasoner.language import is_variable, mentions, walk
from confab.reasoner.symbols import TRUE, Comparison, Condition, SituationType, ValueEffect

Members = Callable[[str], frozenset[str]]


def in_parts(schema: Schema, members: Members) -> tuple[list[Schema], dict[str, SituationType]]:
    """Return a schema without the variables that only conditions use.

    Also return auxiliary rules for these conditions, and the situation types that the rules define.

    A variable is removed only if the removal saves rows.

    Parameters
    ----------
    schema : Schema
        The schema of a behaviour without conditional effects.
    members : function of a class to its individuals
    """
    named = {parameter.name for parameter in schema.behavior.parameters}
    named |= {t for _, effect in schema.effects for t in (*effect.arguments, effect.value)}
    named |= {t for _, effect in schema.amounts for t in (*effect.arguments, *terms_of(effect.amount))}
    named |= set(terms_of(schema.behavior.price)) if schema.behavior.price is not None else set()
    rules: list[Schema] = []
    made: dict[str, SituationType] = {}
    while found := _separable(schema, named, members):
        _, variable, beside, left = found
        name = f"{schema.behavior.name}/{len(made)}"
        made[name] = SituationType(name, tuple(schema.kinds[term] for term in beside), "Truth", boolean=True)
        effect = ValueEffect(name, beside, TRUE)
        own, rest = (
            replace(
                schema,
                atoms=tuple(atom for atom in schema.atoms if (variable in atom.terms) is inside),
                filters=tuple(c for c in schema.filters if (variable in mentions(c)) is inside),
                residue=tuple(c for c in schema.residue if (variable in mentions(c)) is inside),
            )
            for inside in (True, False)
        )
        rules.append(
            replace(
                own,
                behavior=replace(schema.behavior, name=name, preconditions=(), effects=(effect,), amounts=()),
                terms=(*beside, variable),
                atoms=(*own.atoms, *(TablePattern(("class", schema.kinds[term]), (term,)) for term in beside)),
                effects=((0, effect),),
                amounts=(),
                rule=True,
            )
        )
        schema = replace(rest, terms=left, atoms=(TablePattern(("situation", name), beside, True), *rest.atoms))
    return [schema, *rules], made


def _separable(
    schema: Schema, named: set[str], members: Members
) -> tuple[int, str, tuple[str, ...], tuple[str, ...]] | None:
    """Return the variable whose removal leaves the fewest rows.

    The result contains the number of rows, the variable, the terms that occur with the variable in conditions, and the remaining
    terms of the schema. Return None if no removal saves rows.
    """
    every = {term for atom in schema.atoms for term in atom.terms if is_variable(term)}

    def rows(names: Sequence[str]) -> int:
        return math.prod(len(members(schema.kinds[name])) for name in names)

    found = []
    for variable in sorted({*schema.terms} - named):
        own = [part for part in (*schema.atoms, *schema.filters, *schema.residue) if variable in _names(part)]
        beside = tuple(sorted(set().union(*map(_names, own)) & every - {variable}))
        left = tuple(dict.fromkeys(term for term in (*schema.terms, *beside) if term != variable))
        changing = any(part.fluent if isinstance(part, TablePattern) else part in schema.residue for part in own)
        compares = any(
            isinstance(c, Comparison) for part in own if not isinstance(part, TablePattern) for c in walk(part)
        )
        fewer = rows(left) + rows((*beside, variable))
        if changing and not compares and fewer < rows(schema.terms):
            found.append((fewer, variable, beside, left))
    return min(found, default=None)


def _names(part: TablePattern | Condition) -> set[str]:
    return {*part.terms} if isinstance(part, TablePattern) else set(mentions(part))
