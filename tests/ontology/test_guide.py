"""The two pages of the authoring guide, followed literally in an empty folder."""

import re
import shlex
import subprocess
from pathlib import Path

import pytest

import confab
from confab import ontology
from confab.authoring import new_domain
from confab.cli import main
from confab.reaching import with_current_reach
from confab.reasoner.graph.knowledge import load, text
from confab.reasoner.names import local_name
from confab.reasoner.validation.validate import validate
from confab.sim.perception import BUILT_IN as PERCEIVERS
from confab.sim.skills import BUILT_IN as SKILLS

DOCS = Path(__file__).resolve().parents[2] / "docs"
AUTHORING, BODIES = (DOCS / f"{page}.md" for page in ("authoring", "bodies"))
BLOCK = re.compile(r'^```(turtle title=|console$)(?:"(add to )?([^"\n]+\.ttl)")?\n(.*?)^```$', re.MULTILINE | re.DOTALL)


@pytest.mark.slow
def test_the_authoring_guide_works_if_it_is_followed_literally(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    said = []
    monkeypatch.chdir(tmp_path)
    for _, added, name, content in BLOCK.findall(AUTHORING.read_text("utf-8") + BODIES.read_text("utf-8")):
        if name:
            file = tmp_path / name
            file.parent.mkdir(exist_ok=True)
            file.write_text((file.read_text() if added else "") + content)
            continue
        for line in content.splitlines():
            command, *arguments = shlex.split(line.removeprefix("$ "))
            assert command == "confab"
            with pytest.raises(SystemExit) as end:
                main(arguments)
            printed = capsys.readouterr()
            said.append(f"$ confab {' '.join(arguments)}\n{printed.out}")
            assert not end.value.code, said[-1] + printed.err
    story = "\n".join(said)
    assert story.count("nothing is wrong") == 5
    assert story.count("verified: ") == 2
    assert "B3_TIP left_hand" in story
    assert all((tmp_path / "plants" / f"{name}.png").stat().st_size > 5000 for name in ("table", "classes", "behavior"))
    assert "T1_TIDY toy1 location6" in story
    assert "T1_TAKE_OUT toy2 location2" in story
    assert "the plan is the same" in story


def test_the_behavior_that_the_guide_writes_as_individuals_is_its_update(tmp_path: Path) -> None:
    text = AUTHORING.read_text(encoding="utf-8")
    files = {name: "" for _, _, name, _ in BLOCK.findall(text) if name}
    for _, _, name, content in BLOCK.findall(text):
        if name:
            files[name] += content
    (individuals,) = re.findall(
        r'^```turtle title="T1_TIDY as individuals"\n(.*?)^```$', text, re.MULTILINE | re.DOTALL
    )
    domain = files["toys/toys.ttl"]
    (update,) = re.findall(r"^:T1_TIDY a .*?^    \}\"\"\" \.\n", domain, re.MULTILINE | re.DOTALL)
    plans = []
    for folder, written in (("update", domain), ("individuals", domain.replace(update, individuals))):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "toys.ttl").write_text(written, encoding="utf-8")
        scene = tmp_path / folder / "toys-scene.ttl"
        scene.write_text(files["toys/toys-scene.ttl"], encoding="utf-8")
        plans.append(with_current_reach(confab.load(scene), print).plan(mode="paper").json()["steps"])
    assert individuals not in domain and plans[0] == plans[1] != []


def test_the_guide_has_a_domain_of_two_levels_in_one_file(tmp_path: Path) -> None:
    files = {name: content for _, _, name, content in BLOCK.findall(AUTHORING.read_text("utf-8"))}
    (tmp_path / "post.ttl").write_text(files["post/post.ttl"])
    assert {one.severity for one in validate([tmp_path / "post.ttl"])} == {"warning", "remark"}
    scene = confab.load(tmp_path / "post.ttl")
    assert scene.plan().plan.length == {1: 2, 2: 6}
    assert scene.plan(leave_levels=False).plan.length == {1: 2, 2: 7}


def test_the_guide_s_renaming_leaves_a_domain_without_faults(tmp_path: Path) -> None:
    files = new_domain("plants", tmp_path / "plants", bodies=True)
    (script,) = re.findall(r"^```sh\n(.*?)^```$", BODIES.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)
    subprocess.run(["sh", "-c", script], cwd=tmp_path, check=True)
    (scene,) = (file for file in files if file.stem.endswith("-scene"))
    assert [str(finding) for finding in validate([scene])] == []
    said = [re.sub(r'"[^"]*"|(?m:(^|\s)#+ .*)', "", file.read_text(encoding="utf-8")) for file in files[:4]]
    terms = set(re.findall(r"(?:^|\s)\w?:(\w+)", "\n".join(said)))
    assert {"Ladle", "B1_FILL", "B3_LADLE", "SOUP", "tomato_soup", "canReach"} <= terms
    assert [term for term in sorted(terms) if re.search(r"water|dry$|pot|^can(?!Reach)", term, re.IGNORECASE)] == []


def test_the_guide_names_every_skill_and_perceiver_with_its_requirements() -> None:
    graph = load(ontology.ROOT / "embodiment.ttl")
    prefix = "PREFIX e: <https://w3id.org/confab/embodiment#> "
    rows = graph.select(prefix + "SELECT ?who ?what WHERE { ?who e:asksFor ?what } ORDER BY ?who ?what")
    asked: dict[str, set[str]] = {}
    for row in rows:
        asked.setdefault(local_name(text(row[0])), set()).add(local_name(text(row[1])))
    table = {}
    for line in BODIES.read_text(encoding="utf-8").splitlines():
        if cells := re.match(r"\| `e:(\w+)` \| (.*?) \| (.*?) \|", line):
            said = cells[3] if cells[1].startswith("perceive") else cells[2]
            table[cells[1]] = {word.removeprefix("e:") for word in re.findall(r"[\w:]+", said)}
    assert {name: table.get(name) for name in asked} == asked
    rows = graph.select(prefix + "SELECT DISTINCT ?who { ?who a :Skill ; e:phase ?phase }")
    nothing = {"perceive_covered", "perceive_joint", "perceive_measured", "perceive_servings", "perceive_stand"}
    assert {local_name(text(row[0])) for row in rows} | set(SKILLS) | set(PERCEIVERS) == set(asked) | nothing
    assert nothing <= set(table)
