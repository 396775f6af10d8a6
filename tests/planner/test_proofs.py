"""A proof that there is no plan is correct, and its reason names the missing facts in the terms of the ontology."""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from fractions import Fraction
from itertools import pairwise

import pytest

from confab.planner.certificate_checks import refusal as refused
from confab.planner.certificate_reasons import told
from confab.planner.certifying import certify
from confab.planner.grounded.grounding import ground
from confab.planner.grounded.task import Task
from confab.planner.hierarchical.lowest_level import LOOKING, LowestLevel, closed, exhausted, proved, refusal
from confab.planner.hierarchical.planner import Call, compiled
from confab.planner.hierarchical.scope import LEAST
from confab.planner.hierarchical.unsolvability import EASIER, Proofs, impossible
from confab.planner.plan import OUT_OF_MEMORY, Plan, Reason
from confab.reasoner.amounts import Quantity
from confab.reasoner.problem import Problem
from confab.reasoner.symbols import (
    FALSE,
    TRUE,
    AmountEffect,
    AnyOf,
    Behavior,
    ClassCondition,
    Condition,
    EqualityCondition,
    Fact,
    Parameter,
    RelationCondition,
    Rule,
    SituationType,
    Symbol,
    Witness,
)
from worlds.agreement import solvable
from worlds.hierarchies import hierarchy
from worlds.writing import becomes, behavior, has, lacks, world

PLACE_IS_FREE = Witness("?x", "Cup", (has("AT", "?x", "?p"),), negated=True)
ANOTHER_PLACE = EqualityCondition("?o", "?p", True)
REACH = RelationCondition("canReach", ("?h", "?p"))
REACHED = [("left", "shelf"), ("left", "table"), ("right", "table"), ("right", "sink")]
PUT = behavior(
    "PUT", 1, "?h:Hand ?c:Cup ?p:Place", [REACH, has("AT", "?c", "?o"), ANOTHER_PLACE, PLACE_IS_FREE],
    [becomes("AT", "?c", "?p")], "?o:Place",
)  # fmt: skip
WASH = behavior(
    "WASH", 1, "?c:Cup", [has("AT", "?c", "sink"), has("CLEAN", "?c", FALSE)], [becomes("CLEAN", "?c", TRUE)]
)
DRY = behavior("DRY", 1, "?c:Cup", [has("CLEAN", "?c", TRUE)], [becomes("DRY", "?c", TRUE)])


def kitchen(
    goal: Mapping[str, str],
    reached: Iterable[tuple[str, str]] = REACHED,
    behaviors: Iterable[Behavior] = (PUT, WASH, DRY),
    initial: Mapping[str, str] | None = None,
) -> Problem:
    """Two hands, each of which reaches some places and holds one cup; a cup in the sink can be washed, and then dried."""
    truths = [SituationType(name, ("Cup",), "Truth", boolean=True) for name in ("CLEAN", "DRY")]
    return world(
        [SituationType("AT", ("Cup",), "Place"), *truths],
        behaviors,
        {"Hand": ("left", "right"), "Cup": ("cup1", "cup2"), "Place": ("shelf", "table", "sink", "attic"), "Tray": ("tray",)},
        initial or {"AT cup1": "shelf", "AT cup2": "table"},
        goal,
        {"canReach": reached, "fits": [("cup1", "sink")]},
    )  # fmt: skip


def why(problem: Problem) -> str:
    """Return the reason why there is no plan, or an empty text if there is a plan.

    The reason is read from a valid certificate.
    """
    certificate = certify(problem)
    assert (certificate is None) is bool(solvable(problem))
    if certificate is None:
        return ""
    assert refused(problem, certificate) is None
    return told(problem, certificate).text


# ---------------------------------------------------------------------------------------------- relaxed reachability


def test_the_missing_relation_at_the_end_of_the_chain_is_named() -> None:
    proof = impossible(kitchen({"AT cup1": "attic"}))
    assert proof is not None and proof.certificate is not None
    assert (
        proof.reason.text
        == "cup1 AT attic can't be reached: PUT requires a Hand that canReach attic, and there is none"
    )
    assert {"cup1", "AT", "attic", "PUT", "canReach"} <= set(proof.reason.terms)
    dry = kitchen({"DRY cup2": TRUE}, [("left", "shelf")])
    assert why(dry) == (
        "cup2 DRY true can't be reached: PUT requires a Hand that canReach sink, and there is none; "
        "so cup2 AT sink and cup2 CLEAN true never hold"
    )


def test_the_reason_names_the_missing_fact_of_one_of_several_behaviours() -> None:
    throw = behavior(
        "THROW", 1, "?c:Cup ?p:Place", [RelationCondition("fits", ("?c", "?p"))], [becomes("AT", "?c", "?p")]
    )
    problem = kitchen({"AT cup2": "sink"}, [], [PUT, throw])
    assert why(problem) == "cup2 AT sink can't be reached: PUT requires a Hand that canReach sink, and there is none"
    assert why(kitchen({"AT cup1": "sink"}, [], [PUT, throw])) == ""


def test_the_reason_names_only_the_missing_fact_of_a_behaviour() -> None:
    both = [REACH, RelationCondition("fits", ("?c", "?p")), RelationCondition("fits", ("cup1", "shelf"), True)]
    place = behavior("PLACE", 1, "?h:Hand ?c:Cup ?p:Place", both, [becomes("AT", "?c", "?p")])
    said = "cup2 AT sink can't be reached: PLACE requires cup2 fits sink, which does not hold"
    assert why(kitchen({"AT cup2": "sink"}, behaviors=[place])) == said


def test_a_reason_includes_missing_facts_about_two_individuals() -> None:
    near = SituationType("NEAR", ("Cup", "Place"), "Truth", boolean=True)
    bring = behavior("BRING", 1, "?h:Hand ?c:Cup ?p:Place", [REACH], [becomes("NEAR", "?c", "?p", TRUE)])
    wipe = behavior("WIPE", 1, "?c:Cup", [has("NEAR", "?c", "attic", TRUE)], [becomes("CLEAN", "?c", TRUE)])
    problem = kitchen({"CLEAN cup1": TRUE}, behaviors=[bring, wipe])
    problem = replace(problem, domain=replace(problem.domain, situations={**problem.domain.situations, "NEAR": near}))
    assert why(problem) == (
        "cup1 CLEAN true can't be reached: BRING requires a Hand that canReach attic, and there is none; "
        "so cup1 NEAR attic true never holds"
    )
    reaching = replace(problem, relations={"canReach": frozenset([("left", "attic")])})
    assert why(reaching) == ""


def test_two_preconditions_that_no_state_satisfies_are_named_together() -> None:
    never = behavior(
        "RINSE", 1, "?c:Cup", [has("CLEAN", "?c", FALSE), has("CLEAN", "?c", TRUE)], [becomes("CLEAN", "?c", TRUE)]
    )
    assert why(kitchen({"CLEAN cup1": TRUE}, behaviors=[PUT, never])) == (
        "cup1 CLEAN true can't be reached: RINSE requires cup1 CLEAN false and cup1 CLEAN true, and no state satisfies both"
    )


def test_a_goal_that_no_behaviour_achieves_is_reported() -> None:
    assert why(kitchen({"DRY cup1": TRUE}, behaviors=[PUT, WASH])) == (
        "cup1 DRY true can't be reached: no behaviour of level 1 has this effect"
    )
    assert why(kitchen({"CLEAN cup1": FALSE}, initial={"AT cup1": "shelf", "AT cup2": "sink", "CLEAN cup1": TRUE})) == (
        "cup1 CLEAN false can't be reached: no behaviour of level 1 has this effect"
    )


@pytest.mark.parametrize(
    "goal",
    [{"AT cup1": "sink"}, {"AT cup1": "shelf"}, {"CLEAN cup1": FALSE}, {"DRY cup1": TRUE, "AT cup2": "sink"}, {}],
)
def test_a_task_with_a_plan_has_no_reason_for_unsolvable(goal: dict[str, str]) -> None:
    problem = kitchen(goal)
    assert solvable(problem)
    assert impossible(problem) is None
    assert isinstance(proved(problem, 1), Task)


def test_a_circular_precondition_is_a_proof_and_an_achievable_one_is_none() -> None:
    swap = behavior("SWAP", 1, "?c:Cup", [has("DRY", "?c", TRUE)], [becomes("CLEAN", "?c", TRUE)])
    back = behavior("BACK", 1, "?c:Cup", [has("CLEAN", "?c", TRUE)], [becomes("DRY", "?c", TRUE)])
    assert "can't be reached" in why(kitchen({"CLEAN cup1": TRUE}, behaviors=[swap, back]))
    free = behavior("FREE", 1, "?c:Cup", [lacks("AT", "?c", "shelf")], [becomes("CLEAN", "?c", TRUE)])
    assert why(kitchen({"CLEAN cup1": TRUE}, behaviors=[free, PUT])) == ""


def test_two_goals_that_exclude_each_other_are_named() -> None:
    both = {"AT cup1": "sink", "AT cup2": "sink"}
    proof = impossible(kitchen(both))
    assert proof is not None and proof.certificate is not None and proof.certificate.kind == "pair"
    assert proof.reason.text == "cup1 AT sink and cup2 AT sink exclude each other: no reachable state has both"
    assert proof.reason.terms == ("cup1", "AT", "sink", "cup2")
    assert not solvable(kitchen(both))


HEAP = replace(PUT, preconditions=tuple(c for c in PUT.preconditions if c is not PLACE_IS_FREE))
NO_TRAYS = replace(PUT, preconditions=(*HEAP.preconditions, replace(PLACE_IS_FREE, kind="Tray")))
PLACE_IS_OCCUPIED = replace(PUT, preconditions=(*HEAP.preconditions, replace(PLACE_IS_FREE, negated=False)))
OLD_PLACE_IS_FREE = replace(
    PUT, preconditions=(*HEAP.preconditions, Witness("?x", "Cup", (has("AT", "?x", "?o"), ANOTHER_PLACE), True))
)
DROP = behavior("DROP", 1, "?c:Cup", [], [becomes("AT", "?c", "sink")])
TWO = behavior(
    "TWO", 1, "?c:Cup ?d:Cup ?p:Place", [PLACE_IS_FREE], [becomes("AT", "?c", "?p"), becomes("AT", "?d", "?p")]
)


@pytest.mark.parametrize("more", [HEAP, NO_TRAYS, PLACE_IS_OCCUPIED, OLD_PLACE_IS_FREE, DROP, TWO])
def test_goals_exclude_each_other_only_if_every_achiever_requires_a_free_place(more: Behavior) -> None:
    both = {"AT cup1": "sink", "AT cup2": "sink"}
    problem = kitchen(both, behaviors=[PUT, replace(more, name="MORE")])
    assert bool(why(problem)) == (not solvable(problem))
    on_the_shelf = {"AT cup1": "shelf", "AT cup2": "shelf"}
    assert why(kitchen(on_the_shelf, initial=on_the_shelf)) == ""


def test_a_condition_that_no_object_of_a_wider_class_is_there_is_strong_enough() -> None:
    wider = replace(PUT, preconditions=(*HEAP.preconditions, replace(PLACE_IS_FREE, kind="Thing")))
    problem = kitchen({"AT cup1": "sink", "AT cup2": "sink"}, behaviors=[wider])
    assert "exclude" in why(replace(problem, classes={**problem.classes, "Thing": ("cup1", "cup2", "tray")}))


def test_goals_exclude_each_other_although_a_behaviour_moves_objects_elsewhere() -> None:
    aside = behavior("ASIDE", 1, "?c:Cup", [], [becomes("AT", "?c", "attic")])
    nowhere = behavior("TRAY", 1, "?c:Cup ?t:Tray", [], [becomes("AT", "?c", "?t")])
    assert "exclude each other" in why(kitchen({"AT cup1": "sink", "AT cup2": "sink"}, behaviors=[PUT, aside, nowhere]))


def test_an_amount_that_nothing_changes_stays_as_it_is() -> None:
    fill = SituationType("FILL", ("Cup",), "FILL", quantity=Quantity("", whole=True))
    problem = kitchen({"AT cup1": "shelf"})
    domain = replace(problem.domain, situations={**problem.domain.situations, "FILL": fill})
    for goal in ({"cup1": "3", "cup2": "3"}, {"cup1": "3"}):
        wanted = {Symbol("FILL", (cup,)): value for cup, value in goal.items()}
        initial = {**problem.initial, **dict.fromkeys(wanted, "1")}
        said = why(replace(problem, domain=domain, initial=initial, goal=wanted))
        assert said == "cup1 FILL 3 can't be reached: no behaviour of level 1 gives more"


def brewery(malt: int, goal: str, brewers: tuple[str, ...] = ("ada",)) -> Problem:
    """A brewer brews a batch from 150 kg of the malt in the silo; then the batch can be packed."""
    brew = behavior(
        "BREW", 1, "?w:Brewer ?b:Batch ?s:Silo", [has("AT", "?b", "planned")], [becomes("AT", "?b", "tank")]
    )
    brew = replace(brew, amounts=(AmountEffect("MALT", ("?s",), "decrease", Fraction(150)),))
    pack = behavior("PACK", 1, "?b:Batch", [has("AT", "?b", "tank")], [becomes("AT", "?b", "store")])
    malt_type = SituationType("MALT", ("Silo",), "MALT", quantity=Quantity("kg", least=Fraction(0)))
    classes = {"Brewer": brewers, "Batch": ("weiss",), "Silo": ("silo",), "Place": ("planned", "tank", "store")}
    initial = {"AT weiss": "planned", "MALT silo": str(malt)}
    return world(
        [SituationType("AT", ("Batch",), "Place"), malt_type], [brew, pack], classes, initial, {"AT weiss": goal}
    )


def test_the_reason_states_the_amount_that_a_behaviour_lacks() -> None:
    lacking = "BREW requires 150 kg of silo MALT; 100 kg are there, and nothing gives more"
    assert why(brewery(150, "tank")) == ""
    assert why(brewery(100, "tank")) == f"weiss AT tank can't be reached: {lacking}"
    for few_states in (False, True):
        certificate = certify(brewery(100, "store"), few_states=few_states)
        assert certificate is not None
        said = told(brewery(100, "store"), certificate).text
        assert said == f"weiss AT store can't be reached: {lacking}; so weiss AT tank never holds"


def test_the_reason_states_that_the_class_of_a_parameter_has_no_individuals() -> None:
    assert why(brewery(150, "tank", brewers=())) == (
        "weiss AT tank can't be reached: BREW requires a Brewer, and there is none"
    )


# ----------------------------------------------------------------------------------------- grounded, and why not


def test_the_cause_at_the_end_of_a_chain_comes_first() -> None:
    assert why(kitchen({"AT cup1": "attic"})) == (
        "cup1 AT attic can't be reached: PUT requires a Hand that canReach attic, and there is none"
    )
    assert why(kitchen({"DRY cup1": TRUE}, [("left", "shelf")])) == (
        "cup1 DRY true can't be reached: PUT requires a Hand that canReach sink, and there is none; "
        "so cup1 AT sink and cup1 CLEAN true never hold"
    )


def test_a_behaviour_that_moves_another_kind_of_object_is_not_the_reason() -> None:
    """Maids walk, and trolleys are pushed: the behaviour by which maids walk isn't the reason why no trolley reaches the attic."""
    at = SituationType("AT", ("Mobile",), "Place")
    from_here = RelationCondition("path", ("?from", "?to"))
    go = behavior("GO", 1, "?m:Maid ?to:Place ?from:Place", [has("AT", "?m", "?from"), from_here],
                  [becomes("AT", "?m", "?to")])  # fmt: skip
    together: list[Condition] = [has("AT", "?m", "?from"), has("AT", "?t", "?from"), from_here]
    push = behavior("PUSH", 1, "?m:Maid ?t:Trolley ?to:Place ?from:Place", together,
                    [becomes("AT", "?m", "?to"), becomes("AT", "?t", "?to")])  # fmt: skip
    clean = behavior("CLEAN", 1, "?p:Place ?t:Trolley", [has("AT", "?t", "?p")], [becomes("CLEAN", "?p", TRUE)])
    problem = world(
        [at, SituationType("CLEAN", ("Place",), "Truth", boolean=True)],
        [go, push, clean],
        {"Mobile": ("maid", "cart", "van"), "Maid": ("maid",), "Trolley": ("cart", "van"), "Place": ("hall", "attic")},
        {"AT maid": "hall", "AT cart": "hall", "AT van": "hall", "CLEAN attic": FALSE},
        {"CLEAN attic": TRUE},
        relations={"path": ()},
    )
    said = why(problem)
    assert said == (
        "attic CLEAN true can't be reached: PUSH requires a Place that path attic, and there is none; "
        "so some Trolley AT attic never holds"
    )


def reason(conditions: Iterable[object], terms: str = "?c:Cup ?p:Place ?h:Hand") -> str:
    """Return the reason why a cup can't be brought to the sink by a behaviour with the given conditions."""
    make = behavior("MAKE", 1, terms, conditions, [becomes("AT", "?c", "?p")])  # type: ignore[arg-type]
    said = why(kitchen({"AT cup2": "sink"}, [("left", "shelf")], [make]))
    return said.partition("can't be reached: ")[2].removeprefix("MAKE requires ").partition(", and there")[0]


def test_failing_conditions_are_written_as_readable_sentences() -> None:
    assert reason([ClassCondition("?c", "Tray")]) == "that cup2 is a Tray, but cup2 isn't"
    assert reason([RelationCondition("canReach", ("?h", "?p"))]) == "a Hand that canReach sink"
    assert reason([RelationCondition("fits", ("?c", "?q"))], "?c:Cup ?p:Place ?q:Place") == "a Place that cup2 fits"
    assert reason([RelationCondition("fits", ("?c", "?p"))]) == "cup2 fits sink, which does not hold"
    both = [RelationCondition("canReach", ("?h", "?p")), RelationCondition("fits", ("?c", "?p"))]
    assert reason(both) in ("a Hand that canReach sink", "cup2 fits sink, which does not hold")
    pair = [RelationCondition("canReach", ("?h", "?q")), RelationCondition("fits", ("cup1", "?q"))]
    assert reason(pair, "?c:Cup ?p:Place ?h:Hand ?q:Place") == (
        "some Hand canReach some Place and cup1 fits some Place, which nothing satisfies"
    )
    other = EqualityCondition("?c", "cup2", negated=True)
    either = AnyOf(((other,), (RelationCondition("fits", ("?c", "?p")),)))
    assert reason([either]) == "cup2 fits sink, which never holds"


def test_a_goal_on_an_unknown_fact_or_without_an_achiever_is_reported() -> None:
    assert why(kitchen({"AT tray": "sink"})) == ("tray AT sink can't be reached: there is no <tray, AT> on level 1")
    assert why(kitchen({"CLEAN cup1": TRUE}, behaviors=[PUT])) == (
        "cup1 CLEAN true can't be reached: no behaviour of level 1 has this effect"
    )
    assert why(kitchen({"AT cup1": "left"})).endswith("no behaviour of level 1 has this effect")


def test_the_reason_with_the_fewest_parts_is_given() -> None:
    hard = behavior("A_HARD", 1, "?c:Cup ?h:Hand ?q:Place",
                    [RelationCondition("canReach", ("?h", "?q")), RelationCondition("fits", ("cup1", "?q"))],
                    [becomes("AT", "?c", "sink")])  # fmt: skip
    said = why(kitchen({"AT cup2": "sink"}, [("left", "shelf")], [hard, PUT]))
    assert said == "cup2 AT sink can't be reached: PUT requires a Hand that canReach sink, and there is none"


def test_a_circular_chain_of_reasons_ends() -> None:
    swap = behavior("SWAP", 1, "?c:Cup", [has("DRY", "?c", TRUE)], [becomes("CLEAN", "?c", TRUE)])
    assert why(kitchen({"CLEAN cup1": TRUE}, behaviors=[swap, DRY])) == (
        "cup1 CLEAN true can't be reached: SWAP requires cup1 DRY true, which never holds"
    )


def test_a_fact_that_would_have_to_end_is_reported() -> None:
    stay = behavior("MOVE", 1, "?c:Cup ?p:Place", [lacks("AT", "?c", "shelf")], [becomes("AT", "?c", "?p")])
    said = why(kitchen({"AT cup1": "sink"}, behaviors=[stay]))
    assert said == "cup1 AT sink can't be reached: MOVE requires not cup1 AT shelf, which never holds"


def test_an_achievable_fact_is_not_listed_as_missing() -> None:
    rinse = behavior("RINSE", 1, "?c:Cup", [has("CLEAN", "?c", FALSE)], [becomes("CLEAN", "?c", TRUE)])
    air = behavior(
        "AIR", 1, "?c:Cup", [has("CLEAN", "?c", TRUE), lacks("AT", "?c", "shelf")], [becomes("DRY", "?c", TRUE)]
    )
    stay = behavior("MOVE", 1, "?c:Cup ?p:Place", [lacks("AT", "?c", "shelf")], [becomes("AT", "?c", "?p")])
    said = why(kitchen({"DRY cup1": TRUE}, behaviors=[rinse, air, stay]))
    assert said == "cup1 DRY true can't be reached: AIR requires not cup1 AT shelf, which never holds"


def test_a_behaviour_that_sets_another_value_is_no_achiever_of_the_goal() -> None:
    for there in ("sink", "attic"):
        drop = behavior("DROP", 1, "?c:Cup", [], [becomes("AT", "?c", there)])
        for wanted in {"sink", "attic", "table"} - {there}:
            said = why(kitchen({"AT cup1": wanted}, behaviors=[drop]))
            assert said == f"cup1 AT {wanted} can't be reached: no behaviour of level 1 has this effect"


def test_the_reason_names_the_facts_that_hold_each_other_if_every_place_is_taken() -> None:
    drop = behavior("DROP", 1, "?c:Cup ?p:Place", [PLACE_IS_FREE], [becomes("AT", "?c", "?p")])
    free = kitchen({"AT cup1": "table"}, behaviors=[drop])
    full = replace(free, classes={**free.classes, "Place": ("shelf", "table")})
    assert why(free) == ""
    assert why(full) == (
        "cup1 AT table can't be reached: DROP requires no Cup AT table, which never holds, because cup1 AT shelf and "
        "cup2 AT table always hold"
    )


def test_conditions_that_hold_singly_but_never_together_are_named_together() -> None:
    both = [has("CLEAN", "?x", TRUE), has("DRY", "?x", TRUE)]
    use = behavior("USE", 1, "?c:Cup ?x:Cup", both, [becomes("AT", "?c", "sink")])
    state = {"AT cup1": "shelf", "AT cup2": "table", "CLEAN cup1": TRUE, "DRY cup2": TRUE}
    said = why(kitchen({"AT cup1": "sink"}, behaviors=[use, PUT], reached=[], initial=state))
    assert said == "cup1 AT sink can't be reached: PUT requires a Hand that canReach sink, and there is none"
    said = why(kitchen({"AT cup1": "sink"}, behaviors=[use], reached=[], initial=state))
    assert said == (
        "cup1 AT sink can't be reached: USE requires some Cup CLEAN true and some Cup DRY true, which nothing satisfies"
    )


def test_a_static_reason_is_preferred_to_other_reasons() -> None:
    dirty = has("CLEAN", "?c", TRUE)
    assert reason([dirty, RelationCondition("fits", ("?c", "?p"))]) == "cup2 fits sink, which does not hold"
    assert reason([ClassCondition("?c", "Tray"), dirty]) == "that cup2 is a Tray, but cup2 isn't"


def lamps(many: int, last: str = "") -> str:
    """Return the reason for a row of lamps: each lamp requires the lamp before it, and the first requires an unreachable fact."""
    rows = [f"L{i}" for i in range(many)]
    lit = [SituationType(name, ("Cup",), "Truth", boolean=True) for name in rows]
    light = [
        behavior(f"LIGHT{i}", 1, "?c:Cup", [has(rows[i - 1] if i else last or "CLEAN", "?c", TRUE)],
                 [becomes(rows[i], "?c", TRUE)])
        for i in range(many)
    ]  # fmt: skip
    problem = kitchen({f"{rows[-1]} cup1": TRUE}, behaviors=light)
    situations = {**problem.domain.situations, **{kind.name: kind for kind in lit}}
    return why(replace(problem, domain=replace(problem.domain, situations=situations)))


def test_a_long_chain_of_reasons_is_cut_and_a_circular_reason_is_given_once() -> None:
    cause = "can't be reached: LIGHT0 requires cup1 CLEAN true, which does not hold; so"
    assert lamps(3) == f"cup1 L2 true {cause} cup1 L0 true and cup1 L1 true never hold"
    assert (
        lamps(10)
        == f"cup1 L9 true {cause} cup1 L0 true, cup1 L1 true, cup1 L2 true, cup1 L3 true and 5 more never hold"
    )
    assert lamps(1, "L0") == "cup1 L0 true can't be reached: LIGHT0 requires that cup1 L0 true already holds"


# ------------------------------------------------------------------------------------------------ limits of grounding


def test_a_level_is_refused_for_more_changes_than_are_allowed() -> None:
    reached = closed(kitchen({"AT cup1": "sink"}), 1, None)
    said = refusal(reached, 0)
    assert said is not None
    many = int(said.text.split(": ")[1].split()[0])
    assert said.text == f"level 1 can't be grounded: {many} changes, more than the 0 allowed"
    assert refusal(reached, many) is None
    assert refusal(reached, many - 1) is not None
    assert many == 68  # PUT has 16 instances, WASH and DRY two each; an effect on a place makes a change for each value


def test_a_level_that_is_too_large_says_so_and_proves_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("confab.planner.hierarchical.lowest_level.MOST_ROWS", 2)
    said = proved(kitchen({"AT cup1": "sink"}), 1)
    assert isinstance(said, Reason)
    assert said.text.startswith("level 1 can't be grounded: ")
    monkeypatch.undo()
    assert isinstance(proved(kitchen({"AT cup1": "sink"}), 1), Task)


def test_a_level_for_which_memory_runs_out_proves_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    def out(*_: object, **__: object) -> None:
        raise MemoryError

    monkeypatch.setattr("confab.planner.grounded.grounding.ground", out)
    assert proved(kitchen({"AT cup1": "sink"}), 1) == OUT_OF_MEMORY


def test_states_are_examined_only_within_bounds_and_not_repeatedly(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = kitchen({"AT cup1": "sink", "CLEAN cup1": TRUE, "DRY cup2": TRUE, "AT cup2": "shelf"})
    task = ground(problem, 1)
    assert isinstance(task, Task)
    impossible_goal = replace(task, goal=task.goal | 1 << task.facts.index(Fact(Symbol("AT", ("cup1",)), "table")))
    found = exhausted(impossible_goal, 10_000)
    assert isinstance(found, Reason)
    assert found.text == "none of all 54 states of level 1 that can be reached fulfils the goal"
    assert exhausted(impossible_goal, 53) is None
    assert exhausted(impossible_goal, 54) == found
    examined: list[int] = []
    monkeypatch.setattr(
        "confab.planner.hierarchical.unsolvability.exhausted", lambda _, states, __: examined.append(states)
    )
    proofs = Proofs(LowestLevel(Call(problem, compiled(problem), None, 1), searched=False))
    for work in (0, LOOKING, LOOKING * 3 // 2, 2 * LOOKING, 3 * LOOKING):
        proofs.call.space.worked = work // EASIER
        proofs.examine()
    most = LOOKING // max(len(task.owners), LEAST)
    assert examined == [most, 2 * most]


def test_a_plan_that_the_examination_of_states_returns_is_a_cheapest_plan() -> None:
    chain = tuple(f"c{i}" for i in range(8))
    dear = replace(behavior("DEAR", 1, "?t:Tool", [], [becomes("DONE", "?t", TRUE)]), cost=50.0)
    cheap = behavior("CHEAP", 1, "?t:Tool", [has("CHAIN", "?t", chain[-1])], [becomes("DONE", "?t", TRUE)])
    links = [
        behavior(f"LINK{i}", 1, "?t:Tool", [has("CHAIN", "?t", one)], [becomes("CHAIN", "?t", other)])
        for i, (one, other) in enumerate(pairwise(chain))
    ]
    problem = world(
        [SituationType("DONE", ("Tool",), "Truth", boolean=True), SituationType("CHAIN", ("Tool",), "CHAIN")],
        [dear, cheap, *links],
        {"Tool": ("tool",), "CHAIN": chain},
        {"CHAIN tool": "c0"},
        {"DONE tool": TRUE},
    )
    task = ground(problem, 1)
    assert isinstance(task, Task)
    results = [exhausted(task, most) for most in range(1, 30)]
    assert {len(result.steps) for result in results if isinstance(result, Plan)} == {8}
    assert results[3] is None  # the expensive plan is known, and nothing proves that no plan is cheaper


# ------------------------------------------------------------------------------------------------------ random worlds


@pytest.mark.parametrize("part", range(2))
def test_the_expected_number_of_proofs_is_found_in_random_worlds(part: int) -> None:
    said = [why(hierarchy(seed)) for seed in range(40 * part, 40 * (part + 1))]
    assert sum(map(bool, said)) == FOUND[part]


FOUND = [16, 14]
"""Numbers of unsolvable worlds among forty random worlds."""


def number_of(many: int, of: str, kind: str = "Cup") -> Witness:
    """Return the condition that `many` different cups have a property."""
    condition: Witness | None = None
    names = [f"?c{number}" for number in range(many)]
    for number in reversed(range(many)):
        apart = [EqualityCondition(names[number], other, negated=True) for other in names[:number]]
        more = (condition,) if condition is not None else ()
        condition = Witness(names[number], kind, (has(of, names[number], TRUE), *apart, *more))
    assert condition is not None
    return condition


ATTIC = Witness("?a", "Cup", (has("CLEAN", "?a", TRUE), Witness("?b", "Cup", (has("AT", "?b", "attic"),))))
NO_ATTIC = "PUT requires a Hand that canReach attic, and there is none; so cup1 AT attic never holds"


@pytest.mark.parametrize(
    ("rule", "why_not"),
    [
        ((number_of(2, "DRY"),), "PAIR requires two Cup, each DRY true; there can be only one"),
        ((number_of(3, "DRY"),), "PAIR requires three Cup, each DRY true; there can be only one"),
        ((number_of(5, "CLEAN"),), "PAIR requires five Cup, each CLEAN true; there can be only three"),
        (
            (has("CLEAN", "cup1", TRUE), number_of(2, "DRY")),
            "PAIR requires two Cup, each DRY true; there can be only one",
        ),
        ((ATTIC,), NO_ATTIC),
        ((number_of(2, "CLEAN"), ATTIC), NO_ATTIC),
    ],
)
def test_the_reason_on_a_counting_rule_states_the_possible_number_and_no_internal_names(
    rule: tuple[Condition, ...], why_not: str
) -> None:
    dry1 = behavior("DRY", 1, "", [has("CLEAN", "cup1", TRUE)], [becomes("DRY", "cup1", TRUE)])
    problem = kitchen(
        {"PAIR tray": TRUE}, behaviors=[PUT, WASH, dry1], initial={f"AT cup{n}": "shelf" for n in (1, 2, 3)}
    )
    problem = replace(problem, classes={**problem.classes, "Cup": ("cup1", "cup2", "cup3")})
    pair = SituationType("PAIR", ("Tray",), "Truth", boolean=True)
    rules = {"PAIR": (Rule("PAIR", (Parameter("?t", "Tray"),), (), rule),)}
    domain = replace(problem.domain, situations={**problem.domain.situations, "PAIR": pair}, rules=rules)
    assert why(replace(problem, domain=domain)) == f"tray PAIR true can't be reached: {why_not}"
