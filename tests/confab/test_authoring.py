"""Starting a domain, the report of what an edit changed, and renaming terms together with the memory."""

import os
from pathlib import Path

import pytest
from click.testing import CliRunner

import confab
from confab import ontology
from confab.authoring import difference, migrate, new_domain, unknown_terms
from confab.cli import app
from confab.reaching import with_current_reach
from confab.reasoner.graph.knowledge import KnowledgeError
from confab.reasoner.memory.links_file import memory_lines
from confab.reasoner.validation.validate import validate
from confab.scene import read

GUESTS = Path(__file__).parent / "cases" / "guests.ttl"


def test_a_new_domain_is_valid_and_has_a_plan(tmp_path: Path) -> None:
    files = new_domain("tearoom", tmp_path / "tearoom")
    assert sorted(file.name for file in files) == ["catalog-v001.xml", "tearoom-scene.ttl", "tearoom.ttl"]
    scene = tmp_path / "tearoom" / "tearoom-scene.ttl"
    assert validate([scene]) == []
    result = confab.load(scene).plan(mode="paper")
    assert [(step["behavior"], step["arguments"]) for step in result.json()["steps"]] == [
        ("B1_CARRY", ["plate1", "sink"]),
        ("B1_WASH", ["plate1"]),
        ("B1_CARRY", ["plate1", "table"]),
    ]


def test_a_new_domain_overwrites_nothing(tmp_path: Path) -> None:
    new_domain("tearoom", tmp_path)
    with pytest.raises(KnowledgeError, match="exists already"):
        new_domain("tearoom", tmp_path)
    with pytest.raises(KnowledgeError, match="can't be a domain's name"):
        new_domain("tea room", tmp_path)


def test_reach_facts_are_computed_if_they_are_missing_or_outdated(tmp_path: Path) -> None:
    new_domain("shop", tmp_path, bodies=True)
    scene, reach, said = tmp_path / "shop-scene.ttl", tmp_path / "shop-scene.reach.ttl", list[str]()
    assert with_current_reach(read(scene), said.append).plan().solved
    before = reach.read_text()
    with_current_reach(read(scene), said.append)
    assert said == ["computing the reach of the hands"]
    table = tmp_path / "shop-table.ttl"
    table.write_text(table.read_text().replace("e:x 0.4 ; e:y 0.2 ;", "e:x 0.4 ; e:y 0.48 ;"))
    os.utime(table, (reach.stat().st_mtime + 5,) * 2)
    with_current_reach(read(scene), said.append)
    assert reach.read_text() != before
    bodies = tmp_path / "shop-bodies.ttl"
    bodies.write_text(bodies.read_text().replace("e:graspHeight 0.045 ;", ""))
    os.utime(bodies, (reach.stat().st_mtime + 5,) * 2)
    assert with_current_reach(read(scene), said.append).plan(mode="paper").solved
    assert "has no e:graspHeight" in said[-1]


def test_the_difference_of_two_scenes_names_added_and_removed_parts(tmp_path: Path) -> None:
    old, new = tmp_path / "old", tmp_path / "new"
    for folder in (old, new):
        new_domain("tearoom", folder)
    scene = new / "tearoom-scene.ttl"
    text = scene.read_text()
    added = ':tray a owl:NamedIndividual, d:Place ; c:index 4 ; rdfs:label "tray"@en .\n'
    scene.write_text(text.replace("d:isAt :table ; d:cleanliness", "d:isAt :sink ; d:cleanliness") + added)
    changed = difference(confab.load(old / "tearoom-scene.ttl"), confab.load(scene), "paper")
    assert changed.gained["individual"] == ("tray",)
    assert changed.gained["quantified"] == ("B1_CARRY plate1 tray", "B1_CARRY plate2 tray")
    assert changed.lost["quantified"] == ()
    assert changed.before == ("B1_CARRY plate1 sink", "B1_WASH plate1  where: sink", "B1_CARRY plate1 table")
    assert changed.after == ("B1_WASH plate1  where: sink", "B1_CARRY plate1 table")
    assert "+ quantified B1_CARRY plate1 tray" in str(changed)
    same = difference(confab.load(scene), confab.load(scene), "paper")
    assert str(same) == "the plan is the same: 2 steps"


def test_the_difference_of_two_scenes_names_changed_facts_and_goals_and_the_reason_if_there_is_no_plan() -> None:
    scene = confab.load("two-cups").without_goal()
    one, other = (
        scene.with_goal("cup1 LOCATION location5"),
        scene.with_goal("cup1 LOCATION location7").with_fact("cup2 LOCATION location5"),
    )
    said = str(difference(one, other, "guarded"))
    for line in ("- goal cup1 LOCATION location5", "+ goal cup1 LOCATION location7", "+ fact cup2 LOCATION location5"):
        assert line in said
    both = other.with_goal("cup2 LOCATION location7")
    assert "\n+unsolvable: cup1 LOCATION location7 and cup2 LOCATION location7 exclude" in str(
        difference(one, both, "guarded")
    )
    assert str(difference(both, both, "guarded")).startswith("unsolvable: cup1 LOCATION location7 and")


def test_the_difference_of_two_scenes_names_changed_weights_deadlines_and_conditions_of_goals(tmp_path: Path) -> None:
    text = GUESTS.read_text(encoding="utf-8")
    goal = "c:ValueCondition ; c:weight 0.5 ; c:situationType :GREETED ; c:about :guest2"
    seconds = '"PT30S"^^<http://www.w3.org/2001/XMLSchema#dayTimeDuration>'
    greeted = "c:AnyOf ; c:alternative [ a c:ValueCondition ; c:situationType :GREETED ; c:about :{} ]"
    texts = {
        "soft": text,
        "heavier": text.replace(goal, goal.replace("0.5", "0.75")),
        "hard": text.replace(goal, goal.replace("c:weight 0.5 ; ", "")),
        "soon": text.replace(goal, goal.replace("c:weight 0.5", f"c:by {seconds}")),
        "any": text.replace(goal, greeted.format("guest1")),
        "other": text.replace(goal, greeted.format("guest2")),
    }
    scenes = {}
    for name, one in texts.items():
        (tmp_path / f"{name}.ttl").write_text(one, encoding="utf-8")
        scenes[name] = confab.load(tmp_path / f"{name}.ttl")
    for before, after, lost, gained in (
        ("soft", "heavier", "guest2 GREETED true (weight 0.5)", "guest2 GREETED true (weight 0.75)"),
        ("soft", "hard", "guest2 GREETED true (weight 0.5)", "guest2 GREETED true"),
        ("hard", "soon", "guest2 GREETED true", "guest2 GREETED true by 30 s"),
    ):
        changed = difference(scenes[before], scenes[after], "guarded")
        assert (changed.lost["goal"], changed.gained["goal"]) == ((lost,), (gained,))
    changed = difference(scenes["any"], scenes["other"], "guarded")
    assert "guest1" in changed.lost["goal"][0]
    assert "guest2" in changed.gained["goal"][0]


def test_a_comparison_of_scenes_names_the_options_that_it_does_not_take(tmp_path: Path) -> None:
    compare = ["plan", "living-room", "--diff", "living-room"]
    files = ["-o", str(tmp_path / "plan.json"), "--report", str(tmp_path / "plan.html")]
    others = ["--optimal", "--levels", "strict", "--minimise", "steps", "--level", "1", "--engine", "none"]
    done = CliRunner().invoke(app, [*compare, *files, *others])
    assert isinstance(done.exception, KnowledgeError)
    for option in (*files[::2], "--optimal", "--levels strict", "--minimise", "--level", "--engine"):
        assert f"{option} " in f"{done.exception} ", option
    assert not list(tmp_path.iterdir())
    for taken in (["--mode", "paper"], ["--json"], ["--time-limit", "60"], ["--no-memory"]):
        assert CliRunner().invoke(app, [*compare, *taken]).exit_code == 0, taken


def test_plans_that_differ_only_in_the_values_of_variables_are_different() -> None:
    scene = confab.load("beverage-serving")
    said = str(difference(scene, scene.with_fact("cup1 LOCATION location6"), "guarded"))
    assert "-B1_MOVE cup1 location7  from: location2" in said
    assert "+B1_MOVE cup1 location7  from: location6" in said


@pytest.fixture
def memory(tmp_path: Path) -> Path:
    """A memory that has learned one lesson in the tearoom."""
    new_domain("tearoom", tmp_path)
    scene = confab.load(tmp_path / "tearoom-scene.ttl")
    remembered = confab.Memory.of(scene)
    remembered.teach(scene, scene.plan())
    return remembered.save(tmp_path / "memory.ttl")


def test_a_memory_can_be_migrated_to_a_renamed_term(memory: Path) -> None:
    scene = confab.load(memory.with_name("tearoom-scene.ttl"))
    assert unknown_terms(memory_lines(memory), scene) == []
    memory.write_text(memory.read_text().replace("tearoom#CLEANLINESS", "tearoom#CLEANLINES"))
    assert unknown_terms(memory_lines(memory), scene) == ["CLEANLINES; did you mean 'CLEANLINESS'?"]
    assert migrate(memory, ["CLEANLINES=CLEANLINESS"]) > 3
    assert unknown_terms(memory_lines(memory), scene) == []


def test_a_rename_changes_the_words_of_learned_facts_and_whole_words_only(memory: Path) -> None:
    assert ':asks "CLEANLINESS of item"' in memory.read_text()
    migrate(memory, ["CLEANLINESS=CLEAN"])
    text = memory.read_text()
    assert ':asks "CLEAN of item"' in text
    assert "tearoom#CLEAN>" in text or ":CLEAN " in text
    assert ':asks "CLEANLINESS' not in text
    migrate(memory, ["CLEAN=CLEANER"])
    migrate(memory, ["CLEANER=CLEAN"])
    assert memory.read_text().count(':asks "CLEAN of item"') == text.count(':asks "CLEAN of item"')


@pytest.mark.parametrize(("rename", "said"), [("Cup=Mug", "isn't in the memory"), ("Cup", "wanted OLD=NEW")])
def test_an_invalid_rename_is_refused(memory: Path, rename: str, said: str) -> None:
    before = memory.read_bytes()
    with pytest.raises(KnowledgeError, match=said):
        migrate(memory, [rename])
    assert memory.read_bytes() == before


def test_the_commands_convert_a_file_and_show_a_behavior(tmp_path: Path) -> None:
    short = tmp_path / "towers.ttl"
    domain = str(ontology.ROOT / "domains" / "towers.ttl")
    done = CliRunner().invoke(app, ["convert", domain, "--behaviors", "sparql", "-o", str(short)])
    assert done.output == f"{short}: 6 behaviours written as updates\n"
    assert "c:update" in short.read_text()
    done = CliRunner().invoke(app, ["query", "towers-small", "--show", "L1_CARRY", "--update"])
    assert done.exit_code == 0, done.output
    assert "INSERT {" in done.output
