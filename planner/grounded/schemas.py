"""Behaviours prepared for joins: each behaviour becomes a schema with atoms, filters and a residue.

An atom is a condition that the rows of a table match: a positive value condition, a positive relation condition, or a class
condition. A filter is a condition that static facts decide. The residue contains all other conditions, such as negated values,
disjunctions and negated quantifiers.

A positive `Witness` becomes a variable of the schema. A variable that no atom binds is local to its condition.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import count

from confab.reasoner.amounts import put_in, situations_in, terms_of
from confab.reasoner.effects import allowed
from confab.reasoner.language import DomainError, is_variable, mentions, plain_variables, substituted, terms, walk
from confab.reasoner.symbols import (
    FALSE,
    TRUE,
    AmountEffect,
    AnyOf,
    Behavior,
    ClassCondition,
    Comparison,
    Condition,
    Parameter,
    RelationCondition,
    SituationType,
    ValueCondition,
    ValueEffect,
    Witness,
)


@dataclass(frozen=True)
class TablePattern:
    """A condition that the rows of a table match; the table belongs to a situation type, a relation or a class.

    For a situation type that isn't boolean, `terms` are the arguments and the value.
    """

    table: tuple[str, str]
    terms: tuple[str, ...]
    fluent: bool = False


@dataclass(frozen=True)
class Schema:
    """A behaviour, or a conditional effect of a behaviour, in the form of a join.

    `terms` identify an operator; the join drops other variables. The terms of a conditional effect begin with the terms of its
    behaviour. `effects` and `amounts` contain pairs of a position and an effect, in order of execution.
    """

    behavior: Behavior
    terms: tuple[str, ...]
    atoms: tuple[TablePattern, ...]
    filters: tuple[Condition, ...]
    residue: tuple[Condition, ...]
    kinds: Mapping[str, str]
    effects: tuple[tuple[int, ValueEffect], ...]
    conditional: bool = False
    amounts: tuple[tuple[int, AmountEffect], ...] = ()
    rule: bool = False


def rules_apart(rules: Sequence[Behavior], changed: frozenset[str]) -> tuple[list[Behavior], dict[str, SituationType]]:
    """Return rules in which each witness has a separate auxiliary rule, and the auxiliary situation types.

    A single join of "there is a full cup and there is a free shelf" would yield all pairs of a cup and a shelf. Therefore a witness
    becomes an auxiliary situation type over the terms that the witness shares with other conditions. In a rule without other
    changing conditions, the conditions of the witness replace the witness.
    """
    found: list[Behavior] = []
    made: dict[str, SituationType] = {}
    waiting = list(rules)
    for rule in waiting:  # the loop appends rules to the list
        conditions: list[Condition] = []
        parameters, variables = list(rule.parameters), list(rule.variables)
        left = list(rule.preconditions)
        while left:
            condition = left.pop(0)
            if not isinstance(condition, Witness) or condition.negated:
                conditions.append(condition)
                continue
            name = f"?{len(made)}/{len(parameters)}{condition.variable[1:]}"
            own = (ClassCondition(name, condition.kind), *substituted(condition, {}).conditions)  # type: ignore[union-attr]
            own = tuple(substituted(c, {condition.variable: name}) for c in own)
            outside = {p.name for p in parameters} | plain_variables(conditions + left)
            kinds = {t.name: t.kind for t in (*parameters, *variables)}
            if not any(_changing(c, changed) for c in conditions + left):
                parameters.append(Parameter(name, condition.kind))
                left = [*own, *left]
                continue
            shared = sorted(set().union(*map(mentions, own)) & outside - {name})
            aux = f"{rule.effects[0].situation}/{len(made)}"
            made[aux] = SituationType(aux, tuple(kinds[term] for term in shared), "Truth", boolean=True)
            terms_ = (*(Parameter(term, kinds[term]) for term in shared), Parameter(name, condition.kind))
            rest = tuple(v for v in (*parameters, *variables) if v.name not in shared)
            waiting.append(replace(rule, name=aux, parameters=terms_, variables=rest, preconditions=own,
                                   effects=(ValueEffect(aux, tuple(shared), TRUE),)))  # fmt: skip
            conditions.append(ValueCondition(aux, tuple(shared), TRUE))
        found.append(replace(rule, parameters=tuple(parameters), preconditions=tuple(conditions)))
    return found, made


def _changing(condition: Condition, changed: frozenset[str]) -> bool:
    for c in walk(condition):
        if isinstance(c, ValueCondition) and c.situation in changed:
            return True
        if isinstance(c, Comparison) and (situations_in(c.left) | situations_in(c.right)) & changed:
            return True
    return False


def schemas(
    behavior: Behavior,
    situations: Mapping[str, SituationType],
    changed: frozenset[str],
    members: Callable[[str], frozenset[str]],
) -> list[Schema]:
    """Return the schema of a behaviour, followed by a schema for each conditional effect of the behaviour.

    Parameters
    ----------
    behavior : Behavior
    situations : mapping of name to SituationType
    changed : set of situation types
        The situation types that some behaviour of the level changes; all others are static on the level.
    members : function of a class to its individuals

    Raises
    ------
    DomainError
        No condition determines a variable that an effect or a negated condition names.
    """
    kinds = dict(behavior.kinds)
    parameters = tuple(parameter.name for parameter in behavior.parameters)
    preconditions = (*behavior.preconditions, *allowed(behavior, situations))
    effects, amounts = list(enumerate(behavior.effects)), list(enumerate(behavior.amounts))
    compile_ = _Compiler(situations, changed, members, kinds)
    base = compile_.schema(
        behavior,
        parameters,
        preconditions,
        tuple(e for e in effects if not e[1].when),
        amounts=tuple(a for a in amounts if not a[1].when),
    )
    found = [base]
    both: list[tuple[int, ValueEffect | AmountEffect]] = [*effects, *amounts]
    for position, effect in both:
        if effect.when:
            own = set().union(*map(mentions, effect.when)) - set(base.terms)
            names = {name: f"?*{name[1:]}" for name in own}  # unlike the names of variables in preconditions
            compile_.kinds |= {names[name]: kinds[name] for name in sorted(own)}
            conditions = (*preconditions, *(substituted(c, names) for c in effect.when))
            arguments = tuple(names.get(a, a) for a in effect.arguments)
            if isinstance(effect, AmountEffect):
                change = replace(effect, arguments=arguments, amount=put_in(effect.amount, names))
                found.append(compile_.schema(behavior, base.terms, conditions, (), True, ((position, change),)))
            else:
                renamed = replace(effect, arguments=arguments, value=names.get(effect.value, effect.value))
                found.append(compile_.schema(behavior, base.terms, conditions, ((position, renamed),), True))
    return found


@dataclass
class _Compiler:
    situations: Mapping[str, SituationType]
    changed: frozenset[str]
    members: Callable[[str], frozenset[str]]
    kinds: dict[str, str]

    def schema(
        self,
        behavior: Behavior,
        first: tuple[str, ...],
        conditions: Sequence[Condition],
        effects: tuple[tuple[int, ValueEffect], ...],
        conditional: bool = False,
        amounts: tuple[tuple[int, AmountEffect], ...] = (),
    ) -> Schema:
        kinds, fresh = dict(self.kinds), count()
        plain = [c for c in conditions if not isinstance(c, Witness | AnyOf)]
        shared = {*first, *(p.name for p in behavior.parameters), *(t for c in plain for t in terms(c))}
        parts = list(dict.fromkeys(self._flat(conditions, shared, kinds, fresh)))
        atoms = [atom for part in parts for atom in self._atom(part)]
        others = [part for part in parts if not list(self._atom(part))]
        parameters = [parameter.name for parameter in behavior.parameters]
        bound = dict.fromkeys([*first, *parameters, *(t for atom in atoms for t in atom.terms if is_variable(t))])
        atoms += [TablePattern(("class", kinds[name]), (name,)) for name in bound]
        filters = [part for part in others if not self._fluent(part)]
        residue = [part for part in others if self._fluent(part)]
        for part in others:
            for name in filter(is_variable, terms(part)):
                if name not in bound:
                    raise DomainError(f"{behavior.name}: nothing determines {name}; add a value condition that does")
        named_by = [(*effect.arguments, effect.value) for _, effect in effects]
        named_by += [(*effect.arguments, *terms_of(effect.amount)) for _, effect in amounts]
        for names in named_by:
            for name in names:
                if is_variable(name) and name not in bound:
                    raise DomainError(f"{behavior.name}: nothing determines {name}, which an effect names")
        used = {t for atom in atoms if atom.fluent for t in atom.terms}
        used |= {t for part in residue for c in walk(part) for t in terms(c) if is_variable(t)}
        used |= {t for names in named_by for t in names}
        declared = {*self.kinds}
        named = [*first, *(name for name in bound if name not in first and (name in used or name in declared))]
        return Schema(
            behavior, tuple(named), tuple(atoms), tuple(filters), tuple(residue), kinds, effects, conditional, amounts
        )

    def _flat(
        self, conditions: Sequence[Condition], shared: set[str], kinds: dict[str, str], fresh: Iterator[int]
    ) -> Iterator[Condition]:
        """Yield conjuncts with the conditions of positive witnesses in their place; variables outside `shared` get unique names."""
        for condition in conditions:
            if isinstance(condition, Witness) and not condition.negated:
                yield from self._opened(
                    condition.conditions, {condition.variable: condition.kind}, shared, kinds, fresh
                )
            elif isinstance(condition, AnyOf) and not condition.negated and len(condition.alternatives) == 1:
                yield from self._opened(condition.alternatives[0], {}, shared, kinds, fresh)
            elif isinstance(condition, ValueCondition):
                yield from self._plain(condition, kinds)
            else:
                yield condition

    def _opened(
        self,
        group: Sequence[Condition],
        witness: Mapping[str, str],
        shared: set[str],
        kinds: dict[str, str],
        fresh: Iterator[int],
    ) -> Iterator[Condition]:
        """Yield the conjuncts of a group of conditions, with unique names for variables that only the group uses."""
        own = {name: kinds[name] for name in sorted(plain_variables(group) - shared - witness.keys())} | {**witness}
        names = {name: f"?{next(fresh)}{name[1:]}" for name in own}
        kinds |= {names[name]: kind for name, kind in own.items()}
        yield from (ClassCondition(names[name], kind) for name, kind in own.items())
        yield from self._flat([substituted(c, names) for c in group], shared | set(names.values()), kinds, fresh)

    def _plain(self, condition: ValueCondition, kinds: Mapping[str, str]) -> Iterator[Condition]:
        """Yield conditions that are equivalent to a value condition and mention only the value true of boolean symbols.

        If a boolean symbol must be false, the conditions also require that the symbol exists.
        """
        situation = self.situations[condition.situation]
        if not situation.boolean or condition.value == TRUE:
            yield condition
            return
        if condition.value != FALSE:
            raise DomainError(f"{condition.situation} is true or false; {condition.value} can't be its value")
        true = replace(condition, value=TRUE, negated=False)
        doubtful = [
            ClassCondition(term, kind)
            for term, kind in zip(condition.arguments, situation.arguments, strict=True)
            if not (self.members(kinds[term]) if term in kinds else frozenset((term,))) <= self.members(kind)
        ]
        if not condition.negated:
            yield replace(true, negated=True)
            yield from doubtful
        elif doubtful:
            yield AnyOf(((true,), *((replace(c, negated=True),) for c in doubtful)))
        else:
            yield true

    def _atom(self, condition: Condition) -> Iterator[TablePattern]:
        match condition:
            case ValueCondition(situation, arguments, value, False):
                row = arguments if self.situations[situation].boolean else (*arguments, value)
                yield TablePattern(("situation", situation), row, situation in self.changed)
            case RelationCondition(relation, arguments, False):
                yield TablePattern(("relation", relation), arguments)
            case ClassCondition(term, kind, False):
                yield TablePattern(("class", kind), (term,))
            case _:  # other conditions are evaluated row by row
                pass

    def _fluent(self, condition: Condition) -> bool:
        return _changing(condition, self.changed)
