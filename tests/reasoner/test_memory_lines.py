"""The parts of a memory: their names, the edits that people may make, and the error for each broken part."""

import re
from collections.abc import Callable
from dataclasses import FrozenInstanceError
from pathlib import Path

import pyoxigraph as ox
import pytest

from confab.reasoner.condition_nodes import DEEPEST
from confab.reasoner.graph.knowledge import KnowledgeError
from confab.reasoner.memory.experience import (
    ITSELF,
    Experience,
    GoalKind,
    LearnedOrder,
    LearnedRule,
    Lesson,
    Method,
    OpenRole,
    Tally,
)
from confab.reasoner.memory.experience_file import MOST, lines, parse, probability, turtle
from confab.reasoner.memory.rules_file import RuleReader, label
from confab.reasoner.names import Names
from confab.reasoner.symbols import AnyOf, ClassCondition, Condition, RelationCondition, ValueCondition, Witness
from confab.reasoner.vocabulary import CORE
from worlds.memories import load, save

DOMAIN = "https://x.org/k"
NAMES = Names(f"{DOMAIN}#{name}" for name in ("MOVE", "AT", "near", "Cup", "cup1"))
GOAL = ValueCondition("AT", ("?cup", "?day"), "?place")
KINDS = (("?cup", "Cup"), ("?place", "Place"), ("?day", "Day"))


def rule(*asks: Condition) -> LearnedRule:
    return LearnedRule(GOAL, asks, ("MOVE", ("?cup", "?place")), KINDS)


def written(*said: LearnedRule | Method | LearnedOrder | GoalKind) -> str:
    experience = Experience("robot")
    experience.learn(Lesson(list(said), [(one, ITSELF, Tally(1)) for one in said]))
    return "".join(turtle(experience, NAMES, DOMAIN))


def read(text: str, names: Names | None = NAMES) -> Experience:
    return parse(lines(text), "m.ttl", names)


def the_rule(text: str) -> LearnedRule:
    (found,) = (one for one in read(text).said.values() if isinstance(one, LearnedRule))
    return found


def test_the_label_of_a_learned_part_describes_its_content() -> None:
    assert label(rule()) == "for cup AT day place: MOVE cup place"
    assert label(LearnedOrder("AT", "FULL", ())) == "AT before FULL"
    assert label(LearnedOrder("AT", "FULL", ((0, 0),))) == "AT before FULL of the same"
    assert label(Method("MOVE", 1, (("PICK", (0,)), ("PLACE", (0,))), ())) == "MOVE by PICK, PLACE"
    assert label(GoalKind("AT", ("Cup", "Day"))) == "AT of Cup, Day"


@pytest.mark.parametrize("arguments", [("?cup",), ("?cup", "?place"), ("?cup", "?day", "?place")])
def test_a_relation_is_written_with_its_last_argument_as_value(arguments: tuple[str, ...]) -> None:
    asked = RelationCondition("near", arguments)
    text = written(rule(asked))
    assert the_rule(text).asks == (asked,)
    graph = ox.Store()
    graph.load(text.encode(), ox.RdfFormat.TURTLE)
    node = next(graph.quads_for_pattern(None, None, ox.NamedNode(CORE + "RelationCondition"))).subject
    values = list(graph.quads_for_pattern(node, ox.NamedNode(CORE + "value"), None))
    assert len(values) == (len(arguments) > 1)


def deep(most: int, wrap: Callable[[Condition], Condition]) -> Condition:
    found: Condition = ClassCondition("?cup", "Cup")
    for _ in range(most):
        found = wrap(found)
    return found


@pytest.mark.parametrize("wrap", [lambda c: AnyOf(((c,),)), lambda c: Witness("?x", "Cup", (c,))])
def test_conditions_of_a_rule_may_be_nested_to_a_maximum_depth(wrap: Callable[[Condition], Condition]) -> None:
    condition = deep(DEEPEST, wrap)
    assert DEEPEST == 50
    assert the_rule(written(rule(condition))).asks == (condition,)
    with pytest.raises(KnowledgeError, match="the condition lies inside more than 50 others"):
        read(written(rule(deep(DEEPEST + 1, wrap))))


@pytest.mark.parametrize("wrap", [lambda c: AnyOf(((c,),)), lambda c: Witness("?x", "Cup", (c,))])
def test_a_condition_that_contains_itself_is_a_clear_error(wrap: Callable[[Condition], Condition]) -> None:
    text = written(rule(wrap(RelationCondition("near", ("?cup",)))))
    inner = re.search(r"(m:\S+) a owl:NamedIndividual, :RelationCondition", text)
    outer = re.search(r"(m:\S+) a owl:NamedIndividual, :(?:AnyOf|Witness)", text)
    assert inner and outer
    with pytest.raises(KnowledgeError, match=r"m\.ttl: broken memory: .*the condition contains itself"):
        read(re.sub(rf"(:condition|:alternative) {re.escape(inner[1])}", rf"\1 {outer[1]}", text))


def test_a_rule_whose_roles_were_renamed_is_the_same_rule() -> None:
    text = written(rule(RelationCondition("near", ("?cup", "?place"))))
    name = rule(RelationCondition("near", ("?cup", "?place"))).name
    roles = {role: f"{DOMAIN}#role.{i}" for i, role in enumerate(("cup", "place", "day"))}
    for role, iri in roles.items():
        text = re.sub(rf"m:{name}\.{role}(?=[ ,])", f"<{iri}>", text)
    found = the_rule(text)
    assert [kind for _, kind in found.kinds] == [kind for _, kind in KINDS]
    cup, place, day = (role for role, _ in found.kinds)
    assert len({cup, place, day}) == 3
    assert not any("." in role for role in (cup, place, day))
    assert found.goal == ValueCondition("AT", (cup, day), place)
    assert found.asks == (RelationCondition("near", (cup, place)),)
    assert found.does == ("MOVE", (cup, place))


def test_short_names_are_the_ends_of_iris_if_no_scene_defines_others() -> None:
    reader = RuleReader({}, None)
    assert reader.short("https://x.org/k#Cup") == "Cup"
    assert reader.short("https://x.org/Cup") == "Cup"
    assert RuleReader({}, NAMES).short(f"{DOMAIN}#MOVE") == "MOVE"
    plain = read(written(rule()), None)
    assert {one.does for one in plain.said.values() if isinstance(one, LearnedRule)} == {("MOVE", ("?cup", "?place"))}


def test_a_method_keeps_its_steps_and_its_open_roles() -> None:
    opened = (OpenRole("Hand", None, "HOLDS"), OpenRole("Place", ("AT", (1, 0)), None), OpenRole("Cup", None, None))
    method = Method("MOVE", 2, (("PICK", (2, 0)), ("SWAP", (0, 1, 2, 3)), ("WAIT", ())), opened)
    found = read(written(method)).said
    assert found == {method.name: method}
    alone = Method("MOVE", 0, (("WAIT", ()),), ())
    assert read(written(alone)).said == {alone.name: alone}


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (r":memoryFormat \d+", ":memoryFormat 0", "memory of format 0, wanted"),
        (r":memoryFormat \d+", ":memoryFormat 99", "memory of format 99, wanted"),
        (r":does ", ":did ", "wanted one c:does, found 0"),
        (r":does ", ":does :CIRCLE, ", "wanted one c:does, found 2"),
        (r":index 1", ':index "some"', "broken memory"),
        (r":ValueCondition", ":ClassCondition ; :ofClass :Cup", "its :forGoal is no :ValueCondition"),
        (r":RelationCondition", ":Condition", "a condition of no known kind"),
        (r":chosen 1 ", ":chosen 1.5 ", "broken memory"),
        (r":epoch 0", ":epoch -1", ":epoch -1; wanted a number from 0"),
        (r":episodes 1", f":episodes {MOST}", f":episodes {MOST}; wanted a number from 0 to {MOST}"),
        (r":epoch 0", ":epoch 2", ":epoch 2 of 'robot', which has 1 :episodes; wanted an epoch of at most 1"),
        (r":chosen 1 ", f":chosen {MOST} ", f"wanted numbers from 0 to {MOST}"),
        (r"m:counter_\S+ a owl:NamedIndividual, :Counter", "m:other a :Counter", "lacks a part"),
    ],
)
def test_a_missing_or_impossible_part_of_a_memory_is_named(old: str, new: str, said: str) -> None:
    text = written(rule(RelationCondition("near", ("?cup",))))
    assert re.search(old, text)
    with pytest.raises(KnowledgeError, match=re.escape(said)):
        read(re.sub(old, new, text, count=1))


@pytest.mark.parametrize("place", [-1, 3])
@pytest.mark.parametrize("role", [2, 0])
def test_a_method_names_no_role_that_it_lacks(role: int, place: int) -> None:
    text = written(Method("MOVE", 2, (("PICK", (2,)),), (OpenRole("Place", ("AT", (0,)), None),)))
    edited = re.sub(rf"(a owl:NamedIndividual(?:, :Parameter)? ; :index) {role} ", rf"\1 {place} ", text)
    with pytest.raises(KnowledgeError, match=f"names role {place} of 3"):
        read(edited)


def test_probabilities_add_half_a_success_and_half_a_failure_to_the_counts() -> None:
    assert probability(Tally()) == 0.5
    assert probability(Tally(chosen=1, passed_over=2, failed=1)) == 1.5 / 5
    assert ":probability 0.7500 ." in written(rule())


def test_a_memory_names_its_learner_its_trusted_sources_and_its_numbers_of_episodes(tmp_path: Path) -> None:
    experience = Experience("robot 1")
    for _ in range(3):
        experience.learn(Lesson([rule()], [(rule(), ("cup is", "full"), Tally(1))]))
    other = Experience("friend")
    other.learn(Lesson([], [(GoalKind("AT", ("Cup",)), ITSELF, Tally(passed_over=2))]))
    other.disabled.add(rule().name)  # what either memory disables is disabled
    experience.merge(other)
    experience.trusts.add("friend")
    save(tmp_path / "m.ttl", experience, NAMES, DOMAIN)
    found = load(tmp_path / "m.ttl", NAMES)
    assert found == experience
    assert (found.replica, found.trusts, found.disabled) == ("robot 1", experience.trusts, {rule().name})
    assert found.episodes == {"robot 1": 3, "friend": 1}
    alone = "".join(turtle(experience, NAMES, DOMAIN, only="friend"))
    assert read(alone).episodes == {"friend": 1}
    assert {who for who, _ in read(alone).counts} == {"friend"}
    assert ":trusts" not in alone
    assert {who for who, _ in read("".join(turtle(experience, NAMES, DOMAIN, only="robot 1"))).counts} == {"robot 1"}


def test_counts_are_read_up_to_the_limit_of_exact_floating_point_numbers() -> None:
    assert float(MOST - 1) != float(MOST) == float(MOST + 1)
    text = written(rule())
    assert read(re.sub(":chosen 1 ", f":chosen {MOST - 1} ", text)).totals()[rule().name][ITSELF] == Tally(MOST - 1)
    assert read(re.sub(":chosen 1 ", ":chosen 0 ", text)).totals()[rule().name][ITSELF] == Tally()
    for many in (MOST, MOST + 1):
        with pytest.raises(KnowledgeError, match="wanted"):
            read(re.sub(":episodes 1", f":episodes {many}", text))


@pytest.mark.parametrize("space", ["https://x.org/counters/", "https://x.org/counters#"])
def test_counters_may_have_any_names(space: str) -> None:
    text = again = written(rule(), LearnedOrder("AT", "FULL", ()))
    for number, counter in enumerate(re.findall(r"(m:counter_\S+) a owl:NamedIndividual", text)):
        again = again.replace(counter + " ", f"<{space}{number}> ")
    assert again != text
    assert read(again) == read(text)


def test_the_parsed_content_of_a_memory_file_is_immutable() -> None:
    with pytest.raises(FrozenInstanceError):
        lines(written(rule())).rest = ""  # type: ignore[misc]


def test_a_fact_is_written_once_and_read_from_any_layout() -> None:
    fact = ("cup is", 'odd "one"')
    experience = Experience("robot")
    for one in (rule(), LearnedOrder("AT", "FULL", ())):
        experience.learn(Lesson([one], [(one, fact, Tally(1, 2, 3)), (one, ("n", "1"), Tally(failed=1))]))
    text = "".join(turtle(experience, NAMES, DOMAIN))
    assert text.count(":LiftedFact") == 2
    assert read(text) == experience
    other = ox.serialize([q.triple for q in ox.parse(text, ox.RdfFormat.TURTLE)], format=ox.RdfFormat.N_TRIPLES)
    assert other is not None
    assert read(other.decode()) == experience


def test_two_copies_of_a_memory_in_one_file_give_the_larger_counts() -> None:
    early = Experience("robot")
    early.learn(Lesson([rule()], [(rule(), ITSELF, Tally(2, 1))]))
    before = "".join(turtle(early, NAMES, DOMAIN))
    early.learn(Lesson([rule()], [(rule(), ITSELF, Tally(0, 3))]))
    after = "".join(turtle(early, NAMES, DOMAIN))
    assert read(before + after) == read(after + before) == early


def test_the_lines_of_the_papers_links_are_kept_apart_for_their_own_reader() -> None:
    link = "_:link1 <https://x.org/a> <https://x.org/b> .\n"
    found = lines(written(rule()) + link)
    assert found.paper == link
    assert link not in found.rest
    assert found.links == [(found.links[0][0], rule().name, Tally(1))]


def test_a_missing_or_binary_memory_file_is_a_clear_error(tmp_path: Path) -> None:
    with pytest.raises(KnowledgeError, match=r"m\.ttl: no such memory file; 'confab learn' makes one"):
        load(tmp_path / "m.ttl")
    (tmp_path / "m.ttl").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(KnowledgeError, match="broken memory"):
        load(tmp_path / "m.ttl")


def test_a_deleted_rule_removes_only_its_own_counts() -> None:
    kept = rule(ClassCondition("?cup", "Cup"))
    text = written(rule(), kept)
    text = "".join(line for line in text.splitlines(True) if not line.startswith(f"m:{rule().name}"))
    found = read(text)
    assert set(found.said) == {kept.name}
    assert found.totals().keys() == {kept.name}


def test_the_rest_of_a_memory_is_read_after_an_editor_deleted_a_rule_and_all_triples_about_it() -> None:
    kept = GoalKind("AT", ("Cup", "Day"))
    named = f"#{rule().name}>"
    triples = [str(triple) for triple in lines(written(rule(), kept)).triples]
    left = [f"{triple} .\n" for triple in triples if named not in triple]
    assert any("countsFor" in triple for triple in set(triples) - {line[:-3] for line in left})
    found = read("".join(left))
    assert set(found.said) == {kept.name}
    assert [set(counts) for counts in found.counts.values()] == [{kept.name}]
