"""The generator of small random worlds with all constructs, and the plain interpreter that judges plans in them."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from time import process_time
from typing import Any

import pytest

from confab.planner.plan import Plan, Status, Step
from confab.planner.validation import BehaviorReader
from confab.planning import plan
from confab.reasoner.aggregates.dependencies import read_by
from confab.reasoner.derivation import strata
from confab.reasoner.graph.knowledge import KnowledgeError
from confab.reasoner.limits import LimitError
from confab.reasoner.reading.problem import read
from confab.scene import load
from tests.planner.naive import complete, results
from worlds import judging
from worlds.interpreter import Interpreter
from worlds.judging import Judge
from worlds.mixed import drawn, mixed
from worlds.scenes import scene
from worlds.walking import faults

SEEDS = range(20)


def test_a_seed_always_gives_the_same_world() -> None:
    assert all(scene(mixed(seed)) == scene(mixed(seed)) for seed in SEEDS)


def test_the_interpreter_agrees_with_the_naive_reading() -> None:
    for seed in SEEDS:
        problem = mixed(seed).problem
        if problem.domain.aggregates or any(
            e.each for one in problem.domain.behaviors.values() for e in one.every_effect
        ):
            continue
        meant, state = Interpreter(problem), complete(problem)
        for level in problem.domain.levels:
            for one in problem.domain.at_level(level):
                naive = {(one.name, arguments) for arguments, _ in results(problem, one, state)}
                own = {
                    (action.behavior.name, action.arguments)
                    for action in meant.actions(level)
                    if action.behavior is one and any(outcome(meant.initial) for outcome in action.outcomes)
                }
                assert naive == own, (seed, one.name)


@pytest.mark.parametrize("shares", [{}, {"negated": 1.0}, {"several": 1.0}])
def test_the_scene_of_a_random_world_has_its_goals_and_reachable_states(
    shares: dict[str, float], tmp_path: Path
) -> None:
    """The problem that is read from the file has the same applicable behaviours and reachable states as the drawn world."""
    for seed in SEEDS:
        world = mixed(seed, **shares)
        file = tmp_path / "w.ttl"
        file.write_text(scene(world), encoding="utf-8")
        known = load(file)
        assert not known.knowledge.faults
        problem = read(known.knowledge).problem
        assert problem.goal == world.problem.goal
        level = world.problem.domain.levels[-1]
        said, meant = Interpreter(problem).explored(level, 5_000), Interpreter(world.problem).explored(level, 5_000)
        assert (said.least, len(said.costs)) == (meant.least, len(meant.costs)), seed


def test_the_plain_interpreter_rejects_an_incomplete_plan_and_an_unknown_step() -> None:
    world = next(
        w
        for w in map(mixed, range(100, 200))
        if Interpreter(w.problem).explored(w.problem.domain.levels[-1], 5_000).least
    )
    assert faults(Interpreter(world.problem), Plan(())) == ["the goal isn't reached"]
    nonsense = Plan((Step((0,), 0, world.problem.domain.levels[0], "NOTHING", ()),))
    assert faults(Interpreter(world.problem), nonsense)


@pytest.fixture
def unlimited_judge(monkeypatch: pytest.MonkeyPatch) -> None:
    """Give each call a minute of wall-clock time; its CPU time stays limited."""
    monkeypatch.setattr(judging, "SECONDS", 60.0)


@pytest.mark.parametrize("first", [5_050, 5_100, 5_150, 5_200])
def test_small_worlds_with_all_constructs_give_no_wrong_answer(first: int, tmp_path: Path) -> None:
    """Every mode, the checker, exports and execution agree with an exhaustive search."""
    wrong = []
    for seed in range(first, first + 50):
        world, meant = drawn(seed)
        its = Judge(world, tmp_path, meant=meant).judged()
        wrong += [(seed, one.kind, one.mode, one.text) for one in its.complaints]
    assert not wrong


@pytest.mark.usefixtures("unlimited_judge")
def test_worlds_whose_situation_types_define_each_other_give_no_wrong_answer(tmp_path: Path) -> None:
    wrong, defined = [], 0
    for seed in range(8_300_000, 8_300_006):
        world, meant = drawn(seed, mutual=1.0)
        defined += any(len(group) > 1 for group in strata(world.problem.domain.rules))
        its = Judge(world, tmp_path, meant=meant).judged()
        wrong += [(seed, one.kind, one.mode, one.text) for one in its.complaints]
    assert not wrong
    assert defined > 1


@pytest.mark.usefixtures("unlimited_judge")
@pytest.mark.parametrize("shares", [{"wished": 1.0}, {"several": 1.0}])
def test_worlds_with_wishes_or_with_several_constraints_give_no_wrong_answer(
    shares: dict[str, float], tmp_path: Path
) -> None:
    wrong, planned = [], 0
    for seed in range(1_300_001_010, 1_300_001_016):
        world, meant = drawn(seed, **shares)
        its = Judge(world, tmp_path, meant=meant, only="soft" if world.wishes else "").judged()
        wrong += [(seed, one.kind, one.mode, one.text) for one in its.complaints]
        planned += "soft" in its.status if world.wishes else len(world.problem.domain.constraints) > 1
    assert not wrong
    assert planned > 1


@pytest.mark.usefixtures("unlimited_judge")
def test_a_wrong_penalty_and_a_wrong_bound_of_soft_goals_are_found(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def planned(*args: Any, **options: Any) -> Any:
        result = plan(*args, **options)
        penalty = None if result.outcome.penalty is None else result.outcome.penalty + 1
        return replace(result, outcome=replace(result.outcome, penalty=penalty, bound=1000.0))

    monkeypatch.setattr(judging, "plan", planned)
    found = set[str]()
    for seed in range(1_300_001_010, 1_300_001_013):
        world, meant = drawn(seed, wished=1.0)
        found |= {one.kind for one in Judge(world, tmp_path, meant=meant, only="soft").judged().complaints}
    assert found >= {"wrong penalty", "wrong bound"}


@pytest.mark.usefixtures("unlimited_judge")
@pytest.mark.parametrize("mode", ["optimal", "steps", "soft"])
def test_costs_that_depend_on_amounts_and_soft_goals_give_no_wrong_bound(mode: str, tmp_path: Path) -> None:
    solved = 0
    for seed in (496_300_108, 496_300_117):
        world, meant = drawn(seed, constrained=0.3, priced=1.0)
        its = Judge(world, tmp_path, only=mode, meant=meant).judged()
        assert not its.complaints, (seed, its.complaints)
        solved += its.status.get(mode) == "solved"
    assert solved


@pytest.mark.usefixtures("unlimited_judge")
@pytest.mark.parametrize("seed", [7_210_018, 7_210_329])
def test_several_effects_of_a_behaviour_on_one_amount_add_up(seed: int, tmp_path: Path) -> None:
    shares = {"constrained": 0.3, "mutual": 0.2, "priced": 0.2, "everyone": 0.2, "repeated": 1.0}
    world, meant = drawn(seed, **shares)
    assert not Judge(world, tmp_path, meant=meant).judged().complaints


SHARES = {"constrained": 0.3, "mutual": 0.2, "priced": 0.2, "everyone": 0.1, "repeated": 0.2}


@pytest.mark.parametrize(
    ("seed", "mode"),
    [
        pytest.param(901_002_424, "export", id="the bounds of an amount limit the sum of two effects on it"),
        pytest.param(906_000_532, "guarded", id="a goal on a class inside a conjunction is a goal of each individual"),
        pytest.param(901_003_374, "guarded", id="no step refines a step of its own level"),
    ],
)
def test_a_world_that_had_a_wrong_answer_has_none(seed: int, mode: str, tmp_path: Path) -> None:
    world, meant = drawn(seed, **SHARES)
    assert not Judge(world, tmp_path, only=mode, meant=meant).judged().complaints


@pytest.mark.usefixtures("unlimited_judge")
def test_the_part_that_recognition_selects_has_the_same_costs_and_names_as_the_whole_world(tmp_path: Path) -> None:
    for seed in range(8_400_000, 8_400_006):
        world, meant = drawn(seed, constrained=0.3)
        assert not Judge(world, tmp_path, only="recognition", meant=meant).judged().complaints, seed


@pytest.mark.usefixtures("unlimited_judge")
def test_totals_of_totals_have_the_same_bounds_in_the_part_and_in_the_whole_world(tmp_path: Path) -> None:
    owners = set[str]()
    for seed in (995_000_002, 995_000_009, 995_000_010):
        world, meant = drawn(seed, nested=1.0)
        totals = world.problem.domain.aggregates
        outer = [one for one in totals.values() if read_by(one) & totals.keys()]
        assert outer, seed
        owners.update(parameter.kind for one in outer for parameter in one.parameters)
        assert not Judge(world, tmp_path, only="recognition", meant=meant).judged().complaints, seed
    assert "A|B" in owners


def test_a_certificate_that_tells_a_sum_apart_is_refuted_only_by_states_with_the_same_sum(tmp_path: Path) -> None:
    world, meant = drawn(493_002_793, constrained=0.3)
    assert not Judge(world, tmp_path, only="proofs", meant=meant).judged().complaints


@pytest.mark.usefixtures("unlimited_judge")
@pytest.mark.parametrize("seed", [95_006_284, 95_012_744, 95_017_985])
def test_no_mode_refuses_a_division_by_an_amount_that_changes(seed: int, tmp_path: Path) -> None:
    """A task that can't be grounded because of a division is solved, proved unsolvable or given up by other methods."""
    its = Judge(mixed(seed, 0.0), tmp_path, every=True).judged()
    assert not its.complaints
    assert {its.status[mode] for mode in ("guarded", "optimal", "paper")} <= {"solved", "unsolvable"}


@pytest.mark.usefixtures("unlimited_judge")
@pytest.mark.parametrize("seed", [200_002_806])
def test_a_world_with_few_states_is_certified_by_its_states(seed: int, tmp_path: Path) -> None:
    its = Judge(mixed(seed, 0.0), tmp_path, every=True).judged()
    assert not its.complaints
    assert {its.status[mode] for mode in ("guarded", "optimal", "paper")} == {"unsolvable"}


def test_a_fact_with_a_default_value_is_found_although_the_scene_does_not_state_it(tmp_path: Path) -> None:
    """A fact of two objects with the default value isn't stated.

    So neither object leads to the other, and all members of the class are tried.
    """
    its = Judge(mixed(200_012_855, 0.0), tmp_path, every=True).judged()
    assert not its.complaints
    assert its.least == 1.0 and its.length == 1


def test_a_rule_about_an_object_that_is_its_own_value_is_learned(tmp_path: Path) -> None:
    """If an object is its own value, neither the object nor the value leads to the other, so the class is searched."""
    assert not Judge(mixed(201_042_338, 0.0), tmp_path, every=True).judged().complaints


@pytest.mark.parametrize("seed", [202_002_963, 202_003_161])
def test_no_strict_level_is_left_to_bring_initial_values_to_rest(seed: int, tmp_path: Path) -> None:
    assert not Judge(mixed(seed, 0.0), tmp_path, every=True).judged().complaints


@pytest.mark.usefixtures("unlimited_judge")
def test_a_count_follows_values_that_a_witness_loses(tmp_path: Path) -> None:
    """An effect on all members of a class removes values that a condition of the count requires; every mode accepts this world."""
    its = Judge(mixed(301_000_072, 0.0), tmp_path, every=True).judged()
    assert not its.complaints
    assert "refused" not in {its.status[mode] for mode in ("guarded", "optimal", "paper")}


@pytest.mark.parametrize("seed", [320_002_517, 320_002_585])
def test_a_count_with_too_many_conditions_is_refused_immediately(seed: int, tmp_path: Path) -> None:
    (tmp_path / "world.ttl").write_text(scene(mixed(seed)))
    world, begin = load(str(tmp_path / "world.ttl")), process_time()
    with pytest.raises(KnowledgeError, match="by too many effects at once; use fewer effects"):
        world.plan()
    assert process_time() - begin < 3.0


@pytest.mark.parametrize("seed", [340_028_395])
def test_a_step_need_not_keep_totals_that_its_level_does_not_see(seed: int, tmp_path: Path) -> None:
    assert not Judge(mixed(seed), tmp_path, every=True).judged().complaints


@pytest.mark.parametrize("seed", [340_001_535])
def test_goals_of_lower_levels_leave_bounded_amounts_as_the_step_did(seed: int, tmp_path: Path) -> None:
    assert not Judge(mixed(seed), tmp_path, every=True).judged().complaints


@pytest.mark.parametrize("seed", [340_005_745])
def test_equal_effects_on_a_total_are_exported_as_one_multiple(seed: int, tmp_path: Path) -> None:
    assert not Judge(mixed(seed), tmp_path, only="export").judged().complaints


@pytest.mark.parametrize("seed", [340_025_843])
def test_bounds_of_totals_are_exported_for_all_effects_of_an_action_together(seed: int, tmp_path: Path) -> None:
    assert not Judge(mixed(seed), tmp_path, only="export").judged().complaints


@pytest.mark.parametrize("seed", [340_002_931])
def test_a_total_counts_individuals_that_the_task_does_not_need(seed: int, tmp_path: Path) -> None:
    """A variable of a total without a condition ranges over all individuals of its class.

    So the part that is read contains them all.
    """
    assert not Judge(mixed(seed), tmp_path, every=True).judged().complaints


def test_a_step_without_refinement_is_no_error_if_the_plan_may_leave_its_level(tmp_path: Path) -> None:
    """The default mode leaves the level; modes that keep all levels give up and name the step."""
    its = Judge(mixed(340_007_688), tmp_path, every=True).judged()
    assert not its.complaints
    assert its.status["guarded"] == "solved"
    assert any("L1_1 of level 1 can never be refined" in one.text for one in its.remarks if one.mode == "strict levels")


@pytest.mark.parametrize("limit", [0.3, 1.0])
def test_a_search_that_ends_too_early_is_no_error_of_the_domain(limit: float, tmp_path: Path) -> None:
    """A behaviour is an error only if the task has no plan at all; a call that runs out of time gives up."""
    (tmp_path / "world.ttl").write_text(scene(mixed(360_014_986)))
    try:
        outcome = load(str(tmp_path / "world.ttl")).plan(leave_levels=False, time_limit=limit).outcome
    except LimitError:
        return
    assert outcome.status is Status.GAVE_UP


def test_failing_conditions_without_common_variables_are_tested_one_by_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A step has a hundred effects with eighteen conditions each; combinations of conditions would need 77,000 tests."""
    calls, satisfied = [0], BehaviorReader.satisfied

    def counted(*arguments: Any) -> Any:
        calls[0] += 1
        return satisfied(*arguments)

    monkeypatch.setattr(BehaviorReader, "satisfied", counted)
    (tmp_path / "world.ttl").write_text(scene(mixed(360_013_634)))
    assert load(str(tmp_path / "world.ttl")).plan().outcome.left
    assert calls[0] < 10_000


@pytest.mark.usefixtures("unlimited_judge")
def test_a_total_of_totals_is_kept_by_the_change_of_each(tmp_path: Path) -> None:
    """A sum of sums that many effects change at the same time is accepted: the changes are added up one by one."""
    its = Judge(mixed(371_000_305), tmp_path, every=True).judged()
    assert not its.complaints
    assert its.status["paper"] == "solved"


def test_absence_inside_a_condition_on_a_maximum_is_exported_with_its_meaning(tmp_path: Path) -> None:
    assert not Judge(mixed(371_027_808), tmp_path, only="export").judged().complaints


WIDER = {"overlapping": 1.0, "partial": 1.0, "ternary": 1.0, "extended": 1.0}


@pytest.mark.parametrize("seed", [1_400_001_136, 1_400_001_631])
def test_worlds_with_overlapping_classes_and_numbers_of_some_pairs_have_no_faults(seed: int, tmp_path: Path) -> None:
    assert not Judge(mixed(seed, **WIDER), tmp_path).judged().complaints


def test_the_wider_worlds_have_all_their_constructs() -> None:
    texts = [scene(mixed(seed, **WIDER)) for seed in range(1_400_001_000, 1_400_001_012)]
    for said in (
        "c:relation :way",
        "c:extends",
        "owl:unionOf",
        "c:holdsOf",
        "owl:complementOf",
        ", :C ",
        ":AB",
        "c:argument3",
    ):
        assert any(said in text for text in texts), said


@pytest.mark.parametrize("seed", [1_600_000_002, 1_600_000_016])
def test_worlds_with_local_variables_have_no_faults(seed: int, tmp_path: Path) -> None:
    assert not Judge(mixed(seed, local=1.0), tmp_path).judged().complaints


def test_local_variables_occur_in_all_parts_of_a_world() -> None:
    found = set[str]()
    for seed in (1_600_000_002, 1_600_000_004, 1_600_000_017):
        text = scene(mixed(seed, local=1.0, overlapping=1.0))
        own = re.findall(r"^:([A-Za-z])\S*\.v\d_\S* a owl:NamedIndividual, c:Variable ; c:termType :(\w+)", text, re.M)
        found |= {part for part, _ in own} | ({"query"} if "c:construct" in text else set())
        found |= {"defined" for _, kind in own if f":{kind} a owl:Class" in text and kind.startswith("K")}
    assert found >= {"L", "D", "S", "t", "query", "defined"}, (
        "behaviours, rules, totals, goals, queries, defined classes"
    )
