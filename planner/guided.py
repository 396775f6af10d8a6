"""Planning with experience, which may lead but not spoil: a race of two searches that share nothing.

base       the fast planner, exactly as it is without memory
stream     the search that experience leads (`planner.stream`), one expansion at a time, between two expansions of the base
strict     the stream gets one expansion for every `DEBT` of the base on its level: never more than 1.05 times the base alone
guarded    once the base has spent `patience` expansions, the stream leads as long as it gets on; after `STRETCH` expansions
           without a new least number of open goals it owes the base `DEBT` expansions for each of them

Whichever arrives first has solved the problem; that there is no plan is for the base to prove. Memory that isn't trusted runs in
strict mode whatever was asked for, and one that knows none of the level's behaviours isn't asked at all.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from time import perf_counter

from planner import fast
from planner.deciding import Field, Ground
from planner.describing import Schema
from planner.judging import Judge
from planner.plan import Counts, Limits, Outcome, Status
from planner.stream import Stream
from planner.table import Table
from reasoner.experience import Experience
from reasoner.symbols import Problem

DEBT = 20
STRETCH = 8
PATIENCE = 0


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

    def judge(self, schema: Schema) -> Judge:
        """Return what was learned, read once."""
        if self._judge is None:
            behaviors = schema.problem.domain.behaviors.values()
            roles = {behavior.name: schema.roles(behavior) for behavior in behaviors}
            self._judge = Judge(self.experience, schema.problem.parents, roles)
        return self._judge


class ArrivedError(Exception):
    """The stream reached the goal while the base was at it."""


@dataclass
class Race:
    """One race: the stream, and what both have spent."""

    stream: Stream
    strict: bool
    patience: int
    deadline: float | None = None
    spent: dict[int, int] = field(default_factory=dict)
    base: int = 0
    owed: int = 0

    def hook(self, level: int, table: Table, choices: Sequence[Ground]) -> Sequence[Ground]:
        """Count an expansion of the base, let the stream have its share, and leave the base's choices as they are."""
        if self.strict:
            if self.stream.expanded < self.base // DEBT and self.stream.expand():
                raise ArrivedError
        elif self.base >= max(self.owed, self.patience) and self.lead():
            raise ArrivedError
        self.base += level == self.stream.field.level
        self.spent[level] = self.spent.get(level, 0) + 1
        return choices

    def lead(self) -> bool:
        """Let the stream go on as long as it gets nearer; whether it reached the goal."""
        stream = self.stream
        stream.fruitless = 0
        began = stream.expanded
        while not stream.exhausted and stream.fruitless < STRETCH:
            if self.deadline is not None and stream.expanded % 16 == 15 and perf_counter() > self.deadline:
                break
            if stream.expand():
                return True
        self.owed = self.base + DEBT * max(min(stream.expanded - began, STRETCH), 1)
        return False


def plan(
    problem: Problem,
    memory: Memory | None = None,
    mode: str = "guarded",
    limits: Limits = Limits(),  # noqa: B008 - frozen
    using: fast.Compiled | None = None,
    patience: int = PATIENCE,
) -> Outcome:
    """Plan with experience.

    Parameters
    ----------
    problem : Problem
    memory : Memory, optional
    mode : str
        ``strict`` or ``guarded``: how far experience may lead.
    limits : Limits
    using : Compiled, optional
        As for `planner.fast.plan`.
    patience : int
        Expansions that the base gets before experience leads; what it solves within them costs nothing more.

    Returns
    -------
    Outcome
        `search` counts both searches; the stream's expansions are those of the first level.
    """
    began = perf_counter()
    using = using or fast.compiled(problem)
    first = problem.domain.levels[0]
    schema = Schema(using.program)
    judge = None if memory is None else memory.judge(schema)
    if memory is None or judge is None or not judge.knows(b.name for b in problem.domain.at_level(first)):
        return fast.plan(problem, limits=limits, using=using)
    deadline = None if limits.seconds is None else began + limits.seconds
    stream = Stream(Field(using.program, problem, first, schema), judge)
    race = Race(stream, mode == "strict" or not memory.trusted, patience, deadline)
    outcome: Outcome | None = None
    while outcome is None:
        if stream.solution is None:
            with suppress(ArrivedError):
                outcome = fast.plan(problem, advice=race.hook, limits=limits, using=using)
        if stream.solution is not None:
            outcome = refined(problem, using, stream, deadline)
    if outcome.status is Status.GAVE_UP and not race.strict:
        while outcome.plan is None and stream.expanded < limits.expansions and not stream.exhausted:
            if deadline is not None and perf_counter() > deadline:
                break
            if stream.expand():
                outcome = refined(problem, using, stream, deadline) or outcome
    search = {level: Counts(c.generated, c.evaluated, c.expanded) for level, c in outcome.search.items()}
    for level, expanded in race.spent.items() if stream.solution is not None else ():
        search.setdefault(level, Counts()).expanded += expanded
    search.setdefault(first, Counts()).add(Counts(stream.generated, stream.evaluated, stream.expanded))
    return replace(outcome, search=search, seconds=perf_counter() - began)


def refined(problem: Problem, using: fast.Compiled, stream: Stream, deadline: float | None) -> Outcome | None:
    """Refine the stream's solution down to primitives; None if a step can't be, which is then forbidden where it stands."""
    assert stream.solution is not None
    call = fast.Call(problem, using, deadline, None, Limits().expansions)
    first = problem.domain.levels[0]
    for position, (name, arguments) in enumerate(stream.solution):
        step = call.refiner.do(first, name, arguments)
        if step is None:
            stream.forbid(stream.solution[: position + 1])
            return None
        call.steps.append(step)
    cache, counts = call.refiner, call.segments.counts
    return Outcome(Status.SOLVED, call.tree(), None, counts, call.fallbacks, hits=cache.hits, misses=cache.misses)
