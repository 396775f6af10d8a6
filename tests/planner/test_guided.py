"""Experience leads the search and never spoils it; it carries over to what was never seen, and forgets what changed."""

from dataclasses import replace

import pytest

from planner.experience import portfolio as guided
from planner.experience.choice_points import Field, Ground, single_level
from planner.experience.demonstrations import lesson, shortened, shortest
from planner.experience.features import Schema
from planner.experience.portfolio import Memory
from planner.experience.scoring import Judge
from planner.hierarchical import planner as fast
from planner.hierarchical.operators import Program
from planner.plan import Outcome, Status
from planner.validation import validate
from reasoner.memory.counts import Candidate, Decision, Experience, Tally
from reasoner.symbols import Problem, Symbol
from worlds.lessons import problem, taught, teach

TRAINING = "served", "swap", "rotate", "full", "handover", "blocked"


def expanded(outcome: Outcome, level: int = 1) -> int:
    return sum(counts.expanded for at, counts in outcome.search.items() if at == level)


def inverted(memory: Memory) -> Memory:
    """Return a memory for which what was chosen was passed over, and the other way round."""
    experience = Experience("inverted", {"inverted": 1})
    for _, conclusion, pattern, tally in memory.experience:
        table = experience.counts.setdefault(("inverted", 0), {}).setdefault(conclusion, {})
        table[pattern] = Tally(chosen=tally.passed_over, passed_over=tally.chosen)
    return Memory(experience)


def choice(memory: Memory, within: Problem, level: int = 1) -> Ground:
    """Return what memory would do first, of all that is relevant."""
    field = Field(Program(within), within, level)
    judge = judge_of(memory, field.schema)

    def cogency(ground: Ground) -> float:
        candidate = field.candidate(ground)
        assert candidate is not None
        return judge.cogency(candidate)

    return max(field.proposals(field.unmet()), key=lambda ground: (round(cogency(ground), 9), ground))


def judge_of(memory: Memory, schema: Schema) -> Judge:
    behaviors = schema.problem.domain.behaviors.values()
    return Judge(memory.experience, schema.problem.parents, {b.name: schema.roles(b) for b in behaviors})


@pytest.mark.parametrize(("family", "objects"), [("served", 30), ("swap", 30)])
def test_on_scenes_five_times_as_large_every_expansion_is_a_step(family: str, objects: int) -> None:
    within = problem(family, objects, 1)
    outcome = guided.plan(within, taught(), "leading", improve=0)
    assert outcome.plan is not None
    assert validate(within, outcome.plan) == []
    assert expanded(outcome) <= 1.05 * len(outcome.plan.steps)


@pytest.mark.parametrize("family", ["served", "swap", "full", "random"])
@pytest.mark.parametrize("kind", ["good", "inverted", "wrong domain"])
def test_in_strict_mode_expansions_never_exceed_the_memoryless_ones_by_more_than_a_twentieth(
    family: str, kind: str
) -> None:
    memory = {"good": taught(), "inverted": inverted(taught()), "wrong domain": foreign()}[kind]
    for seed in range(2):
        within = problem(family, 8, seed)
        alone, with_memory = fast.plan(within), guided.plan(within, memory, "strict")
        assert with_memory.status is alone.status
        assert expanded(with_memory) <= 1.05 * expanded(alone)


def foreign() -> Memory:
    """Return a memory of behaviours that this domain doesn't have."""
    memory = Experience("foreign", {"foreign": 1})
    for _, conclusion, pattern, tally in taught().experience:
        other = replace(conclusion, behavior=f"OTHER_{conclusion.behavior}")
        memory.counts.setdefault(("foreign", 0), {}).setdefault(other, {})[pattern] = tally
    return Memory(memory)


def test_a_memory_that_knows_none_of_the_behaviours_is_not_asked() -> None:
    within = problem("swap", 8)
    alone, with_memory = fast.plan(within), guided.plan(within, foreign())
    assert {k: c.expanded for k, c in with_memory.search.items()} == {k: c.expanded for k, c in alone.search.items()}


def test_what_the_fast_planner_solves_soon_memory_has_no_part_in() -> None:
    within = problem("swap", 8)
    alone, with_memory = fast.plan(within), guided.plan(within, taught())
    assert with_memory.plan == alone.plan
    assert {k: c.expanded for k, c in with_memory.search.items()} == {k: c.expanded for k, c in alone.search.items()}


def test_a_clear_preference_is_obeyed_from_the_first_expansion_on() -> None:
    within = single_level(problem("served", 4), 2)
    field = Field(Program(within), within, 2)
    picks = [ground for ground in field.proposals(field.unmet()) if ground[0] == "B2_PICK"]
    by_object = {ground[1][1]: [g for g in picks if g[1][1] == ground[1][1]] for ground in picks}
    left, right = (field.candidate(ground) for ground in next(two for two in by_object.values() if len(two) == 2))
    assert left is not None
    assert right is not None
    experience = Experience("robot")
    assert not Memory(experience).prefers(within, 2)
    for _ in range(10):
        experience.learn([Decision(right, (left,))])
    assert Memory(experience).prefers(within, 2)
    assert not Memory(experience).prefers(problem("served", 4), 1)


def test_a_shortest_plan_is_no_longer_than_the_fast_planners() -> None:
    within = single_level(problem("full", 6, 101), 1)
    program, found = Program(within), fast.plan(single_level(problem("full", 6, 101), 1)).plan
    steps = shortest(program, within, 1)
    assert steps is not None
    assert found is not None
    assert Field(program, within, 1).works(steps)
    assert len(steps) <= len(found.steps)
    assert shortest(program, within, 1, most=2) is None


def test_one_free_place_and_zones_that_hands_share_are_learned() -> None:
    experience = Experience("full")
    for seed in range(200, 208):
        teach(experience, problem("full", 8, seed))
    within = problem("full", 20, 1003)
    outcome = guided.plan(within, Memory(experience), "leading", improve=0)
    assert outcome.plan is not None
    assert validate(within, outcome.plan) == []
    assert expanded(outcome) <= 1.05 * len(outcome.plan.steps)


def test_a_plan_that_memory_led_to_is_made_shorter_like_any_other() -> None:
    within = problem("random", 20, 20015)
    first, plan = (guided.plan(within, taught(TRAINING), "leading", improve=shapes).plan for shapes in (0, 2))
    assert first is not None
    assert plan is not None
    assert validate(within, plan) == []
    assert len(plan.primitives) < len(first.primitives)


@pytest.mark.parametrize(
    ("family", "objects", "costly"), [("full", 40, True), ("random", 20, False), ("swap", 40, False)]
)
def test_memory_is_asked_before_several_goals_need_detours_and_not_for_few(
    family: str, objects: int, costly: bool
) -> None:
    told: list[int | None] = []
    fast.plan(problem(family, objects, 20001), watch=told.append)
    assert (None in told) == costly
    assert told.count(1) < guided.patience_for(problem(family, objects, 20001))


def test_a_lesson_is_a_plan_without_needless_steps_and_nothing_where_there_is_none() -> None:
    for family, objects, level in (("full", 6, 1), ("blocked", 6, 2)):
        within = single_level(problem(family, objects, 101), level)
        program = Program(within)
        steps = lesson(problem(family, objects, 101), level)
        found = fast.plan(problem(family, objects, 101), improve=0).plan
        assert found is not None
        assert Field(program, within, level).works(steps)
        assert shortened(program, within, level, steps) == steps
        assert len(steps) <= len(found.at_level(level))
    assert lesson(problem("unsolvable", 4), 1) == []


def test_untrusted_memory_runs_in_strict_mode_by_itself() -> None:
    within = problem("swap", 8)
    untrusted = replace(taught(), trusted=False)
    assert expanded(guided.plan(within, untrusted, "leading")) == expanded(guided.plan(within, taught(), "strict"))


def test_an_inverted_memory_costs_no_more_than_the_guard_and_spoils_no_plan() -> None:
    for family in ("served", "swap", "full"):
        within = problem(family, 8, 1)
        alone, misled = fast.plan(within), guided.plan(within, inverted(taught()), "leading")
        assert misled.plan is not None
        assert validate(within, misled.plan) == []
        assert expanded(misled) <= 1.05 * expanded(alone) + guided.stretch_for(within) * (1 + len(within.goal))


def test_what_is_unsolvable_stays_so() -> None:
    assert guided.plan(problem("unsolvable", 4), taught()).status is Status.UNSOLVABLE


def test_the_same_call_gives_the_same_plan() -> None:
    within = problem("swap", 8, 1)
    assert guided.plan(within, taught(), "leading").plan == guided.plan(within, taught(), "leading").plan


def test_the_same_state_with_swapped_goals_leads_to_another_choice() -> None:
    within = problem("served", 4)
    wanted = {symbol: value for symbol, value in within.goal.items() if symbol.situation == "LOCATION"}
    cups = [symbol for symbol in wanted if within.initial[symbol] != wanted[symbol]]
    one, two = cups[0], cups[1]
    here = replace(within, goal={one: wanted[one], two: wanted[two]})
    there = replace(within, goal={one: wanted[two], two: wanted[one]})
    assert choice(taught(), here) != choice(taught(), there)


def test_a_class_never_seen_does_exactly_as_well() -> None:
    bowl = "\n:Bowl a owl:Class, owl:NamedIndividual ; rdfs:subClassOf k:Cup .\n"

    def bowls(text: str) -> str:
        return text.replace("owl:NamedIndividual, k:Cup", "owl:NamedIndividual, :Bowl") + bowl

    for seed in range(2):
        seen, unseen = problem("served", 12, seed), problem("served", 12, seed, edit=bowls)
        assert unseen.classes["Bowl"] == seen.classes["Cup"]
        one, other = guided.plan(seen, taught(), "leading"), guided.plan(unseen, fresh(taught()), "leading")
        assert one.plan is not None
        assert other.plan is not None
        assert [str(s) for s in one.plan.steps] == [str(s) for s in other.plan.steps]
        assert expanded(one) == expanded(other)


def test_a_class_that_differs_in_one_affordance_is_told_apart() -> None:
    lidded = "\n:Lidded a owl:Class, owl:NamedIndividual ; rdfs:subClassOf k:Vessel .\n"

    def lids(text: str) -> str:
        return text.replace(":cup1 a owl:NamedIndividual, k:Cup", ":cup1 a owl:NamedIndividual, :Lidded") + lidded

    kinds = Schema(Program(problem("served", 4, edit=lids))).kinds
    assert kinds["cup1"] == "Vessel"
    assert kinds["cup2"] == "Cup"


def fresh(memory: Memory) -> Memory:
    """Return the same memory, not yet read."""
    return Memory(memory.experience)


def test_a_hundred_irrelevant_objects_change_no_choice() -> None:
    plain, cluttered = problem("served", 8), problem("served", 8, clutter=100)
    one, other = guided.plan(plain, taught(), "leading"), guided.plan(cluttered, fresh(taught()), "leading")
    assert one.plan is not None
    assert other.plan is not None
    assert [(s.behavior, s.arguments) for s in one.plan.steps] == [(s.behavior, s.arguments) for s in other.plan.steps]


def test_a_preference_that_flips_is_relearned_within_ten_episodes_after_forty() -> None:
    within = single_level(problem("served", 4), 2)
    field = Field(Program(within), within, 2)
    picks = [ground for ground in field.proposals(field.unmet()) if ground[0] == "B2_PICK"]
    by_object = {ground[1][1]: [g for g in picks if g[1][1] == ground[1][1]] for ground in picks}
    left, right = next(two for two in by_object.values() if len(two) == 2)
    one, other = field.candidate(left), field.candidate(right)
    assert one is not None
    assert other is not None
    experience = Experience("robot")

    def prefers(chosen: Candidate, over: Candidate) -> bool:
        judge = judge_of(Memory(experience), field.schema)
        return judge.cogency(chosen) > judge.cogency(over)

    for _ in range(40):
        experience.learn([Decision(one, (other,))])
    assert prefers(one, other)
    episodes = 0
    while not prefers(other, one):
        experience.learn([Decision(other, (one,))])
        episodes += 1
    assert episodes <= 10


def test_what_failed_is_chosen_less() -> None:
    field = Field(Program(problem("served", 4)), problem("served", 4), 1)
    grounds = field.proposals(field.unmet())
    candidate = field.candidate(grounds[0])
    assert candidate is not None
    experience = Experience("robot")
    experience.learn([Decision(candidate)])
    before = judge_of(Memory(experience), field.schema).cogency(candidate)
    experience.learn([Decision(candidate, succeeded=False)] * 3)
    assert judge_of(Memory(experience), field.schema).cogency(candidate) < before


def test_facts_come_from_the_schema_and_say_what_the_goal_wants() -> None:
    within = problem("served", 4)
    field = Field(Program(within), within, 1)
    cup = next(s.arguments[0] for s, v in within.goal.items() if within.initial[s] != v and s.situation == "LOCATION")
    goal = within.goal[Symbol("LOCATION", (cup,))]
    candidate = field.candidate(("B1_MOVE", (cup, goal)))
    assert candidate is not None
    facts = dict(candidate.pattern)
    assert facts["object · goal LOCATION = location"] == "yes"
    assert facts["object wanted LOCATION"] == "unmet"
    assert facts["location · wants LOCATION = object"] == "yes"
