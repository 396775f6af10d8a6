"""Why a fact can't be reached, in the ontology's terms: which behaviour could bring it about, and what that one lacks.

A behaviour's conditions, with the goal's individuals put in, can't all hold; of them as many are dropped as can be while this
stays so, those that change first: what is left is the reason. A fact among it that can't be reached has a reason of its own.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from planner.grounded.reachability import Reached
from planner.grounded.schemas import Atom, Schema, schemas
from planner.grounded.task import Task
from planner.plan import Reason, TooLargeError
from reasoner.language import is_variable
from reasoner.sentences import said
from reasoner.symbols import (
    TRUE,
    Behavior,
    Condition,
    EqualityCondition,
    Fact,
    Parameter,
    Symbol,
    ValueEffect,
    Witness,
    substituted,
)

DEPTH, MOST_ROWS = 6, 1_000_000
"""So many steps back it is asked why something can't be, in joins of at most so many rows."""
ONE = "?one"
"""Who is counted."""
WORDS = ("none", "one", "two", "three", "four", "five")


def unreachable(reached: Reached, goal: Fact) -> Reason:
    """Return why a goal is not reachable even if nothing ever becomes false."""
    because, terms = _because(reached, goal, frozenset())
    return Reason(f"{goal} can't be reached: {because}", tuple(dict.fromkeys((*_words(goal), *terms))))


def blocked(task: Task) -> Reason:
    """Return why no plan exists where the goal isn't reachable even if nothing ever becomes false, negated facts included."""
    reached = task.initial
    ways = [
        (sum(1 << bit for bit in need), add) for need, add in zip(task.needs.lists(), task.adds.lists(), strict=True)
    ]
    before = -1
    while before != reached:
        before = reached
        for need, add in ways:
            if reached & need == need:
                for bit in add:
                    reached |= 1 << bit
    wanted, seen = task.goal & ~reached, set()
    chain: list[str] = []
    terms: list[str] = []
    while wanted and len(chain) <= DEPTH:
        bit = (wanted & -wanted).bit_length() - 1
        fact = task.facts[bit] if bit < len(task.facts) else task.complements.get(bit)
        if fact is not None:
            chain.append(str(fact) if bit < len(task.facts) else f"the end of {fact}")
            terms += _words(fact)
        seen.add(bit)
        missing = [need & ~reached for need, add in ways if bit in add]
        wanted = min(missing, key=int.bit_count, default=0)
        if any(wanted >> other & 1 for other in seen):
            break
    because = "".join(f", which needs {what}" for what in chain[1:])
    return Reason(f"{chain[0] if chain else 'the goal'} can't be reached{because}", tuple(dict.fromkeys(terms)))


def _words(fact: Fact) -> tuple[str, ...]:
    return (*fact.symbol.arguments, fact.symbol.situation, fact.value)


def _because(
    reached: Reached, goal: Fact, above: frozenset[Fact], kinds: Mapping[str, str] = {}
) -> tuple[str, tuple[str, ...]]:
    """Return the reason as half a sentence, and the terms that it names; the variables of the goal are of some kinds."""
    name = goal.symbol.situation
    situation = reached.situations.get(name)
    whole = not any(word.startswith("?") for word in _words(goal))
    if situation is None or (whole and not situation.boolean and goal.symbol not in reached.initial):
        return f"there is no {goal.symbol} on level {reached.level}", ()
    if whole and (few := _too_few(reached, goal.symbol)):
        return few
    found = []
    for schema in reached.schemas:
        for _, effect in schema.effects:
            if effect.situation != name:
                continue
            single = _single(reached, schema, effect, goal)
            if single is None:
                continue
            schema, effect = _opened(reached, single[0]), single[1]
            terms = _unified(
                reached, schema, (*effect.arguments, effect.value), (*goal.symbol.arguments, goal.value), kinds
            )
            if terms is not None:
                found.append((schema, _core(reached, schema, terms)))
    if not found:
        return f"no behaviour of level {reached.level} makes it so", ()
    schema, core = min(found, key=lambda pair: (len(pair[1]), sum(atom.fluent for atom in pair[1])))
    could = f"{schema.behavior.name} could make it so, but"
    if not core:
        return f"{could} its conditions exclude one another", (schema.behavior.name,)
    text = f"{could} {_said(schema, core)}"
    words = tuple(t for atom in core for t in (atom.table[1], *atom.terms) if not t.startswith("?"))
    if len(core) == 1 and core[0].fluent and len(above) < DEPTH:
        deeper = _fact(reached, core[0])
        if deeper not in above | {goal}:
            more, others = _because(reached, deeper, above | {goal}, schema.kinds)
            return f"{text}: {more}", (schema.behavior.name, *words, *others)
    return text, (schema.behavior.name, *words)


def _too_few(reached: Reached, goal: Symbol) -> tuple[str, tuple[str, ...]] | None:
    """Return how many a rule of a goal asks for and how many there can be, where these are fewer."""
    for rule in reached.problem.domain.rules.get(goal.situation, ()):
        names = dict(zip((parameter.name for parameter in rule.parameters), goal.arguments, strict=True))
        for condition in rule.conditions:
            many, kind, own = _counted(substituted(condition, names))
            if many < 2:
                continue
            one = Behavior("", reached.level, (Parameter(ONE, kind),), rule.variables, own, ())
            (schema,) = schemas(one, reached.situations, reached.changed, reached.problem.members)
            try:
                there = {row[0] for rows in reached.joined(schema) for row in rows.tolist()}
            except TooLargeError:
                continue
            if len(there) < many:
                each = " and ".join(said(substituted(c, {ONE: "each"})) for c in own)
                what = f"{goal.situation} asks for {WORDS[many]} {kind}, {each}; there can be {WORDS[len(there)]}"
                return what, (goal.situation, kind)
    return None


def _counted(condition: Condition | None) -> tuple[int, str, tuple[Condition, ...]]:
    """Return how many individuals of a class a condition asks for, each told apart from the others, and what of each."""
    before: list[str] = []
    found: tuple[str, tuple[Condition, ...]] = ("", ())
    while isinstance(condition, Witness) and not condition.negated and len(before) < len(WORDS) - 1:
        apart = {EqualityCondition(condition.variable, other, negated=True) for other in before}
        own = [c for c in condition.conditions if c not in apart]
        nested = own.pop() if own and isinstance(own[-1], Witness) and own[-1].kind == condition.kind else None
        one = condition.kind, tuple(substituted(c, {condition.variable: ONE}) for c in own)
        if before and (one != found or not apart <= {*condition.conditions}):
            break
        found = one
        before.append(condition.variable)
        condition = nested
    return len(before), *found


def _single(reached: Reached, schema: Schema, effect: ValueEffect, goal: Fact) -> tuple[Schema, ValueEffect] | None:
    """Return one of the effects that were made one, the first that could be the goal, with its own schema; None if none could."""
    table = next((atom for atom in schema.atoms if atom.table[1] in reached.together), None)
    if table is None:
        return schema, effect
    words = goal.symbol.arguments
    for row in sorted(reached.problem.relations[table.table[1]]):
        names = dict(zip(table.terms, row, strict=True))
        arguments = tuple(names.get(t, t) for t in effect.arguments)
        if all(is_variable(a) or is_variable(w) or a == w for a, w in zip(arguments, words, strict=True)):
            atoms = (replace(a, terms=tuple(names.get(t, t) for t in a.terms)) for a in schema.atoms if a is not table)
            own = tuple(a for a in atoms if a.table[0] != "class" or is_variable(a.terms[0]))
            return replace(schema, atoms=own), replace(effect, arguments=arguments)
    return None


def _opened(reached: Reached, schema: Schema) -> Schema:
    """Return a schema with what its rule says in the place of parts of the rule that have a name of their own."""
    atoms, kinds = list(schema.atoms), dict(schema.kinds)
    for atom in atoms:  # which grows
        if atom.table[1] in reached.made:
            part = next(s for s in reached.schemas if s.behavior.name == atom.table[1])
            names = dict(zip(part.effects[0][1].arguments, atom.terms, strict=True))
            names = {t: names.get(t, f"{t}/{len(atoms)}") for t in part.kinds}
            kinds |= {names[t]: kind for t, kind in part.kinds.items() if names[t] not in kinds}
            atoms += [replace(a, terms=tuple(names.get(t, t) for t in a.terms)) for a in part.atoms]
    own = tuple(atom for atom in atoms if atom.table[1] not in reached.made)
    return replace(schema, atoms=own, kinds=kinds)


def _unified(
    reached: Reached, schema: Schema, terms: Sequence[str], words: Sequence[str], kinds: Mapping[str, str]
) -> dict[str, str] | None:
    """Return what to put in for variables so that the terms become the words, or None; a word may be a variable of some kind."""
    found: dict[str, str] = {}
    for term, word in zip(terms, words, strict=True):
        if word.startswith("?"):
            could = reached.problem.members(schema.kinds[term]) if term.startswith("?") else {term}
            if word in kinds and reached.problem.members(kinds[word]).isdisjoint(could):
                return None
            continue
        if (found.setdefault(term, word) if term.startswith("?") else term) != word:
            return None
    classes = reached.problem.classes
    fits = all(word in classes.get(schema.kinds[term], ()) for term, word in found.items())
    return found if fits else None


def _core(reached: Reached, schema: Schema, terms: dict[str, str]) -> list[Atom]:
    """Return a smallest set of a schema's conditions that can't hold together with these individuals."""
    atoms = [replace(atom, terms=tuple(terms.get(t, t) for t in atom.terms)) for atom in schema.atoms]
    order = sorted(atoms, key=lambda atom: (atom.table[0] != "class", not atom.fluent))
    core = list(order)
    for atom in order:
        rest = [a for a in core if a is not atom]
        if not _satisfiable(reached, schema, rest):
            core = rest
    return core if not _satisfiable(reached, schema, core) else []


def _satisfiable(reached: Reached, schema: Schema, atoms: Sequence[Atom]) -> bool:
    trial = replace(schema, atoms=tuple(atoms), filters=(), terms=())
    most, reached.most = reached.most, MOST_ROWS
    try:
        return next(reached.joined(trial), None) is not None
    except TooLargeError:
        return True
    finally:
        reached.most = most


def _fact(reached: Reached, atom: Atom) -> Fact:
    name, boolean = atom.table[1], reached.situations[atom.table[1]].boolean
    arguments, value = (atom.terms, TRUE) if boolean else (atom.terms[:-1], atom.terms[-1])
    return Fact(Symbol(name, arguments), value)


def _said(schema: Schema, core: Sequence[Atom]) -> str:
    """Return what fails to hold, e.g. ``no Hand canReach location9``."""
    if len(core) == 1 and core[0].table[0] == "class":
        return f"{_term(schema, core[0].terms[0])} is no {core[0].table[1]}"
    if len(core) == 1 and len(core[0].terms) == 2 and not core[0].fluent:
        (left, right), relation = core[0].terms, core[0].table[1]
        if left.startswith("?"):
            return f"no {schema.kinds[left]} {relation} {_term(schema, right)}"
        if right.startswith("?"):
            return f"{left} {relation} no {schema.kinds[right]}"
        return f"{relation}({left}, {right}) doesn't hold"
    facts = " and ".join(f"{a.table[1]}({', '.join(_term(schema, t) for t in a.terms)})" for a in core)
    return f"{facts} can't be" if len(core) == 1 else f"nothing satisfies {facts}"


def _term(schema: Schema, term: str) -> str:
    return f"some {schema.kinds[term]}" if term.startswith("?") else term
