"""A step may need at its end what only another step gives meanwhile: the planner finds such overlaps, no proof overlooks them."""

from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import pytest

import confab
from confab.planner.acting.dispatching import Concurrency
from confab.planner.acting.episode import End
from confab.planner.acting.executive import act
from confab.planner.acting.symbolic_world import SymbolicWorld
from confab.planner.certificate_checks import refusal
from confab.planner.certificates import Certificate
from confab.planner.certifying import certify
from confab.planner.plan import Limits, Outcome, Plan, Status, Step
from confab.planner.solve import Request, solve
from confab.planner.timed.call import best_in_time
from confab.planner.timed.plan import Slot, TimedPlan, schedule_of
from confab.planner.timed.validation import validate_in_sequence, validate_timed
from confab.planner.validation import Fault, validate
from confab.reasoner.aggregates.compiling import compiled
from confab.reasoner.aggregates.totals import with_totals
from confab.reasoner.amounts import Amount, Quantity
from confab.reasoner.pddl.importing import imported
from confab.reasoner.pddl.syntax import parse
from confab.reasoner.pddl.turtle import turtle
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import (
    FALSE,
    TRUE,
    Aggregate,
    AmountEffect,
    AnyOf,
    Behavior,
    Comparison,
    Condition,
    Effect,
    Fact,
    Parameter,
    SituationType,
    Span,
    Symbol,
    Timing,
    ValueEffect,
    Witness,
)
from confab.reasoner.timing import by_events, projected
from worlds.timed import Action, TimedWorld, least_makespan, problem_of
from worlds.writing import becomes, behavior, has, world

Asked = tuple[tuple[Span, Condition], ...]
Made = tuple[tuple[Span, Effect], ...]
SPANS = {"s": "at start", "o": "over all", "e": "at end"}
Literals = str
"""Literals with their spans: ``s q, e !r`` stands for ``(at start (q))`` and ``(at end (not (r)))``."""


def task(initial: str, goal: str, **actions: tuple[int, Literals, Literals]) -> Problem:
    """Return an imported task; an action has a duration, conditions and effects."""

    def literals(text: Literals) -> str:
        pairs = [one.split() for one in text.split(",") if one.strip()]
        return " ".join(f"({SPANS[at]} {f'(not ({f[1:]}))' if f[0] == '!' else f'({f})'})" for at, f in pairs)

    words = {
        one.split()[1].strip("!") for _, *its in actions.values() for text in its for one in text.split(",") if one
    }
    facts = " ".join(f"({one})" for one in sorted({*words, *initial.split(), *goal.split()}))
    made = [
        f"(:durative-action {name} :parameters () :duration (= ?duration {seconds}) "
        f":condition (and {literals(asked)}) :effect (and {literals(effects)}))"
        for name, (seconds, asked, effects) in actions.items()
    ]
    domain = f"(define (domain d) (:requirements :durative-actions) (:predicates {facts}) {' '.join(made)})"
    initial, goal = (" ".join(f"({one})" for one in text.split()) for text in (initial, goal))
    return imported(parse(domain, f"(define (problem p) (:domain d) (:init {initial}) (:goal (and {goal})))")).problem


WAITING = (4, "s q, e r", "s !q, e p")
"""Takes q at its begin, and needs r at its end."""
SOLVABLE = {
    "what one step takes, another needs missing": (task("q", "p", w=WAITING, v=(2, "s !q", "e r")), 4),
    "two steps need each other's beginnings": (
        task("i j", "p q", a=(4, "s i, e y", "s !i, s x, e p"), b=(3, "s j, e x", "s !j, s y, e q")),
        4,
    ),
    "two steps need values that the other only has meanwhile": (
        task("", "p q", a=(4, "e y", "s x, e !x, e p"), b=(5, "e k", "s y, e q"), c=(1, "s x", "e k")),
        5,
    ),
    "three steps are nested": (
        task(
            "i",
            "g",
            a=(9, "s i, e r", "s !i, s x, e g"),
            b=(6, "s x, e t", "s !x, s y, e r"),
            c=(2, "s y", "s !y, e t"),
        ),
        9,
    ),
    "a step needs at its end what its own begin takes": (
        task("r", "p", w=(4, "e r", "s !r, e p"), v=(2, "", "e r")),
        4,
    ),
}
UNSOLVABLE = {
    "no step gives what is needed": (task("q", "p", w=WAITING), True),
    "the other step needs what the first has taken": (task("q", "p", w=WAITING, v=(2, "s q, e q", "e r, e !q")), True),
    "the other step is too long": (task("q", "p", w=WAITING, v=(5, "s !q", "e r")), False),
    "a step takes at its begin what it needs throughout": (task("r", "p", w=(4, "o r", "s !r, e p")), True),
    "two goals never hold at the same time": (task("", "p r", w=(4, "", "s r, e !r"), v=(2, "o r", "e p")), True),
}


@pytest.mark.parametrize("name", SOLVABLE)
def test_steps_that_need_each_other_overlap(name: str) -> None:
    problem, makespan = SOLVABLE[name]
    outcome = solve(Request(problem, limits=Limits(seconds=20.0)))
    timed = schedule_of(outcome)
    assert timed is not None, outcome
    assert timed.makespan == makespan
    assert validate_timed(problem, timed) == []
    assert validate_in_sequence(problem, timed.plan) != []
    certificate = certify(problem)  # of plans whose steps are executed one after another
    assert certificate is None or refusal(problem, certificate) is not None


@pytest.mark.parametrize("name", UNSOLVABLE)
def test_a_task_that_overlaps_dont_help_has_no_plan(name: str) -> None:
    problem, provable = UNSOLVABLE[name]
    outcome = solve(Request(problem, limits=Limits(seconds=20.0)))
    assert outcome.plan is None
    assert (outcome.status is Status.UNSOLVABLE) == provable, outcome.reason
    if outcome.certificate is not None:
        assert refusal(problem, outcome.certificate) is None


@pytest.mark.parametrize("name", SOLVABLE)
@pytest.mark.parametrize("shift", [Fraction(-5), Fraction(5), Fraction(1, 2)])
def test_the_checker_judges_overlapping_steps_by_their_begins_and_ends(name: str, shift: Fraction) -> None:
    problem, _ = SOLVABLE[name]
    timed = schedule_of(solve(Request(problem, limits=Limits(seconds=20.0))))
    assert timed is not None
    for number, slot in enumerate(timed.slots):
        later = replace(slot, begin=slot.begin + shift, end=slot.end + shift)
        moved = TimedPlan(timed.plan, (*timed.slots[:number], later, *timed.slots[number + 1 :]))
        faults = validate_timed(problem, moved)
        assert faults or abs(shift) < 1 or len(timed.slots) > 2, (name, number)
        longer = replace(slot, end=slot.end + 1)
        assert validate_timed(
            problem, replace(timed, slots=(*timed.slots[:number], longer, *timed.slots[number + 1 :]))
        )
    assert validate_timed(problem, TimedPlan(replace(timed.plan, steps=timed.plan.steps[:1]), timed.slots[:1]))


def test_an_imported_scene_is_planned_with_the_overlap_by_its_file_too(tmp_path: Path) -> None:
    problem, makespan = SOLVABLE["what one step takes, another needs missing"]
    (tmp_path / "scene.ttl").write_text(turtle(problem, "title", "description"), encoding="utf-8")
    result = confab.load(tmp_path / "scene.ttl").plan(time_limit=20)
    assert result.timed is not None
    assert result.timed.makespan == makespan
    assert result.execute().reached
    with pytest.raises(confab.KnowledgeError, match="if they have to overlap, plan again"):
        confab.load(tmp_path / "scene.ttl").read_result(result.save(tmp_path / "plan.json"))


JARS = """
@prefix : <https://example.org/jars#> .
@prefix c: <https://w3id.org/confab/core#> .
@prefix owl: <http://www.w3.org/2002/07/owl#> .
@prefix rdfs: <http://www.w3.org/2000/01/rdf-schema#> .
@prefix xsd: <http://www.w3.org/2001/XMLSchema#> .
<https://example.org/jars> a owl:Ontology ; owl:imports <https://w3id.org/confab/core> ; c:symbolicOnly true .
:Robot a owl:Class, owl:NamedIndividual ; rdfs:subClassOf c:Object .
:Jar a owl:Class, owl:NamedIndividual ; rdfs:subClassOf c:Object ; c:hasSituationType :LOOSE, :SCREWED, :CLOSED .
:LOOSE a owl:Class, owl:NamedIndividual, c:SituationType .
:SCREWED a owl:Class, owl:NamedIndividual, c:SituationType .
:CLOSED a owl:Class, owl:NamedIndividual, c:SituationType .
:PRESS a owl:NamedIndividual, c:Behavior ; c:level 1 ; c:index 1 ; c:duration "PT5S"^^xsd:dayTimeDuration ; c:actor :PRESS.robot ;
  c:parameter :PRESS.jar, :PRESS.robot ; c:precondition :PRESS.screwed ; c:postcondition :PRESS.tight, :PRESS.closed .
:PRESS.jar a owl:NamedIndividual, c:Parameter ; c:index 1 ; c:termType :Jar .
:PRESS.robot a owl:NamedIndividual, c:Parameter ; c:index 2 ; c:termType :Robot .
:PRESS.screwed a owl:NamedIndividual, c:ValueCondition ; c:situationType :SCREWED ; c:about :PRESS.jar ; c:during c:atEnd .
:PRESS.tight a owl:NamedIndividual, c:ValueEffect ; c:situationType :LOOSE ; c:about :PRESS.jar ; c:value c:false ;
  c:during c:atStart .
:PRESS.closed a owl:NamedIndividual, c:ValueEffect ; c:situationType :CLOSED ; c:about :PRESS.jar .
:SCREW a owl:NamedIndividual, c:Behavior ; c:level 1 ; c:index 2 ; c:duration "PT3S"^^xsd:dayTimeDuration ; c:actor :SCREW.robot ;
  c:parameter :SCREW.jar, :SCREW.robot ; c:precondition :SCREW.tight ; c:postcondition :SCREW.screwed .
:SCREW.jar a owl:NamedIndividual, c:Parameter ; c:index 1 ; c:termType :Jar .
:SCREW.robot a owl:NamedIndividual, c:Parameter ; c:index 2 ; c:termType :Robot .
:SCREW.tight a owl:NamedIndividual, c:ValueCondition ; c:situationType :LOOSE ; c:about :SCREW.jar ; c:negated true ;
  c:during c:throughout .
:SCREW.screwed a owl:NamedIndividual, c:ValueEffect ; c:situationType :SCREWED ; c:about :SCREW.jar .
:jar a owl:NamedIndividual, :Jar . :robot1 a owl:NamedIndividual, :Robot .
:loose a owl:NamedIndividual, c:SituatedObjectInstance ; c:situationType :LOOSE ; c:about :jar .
"""
"""One robot presses the lid of a jar while another one screws it on."""
SECOND = (
    ":robot2 a owl:NamedIndividual, :Robot . [] a owl:AllDifferent ; owl:distinctMembers ( :jar :robot1 :robot2 ) ."
)


def jars(folder: Path, more: str) -> Outcome:
    (folder / "jars.ttl").write_text(JARS + more, encoding="utf-8")
    return confab.load(folder / "jars.ttl").plan("jar CLOSED true", time_limit=20).outcome


def test_one_robot_presses_the_lid_while_another_screws(tmp_path: Path) -> None:
    timed = schedule_of(jars(tmp_path, SECOND))
    assert timed is not None
    assert timed.makespan == 5
    assert {slot.actors for slot in timed.slots} == {("robot1",), ("robot2",)}
    outcome = jars(tmp_path, "[] a owl:AllDifferent ; owl:distinctMembers ( :jar :robot1 ) .")
    assert outcome.status is Status.GAVE_UP  # no proof takes actors into account


def test_unsolvable_random_worlds_have_no_plan_with_overlaps_either() -> None:
    """The world of the exhaustive search has literals at begins and ends of steps."""
    asks, makes = (("start", (0, True)), ("end", (1, True))), (("start", (0, False)), ("end", (2, True)))
    needs = Action(4, None, asks, makes)
    gives = Action(2, None, (("start", (0, False)),), (("end", (1, True)),))
    for actions, least in (((needs, gives), 4), ((needs,), None)):
        world = TimedWorld(3, actions, frozenset({0}), ((2, True),))
        outcome = solve(Request(problem_of(world), limits=Limits(seconds=20.0)))
        assert least_makespan(world) == least
        timed = schedule_of(outcome)
        assert (timed and timed.makespan) == least
        assert (outcome.status is Status.UNSOLVABLE) == (least is None)


AFTER = (Span.END, becomes("G", "?t", TRUE))
GIVEN: dict[str, tuple[Asked, Made]] = {
    "at its begin, for its whole duration": (
        ((Span.THROUGHOUT, has("P", "?t", TRUE)),),
        ((Span.START, becomes("P", "?t", TRUE)), (Span.END, becomes("P", "?t", FALSE)), AFTER),
    ),
    "at its begin, for its end": (((Span.END, has("P", "?t", TRUE)),), ((Span.START, becomes("P", "?t", TRUE)), AFTER)),
    "throughout, for its end": (
        ((Span.END, has("P", "?t", TRUE)),),
        ((Span.THROUGHOUT, becomes("P", "?t", TRUE)), AFTER),
    ),
    "as an amount": (
        ((Span.THROUGHOUT, Comparison(Amount("N", ("?t",)), ">=", Fraction(2))),),
        ((Span.START, AmountEffect("N", ("?t",), "increase", Fraction(2))), AFTER),
    ),
    "as an assigned amount, for its end": (
        ((Span.END, Comparison(Amount("N", ("?t",)), "<", Fraction(1), negated=True)),),
        ((Span.START, AmountEffect("N", ("?t",), "assign", Fraction(1))), AFTER),
    ),
}


@pytest.mark.parametrize("name", GIVEN)
@pytest.mark.parametrize("level", [1, 2])
def test_a_step_may_give_itself_what_it_needs(name: str, level: int) -> None:
    problem = spanned(level, *GIVEN[name], "G")
    plan = solve(Request(problem, limits=Limits(seconds=10.0))).plan
    assert plan is not None
    timed = best_in_time(problem, plan).plan
    assert timed is not None
    assert validate_timed(problem, timed) == []
    assert timed.makespan == 2


def test_what_a_step_takes_again_before_its_end_isnt_given() -> None:
    asked = ((Span.END, has("P", "?t", TRUE)),)
    made = ((Span.START, becomes("P", "?t", TRUE)), (Span.THROUGHOUT, becomes("P", "?t", FALSE)), AFTER)
    for level in (1, 2):
        assert solve(Request(spanned(level, asked, made, "G"), limits=Limits(seconds=10.0))).plan is None


N = Amount("N", ("?t",))
TWO_MORE = (Span.START, AmountEffect("N", ("?t",), "increase", Fraction(2)))
OWN: dict[str, tuple[Effect, dict[str, str]]] = {
    "scaled": (AmountEffect("N", ("?t",), "scale", Fraction(3)), {"N": "6"}),
    "doubled by a calculation": (AmountEffect("N", ("?t",), "increase", N), {"N": "4"}),
    "compared": (ValueEffect("P", ("?t",), TRUE, (Comparison(N, ">=", Fraction(2)),)), {"N": "2", "P": TRUE}),
}


@pytest.mark.parametrize("name", OWN)
@pytest.mark.parametrize("level", [1, 2])
def test_an_effect_at_the_end_of_a_step_finds_the_amounts_that_its_begin_has_changed(name: str, level: int) -> None:
    effect, after = OWN[name]
    made = (TWO_MORE, (Span.END, effect), AFTER)
    problem = spanned(level, (), made, "G")
    problem = replace(problem, goal={**problem.goal, **{Symbol(one, ("t",)): value for one, value in after.items()}})
    outcome = solve(Request(problem, limits=Limits(seconds=20.0)))
    assert outcome.plan is not None
    assert len(outcome.plan.primitives) == 1
    assert validate_in_sequence(problem, outcome.plan) == []


@pytest.mark.parametrize("level", [1, 2])
def test_a_plan_whose_steps_have_other_effects_in_time_is_not_returned(level: int) -> None:
    tripled = (Span.END, AmountEffect("N", ("?t",), "scale", Fraction(3), (has("P", "?t", FALSE),)))
    problem = spanned(level, (), (TWO_MORE, tripled, AFTER), "G")
    for value in ("2", "6"):  # it is 6 in time; 2 if the factor came first
        task = replace(problem, goal={**problem.goal, Symbol("N", ("t",)): value})
        outcome = solve(Request(task, limits=Limits(seconds=5.0)))
        assert (outcome.status is Status.SOLVED) == (outcome.plan is not None)
        assert outcome.plan is None or (value == "6" and validate_in_sequence(task, outcome.plan) == [])


@pytest.mark.parametrize("span", [Span.THROUGHOUT, Span.END])
@pytest.mark.parametrize("level", [1, 2])
def test_a_step_whose_begin_makes_its_own_condition_false_is_in_no_plan(span: Span, level: int) -> None:
    made = ((Span.START, becomes("P", "?t", TRUE)), AFTER)
    problem = spanned(level, ((span, has("P", "?t", FALSE)),), made, "G")
    assert solve(Request(problem, limits=Limits(seconds=10.0))).status is Status.UNSOLVABLE
    never = (Span.END, ValueEffect("G", ("?t",), TRUE, (has("P", "?t", FALSE),)))
    problem = spanned(level, (), (made[0], never), "G")
    assert solve(Request(problem, limits=Limits(seconds=10.0))).status is Status.UNSOLVABLE


def test_another_step_makes_a_condition_true_again_that_a_step_makes_false_itself(tmp_path: Path) -> None:
    condition = "c:situationType :{} ; c:about :PRESS.jar ; c:during c:atEnd"
    text = JARS.replace(condition.format("SCREWED"), condition.format("LOOSE")) + SECOND
    effect = ":SCREW.screwed a owl:NamedIndividual, c:ValueEffect ; c:situationType "
    (tmp_path / "jars.ttl").write_text(text.replace(f"{effect}:SCREWED", f"{effect}:LOOSE"), encoding="utf-8")
    timed = schedule_of(confab.load(tmp_path / "jars.ttl").plan("jar CLOSED true", time_limit=20).outcome)
    assert timed is not None
    assert [slot.step.behavior for slot in timed.slots] == ["PRESS", "SCREW"]


def test_validation_reports_a_step_whose_begin_makes_its_own_condition_false(tmp_path: Path) -> None:
    below = ":HOLD a owl:NamedIndividual, c:Behavior ; c:level 2 ; c:index 1 ."
    for span, more, never in (("throughout", "", True), ("atEnd", "", False), ("atEnd", below, True)):
        condition = "c:situationType :{} ; c:about :PRESS.jar ; c:during c:{}"
        text = JARS.replace(condition.format("SCREWED", "atEnd"), condition.format("LOOSE", span))
        assert text != JARS
        (tmp_path / "jars.ttl").write_text(text + more, encoding="utf-8")
        said = [str(one) for one in confab.validate(tmp_path / "jars.ttl")]
        assert any("after its own effect" in one for one in said) == never, said
        assert never or not any("never applicable" in one for one in said), said


def test_a_goal_isnt_reached_by_a_step_that_never_ends() -> None:
    """The first step gives the goal at its begin, but its end needs what only the second step has meanwhile."""
    never = Action(4, None, (("end", (1, True)),), (("end", (2, True)), ("start", (0, True)), ("end", (0, False))))
    gives = Action(1, None, (), (("throughout", (0, True)), ("start", (1, True)), ("end", (1, False))))
    undoes = Action(2, 0, (), (("end", (0, False)), ("end", (1, False))))
    problem = problem_of(TimedWorld(3, (undoes, gives, never), frozenset({2}), ((0, True),)))
    timed = schedule_of(solve(Request(problem, limits=Limits(seconds=20.0))))
    assert timed is not None
    assert timed.makespan == 1


def test_validation_accepts_a_step_that_gives_itself_what_it_needs(tmp_path: Path) -> None:
    text = JARS.replace("c:postcondition :PRESS.tight", "c:postcondition :PRESS.done, :PRESS.tight").replace(
        ":SCREW a",
        ":PRESS.done a owl:NamedIndividual, c:ValueEffect ; c:situationType :SCREWED ; c:about :PRESS.jar .\n:SCREW a",
    )
    (tmp_path / "jars.ttl").write_text(text, encoding="utf-8")
    assert not [one for one in confab.validate(tmp_path / "jars.ttl") if "never applicable" in str(one)]
    result = confab.load(tmp_path / "jars.ttl").plan("jar CLOSED true", time_limit=20)
    assert [step.behavior for step in result.plan.primitives] == ["PRESS"]


def test_a_condition_at_the_end_of_a_step_can_have_several_witnesses() -> None:
    given = (Span.START, becomes("N", "?t", TRUE)), (Span.END, becomes("P", "?t", TRUE))
    some = Witness("?u", "T", (has("G", "?u", TRUE),))
    asked: dict[str, Asked] = {"AWAIT": ((Span.END, some),), "GIVE": ((Span.START, has("N", "?t", TRUE)),)}
    made = {"AWAIT": given, "GIVE": ((Span.END, becomes("G", "?t", TRUE)),)}
    behaviors = [
        replace(
            behavior(name, 1, "?t:T", projected(its, made[name])[0], [e for _, e in made[name]]),
            timing=Timing(Fraction(len(name)), (), its, made[name]),
        )
        for name, its in asked.items()
    ]
    kinds = [SituationType(name, ("T",), "Truth", boolean=True) for name in "PGN"]
    problem = world(kinds, behaviors, {"T": ("t", "u")}, {}, {"P t": TRUE})
    timed = schedule_of(solve(Request(problem, limits=Limits(seconds=10.0))))
    assert timed is not None
    assert validate_timed(problem, timed) == []


def test_a_count_follows_a_fact_that_a_step_gives_itself_for_its_condition_throughout() -> None:
    asked: dict[str, Asked] = {
        "LIGHT": ((Span.THROUGHOUT, has("P", "t", TRUE)), (Span.END, has("G", "t", TRUE))),
        "SEE": ((Span.START, Comparison(Amount("MANY", ()), ">=", Fraction(1))),),
    }
    made: dict[str, Made] = {
        "LIGHT": ((Span.START, becomes("P", "t", TRUE)), (Span.END, becomes("N", "t", TRUE))),
        "SEE": ((Span.END, becomes("G", "t", TRUE)),),
    }
    timings = {name: Timing(Fraction(len(name)), (), its, made[name]) for name, its in asked.items()}
    behaviors = [
        replace(behavior(name, 1, "", *projected(its, made[name])), timing=timings[name])  # type: ignore[arg-type]
        for name, its in asked.items()
    ]
    kinds = [SituationType(name, ("T",), "Truth", boolean=True) for name in "PGN"]
    kinds += [SituationType("MANY", (), "MANY", quantity=Quantity())]
    problem = world(kinds, behaviors, {"T": ("t", "u")}, {}, {"N t": TRUE})
    count = Aggregate("MANY", "count", Fraction(1), (), (Parameter("?x", "T"),), (has("P", "?x", TRUE),))
    domain = compiled(replace(problem.domain, aggregates={"MANY": count}), problem.classes)
    problem = replace(problem, domain=domain, initial=with_totals(domain, problem.classes, {}, problem.initial))
    timed = schedule_of(solve(Request(problem, limits=Limits(seconds=10.0))))
    assert timed is not None
    assert timed.makespan == len("LIGHT")


@pytest.mark.parametrize("level", [1, 2])
@pytest.mark.parametrize("span", [Span.THROUGHOUT, Span.END])
@pytest.mark.parametrize(
    "condition",
    [
        AnyOf(((has("G", "?t", TRUE),), (has("P", "?t", TRUE),))),
        Witness("?u", "T", (has("G", "?u", TRUE),)),
        Comparison(Amount("MANY", ()), ">=", Fraction(1)),
    ],
)
def test_a_step_may_give_itself_an_alternative_a_witness_or_a_total_that_it_needs(
    condition: Condition, span: Span, level: int
) -> None:
    made = (Span.START, becomes("G", "?t", TRUE)), (Span.END, becomes("P", "?t", TRUE))
    problem = counting(spanned(level, ((span, condition),), made, "P"), level)
    outcome = solve(Request(problem, limits=Limits(seconds=10.0)))
    assert outcome.plan is not None
    assert [step.behavior for step in outcome.plan.primitives] == ["W"]
    taking = (Span.START, becomes("G", "?t", FALSE)), (Span.END, becomes("P", "?t", TRUE))
    taken = counting(spanned(level, ((span, condition),), taking, "P"), level)
    taken = replace(taken, initial={**taken.initial, Symbol("G", ("t",)): TRUE, Symbol("MANY", ()): "1"})
    assert validate(taken, outcome.plan)
    assert solve(Request(taken, limits=Limits(seconds=10.0))).status is Status.UNSOLVABLE


@pytest.mark.parametrize("level", [1, 2])
@pytest.mark.parametrize(
    "condition",
    [
        has("G", "?t", TRUE),
        AnyOf(((has("G", "?t", TRUE),), (has("P", "?t", TRUE),))),
        Witness("?u", "T", (has("G", "?u", TRUE),)),
        Comparison(Amount("MANY", ()), ">=", Fraction(1)),
    ],
)
def test_the_conditions_of_an_effect_at_the_end_follow_the_effects_at_the_start(
    condition: Condition, level: int
) -> None:
    """The effect at the start has a condition, too."""
    started = Comparison(Amount("N", ("?t",)), "=", Fraction(0))

    def task(value: str) -> Problem:
        start, end = (
            replace(becomes("G", "?t", value), when=(started,)),
            replace(becomes("P", "?t", TRUE), when=(condition,)),
        )
        problem = counting(spanned(level, (), ((Span.START, start), (Span.END, end)), "P"), level)
        before = {
            Symbol("G", ("t",)): FALSE if value == TRUE else TRUE,
            Symbol("MANY", ()): "0" if value == TRUE else "1",
        }
        return replace(problem, initial={**problem.initial, **before})

    outcome = solve(Request(task(TRUE), limits=Limits(seconds=10.0)))
    assert outcome.plan is not None
    assert [step.behavior for step in outcome.plan.primitives] == ["W"]
    assert not validate(task(TRUE), outcome.plan)
    assert validate(task(FALSE), outcome.plan)
    assert solve(Request(task(FALSE), limits=Limits(seconds=10.0))).status is Status.UNSOLVABLE


@pytest.mark.parametrize("level", [1, 2])
@pytest.mark.parametrize("span", [Span.THROUGHOUT, Span.END])
def test_a_condition_follows_an_effect_at_the_start_that_has_a_condition(span: Span, level: int) -> None:
    def task(value: str) -> Problem:
        start = replace(becomes("G", "?t", value), when=(Comparison(Amount("N", ("?t",)), "=", Fraction(0)),))
        made = (Span.START, start), (Span.END, becomes("P", "?t", TRUE))
        problem = spanned(level, ((span, has("G", "?t", TRUE)),), made, "P")
        problem = replace(problem, domain=compiled(problem.domain, problem.classes))
        return replace(problem, initial={**problem.initial, Symbol("G", ("t",)): FALSE if value == TRUE else TRUE})

    outcome = solve(Request(task(TRUE), limits=Limits(seconds=10.0)))
    assert outcome.plan is not None
    assert [step.behavior for step in outcome.plan.primitives] == ["W"]
    assert validate(task(FALSE), outcome.plan)
    assert solve(Request(task(FALSE), limits=Limits(seconds=10.0))).status is Status.UNSOLVABLE


@pytest.mark.parametrize(("most", "makespan"), [(None, 2), (Fraction(3), 4)])
def test_steps_that_change_a_total_without_a_bound_overlap_and_the_total_follows(
    most: Fraction | None, makespan: int
) -> None:
    problem = lit("?t", most)
    outcome = solve(Request(problem, limits=Limits(seconds=10.0)))
    assert outcome.plan is not None
    timed = best_in_time(problem, outcome.plan).plan
    assert timed is not None
    assert timed.makespan == makespan
    world = SymbolicWorld(problem)
    assert act(problem, world, outcome.plan, together=Concurrency(timed)).status is End.REACHED
    assert world.seconds == makespan
    assert world.observe()[Symbol("MANY", ())] == "2"


def test_no_step_reads_a_total_while_another_step_changes_it() -> None:
    looks = replace(
        behavior("LOOK", 1, "", [Comparison(Amount("MANY", ()), ">=", Fraction(1))], []), timing=Timing(Fraction(1))
    )
    looks = replace(looks, timing=Timing(Fraction(1), (), ((Span.THROUGHOUT, looks.preconditions[0]),)))
    problem = lit("?t", None)
    problem = replace(problem, domain=replace(problem.domain, behaviors={**problem.domain.behaviors, "LOOK": looks}))
    its = (("W", ("t",)), ("LOOK", ()), ("W", ("u",)))
    steps = [Step((n,), problem.id_of(*one), 1, *one) for n, one in enumerate(its)]

    def faults(*begins: int) -> list[Fault]:
        slots = (
            Slot(step, Fraction(b), Fraction(b + (1 if step.behavior == "LOOK" else 2)))
            for step, b in zip(steps, begins, strict=True)
        )
        return validate_timed(problem, TimedPlan(Plan(tuple(steps)), tuple(slots)))

    assert not faults(0, 2, 3)
    assert faults(0, 2, 1)


def lit(term: str, most: Fraction | None) -> Problem:
    """Return a task to light two lamps in 2 s each; MANY is the number of lit lamps, which may have a maximum."""
    made = ((Span.THROUGHOUT, becomes("G", term, TRUE)),)
    one = replace(behavior("W", 1, f"{term}:T", [], [made[0][1]]), timing=Timing(Fraction(2), (term,), (), made))
    kinds = [
        SituationType("G", ("T",), "Truth", boolean=True),
        SituationType("MANY", (), "MANY", quantity=Quantity(most=most)),
    ]
    problem = world(kinds, [one], {"T": ("t", "u")}, {}, {"G t": TRUE, "G u": TRUE})
    count = Aggregate("MANY", "count", Fraction(1), (), (Parameter("?x", "T"),), (has("G", "?x", TRUE),))
    domain = compiled(replace(problem.domain, aggregates={"MANY": count}), problem.classes)
    return replace(problem, domain=domain, initial=with_totals(domain, problem.classes, {}, problem.initial))


def counting(problem: Problem, level: int) -> Problem:
    """Return a compiled problem with the number MANY of the individuals of which G is true, on a level."""
    kinds = {**problem.domain.situations, "MANY": SituationType("MANY", (), "MANY", level, quantity=Quantity())}
    kinds["G"] = replace(kinds["G"], level=level)
    count = Aggregate("MANY", "count", Fraction(1), (), (Parameter("?x", "T"),), (has("G", "?x", TRUE),))
    domain = compiled(replace(problem.domain, situations=kinds, aggregates={"MANY": count}), problem.classes)
    return replace(problem, domain=domain, initial=with_totals(domain, problem.classes, {}, problem.initial))


def test_a_task_of_several_levels_whose_steps_have_spans_is_proved_unsolvable() -> None:
    problem = spanned(2, ((Span.START, has("G", "?t", TRUE)),), ((Span.END, becomes("P", "?t", TRUE)),), "P")
    outcome = solve(Request(problem, limits=Limits(seconds=10.0)))
    assert outcome.status is Status.UNSOLVABLE
    assert outcome.certificate is not None
    assert refusal(problem, outcome.certificate) is None


def spanned(level: int, asked: Asked, made: Made, goal: str) -> Problem:
    """Return a task with one behaviour W on a level, whose conditions and effects have spans."""
    preconditions, effects = projected(asked, made)
    values = [effect for effect in effects if isinstance(effect, ValueEffect)]
    one = behavior("W", level, "?t:T", preconditions, values)
    one = replace(one, amounts=tuple(effect for effect in effects if isinstance(effect, AmountEffect)))
    above = [behavior("ABOVE", 1, "?t:T", [], [becomes(goal, "?t", TRUE)])] if level > 1 else []
    return world(
        [
            *(SituationType(name, ("T",), "Truth", boolean=True) for name in "PG"),
            SituationType("N", ("T",), "Number", level, quantity=Quantity()),
        ],
        [*above, replace(one, timing=Timing(Fraction(2), (), asked, made))],
        {"T": ("t",)},
        {"N t": "0"},
        {f"{goal} t": TRUE},
    )


def looking(determined: bool, meanwhile: bool) -> Problem:
    """Return a task to look at the hall while the lamp glows; if `determined`, the place of the robot determines what it looks at.

    If `meanwhile`, the robot also has to begin to walk away while it looks.
    """
    place, robot = (Parameter("?p", "Place"),), (Parameter("?r", "Robot"),)

    def timed(name: str, seconds: int, asked: Asked, made: Made, more: tuple[Parameter, ...] = robot) -> Behavior:
        needs, gives = projected(asked, made)
        values = tuple(effect for effect in gives if isinstance(effect, ValueEffect))
        return Behavior(name, 1, more, (), needs, values, timing=Timing(Fraction(seconds), (), asked, made))

    def passing(name: str) -> Made:
        return (Span.START, becomes(name, TRUE)), (Span.END, becomes(name, FALSE))

    asked = ((Span.START, has("AT", "?r", "?p")), (Span.START, has("LIT", TRUE)))
    seen = *(passing("BUSY") if meanwhile else ()), (Span.END, becomes("SEEN", "?p", TRUE))
    look = timed("LOOK", 3, asked, seen, robot if determined else (*robot, *place))
    leave = timed("LEAVE", 1, ((Span.START, has("BUSY", TRUE)),), ((Span.END, becomes("AT", "?r", "attic")),))
    return world(
        [
            SituationType("AT", ("Robot",), "Place"),
            SituationType("SEEN", ("Place",), "Truth", boolean=True),
            *(SituationType(name, (), "Truth", boolean=True) for name in ("LIT", "BUSY")),
        ],
        [timed("GLOW", 5, (), passing("LIT"), ()), replace(look, variables=place if determined else ()), leave],
        {"Robot": ("r",), "Place": ("hall", "attic")},
        {"AT r": "hall"},
        {"SEEN hall": TRUE, **({"AT r": "attic"} if meanwhile else {})},
    )


@pytest.mark.parametrize("determined", [False, True])
@pytest.mark.parametrize("meanwhile", [False, True])
def test_an_effect_at_the_end_of_a_step_may_name_what_a_condition_at_its_begin_determines(
    determined: bool, meanwhile: bool
) -> None:
    problem = looking(determined, meanwhile)
    timed = schedule_of(solve(Request(problem, limits=Limits(seconds=20.0))))
    assert timed is not None
    assert validate_timed(problem, timed) == []
    events = by_events(problem)
    assert events is not None
    assert certify(events) is None


def test_the_checker_refuses_a_proof_about_an_effect_that_names_an_unknown_individual() -> None:
    seen = SituationType("SEEN", ("Place",), "Truth", boolean=True)
    look = replace(behavior("LOOK", 1, "", [], [becomes("SEEN", "?p", TRUE)]), variables=(Parameter("?p", "Place"),))
    problem = world([seen], [look], {"Place": ("hall",)}, {}, {"SEEN hall": TRUE})
    goal = Fact(Symbol("SEEN", ("hall",)), TRUE)
    said = refusal(problem, Certificate(never=frozenset({goal}), unmet=(goal,)))
    assert said == "nothing determines ?p, which an effect of LOOK names"
    assert certify(problem) is None
