"""Rest values in episodes: what executed steps have changed is at rest in the end, unless a goal is about it (docs/levels.md)."""

from __future__ import annotations

from typing import Any

import pytest

from confab.planner.acting.dispatching import Concurrency
from confab.planner.acting.episode import End, Episode, Intervention, InterventionKind
from confab.planner.acting.executive import act
from confab.planner.acting.symbolic_world import FaultInjection, SymbolicWorld
from confab.planner.acting.world import WorldReport
from confab.planner.hierarchical.planner import plan
from confab.planner.plan import Plan, Step
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import FALSE, TRUE, Fact, SituationType, State, Symbol
from worlds.writing import becomes, behavior, has, world

OPEN, FOUND, SOLD, JAMMED = (
    Symbol(*of) for of in (("OPEN", ("drawer",)), ("FOUND", ("pen",)), ("SOLD", ("pen",)), ("JAMMED", ("drawer",)))
)


def drawers(levels: int = 1, goal: tuple[str, ...] = ("FOUND pen",), **initial: str) -> Problem:
    """Return a task with a drawer whose rest value is shut: only an open drawer gives the pen, and a jammed one isn't shut."""
    find = [behavior("L1_FIND", 1, "?p:Pen", [has("FOUND", "?p", FALSE)], [becomes("FOUND", "?p", TRUE)])]
    return world(
        [
            SituationType("FOUND", ("Pen",), "Truth", boolean=True),
            SituationType("SOLD", ("Pen",), "Truth", boolean=True),
            SituationType("OPEN", ("Drawer",), "Truth", boolean=True, rest=FALSE, level=levels),
            SituationType("JAMMED", ("Drawer",), "Truth", boolean=True, level=levels),
        ],
        [
            *find[: levels - 1],
            behavior("OPEN_IT", levels, "?d:Drawer", [has("OPEN", "?d", FALSE)], [becomes("OPEN", "?d", TRUE)]),
            behavior("SHUT_IT", levels, "?d:Drawer", [has("JAMMED", "?d", FALSE)], [becomes("OPEN", "?d", FALSE)]),
            behavior("FIND", levels, "?p:Pen ?d:Drawer", [has("OPEN", "?d", TRUE)], [becomes("FOUND", "?p", TRUE)]),
        ],
        {"Pen": ("pen",), "Drawer": ("drawer",)},
        {"FOUND pen": FALSE, "SOLD pen": FALSE, "OPEN drawer": FALSE, "JAMMED drawer": FALSE}
        | {f"{name} drawer": value for name, value in initial.items()},
        dict.fromkeys(goal, TRUE),
    )  # fmt: skip


def planned(problem: Problem) -> Plan:
    found = plan(problem).plan
    assert found is not None
    return found


def after(count: int, change: InterventionKind, symbol: Symbol, levels: int = 1) -> Intervention:
    """Return an intervention after some primitives of the plan open, find, shut."""
    facts = () if change is InterventionKind.DROP_GOAL else (Fact(symbol, TRUE),)
    path = (count - 1,) if levels == 1 else (0, count - 1)
    return Intervention(change, facts, symbol, after=path)


def acted(problem: Problem, *interventions: Intervention, fault: FaultInjection | None = None, **how: Any) -> Episode:
    return act(problem, SymbolicWorld(problem, fault=fault), interventions=interventions, **how)


def names(episode: Episode) -> list[str]:
    return [step.behavior for step in episode.done.primitives]


@pytest.mark.parametrize("levels", [1, 2])
@pytest.mark.parametrize("count", [1, 2])
@pytest.mark.parametrize(
    ("change", "symbol"),
    [
        (InterventionKind.DROP_GOAL, FOUND),
        (InterventionKind.WORLD, FOUND),
        (InterventionKind.GOAL, SOLD),
    ],
)
def test_what_the_steps_changed_is_at_rest_in_the_end_whatever_changes_the_plan(
    levels: int, count: int, change: InterventionKind, symbol: Symbol
) -> None:
    episode = acted(drawers(levels), after(count, change, symbol, levels))
    assert episode.observed[OPEN] == FALSE
    assert (episode.status is End.REACHED) is (symbol != SOLD)
    assert not any(str(OPEN.arguments[0]) in reason.text for reason in episode.reasons)


@pytest.mark.parametrize("levels", [1, 2])
@pytest.mark.parametrize("count", [1, 2])
def test_an_episode_names_the_rest_value_that_cannot_be_restored(levels: int, count: int) -> None:
    episode = acted(drawers(levels), after(count, InterventionKind.WORLD, JAMMED, levels))
    assert episode.status is End.IMPOSSIBLE
    assert episode.observed[OPEN] == TRUE
    assert episode.observed[FOUND] == TRUE
    (reason,) = episode.reasons
    assert "rest value drawer OPEN false can't be restored" in reason.text
    assert "FOUND" not in reason.text


def test_a_given_plan_that_breaks_a_rest_value_is_completed_or_is_not_reached() -> None:
    problem = drawers()
    cut = Plan(planned(problem).steps[:2])
    episode = acted(problem, plan=cut)
    assert episode.status is End.REACHED
    assert names(episode) == ["OPEN_IT", "FIND", "SHUT_IT"]
    stuck = acted(drawers(JAMMED=TRUE), plan=cut)
    assert stuck.status is End.IMPOSSIBLE
    assert "drawer OPEN false" in stuck.reasons[0].text


def test_a_goal_releases_a_changed_symbol_only_as_long_as_it_is_a_goal() -> None:
    problem = drawers(goal=("FOUND pen", "OPEN drawer"))
    assert names(acted(problem)) == ["OPEN_IT", "FIND"]
    dropped = acted(problem, after(1, InterventionKind.DROP_GOAL, OPEN))
    assert dropped.status is End.REACHED
    assert names(dropped) == ["OPEN_IT", "FIND", "SHUT_IT"]


def test_what_a_person_has_changed_and_no_step_need_not_be_at_rest() -> None:
    problem = drawers(OPEN=TRUE)
    episode = acted(problem, after(1, InterventionKind.DROP_GOAL, FOUND))
    assert names(episode) == ["FIND"]
    assert episode.status is End.REACHED


@pytest.mark.parametrize("failures", [2, 100])
def test_a_rest_value_that_failures_prevent_is_tried_again_and_otherwise_given_up(failures: int) -> None:
    left = [failures]

    def jams(step: Step, state: State) -> WorldReport | None:
        if step.behavior != "SHUT_IT" or not left[0]:
            return None
        left[0] -= 1
        return WorldReport(False, "stuck", step.arguments, "the drawer sticks")

    episode = acted(drawers(), fault=jams)
    assert episode.observed[OPEN] == (TRUE if failures > 2 else FALSE)
    assert episode.status is (End.GAVE_UP if failures > 2 else End.REACHED)


def test_several_actors_leave_what_they_changed_at_rest_after_a_goal_is_dropped() -> None:
    episode = acted(drawers(), after(1, InterventionKind.DROP_GOAL, FOUND), together=Concurrency())
    assert episode.status is End.REACHED
    assert episode.observed[OPEN] == FALSE


def test_goals_that_are_reachable_only_together_are_reached_although_another_goal_is_impossible() -> None:
    problem = drawers(goal=("FOUND pen", "OPEN drawer", "SOLD pen"), JAMMED=TRUE)
    episode = acted(problem)
    assert episode.status is End.IMPOSSIBLE
    assert (episode.observed[FOUND], episode.observed[OPEN]) == (TRUE, TRUE)
    (reason,) = episode.reasons
    assert "SOLD" in reason.text


def test_a_goal_that_was_set_aside_is_pursued_again_after_a_change_of_the_goals() -> None:
    problem = drawers(JAMMED=TRUE)
    hope = Intervention(InterventionKind.GOAL, (Fact(OPEN, TRUE),), at=0.0)
    alone = acted(problem)
    assert alone.status is End.IMPOSSIBLE
    assert names(alone) == []
    episode = acted(problem, hope)
    assert episode.status is End.REACHED
    assert names(episode) == ["OPEN_IT", "FIND"]


def test_of_two_goals_that_exclude_each_other_the_goal_that_is_reachable_alone_is_reached() -> None:
    heat, pen = Symbol("HEAT", ("oven",)), Symbol("FOUND", ("pen",))
    problem = world(
        [SituationType("HEAT", ("Oven",), "Heat", rest="cold"), SituationType("FOUND", ("Pen",), "Truth", boolean=True)],
        [
            behavior("WARM", 1, "?o:Oven", [has("HEAT", "?o", "cold")], [becomes("HEAT", "?o", "warm")]),
            behavior("HEAT_IT", 1, "?o:Oven", [has("HEAT", "?o", "cold")], [becomes("HEAT", "?o", "hot")]),
            behavior("MELT", 1, "?p:Pen ?o:Oven", [has("HEAT", "?o", "warm")], [becomes("FOUND", "?p", TRUE)]),
        ],
        {"Pen": ("pen",), "Oven": ("oven",), "Heat": ("cold", "warm", "hot")},
        {"HEAT oven": "cold", "FOUND pen": FALSE},
        {"HEAT oven": "hot", "FOUND pen": TRUE},
    )  # fmt: skip
    episode = acted(problem)
    assert episode.status is End.IMPOSSIBLE
    assert (episode.observed[heat], episode.observed[pen]) == ("hot", FALSE)
