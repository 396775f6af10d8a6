"""Experience outlives its process: files in any layout, crashes, other robots at the same endpoint; and broken files say so."""

import contextlib
import re
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
import rdflib

from reasoner.graph.knowledge import KnowledgeError
from reasoner.memory.counts import Candidate, Conclusion, Decision, Experience, Pattern
from reasoner.memory.counts_file import load, pull, push, save
from reasoner.names import Names

NAMES = Names(f"https://x.org/k#{name}" for name in ("B1_MOVE", "B1_POUR", "Cup", "Bottle"))
DOMAIN = "https://x.org/k"


def lived(replica: str, episodes: int) -> Experience:
    experience = Experience(replica)
    for number in range(episodes):
        chosen = Candidate(
            Conclusion("B1_MOVE", ("Cup",)), (("object · goal LOCATION", "unmet"), ('odd "fact": \\', "a:b"))
        )
        other = Candidate(
            Conclusion("B1_POUR", ("Bottle", "Cup")), (("n", str(number % 3)),), (("source", "bottle1"),), ("source",)
        )
        alike = Candidate(other.conclusion, other.pattern, (("source", "bottle2"),), ("source",))
        experience.learn([Decision(chosen, (other,)), Decision(other, (alike,), number % 2 == 0)])
    return experience


def test_experience_survives_the_file_in_our_layout_and_in_any_other(tmp_path: Path) -> None:
    experience = lived("robot", 4)
    save(tmp_path / "ours.ttl", experience, NAMES, DOMAIN)
    rdflib.Graph().parse(tmp_path / "ours.ttl").serialize(tmp_path / "theirs.ttl")
    assert load(tmp_path / "ours.ttl", NAMES) == experience
    assert load(tmp_path / "theirs.ttl", NAMES) == experience


def older(text: str, pattern: Pattern) -> str:
    """Return a memory of one pattern as it was written before facts were individuals."""
    facts = " | ".join(f"{fact}: {value}" for fact, value in pattern)
    text = re.sub(r"m:fact_\w+ a [^\n]*\n", "", text).replace(":memoryFormat 3", ":memoryFormat 2")
    return re.sub(r":Pattern ; [^\n]*\n", f':Pattern ; :facts "{facts}" .\n', text)


def test_facts_of_a_pattern_can_be_asked_for(tmp_path: Path) -> None:
    experience = Experience("robot")
    facts = tuple((f"object · goal LOCATION {number}", str(number % 3)) for number in range(12))
    shown = ('object "is" \\', "Cup, or: none"), ("first", "")
    for pattern in (facts, facts[::-1], shown, ()):
        experience.learn([Decision(Candidate(Conclusion("B1_MOVE", ("Cup",)), pattern))])
    save(tmp_path / "now.ttl", experience, NAMES, DOMAIN)
    assert load(tmp_path / "now.ttl", NAMES) == experience
    graph = rdflib.Graph().parse(tmp_path / "now.ttl")
    asked = """PREFIX : <https://w3id.org/confab/core#> SELECT ?what ?answer WHERE {
      ?counter :associatedWith ?pattern . ?pattern :fact ?fact . ?fact :asks ?what ; :answer ?answer ; :index 0 } ORDER BY ?what"""
    assert [tuple(map(str, row)) for row in graph.query(asked) if isinstance(row, tuple)] == [
        shown[0],
        facts[0],
        facts[-1],
    ]
    labels = graph.query("SELECT ?l WHERE { ?p a <https://w3id.org/confab/core#Pattern> ; rdfs:label ?l } ORDER BY ?l")
    assert "object · goal LOCATION 0: 0, object · goal LOCATION 1: 1, object · goal LOCATION 2: 2 and 9 more" in {
        str(row[0]) for row in labels if isinstance(row, tuple)
    }
    graph.serialize(tmp_path / "theirs.ttl")  # any other layout
    assert load(tmp_path / "theirs.ttl", NAMES) == experience


def test_the_first_files_of_this_format_are_read_and_spoilt_ones_say_so(tmp_path: Path) -> None:
    experience = Experience("robot")
    pattern = (("object · goal LOCATION", "unmet"), ("object is", "Cup"))
    experience.learn([Decision(Candidate(Conclusion("B1_MOVE", ("Cup",)), pattern))])
    save(tmp_path / "now.ttl", experience, NAMES, DOMAIN)
    text = older((tmp_path / "now.ttl").read_text(), pattern)
    for between, name in ((r"\n", "first.ttl"), ("n", "spoilt.ttl")):  # the OWL API made a plain n of the line breaks
        (tmp_path / name).write_text(text.replace("unmet | object", f"unmet{between}object"))
    assert load(tmp_path / "first.ttl", NAMES) == experience
    with pytest.raises(KnowledgeError, match="can't be told apart"):
        load(tmp_path / "spoilt.ttl", NAMES)


def test_the_union_of_two_files_is_a_file_of_both_memories(tmp_path: Path) -> None:
    one, two = lived("one", 3), lived("two", 2)
    save(tmp_path / "one.ttl", one, NAMES, DOMAIN)
    save(tmp_path / "two.ttl", two, NAMES, DOMAIN)
    (tmp_path / "both.ttl").write_text((tmp_path / "one.ttl").read_text() + (tmp_path / "two.ttl").read_text())
    one.merge(two)
    both = load(tmp_path / "both.ttl", NAMES)
    assert (both.counts, both.episodes) == (one.counts, one.episodes)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("<a> <b", "broken memory"),
        ("<a> <b> <c> .", "says no :memoryFormat"),
        ("<a> <https://w3id.org/confab/core#memoryFormat> 99 .", "format 99, wanted 3"),
    ],
)
def test_a_broken_foreign_or_newer_file_is_a_clear_error(tmp_path: Path, content: str, message: str) -> None:
    (tmp_path / "memory.ttl").write_text(content)
    with pytest.raises(KnowledgeError, match=message):
        load(tmp_path / "memory.ttl")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (r":chosen \d+ ", ":chosen -1 ", "wanted numbers from 0"),
        (r":chosen \d+ ", ":chosen 1" + 400 * "0" + " ", "wanted numbers from 0"),
        (r":learnsAs \S+", ":label 1", "doesn't say who learns into it"),
    ],
)
def test_counts_that_cant_be_and_nobody_who_learns_are_clear_errors(
    tmp_path: Path, old: str, new: str, message: str
) -> None:
    path = tmp_path / "memory.ttl"
    save(path, lived("robot", 2), NAMES, DOMAIN)
    text, count = re.subn(old, new, path.read_text())
    assert count
    path.write_text(text)
    with pytest.raises(KnowledgeError, match=message):
        load(path, NAMES)


def test_a_byte_order_mark_is_no_harm(tmp_path: Path) -> None:
    path = tmp_path / "memory.ttl"
    save(path, lived("robot", 2), NAMES, DOMAIN)
    path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes())
    assert len(load(path, NAMES)) == len(lived("robot", 2))


def test_a_file_cut_off_anywhere_is_an_error_or_whole(tmp_path: Path) -> None:
    experience = lived("robot", 2)
    path = tmp_path / "memory.ttl"
    save(path, experience, NAMES, DOMAIN)
    text = path.read_text()
    for length in range(400, len(text) - 1, 37):
        path.write_text(text[:length])
        with contextlib.suppress(KnowledgeError):
            assert len(load(path, NAMES)) <= len(experience)


def test_no_acknowledged_episode_is_lost_when_the_process_is_killed(tmp_path: Path) -> None:
    path = tmp_path / "memory.ttl"
    acknowledged = 0
    for number in range(5):
        process = subprocess.Popen(
            [sys.executable, "-m", "tests.reasoner.learner", str(path)],
            stdout=subprocess.PIPE,
            text=True,
            cwd=Path(__file__).parents[2],
        )
        assert process.stdout is not None
        first = process.stdout.readline()
        time.sleep(0.003 * number)
        process.send_signal(signal.SIGKILL)
        rest = process.stdout.read().splitlines()
        process.stdout.close()
        process.wait()
        acknowledged = max([acknowledged, int(first), *(int(line) for line in rest if line)])
        assert load(path, NAMES).episodes["robot"] >= acknowledged


@pytest.fixture
def endpoint() -> Iterator[str]:
    server = Path(sys.executable).with_name("oxigraph")
    if not server.is_file() and shutil.which("oxigraph") is None:
        pytest.skip("no oxigraph server")
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    process = subprocess.Popen(
        [str(server), "serve", "--bind", f"127.0.0.1:{port}"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    for _ in range(200):
        with socket.socket() as probe:
            if probe.connect_ex(("127.0.0.1", port)) == 0:
                break
        time.sleep(0.05)
    yield f"http://127.0.0.1:{port}/query"
    process.kill()
    process.wait()


def test_robots_that_write_to_one_endpoint_lose_nothing(endpoint: str) -> None:
    robots = [lived("one", 3), lived("two", 2)]
    for robot in robots:
        push(endpoint, robot, NAMES, DOMAIN)
    for robot in robots:
        robot.learn([])
        push(endpoint, robot, NAMES, DOMAIN)
    found = pull(endpoint, NAMES, replica="reader")
    expected = Experience("reader")
    for robot in robots:
        expected.merge(robot)
    assert found == expected


def test_an_endpoint_that_is_not_there_is_a_clear_error() -> None:
    with pytest.raises(KnowledgeError, match="no memory there"):
        pull("http://127.0.0.1:9/query", timeout=2)
