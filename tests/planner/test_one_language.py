"""One language of conditions and effects: all evaluators agree on applicability and on the resulting states."""

import ast
import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from confab.planner.applicable import joins
from confab.planner.grounded.grounding import ground as grounded
from confab.planner.grounded.task import Task
from confab.planner.hierarchical.operators import Program
from confab.planner.paper.transitions import Model, ground
from confab.planner.solve import RejectedPlanError, Request, solve
from confab.planner.transitions import Table
from confab.planner.validation import successor
from confab.reasoner import symbols
from confab.reasoner.amounts import Quantity
from confab.reasoner.graph.knowledge import SCENE, KnowledgeGraph, text
from confab.reasoner.language import groups
from confab.reasoner.problem import Problem
from confab.reasoner.reading.applicable import applicable_query, write_situation
from confab.reasoner.reading.problem import Reading, read
from confab.reasoner.symbols import FALSE, Condition, Fact, Symbol
from tests.planner import naive, small
from tests.reasoner.worlds import HEAD, graph_of, worlds
from worlds.language import DEFINED, language

ROOT = Path(__file__).resolve().parents[2]
After = Mapping[tuple[str, tuple[str, ...]], frozenset[Fact]]
"""The facts after each applicable behaviour, without false facts and without derived facts."""


def facts(state: Mapping[Symbol, str]) -> frozenset[Fact]:
    return frozenset(Fact(s, value) for s, value in state.items() if value != FALSE and s.situation not in DEFINED)


def by_naive(problem: Problem) -> After:
    state = naive.complete(problem)
    return {
        (behavior.name, arguments): facts(after)
        for behavior in problem.domain.behaviors.values()
        for arguments, after in naive.results(problem, behavior, state)
    }


def by_validation(problem: Problem) -> After:
    found = {}
    for behavior in problem.domain.behaviors.values():
        for arguments in product(*(problem.classes[p.kind] for p in behavior.parameters)):
            after = successor(problem, behavior, arguments, problem.initial)
            if after is not None:
                found[behavior.name, arguments] = facts(after)
    return found


def by_paper(problem: Problem) -> After:
    model = Model(problem)
    done = ((g, model.apply(g, model.values(problem.initial))) for g in ground(problem, 1))
    return {(g.behavior, g.arguments): facts(model.state(applied.after)) for g, applied in done if applied is not None}


def by_operators(problem: Problem) -> After:
    found = {}
    program = Program(problem)
    for behavior in problem.domain.behaviors.values():
        for arguments in product(*(problem.classes[p.kind] for p in behavior.parameters)):
            table = Table(problem.domain.situations, problem.initial)
            done = program.bind(table).forward[behavior.name](*arguments)
            if done is not None:
                for change in done[1]:
                    table.put(*change)
                found[behavior.name, arguments] = facts(table.state())
    return found


def by_joins(problem: Problem) -> After:
    """Return the applicable behaviours among the arguments that the joins of a state yield."""
    found = {}
    table, program = Table(problem.domain.situations, problem.initial), Program(problem)
    forward = program.bind(table).forward
    for name, join in joins(program.writer, problem.domain.behaviors.values(), table).items():
        for arguments in join():
            if (done := forward[name](*arguments)) is not None:
                assert (name, arguments) not in found
                after = Table(problem.domain.situations, problem.initial)
                for change in done[1]:
                    after.put(*change)
                found[name, arguments] = facts(after.state())
    return found


def by_task(problem: Problem) -> After:
    task = grounded(problem)
    assert isinstance(task, Task)
    found = {}
    for number in range(len(task)):
        after = task.applied(task.initial, number)
        if after is not None:
            behavior, arguments, _ = task.describe(number)
            found[behavior, arguments] = facts(task.values(after))
    return found


def by_sparql(graph: KnowledgeGraph, reading: Reading) -> set[tuple[str, tuple[str, ...]]]:
    """Return the applicable behaviours, computed by queries on the graph."""
    write_situation(graph, reading)
    return {
        (behavior.name, tuple(reading.names.short(text(term)) for term in tuple(row)[: len(behavior.parameters)]))
        for behavior in reading.problem.domain.behaviors.values()
        for row in graph.select(applicable_query(graph, reading, behavior), SCENE)
    }


EVALUATORS: dict[str, Callable[[Problem], After]] = {
    "validation": by_validation,
    "paper": by_paper,
    "operators": by_operators,
    "joins": by_joins,
    "task": by_task,
}
"""All evaluators of behaviours except the naive interpreter, which is the reference."""


def deviating(problem: Problem) -> set[str]:
    """Return the evaluators whose result differs from that of the naive interpreter."""
    now, truth = facts(problem.initial), by_naive(problem)
    changing = {done: after for done, after in truth.items() if after != now}
    found = {name: evaluator(problem) for name, evaluator in EVALUATORS.items()}
    # The grounded task contains no operators without effect.
    found["task"] = {done: after for done, after in found["task"].items() if after != now}
    return {name for name, after in found.items() if after != (changing if name == "task" else truth)}


@given(seed=st.integers(0, 10**9))
@settings(max_examples=settings().max_examples * 3)
def test_all_evaluators_agree_on_applicable_behaviours_and_their_effects(seed: int) -> None:
    assert deviating(language(seed, defined=seed % 2 == 1)) == set()


@pytest.fixture
def true_first(monkeypatch: pytest.MonkeyPatch) -> None:
    """Execute effects that make facts true before effects that make facts false, as in commit f43f953."""

    def post_init(behavior: symbols.Behavior) -> None:
        effects = sorted(behavior.effects, key=lambda effect: effect.value == FALSE)
        object.__setattr__(behavior, "effects", tuple(effects))

    monkeypatch.setattr(symbols.Behavior, "__post_init__", post_init)


@pytest.mark.usefixtures("true_first")
def test_a_wrong_order_of_effects_is_detected() -> None:
    noticed, seed = set[str](), 0
    while len(noticed) < 4 and seed < 200:
        noticed |= deviating(language(seed))
        seed += 1
    assert noticed == {"paper", "operators", "joins", "task"}


@pytest.mark.usefixtures("true_first")
@pytest.mark.parametrize("mode", ["guarded", "paper"])
def test_a_plan_that_relies_on_a_wrong_order_of_effects_is_rejected(mode: str) -> None:
    driven = small.drive().problem
    assert solve(Request(driven, mode)).plan is None  # although there is a plan
    away = replace(driven, goal={Symbol("THERE", ("truck", "yard")): FALSE})
    with pytest.raises(RejectedPlanError, match="isn't reached"):
        solve(Request(away, mode))


ASSIGNED_AND_DECREASED = f"""{HEAD}
w:s0 a owl:NamedIndividual, w:Spot .
w:t0 a owl:NamedIndividual, w:Thing ; w:at w:s0 .
w:B a owl:NamedIndividual, :Behavior ; :level 1 ; :parameter w:B.x ; :postcondition w:B_all, w:B_one .
w:B.x a owl:NamedIndividual, :Parameter ; :index 1 ; :termType w:Thing .
w:B_all a owl:NamedIndividual, :AmountEffect ; :about w:Thing ; :situationType w:FILL ; :change "decrease" ; :amount 1 .
w:B_one a owl:NamedIndividual, :AmountEffect ; :about w:B.x ; :situationType w:FILL ; :change "assign" ; :amount 0.5 .
w:task a owl:NamedIndividual, :Task ; :goal w:task.g .
w:task.g a owl:NamedIndividual, :ValueCondition ; :about w:t0 ; :situationType w:AT ; :value w:s0 .
"""
"""A behaviour that assigns an amount and decreases it below its minimum: it is applicable to no individual."""


@example(world=ASSIGNED_AND_DECREASED)
@given(world=worlds())
@settings(max_examples=max(settings().max_examples // 2, 30))
def test_queries_on_the_graph_agree_with_all_evaluators(world: str) -> None:
    with TemporaryDirectory() as folder:
        graph = graph_of(world, Path(folder))
    reading = read(graph)
    truth = by_naive(reading.problem)
    assert by_sparql(graph, reading) == truth.keys()
    for name, evaluator in EVALUATORS.items():
        if evaluator is not by_task:
            assert evaluator(reading.problem) == truth, name


CASES = {
    "planner/transitions.py": "expression",
    "planner/grounded/formulas.py": "condition",
    "reasoner/reading/applicable.py": "positive",
    "planner/checked_conditions.py": "test",
    "tests/planner/naive.py": "holds",
}
"""The function of each evaluator that has a case for every kind of condition."""


def unhandled(source: str, function: str, kinds: set[str]) -> set[str]:
    """Return the kinds of conditions for which a function has no case."""
    found = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.FunctionDef) and node.name == function:
            found |= {ast.unparse(p.cls) for p in ast.walk(node) if isinstance(p, ast.MatchClass)}
    return kinds - found


@pytest.mark.parametrize(("path", "function"), CASES.items())
def test_every_evaluator_handles_every_kind_of_condition(path: str, function: str) -> None:
    kinds = set(re.findall(r"\w+", str(vars(symbols)["Condition"])))
    source = (ROOT / path).read_text(encoding="utf-8")
    assert len(kinds) >= 6
    assert unhandled(source, function, kinds) == set()
    assert unhandled(source, function, {*kinds, "DerivedCondition"}) == {"DerivedCondition"}


def test_random_behaviours_are_of_every_kind() -> None:
    conditions: Counter[tuple[str, bool, int]] = Counter()
    conflicts = equal = odd = own = refused = added = 0
    for seed in range(400):
        problem = language(seed)
        for behavior in problem.domain.behaviors.values():
            for depth, condition in nested(behavior.preconditions):
                conditions[type(condition).__name__, condition.negated, depth] += 1
            places = [(e.situation, e.arguments) for e in behavior.effects]
            conflicts += len(set(places)) < len(places)
            targets = [(e.situation, e.arguments) for e in behavior.amounts]
            added += len(set(targets)) < len(targets)
            refused += not set(by_naive(problem)) >= set(by_naive(without_bounds(problem)))
            own += any(e.when and e.value in {v.name for v in behavior.variables} for e in behavior.effects)
        for (name, arguments), _ in by_naive(problem).items():
            equal += len(set(arguments)) < len(arguments)
            odd += any(a.startswith("shelf") for e in problem.domain.behaviors[name].effects for a in e.arguments[:1])
    kinds = {
        (name, negated, depth) for name, negated, depth in conditions if depth < 2 or name not in ("Witness", "AnyOf")
    }
    plain = {"ValueCondition", "RelationCondition", "ClassCondition", "EqualityCondition", "Comparison"}
    assert kinds >= set(product(plain, (False, True), (0, 1, 2))) | set(
        product(("Witness", "AnyOf"), (False, True), (0, 1))
    )
    assert min(conflicts, equal, odd, own, refused, added) > 20


def without_bounds(problem: Problem) -> Problem:
    """Return the problem without bounds of amounts."""
    situations = {
        name: replace(s, quantity=Quantity()) if s.quantity else s for name, s in problem.domain.situations.items()
    }
    return replace(problem, domain=replace(problem.domain, situations=situations))


def nested(conditions: Sequence[Condition], depth: int = 0) -> Iterator[tuple[int, Condition]]:
    """Yield all conditions, each with its nesting depth."""
    for condition in conditions:
        yield depth, condition
        for group in groups(condition):
            yield from nested(group, depth + 1)
