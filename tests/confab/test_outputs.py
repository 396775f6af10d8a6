"""No command replaces one of its inputs: an output replaces only a file of the kind that is about to be written."""

from collections.abc import Iterator
from importlib import import_module
from pathlib import Path

import pytest
from click import Command, Group

from benchmarks.outputs import DOORS, FILES, KIND_OF, LINKS, Door, answers, call, inside, prepare
from confab.cli import COMMANDS
from confab.commands.options import Output
from confab.reasoner.files import check_replaceable, write_whole
from confab.reasoner.kinds import GENERATED, MEMORY, PLAN, REPORT, kind_of, stamped


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("whole")
    prepare(folder)
    return folder


@pytest.mark.parametrize("door", DOORS, ids=lambda door: door.name)
def test_a_command_replaces_only_files_of_the_kind_that_it_writes(door: Door, whole: Path) -> None:
    there = (*FILES, *LINKS, "folder", "pipe", "read-only", "its own")
    for what, answer in answers(door, whole, there):
        replaced = (what == "its own" and not door.new) or KIND_OF.get(what) == door.kind
        assert answer in (("replaced", "made") if replaced else ("refused",)), (what, answer)


def outputs(name: str, command: Command) -> Iterator[set[str]]:
    """Yield the names of each output of a command, as the command line displays them."""
    if isinstance(command, Group):
        for word, one in command.commands.items():
            yield from outputs(f"{name} {word}", one)
    for parameter in command.params:
        if isinstance(parameter.type, Output) or "-o" in parameter.opts:
            yield {f"{name} {option}" if option.startswith("-") else name for option in parameter.opts}


def test_every_output_option_of_every_command_is_tested() -> None:
    tried = {door.name.removesuffix(f" {Path(door.file).name}") for door in DOORS}
    commands = {
        name: getattr(import_module(f"confab.commands.{module}"), it) for name, (module, it) in COMMANDS.items()
    }
    found = [names for name, command in commands.items() for names in outputs(name, command)]
    assert len(found) > 20
    assert [names for names in found if not names & tried] == []


def test_the_message_names_the_kinds_of_the_existing_and_the_new_file_and_the_remedy(
    whole: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scene = (whole / "tearoom-scene.ttl").read_text()
    with inside(whole), pytest.raises(OSError, match="is a scene or another ontology, which a report doesn't replace"):
        check_replaceable(Path("tearoom-scene.ttl"), REPORT)
    with inside(whole), pytest.raises(OSError, match="which a plan doesn't replace; give another name"):
        write_whole(Path("memory.ttl"), (whole / "plan.json").read_bytes())
    assert (whole / "tearoom-scene.ttl").read_text() == scene


@pytest.mark.parametrize("words", ["plan a.ttl --report a.ttl", "plan a.ttl --report r.html -o ./r.html"])
def test_one_file_is_refused_as_two_inputs_or_outputs_of_a_call(words: str, whole: Path, tmp_path: Path) -> None:
    with inside(tmp_path):
        Path("a.ttl").write_text("" if "r.html" in words else (whole / "generated.ttl").read_text())
        before = Path("a.ttl").read_bytes()
        assert call(words) == 2
        assert Path("a.ttl").read_bytes() == before and not Path("r.html").exists()


def test_a_converted_file_isnt_converted_onto_itself_also_not_through_a_hard_link(whole: Path, tmp_path: Path) -> None:
    with inside(whole):
        assert call("convert tearoom.ttl --behaviors sparql -o twice.ttl") == 0
        assert call("convert tearoom.ttl --behaviors sparql -o twice.ttl") == 0
        (whole / "thrice.ttl").hardlink_to(whole / "twice.ttl")
        assert call("convert twice.ttl --behaviors individuals -o thrice.ttl") == 2


def test_a_generated_file_is_not_replaced_after_it_was_edited(tmp_path: Path) -> None:
    file = tmp_path / "scene.ttl"
    write_whole(file, stamped(GENERATED, ["<urn:a> <urn:b> <urn:c> ."]))
    check_replaceable(file, GENERATED)
    file.write_text(file.read_text() + "<urn:d> <urn:b> <urn:c> .\n")
    with pytest.raises(OSError, match="is a scene or another ontology"):
        check_replaceable(file, GENERATED)
    write_whole(tmp_path / "second.ttl", stamped(GENERATED, ["<urn:a> <urn:b> <urn:c> ."]))
    text = (tmp_path / "second.ttl").read_text()
    (tmp_path / "second.ttl").write_text(text.replace("urn:c", "urn:d"))
    with pytest.raises(OSError, match="that was edited since"):
        check_replaceable(tmp_path / "second.ttl", GENERATED)


@pytest.mark.parametrize(
    ("name", "content", "told"),
    [
        ("a.html", "<!DOCTYPE html><html><title>mine</title></html>", "an HTML page from elsewhere"),
        ("a.json", '{"steps": []}', "JSON from elsewhere"),
        ("a.json", "[" * 100_000, "a text"),
        ("a.ttl", "<urn:a> <urn:b> " + "<<(" * 100_000, "a text"),
        ("a.ttl", "@prefix : <urn:a> . broken", "a scene or another ontology"),
        ("a.png", b"\x89PNG\r\n\x1a\n....", "a picture from elsewhere"),
        ("a.mp4", b"\0\0\0\x20ftypisom", "a film from elsewhere"),
        ("a.bin", b"abc\0", "binary data"),
        ("a.pddl", "; mine\n(define (domain d))", "PDDL"),
        ("a.txt", "# notes\nof mine", "a text"),
        ("a.md", "notes", "a text"),
    ],
)
def test_foreign_files_are_named_by_their_kind(tmp_path: Path, name: str, content: str | bytes, told: str) -> None:
    file = tmp_path / name
    file.write_bytes(content if isinstance(content, bytes) else content.encode())
    found = kind_of(file)
    assert str(found) == told
    for kind in (REPORT, PLAN, MEMORY):
        with pytest.raises(OSError, match="doesn't replace"):
            check_replaceable(file, kind)


def test_rows_replace_rows_of_the_same_columns(tmp_path: Path) -> None:
    for name, first, again, other in (
        ("a.csv", "x,y\n1,2\n", "x,y\n", "x,z\n1,2\n"),
        ("a.tsv", "?x\t?y\n1\t2\n", "?x\t?y\n", "?x\n1\n"),
        ("a.txt", "x  y\n1  2\n", "x   y\nlong  2\n", "x\n"),
        ("a.json", '[{"x": "1"}]', "[]", '[{"z": "1"}]'),
    ):
        file = tmp_path / name
        write_whole(file, first)
        with pytest.raises(OSError, match="is rows of a query"):
            write_whole(file, other)
        assert file.read_text() == first
        write_whole(file, again)
        assert file.read_text() == again
