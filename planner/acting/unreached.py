"""Reasons for unachieved goals: blocking objects, discoveries, and failures."""

from __future__ import annotations

from dataclasses import replace

from confab.planner.acting.belief import Belief
from confab.planner.acting.record import Record
from confab.planner.acting.repair import replan
from confab.planner.hierarchical.planner import compiled
from confab.planner.plan import Limits, Reason
from confab.reasoner.symbols import Fact, Symbol


def blocked(belief: Belief, fact: Fact, limits: Limits) -> Reason | None:
    """Return the reason why a goal is unreachable if only immovable objects block the goal; otherwise return None."""
    if not belief.obstacles:
        return None
    free = belief.without_obstacles({fact.symbol: fact.value})
    steps, _ = replan(free, None, compiled(free), limits)
    if steps is None:
        return None
    things = belief.obstacles
    where = {name: [v for s, v in belief.state.items() if name in s.arguments[:1]] for name in things}
    told = "; ".join(f"{name} at {', '.join(where[name])} ({found.fixed})" for name, found in things.items())
    return Reason(f"{fact} is blocked by {told}", (*fact.symbol.arguments, fact.value, *things))


def with_discoveries(belief: Belief, record: Record, fact: Fact, reason: Reason) -> Reason:
    """Return the reason why a goal is unreachable, extended by discoveries about its objects."""
    there = {v for s, v in belief.state.items() if {*s.arguments[:1]} & {*fact.symbol.arguments}}
    found = [one.text for one, _ in record.discovered if one.individual in there and one.text]
    return replace(reason, text="; ".join((*found, reason.text))) if found else reason


def unrestored(belief: Belief, record: Record, rest: Fact, reason: Reason) -> Reason:
    """Return the reason why a symbol that the steps have changed can't be brought to rest: a failure, or else `reason`."""
    why = blamed(record, rest.symbol, rest.value) if belief.doubted else reason
    return replace(why, text=f"the rest value {rest} can't be restored: {why.text}")


def blamed(record: Record, symbol: Symbol, value: str) -> Reason:
    """Return the reason for dropping a goal: the last failure that concerns the goal, otherwise the last failure of the episode."""
    concerned = {*symbol.arguments, value}
    failures = record.failures
    near = [f for f in failures if concerned & {*f.objects, *f.step.arguments, *f.step.bindings.values()}]
    text, objects = f"{symbol} = {value} is given up", tuple[str, ...]()
    for failure in (near or failures)[-1:]:
        told = ", ".join(failure.objects) if failure.message in ("", failure.code) else failure.message
        text, objects = f"{text}: {failure.step} failed, {failure.code}: {told}", failure.objects
    return Reason(text, (*symbol.arguments, value, *objects))
