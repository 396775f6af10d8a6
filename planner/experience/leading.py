"""Rules that act, on every level: chains of them are done for real, refined, until what was wanted is so.

off       what isn't yet as it must be in the end: what is wanted, and what was touched on the way and is to be kept
rank      how many rules must follow each other (`confab.planner.experience.chaining`); what is nearest is brought about first
promise   what came to be right must not go wrong again, but once
wasted    what was undone because a promise of the most abstract level was broken; nothing is tried there while that is more than a
          tenth of all expansions
vain      all that came to nothing, rules that were asked included; of all effort that is never more than a tenth, and a little

The goals of a task, one by one in series, and the changes that a refinement must bring about are the same to rules: `Guide.follow`
leaves the table as wanted, with all kept that must be, or as it was. So search goes on as if nobody had asked.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from math import inf
from typing import TypeAlias, TypeVar

from confab.planner.experience.chaining import Budget, Candidate, Chains, TooMuchError, fact
from confab.planner.experience.matching import Bind, known
from confab.planner.hierarchical.call import Call
from confab.planner.hierarchical.methods import Ranked, as_they_come
from confab.planner.hierarchical.operators import Program
from confab.planner.hierarchical.refinement import RefinedStep
from confab.planner.hierarchical.workspace import Keep
from confab.planner.transitions import Cell, arguments_of
from confab.reasoner.amounts import meets
from confab.reasoner.memory.experience import ITSELF, Experience, Order, Rule, Tally
from confab.reasoner.symbols import FALSE, TRUE, Condition, Fact, Symbol

CASES, NEARLY = 3, 0.95
"""An order counts if it held in so many cases, and in this share of all."""
WASTE = 10
"""Of so many expansions, and of so much effort, one part may be for what comes to nothing."""
FREE = 500_000
"""That is counted as if so much had been done before, in microseconds: a promise in a world with locks takes 20,000."""
PATIENCE, SLACK = 3, 2
"""So many times as many steps are done as are promised, and so many more: each condition is promised by itself."""
TWICE = 2
"""So many times something is brought about in the end: what was shut is opened once more for what belongs into it."""

Score: TypeAlias = "Callable[[Candidate], float]"
Found = TypeVar("Found")


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
    ranked : function of a method and ways to fill its roles, optional
        Returns these, the best first.
    """

    def __init__(
        self,
        call: Call,
        rules: Iterable[Rule],
        orders: Sequence[Order] = (),
        score: Score | None = None,
        joins: dict[str, Bind | None] | None = None,
        ranked: Ranked = as_they_come,
    ) -> None:
        self.call, self.ranked = call, ranked
        self.levels = {b.name: b.level for b in call.program.domain.behaviors.values()}
        self.by_goal: dict[tuple[int, str], list[Rule]] = {}
        self.off: dict[Cell, str] = {}
        self.first = call.program.levels[0]
        self.wasted, self.vain = 0, 0.0
        self.serial = True
        """Whether goals can be reached one after the other, for all that is known."""
        self.reached: set[str] = set()
        """Situation types of which rules reached a goal, and then there was still a way to another one."""
        self.orders = frozenset(orders)
        self.constants = frozenset(call.program.named) | {TRUE, FALSE}
        self.before = _before(call.goal, orders, call.program)
        self.chains = Chains(call, self.by_goal, {} if joins is None else joins, score, self.sooner)
        for rule in rules:
            if known(rule, call.program.problem):
                self.by_goal.setdefault((self.levels[rule.does[0]], rule.goal.situation), []).append(rule)
        self.expects = all((self.first, situation) in self.by_goal for situation, _ in self.open())

    def sooner(self, first: Condition, then: Condition, env: Mapping[str, str]) -> bool:
        """Whether one condition is known to be brought about before another one."""
        one, other = fact(first, env), fact(then, env)
        return one is not None and other is not None and Order.of(one, other, self.constants) in self.orders

    def open(self) -> dict[Cell, str]:
        """Return the goals of the call that don't hold now."""
        return {cell: value for cell, value in self.call.goal.items() if not self.call.met(cell)}

    def every(self, cells: Mapping[Cell, str]) -> Iterator[Candidate]:
        """Yield the ways to follow a rule of the most abstract level now for some values, or for what the nearest ways lack."""
        goals = dict.fromkeys(cells.items())
        for goal in (asked := list(goals)):
            ready = [way for way in self.chains.ways(self.first, goal) if not way.unmet]
            yield from ready
            for _, way in () if ready else self.chains.nearest(self.first, goal):
                new = [g for n in way.unmet for g in self.chains.lacks(self.first, way, n) if g not in goals]
                goals.update(dict.fromkeys(new))
                asked += new

    def waits(self, cell: Cell) -> bool:
        """Whether another open goal comes first."""
        return any(not self.call.met(other) for other in self.before.get(cell, ()))

    def allowed(self) -> float:
        """Return how much more may come to nothing."""
        return (self.call.space.effort + self.chains.spent + FREE) / WASTE - self.vain

    def ready(self) -> bool:
        """Whether more may come to nothing."""
        return self.wasted * WASTE <= self.call.space.expanded and self.allowed() > 0

    def bounded(self, level: int, ask: Callable[[], Found | None]) -> Found | None:
        """Return what rules answer, None if they have none or asking them takes more than what may come to nothing."""
        if not self.ready() if level == self.first else self.allowed() <= 0:
            return None
        chains = self.chains
        outer, vain, began = chains.most, self.vain, chains.spent
        chains.most = min(outer, began + self.allowed())
        try:
            found = ask()
        except TooMuchError:
            found = None
        chains.most = outer + chains.spent - began  # what it is a part of isn't stopped by it
        if not found:
            self.vain = max(self.vain, vain + chains.spent - began)
        return found

    def rank(self, cell: Cell) -> int:
        """Return 1 if rules promise a goal by one step, 2 if ways to it lack something, 0 if they promise nothing."""
        level, goal, chains = self.first, (cell, self.call.goal[cell]), self.chains

        def ask() -> int:
            ways = chains.ways(level, goal) or chains.ways(level, goal, True)
            return min((1 + bool(way.unmet) for way in ways), default=0)

        return self.bounded(level, ask) or 0

    def follow(self, level: int, targets: Mapping[Cell, str], keep: Keep) -> list[RefinedStep] | None:
        """Do steps of a level, refined, that achieve the targets and keep the rest; None, and the table as it was, without any."""
        return self.bounded(level, lambda: self.tried(level, targets, keep))

    def tried(self, level: int, targets: Mapping[Cell, str], keep: Keep) -> list[RefinedStep] | None:
        """Do the same, however much comes to nothing."""
        call = self.call
        start, vain = len(call.table.trail), self.vain
        expanded = call.space.expanded
        began = call.space.effort + self.chains.spent
        outer, self.off = self.off, {}
        other = self.another(targets) if level == self.first and self.serial else None
        try:
            steps = self.led(level, targets, keep)
            if steps is not None and other is not None:
                self.serial = self.chains.far(level, other) < inf
                self.reached.add(other[0][0])
                if not self.serial:  # not tried again
                    call.table.undo(start)
                    steps = self.chains.together(level, list(self.open().items()))
        except TooMuchError:
            steps = None
        finally:
            self.off = outer
        if steps is not None and call.refiner.left_wrong(start, targets, keep) is None:
            if level == self.first:
                return steps  # made shorter in the end
            return list(call.refiner.pruned(steps, start, targets, keep))
        if level == self.first:
            self.wasted += call.space.expanded - expanded
        self.vain = max(self.vain, vain + call.space.effort + self.chains.spent - began)
        call.table.undo(start)
        return None

    def another(self, targets: Mapping[Cell, str]) -> tuple[Cell, str] | None:
        """Return another open goal of a target's kind to which chains lead now, if that wasn't asked of the kind before."""
        symmetry = self.call.program.symmetry.class_of
        kinds = {
            (cell[0], *map(symmetry.get, arguments_of(cell[1]))) for cell in targets if cell[0] not in self.reached
        }
        for cell, value in reversed(self.call.goal.items()) if kinds else ():
            if (
                cell not in targets
                and (cell[0], *map(symmetry.get, arguments_of(cell[1]))) in kinds
                and not self.call.met(cell)
            ):
                return (cell, value) if self.chains.far(self.first, (cell, value)) < inf else None
        return None

    def led(self, level: int, targets: Mapping[Cell, str], keep: Keep) -> list[RefinedStep] | None:
        """Do steps until nothing is off; None where no rule leads on."""
        table, space, off = self.call.table, self.call.space, self.off
        mark = len(table.trail)
        origin: dict[Cell, str] = {}
        for cell, value in targets.items():
            self._look(cell, value)
        closed: dict[Cell, int] = {}
        steps: list[RefinedStep] = []
        while off:
            before = _before(off, self.orders, self.call.program) if len(off) > 1 else {}
            among = sorted(
                (sum(other in off for other in before.get(g[0], ())), -self.chains.far(level, g), i, g)
                for i, g in enumerate(off.items())
                if closed.get(g[0], 0) < TWICE
            )
            done = None
            for _, far, _, goal in among:
                done = self.chains.attain(level, goal, Budget(int(SLACK - PATIENCE * far))) if far > -inf else None
                if done is not None:
                    steps += done
                    closed[goal[0]] = closed.get(goal[0], 0) + 1
                    break
            if done is None:
                return None
            for situation, key, old in table.trail[mark:]:
                first = origin.setdefault((situation, key), old)
                self._look((situation, key), targets.get((situation, key)) or keep((situation, key), first))
            for cell in space.defined:
                self._look(cell, targets.get(cell) or keep(cell, ""))
            mark = len(table.trail)
        return steps

    def _look(self, cell: Cell, wanted: str | None) -> None:
        if wanted is None or meets(self.call.table.now[cell[0]].get(cell[1], FALSE), wanted):
            self.off.pop(cell, None)
        else:
            self.off[cell] = wanted


def by_rules(guide: Guide) -> None:
    """Achieve goals by rules alone, as many as they can."""
    call, level = guide.call, guide.call.program.levels[0]
    reached = True
    while reached:
        reached = False
        for cell, value in sorted(guide.open().items(), key=lambda item: guide.waits(item[0])):
            if not call.met(cell):
                steps = guide.tried(level, {cell: value}, call.space.keeping(call.kept))
                if steps is not None:
                    call.steps += steps
                    call.kept[cell] = value
                    reached = True


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


def _before(goal: Mapping[Cell, str], orders: Iterable[Order], program: Program) -> dict[Cell, list[Cell]]:
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
                    if other != cell and Order.of(facts[other], facts[cell], constants) == order:
                        found.setdefault(cell, []).append(other)
    return found
