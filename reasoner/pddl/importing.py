"""Translation of a PDDL domain and problem to the classes of `confab.reasoner.symbols`.

==============================  ================================================================
PDDL                            planning problem
==============================  ================================================================
type                            class, e.g. ``Truck``
predicate that never changes    class (one argument), static relation (more)
predicates of which at most     one functional situation type, e.g. ``AT`` for ``at`` and ``in``;
one holds of an object          with an extra value for "none of them holds"
any other predicate             boolean situation type
derived predicate               boolean situation type with rules
``sometime``, ``at-most-once``  remembered situation types, with a goal or a constraint
action                          behaviour on level 1, all of whose variables are parameters
cost that depends on objects    price of the behaviour
function that never changes     static relation, whose last argument is the number
any other function              situation type whose values are amounts, unless it only counts cost
(soft) goal that isn't a fact   boolean situation type ``GOAL_REACHED`` with a rule
==============================  ================================================================

Invariant synthesis finds mutually exclusive predicates. At most one of several mutually exclusive predicates holds for an object
initially. An action that adds one of these predicates for an object deletes another one. Helmert, "Concise finite-domain
representations for PDDL planning tasks", Artificial Intelligence 173 (2009), section 5, without its search for inequalities.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import cached_property, reduce
from itertools import product

from confab.reasoner.amounts import Amount, Calculation, Expression, Measure, Quantity, bounds_written, written
from confab.reasoner.closure import closure
from confab.reasoner.derivation import circles, circular, needed
from confab.reasoner.pddl.declarations import COMPARISONS, Axiom, Pddl, Typed
from confab.reasoner.pddl.forms import (
    Atom,
    NumericEffect,
    PddlEffect,
    atoms_in,
    conjuncts,
    effects_of,
    functions_read,
    numeric_of,
    spread,
    typed_in,
    words_in,
    words_of,
)
from confab.reasoner.pddl.invariants import InvariantPart, Invariants
from confab.reasoner.pddl.timing import QuantifiedVariables, happenings, snapped, timing
from confab.reasoner.pddl.words import Form, PddlError, PddlWord, is_number
from confab.reasoner.problem import Domain, Problem
from confab.reasoner.symbols import (
    FALSE,
    TRUE,
    AmountEffect,
    AnyOf,
    Behavior,
    ClassCondition,
    Comparison,
    Condition,
    Constraint,
    EqualityCondition,
    Parameter,
    RelationCondition,
    Rule,
    SituationType,
    Symbol,
    Timing,
    ValueCondition,
    ValueEffect,
    Witness,
)
from confab.reasoner.timing import projected

THING = "Thing"
"""The class of all objects, PDDL's ``object``."""
WORLD, THE_WORLD = "World", "the_world"
"""A class with a single individual, which is the argument of situation types for predicates without arguments."""
BASE = "https://w3id.org/confab/pddl/"


@dataclass(frozen=True)
class PredicateTranslation:
    """The translation of a predicate: its situation type, the positions of the object and the value, and possibly a fixed value.

    A predicate has a fixed value if none of its arguments is the value.
    """

    situation: str
    part: InvariantPart | None = None
    value: str = TRUE


@dataclass(frozen=True)
class Imported:
    """A planning problem, and the PDDL name of each behaviour and individual (`said`)."""

    problem: Problem
    said: Mapping[str, str]

    def line(self, behavior: str, arguments: Sequence[str]) -> str:
        """Return a step in PDDL's notation of plans."""
        return " ".join(self.said.get(word, word) for word in (behavior, *arguments))


def imported(pddl: Pddl, scene: str | None = None, level: int = 1) -> Imported:
    """Return the planning problem that a PDDL domain and problem describe.

    Parameters
    ----------
    pddl : Pddl
    scene : str, optional
        The last part of the scene's IRI; by default, the name of the PDDL problem.
    level : int
        The level of all behaviours. The default 1 is the most abstract level, so that less abstract behaviours can be added on
        further levels.
    """
    table = _Import(pddl, scene or pddl.problem, level)
    problem = table.problem()
    return Imported(problem, {ours: theirs for (_, theirs), ours in table.names.items()})


@dataclass
class _Import:
    pddl: Pddl
    scene: str
    level: int
    names: dict[tuple[str, str], str] = field(default_factory=dict)  # the problem's name, by kind and PDDL name
    taken: set[str] = field(
        default_factory=lambda: {TRUE, FALSE, "Truth", "Object", "Hand", "Robot", "task", WORLD, THE_WORLD}
    )
    places: dict[str, PredicateTranslation] = field(default_factory=dict)
    variables: dict[str, str] = field(default_factory=dict)  # the PDDL name, by the problem's name

    def __post_init__(self) -> None:
        self.effects = {name: tuple(effects_of(action.effect)) for name, action in self.pddl.actions.items()}
        self.numeric = {name: tuple(numeric_of(action.effect)) for name, action in self.pddl.actions.items()}
        forms = [f for a in self.pddl.actions.values() for f in (a.precondition, a.effect)]
        forms += [axiom.condition for axiom in self.pddl.axioms]
        durations = [a.durative.duration for a in self.pddl.actions.values() if a.durative is not None]
        forms += [Form((one,), 0, 0) for one in durations]
        wanted = [self.pddl.goal, *self.pddl.preferences.values()]
        read = {word for form in (*forms, *wanted) for word in functions_read(form)}
        changed = {effect.function.head for effects in self.numeric.values() for effect in effects}
        self.weights = {"total-cost": Fraction(1)} if self.pddl.metric is None else self.pddl.metric
        self.amounts = changed & (read | (changed - self.weights.keys() - {"total-cost"}))
        counted = [e.amount for effects in self.numeric.values() for e in effects]
        conditions = [a.precondition for a in self.pddl.actions.values()]
        conditions += [axiom.condition for axiom in self.pddl.axioms]
        whens = [f for effects in self.numeric.values() for e in effects for f in e.when]
        whens += [f for effects in self.effects.values() for e in effects for f in e.when]
        asked = [*wanted, *conditions, *whens, *(a for a in (*counted, *durations) if isinstance(a, Form))]
        heads = {form.head for form in asked if form} | {word for form in asked for word in functions_read(form)}
        self.measures = (heads & self.pddl.functions.keys()) - self.amounts
        self.derived = {axiom.predicate for axiom in self.pddl.axioms}
        self.changing = {effect.atom[0] for effects in self.effects.values() for effect in effects} | self.derived
        self.happening = {atom[0] for _, atom, _ in self.pddl.timed}
        self.changing |= self.happening | self.pddl.remembers.keys()
        self.sets = {kind: frozenset(self.pddl.of_type(kind)) for kind in self.pddl.types}
        self.facts = dict.fromkeys(self.pddl.initial)
        self.axioms = [*self.pddl.axioms]

    # -------------------------------------------------------------------------------------------------- names

    def name(self, kind: str, pddl_name: str, wanted: str | None = None) -> str:
        """Return the problem's name for a PDDL name of the given kind; different PDDL names have different names in the problem."""
        if (kind, pddl_name) not in self.names:
            text = re.sub(r"[^0-9A-Za-z_]", "_", wanted or pddl_name)
            while text in self.taken:
                text += "_"
            self.taken.add(text)
            self.names[kind, pddl_name] = text
        return self.names[kind, pddl_name]

    def kind(self, pddl_type: str) -> str:
        if pddl_type == "object":
            return self.name("type", "object", THING)
        return self.name("type", pddl_type, pddl_type[0].upper() + pddl_type[1:])

    def term(self, word: str) -> str:
        if not word.startswith("?"):
            return self.name("object", word)
        text = re.sub(r"[^0-9a-z_]", "_", word)[1:]
        while self.variables.setdefault(f"?{text}", word) != word:  # the words ?a-1 and ?a_1 give the same text
            text += "_"
        return f"?{text}"

    # ------------------------------------------------------------------------------------------------ problem

    def problem(self) -> Problem:
        pddl = self.pddl
        for kind in pddl.types:
            self.kind(kind)
        for thing in pddl.objects:
            self.name("object", thing)
        classes: dict[str, tuple[str, ...]] = {
            self.kind(kind): tuple(self.name("object", o) for o in pddl.of_type(kind)) for kind in pddl.types
        }
        parents: dict[str, tuple[str, ...]] = {
            self.kind(kind): tuple(map(self.kind, above)) for kind, above in pddl.types.items() if above
        }
        relations: dict[str, frozenset[tuple[str, ...]]] = {}
        for predicate, signature in pddl.predicates.items():
            if predicate in self.changing or not signature:
                continue
            rows = [tuple(self.name("object", w) for w in fact[1:]) for fact in self.facts if fact[0] == predicate]
            if len(signature) == 1:
                kind = self.name("static", predicate, predicate[0].upper() + predicate[1:])
                members = {row[0] for row in rows}
                classes[kind] = tuple(name for name in classes[self.kind("object")] if name in members)
                parents[kind] = (self.kind("object"),)
            else:
                relations[self.name("static", predicate)] = frozenset(rows)
        for function in sorted(self.measures):
            numbers = {words[1:]: n for words, n in pddl.numbers.items() if words[0] == function}
            measured = {(*(self.name("object", w) for w in words), written(n)) for words, n in numbers.items()}
            relations[self.name("static", f"({function})", function)] = frozenset(measured)
        situations = self.situations(classes, parents)
        behaviors = {b.name: b for b in map(self.behavior, pddl.actions) if b is not None}
        initial = self.initial(situations, classes)
        goal = self.goal(situations)
        weights = self.preferences(situations, goal)
        events, all_happened, times = happenings(self, _Variables(self), situations, classes)
        behaviors |= {event.name: event for event in events}
        goal |= all_happened
        if not goal:  # a task needs a goal
            goal[self.defined("goal reached", (), situations)] = TRUE
        rules = self.rules()
        if any(s.arguments == (WORLD,) for s in situations.values()):
            classes[WORLD] = (THE_WORLD,)
        scene = f"{BASE}{_slug(pddl.domain)}/{_slug(self.scene)}"
        never = [Constraint(self.places[predicate].situation) for predicate in pddl.forbidden]
        constraints = {f"{one.situation}.exceptions": one for one in never}
        named = {predicate: place.situation for predicate, place in self.places.items()}
        remembers = {named[one]: named[other] for one, other in pddl.remembers.items()}
        domain = Domain(situations, behaviors, rules=rules, constraints=constraints, remembers=remembers)
        return Problem(scene, domain, classes, relations, initial, goal, parents, times=times, weights=weights)

    def rules(self) -> dict[str, tuple[Rule, ...]]:
        """Return the rules of each derived predicate.

        Raises
        ------
        PddlError
            The value of a derived predicate depends on its own negation.
        """
        found: dict[str, tuple[Rule, ...]] = {}
        for axiom in self.axioms:
            name, variables = self.places[axiom.predicate].situation, _Variables(self)
            parameters = [Parameter(self.term(p.name), self.kind(p.type)) for p in axiom.parameters]
            conditions = self.simplified(c for form in conjuncts(axiom.condition) for c in variables.condition(form))
            head = tuple(parameters) or (Parameter("?the_world", WORLD),)
            its = () if conditions is None else (Rule(name, head, (), tuple(dict.fromkeys(conditions))),)
            found[name] = (*found.get(name, ()), *its)
        said = {ours: theirs for (_, theirs), ours in self.names.items()}
        for one, other in circles(found):
            raise PddlError(
                f"'{said[one]}' is derived from (not ({said[other]} …)), which is derived from it in turn; "
                "no planner can tell which of the two holds"
            )
        constrained = [self.places[one].situation for one in (*self.pddl.forbidden, *self.pddl.remembers.values())]
        read = closure(constrained, lambda one: {s for rule in found.get(one, ()) for s, _ in needed(rule.conditions)})
        for name in sorted(read & circular(found)):
            raise PddlError(f"'{said[name]}' is derived from itself; (:constraints …) can't use such a predicate")
        return found

    def situations(
        self, classes: dict[str, tuple[str, ...]], parents: dict[str, tuple[str, ...]]
    ) -> dict[str, SituationType]:
        """Return all situation types, first the types of invariants, and store the translation of each predicate in `places`."""
        found: dict[str, SituationType] = {}
        candidates = frozenset(self.changing - self.derived - self.happening - self.pddl.remembers.keys())
        pddl, effects = snapped(self.pddl, self.effects)
        for parts in Invariants(pddl, effects, candidates, frozenset(self.changing), self.sets).found():
            name = self.name("situation", "+".join(p.predicate for p in parts), parts[0].predicate.upper())
            own = []
            for part in parts:
                if part.counted is None:
                    value = self.name("value", part.predicate, f"{part.predicate}_")
                    own.append(value)
                    self.places[part.predicate] = PredicateTranslation(name, part, value)
                else:
                    kind = self.kind(self.signatures[part.predicate][part.counted])
                    parents[kind] = (*parents.get(kind, ()), name)
                    self.places[part.predicate] = PredicateTranslation(name, part)
            none = self.name("value", name, f"no_{parts[0].predicate}")
            own.append(none)
            classes[name] = tuple(own)
            key = self.common([self.signatures[p.predicate][p.key] for p in parts])
            found[name] = SituationType(name, (self.kind(key),), name, default=none)
        for kind, above in parents.items():  # the values of a situation type form a class
            for name in above:
                if name in found:
                    classes[name] = tuple(dict.fromkeys((*classes[kind], *classes[name])))
        order = {self.name("object", thing): i for i, thing in enumerate(self.pddl.objects)}
        for name in found:  # declared objects in their order, then other values
            classes[name] = tuple(sorted(classes[name], key=lambda member: order.get(member, len(order))))
        for predicate, signature in self.signatures.items():
            if predicate in self.places or (predicate not in self.changing and signature):
                continue
            name = self.name("situation", predicate, predicate.upper())
            arguments = tuple(map(self.kind, signature)) or (WORLD,)
            found[name] = SituationType(name, arguments, "Truth", default=FALSE, boolean=True)
            self.places[predicate] = PredicateTranslation(name)
        for function in sorted(self.amounts):
            self.check_numbers(function)
            arguments = tuple(self.kind(one.type) for one in self.pddl.functions[function]) or (WORLD,)
            name = self.name("situation", f"({function})", function.upper())
            found[name] = SituationType(name, arguments, name, quantity=Quantity())
        return found

    def common(self, kinds: Sequence[str]) -> str:
        """Return the lowest common supertype of some types."""
        return next(kind for kind in self.pddl.above(kinds[0]) if all(kind in self.pddl.above(k) for k in kinds))

    def initial(
        self, situations: Mapping[str, SituationType], classes: Mapping[str, tuple[str, ...]]
    ) -> dict[Symbol, str]:
        found = {
            Symbol(s.name, (name,)): s.default or FALSE
            for s in situations.values()
            if not s.boolean and s.quantity is None
            for name in classes[s.arguments[0]]
        }
        for words, number in self.pddl.numbers.items():
            if words[0] in self.amounts:
                terms = tuple(self.name("object", w) for w in words[1:]) or (THE_WORLD,)
                found[Symbol(self.name("situation", f"({words[0]})"), terms)] = written(number)
        for fact in self.facts:
            if fact[0] in self.places:
                condition = self.atom(fact)
                found[Symbol(condition.situation, condition.arguments)] = condition.value
        return found

    def goal(self, situations: dict[str, SituationType]) -> dict[Symbol, str]:
        """Return the goal as values of symbols.

        If some conjuncts of the PDDL goal aren't facts, all these conjuncts together become the situation type ``GOAL_REACHED``
        with a rule.
        """
        found: dict[Symbol, str] = {}
        parts = [one for part in conjuncts(self.pddl.goal) for one in spread(part, self.pddl.of_type, self.holds)]
        left = [one for one in parts if not self.plain(one, situations, found)]
        if left:
            found[self.defined("goal reached", left, situations)] = TRUE
        return found

    def defined(self, name: str, conditions: Sequence[Form], situations: dict[str, SituationType]) -> Symbol:
        """Add a situation type with a rule for the conjunction of some conditions; return its only symbol."""
        its = self.name("situation", name, re.sub(r"\W", "_", name.upper()))
        situations[its] = SituationType(its, (WORLD,), "Truth", default=FALSE, boolean=True)
        self.places[name] = PredicateTranslation(its)
        self.axioms.append(Axiom(name, (), Form((PddlWord("and", 0, 0), *conditions), 0, 0)))
        return Symbol(its, (THE_WORLD,))

    def preferences(self, situations: dict[str, SituationType], goal: dict[Symbol, str]) -> dict[Symbol, Fraction]:
        """Add the soft goals to the goal, and return their weights in the metric. A soft goal without a weight is omitted.

        A soft goal that isn't a fact, or whose symbol has another goal, becomes a situation type with a rule.
        """
        found: dict[Symbol, Fraction] = {}
        for name, form in self.pddl.preferences.items():
            weight, fact = self.weights.get(f"is-violated {name}"), dict[Symbol, str]()
            if weight is None:
                continue
            parts = list(conjuncts(form))
            if len(parts) != 1 or not self.plain(parts[0], situations, fact) or fact.keys() & goal.keys():
                fact = {self.defined(f"preference {name}", parts, situations): TRUE}
            goal |= fact
            found |= dict.fromkeys(fact, weight)
        return found

    def holds(self, atom: Atom) -> bool | None:
        """Return whether an atom of a static predicate holds; None if actions can change the atom."""
        if atom[0] == "=":
            return atom[1] == atom[2]
        known = atom[0] in self.pddl.predicates and atom[0] not in self.changing
        return atom in self.facts if known else None

    def plain(self, part: Form, situations: Mapping[str, SituationType], found: dict[Symbol, str]) -> bool:
        """Return whether a conjunct of the goal is equivalent to a fact; if so, add the fact to `found`.

        Facts include negated atoms of boolean situation types, and comparisons of a changing function with a number. A conjunct
        that contradicts an earlier fact isn't added.
        """
        if part.head in COMPARISONS and part.items[1:] and isinstance(part.items[1], Form):
            function, limit = part.items[1:]
            if not isinstance(function, Form) or function.head not in self.amounts or not isinstance(limit, PddlWord):
                return False
            terms = tuple(self.term(w) for w in words_of(function)[1:]) or (THE_WORLD,)
            symbol = Symbol(self.name("situation", f"({function.head})"), terms)
            wanted = f"{part.head}{written(Fraction(limit.text))}"
            found[symbol] = bounds_written(f"{found[symbol]},{wanted}" if symbol in found else wanted)
            return True
        inner = part.items[1] if part.head == "not" else part
        if not isinstance(inner, Form) or inner.head not in self.places:
            return False
        condition = self.atom(words_of(inner))
        if part.head == "not" and not situations[condition.situation].boolean:
            return False
        value = FALSE if part.head == "not" else condition.value
        return found.setdefault(Symbol(condition.situation, condition.arguments), value) == value

    @cached_property
    def signatures(self) -> dict[str, list[str]]:
        """The types of each predicate's arguments.

        The type of an argument is the lowest common supertype of the declared type and of all variables that occur as this
        argument.
        """
        found = {name: [one.type for one in signature] for name, signature in self.pddl.predicates.items()}
        parts = [(action.parameters, (action.precondition, action.effect)) for action in self.pddl.actions.values()]
        parts += [(axiom.parameters, (axiom.condition, None)) for axiom in self.pddl.axioms]
        for parameters, forms in parts:
            types = {p.name: p.type for p in parameters}
            for form in forms:
                for atom, own in atoms_in(form, self.pddl.predicates, types) if form else ():
                    kinds = found[atom[0]]
                    for position, term in enumerate(atom[1:]):
                        if term in own:
                            kinds[position] = self.common([kinds[position], own[term]])
        return found

    # ---------------------------------------------------------------------------------------------- behaviours

    def atom(self, atom: Atom) -> ValueCondition:
        """Return the value condition that is equivalent to an atom of a changing predicate."""
        place, terms = self.places[atom[0]], [self.term(t) for t in atom[1:]]
        if place.part is None:
            return ValueCondition(place.situation, tuple(terms) or (THE_WORLD,), TRUE)
        value = place.value if place.part.counted is None else terms[place.part.counted]
        return ValueCondition(place.situation, (terms[place.part.key],), value)

    def simplified(self, conditions: Iterable[Condition]) -> tuple[Condition, ...] | None:
        """Return a conjunction without the conjuncts that always hold; return None if the conjunction never holds."""
        found: list[Condition] = []
        for condition in conditions:
            holds: bool | None = None
            match condition:
                case AnyOf(alternatives, negated):
                    groups = [group for group in map(self.simplified, alternatives) if group is not None]
                    holds = True if () in groups else None if groups else False
                    condition = AnyOf(tuple(groups), negated)
                case Witness(_, kind, conditions_inside, negated):
                    group = self.simplified(conditions_inside)
                    holds = False if group is None else None if group else self.inhabited(kind)
                    condition = replace(condition, conditions=group or ())
                case EqualityCondition(left, right, negated):
                    constant = not left.startswith("?") and not right.startswith("?")
                    holds = True if left == right else False if constant else None
                case ValueCondition() | RelationCondition() | ClassCondition() | Comparison():
                    negated = False
            if holds is None:
                found.append(condition)
            elif holds is negated:
                return None
        return None if any(replace(one, negated=not one.negated) in found for one in found) else tuple(found)

    def inhabited(self, kind: str) -> bool:
        """Return whether the class of a type has an individual."""
        return any(self.sets[theirs] for (of, theirs), ours in self.names.items() if of == "type" and ours == kind)

    def behavior(self, name: str) -> Behavior | None:
        """Return the behaviour for an action; return None if the action is never applicable."""
        action, variables = self.pddl.actions[name], _Variables(self)
        parameters = tuple(Parameter(self.term(p.name), self.kind(p.type)) for p in action.parameters)
        lies: Timing | None = None
        if action.durative is None:
            found = self.simplified(c for form in conjuncts(action.precondition) for c in variables.condition(form))
            if found is None:
                return None
            conditions = tuple(dict.fromkeys(found))
            effects = self.value_effects(self.effects[name], variables, conditions)
            amounts = self.amount_effects(self.numeric[name], variables, conditions)
        else:
            lies = timing(self, action.durative, variables)
            if lies is None:
                return None
            conditions, made = projected(lies.conditions, lies.effects)
            effects = tuple(one for one in made if isinstance(one, ValueEffect))
            amounts = tuple(one for one in made if isinstance(one, AmountEffect))
        used = {word for atom in words_in(action.precondition, action.effect) for word in atom}
        unused = [p for p in action.parameters if p.name not in used]
        conditions += tuple(ClassCondition(self.term(p.name), self.kind(p.type)) for p in unused)
        named = self.name("action", name, name.upper())
        if lies is not None and lies.duration is not None and not isinstance(lies.duration, Fraction):
            conditions = (*conditions, Comparison(lies.duration, ">=", Fraction(0)))
        behavior = Behavior(named, self.level, parameters, (), conditions, effects, amounts=amounts, timing=lies)
        price = self.price(name)
        if not price and self.pddl.metric is None:
            price = Fraction(1)
        if isinstance(price, Fraction):
            if price < 0:
                raise PddlError(f"action '{name}': its cost is {written(price)}; costs below 0 are not supported")
            return replace(behavior, cost=float(price))
        return replace(behavior, price=price, preconditions=(*conditions, Comparison(price, ">=", Fraction(0))))

    def price(self, name: str) -> Expression:
        """Return the cost of an action: the weighted sum of the increases of functions in the metric."""
        found: Expression = Fraction(0)
        for effect in self.numeric[name]:
            weight = self.weights.get(effect.function.head)
            if weight is None or effect.when or effect.head not in ("increase", "decrease"):
                continue
            factor = weight if effect.head == "increase" else -weight
            for named in self.instances(effect):
                one = self.number(effect.amount, named)
                one = (
                    one * factor if isinstance(one, Fraction) else one if factor == 1 else Calculation("*", factor, one)
                )
                if isinstance(one, Fraction) and isinstance(found, Fraction):
                    found += one
                else:
                    found = Calculation("+", found, one) if found else one
        return found

    def number(self, item: PddlWord | Form, named: Mapping[str, str]) -> Expression:
        """Return the translation of a number, a function or an arithmetic expression."""
        if isinstance(item, PddlWord):
            return Fraction(item.text)
        if item.head in ("+", "-", "*", "/"):
            parts = [self.number(one, named) for one in item.items[1:]]
            if len(parts) == 1:
                parts.insert(0, Fraction(0))
            return reduce(lambda left, right: Calculation(item.head, left, right), parts)
        terms = tuple(named.get(t, t) for t in map(self.term, words_of(item)[1:]))
        if item.head in self.amounts:
            return Amount(self.name("situation", f"({item.head})"), terms or (THE_WORLD,))
        return Measure(self.name("static", f"({item.head})"), terms)

    def amount_effects(
        self,
        effects: Sequence[NumericEffect],
        variables: QuantifiedVariables,
        conditions: Sequence[Condition],
    ) -> tuple[AmountEffect, ...]:
        """Return the effects of an action on amounts, one for each binding of quantified variables."""
        found = []
        for effect in effects:
            if effect.function.head not in self.amounts:
                continue
            for named in self.instances(effect):
                when = self.simplified(
                    c for form in effect.when for part in conjuncts(form) for c in variables.condition(part, named)
                )
                if when is None or self.simplified((*conditions, *when)) is None:
                    continue
                at, by = self.number(effect.function, named), self.number(effect.amount, named)
                assert isinstance(at, Amount)
                if effect.head == "scale-down":
                    by = Calculation("/", Fraction(1), by)
                operation = effect.head.split("-")[0]
                found.append(AmountEffect(at.situation, at.arguments, operation, by, when))
        return tuple(found)

    def check_numbers(self, function: str) -> None:
        """Raise an error if a changing function has no initial number for some objects of its arguments' types."""
        things = (self.pddl.of_type(one.type) for one in self.pddl.functions[function])
        for row in product(*things):
            if (function, *row) not in self.pddl.numbers:
                raise PddlError(
                    f"({' '.join((function, *row))}) has no number in :init, but actions change '{function}'; state its number, "
                    f"or declare '{function}' for a type whose objects all have one"
                )

    def value_effects(
        self, effects: Sequence[PddlEffect], variables: QuantifiedVariables, conditions: Sequence[Condition]
    ) -> tuple[ValueEffect, ...]:
        """Return the effects of an action on values.

        Effects that take a value from a symbol come before effects that give a value.
        """
        ends: list[ValueEffect] = []
        begins: list[ValueEffect] = []
        for effect, named in ((e, n) for e in effects for n in self.instances(e)):
            when = self.simplified(
                c for form in effect.when for part in conjuncts(form) for c in variables.condition(part, named)
            )
            if when is None or self.simplified((*conditions, *when)) is None:
                continue
            at = self.atom(effect.atom)
            put = tuple(named.get(a, a) for a in (*at.arguments, at.value))
            at = replace(at, arguments=put[:-1], value=put[-1])
            place = self.places[effect.atom[0]]
            if effect.true:
                begins.append(ValueEffect(at.situation, at.arguments, at.value, when))
            elif place.part is None:
                ends.append(ValueEffect(at.situation, at.arguments, FALSE, when))
            elif not self.replaced(effect, effects):
                known = at in conditions or at in when
                none = self.names["value", place.situation]
                ends.append(ValueEffect(at.situation, at.arguments, none, when if known else (*when, at)))
        return tuple(dict.fromkeys((*ends, *begins)))

    def instances(self, effect: PddlEffect | NumericEffect) -> Iterator[dict[str, str]]:
        """Yield all bindings of an effect's quantified variables to objects."""
        names = [self.term(v.name) for v in effect.variables]
        things = [[self.name("object", o) for o in self.pddl.of_type(v.type)] for v in effect.variables]
        yield from (dict(zip(names, row, strict=True)) for row in product(*things))

    def replaced(self, end: PddlEffect, effects: Sequence[PddlEffect]) -> bool:
        """Return whether an effect that takes a value from a symbol is redundant, because another effect gives a new value."""
        symbol = replace(self.atom(end.atom), value="")
        return any(
            e.true and e.atom[0] in self.places and replace(self.atom(e.atom), value="") == symbol
            and e.when in ((), end.when) and e.variables in ((), end.variables)
            for e in effects
        )  # fmt: skip


@dataclass
class _Variables:
    """The quantified variables of one behaviour, each renamed to a unique name."""

    table: _Import
    kinds: dict[str, str] = field(default_factory=dict)

    def renamed(self, typed: Sequence[Typed]) -> dict[str, str]:
        found = {}
        for one in typed:
            name = f"?w_{self.table.term(one.name)[1:]}"
            while name in self.kinds or name in self.table.variables:
                name += "_"
            self.kinds[name] = self.table.kind(one.type)
            found[self.table.term(one.name)] = name
        return found

    def condition(
        self, form: Form, named: Mapping[str, str] | None = None, negated: bool = False
    ) -> Iterator[Condition]:
        """Yield conditions whose conjunction is equivalent to a PDDL formula, or to its negation if `negated`."""
        named = named or {}
        head, rest = form.head, [item for item in form.items[1:] if isinstance(item, Form)]
        if head == "not":
            yield from self.condition(rest[0], named, not negated)
        elif head == "and" and not negated:
            for part in rest:
                yield from self.condition(part, named)
        elif head == "and":
            yield AnyOf((tuple(c for part in rest for c in self.condition(part, named)),), True)
        elif head in ("or", "imply"):
            groups = [tuple(self.condition(part, named, head == "imply" and i == 0)) for i, part in enumerate(rest)]
            yield AnyOf(tuple(groups), negated)
        elif head in ("exists", "forall"):
            typed = typed_in(form.items[1])  # type: ignore[arg-type]
            inner = dict(named) | self.renamed(typed)
            flip = head == "forall"
            parts = [rest[1]] if flip else list(conjuncts(rest[1]))
            pieces = [({w for ws in words_in(p) for w in ws}, tuple(self.condition(p, inner, flip))) for p in parts]
            found = self.nested(pieces, {t.name: t for t in typed}, inner)
            if negated is flip:
                yield from found
            elif len(found) == 1:
                yield replace(found[0], negated=not found[0].negated)
            else:
                yield AnyOf((found,), True)
        elif head in COMPARISONS and (head != "=" or rest or any(is_number(item) for item in form.items[1:])):
            left, right = (self.table.number(item, named) for item in form.items[1:])
            yield Comparison(left, head, right, negated)
        else:
            yield from self.literal(words_of(form), named, negated)

    def nested(
        self, pieces: list[tuple[set[str], tuple[Condition, ...]]], typed: dict[str, Typed], named: Mapping[str, str]
    ) -> tuple[Condition, ...]:
        """Return conditions that are true if some individuals satisfy all conjuncts in `pieces`.

        Each existential quantifier is moved as far inward as possible. As a result, a search for "a car and a place such that …"
        enumerates pairs only if a conjunct mentions both variables.
        """
        left = dict(typed)
        while left:
            met = {name: set().union(*(words for words, _ in pieces if name in words)) for name in left}
            name = min(left, key=lambda name: len(met[name] & left.keys()))
            one = left.pop(name)
            inside = tuple(c for words, found in pieces if name in words for c in found)
            witness = Witness(named[self.table.term(name)], self.table.kind(one.type), inside)
            pieces = [piece for piece in pieces if name not in piece[0]] + [(met[name] - {name}, (witness,))]
        return tuple(c for _, found in pieces for c in found)

    def literal(self, atom: Atom, named: Mapping[str, str], negated: bool) -> Iterator[Condition]:
        table = self.table

        def put(terms: Sequence[str]) -> tuple[str, ...]:
            return tuple(named.get(t, t) for t in terms)

        if atom[0] == "=":
            yield EqualityCondition(put([table.term(atom[1])])[0], put([table.term(atom[2])])[0], negated)
        elif atom[0] in table.places:
            at = table.atom(atom)
            yield ValueCondition(at.situation, put(at.arguments), put([at.value])[0], negated)
        elif len(atom) == 2:
            yield ClassCondition(put([table.term(atom[1])])[0], table.names["static", atom[0]], negated)
        else:
            relation = table.names["static", atom[0]]
            yield RelationCondition(relation, put([table.term(t) for t in atom[1:]]), negated)


def _slug(text: str) -> str:
    return re.sub(r"[^0-9A-Za-z_.-]", "-", text)
