"""Rules beside the memoryless search, which they can't disturb: they have tables of their own, and a share of its expansions.

The memoryless search runs as if there were no memory. Whenever it has done, on the most abstract level, `share` times the
expansions that rules had on all and one try more may have, rules alone try the whole task from its beginning, with twice as
many as the last time. Nothing is searched for them on any level, so that a try ends where its expansions do. Hence no call
has more expansions than the memoryless one and a `share`-th of these, neither on the most abstract level nor on all together.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from time import perf_counter

from planner.experience.leading import Guide, by_rules
from planner.hierarchical import planner as fast
from planner.hierarchical.serialization import Call, Compiled
from planner.hierarchical.subplans import EXPANSION
from planner.plan import LimitError, Limits, Outcome, Status
from reasoner.symbols import Problem

LEAST = 4
"""So many expansions the first try has, and the next one twice as many."""


class _Led(Exception):  # noqa: N818 - no error: rules have reached the goals
    """Rules have reached all goals of a call."""

    def __init__(self, call: Call) -> None:
        self.call = call


def raced(
    problem: Problem,
    guide: Callable[[Call], Guide],
    share: int,
    limits: Limits,
    using: Compiled,
    improve: int,
    leave_levels: bool,
) -> Outcome:
    """Plan without memory, while rules may have one of so many expansions; what reaches the goals first is the plan.

    Parameters
    ----------
    problem : Problem
    guide : function of a call
        Binds the rules.
    share : int
    limits, using, improve, leave_levels
        As for `planner.hierarchical.planner.plan`.

    Returns
    -------
    Outcome
    """
    begin = perf_counter()
    base: list[Call] = []
    tries: list[Call] = []
    spent = 0

    def watch(_: int | None) -> None:
        nonlocal spent
        most = LEAST << len(tries)
        if not base or (spent + most + 1) * share > base[0].segments.counts[base[0].program.levels[0]].expanded:
            return
        call = Call(problem, using, base[0].segments.deadline, most, searching=False)
        tries.append(call)
        rules = guide(call)
        rules.chains.most = most * EXPANSION
        with suppress(LimitError):
            by_rules(rules)
        spent += call.segments.expanded
        if all(map(call.met, call.goal)):
            raise _Led(call)

    def first(call: Call) -> None:
        base.append(call)

    done: Call | None = None
    try:
        outcome = fast.plan(
            problem, limits=limits, improve=0, using=using, watch=watch, leave_levels=leave_levels, advised=first
        )
        if outcome.status is Status.SOLVED and all(map(base[0].met, base[0].goal)):  # and not flat
            done = base[0]
    except _Led as led:
        done = led.call
        outcome = base[0].outcome(Status.SOLVED, done.tree(), None, perf_counter() - begin)
    for call in tries:
        for level, counts in call.segments.counts.items():
            base[0].segments.counts[level].add(counts)
    search = dict(outcome.search)
    base.clear()  # what is made shorter isn't raced
    if done is not None and improve:
        plan = fast.shortened(done, improve, leave_levels)
        return replace(outcome, plan=plan, search=search, given_up=tuple(done.given_up))
    return outcome
