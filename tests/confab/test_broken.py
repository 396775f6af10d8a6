"""Hostile and broken input: the answer is a result or one line, never a traceback, and valid files are unharmed."""

import json
import os
import re
import signal
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from time import sleep
from typing import Any, NoReturn, cast

import pytest

import confab
from confab.authoring import migrate, new_domain
from confab.cli import main
from confab.memory import Memory
from confab.ontology import ROOT
from confab.ontology import scenes as shipped_scenes
from confab.reasoner.files import alone, write_whole
from confab.reasoner.generate import write_scene
from confab.reasoner.graph.knowledge import KnowledgeError, KnowledgeGraph
from confab.reasoner.limits import Deadline, LimitError, current
from confab.reasoner.memory.experience import Experience, GoalKind, Lesson, Tally
from confab.terminal import BUG, GAVE_UP, INTERRUPTED, MISUSE, YES, Ending, ended_by, run_to_end

Answer = tuple[int, str, str]
Ask = Callable[..., Answer]


@pytest.fixture
def ask(capsys: pytest.CaptureFixture[str]) -> Ask:
    """Call the command line in this process; return the exit code, stdout and stderr."""

    def answer(*arguments: str | Path) -> Answer:
        capsys.readouterr()
        with pytest.raises(SystemExit) as end:
            main([str(argument) for argument in arguments])
        said = capsys.readouterr()
        assert "Traceback" not in said.out + said.err
        return int(end.value.code or 0), said.out, said.err

    return answer


@pytest.fixture
def tearoom(tmp_path: Path) -> Path:
    new_domain("tearoom", tmp_path)
    return tmp_path / "tearoom-scene.ttl"


def change(file: Path, old: str, new: str) -> None:
    text = file.read_text()
    assert old in text
    file.write_text(text.replace(old, new, 1))


# ---------------------------------------------------------------------------------------------- a memory is never lost


ODD_NAMES = [
    "robot 1",
    "a;b",
    'say "hi"',
    "back\\slash",
    "line\rbreak\n",
    "tab\t",
    "m:x . # y",
    "µ²…\u2028",
    "",
    "a" * 300,
]


def lived(replica: str, word: str = "yes") -> Experience:
    experience = Experience(replica)
    experience.learn(Lesson(counted=[(GoalKind("B1_WASH", ("Plate",)), ("item is", word), Tally(1))]))
    return experience


@pytest.mark.parametrize("name", ODD_NAMES)
def test_any_name_and_text_in_a_memory_survives_saving_and_loading(tmp_path: Path, tearoom: Path, name: str) -> None:
    scene = confab.load(tearoom)
    memory = Memory.of(scene)
    memory.experience = lived(name, name.replace("\n", "") or "-")
    memory.experience.trusts = memory.trusted = {name + " too"}
    memory.experience.episodes[name + " too"] = 1
    memory.save(tmp_path / "m.ttl")
    again = Memory.load(tmp_path / "m.ttl", scene)
    assert again.experience == memory.experience
    assert again.trusted == memory.trusted
    again.merge(Memory.load(tmp_path / "m.ttl"))
    again.save(tmp_path / "m.ttl")
    assert Memory.load(tmp_path / "m.ttl", scene).experience == memory.experience


def test_a_memory_that_can_not_be_read_back_replaces_no_file(
    tmp_path: Path, tearoom: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    memory, file = Memory.of(confab.load(tearoom)), tmp_path / "m.ttl"
    memory.experience = lived("me")
    memory.save(file)
    good = file.read_bytes()
    for broken in (
        ["@prefix : <x"],
        [good.decode().replace(":chosen 1", ":chosen 2")],
        [good.decode().replace('"me"', '"you"')],
    ):
        monkeypatch.setattr("confab.memory.turtle", lambda *_, lines=broken, **__: iter(lines))
        with pytest.raises(KnowledgeError):
            memory.save(file)
        assert file.read_bytes() == good
    assert [path.name for path in tmp_path.iterdir() if path.name.startswith(".")] == []


@pytest.mark.parametrize(
    ("old", "new"),
    [
        (":episodes 1", ":episodes -1"),
        (":epoch 0", ":epoch -1"),
        (":chosen 1", ":chosen -1"),
        (":episodes 1", ":episodes 1e9"),
    ],
)
def test_impossible_counts_in_a_memory_are_refused(tmp_path: Path, tearoom: Path, old: str, new: str) -> None:
    memory = Memory.of(confab.load(tearoom))
    memory.experience = lived("me")
    memory.save(tmp_path / "m.ttl")
    change(tmp_path / "m.ttl", old, new)
    with pytest.raises(KnowledgeError, match=r"m\.ttl: broken memory"):
        Memory.load(tmp_path / "m.ttl")


def test_a_link_is_followed_and_permissions_stay(tmp_path: Path) -> None:
    real, link = tmp_path / "a" / "real.csv", tmp_path / "link.csv"
    real.parent.mkdir()
    real.write_text("thing\nold\n")
    real.chmod(0o600)
    link.symlink_to(real)
    write_whole(link, "thing\nnew\n")
    assert link.is_symlink()
    assert real.read_text() == "thing\nnew\n"
    assert real.stat().st_mode & 0o777 == 0o600
    new = tmp_path / "new.ttl"
    old_mask = os.umask(0o077)
    try:
        write_whole(new, "new")
    finally:
        os.umask(old_mask)
    assert new.stat().st_mode & 0o777 == 0o600


def test_a_read_only_or_special_file_is_kept_and_the_message_names_it(tmp_path: Path) -> None:
    kept = tmp_path / "kept.ttl"
    kept.write_text("old")
    kept.chmod(0o444)
    with pytest.raises(OSError, match="read-only") as error:
        write_whole(kept, "new")
    assert error.value.filename == str(kept)
    os.mkfifo(tmp_path / "pipe")
    for other in (tmp_path, tmp_path / "pipe", Path(os.devnull)):
        with pytest.raises(OSError, match="wanted the name of a file"):
            write_whole(other, "new")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["kept.ttl", "pipe"]
    assert kept.read_text() == "old"


def test_the_message_on_a_full_disk_names_the_file_and_no_partial_file_remains(tmp_path: Path) -> None:
    program = (
        "import resource, sys; from pathlib import Path; from confab.reasoner.files import write_whole\n"
        "import signal; signal.signal(signal.SIGXFSZ, signal.SIG_IGN); resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))\n"
        "try: write_whole(Path(sys.argv[1]), 'x' * 5000)\nexcept OSError as error: print(error.filename, error.strerror)"
    )
    (tmp_path / "m.ttl").write_text("old")
    done = subprocess.run(
        [sys.executable, "-c", program, str(tmp_path / "m.ttl")],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
    )
    assert done.stdout.startswith(f"{tmp_path / 'm.ttl'} "), done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["m.ttl"]
    assert (tmp_path / "m.ttl").read_text() == "old"


@pytest.mark.parametrize(
    ("prepare", "said"),
    [("head -c 2m /dev/zero > fill", "No space left"), ("mount -o remount,ro .", "Read-only file system")],
)
def test_on_a_full_or_read_only_disk_the_file_is_named_and_the_old_file_is_kept(
    tmp_path: Path, prepare: str, said: str
) -> None:
    memory = Memory.of(confab.load("living-room"))
    memory.experience = lived("me")
    memory.save(tmp_path / "m.ttl")
    code = """
import sys
from pathlib import Path
from confab.cli import main
before = Path("m.ttl").read_bytes()
for call in sys.argv[1:]:
    try:
        main(call.split())
    except SystemExit as end:
        print(end.code)
print(Path("m.ttl").read_bytes() == before, sorted(path.name for path in Path().rglob("*") if path.is_file()))
"""
    calls = [f"memory {what}" for what in ("merge m.ttl m.ttl -o m.ttl", "trust m.ttl all", "migrate m.ttl Plate=Dish")]
    calls += ["-q execute living-room --memory m.ttl --learn", "-q execute living-room --save e.ttl"]
    calls += ["generate served --objects 40 -o s.ttl", "export living-room -o pddl"]
    disk = (
        f"mkdir disk; mount -t tmpfs -o size=1m tmpfs disk && cp m.ttl disk && cd disk && {{ {prepare}; "
        + 'exec "$@"; }'
    )
    done = subprocess.run(
        ["unshare", "-rm", "bash", "-c", disk, "-", sys.executable, "-c", code, *calls],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
    )
    *codes, last = done.stdout.splitlines()
    assert (codes, last.replace(", 'fill'", "").replace("'fill', ", "")) == (["2"] * 7, "True ['m.ttl']"), done.stderr
    told = re.findall(rf"^confab: (\S+): (?:can't be written: )?(?:{said}|is read-only)", done.stderr, re.MULTILINE)
    assert told[:-1] == ["m.ttl"] * 4 + ["e.ttl", "s.ttl"], done.stderr
    assert told[-1] in ("pddl", "pddl/domain.pddl"), done.stderr


def test_a_rename_waits_for_another_writer_and_reports_it(
    tmp_path: Path, tearoom: Path, caplog: pytest.LogCaptureFixture
) -> None:
    memory, file, link = Memory.of(confab.load(tearoom)), tmp_path / "m.ttl", tmp_path / "link" / "m.ttl"
    memory.experience = lived("me")
    memory.save(file)
    link.parent.mkdir()
    link.symlink_to(file)
    renaming = threading.Thread(target=migrate, args=(link, ["B1_WASH=B1_CLEAN"]))
    with alone(file):
        renaming.start()
        renaming.join(0.2)
        assert renaming.is_alive()
        memory.experience.merge(lived("other"))
        memory.save(file)
    renaming.join()
    found = Memory.load(file)
    assert found.experience.episodes == {"me": 1, "other": 1}
    assert {one.situation for one in found.experience.said.values() if isinstance(one, GoalKind)} == {"B1_CLEAN"}
    assert "waiting for another process" in caplog.text


@pytest.mark.parametrize("rename", ["B1_WASH=a b", "B1_WASH=", "=", "B1_WASH=http://[x", "x=y"])
def test_a_rename_to_an_invalid_name_changes_nothing(tmp_path: Path, tearoom: Path, ask: Ask, rename: str) -> None:
    memory, file = Memory.of(confab.load(tearoom)), tmp_path / "m.ttl"
    memory.experience = lived("me")
    memory.save(file)
    before = file.read_bytes()
    code, _, said = ask("memory", "migrate", file, rename)
    assert (code, said.count("\n")) == (MISUSE, 1)
    assert file.read_bytes() == before


# --------------------------------------------------------------------------------------------------------------- XML


BOMB = "".join(f'<!ENTITY {b} "{f"&{a};" * 10}">' for a, b in zip("abcdefgh", "bcdefghi", strict=True))
HEAD = '<rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#" xmlns:owl="http://www.w3.org/2002/07/owl#" xmlns:rdfs="http://www.w3.org/2000/01/rdf-schema#">'
BODY = '<owl:Ontology rdf:about="https://x.org/s"><rdfs:label>&i;</rdfs:label></owl:Ontology></rdf:RDF>'


@pytest.mark.parametrize(
    ("prolog", "body", "said"),
    [
        (
            f'<!-- <rdf:RDF --><!DOCTYPE x [<!ENTITY a "aaaaaaaaaa">{BOMB}]>',
            BODY,
            "entity 'b' reads another file or grows",
        ),
        (f'<?pi <rdf:RDF ?><!DOCTYPE x [<!ENTITY a "aaaaaaaaaa">{BOMB}]>', BODY, "entity 'b'"),
        ('<!DOCTYPE x SYSTEM "file:///etc/hostname">', BODY, "reads 'file:///etc/hostname'"),
        ('<!DOCTYPE x [<!ENTITY i SYSTEM "file:///etc/hostname">]>', BODY, "entity 'i'"),
        ('<!DOCTYPE x [<!ENTITY % i "x"> %i;]>', BODY, "entity 'i'"),
        (
            f'<!DOCTYPE x [<!ENTITY i "{"x" * 60_000}">]>',
            BODY.replace("&i;", "&i;" * 1_000),
            "grow to 60,000,000 bytes",
        ),
        ("", BODY.replace("&i;", '<!DOCTYPE x [<!ENTITY i "x">]>'), "stands inside the document"),
        ("<", BODY, "no XML"),
    ],
)
@pytest.mark.parametrize("command", ["plan", "validate"])
def test_xml_that_reads_files_or_grows_is_refused(
    tmp_path: Path, ask: Ask, command: str, prolog: str, body: str, said: str
) -> None:
    (tmp_path / "s.owl").write_text(f'<?xml version="1.0"?>{prolog}{HEAD}{body}')
    code, out, err = ask(command, tmp_path / "s.owl")
    assert code in (1, MISUSE)
    assert said in out + err


def test_plain_xml_entities_are_still_expanded(tmp_path: Path) -> None:
    text = BODY.replace("https://x.org/", "&i;")
    (tmp_path / "s.owl").write_text(f'<!DOCTYPE rdf:RDF [<!ENTITY i "https://x.org/" >]>{HEAD}{text}')
    assert confab.load(tmp_path / "s.owl").iri == "https://x.org/s"


# ------------------------------------------------------------------------------------------------- the structure of a scene


@pytest.mark.parametrize(
    ("file", "old", "new", "said"),
    [
        ("-scene", "d:isAt :table", 'd:isAt "table"', "isAt has the text 'table' as its value"),
        ("-scene", "d:isAt :table", "d:isAt [ a d:Place ]", "a node without a name"),
        ("-scene", "c:value :table", 'c:value "table"', "value has the text 'table' as its value"),
        ("-scene", "c:index 1", 'c:index "one"', "c:index is 'one'; wanted a whole number"),
        ("-scene", "c:situationType d:PLACE ; ", "", "wanted one c:situationType, found 0"),
        ("-scene", "d:isAt :table", "d:isAt :tabel", "tabel isn't declared as an individual; declare it"),
        ("-scene", "d:isAt :table", "d:isAt <<( :a :b :c )>>", "contains triple terms"),
        ("", "c:level 1", "c:level 1.5", "c:level is '1.5'; wanted a whole number from 1"),
        ("", "c:level 1", "c:level 0", "c:level is '0'"),
        ("", "c:level 1", "c:level -1", "c:level is '-1'"),
        ("", "c:level 1", f"c:level {'9' * 5000}", "c:level is '9999"),
        ("", "c:index 1", 'c:index "one"', "c:index is 'one'"),
        ("", "c:level 1", 'c:level 1 ; c:cost "x"', "c:cost is 'x'; wanted a number from 0"),
        ("", "c:level 1", "c:level 1 ; c:cost -1", "c:cost is '-1'"),
        ("", "c:level 1", 'c:level 1 ; c:cost "NaN"^^<http://www.w3.org/2001/XMLSchema#double>', "c:cost is 'NaN'"),
        ("", "c:level 1", 'c:level 1 ; c:cost "INF"^^<http://www.w3.org/2001/XMLSchema#double>', "c:cost is 'INF'"),
        (
            "",
            "c:parameter :B1_CARRY.item,",
            "c:parameter :B1_CARRY.thing,",
            "B1_CARRY.thing> is used as a parameter but",
        ),
        ("", "c:parameter :B1_CARRY.item,", "c:parameter :PLACE,", "PLACE> is used as a parameter but"),
        (
            "",
            ":PLACE a ",
            ":PLACE c:fromLevel 3 . :PLACE a ",
            "B1_CARRY on level 1 uses PLACE, but this situation type exists only from level 3",
        ),
        (
            "",
            "c:precondition :B1_CARRY.free",
            "c:precondition :B1_CARRY.fre",
            "B1_CARRY.fre> is used as a condition but",
        ),
        ("", "c:postcondition :B1_CARRY.carried", "c:postcondition :B1_CARRY.carry", "carry> is used as an effect but"),
        ("", ":PLACE ; c:value :B1_CARRY.place", ":PLAZE ; c:value :B1_CARRY.place", "PLAZE> isn't a situation type"),
        ("", "c:about :B1_CARRY.item ; ", "", "B1_CARRY uses PLACE with 0 arguments, but it has 1"),
        ("", "c:value :dirty", "c:value :dirt", "tearoom#dirt> is named in a behaviour, but isn't declared"),
        ("", "c:AbsenceCondition ;", 'c:AbsenceCondition ; c:negated "perhaps" ;', "c:negated is 'perhaps'"),
        ("", ":B1_CARRY.free ;", ":N . :N a c:AnyOf ; c:alternative :N . :B1_CARRY", "the condition contains itself"),
    ],
)
def test_an_invalid_scene_is_refused_in_one_line_by_plan_and_by_validate(
    tearoom: Path, ask: Ask, file: str, old: str, new: str, said: str
) -> None:
    change(tearoom.with_name(f"tearoom{file}.ttl"), old, new)
    code, out, err = ask("plan", tearoom)
    assert (code, out, err.count("\n")) == (MISUSE, "", 1)
    assert said in err
    assert ask("validate", tearoom)[0] == 1


def test_the_message_on_an_individual_without_a_name_is_the_same_in_every_call(tearoom: Path, ask: Ask) -> None:
    change(tearoom.with_name("tearoom-scene.ttl"), ":plate1 a ", "[] a d:Plate ; d:isAt :shelf . :plate1 a ")
    said = {ask("plan", tearoom)[2] for _ in range(2)}
    assert len(said) == 1
    assert "a node without a name has a value of isAt; name the individual" in said.pop()


@pytest.mark.parametrize("index", ['"one"', "1.5", "1" + "0" * 5000])
def test_an_index_that_is_no_whole_number_is_refused_where_a_robot_has_a_body(
    tmp_path: Path, ask: Ask, index: str
) -> None:
    scene = tmp_path / "beverage-serving.ttl"
    scene.write_text(shipped_scenes()["beverage-serving"].read_text())
    change(scene, "c:index 1 ;", f"c:index {index} ;")
    code, out, err = ask("plan", scene, "-q")
    assert (code, out) == (MISUSE, "")
    assert "wanted a whole number" in err


def test_a_goal_about_too_few_individuals_is_refused(tmp_path: Path, ask: Ask) -> None:
    scene = tmp_path / "packing-small.ttl"
    scene.write_text(shipped_scenes()["packing-small"].read_text())
    change(scene, "c:ValueCondition ; c:about :ring ;", "c:ValueCondition ;")
    code, out, err = ask("plan", scene, "--optimal")
    assert (code, out, err.count("\n")) == (MISUSE, "", 1)
    assert "<casket, INSIDE>: a goal about 1 individuals; INSIDE is about 2" in err


@pytest.mark.parametrize("command", ["plan", "execute", "explain", "export -o out"])
def test_a_scene_without_behaviours_is_refused(
    tearoom: Path, ask: Ask, monkeypatch: pytest.MonkeyPatch, command: str
) -> None:
    monkeypatch.chdir(tearoom.parent)
    domain = tearoom.with_name("tearoom.ttl")
    domain.write_text(domain.read_text().replace("c:Behavior", "c:Action"))
    name, *options = command.split()
    code, out, err = ask(name, tearoom, *options)
    assert (code, out, err.count("\n")) == (MISUSE, "", 1)
    assert "has no behaviours" in err
    assert not Path("out").exists()


def test_an_amount_that_is_not_declared_as_a_situation_type_is_refused(tmp_path: Path, ask: Ask) -> None:
    scene = tmp_path / "canteen-small.ttl"
    scene.write_text(shipped_scenes()["canteen-small"].read_text())
    (tmp_path / "canteen.ttl").write_text((ROOT / "domains/canteen.ttl").read_text())
    (tmp_path / "catalog-v001.xml").write_text(
        '<catalog xmlns="urn:oasis:names:tc:entity:xmlns:xml:catalog">'
        '<uri name="https://w3id.org/confab/canteen" uri="canteen.ttl"/></catalog>'
    )
    change(
        tmp_path / "canteen.ttl", ":BATTERY a owl:NamedIndividual, c:SituationType,", ":BATTERY a owl:NamedIndividual,"
    )
    code, out, err = ask("plan", scene)
    assert (code, out, err.count("\n")) == (MISUSE, "", 1)
    assert "canteen#BATTERY> isn't a situation type; declare it as one" in err


def test_a_situation_type_that_follows_from_axioms_needs_a_class_that_has_it(tmp_path: Path, ask: Ask) -> None:
    for name, file in (("gallery", "domains/gallery.ttl"), ("scene", "scenes/gallery-small.ttl")):
        (tmp_path / f"{name}.ttl").write_text((ROOT / file).read_text())
    change(tmp_path / "gallery.ttl", "c:hasSituationType :JOINED, :WAY", "c:hasSituationType :JOINED")
    (tmp_path / "catalog-v001.xml").write_text(
        '<catalog xmlns="urn:oasis:names:tc:entity:xmlns:xml:catalog">'
        '<uri name="https://w3id.org/confab/gallery" uri="gallery.ttl"/></catalog>'
    )
    code, out, err = ask("plan", tmp_path / "scene.ttl")
    assert (code, out, err.count("\n")) == (MISUSE, "", 1)
    assert "WAY follows from axioms about its value property" in err


def test_conditions_may_be_nested_to_a_maximum_depth(tearoom: Path, ask: Ask) -> None:
    domain = tearoom.with_name("tearoom.ttl")
    change(domain, "c:precondition :B1_CARRY.free", "c:precondition :B1_CARRY.free, :N0")
    text = domain.read_text()
    for deep, wide, code in ((40, 1, YES), (60, 1, MISUSE), (20, 2, MISUSE)):
        more = []
        for i in range(deep):
            group = f":N{i} a c:AnyOf ; c:alternative :N{i + 1}, :B1_CARRY.free"
            more.append(group + (f", :A{i} . :A{i} a c:AllOf ; c:condition :N{i + 1} ." if wide == 2 else " ."))
        last = "c:AbsenceCondition ; c:ofClass :Item ; c:situationType :PLACE ; c:value :B1_CARRY.place ."
        domain.write_text("\n".join([text, *more, f":N{deep} a {last}"]))
        assert ask("plan", tearoom)[0] == code


def test_all_commands_handle_long_chains_and_circles_of_classes(tmp_path: Path, tearoom: Path, ask: Ask) -> None:
    chain = "".join(f":K{i} a owl:Class ; rdfs:subClassOf :K{i + 1} .\n" for i in range(1000))
    domain = tearoom.with_name("tearoom.ttl")
    text = domain.read_text()
    domain.write_text(text + ":Plate rdfs:subClassOf :K0 . " + chain + ":K1000 a owl:Class ; rdfs:subClassOf :Item .")
    assert ask("plan", tearoom)[0] == YES
    assert ask("learn", tearoom, "--memory", tmp_path / "m.ttl")[0] == YES
    code, _, said = ask("picture", tearoom, "--classes", "-o", tmp_path / "c.svg")
    assert code == MISUSE
    assert "too many classes to draw" in said
    domain.write_text(text + ":Item rdfs:subClassOf :Plate .")
    assert ask("learn", tearoom, "--memory", tmp_path / "n.ttl")[0] == YES
    assert ask("picture", tearoom, "--classes", "-o", tmp_path / "c.svg")[0] == YES


@pytest.mark.parametrize("name", ["µPlate", "Plate²", "ﬁsh", "Pl-ate", "Ⅷ", "class", "Pl_2d_ate"])
def test_classes_may_have_any_name(tearoom: Path, ask: Ask, name: str) -> None:
    for file in (tearoom, tearoom.with_name("tearoom.ttl")):
        file.write_text(re.sub(r"(?<!\w)d?:Plate\b", f"<https://example.org/tearoom#{name}>", file.read_text()))
    assert ask("plan", tearoom)[0] == YES


def test_dollar_signs_in_labels_are_drawn(tmp_path: Path, tearoom: Path, ask: Ask) -> None:
    change(tearoom.with_name("tearoom.ttl"), '"the item is dirty"', '"costs $5 or \\\\frac$"')
    assert ask("picture", tearoom, "--behavior", "B1_WASH", "-o", tmp_path / "a.svg")[0] == YES


# ---------------------------------------------------------------------------------------- other kinds of input


STEP = '{"behavior": "B1_WASH", "arguments": ["plate1"]'
STEPS = '{"steps": [' + STEP


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('{"steps": 5}', "it has no 'steps'"),
        ('{"steps": [{"behavior": "B1_WASH", "arguments": 5}]}', "'arguments' is 5; wanted a list"),
        (STEPS + ', "bindings": 5}]}', "'bindings' is 5; wanted an object"),
        (STEPS + ', "steps": {"a": 1}}]}', "'steps' is {\"a\": 1}; wanted a list"),
        ("[" * 100_000, "nested too deeply"),
        (STEPS + ', "id": ' + "9" * 5000 + "}]}", "not JSON"),
        (STEPS + ', "steps": [' + (STEP + ', "steps": [') * 200 + "]}" * 201 + "]}", "lies inside more than"),
        ("\ufeff", "not JSON"),
    ],
)
def test_a_text_that_is_no_plan_is_refused_in_one_line(
    tmp_path: Path, tearoom: Path, ask: Ask, text: str, said: str
) -> None:
    (tmp_path / "plan.json").write_text(text)
    code, _, err = ask("execute", tearoom, "--plan", tmp_path / "plan.json")
    assert (code, err.count("\n")) == (MISUSE, 1)
    assert said in err


def test_files_may_have_any_name(tmp_path: Path, tearoom: Path, ask: Ask, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert ask("execute", tearoom, "--save", "ep 1.ttl", "--memory", "m.ttl")[0] == MISUSE
    assert ask("learn", tearoom, "--memory", "my $ memory")[0] == YES
    assert ask("execute", tearoom, "--save", 'ep "1" <x>.ttl', "--memory", "my $ memory", "--learn")[0] == YES
    assert Path('ep "1" <x>.ttl').is_file()
    construct = "CONSTRUCT { ?s rdfs:label ?l } WHERE { ?s rdfs:label ?l }"
    assert ask("query", tearoom, construct, "-o", "my täble^.ttl")[0] == YES
    assert ask("generate", "served", "-o", "Küche 1.ttl")[0] == YES
    assert ask("validate", "Küche 1.ttl")[:2] == (YES, "nothing is wrong\n")


@pytest.mark.parametrize(
    "url", ["http://[bad", "http://[::1", "https://", "http://x y/", "http://x:99999999/", "http://\x1b"]
)
@pytest.mark.parametrize("command", ["plan", "fetch"])
def test_an_invalid_address_is_refused_in_one_line(tmp_path: Path, ask: Ask, command: str, url: str) -> None:
    code, _, err = ask(command, url, *(["--into", tmp_path] if command == "fetch" else []))
    assert (code, err.count("\n")) == (MISUSE, 1)


# ---------------------------------------------------------------------------------- queries in a separate process


NESTED = "SELECT * WHERE " + "{" * 3000 + "}" * 3000
CROSS = "SELECT * WHERE { ?a ?b ?c . ?d ?e ?f . ?g ?h ?i }"


@pytest.mark.parametrize(
    ("query", "more", "code", "said"),
    [
        (NESTED, [], MISUSE, "brings the SPARQL engine down"),
        (CROSS, [], GAVE_UP, "more than 100,000 rows"),
        (CROSS, ["--rows", "7"], GAVE_UP, "more than 7 rows"),
        (
            CROSS.replace("*", "(COUNT(*) AS ?n)"),
            ["--time-limit", "1"],
            GAVE_UP,
            "gave up after 1 s while answering a query",
        ),
        (CROSS + " ORDER BY ?a ?d ?g", ["--time-limit", "60"], GAVE_UP, "more than 2,000 MB of memory"),
        ("SELECT * WHERE { service <http://127.0.0.1:9/> { ?a ?b ?c } }", [], MISUSE, "asks another endpoint"),
    ],
)
def test_a_harmful_query_is_ended_with_one_line_and_harms_nothing_else(
    ask: Ask, query: str, more: list[str], code: int, said: str
) -> None:
    got, out, err = ask("query", "beverage-serving", query, *more)
    assert (got, out, err.count("\n")) == (code, "", 1)
    assert said in err


@pytest.mark.parametrize(
    ("limit", "pattern", "code", "said"),
    [
        ("-t 20", "?s a k:Cup", YES, ""),
        ("-v 1500000", "?s a k:Cup", YES, ""),
        ("-t 3", "?s ?a ?b . ?c ?d ?e . ?f ?g ?h", GAVE_UP, "gave up after 2 s at the query"),
        ("-v 1500000", "?s ?a ?b . ?c ?d ?e . ?f ?g ?h", GAVE_UP, "needs more than 1,536 MB of memory"),
    ],
)
def test_a_query_keeps_the_limits_of_its_shell_and_the_message_states_them(
    limit: str, pattern: str, code: int, said: str
) -> None:
    group = "?s ?a ?b ?c ?d ?e ?f ?g ?h" if limit.startswith("-v") else "?s"
    query = f"SELECT (COUNT(?s) AS ?n) WHERE {{ {pattern} }} GROUP BY {group}"
    run = f"ulimit {limit}; exec '{sys.executable}' -c 'from confab.start import main; main()' query beverage-serving '{query}'"
    env = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    done = subprocess.run(["/bin/sh", "-c", run], capture_output=True, text=True, check=False, env=env)
    assert (done.returncode, done.stderr.count("\n")) == (code, bool(said)), done.stderr
    assert said in done.stderr


def test_no_query_reaches_another_endpoint_unless_the_user_allows_it(tmp_path: Path) -> None:
    """A query that the check of keywords accepts still can't open a connection, unless the user allows it."""
    import http.server

    asked: list[str] = []

    class Handler(http.server.BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            asked.append(self.path)
            self.send_response(500)
            self.end_headers()

        def log_message(self, *_: Any) -> None:
            pass

    server = http.server.HTTPServer(("127.0.0.1", 0), Handler)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    from confab.reasoner.graph import query_process

    scene, url = confab.load("living-room"), f"<http://127.0.0.1:{server.server_port}/q>"
    query = f"SELECT * WHERE {{ SERVICE SILENT {url} {{ ?a ?b ?c }} }}"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(query_process, "SERVICE", re.compile("(?!)"))
        scene.query(query)
    assert not asked
    scene.query(query, query_process.QueryLimits(service=True))
    server.shutdown()
    server.server_close()
    assert asked == ["/q"]


@pytest.mark.parametrize("text", ['"SERVICE"', "<urn:SERVICE>", "?service", ":SERVICE", "'''a\nSERVICE'''"])
def test_the_word_service_is_allowed_in_texts_and_names_of_a_query(text: str) -> None:
    from confab.reasoner.graph.query_process import SERVICE, TEXTS

    assert SERVICE.search(TEXTS.sub(" ", f"SELECT * {{ ?a ?b {text} }}")) is None


# ------------------------------------------------------------------------------------------ checks of input


def test_an_internal_error_gives_one_line_and_a_log(ask: Ask, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object, **__: object) -> NoReturn:
        raise KeyError("no\nsuch\x1b[2J thing")

    monkeypatch.setattr("confab.scene.read", fail)
    code, out, err = ask("plan", "beverage-serving")
    assert (code, out, err.count("\n")) == (BUG, "", 1)
    assert "a fault of Confab" in err
    log = Path(err.rsplit(" with ", 1)[1].strip())
    assert "KeyError" in log.read_text()
    assert "Traceback" in log.read_text()
    log.unlink()


@pytest.mark.parametrize(("raised", "code"), [(MemoryError(), GAVE_UP), (KeyboardInterrupt(), INTERRUPTED)])
def test_limits_and_interrupts_have_codes_of_their_own(
    ask: Ask, monkeypatch: pytest.MonkeyPatch, raised: BaseException, code: int
) -> None:
    def fail(*_: object, **__: object) -> NoReturn:
        raise raised

    monkeypatch.setattr("confab.scene.read", fail)
    got, out, err = ask("plan", "beverage-serving")
    assert (got, out, err.strip().count("\n")) == (code, "", 0)


@pytest.mark.parametrize(
    ("where", "said"), [(">&-", "stdout is closed"), (">/dev/full", "stdout: No space left"), ("2>&-", ""), ("| :", "")]
)
def test_streams_may_be_closed_or_full(tmp_path: Path, where: str, said: str) -> None:
    run = f'"{sys.executable}" -c "from confab.cli import main; main()" plan living-room {where}'
    done = subprocess.run(
        ["/bin/sh", "-c", run],
        capture_output=True,
        text=True,
        cwd=tmp_path,
        check=False,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
    )
    assert "Traceback" not in done.stderr
    assert "Exception ignored" not in done.stderr
    assert said in done.stderr
    assert done.returncode == (MISUSE if said else YES)


def test_no_control_character_is_echoed(ask: Ask) -> None:
    code, _, err = ask("plan", "beverage-serving", "--goal", "a\x1b[2J\x07 b\r\nc")
    assert code == MISUSE
    assert err.strip().isprintable()
    assert "\\x1b" in err


def test_json_output_contains_only_standard_json_numbers(tmp_path: Path, tearoom: Path, ask: Ask) -> None:
    code, out, _ = ask("plan", tearoom, "--optimal", "--json")
    assert code == YES
    json.loads(out, parse_constant=lambda word: pytest.fail(f"{word} is no JSON"))


# -------------------------------------------------------------------------------------------- a single deadline


@pytest.mark.parametrize(("mode", "objects"), [("guarded", 400), ("paper", 120)])
def test_the_time_limit_holds_from_the_first_step_on(tmp_path: Path, ask: Ask, mode: str, objects: int) -> None:
    write_scene(tmp_path / "s.ttl", "served", objects, 2, 0, 0)
    code, out, err = ask("plan", tmp_path / "s.ttl", "--time-limit", "0.05", "--mode", mode)
    assert (code, out, err.count("\n")) == (GAVE_UP, "", 1)
    assert re.search("gave up after 0.05 s while .*--time-limit", err)


def test_an_uninterruptible_step_is_ended_shortly_after_the_time_limit(
    capsys: pytest.CaptureFixture[str],
) -> None:
    codes: list[int] = []
    ending = cast("Ending", codes.append)
    with ended_by(Deadline.after(0.1), ending):
        sleep(0.5)
    assert codes == [GAVE_UP]
    assert "gave up after 0.1 s, within a step" in capsys.readouterr().err
    with ended_by(Deadline.after(0.2), ending), ended_by(Deadline(), ending), ended_by(Deadline.after(0.0), None):
        pass
    sleep(0.4)
    assert codes == [GAVE_UP]


def test_the_check_of_a_scene_before_planning_keeps_the_time_limit(
    tearoom: Path, ask: Ask, monkeypatch: pytest.MonkeyPatch
) -> None:
    looked = []

    def slowly(graph: KnowledgeGraph) -> NoReturn:
        looked.append(current().seconds)
        raise LimitError("gave up")

    monkeypatch.setattr("confab.reasoner.validation.validate.quick_errors", slowly)
    assert ask("plan", tearoom, "--time-limit", "60")[0] == YES
    assert looked == [60.0]


def test_a_time_limit_applies_only_to_its_own_call(tearoom: Path) -> None:
    scene = confab.load(tearoom)
    with pytest.raises(LimitError, match="gave up after 1e-09 s"):
        scene.plan(time_limit=1e-9)
    assert scene.plan().solved
    assert scene.plan(time_limit=60.0).solved
    with confab.within(0.0), pytest.raises(LimitError):
        confab.load(tearoom)


def test_a_fact_without_an_individual_is_refused(tmp_path: Path, ask: Ask) -> None:
    scene = tmp_path / "ferry.ttl"
    scene.write_text((Path(__file__).parents[2] / "docs" / "examples" / "ferry" / "ferry.ttl").read_text())
    change(scene, "c:situationType :MOORED ; c:about :west .", "c:situationType :MOORED .")
    code, _, err = ask("plan", scene)
    assert code == MISUSE
    assert "a fact about 0 individuals; MOORED is about 1" in err


def test_without_pybullet_all_but_physics_works_and_physics_reports_it(tmp_path: Path) -> None:
    new_domain("pouring", tmp_path / "p", bodies=True)
    scene, plan = tmp_path / "p" / "pouring-scene.ttl", tmp_path / "plan.json"
    confab.load(scene).plan().save(plan)
    code = """
import io, sys
from contextlib import redirect_stderr, redirect_stdout
sys.modules["pybullet"] = None
from confab.cli import main
for line in sys.stdin:
    out, err = io.StringIO(), io.StringIO()
    try:
        with redirect_stdout(out), redirect_stderr(err):
            main(line.split())
    except SystemExit as end:
        print(end.code, " ".join(err.getvalue().split()))
"""
    works = [f"plan {scene}", f"execute {scene}", f"validate {scene}", f"picture {scene} --classes -o {tmp_path}/a.svg"]
    works.append(f"run towers-small -o {tmp_path}/out")
    needs = [
        f"run {scene} --no-video",
        f"verify {scene} {plan}",
        f"execute {scene} --world pybullet",
        f"picture {scene} -o {tmp_path}/t.png",
    ]
    done = subprocess.run(
        [sys.executable, "-c", code], input="\n".join(works + needs), capture_output=True, text=True, check=True
    )
    answers = done.stdout.splitlines()
    assert [answer[0] for answer in answers] == ["0"] * 5 + ["2"] * 4, done.stdout
    assert all("this needs physics, and PyBullet isn't installed" in answer for answer in answers[5:])
    assert scene.with_name("pouring-scene.reach.ttl").is_file()


def test_the_main_job_opens_no_socket(tmp_path: Path) -> None:
    code = """
import sys
def blocked(event, arguments):
    if event.startswith("socket.") and event not in ("socket.__new__", "socket.gethostname"):
        raise PermissionError(f"{event} {arguments}")
sys.addaudithook(blocked)
import socket
try:
    socket.create_connection(("127.0.0.1", 9))
except PermissionError:
    from confab.cli import main
    main(["run", "one-arm-serving", "--no-video", "--out", sys.argv[1]])
"""
    alone = subprocess.run(["unshare", "-rn", "true"], capture_output=True, check=False).returncode == 0
    command = [*(["unshare", "-rn"] if alone else []), sys.executable, "-c", code, str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "report.html").is_file()
    assert 'src="http' not in (tmp_path / "report.html").read_text()


def test_ctrl_c_during_imports_gives_one_line() -> None:
    code = """
import os, signal, sys
class Impatient:
    def find_spec(self, name, path=None, target=None):
        if name == "confab.cli":
            os.kill(os.getpid(), signal.SIGINT)
sys.meta_path.insert(0, Impatient())
from confab.start import main
main()
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (INTERRUPTED, "")
    assert done.stderr == "confab: interrupted; every file is unchanged or complete\n"


@pytest.mark.parametrize(
    ("command", "moment"),
    [
        ("run one-arm-serving --no-video --out . --memory m.ttl", "confab.sim.world:PhysicsWorld.execute"),
        ("run towers-small --no-video --out . --memory m.ttl", "confab.reasoner.files:os.fsync"),
        ("plan living-room -o p.json", "confab.planner.validation:validate"),
        ("plan living-room -o p.json", "confab.reasoner.files:os.fsync"),
        ("learn living-room --memory m.ttl", "confab.reasoner.files:os.fsync"),
        ("query living-room ASK{?s?p?o}", "confab.reasoner.graph.query_process:QueryWorker._send"),
        ("serve living-room --port 0", "socket:create_server"),
    ],
)
def test_ctrl_c_gives_one_line_and_leaves_no_partial_file(tmp_path: Path, command: str, moment: str) -> None:
    code = """
import os, pkgutil, signal, sys
owner, _, name = sys.argv.pop(1).replace(":", ".").rpartition(".")
owner = pkgutil.resolve_name(owner)
def impatient(*_, **__):
    os.kill(os.getpid(), signal.SIGINT)
setattr(owner, name, impatient)
from confab.start import main
main()
"""
    done = subprocess.run(
        [sys.executable, "-c", code, moment, *command.split()],
        capture_output=True,
        text=True,
        check=False,
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(Path(confab.__file__).parents[1])},
    )
    assert done.returncode == INTERRUPTED, done.stderr
    assert done.stderr.splitlines()[-1] == "confab: interrupted; every file is unchanged or complete"
    # click prints a line break after ^C
    assert all(line.startswith("confab: ") for line in done.stderr.splitlines() if line)
    assert not list(tmp_path.rglob("*.*"))


def test_ctrl_c_is_recognised_even_if_a_library_raises_another_error(capsys: pytest.CaptureFixture[str]) -> None:
    def call() -> NoReturn:
        try:
            os.kill(os.getpid(), signal.SIGINT)
        except KeyboardInterrupt:
            raise ImportError("numpy's arrays") from None
        raise AssertionError

    before = signal.getsignal(signal.SIGINT)
    with pytest.raises(SystemExit) as end:
        run_to_end(call)
    assert end.value.code == INTERRUPTED
    assert capsys.readouterr().err == "confab: interrupted; every file is unchanged or complete\n"
    assert signal.getsignal(signal.SIGINT) is before


def test_ctrl_c_after_the_end_changes_nothing(tmp_path: Path) -> None:
    code = """
import atexit, os, signal
atexit.register(lambda: os.kill(os.getpid(), signal.SIGINT))
from confab.start import main
main()
"""
    done = subprocess.run([sys.executable, "-c", code, "--version"], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (YES, "")


def test_a_clock_that_goes_backwards_loses_no_episode(tearoom: Path, ask: Ask, monkeypatch: pytest.MonkeyPatch) -> None:
    memory = tearoom.with_name("m.ttl")
    for year in (2040, 1990, 2026):
        monkeypatch.setattr("time.time", lambda year=year: (year - 1970) * 365.25 * 86400.0)
        if memory.is_file():
            os.utime(memory, (year * 1e6, year * 1e6))
        assert ask("learn", tearoom, "--memory", memory)[0] == YES
    assert sum(Memory.load(memory).experience.episodes.values()) == 3
