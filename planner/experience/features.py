"""What memory sees of a candidate: lifted facts, generated from the ontology's situation types and static relations.

role    an argument of the behaviour, or a variable that the state determines (what the hand holds)
path    a role, followed by up to three of these steps:
            ``S``        the value now            ``goal S``   the value that the task wants
            ``who S``    those that have it now   ``wants S``  those that shall have it and haven't yet
end     what a path leads to: an individual, none, or several

Of each end the facts are its class (or its name, where behaviours mention it), what the task wants of it, whether it is the
individual in a role, and how static relations tie it to a role. A value is always given, `none` included. The facts speak of
roles and classes and never of the size of the world, so that they hold of individuals never seen.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeAlias, cast

from planner.hierarchical.operators import Program, named
from planner.language import walk
from planner.transitions import Cell, Key, Table
from reasoner.memory.counts import Candidate, Conclusion, Pattern
from reasoner.symbols import (
    FALSE,
    TRUE,
    Behavior,
    ClassCondition,
    Problem,
    SituationType,
    ValueCondition,
    Witness,
)

NONE = "none"
DEPTH = 2  # steps of a path; one more to what static relations speak of
MOST = 6  # of several individuals at a path's end, so many are looked at
CROWD = 4  # classes with at most so many members are small enough to ask what the others do

Individuals: TypeAlias = "tuple[str, ...]"
Values: TypeAlias = "tuple[str, ...]"
Step: TypeAlias = "Callable[[Individuals], Individuals]"


@dataclass(frozen=True)
class End:
    """A path: its name, the end that it continues, the step from there, and what it can lead to."""

    name: str
    start: int
    step: tuple[str, str] | None
    members: frozenset[str]
    role: bool = False


@dataclass(frozen=True)
class Question:
    """A lifted fact to be read off: its name, its kind, the ends that it concerns, and a situation type or relation."""

    name: str
    kind: str
    ends: tuple[int, ...]
    of: str = ""


class Schema:
    """The paths and questions of every behaviour, and the classes of individuals as far as behaviours tell them apart.

    Parameters
    ----------
    program : Program
        Gives the problem's schema, and which variables the state determines.
    """

    def __init__(self, program: Program) -> None:
        self.problem = problem = program.problem
        self.members = program.members
        self.variables = program.variables
        self.mentioned = mentioned(problem)
        self.names = frozenset(named(problem)) | {TRUE, FALSE}
        depths = _depths(problem)
        self._narrowest = sorted(
            (kind for kind in self.mentioned if kind in self.members),
            key=lambda kind: (len(self.members[kind]), -depths[kind], kind),
        )
        self.kinds = {who: self._kind(who) for members in problem.classes.values() for who in members}
        self.classes = _most_specific(problem)
        self.partners = {name: _partners(tuples) for name, tuples in problem.relations.items()}
        self.plain = [s for s in problem.domain.situations.values() if len(s.arguments) == 1]
        self._paths: dict[str, tuple[list[End], list[Question]]] = {}

    def paths(self, name: str) -> tuple[list[End], list[Question]]:
        """Return the paths from a behaviour's roles, and the questions about their ends."""
        if name not in self._paths:
            behavior = self.problem.domain.behaviors[name]
            ends = self._ends(behavior)
            self._paths[name] = ends, self._questions(behavior, ends)
        return self._paths[name]

    def roles(self, behavior: Behavior) -> list[tuple[str, str]]:
        """Return the roles of a behaviour with the class of each: parameters first, then what the state determines."""
        determined = self.variables[behavior.name]
        kinds = {term.name[1:]: term.kind for term in behavior.variables}
        return [(p.name[1:], p.kind) for p in behavior.parameters] + [(v, kinds[v]) for v in determined]

    def _kind(self, individual: str) -> str:
        """Return the name of an individual that behaviours mention; of another the class, as far as behaviours mention it."""
        if individual in self.names:
            return individual
        return next((kind for kind in self._narrowest if individual in self.members[kind]), NONE)

    def _ends(self, behavior: Behavior) -> list[End]:
        """Return the roles, then what paths lead to; a determined value is what a path of one step leads to."""
        determined = {
            condition.value[1:]: condition
            for condition in behavior.preconditions
            if isinstance(condition, ValueCondition) and condition.value.startswith("?") and not condition.negated
        }
        ends: list[End] = []
        depth: dict[int, int] = {}  # steps of each end's path
        for name, kind in self.roles(behavior):
            condition = determined.get(name)
            by = (condition.arguments[0][1:], condition.situation) if condition else ("", "")
            places = [end.name for end in ends]
            start = places.index(by[0]) if by[0] in places else -1
            ends.append(
                End(name, start, ("", by[1]) if start >= 0 else None, self.members.get(kind, frozenset()), True)
            )
            situated = any(ends[-1].members <= self.members.get(s.arguments[0], frozenset()) for s in self.plain)
            depth[len(ends) - 1] = 0 if situated else int(start >= 0)
        known = {(end.start, end.step) for end in ends}
        plain = [s for s in self.plain if s.level <= behavior.level]
        for start, end in enumerate(ends):
            if depth[start] == DEPTH + 1:
                continue
            for step, members in self._steps(end, plain):
                if (start, step) in known:
                    continue  # the value has a role of its own
                if depth[start] == DEPTH and (step[0] not in ("", "goal") or not self._related(members)):
                    continue
                depth[len(ends)] = depth[start] + 1
                name = f"{end.name} · {' '.join(part for part in step if part)}"
                ends.append(End(name, start, step, members))
        return ends

    def _steps(self, end: End, situations: Sequence[SituationType]) -> list[tuple[tuple[str, str], frozenset[str]]]:
        """Return the steps that lead on from an end and not straight back, with what they can lead to."""
        came, by = end.step or ("", "")
        found = []
        for s in situations:
            holders, values = self.members.get(s.arguments[0], frozenset()), self.members.get(s.range, frozenset())
            again = end.step is not None and s.name == by
            if not holders.isdisjoint(end.members):
                if not (again and came in ("", "goal", "who")):
                    found.append((("", s.name), values))
                if not (again and came in ("goal", "wants")):
                    found.append((("goal", s.name), values))
            if not s.boolean and not values.isdisjoint(end.members):
                if not (again and came in ("", "who", "wants")):
                    found.append((("who", s.name), holders))
                if not (again and came in ("goal", "who", "wants")):
                    found.append((("wants", s.name), holders))
        return found

    def _related(self, members: frozenset[str]) -> bool:
        return any(not members.isdisjoint(partners) for pair in self.partners.values() for partners in pair)

    def _questions(self, behavior: Behavior, ends: Sequence[End]) -> list[Question]:
        roles = len(self.roles(behavior))
        plain = [s for s in self.plain if s.level <= behavior.level]
        found = []
        for i, end in enumerate(ends):
            deep = end.name.count(" · ") > DEPTH
            if not deep and (i >= roles or len({self.kinds[m] for m in end.members}) > 1):
                found.append(Question(f"{end.name} is", "class", (i,)))
            for s in plain:
                if not deep and not self.members.get(s.arguments[0], frozenset()).isdisjoint(end.members):
                    found.append(Question(f"{end.name} wanted {s.name}", "wanted", (i,), s.name))
            for name, (right_of, left_of) in self.partners.items():
                if len(right_of) <= CROWD and not end.members.isdisjoint(left_of):
                    found.append(Question(f"how many {name} {end.name}", "many", (i,), name))
                if len(left_of) <= CROWD and not end.members.isdisjoint(right_of):
                    found.append(Question(f"{end.name} {name} how many", "many", (i,), name))
            for j in range(roles):
                if i > j and end.start != j and not end.members.isdisjoint(ends[j].members):
                    found.append(Question(f"{end.name} = {ends[j].name}", "same", (i, j)))
                if i > j:
                    found += self._relations(i, j, end, ends[j])
        for j in range(roles):
            crowd = ends[j].members
            if len(crowd) <= CROWD:
                found += [
                    Question(f"others of {ends[j].name} · {s.name} is", "others", (j,), s.name)
                    for s in plain
                    if s.rest is not None and crowd <= self.members.get(s.arguments[0], frozenset())
                ]
        for s in self.problem.domain.situations.values():
            if s.boolean and len(s.arguments) == 2 and s.level <= behavior.level:
                for i in range(roles):
                    for j in range(roles):
                        a, b = (self.members.get(kind, frozenset()) for kind in s.arguments)
                        if not a.isdisjoint(ends[i].members) and not b.isdisjoint(ends[j].members):
                            found.append(Question(f"{s.name} {ends[i].name} {ends[j].name}", "pair", (i, j), s.name))
                            found.append(
                                Question(f"goal {s.name} {ends[i].name} {ends[j].name}", "pair goal", (i, j), s.name)
                            )
        return found

    def _relations(self, i: int, j: int, end: End, role: End) -> list[Question]:
        found = []
        for name, (right_of, left_of) in self.partners.items():
            if not role.members.isdisjoint(right_of) and not end.members.isdisjoint(left_of):
                found.append(Question(f"{role.name} {name} {end.name}", "related", (i, j), name))
            elif not role.members.isdisjoint(left_of) and not end.members.isdisjoint(right_of):
                found.append(Question(f"{end.name} {name} {role.name}", "related", (i, j), name))
            elif not role.members.isdisjoint(left_of) and not end.members.isdisjoint(left_of):
                found.append(Question(f"something {name} {role.name} and {end.name}", "joined", (i, j), name))
        return found


class View:
    """Reads the lifted facts of candidates off one table and goal.

    Parameters
    ----------
    schema : Schema
    table : Table
    goal : mapping of cell to value
    """

    def __init__(self, schema: Schema, table: Table, goal: Mapping[Cell, str]) -> None:
        self.schema, self.table, self.goal = schema, table, goal
        self.wanted: dict[str, dict[Key, str]] = {name: {} for name in table.now}
        self.wanters: dict[str, dict[str, list[Key]]] = {name: {} for name in table.now}
        for (situation, key), value in goal.items():
            self.wanted[situation][key] = value
            self.wanters[situation].setdefault(value, []).append(key)
        self._compiled: dict[str, tuple[list[tuple[int, Step]], list[Callable[[Sequence[Individuals]], str]]]] = {}
        self.only: Mapping[str, Sequence[int]] = {}  # the questions worth asking, where not all are

    def values(self, behavior: str, roles: Sequence[str]) -> Values:
        """Return the values of a behaviour's questions, given the individuals in its roles."""
        if behavior not in self._compiled:
            self._compiled[behavior] = self._compile(behavior)
        steps, questions = self._compiled[behavior]
        ends: list[Individuals] = [(role,) for role in roles]
        for start, step in steps:
            ends.append(step(ends[start]))
        return tuple([ask(ends) for ask in questions])

    def candidate(self, behavior: str, roles: Sequence[str], values: Values | None = None) -> Candidate:
        """Return a candidate as memory sees it."""
        schema = self.schema
        conclusion = Conclusion(behavior, tuple([schema.classes.get(role, NONE) for role in roles]))
        names = [name for name, _ in schema.roles(schema.problem.domain.behaviors[behavior])]
        found = self.values(behavior, roles) if values is None else values
        kinds = [kind for _, kind in schema.roles(schema.problem.domain.behaviors[behavior])]
        personal = tuple(name for name, kind in zip(names, kinds, strict=True) if len(schema.members[kind]) <= CROWD)
        return Candidate(conclusion, self.pattern(behavior, found), tuple(zip(names, roles, strict=True)), personal)

    def pattern(self, behavior: str, values: Values) -> Pattern:
        """Return values together with the names of their facts."""
        questions = self.schema.paths(behavior)[1]
        asked = self.only.get(behavior, range(len(questions)))
        return tuple((questions[i].name, value) for i, value in zip(asked, values, strict=True))

    def _compile(self, behavior: str) -> tuple[list[tuple[int, Step]], list[Callable[[Sequence[Individuals]], str]]]:
        """Return the steps to make and the questions to ask; of both only those that are worth it."""
        ends, questions = self.schema.paths(behavior)
        asked = [questions[i] for i in self.only.get(behavior, range(len(questions)))]
        needed = {i for question in asked for i in question.ends}
        for i in range(len(ends) - 1, -1, -1):
            if i in needed and not ends[i].role:
                needed.add(ends[i].start)
        place = {i: i for i, end in enumerate(ends) if end.role}
        steps = []
        for i, end in enumerate(ends):
            if i in needed and not end.role and end.step is not None:
                place[i] = len(place)
                steps.append((place[end.start], self._step(*end.step)))
        return steps, [
            self._ask(Question(q.name, q.kind, tuple(place[i] for i in q.ends), q.of), ends[q.ends[0]].members)
            for q in asked
        ]

    def _step(self, way: str, situation: str) -> Step:
        now, who = self.table.now[situation], self.table.who[situation]
        wanted, wanters = self.wanted[situation], self.wanters[situation]

        def of(cells: Mapping[Key, str]) -> Step:
            def step(start: Individuals) -> Individuals:
                if len(start) == 1:
                    value = cells.get(start[0])
                    return () if value is None else (value,)
                return tuple({cells[x]: None for x in start if x in cells})

            return step

        def holders(start: Individuals) -> Individuals:
            found = who.get(start[0], ()) if len(start) == 1 else {key: None for x in start for key in who.get(x, ())}
            return cast(Individuals, tuple(found)[:MOST])

        def wishers(start: Individuals) -> Individuals:
            found = {key: None for x in start for key in wanters.get(x, ()) if now.get(key) != x}
            return cast(Individuals, tuple(found)[:MOST])

        return {"": of(now), "goal": of(wanted), "who": holders, "wants": wishers}[way]

    def _ask(self, question: Question, members: frozenset[str]) -> Callable[[Sequence[Individuals]], str]:
        schema, i, j = self.schema, question.ends[0], question.ends[-1]
        if question.kind == "class":
            kinds = schema.kinds
            return lambda ends: _joined([kinds.get(x, NONE) for x in ends[i]])
        if question.kind in ("wanted", "others"):
            now, wanted = self.table.now[question.of], self.wanted[question.of]

            def status(x: str) -> str:
                value = wanted.get(x)
                return NONE if value is None else "met" if now.get(x) == value else "unmet"

            if question.kind == "wanted":
                return lambda ends: status(ends[i][0]) if len(ends[i]) == 1 else _joined([status(x) for x in ends[i]])
            crowd, kinds = sorted(members), schema.kinds
            return lambda ends: _joined([kinds.get(now.get(x, NONE), NONE) for x in crowd if x != ends[i][0]])
        if question.kind == "same":
            return lambda ends: NONE if not ends[i] else "yes" if ends[j][0] in ends[i] else "no"
        if question.kind in ("pair", "pair goal"):
            cells = self.table.now[question.of] if question.kind == "pair" else self.wanted[question.of]
            return lambda ends: cells.get((ends[i][0], ends[j][0]), FALSE if question.kind == "pair" else NONE)
        right_of, left_of = schema.partners[question.of]
        if question.kind == "many":
            sides = left_of if question.name.startswith("how") else right_of
            total = len(right_of if sides is left_of else left_of)

            def many(x: str) -> str:
                count = len(sides.get(x, ()))
                return "all" if count == total else str(min(count, 1)) if count < 2 else "several"

            return lambda ends: _joined([many(x) for x in ends[i]])
        partners = left_of if question.kind == "joined" else {**right_of, **left_of}
        nobody: frozenset[str] = frozenset()
        if question.kind == "joined":

            def joined(ends: Sequence[Individuals]) -> str:
                if not ends[i]:
                    return NONE
                mine = partners.get(ends[j][0], nobody)
                return "yes" if any(not mine.isdisjoint(partners.get(x, nobody)) for x in ends[i]) else "no"

            return joined

        def related(ends: Sequence[Individuals]) -> str:
            if not ends[i]:
                return NONE
            mine = partners.get(ends[j][0], nobody)
            return "yes" if any(x in mine for x in ends[i]) else "no"

        return related


def _joined(values: list[str]) -> str:
    if len(values) == 1:
        return values[0]
    return "+".join(sorted(set(values))) or NONE


def mentioned(problem: Problem) -> tuple[str, ...]:
    """Return the classes that behaviours, situation types or terms tell apart: what can be done depends on no other."""
    found: dict[str, None] = {}

    for behavior in problem.domain.behaviors.values():
        found.update(dict.fromkeys(behavior.kinds.values()))
        for condition in (*behavior.preconditions, *(c for effect in behavior.effects for c in effect.when)):
            kinds = [inner.kind for inner in walk(condition) if isinstance(inner, ClassCondition | Witness)]
            found.update(dict.fromkeys(kinds))
    for situation in problem.domain.situations.values():
        found.update(dict.fromkeys((*situation.arguments, situation.range)))
    return tuple(sorted(found))


def _most_specific(problem: Problem) -> dict[str, str]:
    """Return for each individual its smallest class."""
    found: dict[str, str] = {}
    depths = _depths(problem)
    for kind in sorted(problem.classes, key=lambda kind: (-len(problem.classes[kind]), depths[kind], kind)):
        found.update(dict.fromkeys(problem.classes[kind], kind))
    return found


def _depths(problem: Problem) -> dict[str, int]:
    """Return how many superclasses each class has above it, along the longest chain; a circle of classes is cut somewhere."""
    found: dict[str, int] = {}
    for kind in problem.classes:
        path = {kind: None}
        while path:
            top = next(reversed(path))
            parents = problem.parents.get(top, ())
            above = next((parent for parent in parents if parent not in found and parent not in path), None)
            if above is not None:
                path[above] = None
            else:
                found[top] = 1 + max((found.get(parent, 0) for parent in parents), default=0)
                del path[top]
    return found


def _partners(tuples: frozenset[tuple[str, ...]]) -> tuple[dict[str, frozenset[str]], dict[str, frozenset[str]]]:
    """Return for the left side of a binary relation what is right of it, and the other way round."""
    right: dict[str, set[str]] = {}
    left: dict[str, set[str]] = {}
    for row in sorted(tuples):
        if len(row) == 2:
            right.setdefault(row[0], set()).add(row[1])
            left.setdefault(row[1], set()).add(row[0])
    return {a: frozenset(b) for a, b in right.items()}, {b: frozenset(a) for b, a in left.items()}
