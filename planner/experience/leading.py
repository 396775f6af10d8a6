"""Rules that act, on every level: what promises the fewest steps is done for real, refined, until what was wanted is so.

off       what isn't yet as it must be in the end: what is wanted, and what was touched on the way and is to be kept
rank      the steps that a rule promises; of equal ones, the candidate that loses least and has the greatest cogency comes first
promise   after a rule's step, rules for the same symbol must promise fewer; what came to be right must not go wrong again
wasted    steps that were undone because a promise was broken; nothing is tried while more than a tenth of all effort was

The goals of a task, one by one in series, and the changes that a refinement must bring about are the same to rules: `Guide.follow`
leaves the table as wanted, with all kept that must be, or as it was. So search goes on as if nobody had asked, and what it
finds becomes rules at once.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from typing import TypeAlias

from planner.experience.evidence import told_apart
from planner.experience.matching import Find, finder, known
from planner.experience.regression import Course, ordered
from planner.hierarchical.operators import Program
from planner.hierarchical.refinement_cache import RefinedStep
from planner.hierarchical.serialization import Call
from planner.hierarchical.subplans import Keep
from planner.transitions import Cell, Table, arguments_of
from reasoner.amounts import meets
from reasoner.memory.experience import ITSELF, Experience, Ground, Order, Rule, Tally
from reasoner.symbols import FALSE, TRUE, Fact, Symbol

CANDIDATES = 20
"""So many ways to fill a rule's roles are compared."""
TRIES = 3
"""So many of them are tried."""
CASES, NEARLY = 3, 0.95
"""An order counts if it held in so many cases, and in this share of all."""
WASTE = 10
"""Of so many expansions one may have been for steps of rules that were undone."""
SHARE, LONG = 20, 12
"""In strict mode: one of so many, with promises of so many steps counted as wasted before they are tried."""
FAR = 1000
"""More steps than any rule promises."""

NOTHING: Mapping[Cell, str] = {}

Roles: TypeAlias = "tuple[str, ...]"


@dataclass(frozen=True)
class Candidate:
    """A way to follow a rule now: the symbol that it is for, and the individuals in its roles."""

    rule: Rule
    goal: Cell
    roles: Roles

    @property
    def ground(self) -> Ground:
        """The step to do."""
        filled = dict(zip((role for role, _ in self.rule.kinds), self.roles, strict=True))
        return self.rule.does[0], tuple([filled.get(term, term) for term in self.rule.does[1]])


Score: TypeAlias = "Callable[[Candidate], float]"


class Guide:
    """Rules bound to one call: its table, its goals and the order of these.

    Parameters
    ----------
    call : Call
    rules : iterable of Rule
    orders : sequence of Order
    score : function of a candidate, optional
        The greater, the sooner tried.
    joins : dict, optional
        What was compiled of rules for other calls over the same program; grows.
    """

    def __init__(
        self,
        call: Call,
        rules: Iterable[Rule],
        orders: Sequence[Order] = (),
        score: Score | None = None,
        joins: dict[str, Callable[[Table], Find] | None] | None = None,
        strict: bool = False,
    ) -> None:
        self.call, self.score, self.strict = call, score, strict
        self.joins = {} if joins is None else joins
        self.levels = {b.name: b.level for b in call.program.domain.behaviors.values()}
        self.by_goal: dict[tuple[int, str], list[Rule]] = {}
        self.finds: dict[str, Find | None] = {}
        self.names: set[str] = set()
        self.broken: dict[str, int] = {}
        self.wasted = 0
        self.taught: dict[object, tuple[int, int]] = {}
        """Of each kind of targets how many lessons in a row rules led nowhere after, and how many more are left out."""
        self.classes: dict[str, frozenset[str]] = {}
        self.before = _before(call.goal, orders, call.program)
        self.add(rules)
        first = call.program.levels[0]
        self.expects = not strict and all((first, situation) in self.by_goal for situation, _ in self.open())

    def add(self, rules: Iterable[Rule]) -> None:
        """Follow more rules."""
        for rule in rules:
            if rule.name not in self.names:
                self.names.add(rule.name)
                if known(rule, self.call.program.problem):
                    of = self.by_goal.setdefault((self.levels[rule.does[0]], rule.goal.situation), [])
                    of.append(rule)
                    of.sort(key=lambda rule: (rule.steps, rule.name))

    def ways(self, rule: Rule, cell: Cell, value: str, most: int = CANDIDATES) -> list[Candidate]:
        """Return ways to follow a rule for a value now; it is compiled when it is first asked."""
        if rule.name not in self.finds:
            if rule.name not in self.joins:
                self.joins[rule.name] = finder(rule, self.call.program.writer)
            bind = self.joins[rule.name]
            self.finds[rule.name] = bind(self.call.table) if bind is not None else None
        find = self.finds[rule.name]
        if find is None:
            return []
        return [Candidate(rule, cell, roles) for roles in islice(find(*arguments_of(cell[1]), value), most)]

    def open(self) -> dict[Cell, str]:
        """Return the goals of the call that don't hold now."""
        return {cell: value for cell, value in self.call.goal.items() if not self.call.met(cell)}

    def every(self, cells: Mapping[Cell, str]) -> Iterator[Candidate]:
        """Yield every way to follow a rule of the most abstract level for some values."""
        for cell, value in cells.items():
            for rule in self.by_goal.get((self.call.program.levels[0], cell[0]), ()):
                yield from self.ways(rule, cell, value)

    def waits(self, cell: Cell) -> bool:
        """Whether another open goal comes first."""
        return not self.strict and any(not self.call.met(other) for other in self.before.get(cell, ()))

    def candidates(
        self, level: int, cells: Mapping[Cell, str], below: int = FAR, off: Mapping[Cell, str] = NOTHING
    ) -> list[Candidate]:
        """Return the candidates of the least rank below a bound for some values, in the order in which to try them.

        Last come those that give something to somebody though somebody else, who is off, is to have it.
        """
        rank, found = below - 1, list[Candidate]()
        for cell, value in cells.items():
            for rule in self.by_goal.get((level, cell[0]), ()):
                if rule.steps > rank or (rule.steps == rank and len(found) >= CANDIDATES):
                    break
                if self.broken.get(rule.name, 0) > 1:
                    continue
                ways = self.ways(rule, cell, value)
                if ways and rule.steps < rank:
                    rank, found = rule.steps, []
                found += ways
        score = self.score
        if score is not None and len(found) > 1:
            found.sort(key=score, reverse=True)
        if len(off) > 1:
            wanted = {value: arguments_of(key) for (_, key), value in off.items() if value not in (TRUE, FALSE)}
            found.sort(key=lambda c: any(not set(wanted[a]) & set(c.ground[1]) for a in c.ground[1] if a in wanted))
        return found

    def ready(self) -> bool:
        """Whether no more than a share of the effort was wasted so far; if strict, would be after one promise more."""
        if self.strict:
            return (self.wasted + LONG) * SHARE <= self.call.segments.expanded
        return self.wasted * WASTE <= self.call.segments.expanded

    def rank(self, cell: Cell) -> int:
        """Return how many steps rules promise for a goal; 0 if they promise nothing."""
        rules = self.by_goal.get((self.call.program.levels[0], cell[0]), ()) if self.ready() else ()
        return next(
            (r.steps for r in rules if self.broken.get(r.name, 0) < 2 and self.ways(r, cell, self.call.goal[cell], 1)),
            0,
        )

    def follow(self, level: int, targets: Mapping[Cell, str], keep: Keep) -> list[RefinedStep] | None:
        """Do steps of a level, refined, that achieve the targets and keep the rest; None, and the table as it was, without any."""
        return self.tried(level, targets, keep) if self.ready() else None

    def tried(self, level: int, targets: Mapping[Cell, str], keep: Keep) -> list[RefinedStep] | None:
        """Do the same, however much was wasted."""
        call = self.call
        table, segments = call.table, call.segments
        start = mark = len(table.trail)
        began = segments.expanded
        origin: dict[Cell, str] = {}
        off = {c: v for c, v in targets.items() if not meets(table.now[c[0]].get(c[1], FALSE), v)}
        closed: set[Cell] = set()
        steps: list[RefinedStep] = []
        used: dict[str, None] = {}
        goal: Cell | None = None
        rank = FAR
        while off:
            among = {goal: off[goal]} if goal in off else {c: v for c, v in off.items() if c not in closed}
            done = None
            found = self.candidates(level, among, rank, off)
            possible = (c for c in found if segments.forward[c.ground[0]](*c.ground[1]) is not None)
            for candidate in islice(possible, TRIES):
                used[candidate.rule.name] = None
                done = self.do(level, candidate)
                if done is not None:
                    goal, rank = candidate.goal, candidate.rule.steps
                    steps.append(done)
                    break
            if done is None:
                break
            for situation, key, old in table.trail[mark:]:
                first = origin.setdefault((situation, key), old)
                self._look((situation, key), targets.get((situation, key)) or keep((situation, key), first), off)
            for cell in segments.defined:
                self._look(cell, targets.get(cell) or keep(cell, ""), off)
            mark = len(table.trail)
            if goal is not None and goal not in off:
                closed.add(goal)
                rank = FAR
        if not off and call.refiner.left_as_it_must(start, targets, keep) is None:
            self.taught.pop(self.kind(level, targets), None)
            return steps
        for name in used:
            self.broken[name] = self.broken.get(name, 0) + 1
        self.wasted += segments.expanded - began
        table.undo(start)
        return None

    def _look(self, cell: Cell, wanted: str | None, off: dict[Cell, str]) -> None:
        if wanted is None or meets(self.call.table.now[cell[0]].get(cell[1], FALSE), wanted):
            off.pop(cell, None)
        else:
            off[cell] = wanted

    def do(self, level: int, candidate: Candidate) -> RefinedStep | None:
        """Do a candidate's step, refined, unless it changes nothing; None, and the table as it was, if it can't be done."""
        call, mark = self.call, len(self.call.table.trail)
        name, arguments = candidate.ground
        call.segments.expand(level)
        done = call.refiner.do(level, name, arguments)
        return done if len(call.table.trail) > mark else None

    def kind(self, level: int, targets: Mapping[Cell, str]) -> object:
        """Return of what kind targets are: the situation types, and the classes of those whom they are about."""
        if not self.classes:
            members = self.call.program.problem.members
            self.classes = {kind: members(kind) for kind in told_apart(self.call.program.problem)}
        found = set()
        for (situation, key), value in targets.items():
            parts = (*arguments_of(key), value)
            found.add((situation, *(tuple(k for k, its in self.classes.items() if one in its) for one in parts)))
        return level, frozenset(found)

    def learn(
        self, level: int, mark: int, targets: Mapping[Cell, str], keep: Keep, steps: Sequence[RefinedStep]
    ) -> bool:
        """Learn rules at once from steps of a level that search found, done since a mark; whether there are new ones.

        After each lesson twice as many are left out, until rules lead to such targets.
        """
        kind = self.kind(level, targets)
        lessons, pause = self.taught.get(kind, (0, 0))
        if pause:
            self.taught[kind] = lessons, pause - 1
            return False
        self.taught[kind] = lessons + 1, 2**lessons
        known = len(self.names)
        done = [(step.behavior, step.arguments) for step in steps]
        self.add(course(self.call, mark, targets, keep, done).rules_of())
        return len(self.names) > known


def by_rules(guide: Guide) -> None:
    """Achieve goals by rules alone, as many as they can."""
    call, level = guide.call, guide.call.program.levels[0]
    reached = True
    while reached:
        reached = False
        for cell, value in sorted(guide.open().items(), key=lambda item: guide.waits(item[0])):
            if not call.met(cell):
                steps = guide.tried(level, {cell: value}, call.segments.keeping(call.kept))
                if steps is not None:
                    call.steps += steps
                    call.kept[cell] = value
                    reached = True


def course(call: Call, mark: int, targets: Mapping[Cell, str], keep: Keep, done: Sequence[Ground]) -> Course:
    """Return steps of a level, done since a mark, as a way from the state there to what they should leave."""
    before: dict[Cell, str] = {}
    for situation, key, old in call.table.trail[mark:]:
        before.setdefault((situation, key), old)
    state = call.table.state()
    goal = {}
    for cell, first in before.items():
        symbol = Symbol(cell[0], arguments_of(cell[1]))
        state[symbol] = first
        wanted = targets.get(cell) or keep(cell, first)
        if wanted is not None:
            goal[symbol] = wanted
    for cell in targets.keys() - before.keys():
        goal[Symbol(cell[0], arguments_of(cell[1]))] = targets[cell]
    return Course(replace(call.problem, initial=state, goal=goal), done)


def rules_in(experience: Experience) -> list[Rule]:
    """Return the rules that may be followed."""
    return [
        one
        for name, one in sorted(experience.said.items())
        if isinstance(one, Rule) and name not in experience.disabled
    ]


def usable(experience: Experience) -> list[Order]:
    """Return the orders that held in nearly all cases; one between goals that share nobody, of different situation types only."""
    counts = experience.totals()
    found = []
    for name, order in sorted(experience.said.items()):
        if isinstance(order, Order) and name not in experience.disabled and (order.shared or order.first != order.then):
            so = counts.get(name, {}).get(ITSELF, Tally()).chosen
            other = counts.get(order.reversed.name, {}).get(ITSELF, Tally()).chosen
            if so >= CASES and so >= NEARLY * (so + other):
                found.append(order)
    return found


def _before(goal: Mapping[Cell, str], orders: Sequence[Order], program: Program) -> dict[Cell, list[Cell]]:
    """Return for each goal those that come before it."""
    found: dict[Cell, list[Cell]] = {}
    parts = {cell: (*arguments_of(cell[1]), value) for cell, value in goal.items()}
    constants = frozenset(program.named) | {TRUE, FALSE}
    facts = {cell: Fact(Symbol(cell[0], arguments_of(cell[1])), value) for cell, value in goal.items()}
    for order in orders:
        index: dict[tuple[str, ...], list[Cell]] = {}
        for cell, terms in parts.items():
            if cell[0] == order.first:
                index.setdefault(tuple(terms[i] for i, _ in order.shared), []).append(cell)
        for cell, terms in parts.items():
            if cell[0] == order.then:
                for other in index.get(tuple(terms[j] for _, j in order.shared), ()):
                    if other != cell and ordered(facts[other], facts[cell], constants) == order:
                        found.setdefault(cell, []).append(other)
    return found
