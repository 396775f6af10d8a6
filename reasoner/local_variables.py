"""Different names for different variables.

A variable that occurs only inside witnesses and disjunctions is local to a group of conditions: to the conditions of a witness, or
to an alternative. The same name in two such groups denotes two variables. In the domain, each variable of a behaviour or rule has a
name of its own, so that conditions can be taken out of their groups without confusing variables.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from itertools import count

from confab.reasoner.amounts import put_in
from confab.reasoner.language import groups, plain_variables, substituted, walk
from confab.reasoner.symbols import AnyOf, Behavior, Condition, Effect, Parameter, Rule, ValueEffect, Witness


def named_apart(behavior: Behavior) -> Behavior:
    """Return a behaviour in which no two variables have the same name; the first variable with a name keeps the name."""
    timing = behavior.timing
    asked = [*behavior.preconditions, *(c for _, c in (timing.conditions if timing else ()))]
    made = [*behavior.every_effect, *(e for _, e in (timing.effects if timing else ()))]
    if not any(groups(c) for c in (*asked, *(c for effect in made for c in effect.when))):
        return behavior
    actors = timing.actors if timing else ()
    bound = frozenset({p.name for p in behavior.parameters}.union(actors, plain_variables(asked)))
    names = _LocalNames(dict(behavior.kinds), set().union(*(map(_witnesses, behavior.conditions))))
    asked = list(dict.fromkeys(asked))
    conditions = dict(zip(asked, names.within(asked, bound), strict=True))
    inside = frozenset(names.taken)
    effects: dict[Effect, Effect] = {}
    for effect in made:  # variables of different effects may have the same name
        if effect not in effects:
            names.taken = set(inside)
            effects[effect] = names.effect(effect, bound)
    variables = (Parameter(name, kind) for name, kind in names.kinds.items() if name not in behavior.kinds)
    return replace(
        behavior,
        variables=(*behavior.variables, *variables),
        preconditions=tuple(conditions[c] for c in behavior.preconditions),
        effects=tuple(e for one in behavior.effects if isinstance(e := effects[one], ValueEffect)),
        amounts=tuple(e for one in behavior.amounts if not isinstance(e := effects[one], ValueEffect)),
        timing=timing
        and replace(
            timing,
            conditions=tuple((span, conditions[c]) for span, c in timing.conditions),
            effects=tuple((span, effects[e]) for span, e in timing.effects),
        ),
    )


def rule_named_apart(rule: Rule) -> Rule:
    """Return a rule in which no two variables have the same name."""
    found = named_apart(rule.behavior)
    return replace(rule, variables=found.variables, conditions=found.preconditions)


@dataclass
class _LocalNames:
    """The names of the variables of a behaviour.

    `kinds` contains the classes of all variables except those that witnesses bind, which are in `witnesses`. `taken` contains the
    variables that are local to a group.
    """

    kinds: dict[str, str]
    witnesses: set[str]
    taken: set[str] = field(default_factory=set)

    def within(self, conditions: Sequence[Condition], bound: frozenset[str]) -> tuple[Condition, ...]:
        """Return conditions with new names for the local variables of their groups."""

        def one(condition: Condition) -> Condition:
            match condition:
                case Witness(variable, _, inner):
                    return replace(condition, conditions=self.group(inner, bound | {variable}))
                case AnyOf(alternatives):
                    return replace(condition, alternatives=tuple(self.group(group, bound) for group in alternatives))
                case _:
                    return condition

        return tuple(map(one, conditions))

    def group(self, conditions: Sequence[Condition], bound: frozenset[str]) -> tuple[Condition, ...]:
        """Return a group of conditions with new names for local variables whose names are taken."""
        terms = self.chosen(plain_variables(conditions) - bound)
        renamed = [substituted(c, terms) for c in conditions] if terms else conditions
        return self.within(renamed, bound | plain_variables(renamed))

    def effect(self, effect: Effect, bound: frozenset[str]) -> Effect:
        """Return an effect with new names for its own variables whose names are taken by groups of preconditions."""
        bound |= {effect.each.name} if effect.each else set()
        terms = self.chosen(plain_variables(effect.when) - bound)
        if terms:
            arguments = tuple(terms.get(a, a) for a in effect.arguments)
            when = tuple(substituted(c, terms) for c in effect.when)
            if isinstance(effect, ValueEffect):
                effect = replace(effect, arguments=arguments, value=terms.get(effect.value, effect.value), when=when)
            else:
                effect = replace(effect, arguments=arguments, amount=put_in(effect.amount, terms), when=when)
        return replace(effect, when=self.within(effect.when, bound | plain_variables(effect.when)))

    def chosen(self, variables: Iterable[str]) -> dict[str, str]:
        """Return new names for those of a group's own variables whose names are taken, and take the variables' names."""
        found = dict[str, str]()
        for variable in sorted(self.kinds.keys() & variables):
            if variable in self.taken:
                names = (f"{variable}_{number}" for number in count(2))
                free = next(name for name in names if name not in self.kinds and name not in self.witnesses)
                self.kinds[free] = self.kinds[variable]
                found[variable] = free
            self.taken.add(found.get(variable, variable))
        return found


def _witnesses(condition: Condition) -> set[str]:
    return {inner.variable for inner in walk(condition) if isinstance(inner, Witness)}
