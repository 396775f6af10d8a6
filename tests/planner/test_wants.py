"""What is read off a state once holds as long as the state does, and what is asked of one individual holds of its likes."""

import random
from collections.abc import Sequence
from typing import Any

import pytest

from planner.hierarchical.operators import Achiever, Program
from planner.hierarchical.serialization import Call, Compiled
from planner.hierarchical.subgoals import Env, Wants
from reasoner.symbols import Condition, Problem, RelationCondition, SituationType
from worlds.families import family, random_table
from worlds.rooms import rooms
from worlds.writing import becomes, behavior, has, world

CASES = [("served", family("served", 6)), ("full", family("full", 6)), ("handover", family("handover", 8))]
CASES += [(f"random {seed}", random_table(seed)) for seed in range(50_000, 50_006)] + [("rooms", rooms(6, 1))]


def ask_anew(wants: Wants, monkeypatch: pytest.MonkeyPatch) -> None:
    """Let nothing be kept of what was asked before."""

    def would_hold(achiever: Achiever, condition: Condition, env: Env, term: str, value: str) -> bool:
        return wants.holds(achiever, condition, {**env, term: value})

    monkeypatch.setattr(wants, "_would_hold", would_hold)


@pytest.mark.parametrize(("name", "problem"), CASES, ids=[name for name, _ in CASES])
def test_wants_that_are_kept_are_those_of_the_present_state(
    name: str, problem: Problem, monkeypatch: pytest.MonkeyPatch
) -> None:
    rng = random.Random(name)
    asked = 0
    program = Program(problem)
    for level in problem.domain.levels:
        kept, fresh = (Call(problem, Compiled(program), None, 100_000) for _ in range(2))
        ask_anew(fresh.segments.wants, monkeypatch)
        for _ in range(12):
            for (at, situation), achievers in program.achievers.items():
                cells = [cell for cell in kept.goal.items() if cell[0][0] == situation]
                for achiever in achievers if at == level else ():
                    for (_, key), value in cells:
                        arguments = (key,) if isinstance(key, str) else key
                        achieve = kept.segments.achieve[achiever.behavior, achiever.effect]
                        for _, unmet, env in achieve(*arguments, value):
                            for number in unmet:
                                anew = list(fresh.segments.wants.of(achiever, achiever.soft[number], env, level))
                                assert list(kept.segments.wants.towards(achiever, number, env, level)) == anew
                                assert list(kept.segments.wants.towards(achiever, number, env, level)) == anew
                                asked += 1
            off = {cell: value for cell, value in kept.goal.items() if not kept.met(cell)}
            found = list(kept.segments.relevant(level, off, 3))
            if not found:
                break
            ground = rng.choice(found)
            for field in (kept, fresh):
                done = field.segments.forward[ground[0]](*ground[1])
                assert done is not None
                field.segments.apply(done[1])
    assert asked or not problem.goal


def test_tuples_of_many_places_are_gone_through_by_what_is_known_of_them(monkeypatch: pytest.MonkeyPatch) -> None:
    """A turntable has four of many spots: nobody asks of any four spots whether they are its."""
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
    found = list(call.segments.achieve["TURN", 0]("piece", spots[9]))
    assert [arguments for arguments, _, _ in found] == [("piece", "table2", *spots[8:12])]
    assert len(asked) < len(spots)
