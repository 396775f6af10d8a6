"""What is read off a state once holds as long as the state does, and what is asked of one individual holds of its likes."""

import random

import pytest

from planner.hierarchical.operators import Achiever, Program
from planner.hierarchical.serialization import Call, Compiled
from planner.hierarchical.subgoals import Env, Wants
from reasoner.symbols import Condition, Problem
from worlds.families import family, random_table
from worlds.rooms import rooms

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
