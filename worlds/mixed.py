"""Small random worlds that combine all constructs of domains.

Situation types have one or several values per object, several arguments, or numbers, or are defined by rules or property
axioms. Behaviours belong to one, two or three levels. Effects may be conditional, and may concern named individuals or all
members of a class. Some worlds have rest values, values and situation types of lower levels, empty classes, or unused
individuals. Goals are drawn from one or several reachable states, or at random. Most worlds are small enough for an exhaustive
search by `worlds.interpreter`.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from itertools import product
from math import prod
from random import Random
from typing import Any

from confab.reasoner.aggregates.dependencies import read_by
from confab.reasoner.amounts import Amount, Expression, Quantity, bounds, written
from confab.reasoner.closure import closure
from confab.reasoner.derivation import TASK, circular
from confab.reasoner.language import terms, walk
from confab.reasoner.problem import Domain, Problem
from confab.reasoner.symbols import (
    FALSE,
    TRUE,
    Aggregate,
    AmountEffect,
    AnyOf,
    Behavior,
    Comparison,
    Condition,
    Constraint,
    EqualityCondition,
    Parameter,
    RelationCondition,
    Rule,
    SituationType,
    Symbol,
    ValueCondition,
    ValueEffect,
    Witness,
)
from worlds.constraining import with_constraints
from worlds.interpreter import Interpreter, State, TooManyStatesError
from worlds.kinds import describe, overlapping
from worlds.phrases import HIGHEST, LOCAL, Phrases, Vocabulary, contrary, named
from worlds.tuples import numbers_of_some, of_three
from worlds.wishes import Wish, wishes

MOST = 300
"""Maximum number of reachable nodes of the lowest level in most worlds."""
UNBOUNDED = 0.03
"""Share of worlds that may be too large for an exhaustive search."""
FEW = 8
"""A world with fewer states than this number is usually drawn again."""
EXCLUDED = 0.33
"""Share of worlds whose goal is, if possible, satisfied by no reachable state."""
GROUNDED = 400
"""Maximum number of grounded behaviours and rules of a larger world without exhaustive search."""
TRIES, WALK = 8, 120
"""Number of attempts to draw something that fits, and of the steps that a random walk tries."""
NEAR = 0.25
"""Share of the goals reachable in one step that are kept."""
AGGREGATED = 0.4
"""Share of worlds with derived sums, counts, maxima or minima."""
ALTERNATIVES = 0.15
"""Share of worlds whose goal is a disjunction or existentially quantified."""
UPDATES = 0.15
"""Share of worlds in which some behaviours are written as SPARQL updates, which are slow to read."""


@dataclass(frozen=True)
class RandomWorld:
    """A random problem, with information on how its scene is written.

    `pairs` are the situation types whose property takes several values. `owners` maps each situation type to the classes that
    have it. `axioms` has the property axioms that define situation types instead of rules. `updates` are the behaviours that are
    written as SPARQL updates; with `extending`, an update may extend another one. With `queries`, some rules are written as SPARQL
    queries. `definitions` has the OWL expressions of classes, and `described` the conditions on a member of a class that situations
    define. `wishes` are further goals, which only the task with soft goals has.
    """

    seed: int
    problem: Problem
    parents: Mapping[str, tuple[str, ...]]
    owners: Mapping[str, tuple[str, ...]]
    pairs: frozenset[str] = frozenset()
    axioms: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    updates: frozenset[str] = frozenset()
    wishes: tuple[Wish, ...] = ()
    extending: bool = False
    queries: bool = False
    definitions: Mapping[str, str] = field(default_factory=dict)
    described: Mapping[str, tuple[Condition, ...]] = field(default_factory=dict)


def mixed(seed: int, aggregated: float = AGGREGATED, **shares: float) -> RandomWorld:
    """Return the random world of a seed; for the other parameters see `drawn`."""
    return drawn(seed, aggregated, **shares)[0]


def drawn(
    seed: int,
    aggregated: float = AGGREGATED,
    constrained: float = 0.0,
    remembered: float = 0.0,
    mutual: float = 0.0,
    priced: float = 0.0,
    everyone: float = 0.0,
    repeated: float = 0.0,
    nested: float = 0.0,
    negated: float = 0.0,
    wished: float = 0.0,
    several: float = 0.0,
    partial: float = 0.0,
    ternary: float = 0.0,
    overlapping: float = 0.0,
    extended: float = 0.0,
    local: float = 0.0,
) -> tuple[RandomWorld, Interpreter]:
    """Return the random world of a seed, and an interpreter of the world.

    Parameters
    ----------
    seed : int
    aggregated, constrained, remembered, mutual, priced, everyone, repeated, nested, negated, wished, several, partial, ternary, \
    overlapping, extended, local : float
        The shares of worlds with derived amounts, with constraints on every state, with remembered situation types, with two
        situation types that define each other, with behaviours whose costs depend on amounts, with a goal about all individuals
        of a class, with behaviours that change a situation type by several effects, with bounds or constraints on totals of
        totals, with goals that exclude a value or an amount, with soft goals that aren't among the goals, with several
        constraints on every state or on the order of states, with numbers that only some pairs have, with situation types of
        three arguments, with classes that share individuals or are defined, with behaviours that extend others, and with variables
        that are local to groups of conditions or to effects.
    """
    rng = Random(f"mixed {seed}")
    most, least = (MOST, FEW if rng.random() < 0.5 else 2) if rng.random() > UNBOUNDED else (MOST // 10, 0)
    while True:
        draft = _Draft(
            rng, seed, aggregated, constrained, remembered, mutual, priced, repeated=repeated, nested=nested,
            partial=partial, ternary=ternary, overlapping=overlapping, extended=extended, local=local,
        )  # fmt: skip
        world = draft.world()
        world = replace(world, problem=with_constraints(seed, world.problem, several))
        interpreter = Interpreter(world.problem)
        try:
            costs = interpreter.explored(world.problem.domain.levels[-1], most, False).costs
        except TooManyStatesError:
            if least:
                continue
            costs = {(interpreter.initial, frozenset()): 0}
        if len(costs) < least:
            continue
        goal = _Wishes(rng, interpreter, {node[0]: cost for node, cost in costs.items()}).goal(rng.random() < EXCLUDED)
        if goal:
            meant = _of_everyone(seed, interpreter.wanting(goal), everyone)
            wanted = wishes(seed, meant, [state for state, _ in costs], wished)
            world = replace(world, problem=meant.problem, wishes=wanted)
            world, meant = _with_excluded(*_with_derived_goal(world, meant), negated)
            return _with_local(world, meant, _local_goals(draft, interpreter, [state for state, _ in costs]))


def crowded(seed: int, constrained: float = 0.0, **shares: float) -> tuple[RandomWorld, Interpreter, list[State]]:
    """Return a random world with more individuals and a goal of one fact, its interpreter, and the states of a random walk.

    Such a world can have too many states for an exhaustive search. The `shares` are those of worlds with numbers of some pairs,
    with situation types of three arguments and with overlapping classes.
    """
    rng = Random(f"crowded {seed}")
    while True:
        world = _Draft(rng, seed, AGGREGATED, constrained, 0.0, 0.0, 0.0, rng.choice((1, 2, 3)), **shares).world()
        domain, classes = world.problem.domain, world.problem.classes
        behaviors = [*domain.behaviors.values(), *(one.behavior for one in domain.aggregates.values())]
        behaviors += [rule.behavior for rules in domain.rules.values() for rule in rules]
        if sum(prod(len(classes[kind]) for kind in one.kinds.values()) for one in behaviors) > GROUNDED:
            continue
        meant = Interpreter(world.problem)
        names = [(one.behavior.name, one.arguments) for one in meant.actions(world.problem.domain.levels[-1])]
        states = [meant.initial]
        for name, arguments in rng.choices(names, k=WALK) if names else ():
            states += [state for _, state in list(meant.done(name, arguments, states[-1]))[:1] if state != states[-1]]
        first, last = states[0], states[-1]
        changed = [s for s, i in meant.slots.items() if i < meant.stated and first[i] != last[i] and _sayable(last[i])]
        if changed and len(set(states)) >= FEW:
            symbol = rng.choice(changed)
            value = meant.value(last, symbol)
            goal = {symbol: value if isinstance(value, str) else written(value)}
            meant = meant.wanting(goal)
            return replace(world, problem=meant.problem), meant, states


def _of_everyone(seed: int, meant: Interpreter, share: float) -> Interpreter:
    """Return an interpreter; in a share of the worlds, a goal is required of all individuals of its class."""
    problem = meant.problem
    if Random(f"everyone {seed}").random() >= share:
        return meant
    for symbol, value in problem.goal.items():
        kind = problem.domain.situations[symbol.situation]
        if len(kind.arguments) == 1 and kind.quantity is None:
            everyone = {Symbol(kind.name, (one,)): value for one in problem.classes[kind.arguments[0]]}
            return meant.wanting(dict(sorted({**problem.goal, **everyone}.items())))
    return meant


def _with_derived_goal(world: RandomWorld, meant: Interpreter) -> tuple[RandomWorld, Interpreter]:
    """Return a world; for a share of the worlds, replace the goal by a disjunctive or existentially quantified goal."""
    rng, problem = Random(f"alternatives {world.seed}"), world.problem
    domain = problem.domain
    if rng.random() > ALTERNATIVES:
        return world, meant
    facts = [_as_conditions(problem, symbol, value) for symbol, value in problem.goal.items()]
    (symbol, value), others = next(iter(problem.goal.items())), facts[1:]
    kind = domain.situations[symbol.situation]
    wanted: Condition = AnyOf(tuple(facts[:2])) if others else AnyOf((facts[0],))
    if "|" not in kind.arguments[0] and (not others or rng.random() < 0.4):
        some = Symbol(symbol.situation, ("?w", *symbol.arguments[1:]))
        wanted = Witness("?w", kind.arguments[0], _as_conditions(problem, some, value))
    left = dict(list(problem.goal.items())[2 if isinstance(wanted, AnyOf) else 1 :])
    return _wanting(world, wanted, left) or (world, meant)


def _with_excluded(world: RandomWorld, meant: Interpreter, share: float) -> tuple[RandomWorld, Interpreter]:
    """Return a world; in a share of the worlds, replace goals by goals that exclude one of several values, or an amount."""
    rng, problem = Random(f"negated {world.seed}"), world.problem
    if rng.random() >= share:
        return world, meant
    changed = problem.domain.aggregates.keys() | {s for one in problem.domain.behaviors.values() for s in one.changes}
    kinds = {s: problem.domain.situations[s.situation] for s in meant.slots if s.arguments and s.situation in changed}
    amounts = [symbol for symbol, kind in kinds.items() if kind.quantity is not None]
    several = [symbol for symbol, kind in kinds.items() if len(problem.classes.get(kind.range, ())) > 2]
    symbols = several if several and (not amounts or rng.random() < 0.7) else amounts
    found, wanting = world, meant
    for symbol in rng.sample(symbols, min(len(symbols), rng.choice((1, 1, 2)))):
        value = meant.value(meant.initial, symbol)
        wanted: Condition
        if symbols is amounts:
            limit = Fraction(str(value)) if _sayable(value) else Fraction(1)
            wanted = Comparison(Amount(symbol.situation, symbol.arguments), "=", limit, negated=True)
        else:
            value = value if rng.random() < 0.7 else rng.choice(problem.classes[kinds[symbol].range])
            wanted = ValueCondition(symbol.situation, symbol.arguments, value, negated=True)
        left = {
            s: v
            for s, v in found.problem.goal.items()
            if s.arguments == ("task",) or (s != symbol and rng.random() < 0.7)
        }
        found, wanting = _wanting(found, wanted, left) or (found, wanting)
    return found, wanting


def _local_goals(draft: _Draft, meant: Interpreter, states: Sequence[State]) -> Iterator[Condition]:
    """Yield conditions with local variables that hold in some of the states, if the world has such variables."""
    draft.rng = own = Random(f"local goals {draft.seed}")
    some = own.sample(states, min(len(states), WALK))
    for _ in range(TRIES if draft.local else 0):
        wanted = Phrases(draft, HIGHEST).local([], 1)
        if wanted is not None and any(meant.holds([wanted], state) for state in some):
            yield wanted


def _with_local(
    world: RandomWorld, meant: Interpreter, conditions: Iterable[Condition]
) -> tuple[RandomWorld, Interpreter]:
    """Return a world; in a share of the worlds, one of the conditions is a goal, and one is a wish."""
    own, goal = Random(f"local goal {world.seed}"), world.problem.goal
    changed = own.random() < 0.3
    for wanted in conditions:
        if world.wishes and own.random() < 0.5:
            world = replace(world, wishes=(*world.wishes[:-1], replace(world.wishes[-1], condition=wanted)))
        elif changed and (found := _wanting(world, wanted, {s: v for s, v in goal.items() if own.random() < 0.5})):
            return found
    return world, meant


def _wanting(
    world: RandomWorld, wanted: Condition, left: Mapping[Symbol, str]
) -> tuple[RandomWorld, Interpreter] | None:
    """Return a world with a goal that isn't a fact, and the goals `left`; return None if these goals hold initially."""
    problem = world.problem
    domain = problem.domain
    name = f"goal{sum(symbol.arguments == ('task',) for symbol in left)}"
    rule = Rule(name, (Parameter("?task", TASK),), (), (wanted,))
    levels = [domain.situations[each].level for each in named([wanted])]
    levels += [problem.value_levels.get(term, 1) for inner in walk(wanted) for term in terms(inner)]
    derived = SituationType(name, (TASK,), "Truth", max(levels), boolean=True, default=FALSE)
    more = replace(domain, situations={**domain.situations, name: derived}, rules={**domain.rules, name: (rule,)})
    goal = {Symbol(name, ("task",)): TRUE, **left}
    changed = replace(problem, domain=more, goal=goal, classes={**problem.classes, TASK: ("task",)})
    other = Interpreter(changed)
    if other.wanted(other.initial):
        return None
    return replace(world, problem=changed, owners={**world.owners, name: ()}), other


def _as_conditions(problem: Problem, symbol: Symbol, value: str) -> tuple[Condition, ...]:
    """Return a goal as conditions."""
    if problem.domain.situations[symbol.situation].quantity is None:
        return (ValueCondition(symbol.situation, symbol.arguments, value),)
    amount = Amount(symbol.situation, symbol.arguments)
    return tuple(Comparison(amount, sign, limit) for sign, limit in bounds(value))


class _Wishes:
    """Draws the goal of a world."""

    def __init__(self, rng: Random, interpreter: Interpreter, costs: Mapping[State, Any]) -> None:
        self.rng, self.of, self.costs = rng, interpreter, costs
        self.states = sorted(costs, key=lambda state: float(costs[state]))
        self.first: dict[tuple[int, Any], Any] = {}  # the least cost of a state with a value
        for state in self.states:
            for fact in enumerate(state):
                self.first.setdefault(fact, costs[state])

    def goal(self, excluded: bool) -> dict[Symbol, str]:
        """Return a goal that doesn't hold initially, with `excluded` in no reachable state; an empty goal if none was found."""
        for _ in range(3 * TRIES if excluded else TRIES):
            kind = "random" if self.rng.random() < 0.12 else "two" if excluded else "one"
            goal = self.drawn(kind)
            states = self.states if excluded else self.states[:1]
            if (
                goal
                and not any(self.has(state, goal) for state in states)
                and (kind == "two" or not excluded or self.rng.random() < 0.3)
            ):
                near = (state for state in self.states[1:] if self.has(state, goal))
                cost = self.costs[next(near, self.states[0])]
                if excluded or not cost or cost > 1 or self.rng.random() < NEAR:
                    return goal
        return {}

    def has(self, state: State, goal: Mapping[Symbol, str]) -> bool:
        """Return whether a state satisfies a goal."""
        return all(self.of.meets(state, symbol, value) for symbol, value in goal.items())

    def drawn(self, kind: str) -> dict[Symbol, str]:
        """Return a goal of values from one reachable state, from two states (`two`), or of any values (`random`)."""
        rng = self.rng
        sources = [rng.choice(self.states[-1 - len(self.states) // 6 :])]
        sources += [rng.choice(self.states), rng.choice(self.states)] if kind == "two" else []
        found: dict[Symbol, str] = {}
        for _ in range(rng.choice((1, 1, 2, 2, 3, 4)) + 2 * (kind == "two")):
            source = rng.choice(sources)
            changed = [s for s, i in self.of.slots.items() if source[i] != self.of.initial[i]]
            if kind == "random" or not changed or rng.random() < 0.15:
                changed = self.of.symbols
            changed = [symbol for symbol in changed if self.wished(symbol)]
            if not changed:
                return {}
            symbol = rng.choice(changed)
            if kind != "random" and rng.random() < 0.6:  # prefer values that are reached late
                symbol = max(
                    changed, key=lambda s: (self.first[self.of.slots[s], source[self.of.slots[s]]], rng.random())
                )
            value = self.random(symbol) if kind == "random" else self.of.value(source, symbol)
            found.setdefault(symbol, self.said(symbol, value))
        return dict(sorted(found.items()))

    def wished(self, symbol: Symbol) -> bool:
        """Return whether a goal may name a symbol: no maximum or minimum, and none of a situation type that Confab adds."""
        aggregate = self.of.problem.domain.aggregates.get(symbol.situation)
        return (aggregate is None or aggregate.kept) and not self.of.kinds[symbol.situation].added

    def random(self, symbol: Symbol) -> object:
        kind = self.of.kinds[symbol.situation]
        if kind.quantity is not None:
            return self.rng.randint(0, 4)
        return self.rng.choice((FALSE, TRUE) if kind.boolean else self.of.problem.classes[kind.range])

    def said(self, symbol: Symbol, value: object) -> str:
        if self.of.kinds[symbol.situation].quantity is None:
            return str(value)
        sign = self.rng.choice(("=", ">=", "<=", "<", ">"))
        number = Fraction(str(value)) if _sayable(value) else Fraction(1)
        number += {"<": 1, ">": -1}.get(sign, 0)
        return written(number) if sign == "=" else f"{sign}{written(number)}"


def _sayable(value: Any) -> bool:
    """Return whether a scene can state a value: a name, or a number with few digits."""
    return isinstance(value, str) or (abs(value) < 100 and Fraction(value).denominator in (1, 2, 4))


def _shared(terms: Iterable[str]) -> list[str]:
    """Return the terms that aren't local to an effect."""
    return [term for term in terms if not term.startswith(LOCAL)]


def _recursive(aggregate: Aggregate, rules: Mapping[str, Sequence[Rule]]) -> bool:
    """Return whether an aggregate depends on a recursively defined situation type."""
    needs = closure(
        read_by(aggregate), lambda name: (s for rule in rules.get(name, ()) for s in named(rule.conditions))
    )
    return not needs.isdisjoint(circular(rules))


class _Draft(Vocabulary):
    """A randomly drawn world without its goal."""

    def __init__(
        self,
        rng: Random,
        seed: int,
        aggregated: float,
        constrained: float,
        remembered: float,
        mutual: float,
        priced: float,
        crowd: int = 0,
        repeated: float = 0.0,
        nested: float = 0.0,
        partial: float = 0.0,
        ternary: float = 0.0,
        overlapping: float = 0.0,
        extended: float = 0.0,
        local: float = 0.0,
    ) -> None:
        super().__init__(rng)
        self.local = Random(f"local {seed}").random() < local
        self.repeated = Random(f"repeated {seed}").random() < repeated
        self.crowd, self.valued, self.nested = crowd, priced, nested
        self.seed, self.share, self.prevented = seed, aggregated, constrained
        self.remembered, self.connected = remembered, mutual
        self.some, self.triples, self.overlapping, self.extended = partial, ternary, overlapping, extended
        self.forbidden: list[str] = []  # situation types of which a constraint is drawn
        self.levels = rng.choice((1, 1, 1, 2, 2, 3))
        self.pairs: set[str] = set()
        self.made: list[ValueEffect] = []

    def chance(self, p: float) -> bool:
        return self.rng.random() < p

    def world(self) -> RandomWorld:
        self.individuals()
        if (own := Random(f"overlapping {self.seed}")).random() < self.overlapping:
            overlapping(self, own)
        for number in range(self.rng.choice((2, 2, 3, 3, 4, 5))):
            self.situation(number)
        self.static()
        for what, share, draw in (("partial", self.some, numbers_of_some), ("ternary", self.triples, of_three)):
            if (own := Random(f"{what} {self.seed}")).random() < share:
                draw(self, own, self.levels)
        if self.overlaps and (own := Random(f"described {self.seed}")).random() < 0.6:
            describe(self, own)
        own = Random(f"aggregates {self.seed}")  # a separate generator keeps worlds without aggregates unchanged
        many = own.choice((1, 1, 2)) if own.random() < self.share else 0
        first = own.random() < 0.5
        for number in range(many if first else 0):
            self.aggregated(number)
        for number in range(self.rng.choice((0, 0, 1, 1, 2))):
            self.defined(number)
        for number in range(0 if first else many):
            self.aggregated(number)
        self.mutual()
        self.remembering()
        extending = (own := Random(f"extended {self.seed}")).random() < self.extended
        behaviors = self.priced([*(made := self.behaviors()), *(self.extensions(made, own) if extending else ())])
        used = {b.level for b in behaviors}
        self.levels = max(used)
        aggregates = self.aggregates
        domain = Domain(
            self.situations,
            {b.name: b for b in behaviors},
            rules=self.rules,
            aggregates=aggregates,
            remembers=self.remembers,
        )
        problem = Problem("w", domain, self.classes, self.relations, self.initial, {}, self.parents, self.values)
        if aggregates:
            problem = self.bounded(problem)
        problem = self.totalled(self.constrained(problem))
        updates = frozenset(b.name for b in behaviors if self.chance(0.5)) if self.chance(UPDATES) else frozenset()
        updates = frozenset(b.name for b in behaviors) if extending else updates
        if self.local and (own := Random(f"queries {self.seed}")).random() < 0.3:
            updates = frozenset(b.name for b in behaviors if own.random() < 0.7)
        return RandomWorld(
            self.seed, problem, self.parents, self.owners, frozenset(self.pairs), self.axioms, updates,
            extending=extending, queries=self.local, definitions=self.definitions, described=self.described,
        )  # fmt: skip

    def individuals(self) -> None:
        rng, number = self.rng, 0

        def some(letter: str, many: int) -> tuple[str, ...]:
            nonlocal number
            number += many
            return tuple(f"{letter}{i}" for i in range(number - many + 1, number + 1))

        own, sub = some("a", rng.choice((1, 1, 2, 2, 3)) + self.crowd), some("a", rng.choice((0, 0, 1, 1, 2)))
        b = some("z", rng.choice((0, 1, 1, 2, 2, 3)) + self.crowd)
        # in sorted order, the names of B are after "true", and the other names are before "false"
        self.classes = {"Truth": (FALSE, TRUE), "A": (*own, *sub), "A1": sub, "B": b}
        self.objects = (*own, *sub, *b)

    # --------------------------------------------------------------------------------------------------- situation types

    def situation(self, number: int) -> None:
        """Draw a situation type and its initial values."""
        rng = self.rng
        kind = rng.choice("FFFPPRRQGNNM" if number or not self.crowd else "FFR")
        name = f"{kind}{number}"
        level = rng.choice(range(1, self.levels + 1)) if number else 1
        owner = rng.choice(("A", "A", "B", "A1", "A|B"))
        owner = self.kind(owner, self.owning) if owner in self.parents else owner
        owners = tuple(owner.split("|"))
        if len(owners) > 1:
            self.classes[owner] = tuple(dict.fromkeys(one for of in owners for one in self.classes[of]))
        arguments: tuple[str, ...] = (owner,)
        if kind in "QGM":
            owners = ()
            arguments = tuple(
                self.kind(rng.choice(("A", "B", "A1")), self.owning)
                for _ in range(3 if kind == "Q" and self.chance(0.1) else 2)
            )
        self.owners[name] = owners
        rest: str | None = None
        if kind in "FG":
            self.with_values(name, arguments, level)
            return
        if kind in "NM":
            self.amount(name, arguments, level)
            return
        if kind == "R":
            target = rng.choice(("A", "B", "B"))
            self.pairs.add(name)
            self.parents[target] = (*self.parents[target], name)
            self.classes[name] = self.classes[target]
            arguments = (*arguments, name)
        if level > 1 and self.chance(0.5):
            rest = FALSE
        elif level > 1 and self.chance(0.1):
            rest = TRUE
        rest = None if kind == "R" and rest == TRUE else rest
        self.situations[name] = SituationType(name, arguments, "Truth", level, rest, FALSE, boolean=True)
        if rest == TRUE:
            self.situations[name] = SituationType(name, arguments, "Truth", level, TRUE, TRUE, boolean=True)
        for row in product(*(self.classes[of] for of in arguments)):
            if rest == TRUE or self.chance(0.05 if rest == FALSE else 0.3):
                self.initial[Symbol(name, row)] = TRUE

    def with_values(self, name: str, arguments: tuple[str, ...], level: int) -> None:
        """Draw a situation type with one value per object."""
        rng = self.rng
        members = tuple(f"{name}v{i}" for i in range(rng.choice((2, 2, 3))))
        target = rng.choice(("A", "B", "B") if self.crowd else ("", "", "", "A", "B"))
        target = self.kind(target, self.owning) if target else ""
        if target:
            members = members[: rng.choice((0, 1, 1, 2))]
            if len({*members, *self.classes[target]}) < 2:
                members = (f"{name}v0", f"{name}v1")
            self.parents[target] = (*self.parents[target], name)
        self.classes[name] = (*members, *(self.classes[target] if target else ()))
        first = self.classes[name]
        if members and self.levels > level and self.chance(0.2):
            lower = rng.choice(members)
            self.values[lower] = rng.choice(range(level + 1, self.levels + 1))
            first = tuple(value for value in first if value != lower) or first
        start = {row: rng.choice(first) for row in product(*(self.classes[of] for of in arguments))}
        rest = None
        if level > 1 and self.chance(0.5):
            rest = rng.choice(first)
            start = {row: value if self.chance(0.05) else rest for row, value in start.items()}
        default = rest if rest is not None else rng.choice(first) if len(arguments) > 1 or self.chance(0.2) else None
        if (
            self.crowd and rest is None and target and self.chance(0.4)
        ):  # no query leads from an unstated value to its objects
            default = rng.choice(first)
            start = {row: default if self.chance(0.4) else value for row, value in start.items()}
        self.situations[name] = SituationType(name, arguments, name, level, rest, default)
        self.initial |= {Symbol(name, row): value for row, value in start.items()}

    def amount(self, name: str, arguments: tuple[str, ...], level: int) -> None:
        """Draw a situation type with a number per object."""
        rng = self.rng
        least = rng.choice((Fraction(0), Fraction(0), Fraction(-1), None))
        most = rng.choice((Fraction(2), Fraction(3), Fraction(4), None))
        if least is None and most is None and not self.chance(0.1):
            most, least = Fraction(3), Fraction(0)
        whole = self.chance(0.6)
        default = "1" if len(arguments) > 1 or self.chance(0.2) else None
        self.situations[name] = SituationType(
            name, arguments, name, level, None, default, quantity=Quantity("", whole, least, most)
        )
        for row in product(*(self.classes[of] for of in arguments)):
            if len(arguments) == 1 or self.chance(0.5) or default:
                self.initial[Symbol(name, row)] = str(rng.randint(0, 2))

    def static(self) -> None:
        """Draw static relations between individuals, and static numbers of individuals."""
        if self.chance(0.4):
            ends = (self.rng.choice(("A", "B", "A1")), self.rng.choice(("A", "B")))
            rows = frozenset(row for row in product(*(self.classes[of] for of in ends)) if self.chance(0.5))
            self.relations["near"], self.ends["near"] = rows, ends
        if self.chance(0.3) and any(s.quantity for s in self.situations.values()):
            self.relations["size"] = frozenset(
                (one, str(self.rng.randint(0, 2))) for one in self.classes["A"] if self.chance(0.9)
            )
            self.ends["size"] = ("A",)

    def defined(self, number: int) -> None:
        """Draw a defined situation type."""
        rng, name = self.rng, f"D{number}"
        properties = [one for one in sorted(self.pairs) if one not in self.rules]
        if properties and self.chance(0.35):
            self.along(name, rng.choice(properties))
            return
        kind = rng.choice(("A", "B", "A1"))
        arguments: tuple[str, ...] = (kind,) if self.chance(0.75) else (kind, rng.choice(("A", "B")))
        self.owners[name] = (kind,) if len(arguments) == 1 else ()
        rules = []
        for _ in range(rng.choice((1, 1, 2))):
            writer = Phrases(self, HIGHEST)
            parameters = [writer.fresh(of) for of in arguments]
            if self.chance(0.35):  # a single negated condition
                conditions = [contrary(writer.value(parameters))]
            else:
                conditions = writer.conditions(parameters, rng.choice((1, 2)), 1)
            terms = writer.terms()
            rules.append(Rule(name, terms[: len(parameters)], terms[len(parameters) :], tuple(conditions)))
        level = max((self.situations[s].level for rule in rules for s in named(rule.conditions)), default=1)
        self.situations[name] = SituationType(name, arguments, "Truth", level, boolean=True, default=FALSE)
        self.rules[name] = tuple(rules)

    def mutual(self) -> None:
        """Draw two situation types that define each other: objects that links connect, in any direction, with certain objects."""
        own, rng = Random(f"mutual {self.seed}"), self.rng
        links: list[tuple[tuple[str, ...], Condition]] = [
            (one.arguments, ValueCondition(one.name, ("?x", "?y"), TRUE))
            for one in self.situations.values()
            if one.boolean and one.name not in self.rules and one.arguments[1:] in (("A",), ("A1",), ("B",))
        ]
        if "near" in self.ends:
            links.append((self.ends["near"], RelationCondition("near", ("?x", "?y"))))
        if own.random() >= self.connected or not links:
            return
        self.rng = own  # a separate generator keeps worlds without such situation types unchanged
        kinds, link = own.choice(links)
        writer = Phrases(self, HIGHEST)
        one = writer.fresh(kinds[0])
        first = writer.conditions([one], 1, 1)
        x, y = (Parameter(term, kind) for term, kind in zip(("?x", "?y"), kinds, strict=True))
        terms = writer.terms()
        rules = {
            "D8": (
                Rule("D8", terms[:1], terms[1:], tuple(first)),
                Rule("D8", (x,), (), (Witness("?y", kinds[1], (link, ValueCondition("D9", ("?y",), TRUE))),)),
            ),
            "D9": (Rule("D9", (y,), (), (Witness("?x", kinds[0], (link, ValueCondition("D8", ("?x",), TRUE))),)),),
        }
        used = named([*first, link]) & self.situations.keys()
        level = max((self.situations[name].level for name in used), default=1)
        for name, kind in zip(rules, kinds, strict=True):
            self.owners[name] = (kind,)
            self.situations[name] = SituationType(name, (kind,), "Truth", level, boolean=True, default=FALSE)
        self.rules.update(rules)
        self.rng = rng

    def aggregated(self, number: int) -> None:
        """Draw a sum, a count, a maximum or a minimum over individuals."""
        rng, name = self.rng, f"S{number}"
        kind = rng.choice(("A", "B", "A1"))
        arguments: tuple[str, ...] = (kind,) if self.chance(0.8) else (kind, rng.choice(("A", "B")))
        for _ in range(TRIES):
            writer = Phrases(self, HIGHEST)
            parameters = [writer.fresh(of) for of in arguments]
            over = [writer.fresh(rng.choice(("A", "A", "B", "A1"))) for _ in range(rng.choice((1, 1, 1, 2)))]
            bound = [*parameters, *over]
            conditions = [self.joining(writer, over[0], parameters[0])] if self.chance(0.6) else []
            conditions += writer.conditions(bound, rng.choice((0, 1, 1, 2)) + (not conditions), 1)
            function = rng.choice(("sum", "sum", "count", "count", "max", "min"))
            by = None if function == "count" else writer.number(bound, 1, extrema=False)
            amount = Fraction(1) if function == "count" else by or Fraction(rng.choice((1, 2)))
            terms = writer.terms()
            made = Aggregate(
                name, function, amount, terms[: len(arguments)], terms[len(arguments) :], tuple(conditions)
            )
            if not _recursive(made, self.rules):
                break
        else:
            return
        self.owners[name] = (kind,) if len(arguments) == 1 else ()
        level = max((self.situations[s].level for s in read_by(made)), default=1)
        self.situations[name] = SituationType(name, arguments, name, level, quantity=Quantity())
        self.aggregates[name] = made

    def joining(self, writer: Phrases, one: str, other: str) -> Condition:
        """Return a condition that relates two individuals, if possible by a value of the first."""
        of, to = set(writer.kinds_of(one)), set(writer.kinds_of(other))
        fitting = [
            s for s in self.situations.values() if s.level <= writer.level and of & {*self.classes[s.arguments[0]]}
        ]
        found: list[Condition] = [
            ValueCondition(s.name, (one,), other)
            for s in fitting
            if len(s.arguments) == 1 and to & {*self.classes.get(s.range, ())}
        ]
        if self.crowd:
            found += [
                ValueCondition(s.name, (one, other), TRUE)
                for s in fitting
                if s.boolean and len(s.arguments) == 2 and to & {*self.classes[s.arguments[1]]}
            ]
        if "near" in self.relations and self.crowd and self.chance(0.5):
            return RelationCondition("near", (one, other))
        return self.rng.choice(found) if found else writer.value([one, other], one)

    def bounded(self, problem: Problem) -> Problem:
        """Return the problem with bounds on some sums and counts; the bounds hold initially."""
        meant, situations = Interpreter(problem), dict(problem.domain.situations)
        for name, one in self.aggregates.items():
            first = [meant.initial[i] for symbol, i in meant.slots.items() if symbol.situation == name]
            if not one.kept or not first or not self.chance(0.3):
                continue
            most = Fraction(max(first)) + self.rng.choice((0, 1, 2))
            least = Fraction(min(first)) - self.rng.choice((0, 1)) if self.chance(0.2) else None
            if most.denominator in (1, 2, 4) and (least is None or least.denominator in (1, 2, 4)):
                situations[name] = replace(situations[name], quantity=Quantity("", False, least, most))
        self.situations = situations
        return replace(problem, domain=replace(problem.domain, situations=situations))

    def constrained(self, problem: Problem) -> Problem:
        """Return the problem; in a share of the worlds, the problem gets a constraint that holds initially."""
        own = Random(f"constraints {self.seed}")
        if own.random() >= self.prevented and not self.forbidden:
            return problem
        meant = Interpreter(problem)
        found = [
            Constraint(name, always)
            for name, kind in self.situations.items()
            for always in (False, True)
            if kind.boolean and name not in circular(self.rules)
            if all(
                value == (TRUE if always else FALSE)
                for symbol, value in [
                    *((s, meant.initial[i]) for s, i in meant.slots.items()),
                    *meant.constants.items(),
                ]
                if symbol.situation == name
            )
        ]
        derived = [one for one in found if one.situation in self.rules]
        chosen = [one for one in found if one.situation in self.forbidden and not one.always]
        if not self.forbidden and found:
            chosen = [own.choice(derived if derived and own.random() < 0.8 else found)]
        constraints = {f"{one.situation}.exceptions": one for one in chosen}
        return replace(problem, domain=replace(problem.domain, constraints=constraints))

    def totalled(self, problem: Problem) -> Problem:
        """Return the problem; in a share of the worlds, it gets a total of totals, and limits on a total that hold initially."""
        own, rng = Random(f"totals {self.seed}"), self.rng
        if own.random() >= self.nested:
            return problem
        self.rng = own  # a separate generator keeps worlds without totals of totals unchanged
        counts = [one.situation for one in self.aggregates.values() if one.kept and len(one.parameters) == 1]
        if not counts or self.chance(0.3):
            counts = self.total("S7", None)
        totals = [*counts, *(self.total("S8", own.choice(counts)) if counts else ())]
        if "S8" in totals and self.chance(0.2):
            totals += self.total("S9", "S8")
        self.rng = rng
        if not totals:
            return problem
        domain = replace(problem.domain, situations=self.situations, aggregates=self.aggregates, rules=self.rules)
        meant = Interpreter(replace(problem, domain=domain, classes=self.classes))

        def initially(name: str) -> list[Fraction]:
            return [Fraction(meant.initial[i]) for symbol, i in meant.slots.items() if symbol.situation == name]

        constraints = {**domain.constraints}
        last = totals[-1]
        if (numbers := initially(last)) and own.random() < 0.7:
            most = max(numbers) + own.choice((0, 0, 1)) if own.random() < 0.8 else None
            least = min(numbers) if most is None or own.random() < 0.2 else None
            if all(one is None or one.denominator in (1, 2, 4) for one in (most, least)):
                self.situations[last] = replace(self.situations[last], quantity=Quantity("", False, least, most))
        limited = own.choice(totals)
        kind = self.situations[limited].arguments[0]
        if (numbers := initially(limited)) and "|" not in kind and own.random() < 0.5:
            sign, limit = own.choice(((">", max(numbers)), (">", max(numbers) + 1), ("<", min(numbers))))
            if _sayable(limit):
                condition = Comparison(Amount(limited, ("?p0",)), sign, limit)
                self.rules["D7"] = (Rule("D7", (Parameter("?p0", kind),), (), (condition,)),)
                self.owners["D7"], level = (kind,), self.situations[limited].level
                self.situations["D7"] = SituationType("D7", (kind,), "Truth", level, boolean=True, default=FALSE)
                constraints["D7.exceptions"] = Constraint("D7")
        return replace(problem, classes=self.classes, domain=replace(domain, constraints=constraints))

    def total(self, name: str, of: str | None) -> list[str]:
        """Draw a count, or a sum or count over the owners of another total; return its name, or nothing if no total was found."""
        whole = [*self.classes["A"], *self.classes["B"]]
        kind = "A|B" if whole and of is not None and self.chance(0.2) else self.rng.choice(("A", "A", "B", "A1"))
        for _ in range(TRIES):
            writer = Phrases(self, HIGHEST)
            owner = self.rng.choice(whole) if kind == "A|B" else writer.fresh(kind)
            head = (Parameter("?argument0", kind),) if kind == "A|B" else writer.terms()
            over = writer.fresh(self.rng.choice(("A", "A", "B")) if of is None else self.situations[of].arguments[0])
            if "|" in writer.kinds[over]:
                return []
            near = [ends for ends in ((over, owner), (owner, over)) if "near" in self.ends]
            if near and self.chance(0.4):
                conditions: list[Condition] = [RelationCondition("near", self.rng.choice(near))]
            else:
                conditions = [self.joining(writer, over, owner)] if of is None or self.chance(0.8) else []
            conditions += writer.conditions([over], 1, 1) if of is None and self.chance(0.4) else []
            amount: Expression = Fraction(1)
            if of is not None and self.chance(0.7):
                amount = Amount(of, (over,))
            elif of is not None:
                conditions.append(Comparison(Amount(of, (over,)), self.rng.choice((">", ">=", "=")), Fraction(1)))
            function = "count" if amount == 1 else "sum"
            variables = tuple(one for one in writer.terms() if one not in head)
            if kind == "A|B":
                conditions.insert(0, EqualityCondition(head[0].name, owner))
            made = Aggregate(name, function, amount, head, variables, tuple(conditions))
            if not _recursive(made, self.rules):
                break
        else:
            return []
        if kind == "A|B":
            self.classes[kind] = tuple(dict.fromkeys(whole))
        self.owners[name] = tuple(kind.split("|"))
        level = max((self.situations[s].level for s in read_by(made)), default=1)
        self.situations[name] = SituationType(name, (kind,), name, level, quantity=Quantity())
        self.aggregates[name] = made
        return [name]

    def remembering(self) -> None:
        """Draw remembered situation types, and constraints on them: "at most once" and "only after"."""
        own, rng = Random(f"remembered {self.seed}"), self.rng
        if own.random() >= self.remembered:
            return
        self.rng = own  # a separate generator keeps worlds without remembered situation types unchanged
        kinds = [
            s
            for s in self.situations.values()
            if s.boolean and s.name not in circular(self.rules) and (len(s.arguments) == 1 or "|" not in s.arguments[0])
        ]
        if kinds:
            of = self.rng.choice(kinds)
            same = [s for s in kinds if s.arguments == of.arguments and s is not of]
            pattern = self.rng.choice(("some", "once", "once", "after"))
            if pattern == "some" or (pattern == "after" and not same):
                self.remember("O0", of.name)
            elif pattern == "once":
                self.remember("O0", of.name)
                self.both("E0", of, "O0", TRUE, of.name, FALSE)
                self.remember("O1", "E0")
                self.both("V0", of, of.name, TRUE, "O1", TRUE)
                self.forbidden.append("V0")
            else:
                first = self.rng.choice(same).name
                self.both("E0", of, first, TRUE, of.name, FALSE)
                self.remember("O0", "E0")
                self.both("V0", of, of.name, TRUE, "O0", FALSE)
                self.forbidden.append("V0")
        self.rng = rng

    def remember(self, name: str, source: str) -> None:
        """Add a situation type that remembers another one."""
        kind = self.situations[source]
        self.owners[name] = self.owners[source] if len(kind.arguments) == 1 else ()
        self.remembers[name] = source
        self.situations[name] = replace(kind, name=name, rest=None, default=FALSE, properties=())
        for row in product(*(self.classes[of] for of in kind.arguments)):
            if self.chance(0.05):
                self.initial[Symbol(name, row)] = TRUE

    def both(self, name: str, of: SituationType, one: str, its: str, other: str, value: str) -> None:
        """Add a situation type that is true if two situation types have the given values for its arguments."""
        head = tuple(Parameter(f"?p{i}", kind.split("|")[0]) for i, kind in enumerate(of.arguments))
        terms = tuple(one.name for one in head)
        conditions = tuple(ValueCondition(s, terms, TRUE, v == FALSE) for s, v in ((one, its), (other, value)))
        level = max(self.situations[s].level for s in (one, other))
        self.owners[name] = self.owners[of.name] if len(of.arguments) == 1 else ()
        self.situations[name] = SituationType(name, of.arguments, "Truth", level, boolean=True, default=FALSE)
        self.rules[name] = (Rule(name, head, (), conditions),)

    def along(self, name: str, base: str) -> None:
        """Draw a situation type that a property axiom defines: a transitive superproperty, or a property chain."""
        situation = self.situations[base]
        owner, target = situation.arguments
        base_property, own_property = base.lower(), name.lower()
        x, y, z = "?x", "?y", "?z"
        one = ValueCondition(base, (x, z), TRUE)
        near = self.ends.get("near", ("", ""))
        kinds = tuple(owner.split("|"))
        if near[0] and self.chance(0.5):
            last = f"{name}"
            chain = (ValueCondition(base, (x, y), TRUE), RelationCondition("near", (y, z)))
            rules = [Rule(name, (Parameter(x, owner), Parameter(z, last)), (Parameter(y, target),), chain)]
            self.classes[name], self.axioms[name] = self.classes[near[1]], (
                f":{own_property} owl:propertyChainAxiom ( :{base_property} :near ) .",
            )  # fmt: skip
            self.parents[near[1]] = (*self.parents[near[1]], name)
        else:
            source = next(kind for kind in ("A", "B") if base in self.parents[kind])
            self.parents[source] = (*self.parents[source], name)
            self.classes[name] = self.classes[target]
            further = (ValueCondition(name, (x, y), TRUE), ValueCondition(name, (y, z), TRUE))
            ends = Parameter(x, owner), Parameter(z, name)
            rules = [Rule(name, ends, (), (one,)), Rule(name, ends, (Parameter(y, name),), further)]
            self.axioms[name] = (
                f":{own_property} a owl:TransitiveProperty .",
                f":{base_property} rdfs:subPropertyOf :{own_property} .",
            )
        self.owners[name] = kinds
        self.pairs.add(name)
        self.situations[name] = SituationType(
            name, (owner, name), "Truth", situation.level, boolean=True, default=FALSE
        )
        self.rules[name] = tuple(rules)

    # -------------------------------------------------------------------------------------------------------- behaviours

    def behaviors(self) -> list[Behavior]:
        """Return random behaviours; most lower-level behaviours have at least the effects of a behaviour of the level above."""
        rng, found = self.rng, list[Behavior]()
        above: list[Behavior] = []
        for level in range(1, self.levels + 1):
            made: list[Behavior] = []
            for upper in above:
                if self.chance(0.85):
                    made += self.refining(upper, level, len(made))
            for _ in range(rng.choice((1, 2, 2, 3)) if level == 1 else rng.choice((0, 1, 1, 2))):
                made.append(self.behavior(f"L{level}_{len(made)}", level))
            above = [one for one in made if one.effects or one.amounts]
            found += above
        return found or [self.behavior("L1_0", 1, True)]

    def behavior(self, name: str, level: int, sure: bool = False) -> Behavior:
        """Return a behaviour that is independent of the level above."""
        rng, writer = self.rng, Phrases(self, level)
        parameters = [
            writer.fresh(rng.choice(("A", "A", "B", "A1")))
            for _ in range(rng.choice((1, 2, 2, 3) if self.crowd else (0, 1, 1, 2, 2)))
        ]
        bound = list(parameters)
        conditions = writer.conditions(bound, rng.choice((0, 0, 0, 1) if self.crowd else (0, 1, 1, 2, 3)), 1)
        if self.crowd:  # related parameters lead recognition to few individuals
            pairs = [(one, self.rng.choice(parameters[:i])) for i, one in enumerate(parameters) if i]
            conditions += [
                self.joining(writer, *pair) if self.chance(0.5) else self.joining(writer, *pair[::-1]) for pair in pairs
            ]
        described = [one for one in map(writer.described, parameters if self.described else ()) if one is not None]
        if described and self.chance(0.5):
            conditions.append(self.rng.choice(described))
        if self.made and self.chance(0.6) and (link := writer.link(bound, rng.choice(self.made))):
            conditions.append(link)
        many = rng.choice((1, 1, 2) if self.crowd else (1, 1, 2, 3))
        found = self.with_effects(name, level, writer, parameters, bound, conditions, many)
        self.made += [effect for effect in found.effects if not effect.value.startswith("?")]
        return found

    def extensions(self, behaviors: Sequence[Behavior], own: Random) -> list[Behavior]:
        """Return a behaviour of the lowest level with the conditions and effects of another one, and more."""
        self.rng, rng = own, self.rng  # a separate generator keeps worlds without extensions unchanged
        lowest = [one for one in behaviors if one.level == max(each.level for each in behaviors)]
        found = self.refining(own.choice(lowest), lowest[0].level, len(lowest))
        self.rng = rng
        return found

    def priced(self, behaviors: list[Behavior]) -> list[Behavior]:
        """Return the behaviours; in a share of the worlds, some of them have a price in place of a cost."""
        own, rng = Random(f"prices {self.seed}"), self.rng
        if own.random() >= self.valued:
            return behaviors
        self.rng, found = own, list[Behavior]()  # a separate generator keeps worlds without prices unchanged
        for one in behaviors:
            writer = Phrases(self, one.level)
            writer.kinds = {**one.kinds}
            price = writer.number(_shared(writer.kinds), 1, extrema=False) if self.chance(0.6) else None
            if price is not None:
                one = replace(one, cost=1.0, price=price)
                one = replace(one, preconditions=(*one.preconditions, *([one.priced] if one.priced else [])))
            elif self.chance(0.3):
                one = replace(one, cost=0.0)
            found.append(one)
        self.rng = rng
        return found

    def with_effects(
        self,
        name: str,
        level: int,
        writer: Phrases,
        parameters: Sequence[str],
        bound: list[str],
        conditions: Sequence[Condition],
        many: int,
        effects: Sequence[ValueEffect] = (),
        amounts: Sequence[AmountEffect] = (),
    ) -> Behavior:
        values, numbers, before = list(effects), list(amounts), len(bound)
        for _ in range(many):
            writer.effect(bound, values, numbers)
        parameters = [*parameters, *bound[before:]]
        terms = writer.terms()
        cost = self.rng.choice((1.0, 1.0, 1.0, 2.0, 0.5)) if self.chance(0.5) else 1.0
        return Behavior(
            name, level, tuple(t for t in terms if t.name in parameters), tuple(t for t in terms if t.name not in parameters),
            tuple(conditions), tuple(values), cost, tuple(numbers),
        )  # fmt: skip

    def refining(self, upper: Behavior, level: int, count: int) -> list[Behavior]:
        """Return behaviours of the next level that together have the effects of an upper behaviour."""
        writer = Phrases(self, level)
        writer.kinds = {**upper.kinds}
        parameters = [p.name for p in upper.parameters]
        bound = _shared(writer.kinds)
        more = writer.conditions(bound, self.rng.choice((0, 0, 1)), 1)
        derived = {*self.rules, *self.remembers}
        lower = [s for s in self.situations.values() if s.level == level and s.name not in derived]
        switches = [
            s for s in lower if s.boolean and s.arguments in (("A",), ("B",), ("A1",)) and self.classes[s.arguments[0]]
        ]
        name = f"L{level}_{count}"
        if switches and self.chance(0.4):  # the refinement requires a switch, and further behaviours set the switch
            switch = self.rng.choice(switches)
            first = Phrases(self, level)
            on = first.fresh(switch.arguments[0])
            fitting = [
                t for t in parameters if set(self.classes[writer.kinds[t]]) <= set(self.classes[switch.arguments[0]])
            ]
            about = self.rng.choice([*fitting, self.rng.choice(self.classes[switch.arguments[0]])])
            asked = ValueCondition(switch.name, (about,), FALSE if switch.rest == TRUE else TRUE)
            begun = ValueEffect(switch.name, (on,), asked.value)
            ended = ValueEffect(switch.name, (on,), FALSE if asked.value == TRUE else TRUE)
            made = [
                self.with_effects(name, level, writer, parameters, bound, [*upper.preconditions, asked, *more], 0,
                                  upper.effects, upper.amounts),
                self.with_effects(f"L{level}_{count + 1}", level, first, [on], [on], [], 0, [begun]),
            ]  # fmt: skip
            if switch.rest is not None or self.chance(0.5):
                last = Phrases(self, level)
                last.kinds = {**first.kinds}
                made.append(self.with_effects(f"L{level}_{count + 2}", level, last, [on], [on], [], 0, [ended]))
            return made
        extra = self.rng.choice((0, 0, 1, 1))
        conditions = [*upper.preconditions, *more]
        return [
            self.with_effects(name, level, writer, parameters, bound, conditions, extra, upper.effects, upper.amounts)
        ]
