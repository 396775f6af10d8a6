"""Results derived from a state stay valid with the state; results for one individual hold for symmetric individuals."""

import random
from collections.abc import Iterator, Sequence
from typing import Any

import pytest

from confab.planner.hierarchical.call import Call, Compiled
from confab.planner.hierarchical.condition_tests import Env
from confab.planner.hierarchical.operators import Achiever, Program
from confab.planner.hierarchical.planner import plan
from confab.planner.hierarchical.relevance import relevant
from confab.planner.hierarchical.scope import focus
from confab.planner.hierarchical.search_budget import WIDER
from confab.planner.hierarchical.subgoals import Subgoals
from confab.planner.plan import Limits, Status
from confab.planner.transitions import Cell
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import Condition, RelationCondition, SituationType, Witness
from worlds.families import family, random_table
from worlds.rooms import rooms
from worlds.writing import becomes, behavior, has, world

CASES = [("served", family("served", 6)), ("full", family("full", 6)), ("handover", family("handover", 8))]
CASES += [(f"random {seed}", random_table(seed)) for seed in range(50_000, 50_006)] + [("rooms", rooms(6, 1))]


def disable_cache(subgoals: Subgoals, monkeypatch: pytest.MonkeyPatch) -> None:
    """Let the cache keep no results."""

    def fitting(achiever: Achiever, condition: Condition, env: Env, term: str, values: Sequence[str]) -> Iterator[str]:
        return (value for value in values if subgoals.tests.holds(achiever, condition, {**env, term: value}))

    monkeypatch.setattr(subgoals.tests, "fitting", fitting)


@pytest.mark.parametrize(("name", "problem"), CASES, ids=[name for name, _ in CASES])
def test_cached_subgoals_are_those_of_the_present_state(
    name: str, problem: Problem, monkeypatch: pytest.MonkeyPatch
) -> None:
    rng = random.Random(name)
    asked = 0
    program = Program(problem)
    for level in problem.domain.levels:
        kept, fresh = (Call(problem, Compiled(program), None, 100_000) for _ in range(2))
        disable_cache(fresh.space.subgoals, monkeypatch)
        for _ in range(12):
            for (at, situation), achievers in program.achievers.items():
                cells = [cell for cell in kept.goal.items() if cell[0][0] == situation]
                for achiever in achievers if at == level else ():
                    for (_, key), value in cells:
                        arguments = (key,) if isinstance(key, str) else key
                        achieve = kept.space.achieving[achiever.behavior, achiever.effect]
                        for _, unmet, env in achieve(*arguments, value):
                            for number in unmet:
                                anew = list(fresh.space.subgoals.of(achiever, achiever.soft[number], env, level))
                                assert list(kept.space.subgoals.towards(achiever, number, env, level)) == anew
                                assert list(kept.space.subgoals.towards(achiever, number, env, level)) == anew
                                asked += 1
            off = {cell: value for cell, value in kept.goal.items() if not kept.met(cell)}
            found = list(relevant(kept.space, level, off, 3))
            if not found:
                break
            ground = rng.choice(found)
            for field in (kept, fresh):
                done = field.space.forward[ground[0]](*ground[1])
                assert done is not None
                field.space.apply(done[1])
    assert asked or not problem.goal


def test_tuples_of_many_places_are_searched_by_their_known_arguments(monkeypatch: pytest.MonkeyPatch) -> None:
    """A turntable has four of many spots: the search doesn't test all combinations of four spots."""
    spots = tuple(f"spot{i}" for i in range(40))
    tables = tuple(f"table{i}" for i in range(10))
    rings = frozenset((table, *spots[4 * i : 4 * i + 4]) for i, table in enumerate(tables))
    at = SituationType("AT", ("Piece",), "Spot")
    turn = behavior(
        "TURN", 1, "?piece:Piece ?table:Table ?a:Spot ?b:Spot ?c:Spot ?d:Spot",
        [has("AT", "?piece", "?a"), RelationCondition("RING", ("?table", "?a", "?b", "?c", "?d"))],
        [becomes("AT", "?piece", "?b")],
    )  # fmt: skip
    classes = {"Piece": ("piece",), "Spot": spots, "Table": tables}
    problem = world([at], [turn], classes, {"AT piece": spots[8]}, {"AT piece": spots[9]}, relations={"RING": rings})
    asked: list[tuple[str, ...]] = []
    picked = Program._picked

    def counted(program: Program, candidates: tuple[str, ...], *how: Any) -> Sequence[str]:
        asked.append(candidates)
        return picked(program, candidates, *how)

    monkeypatch.setattr(Program, "_picked", counted)
    call = Call(problem, Compiled(Program(problem)), None, 100)
    found = list(call.space.achieving["TURN", 0]("piece", spots[9]))
    assert [arguments for arguments, _, _ in found] == [("piece", "table2", *spots[8:12])]
    assert len(asked) < len(spots)


def museum(rooms: int) -> Problem:
    """A picture hangs at one end of a row of rooms, and its goal is the other end.

    A crate is in between, and all doors are shut.
    """
    row = tuple(f"room{i}" for i in range(rooms))
    doors = tuple(f"door{i}" for i in range(rooms - 1))
    leads = [(door, room) for i, door in enumerate(doors) for room in row[i : i + 2]]
    sides = tuple(RelationCondition("LEADS", ("?door", side)) for side in ("?from", "?to"))
    open_ = Witness("?door", "Door", (has("DOOR", "?door", "open"), *sides))
    here, there = has("CRATE_AT", "?c", "?room"), becomes("CRATE_AT", "?c", "?to")
    return world(
        [
            SituationType("HANGS", ("Picture",), "HANGS"),
            SituationType("PACKED", ("Picture",), "PACKED", level=2, rest="unpacked"),
            SituationType("CRATE_AT", ("Crate",), "Room", level=2),
            SituationType("DOOR", ("Door",), "DOOR", level=2, rest="shut"),
        ],
        [
            behavior("MOVE", 1, "?p:Picture ?to:Room", [has("HANGS", "?p", "?at")], [becomes("HANGS", "?p", "?to")], "?at:Room"),
            behavior("OPEN", 2, "?d:Door", [has("DOOR", "?d", "shut")], [becomes("DOOR", "?d", "open")]),
            behavior("SHUT", 2, "?d:Door", [has("DOOR", "?d", "open")], [becomes("DOOR", "?d", "shut")]),
            behavior("PUSH", 2, "?c:Crate ?to:Room", [has("CRATE_AT", "?c", "?from"), open_], [there], "?from:Room"),
            behavior("PACK", 2, "?p:Picture ?c:Crate", [has("HANGS", "?p", "?room"), here],
                     [becomes("HANGS", "?p", "crated"), becomes("PACKED", "?p", "?c")], "?room:Room"),
            behavior("HANG", 2, "?p:Picture ?c:Crate", [has("PACKED", "?p", "?c"), here],
                     [becomes("HANGS", "?p", "?room"), becomes("PACKED", "?p", "unpacked")], "?room:Room"),
        ],
        {"Picture": ("picture",), "Crate": ("crate",), "Room": row, "Door": doors, "DOOR": ("open", "shut"),
         "HANGS": (*row, "crated"), "PACKED": ("crate", "unpacked")},
        {"HANGS picture": row[0], "PACKED picture": "unpacked", "CRATE_AT crate": row[rooms // 2],
         **{f"DOOR {door}": "shut" for door in doors}},
        {"HANGS picture": row[-1]},
        {"LEADS": leads},
        {"crated": 2},
    )  # fmt: skip


def test_the_scope_of_a_search_contains_the_rooms_and_closed_doors_on_the_path() -> None:
    problem = museum(9)
    call = Call(problem, Compiled(Program(problem)), None, 10_000)
    target: dict[Cell, str] = {("CRATE_AT", "crate"): "room8"}
    assert {f"room{i}" for i in range(4, 9)} | {f"door{i}" for i in range(4, 8)} <= (
        focus(call.space, 2, target, WIDER) or set()
    )


def test_a_step_with_a_long_detour_is_refined_with_few_expansions() -> None:
    outcome = plan(museum(21), limits=Limits(expansions=6_000))
    assert outcome.status is Status.SOLVED and outcome.plan is not None
    assert outcome.plan.length[1] == 1 and not outcome.given_up
