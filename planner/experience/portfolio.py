"""Planning with experience, which may lead but not spoil: a race of two searches that share nothing.

base       the fast planner, exactly as it is without memory
stream     the search that experience leads (`planner.experience.discrepancy_search`), one expansion at a time, between two
           expansions of the base
strict     the stream gets one expansion for every `DEBT` of the base on its level: never more than 1.05 times the base alone
leading    the stream leads as long as it gets on; after a stretch (`stretch_for`) of expansions without a new least number of
           open goals it owes the base `DEBT` expansions for each of them
guarded    the same, but only once the base has searched longer than such a task usually takes it (`patience_for`), needs detours
           for several goals, or has tried its first level in vain: in what it solves before, memory has no part. A clear
           preference is obeyed from the first on

Whichever arrives first has solved the problem; that there is no plan is for the base to prove. Memory that isn't trusted runs in
strict mode whatever was asked for, and one that knows none of the level's behaviours isn't asked at all.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass, field, replace
from time import perf_counter

from planner.experience.choice_points import Field
from planner.experience.discrepancy_search import Stream
from planner.experience.features import CROWD, Schema
from planner.experience.scoring import Judge, preferred
from planner.hierarchical import planner as fast
from planner.hierarchical.operators import Program
from planner.hierarchical.postoptimization import Improver
from planner.hierarchical.subplans import LimitError
from planner.plan import Counts, Limits, Outcome, Status
from reasoner.amounts import meets
from reasoner.memory.counts import Experience
from reasoner.symbols import Problem

DEBT = 20
STRETCH, PER_OPEN = 12, 1.5  # expansions without getting on: at least, and for each goal that is open in the beginning
PATIENCE = 100  # expansions of the base before experience leads, and besides
PER_GOAL = 15  # for each goal that is open


@dataclass
class Memory:
    """Experience as the planner takes it: what it says, for behaviours and classes as this domain has them.

    Parameters
    ----------
    experience : Experience
    trusted : bool
        Whether it may lead; else it runs in strict mode.
    """

    experience: Experience
    trusted: bool = True
    _judge: Judge | None = None
    _known: set[str] | None = None
    _liked: set[tuple[str, str, str]] | None = None

    def judge(self, schema: Schema) -> Judge:
        """Return what was learned, read once."""
        if self._judge is None:
            behaviors = schema.problem.domain.behaviors.values()
            roles = {behavior.name: schema.roles(behavior) for behavior in behaviors}
            self._judge = Judge(self.experience, schema.problem.parents, roles)
        return self._judge

    def stream(self, program: Program, problem: Problem, level: int) -> Stream:
        """Return the search that this memory leads."""
        schema = Schema(program)
        return Stream(Field(program, problem, level, schema), self.judge(schema))

    def knows(self, behaviors: Iterable[str]) -> bool:
        """Whether anything was counted of any of these behaviours."""
        if self._known is None:
            self._known = {
                c.behavior for (_, epoch), tallies in self.experience.counts.items() if not epoch for c in tallies
            }
        return not self._known.isdisjoint(behaviors)

    def prefers(self, problem: Problem, level: int) -> bool:
        """Whether somebody was clearly preferred to others, among those whom the behaviours of a level have to do with here."""
        if self._liked is None:
            self._liked = preferred(self.experience)
        here = {b.name: b for b in problem.domain.at_level(level)}
        for behavior, role, who in self._liked:
            if behavior in here:
                kinds = {term.name[1:]: term.kind for term in (*here[behavior].parameters, *here[behavior].variables)}
                among = problem.classes.get(kinds.get(role, ""), ())
                if who in among and len(among) <= CROWD:
                    return True
        return False


def patience_for(problem: Problem) -> int:
    """Return how many expansions the base gets before experience leads: a search that takes no more is cheaper without it."""
    return PATIENCE + PER_GOAL * unmet(problem)


def stretch_for(problem: Problem) -> int:
    """Return how many expansions experience may make without getting on: the more goals, the longer the ways around."""
    return max(STRETCH, int(PER_OPEN * unmet(problem)))


def unmet(problem: Problem) -> int:
    """Return how many goals are open in the beginning."""
    return sum(not meets(problem.initial.get(symbol), value) for symbol, value in problem.goal.items())


class ArrivedError(Exception):
    """The stream reached the goal while the base was at it."""


@dataclass
class Race:
    """One race: the stream, and what both have spent."""

    begin: Callable[[], Stream]
    level: int
    strict: bool
    patience: int
    stretch: int
    deadline: float | None = None
    spent: dict[int, int] = field(default_factory=dict)
    base: int = 0
    owed: int = 0
    begun: Stream | None = None

    @property
    def stream(self) -> Stream:
        """The stream, which costs nothing before it is asked for."""
        if self.begun is None:
            self.begun = self.begin()
        return self.begun

    def watch(self, level: int | None) -> None:
        """Let the stream have its share before an expansion of the base; before what costs most (None) whatever the patience."""
        if self.strict:
            if self.base >= DEBT and self.stream.expanded < self.base // DEBT and self.stream.expand():
                raise ArrivedError
        elif self.base >= (self.owed if level is None else max(self.owed, self.patience)) and self.lead():
            raise ArrivedError
        if level is not None:
            self.base += level == self.level
            self.spent[level] = self.spent.get(level, 0) + 1

    def lead(self) -> bool:
        """Let the stream go on as long as it gets nearer; whether it reached the goal."""
        stream = self.stream
        stream.fruitless = 0
        began = stream.expanded
        while not stream.exhausted and stream.fruitless < self.stretch:
            if self.deadline is not None and stream.expanded % 16 == 15 and perf_counter() > self.deadline:
                break
            if stream.expand():
                return True
        self.owed = self.base + DEBT * max(min(stream.expanded - began, self.stretch), 1)
        return False


def plan(
    problem: Problem,
    memory: Memory | None = None,
    mode: str = "guarded",
    limits: Limits = Limits(),  # noqa: B008 - frozen
    using: fast.Compiled | None = None,
    patience: int | None = None,
    improve: int = fast.IMPROVEMENTS,
    leave_levels: bool = True,
) -> Outcome:
    """Plan with experience.

    Parameters
    ----------
    problem : Problem
    memory : Memory, optional
    mode : str
        ``strict``, ``guarded`` or ``leading``: how far experience may lead.
    limits : Limits
    using : Compiled, optional
        As for `planner.hierarchical.planner.plan`.
    patience : int
        Expansions that the base gets before experience leads; if left out, as `mode` says.
    improve, leave_levels
        As for `planner.hierarchical.planner.plan`.

    Returns
    -------
    Outcome
        `search` counts both searches; the stream's expansions are those of the first level.
    """
    began = perf_counter()
    using = using or fast.compiled(problem)
    first = problem.domain.levels[0]
    if memory is None or not memory.knows(b.name for b in problem.domain.at_level(first)):
        return fast.plan(problem, limits=limits, improve=improve, using=using, leave_levels=leave_levels)
    deadline = None if limits.seconds is None else began + limits.seconds

    def begin() -> Stream:
        return memory.stream(using.program, problem, first)

    strict = mode == "strict" or not memory.trusted
    if patience is None:
        eager = mode == "leading" or memory.prefers(problem, first)
        patience = 0 if eager or strict else patience_for(problem)
    race = Race(begin, first, strict, patience, stretch_for(problem), deadline)
    outcome: Outcome | None = None
    lost: dict[int, int] = {}  # what the base spent before the stream found what couldn't be refined
    while outcome is None:
        lost = dict(race.spent)
        if race.begun is None or race.begun.solution is None:
            with suppress(ArrivedError):
                outcome = fast.plan(
                    problem, limits=limits, improve=improve, using=using, watch=race.watch, leave_levels=leave_levels
                )
        if race.begun is not None and race.begun.solution is not None:
            outcome = refined(problem, using, race.begun, deadline, limits.expansions, improve)
    if outcome.status is Status.GAVE_UP and not race.strict:
        stream = race.stream
        while outcome.plan is None and stream.expanded < limits.expansions and not stream.exhausted:
            if deadline is not None and perf_counter() > deadline:
                break
            if stream.expand():
                outcome = refined(problem, using, stream, deadline, limits.expansions, improve) or outcome
    if race.begun is None:
        return replace(outcome, seconds=perf_counter() - began)
    stream = race.begun
    search = {level: Counts(c.generated, c.evaluated, c.expanded) for level, c in outcome.search.items()}
    for level, expanded in (race.spent if stream.solution is not None else lost).items():
        search.setdefault(level, Counts()).expanded += expanded
    search.setdefault(first, Counts()).add(Counts(stream.generated, stream.evaluated, stream.expanded))
    return replace(outcome, search=search, seconds=perf_counter() - began)


def planner_with(memory: Memory, mode: str = "guarded") -> Callable[[Problem], Outcome]:
    """Return what plans any problem of one domain with experience."""
    return lambda problem: plan(problem, memory, mode)


def refined(
    problem: Problem, using: fast.Compiled, stream: Stream, deadline: float | None, most: int, improve: int
) -> Outcome | None:
    """Refine the stream's solution down to primitives and shorten it; None if a step can't be, which is then forbidden there."""
    assert stream.solution is not None
    call = fast.Call(problem, using, deadline, most)
    first = problem.domain.levels[0]
    for position, (name, arguments) in enumerate(stream.solution):
        step = call.refiner.do(first, name, arguments)
        if step is None:
            stream.forbid(stream.solution[: position + 1])
            return None
        call.steps.append(step)
    with suppress(LimitError):  # then the first plan is what there is
        if improve:
            call.steps = Improver(call.refiner, using.shapes, (improve + 1) // 2).improve(call.steps)
    return call.outcome(Status.SOLVED, call.tree(), None, 0.0)
