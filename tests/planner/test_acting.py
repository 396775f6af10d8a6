"""The executive in a symbolic world: interventions by people, and the reactions of the executive."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from confab.planner.acting.dispatching import Concurrency
from confab.planner.acting.episode import End, Episode, Event, Intervention, InterventionKind
from confab.planner.acting.executive import act
from confab.planner.acting.failure_memory import Caution
from confab.planner.acting.retries import RetryPolicy
from confab.planner.acting.symbolic_world import SymbolicWorld
from confab.planner.acting.world import WorldReport
from confab.planner.hierarchical.planner import plan
from confab.planner.paper.hierarchy import plan as paper_plan
from confab.planner.paper.learning import learn
from confab.planner.plan import Plan, Step
from confab.planner.validation import successor, validate
from confab.reasoner.generate import write_scene
from confab.reasoner.graph.knowledge import load
from confab.reasoner.memory.links import Links
from confab.reasoner.possible import ImpossibleStateError
from confab.reasoner.reading.problem import read
from confab.reasoner.symbols import FALSE, Fact, State, Symbol
from tests.planner.serving import planned, serving

SERVED_AS_IN_FIGURE_8 = {
    22: {2: [6, 28, 32], 22: [18, 30, 32]},
    34: {4: [8, 29, 33], 14: [10, 35, 37, 33], 27: [23, 31, 33]},
    28: {3: [7, 28, 32], 20: [16, 30, 32]},
    39: {5: [9, 29, 33], 15: [11, 35, 37, 33], 26: [22, 31, 33]},
}


@cache
def situations() -> tuple[State, ...]:
    """The state before each primitive of the plan."""
    found: list[State] = [serving().initial]
    for step in planned().primitives:
        after = successor(serving(), serving().domain.behaviors[step.behavior], step.arguments, found[-1])
        assert after is not None
        found.append(after)
    return tuple(found)


def at(individual: str, value: str, situation: str = "LOCATION") -> Fact:
    return Fact(Symbol(situation, (individual,)), value)


def moved(individual: str, place: str, **when: object) -> Intervention:
    return Intervention(InterventionKind.WORLD, (at(individual, place),), **when)  # type: ignore[arg-type]


def wanted(individual: str, value: str, situation: str = "LOCATION", **when: object) -> Intervention:
    return Intervention(InterventionKind.GOAL, (at(individual, value, situation),), **when)  # type: ignore[arg-type]


def acted(*interventions: Intervention, **options: object) -> Episode:
    options = {"plan": planned(), **options}
    return act(serving(), SymbolicWorld(serving()), interventions=interventions, **options)  # type: ignore[arg-type]


def tree(done: Plan) -> dict[int, dict[int, list[int]]]:
    return {a.id: {m.id: [p.id for p in m.steps] for m in a.steps} for a in done.steps}


def holds(episode: Episode) -> bool:
    return all(episode.observed.get(symbol, FALSE) == value for symbol, value in episode.goal.items())


def at_rest(episode: Episode) -> bool:
    rests = {name: s.rest for name, s in serving().domain.situations.items() if s.rest is not None}
    return all(value == rests[s.situation] for s, value in episode.observed.items() if s.situation in rests)


# ------------------------------------------------------------------------------------------------------------- figure 8


def test_after_step_28_the_cup_moves_and_the_right_hand_does_the_rest_as_in_figure_8() -> None:
    episode = acted(moved("cup2", "location8", after=28), wanted("cup2", "location8", after=28))
    assert episode.status is End.REACHED
    assert tree(episode.done) == SERVED_AS_IN_FIGURE_8
    (change,) = episode.replans
    assert (change.kind, change.dropped, change.added) == ("repair", 10, 10)
    assert holds(episode)
    assert at_rest(episode)


def test_the_papers_mode_executes_the_steps_of_figures_7_and_8_after_a_demonstration() -> None:
    shown = Plan(tuple(sorted(planned().steps, key=lambda step: [22, 34, 28, 39].index(step.id))))
    links = learn(serving(), shown, Links())
    episode = acted(
        moved("cup2", "location8", after=28),
        wanted("cup2", "location8", after=28),
        plan=None,
        planner=partial(paper_plan, links=links),
    )
    assert [step.id for step in episode.done.steps] == [22, 34, 28, 39]
    assert tree(episode.done) == SERVED_AS_IN_FIGURE_8
    assert episode.replans[0].after == (2, 1, 2)


def test_replanning_from_scratch_gives_the_same_steps_as_repair(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("confab.planner.acting.repair.repair", lambda *_: None)
    episode = acted(moved("cup2", "location8", after=28), wanted("cup2", "location8", after=28))
    assert {change.kind for change in episode.replans} == {"replan"}
    assert tree(episode.done) == SERVED_AS_IN_FIGURE_8


def test_the_executed_steps_equal_the_plan_without_interventions() -> None:
    episode = acted()
    assert episode.done == planned()
    assert episode.replans == ()
    assert validate(serving(), episode.done) == []


# ------------------------------------------------------------------------------------------------------------- safety


def begun(episode: Episode) -> list[str]:
    return [str(event.step) for event in episode.events]


def test_the_robot_does_not_pour_into_a_removed_cup() -> None:
    episode = acted(Intervention(InterventionKind.REMOVE, individual="cup2", after=28))
    assert episode.status is End.IMPOSSIBLE
    assert any("cup2" in reason.terms for reason in episode.reasons)
    last = max(i for i, event in enumerate(episode.events) if "cup2" in event.step.arguments)
    assert episode.events[last].step.path < (2,)
    assert episode.observed[Symbol("BEVERAGE", ("cup1",))] == "beverage1"
    assert at_rest(episode)


def test_a_primitive_whose_precondition_is_lost_is_not_begun() -> None:
    class Watched(SymbolicWorld):
        def execute(self, step: Step) -> WorldReport:
            behavior = self.problem.domain.behaviors[step.behavior]
            assert successor(self.problem, behavior, step.arguments, self.state) is not None, step
            return super().execute(step)

    world = Watched(serving())
    path = planned().primitives[8].path  # the hand holds cup2 and is raised
    episode = act(serving(), world, planned(), [moved("cup2", "location6", after=path)])
    assert episode.status is End.REACHED


def test_an_interrupted_primitive_leaves_the_hand_in_a_state_from_which_planning_continues() -> None:
    reach = planned().primitives[0]
    episode = acted(moved("cup1", "location8", at=0.5))
    first = episode.events[0]
    assert (str(first.step), first.ok, first.code) == (str(reach), False, "interrupted")
    assert episode.status is End.REACHED
    assert at_rest(episode)


def test_a_hand_does_not_put_an_object_down_at_a_place_that_a_person_has_occupied() -> None:
    over = next(i for i, s in enumerate(planned().primitives) if s.arguments[1:] == ("location5",))
    episode = acted(moved("bottle2", "location5", after=planned().primitives[over].path))
    assert episode.status is End.REACHED
    for event, following in zip(episode.events, episode.events[1:], strict=False):
        if event.surprises and any(s.symbol.arguments == ("bottle2",) for s in event.surprises):
            assert following.step.behavior != "B3_PUT_DOWN"


# ------------------------------------------------------------------------------------------------------------- impossible


@pytest.mark.parametrize("value", ["beverage1", "beverage2"])
def test_a_cup_filled_with_the_wrong_drink_is_proved_hopeless_and_the_rest_is_served(value: str) -> None:
    fill = Intervention(InterventionKind.WORLD, (at("cup2", value, "BEVERAGE"),), after=28)
    episode = acted(fill)
    assert episode.status is (End.REACHED if value == "beverage2" else End.IMPOSSIBLE)
    assert bool(episode.reasons) == (value == "beverage1")
    assert episode.observed[Symbol("BEVERAGE", ("cup1",))] == "beverage1"
    assert holds(episode)


def test_a_dropped_goal_is_not_achieved() -> None:
    drop = [
        Intervention(InterventionKind.DROP_GOAL, symbol=Symbol("BEVERAGE", (cup,)), after=28)
        for cup in ("cup1", "cup2")
    ]
    episode = acted(*drop)
    assert episode.status is End.REACHED
    assert len(episode.done.primitives) == 12


def test_an_added_object_at_a_goal_place_is_moved_away() -> None:
    newcomer = (at("cup9", "location5"), at("cup9", "no_beverage", "BEVERAGE"))
    episode = acted(Intervention(InterventionKind.ADD, newcomer, individual="cup9", kind="Cup", after=22))
    assert episode.status is End.REACHED
    assert episode.observed[Symbol("LOCATION", ("cup9",))] != "location5"


def test_goals_about_added_objects_are_achieved() -> None:
    newcomer = (at("cup9", "location6"), at("cup9", "no_beverage", "BEVERAGE"))
    episode = acted(
        Intervention(InterventionKind.ADD, newcomer, individual="cup9", kind="Cup", after=22),
        wanted("cup9", "beverage1", "BEVERAGE", after=22),
    )
    assert episode.status is End.REACHED
    assert episode.observed[Symbol("BEVERAGE", ("cup9",))] == "beverage1"


# ------------------------------------------------------------------------------------------------------------- failures


def failing(test: Callable[[Step, State], bool], code: str = "no path") -> Episode:
    def fault(step: Step, state: State) -> WorldReport | None:
        return WorldReport(False, code, ("cup2",)) if test(step, state) else None

    return act(serving(), SymbolicWorld(serving(), fault=fault), planned())


def test_a_primitive_without_a_path_is_executed_after_the_obstacle_has_moved() -> None:
    there = at("cup2", "location1")

    def blocked(step: Step, state: State) -> WorldReport | None:
        taken = step.behavior == "B3_REACH_HAND_OBJECT" and step.arguments[1] == "cup1"
        return (
            WorldReport(False, "no path", ("cup1", "cup2"), "", (there,))
            if taken and state[there.symbol] == there.value
            else None
        )

    episode = act(serving(), SymbolicWorld(serving(), fault=blocked), planned())
    assert episode.status is End.REACHED
    tried = [failure.step.arguments for failure in episode.failures]
    assert tried
    assert len(tried) == len(set(tried))  # no hand tries the same primitive twice
    assert {one.facts for one in episode.refuted} == {(there,)}


def test_a_hand_that_was_stopped_on_its_way_and_has_no_perceived_position_is_lifted() -> None:
    position = Symbol("HAND_POSITION", ("left_hand",))

    class Stopping(SymbolicWorld):
        stops, lost = 2, False

        def execute(self, step: Step) -> WorldReport:
            self.lost = step.behavior == "B3_LIFT" and self.stops > 0
            self.stops -= self.lost
            return WorldReport(False, "tracking error") if self.lost else super().execute(step)

        def observe(self) -> State:
            return {symbol: value for symbol, value in self.state.items() if not (self.lost and symbol == position)}

    episode = act(serving(), Stopping(serving()), planned())
    assert episode.status is End.REACHED
    assert [failure.code for failure in episode.failures] == ["tracking error"] * 2
    assert None in {seen.value for seen in episode.course if seen.symbol == position}
    assert len(episode.events) == 32 + 2
    assert not episode.replans


def test_a_primitive_that_failed_once_is_repeated() -> None:
    tries = iter([True])
    episode = failing(lambda step, state: step.behavior == "B3_GRASP" and next(tries, False), "no grasp")
    assert episode.status is End.REACHED
    assert [failure.code for failure in episode.failures] == ["no grasp"]
    assert episode.replans == ()


def test_the_other_hand_does_the_step_if_one_hand_has_no_path() -> None:
    bottle = Symbol("LOCATION", ("bottle2",))
    episode = failing(
        lambda step, state: (
            step.arguments[0] == "left_hand" and state[bottle] == "location3" and "bottle2" in step.arguments
        )
    )
    assert episode.status is End.REACHED
    assert ("right_hand", "bottle2") in [step.arguments for step in episode.done.primitives]
    assert len(episode.failures) == 2


def test_an_episode_in_which_no_hand_has_a_path_gives_up_with_a_reason() -> None:
    episode = failing(lambda step, state: "cup2" in step.arguments and step.behavior == "B3_REACH_HAND_OBJECT")
    assert episode.status is End.GAVE_UP
    assert episode.reasons
    assert at_rest(episode)


def test_an_episode_in_which_every_primitive_fails_is_given_up_soon() -> None:
    episode = failing(lambda step, state: True)
    assert episode.status is End.GAVE_UP
    assert len(episode.events) < 100


def test_the_number_of_primitives_is_bounded() -> None:
    class Stubborn(SymbolicWorld):
        def execute(self, step: Step) -> WorldReport:
            said = super().execute(step)
            if step.behavior == "B3_LIFT":  # a person puts the cup back again and again
                self.state[Symbol("LOCATION", ("cup1",))] = "location2"
                self.state[Symbol("HOLDS", ("left_hand",))] = "nothing"
            return said

    episode = act(serving(), Stubborn(serving()), planned(), retry_policy=RetryPolicy(primitives=2))
    assert episode.status is End.GAVE_UP
    assert len(episode.events) <= 2 * 32 + 10


def blocked(step: Step, state: State) -> WorldReport | None:
    """An unperceived obstacle: the left hand can't reach the bottle at location3."""
    there = state[Symbol("LOCATION", ("bottle2",))] == "location3"
    hit = step.behavior == "B3_REACH_HAND_OBJECT" and step.arguments == ("left_hand", "bottle2") and there
    return WorldReport(False, "no path", ("bottle2",)) if hit else None


@pytest.mark.parametrize("learning", [True, False])
def test_a_second_episode_avoids_the_failure_only_if_the_robot_has_learned_it(learning: bool) -> None:
    caution, ends = Caution(), []
    for _ in range(3):
        world = SymbolicWorld(serving(), fault=blocked)
        episode = act(serving(), world, retry_policy=RetryPolicy(failures=2), caution=caution)
        ends.append(episode.status)
        caution = caution.learned(episode) if learning else caution
    assert ends == [End.GAVE_UP, *[End.REACHED if learning else End.GAVE_UP] * 2]


def test_a_task_with_one_possible_hand_is_not_given_up_because_of_past_failures() -> None:
    only = ("canReach", ("left_hand", "location1"))
    world = SymbolicWorld(serving())
    assert act(serving(), world, caution=Caution({only: (9, 9)})).status is End.REACHED


def test_the_failure_counts_of_two_robots_are_added() -> None:
    one, other = ("canReach", ("left_hand", "location1")), ("canReach", ("left_hand", "location2"))
    assert (Caution({one: (3, 1)}) + Caution({one: (1, 1), other: (2, 0)})).counts == {one: (4, 2), other: (2, 0)}


# ------------------------------------------------------------------------------------------------------------- at random

OBJECTS, PLACES = ("bottle1", "bottle2", "cup1", "cup2"), tuple(f"location{i}" for i in range(1, 9))


@st.composite
def interventions(draw: st.DrawFn) -> Intervention:
    position = draw(st.integers(0, len(planned().primitives) - 1))
    inside = draw(st.booleans())
    when = {"at": position + 0.5} if inside else {"after": planned().primitives[position].path}
    state = situations()[position]
    taken = set(state.values()) | set(serving().goal.values())
    free = [place for place in PLACES if place not in taken]
    one = draw(st.sampled_from(OBJECTS))
    cup = draw(st.sampled_from(OBJECTS[2:]))
    drink = draw(st.sampled_from(["no_beverage", "beverage1", "beverage2"]))
    choices: list[Intervention] = [
        moved(one, draw(st.sampled_from(free)), **when),
        Intervention(InterventionKind.WORLD, (at(cup, drink, "BEVERAGE"),), **when),
        Intervention(InterventionKind.REMOVE, individual=one, **when),
        wanted(one, draw(st.sampled_from(free)), **when),
        Intervention(InterventionKind.DROP_GOAL, symbol=draw(st.sampled_from(sorted(serving().goal))), **when),
    ]
    return draw(st.sampled_from(choices))


@settings(max_examples=20)
@given(st.lists(interventions(), min_size=1, max_size=2))
def test_the_goal_is_reached_or_proved_impossible_whatever_people_do(happenings: list[Intervention]) -> None:
    episode = acted(*happenings)
    assert episode.status in (End.REACHED, End.IMPOSSIBLE)
    assert (episode.status is End.IMPOSSIBLE) == bool(episode.reasons)
    assert holds(episode)
    assert at_rest(episode)
    assert len(episode.events) <= 120


def test_the_same_course_of_events_gives_the_same_episode() -> None:
    def timeless(episode: Episode) -> Episode:
        return replace(episode, seconds={}, replans=tuple(replace(r, seconds=0.0) for r in episode.replans))

    happening = moved("cup1", "location6", at=20.5)
    assert timeless(acted(happening)) == timeless(acted(happening))


def test_an_observer_receives_every_primitive_and_every_change() -> None:
    events: list[Event] = []
    episode = acted(moved("cup2", "location8", after=28), wanted("cup2", "location8", after=28), observer=events.append)
    said = [event.what for event in events]
    assert said.count("begin") == said.count("end") == len(episode.events)
    assert said.count("intervention") == 2
    assert said.count("repair") == 1
    assert said[0] == "plan"
    assert said[-1] == "over"


def test_an_intervention_among_twenty_objects_changes_few_steps_of_the_plan(
    tmp_path_factory: pytest.TempPathFactory,
) -> None:
    path = tmp_path_factory.mktemp("scenes") / "served.ttl"
    write_scene(path, "served", 20)
    problem = read(load(path)).problem
    begin = plan(problem).plan
    assert begin is not None
    step = begin.primitives[80]
    episode = act(problem, SymbolicWorld(problem), begin, [moved("cup3", "location40", after=step.path)])
    assert episode.status in (End.REACHED, End.IMPOSSIBLE)
    assert all(change.distance < 60 for change in episode.replans)


# ------------------------------------------------------------------------------------------------------------- the world itself


def test_interventions_whose_time_never_came_are_listed_as_missed() -> None:
    never = [moved("cup2", "location8", after=999), moved("cup2", "location8", at=1e6)]
    episode = acted(*never)
    assert episode.status is End.REACHED
    assert list(episode.missed) == never
    assert episode.interventions == ()


def test_a_primitive_that_reports_a_failure_but_has_its_effects_counts_as_done() -> None:
    class Grumbling(SymbolicWorld):
        def execute(self, step: Step) -> WorldReport:
            said = super().execute(step)
            return WorldReport(False, "object disturbed", ("bottle1",)) if step.behavior == "B3_GRASP" else said

    episode = act(serving(), Grumbling(serving()), planned())
    assert episode.status is End.REACHED
    assert tree(episode.done) == tree(planned())
    assert [failure.code for failure in episode.failures] == ["object disturbed"] * 4


def test_primitives_that_failed_with_every_hand_are_retried_before_the_goal_is_given_up() -> None:
    tries = iter(range(4))  # each hand fails twice, then a person removes the obstacle
    episode = failing(
        lambda step, state: (
            "cup2" in step.arguments and step.behavior == "B3_REACH_HAND_OBJECT" and next(tries, None) is not None
        )
    )
    assert episode.status is End.REACHED
    assert len(episode.failures) == 4


def test_only_goals_that_failures_prevent_are_given_up() -> None:
    """No hand can ever grasp cup2: all other goals are achieved first, and the reason names the failure."""
    episode = failing(lambda step, state: "cup2" in step.arguments and step.behavior == "B3_REACH_HAND_OBJECT")
    assert episode.status is End.GAVE_UP
    assert episode.observed[Symbol("BEVERAGE", ("cup1",))] == "beverage1"
    assert all("B3_REACH_HAND_OBJECT" in reason.text and "cup2" in reason.terms for reason in episode.reasons)
    assert holds(episode)
    last = [event for event in episode.events if event.ok][-1]
    first = next(event for event in episode.events if not event.ok)
    assert first.begin < last.begin


# ------------------------------------------------------------------------------------------------------------- beyond the scene


def test_an_object_that_is_pushed_off_its_place_is_at_a_spot_and_is_brought_back() -> None:
    push = Intervention(InterventionKind.PUSH, individual="cup2", numbers=(0.0, 0.08), after=28)  # cup2 is at its goal
    episode = acted(push)
    assert episode.status is End.REACHED
    assert [found.individual for found, _ in episode.discovered] == ["spot1"]
    assert Symbol("LOCATION", ("cup2",)) in {s.symbol for event in episode.events for s in event.surprises} or any(
        seen.value == "spot1" for seen in episode.course
    )
    assert episode.observed[Symbol("LOCATION", ("cup2",))] == "location5"


def test_an_object_in_a_hand_cannot_be_pushed() -> None:
    with pytest.raises(ImpossibleStateError, match="can't be pushed"):
        acted(Intervention(InterventionKind.PUSH, individual="cup1", numbers=(0.0, 0.08), at=3.5))


def test_an_unknown_box_at_a_goal_place_is_moved_away() -> None:
    fact = at("box1", "location5")
    episode = acted(
        Intervention(InterventionKind.BOX, (fact,), individual="box1", kind="Movable", numbers=(0.1,) * 3, after=22)
    )
    assert episode.status is End.REACHED
    assert episode.observed[fact.symbol] not in ("location5", "in_hand")


@pytest.mark.parametrize("knocked", ["cup2", "bottle1"])
def test_only_the_goals_of_a_knocked_over_object_are_given_up(knocked: str) -> None:
    episode = acted(Intervention(InterventionKind.KNOCK, individual=knocked, after=22))
    assert episode.status is End.IMPOSSIBLE
    assert any(knocked in reason.text for reason in episode.reasons)
    assert holds(episode)
    assert at_rest(episode)


class Broken(SymbolicWorld):
    """A robot whose driver fails in a different way at each call."""

    def __init__(self, how: str) -> None:
        super().__init__(serving())
        self.how = how

    def observe(self) -> State:
        if self.how == "observe raises" and self.seconds > 3:
            raise ConnectionError("no camera")
        return [] if self.how == "observe returns" else super().observe()  # type: ignore[return-value]

    def execute(self, step: Step) -> WorldReport:
        if self.how == "execute raises" and self.seconds > 3:
            raise RuntimeError("motor 3 is hot")
        return None if self.how == "execute returns" else super().execute(step)  # type: ignore[return-value]


@pytest.mark.parametrize(
    ("how", "word"),
    [
        ("observe raises", "observe() raised ConnectionError: no camera"),
        ("execute raises", "raised RuntimeError: motor 3 is hot"),
        ("observe returns", "observe() returned []; wanted a mapping"),
        ("execute returns", "returned None without ok"),
    ],
)
def test_a_world_that_breaks_ends_the_episode_with_a_clear_reason(how: str, word: str) -> None:
    episode = act(serving(), Broken(how), planned())
    assert episode.status is End.GAVE_UP
    assert word in episode.reasons[-1].text
    assert len(episode.done.primitives) <= 4


def test_a_goal_is_impossible_after_the_removal_of_all_objects() -> None:
    episode = acted(*(Intervention(InterventionKind.REMOVE, individual=one, after=22) for one in OBJECTS))
    assert episode.status is End.IMPOSSIBLE
    assert at_rest(episode)
    assert episode.goal == {}


@settings(max_examples=12)
@given(
    position=st.integers(0, 31),
    inside=st.booleans(),
    change=st.sampled_from((partial(moved, "cup2"), partial(moved, "bottle1"), partial(wanted, "cup2"))),
)
def test_several_hands_reach_the_goals_after_any_intervention(
    position: int, inside: bool, change: Callable[..., Intervention]
) -> None:
    when = {"at": position * 22 / 32 + 0.2} if inside else {"after": planned().primitives[position].path}
    episode = act(serving(), SymbolicWorld(serving()), planned(), [change("location8", **when)], together=Concurrency())
    assert episode.status is End.REACHED
    assert holds(episode)
    assert not episode.missed
    assert [event.begin for event in episode.events] == sorted(event.begin for event in episode.events)


def test_several_hands_begin_nothing_more_once_an_intervention_is_due() -> None:
    after = planned().primitives[5].path
    episode = act(
        serving(),
        SymbolicWorld(serving()),
        planned(),
        [moved("cup2", "location8", after=after)],
        together=Concurrency(),
    )
    ((_, seconds),) = episode.interventions
    last = max(event.end for event in episode.events if event.begin < seconds)
    assert next(event.end for event in episode.events if event.step.path == after) == last == seconds
