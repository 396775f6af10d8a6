"""The loop in which rules act: what promises the fewest steps is done for real, and where rules run out, search goes on.

open      goals that don't hold
first     what orders say must come before a goal; it waits while that is open
rank      the steps that a rule promises; of equal ones, the candidate of the greatest cogency is tried first
broken    a promise isn't kept: after a rule's step no rule for its goal promises fewer steps; twice broken, it isn't asked again
mark      where the fewest goals were open so far: what leads no further is undone down to there
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from typing import TypeAlias

from planner.experience.matching import Find, finder, known
from planner.experience.regression import Course, ordered
from planner.hierarchical.operators import Program
from planner.hierarchical.serialization import EASY, LONGER, Call
from planner.plan import LimitError
from planner.transitions import Cell, Change, arguments_of
from reasoner.amounts import meets
from reasoner.memory.experience import ITSELF, Experience, Order, Rule, Tally
from reasoner.symbols import FALSE, TRUE, Fact, Symbol

CANDIDATES = 20
"""So many ways to fill a rule's roles are compared."""
PATIENCE = 6
"""So many steps, and twice what was promised, may bring no new least number of open goals."""
SEARCHING = 10
"""Expansions of search between rules, and again after them, beside one for each goal that was reached."""
GOALS = 8
"""So many goals are searched for where rules run out."""
TRIES = 3
"""So many of them are tried."""
CASES, NEARLY = 3, 0.95
"""An order counts if it held in so many cases, and in this share of all."""
FAR = 1000
"""More steps than any rule promises."""

Roles: TypeAlias = "tuple[str, ...]"


@dataclass(frozen=True)
class Candidate:
    """A way to follow a rule now: the goal that it is for, and the individuals in its roles."""

    rule: Rule
    goal: Cell
    roles: Roles

    @property
    def ground(self) -> tuple[str, Roles]:
        """The step to do."""
        filled = dict(zip((role for role, _ in self.rule.kinds), self.roles, strict=True))
        return self.rule.does[0], tuple([filled.get(term, term) for term in self.rule.does[1]])


Score: TypeAlias = "Callable[[Candidate], float]"


class Guide:
    """Rules bound to one call: its table, its goals and the order of these.

    Parameters
    ----------
    call : Call
    rules : sequence of Rule
    orders : sequence of Order
    score : function of a candidate, optional
        The greater, the sooner tried.
    """

    def __init__(self, call: Call, rules: Iterable[Rule], orders: Sequence[Order], score: Score | None = None) -> None:
        self.call, self.goal, self.score = call, call.goal, score
        self.by_situation: dict[str, list[Rule]] = {}
        self.finds: dict[str, Find | None] = {}
        self.names: set[str] = set()
        self.broken: dict[str, int] = {}
        self.before = _before(self.goal, orders, call.program)
        self.levels = {b.name: b.level for b in call.program.domain.behaviors.values()}
        self.open = {cell: None for cell in self.goal if not call.met(cell)}
        self.add(rules)

    def add(self, rules: Iterable[Rule]) -> None:
        """Follow more rules."""
        for rule in rules:
            if rule.name not in self.names:
                self.names.add(rule.name)
                if known(rule, self.call.program.problem):
                    self.by_situation.setdefault(rule.goal.situation, []).append(rule)
        for found in self.by_situation.values():
            found.sort(key=lambda rule: (rule.steps, rule.name))

    def ways(self, rule: Rule, cell: Cell) -> list[Candidate]:
        """Return ways to follow a rule for a goal now; it is compiled when it is first asked."""
        if rule.name not in self.finds:
            bind = finder(rule, self.call.program.writer)
            self.finds[rule.name] = bind(self.call.table) if bind is not None else None
        find = self.finds[rule.name]
        if find is None:
            return []
        roles = islice(find(*arguments_of(cell[1]), self.goal[cell]), CANDIDATES)
        return [Candidate(rule, cell, filled) for filled in roles]

    def look(self, mark: int) -> None:
        """See which goals changes since a mark have opened or achieved."""
        met = self.call.met
        for cell in (*((s, key) for s, key, _ in self.call.table.trail[mark:]), *self.call.segments.defined):
            if cell in self.goal:
                if met(cell):
                    self.open.pop(cell, None)
                else:
                    self.open[cell] = None

    def every(self, cell: Cell) -> Iterator[Candidate]:
        """Yield every way to follow a rule for a goal."""
        for rule in self.by_situation.get(cell[0], ()):
            yield from self.ways(rule, cell)

    def waits(self, cell: Cell) -> bool:
        """Whether another open goal comes first."""
        return any(other in self.open for other in self.before.get(cell, ()))

    def candidates(self, cells: Iterable[Cell], below: int) -> list[Candidate]:
        """Return the candidates of the least rank below a bound for some goals, the most cogent first."""
        rank, found = below - 1, list[Candidate]()
        for cell in cells:
            for rule in self.by_situation.get(cell[0], ()):
                if rule.steps > rank or (rule.steps == rank and len(found) >= CANDIDATES):
                    break
                if self.broken.get(rule.name, 0) > 1:
                    continue
                ways = self.ways(rule, cell)
                if ways and rule.steps < rank:
                    rank, found = rule.steps, []
                found += ways
        score = self.score
        if score is not None and len(found) > 1:
            found.sort(key=lambda c: -score(c))
        return found

    def next(self, following: Candidate | None) -> list[Candidate]:
        """Return the candidates to try: for the goal that is followed, else for those that need not wait, else for any."""
        if following is not None and following.goal in self.open:
            found = self.candidates([following.goal], following.rule.steps)
            if found:
                return found
        ready = [cell for cell in self.open if not self.waits(cell)]
        found = self.candidates(ready, FAR)
        return found if found or len(ready) == len(self.open) else self.candidates(self.open, FAR)

    def do(self, candidate: Candidate) -> bool:
        """Do a candidate's step, refined, unless it changes nothing or a goal that holds for good is lost; whether it was done."""
        call = self.call
        name, arguments = candidate.ground
        said = call.segments.forward[name](*arguments)
        if said is None or self.loses(said[1]):
            return False
        mark = len(call.table.trail)
        call.segments.expand(self.levels[name])
        done = call.refiner.do(self.levels[name], name, arguments)
        if done is None:
            return False
        if len(call.table.trail) == mark or self.harmed(mark):
            call.table.undo(mark)
            return False
        call.steps.append(done)
        self.look(mark)
        return True

    def loses(self, changes: Iterable[Change]) -> bool:
        """Whether changes would lose a goal that holds for good: they needn't be tried."""
        for situation, key, value in changes:
            cell = situation, key
            wanted = self.goal.get(cell)
            if wanted is not None and cell not in self.open and not meets(value, wanted) and not self.waits(cell):
                return True
        return False

    def harmed(self, mark: int) -> bool:
        """Whether a goal was lost since a mark that waits for no other."""
        cells = {(situation, key) for situation, key, _ in self.call.table.trail[mark:]}
        return any(
            cell in self.goal and cell not in self.open and not self.call.met(cell) and not self.waits(cell)
            for cell in cells
        )


def follow(guide: Guide) -> Iterator[Candidate]:
    """Follow rules from where a call stands, and leave it where they led nearer; yield each candidate before it is tried."""
    call = guide.call
    table = call.table
    least, mark, steps, left = len(guide.open), len(table.trail), len(call.steps), -1
    following: Candidate | None = None
    while guide.open:
        tried = guide.next(following)
        if following is not None and following.goal in guide.open and not (tried and tried[0].goal == following.goal):
            guide.broken[following.rule.name] = guide.broken.get(following.rule.name, 0) + 1
        done = None
        for candidate in tried[:TRIES]:
            yield candidate
            if guide.do(candidate):
                done = candidate
                break
        if done is None:
            if not tried:
                break
            for name in {candidate.rule.name for candidate in tried}:
                guide.broken[name] = guide.broken.get(name, 0) + 1
            following = None  # another rule may get on
            continue
        following = done if done.goal in guide.open else None
        if len(guide.open) < least:
            least, mark, steps, left = len(guide.open), len(table.trail), len(call.steps), -1
        else:
            left = 2 * done.rule.steps + PATIENCE if left < 0 else left - 1
            if left == 0:
                break
    back = len(table.trail)
    if back > mark:
        touched = table.trail[mark:]
        table.undo(mark)
        del call.steps[steps:]
        table.trail.extend(touched)  # for a look at the goals among them
        guide.look(mark)
        del table.trail[mark:]


def go_on(guide: Guide) -> Iterator[Candidate]:
    """Follow rules as long as they reach goals; where they run out, search for one, learn from that at once, and follow them again.

    Searching may take `SEARCHING` expansions in all, and one for each goal that was reached.
    """
    call, goals = guide.call, len(guide.open)
    first = call.program.levels[0]
    searching = 0
    while guide.open:
        open_ = len(guide.open)
        yield from follow(guide)
        before = call.segments.expanded
        budget = SEARCHING + goals - len(guide.open) - searching
        if len(guide.open) in (0, open_) or budget <= 0 or not searched(guide, first, budget):
            return
        searching += call.segments.expanded - before


def searched(guide: Guide, level: int, budget: int) -> bool:
    """Achieve one more goal by search, and learn rules from that; whether one was."""
    call, began = guide.call, guide.call.segments.expanded
    ready = [cell for cell in guide.open if not guide.waits(cell)] or list(guide.open)
    call.kept = {cell: call.goal[cell] for cell in call.goal if cell not in guide.open and not guide.waits(cell)}
    before, mark, steps = call.table.state(), len(call.table.trail), len(call.steps)
    most = call.segments.most
    call.segments.most = min(most, began + budget)
    try:
        cell = next(c for a in (EASY, LONGER) for c in ready[:GOALS] if call.achieve(level, c, a))
    except StopIteration:
        return False
    except LimitError:
        if began + budget >= most or call.segments.expanded <= began + budget:
            raise
        call.table.undo(mark)
        return False
    finally:
        call.segments.most = most
    guide.look(mark)
    goal = {Symbol(cell[0], arguments_of(cell[1])): call.goal[cell]}
    done = [(step.behavior, step.arguments) for step in call.steps[steps:]]
    guide.add(Course(replace(call.problem, initial=before, goal=goal), done).rules_of())
    return True


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
